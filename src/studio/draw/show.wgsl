// Shows a drawn scene in the window, pixel for pixel.

@group(0) @binding(0) var picture: texture_2d<f32>;

struct Place {
    @builtin(position) clip: vec4f,
    // 0 to 1 from the upper left corner of the pane.
    @location(0) uv: vec2f,
}

// One triangle that covers the whole pane.
@vertex
fn cover(@builtin(vertex_index) index: u32) -> Place {
    let uv = 2.0 * vec2f(f32(index & 1u), f32(index >> 1u));
    return Place(vec4f(2.0 * uv.x - 1.0, 1.0 - 2.0 * uv.y, 0.0, 1.0), uv);
}

fn texel(uv: vec2f) -> vec4f {
    let size = textureDimensions(picture);
    return textureLoad(picture, min(vec2u(uv * vec2f(size)), size - 1u), 0);
}

@fragment
fn to_gamma_target(place: Place) -> @location(0) vec4f {
    return texel(place.uv);
}

// The window encodes what it is given, so it is given decoded light.
@fragment
fn to_linear_target(place: Place) -> @location(0) vec4f {
    let stored = texel(place.uv);
    let low = stored.rgb / 12.92;
    let high = pow((stored.rgb + 0.055) / 1.055, vec3f(2.4));
    return vec4f(select(high, low, stored.rgb <= vec3f(0.04045)), stored.a);
}
