// Ends a tile for a picture that is read back.
//
// import ended

// Pixels per side of a workgroup.
const GROUP: u32 = 8;

@group(0) @binding(3) var<storage, read_write> picture: array<f32>;

@compute @workgroup_size(GROUP, GROUP)
fn main(@builtin(global_invocation_id) pixel: vec3u) {
    if any(pixel.xy >= tile.size) {
        return;
    }
    let color = color_of(pixel.xy);
    let index = 3u * (pixel.y * tile.size.x + pixel.x);
    picture[index] = color.r;
    picture[index + 1u] = color.g;
    picture[index + 2u] = color.b;
}
