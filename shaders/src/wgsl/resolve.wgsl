// Copies a tile that was rendered to its place in a band of the picture, over surfaces if there are any. A colour
// beyond what is behind and what can be in front becomes the nearest between.

struct Tile {
    // Its first pixel in the band, and its pixels.
    origin: vec2u,
    size: vec2u,
    // The least and the largest colour that is drawn.
    low: vec3f,
    // Pixels from left to right of the band.
    band_width: u32,
    high: vec3f,
    // What is behind where there are no surfaces.
    background: vec3f,
}

// Whether the tile was rendered over nothing, and comes over surfaces.
override HAS_SURFACES: bool = false;

// Pixels per side of a workgroup.
const GROUP: u32 = 8;

@group(0) @binding(0) var<uniform> tile: Tile;
@group(0) @binding(1) var rendered: texture_2d<f32>;
@group(0) @binding(2) var<storage, read_write> picture: array<f32>;
// Of each pixel of the tile, colour and depth.
@group(0) @binding(3) var surfaces: texture_2d<f32>;

@compute @workgroup_size(GROUP, GROUP)
fn main(@builtin(global_invocation_id) pixel: vec3u) {
    if any(pixel.xy >= tile.size) {
        return;
    }
    var color = textureLoad(rendered, pixel.xy, 0);
    var behind = tile.background;
    if HAS_SURFACES {
        behind = textureLoad(surfaces, pixel.xy, 0).rgb;
        color += vec4f((1.0 - color.a) * behind, 0.0);
    }
    color = vec4f(clamp(color.rgb, min(tile.low, behind), max(tile.high, behind)), 1.0);
    let place = tile.origin + pixel.xy;
    let index = 3u * (place.y * tile.band_width + place.x);
    picture[index] = color.r;
    picture[index + 1u] = color.g;
    picture[index + 2u] = color.b;
}
