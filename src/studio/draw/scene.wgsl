// The scene on the graphics card. Names and formulas equal those of `software.rs`.

struct View {
    // The point in the middle of the picture, mm.
    centre: vec2f,
    // Width and height of the picture, px.
    size: vec2f,
    // Pixels per millimetre.
    scale: f32,
}

@group(0) @binding(0) var<uniform> view: View;

fn to_px(mm: vec2f) -> vec2f {
    let d = (mm - view.centre) * view.scale;
    return 0.5 * view.size + vec2f(d.x, -d.y);
}

fn to_clip(px: vec2f) -> vec4f {
    let unit = 2.0 * px / view.size - 1.0;
    return vec4f(unit.x, -unit.y, 0.0, 1.0);
}

fn premultiplied(colour: vec4f) -> vec4f {
    return vec4f(colour.rgb * colour.a, colour.a);
}

// Filled triangles.

struct Area {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) colour: vec4f,
}

@vertex
fn corner(@location(0) at: vec2f, @location(1) colour: vec4f) -> Area {
    return Area(to_clip(to_px(at)), premultiplied(colour));
}

@fragment
fn triangle(area: Area) -> @location(0) vec4f {
    return area.colour;
}

// Lines and dots: a quad around each, and the ramp at its rim from the pixel's distance.

// Below this a line has no direction and is a dot, px.
const DOT = 1e-3;

struct Line {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) ends: vec4f,
    @location(1) @interpolate(flat) half: f32,
    @location(2) @interpolate(flat) colour: vec4f,
}

@vertex
fn quad(
    @builtin(vertex_index) index: u32,
    @location(0) start: vec2f,
    @location(1) stop: vec2f,
    @location(2) width: f32,
    @location(3) colour: vec4f,
) -> Line {
    let a = to_px(start);
    let b = to_px(stop);
    let length = distance(a, b);
    var axis = vec2f(1.0, 0.0);
    if length >= DOT {
        axis = (b - a) / length;
    }
    // Half a pixel for the ramp and half for the distance from a pixel's centre to its corner.
    let reach = 0.5 * width + 1.0;
    let across = select(-reach, reach, (index & 1u) == 1u) * vec2f(-axis.y, axis.x);
    let end = select(a - reach * axis, b + reach * axis, index > 1u);
    return Line(to_clip(end + across), vec4f(a, b), 0.5 * width, premultiplied(colour));
}

// How much of the unit interval around `x` lies between `low` and `high`.
fn overlap(x: f32, low: f32, high: f32) -> f32 {
    return max(0.0, min(x + 0.5, high) - max(x - 0.5, low));
}

// How much of a pixel a segment covers, 0 to 1.
fn segment_coverage(pixel: vec2f, a: vec2f, b: vec2f, half: f32) -> f32 {
    let length = distance(a, b);
    if length < DOT {
        return clamp(half + 0.5 - distance(pixel, a), 0.0, 1.0);
    }
    let axis = (b - a) / length;
    let r = pixel - a;
    let across = r.x * axis.y - r.y * axis.x;
    return overlap(across, -half, half) * overlap(dot(r, axis), 0.0, length);
}

@fragment
fn segment(line: Line) -> @location(0) vec4f {
    return line.colour * segment_coverage(line.clip.xy, line.ends.xy, line.ends.zw, line.half);
}
