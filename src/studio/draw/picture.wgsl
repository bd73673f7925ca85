// The quick way to a picture on the graphics card. Names and formulas are those of `picture/quick`, which
// is the specification: first the light of beams at the points of lattices, then the sum of the lattices
// of a block at its pixels, by cubic B-splines.

// A beam of one colour in a block: its weight, and the paintings that it looks at.
struct Beam {
    weight: array<f32, 6>,
    first_look: u32,
    end_look: u32,
}

// A beam's view of a painting: its place in texels, and the blur.
struct Look {
    u: array<f32, 6>,
    v: array<f32, 6>,
    tap: array<f32, 2>,
    coarser: f32,
    taps: u32,
    // The first texel, the columns and the rows of the finer and of the coarser level.
    fine: array<u32, 3>,
    coarse: array<u32, 3>,
    padding: array<u32, 2>,
}

// The points of one spacing and one colour in a block.
struct Lattice {
    first_beam: u32,
    end_beam: u32,
    // The first of its values.
    values: u32,
    columns: u32,
    rows: u32,
    step: u32,
    // The pixels of the block.
    width: u32,
    height: u32,
    color: u32,
    background: f32,
}

// A rectangle of pixels.
struct Block {
    left: u32,
    top: u32,
    width: u32,
    height: u32,
    first_lattice: u32,
    end_lattice: u32,
    // The light that comes from no plane in front of the lens.
    open: array<f32, 3>,
}

// A lattice or a block, and the first of its points that a group works on.
struct Share {
    owner: u32,
    first: u32,
}

@group(0) @binding(0) var<storage, read> beams: array<Beam>;
@group(0) @binding(1) var<storage, read> looks: array<Look>;
@group(0) @binding(2) var<storage, read> texels: array<vec2<f32>>;
@group(0) @binding(3) var<storage, read> sources: array<Lattice>;
@group(0) @binding(4) var<storage, read> source_shares: array<Share>;
@group(0) @binding(5) var<storage, read_write> sums: array<f32>;

@group(0) @binding(0) var<storage, read> blocks: array<Block>;
@group(0) @binding(1) var<storage, read> lattices: array<Lattice>;
@group(0) @binding(2) var<storage, read> values: array<f32>;
@group(0) @binding(3) var<storage, read> block_shares: array<Share>;
@group(0) @binding(4) var<storage, read_write> pixels: array<f32>;
@group(0) @binding(5) var<uniform> picture: vec4<u32>;

const GROUP: u32 = 64u;

fn quadratic(q: array<f32, 6>, s: f32, t: f32) -> f32 {
    let a = q[0] + t * (q[2] + t * q[5]);
    let b = q[1] + t * q[4];
    return a + s * (b + s * q[3]);
}

// The place of a pixel in a block, -1 to 1.
fn relative(at: f32, count: u32) -> f32 {
    let middle = 0.5 * (f32(count) - 1.0);
    return (at - middle) / max(middle, 0.5);
}

// Light times cover, and cover, between the middles of texels.
fn tent(level: array<u32, 3>, place: vec2<f32>) -> vec2<f32> {
    let last = vec2<u32>(level[1] - 1u, level[2] - 1u);
    let at = clamp(place, vec2<f32>(0.0), vec2<f32>(last));
    let low = vec2<u32>(at);
    let next = min(low + vec2<u32>(1u), last);
    let part = at - vec2<f32>(low);
    let below = level[0] + low.y * level[1];
    let above = level[0] + next.y * level[1];
    let a = texels[below + low.x];
    let b = texels[below + next.x];
    let c = texels[above + low.x];
    let d = texels[above + next.x];
    let first = a + part.x * (b - a);
    let second = c + part.x * (d - c);
    return first + part.y * (second - first);
}

// The offset and the share of a tap.
fn tap_of(taps: u32, i: u32) -> vec2<f32> {
    switch taps {
        case 1u: { return vec2<f32>(0.0, 1.0); }
        case 2u: { return vec2<f32>(f32(i) - 0.5, 0.5); }
        case 3u: { return vec2<f32>(f32(i) - 1.0, select(0.25, 0.5, i == 1u)); }
        default: {
            return vec2<f32>(f32(i) - 1.5, select(0.125, 0.375, i == 1u || i == 2u));
        }
    }
}

