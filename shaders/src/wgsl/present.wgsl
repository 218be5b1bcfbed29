// Ends a tile for a picture that stays on the device: in a texture of somebody else's, of any format that can be drawn to.
//
// import ended

// One triangle over the whole tile.
@vertex
fn corner(@builtin(vertex_index) vertex: u32) -> @builtin(position) vec4f {
    return vec4f(select(-1.0, 3.0, vertex == 1u), select(-1.0, 3.0, vertex == 2u), 0.0, 1.0);
}

@fragment
fn pixel(@builtin(position) position: vec4f) -> @location(0) vec4f {
    return vec4f(color_of(vec2u(position.xy) - tile.origin), 1.0);
}
