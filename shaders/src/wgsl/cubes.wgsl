// Draws cubes as fans of triangles, by the method and the tables of crate `volery-cubefan`.
//
// An instance is a batch of cubes, a cube ten vertices under one list of indices. Each vertex finds the planes of
// its cube relative to the eye, from them which faces are toward the eye, and its own place and share of the ray.
// Planes are whole numbers until the eye is taken off them, so neighbours agree about the face that they share.
//
// Lengths are in units of half the volume's widest spacing, positions relative to the frame's anchor: the eye, or,
// per axis, a plane of the volume where the eye is far from it. Parallel rays are the case in which all places see
// the eye in the same way.

// import opacity

struct Frame {
    // A position and 1 to clip coordinates, whose depth is half their w: there is no near plane.
    clip_x: vec4f,
    clip_y: vec4f,
    clip_w: vec4f,
    // A position and 1 to its depth along the view, from that of the surfaces on; without these from the plane where
    // parallel rays start on, and zero in perspective.
    depth: vec4f,
    // Directions of parallel rays, a unit vector, or zero in perspective.
    way: vec3f,
    is_parallel: u32,
    // The lattice plane at or below the eye, and how far above it the eye is.
    eye_whole: vec3i,
    unit_length: f32,
    eye_fraction: vec3f,
    // Between neighbouring lattice planes.
    step: vec3f,
    // As the eye's.
    anchor_whole: vec3i,
    anchor_fraction: vec3f,
    anchor_from_eye: vec3f,
    // The lattice plane where the domain ends.
    end: vec3i,
    // The image point before the eye, and the slope of rays per pixel; no slope in parallel.
    center: vec2f,
    slope_per_pixel: vec2f,
    // The depth of the plane through the eye, and lengths in lengths of the world.
    eye_depth: f32,
    units_per_length: f32,
}

struct Cube {
    // Indices along x (low half) and y, then along z, and the level.
    index_xy: u32,
    index_z_level: u32,
    red: f32,
    green: f32,
    blue: f32,
    extinction: f32,
}

// Whether the length of the ray is exact, or interpolated on the screen.
override IS_EXACT: bool = true;
// Whether rays end at surfaces.
override HAS_SURFACES: bool = false;

// Cubes of an instance: their vertices are numbered by 16 bits.
const BATCH: u32 = 6553;
const NUM_VERTICES: u32 = 10;
const NUM_INNER: u32 = 4;
const CORNER_BITS: u32 = 3;
const CLASS_SHIFT: u32 = 30;

// Planes nearer to the eye than this go through it: 2^-60.
const TINY: f32 = 8.67361737988403547e-19;
// The greatest extinction, for infinity may not be multiplied.
const MAX_EXTINCTION: f32 = 1e38;

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> cubes: array<Cube>;
// By sides and first axis, as in `volery_cubefan::table::ASPECTS`: the corners of the ten vertices in 3 bits each
// from the lowest, and the class above them.
@group(0) @binding(2) var<storage, read> aspects: array<u32>;
// Of each pixel of the tile, colour and depth in the world's lengths.
@group(0) @binding(3) var surfaces: texture_2d<f32>;

struct Vertex {
    @builtin(position) position: vec4f,
    // Of the way from the eye to the exit: the part before the cube and the part in it. Then the entry's depth. Then thickness times depth, which divided by the depth is linear on the
    // screen. (What is interpolated linearly by declaration is wrong on llvmpipe in triangles that are clipped.)
    @location(0) shares: vec4f,
    // Colour and extinction; that is below zero where a cube reaches behind the eye, for then nothing is linear on
    // the screen, and the length is exact.
    @location(1) @interpolate(flat) matter: vec4f,
}

// A bound of a cube, clipped to the domain: twice the finest-sample coordinates.
fn lattice_plane(index: u32, level: u32, end: i32) -> i32 {
    let shift = min(level + 1u, 31u);
    if index > 0x7fffffffu >> shift {
        return end;
    }
    return clamp(i32(index << shift) - 1, 0, end);
}

fn lattice_planes(index: vec3u, level: u32) -> vec3i {
    return vec3i(
        lattice_plane(index.x, level, frame.end.x),
        lattice_plane(index.y, level, frame.end.y),
        lattice_plane(index.z, level, frame.end.z),
    );
}

// Planes as the eye sees them.
fn seen(planes: vec3i) -> vec3f {
    let from_eye = (vec3f(planes - frame.eye_whole) - frame.eye_fraction) * frame.step;
    let settled = select(from_eye, vec3f(0.0), abs(from_eye) < vec3f(TINY));
    return select(settled, frame.way, frame.is_parallel != 0u);
}

// A corner or a point of the first face.
struct Place {
    point: vec3f,
    before: f32,
    through: f32,
    // Whether a part of the cube is behind the eye.
    is_around_eye: bool,
    // Whether the eye is in it: then rays enter where they start.
    is_inside: bool,
}

