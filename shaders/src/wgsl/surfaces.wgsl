// Draws opaque surfaces before all else: the nearest of each pixel as its colour and depth, in one texture that other
// shaders read. What they draw ends there.
//
// Corners are relative to an origin near them, and depths to that of the nearest of them, both chosen in f64: so 32 bits
// do however far the eye is. The depth of a fragment is where its ray meets the triangle's plane; nothing is
// interpolated but the depth for the comparison, which is 1 at the nearest corner in front of the eye and 0 at the
// farthest.

// import unit

struct Frame {
    // A place and 1 to clip coordinates.
    clip_x: vec4f,
    clip_y: vec4f,
    clip_z: vec4f,
    clip_w: vec4f,
    // A place and 1 to its depth.
    depth: vec4f,
    // Where the ray of image point (x, y) of the tile has depth 0: `start + x * start_dx + y * start_dy`. Its way per
    // depth likewise.
    start: vec3f,
    start_dx: vec3f,
    start_dy: vec3f,
    toward: vec3f,
    toward_dx: vec3f,
    toward_dy: vec3f,
}

// The least share of its colour that a surface shows: as the scene has it.
const AMBIENT: f32 = 0.25;

@group(0) @binding(0) var<uniform> frame: Frame;
// Nine numbers of each triangle.
@group(0) @binding(1) var<storage, read> corners: array<f32>;
// Of each mesh.
@group(0) @binding(2) var<storage, read> colors: array<vec4f>;

struct Vertex {
    @builtin(position) position: vec4f,
    // Across the triangle, of length 1, or none where it has no area.
    @location(0) @interpolate(flat) normal: vec3f,
    @location(1) @interpolate(flat) corner: vec3f,
    // Least and greatest of the corners.
    @location(2) @interpolate(flat) depths: vec2f,
    @location(3) @interpolate(flat) color: vec3f,
}

fn corner_of(triangle: u32, corner: u32) -> vec3f {
    let at = 9u * triangle + 3u * corner;
    return vec3f(corners[at], corners[at + 1u], corners[at + 2u]);
}

@vertex
fn corner(@builtin(vertex_index) vertex: u32, @builtin(instance_index) mesh: u32) -> Vertex {
    let triangle = vertex / 3u;
    let a = corner_of(triangle, 0u);
    let b = corner_of(triangle, 1u);
    let c = corner_of(triangle, 2u);
    let place = vec4f(corner_of(triangle, vertex % 3u), 1.0);
    let depths = vec3f(dot(frame.depth, vec4f(a, 1.0)), dot(frame.depth, vec4f(b, 1.0)), dot(frame.depth, vec4f(c, 1.0)));
    var out: Vertex;
    out.position = vec4f(
        dot(frame.clip_x, place), dot(frame.clip_y, place), dot(frame.clip_z, place), dot(frame.clip_w, place),
    );
    out.normal = unit(cross(unit(b - a), unit(c - a)));
    out.corner = a;
    out.depths = vec2f(min(depths.x, min(depths.y, depths.z)), max(depths.x, max(depths.y, depths.z)));
    out.color = colors[mesh].rgb;
    return out;
}

// Colour and depth of the surface.
@fragment
fn surface(in: Vertex) -> @location(0) vec4f {
    let at = in.position.xy;
    let start = frame.start + at.x * frame.start_dx + at.y * frame.start_dy;
    let toward = frame.toward + at.x * frame.toward_dx + at.y * frame.toward_dy;
    let approach = dot(in.normal, toward);
    let met = dot(in.normal, in.corner - start) / approach;
    // Along a triangle that is seen on edge any depth of its own is right.
    let depth = select(in.depths.x, clamp(met, in.depths.x, in.depths.y), abs(approach) > 0.0);
    let cosine = min(abs(approach) / length(toward), 1.0);
    return vec4f(in.color * (AMBIENT + (1.0 - AMBIENT) * cosine), depth);
}
