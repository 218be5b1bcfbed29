// The end of a tile: what its pixels have gathered, before surfaces or the background.

struct Tile {
    // Pixels.
    size: vec2u,
    // Its first pixel in the target of whoever shows it.
    origin: vec2u,
    // The least and the largest colour that its parts can show.
    low: vec3f,
    // As numbers, 0 or 1: whether it has gathered anything, and whether there are surfaces.
    has_light: u32,
    high: vec3f,
    has_surfaces: u32,
    // What is behind where there are no surfaces.
    background: vec3f,
    // Pixels per axis that share what was gathered.
    stride: u32,
}

@group(0) @binding(0) var<uniform> tile: Tile;
// Of each pixel, the colour it has gathered from the front, and the share of light that still comes through.
@group(0) @binding(1) var<storage, read> gathered: array<vec4f>;
// Of each pixel, colour and depth.
@group(0) @binding(2) var surfaces: texture_2d<f32>;

// A colour beyond what is behind and what can be in front becomes the nearest between.
fn color_of(pixel: vec2u) -> vec3f {
    var behind = tile.background;
    if tile.has_surfaces != 0u {
        behind = textureLoad(surfaces, pixel, 0).rgb;
    }
    if tile.has_light == 0u {
        return behind;
    }
    let place = pixel / tile.stride;
    let light = gathered[place.y * ((tile.size.x + tile.stride - 1u) / tile.stride) + place.x];
    return clamp(light.rgb + light.a * behind, min(tile.low, behind), max(tile.high, behind));
}