fn place_of(number: u32, low_plane: vec3i, high_plane: vec3i) -> Place {
    let is_parallel = frame.is_parallel != 0u;
    let size = vec3f(high_plane - low_plane) * frame.step;
    let low = seen(low_plane);
    let high = seen(high_plane);
    let near = max(low, -high);
    let far = max(high, -low);
    let ratio = near / size;
    let first = select(select(0u, 1u, ratio.y > ratio.x), 2u, ratio.z > max(ratio.x, ratio.y));
    let is_low = low > vec3f(0.0);
    let is_high = high < vec3f(0.0);
    let sides = select(vec3u(0u), vec3u(1u, 3u, 9u), is_low) + select(vec3u(0u), vec3u(2u, 6u, 18u), is_high);
    let aspect = aspects[3u * (sides.x + sides.y + sides.z) + first];

    let is_outside = aspect >> CLASS_SHIFT != 0u;
    let is_inner = is_outside && number < NUM_INNER;
    let corner = aspect >> (CORNER_BITS * number);
    let is_first = vec3u(first) == vec3u(0u, 1u, 2u);
    let is_high_corner = (vec3u(corner) & vec3u(1u, 2u, 4u)) != vec3u(0u);
    // Inner vertices are on the face where rays enter.
    let is_high_end = select(is_high_corner, is_high, is_first & vec3<bool>(is_inner));
    let plane = select(low_plane, high_plane, is_high_end);
    let end = (vec3f(plane - frame.anchor_whole) - frame.anchor_fraction) * frame.step;
    let least_depth = min(low * frame.clip_w.xyz, high * frame.clip_w.xyz);
    let is_around_eye = !is_parallel && least_depth.x + least_depth.y + least_depth.z <= 0.0;
    if !is_outside {
        return Place(end, 1.0, 1.0, true, true);
    }
    if !is_inner {
        return Place(end, 1.0, 0.0, is_around_eye, false);
    }
    let before = near[first] / far[first];
    let through = size[first] / far[first];
    // The far face drawn onto the near one: as a way from the end, exact from afar, or as a place, from nearby.
    let end_seen = select(low, high, is_high_end);
    let least = select(vec3f(0.0), -size, is_high_end);
    let most = select(size, vec3f(0.0), is_high_end);
    let from_afar = end + clamp(-through * end_seen, least, most);
    let from_nearby = clamp(before * end_seen, low, high) - frame.anchor_from_eye;
    let drawn = select(from_afar, from_nearby, through > 0.5 && !is_parallel);
    return Place(select(drawn, end, is_first), before, through, is_around_eye, false);
}

@vertex
fn fan(@builtin(vertex_index) vertex: u32, @builtin(instance_index) batch: u32) -> Vertex {
    let cube = cubes[batch * BATCH + vertex / NUM_VERTICES];
    let index = vec3u(cube.index_xy & 0xffffu, cube.index_xy >> 16u, cube.index_z_level & 0xffffu);
    let level = cube.index_z_level >> 16u;
    let low_plane = lattice_planes(index, level);
    let high_plane = lattice_planes(index + 1u, level);
    var out: Vertex;
    if any(low_plane >= high_plane) {
        // A cube without volume is one point outside the picture.
        out.position = vec4f(2.0, 2.0, 0.5, 1.0);
        return out;
    }
    let place = place_of(vertex % NUM_VERTICES, low_plane, high_plane);
    let position = vec4f(place.point, 1.0);
    let w = dot(frame.clip_w, position);
    out.position = vec4f(dot(frame.clip_x, position), dot(frame.clip_y, position), 0.5 * w, w);
    let reach = select(length(place.point + frame.anchor_from_eye), 1.0, frame.is_parallel != 0u);
    let thickness = reach * place.through / place.before;
    let enter = select(dot(frame.depth, position), frame.eye_depth, place.is_inside);
    out.shares = vec4f(place.before, place.through, enter, w * thickness);
    let extinction = min(min(cube.extinction, MAX_EXTINCTION) * frame.unit_length, MAX_EXTINCTION);
    out.matter = vec4f(cube.red, cube.green, cube.blue, select(extinction, -extinction, place.is_around_eye));
    return out;
}

@fragment
fn matter(in: Vertex) -> @location(0) vec4f {
    // Of a ray, length per depth; depth is one over `w`.
    let slope = (in.position.xy - frame.center) * frame.slope_per_pixel;
    let length_per_depth = sqrt(1.0 + dot(slope, slope));
    var thickness = in.shares.w * in.position.w;
    if IS_EXACT || in.matter.w < 0.0 {
        thickness = length_per_depth * in.shares.y / (in.shares.x * in.position.w);
    }
    // Less what is before the start of the ray.
    var length = max(thickness + min(in.shares.z - frame.eye_depth, 0.0), 0.0);
    if HAS_SURFACES {
        let end = textureLoad(surfaces, vec2u(in.position.xy), 0).a * frame.units_per_length;
        length = min(length, max((end - max(in.shares.z, frame.eye_depth)) * length_per_depth, 0.0));
    }
    let opacity = opacity_of(min(length * abs(in.matter.w), OPAQUE_DEPTH));
    return vec4f(in.matter.rgb * opacity, opacity);
}