fn mean(look: Look, s: f32, t: f32) -> vec2<f32> {
    let place = vec2<f32>(quadratic(look.u, s, t), quadratic(look.v, s, t));
    let tap = vec2<f32>(look.tap[0], look.tap[1]);
    var sum = vec2<f32>(0.0);
    for (var i = 0u; i < look.taps; i++) {
        let offset = tap_of(look.taps, i);
        let at = place + offset.x * tap;
        var found = tent(look.fine, at);
        if look.coarser > 0.0 {
            let coarse = tent(look.coarse, 0.5 * at - vec2<f32>(0.25));
            found += look.coarser * (coarse - found);
        }
        sum += offset.y * found;
    }
    return sum;
}

@compute @workgroup_size(64)
fn sum_beams(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = group.y * groups.x + group.x;
    if index >= arrayLength(&source_shares) {
        return;
    }
    let share = source_shares[index];
    let lattice = sources[share.owner];
    let point = share.first + lane;
    if point >= lattice.columns * lattice.rows {
        return;
    }
    let step = f32(lattice.step);
    let first = select(-step, 0.0, lattice.step == 1u);
    let s = relative(first + step * f32(point % lattice.columns), lattice.width);
    let t = relative(first + step * f32(point / lattice.columns), lattice.height);
    var sum = 0.0;
    for (var b = lattice.first_beam; b < lattice.end_beam; b++) {
        var light = 0.0;
        var open = 1.0;
        for (var l = beams[b].first_look; l < beams[b].end_look; l++) {
            let found = mean(looks[l], s, t);
            light += open * found.x;
            open *= 1.0 - found.y;
        }
        let weight = max(quadratic(beams[b].weight, s, t), 0.0);
        sum += weight * (light + open * lattice.background);
    }
    sums[lattice.values + point] = sum;
}

// The weights of four points of a lattice at a place between the two in the middle.
fn spline(f: f32) -> vec4<f32> {
    let g = 1.0 - f;
    let inner = vec2<f32>(4.0 - 6.0 * f * f + 3.0 * f * f * f, 4.0 - 6.0 * g * g + 3.0 * g * g * g);
    return vec4<f32>(g * g * g, inner, f * f * f) / 6.0;
}

fn between(lattice: Lattice, x: u32, y: u32) -> f32 {
    if lattice.step == 1u {
        return values[lattice.values + y * lattice.columns + x];
    }
    let across = spline(f32(x % lattice.step) / f32(lattice.step));
    let along = spline(f32(y % lattice.step) / f32(lattice.step));
    let from_here = lattice.values + (y / lattice.step) * lattice.columns + x / lattice.step;
    var sum = 0.0;
    for (var j = 0u; j < 4u; j++) {
        let line = from_here + j * lattice.columns;
        let row = vec4<f32>(values[line], values[line + 1u], values[line + 2u], values[line + 3u]);
        sum += along[j] * dot(across, row);
    }
    return sum;
}

@compute @workgroup_size(64)
fn sum_lattices(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let index = group.y * groups.x + group.x;
    if index >= arrayLength(&block_shares) {
        return;
    }
    let share = block_shares[index];
    let block = blocks[share.owner];
    let point = share.first + lane;
    if point >= block.width * block.height {
        return;
    }
    let x = point % block.width;
    let y = point / block.width;
    var sum = vec3<f32>(block.open[0], block.open[1], block.open[2]);
    for (var l = block.first_lattice; l < block.end_lattice; l++) {
        let lattice = lattices[l];
        sum[lattice.color] += between(lattice, x, y);
    }
    let pixel = 3u * ((block.top + y) * picture.x + block.left + x);
    pixels[pixel] = sum.x;
    pixels[pixel + 1u] = sum.y;
    pixels[pixel + 2u] = sum.z;
}
