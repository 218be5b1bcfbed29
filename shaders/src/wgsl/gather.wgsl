// Puts what was rendered over nothing behind what the pixels of a tile have gathered.

struct Tile {
    // Pixels.
    size: vec2u,
    // Whether this is the first part of the picture: 0 or 1.
    is_first: u32,
}

// Pixels per side of a workgroup.
const GROUP: u32 = 8;

@group(0) @binding(0) var<uniform> tile: Tile;
// Light, and the share of what is behind that it hides.
@group(0) @binding(1) var rendered: texture_2d<f32>;
// Of each pixel, the colour it has gathered from the front, and the share of light that still comes through.
@group(0) @binding(2) var<storage, read_write> gathered: array<vec4f>;

@compute @workgroup_size(GROUP, GROUP)
fn main(@builtin(global_invocation_id) pixel: vec3u) {
    if any(pixel.xy >= tile.size) {
        return;
    }
    let index = pixel.y * tile.size.x + pixel.x;
    var before = vec4f(0.0, 0.0, 0.0, 1.0);
    if tile.is_first == 0u {
        before = gathered[index];
    }
    let light = textureLoad(rendered, pixel.xy, 0);
    gathered[index] = vec4f(before.rgb + before.a * light.rgb, before.a * (1.0 - light.a));
}
