// Draws sheets: triangles with values at their vertices, each sheet standing for matter of some thickness.
//
// A vertex comes out of buffers by its number, in one of two forms, and its sheet is the instance. Places are relative
// to the frame's origin, which the frame's rows take to the eye: in f64, until the last step. What is interpolated is
// affine in the place, so perspective loses nothing.
//
// Opacity may be below zero: of matter that is taken away in front of other matter.

// import opacity
// import unit

struct Frame {
    // A place and 1 to clip coordinates, whose depth is half their w: there is no near plane.
    clip_x: vec4f,
    clip_y: vec4f,
    clip_w: vec4f,
    // A place and 1 to its depth along the view, from that of the surfaces on; without these from the plane through
    // the eye on.
    depth: vec4f,
    // Of quantised vertices: places and values of 0, and of one step.
    low: vec4f,
    scale: vec4f,
    normal: vec3f,
    // Of quantised gradients: one step of magnitudes.
    magnitude_scale: f32,
    // A unit vector.
    toward_light: vec3f,
    ambient: f32,
    // The image point before the eye, and the slope of rays per pixel; no slope in parallel.
    center: vec2f,
    slope_per_pixel: vec2f,
    // The normal's part along the ray before the eye, and its change per pixel for rays of depth 1.
    normal_per_pixel: vec2f,
    normal_ahead: f32,
    diffuse: f32,
    // Scale and offset: places in the table.
    column_from_value: vec2f,
    row_from_magnitude: vec2f,
    columns: u32,
    rows: u32,
    // The depth of the plane through the eye.
    eye_depth: f32,
}

// What a sheet's triangles stand for.
struct Sheet {
    // At the origin and per length along the normal.
    thickness: vec2f,
    // Which of the triangles count.
    counted: u32,
}

// Whether vertices are integers, or floats.
override IS_QUANTIZED: bool = false;
override HAS_GRADIENTS: bool = false;
// Whether gradients shade.
override IS_LIT: bool = false;
// Whether the table has more than one row.
override HAS_ROWS: bool = false;
// Whether rays are parallel, and begin at the plane through the eye.
override IS_PARALLEL: bool = false;
// Whether rays end at surfaces.
override HAS_SURFACES: bool = false;

// All triangles count; those of an outline where the ray leaves what it is of and goes along the normal, or comes in and
// goes against it; and those elsewhere.
const ALL: u32 = 0;
const RISING: u32 = 1;
const FALLING: u32 = 2;
// Rays at a sine below this to a sheet go through as much matter as at this.
const MIN_COSINE: f32 = 1e-30;
// As the frame has it.
const MAX_STRIP_DEPTH: f32 = 5.0;

@group(0) @binding(0) var<uniform> frame: Frame;
// Of each vertex x, y, z and the value: bits of floats, or unsigned 16-bit integers.
@group(0) @binding(1) var<storage, read> points: array<u32>;
// Of each vertex the direction in which the value rises, and the magnitude: bits of floats, or signed bytes and one
// unsigned.
@group(0) @binding(2) var<storage, read> gradients: array<u32>;
@group(0) @binding(3) var<storage, read> listing: array<Sheet>;
// Colour and extinction, row after row.
@group(0) @binding(4) var<storage, read> entries: array<vec4f>;
// Of each pixel of the tile, colour and depth.
@group(0) @binding(5) var surfaces: texture_2d<f32>;

struct Vertex {
    @builtin(position) position: vec4f,
    @location(0) gradient: vec4f,
    // Value, thickness, depth, and what the thickness changes by along the normal.
    @location(1) matter: vec4f,
    @location(2) @interpolate(flat) counted: u32,
}

fn point_of(vertex: u32) -> vec4f {
    if IS_QUANTIZED {
        let xy = points[2u * vertex];
        let zw = points[2u * vertex + 1u];
        let steps = vec4u(xy & 0xffffu, xy >> 16u, zw & 0xffffu, zw >> 16u);
        return frame.low + frame.scale * vec4f(steps);
    }
    let at = 4u * vertex;
    return bitcast<vec4f>(vec4u(points[at], points[at + 1u], points[at + 2u], points[at + 3u]));
}

fn gradient_of(vertex: u32) -> vec4f {
    if IS_QUANTIZED {
        let word = gradients[vertex];
        return vec4f(unpack4x8snorm(word).xyz, f32(word >> 24u) * frame.magnitude_scale);
    }
    let at = 4u * vertex;
    return bitcast<vec4f>(vec4u(gradients[at], gradients[at + 1u], gradients[at + 2u], gradients[at + 3u]));
}

@vertex
fn corner(@builtin(vertex_index) vertex: u32, @builtin(instance_index) sheet: u32) -> Vertex {
    let point = point_of(vertex);
    let place = vec4f(point.xyz, 1.0);
    let thickness = listing[sheet].thickness;
    var out: Vertex;
    let w = dot(frame.clip_w, place);
    out.position = vec4f(dot(frame.clip_x, place), dot(frame.clip_y, place), 0.5 * w, w);
    if HAS_GRADIENTS {
        out.gradient = gradient_of(vertex);
    }
    let along_normal = dot(frame.normal, point.xyz);
    out.matter =
        vec4f(point.w, thickness.x + thickness.y * along_normal, dot(frame.depth, place), thickness.y);
    out.counted = listing[sheet].counted;
    return out;
}

// A place between two of `count` entries: the first, and the weight of the second. What is no number is the first.
struct Between {
    first: u32,
    second: u32,
    weight: f32,
}

fn between(scale_offset: vec2f, x: f32, count: u32) -> Between {
    let place = scale_offset.x * x + scale_offset.y;
    let last = count - 1u;
    let clamped = select(0.0, min(place, f32(last)), place > 0.0);
    let first = min(u32(clamped), max(last, 1u) - 1u);
    return Between(first, min(first + 1u, last), clamped - f32(first));
}

fn mix_of(a: vec4f, b: vec4f, weight: f32) -> vec4f {
    return a + (b - a) * weight;
}

// Straight colour and extinction, bilinear between entries.
fn classify(value: f32, magnitude: f32) -> vec4f {
    let column = between(frame.column_from_value, value, frame.columns);
    let upper = mix_of(entries[column.first], entries[column.second], column.weight);
    if !HAS_ROWS {
        return upper;
    }
    let row = between(frame.row_from_magnitude, magnitude, frame.rows);
    let top = frame.columns * row.first;
    let bottom = frame.columns * row.second;
    return mix_of(
        mix_of(entries[top + column.first], entries[top + column.second], column.weight),
        mix_of(entries[bottom + column.first], entries[bottom + column.second], column.weight),
        row.weight,
    );
}

// The share of the colour that light leaves, on either side. A direction of zero has no shade.
fn shade(direction: vec3f) -> f32 {
    let rising = unit(direction);
    let lit = frame.ambient + frame.diffuse * abs(dot(rising, frame.toward_light));
    return select(lit, 1.0, all(rising == vec3f(0.0)));
}

// Of a slab half before and half behind a place, or of what is no slab and lies there, the share before a surface.
fn share_before(way_to_surface: f32, length: f32, is_slab: bool) -> f32 {
    if is_slab && length > 0.0 {
        return clamp(way_to_surface / length + 0.5, 0.0, 1.0);
    }
    return select(0.0, 1.0, way_to_surface > 0.0);
}

@fragment
fn matter(in: Vertex, @builtin(front_facing) is_coming_in: bool) -> @location(0) vec4f {
    var entry = classify(in.matter.x, in.gradient.w);
    if HAS_GRADIENTS && IS_LIT {
        entry = vec4f(entry.rgb * shade(in.gradient.xyz), entry.a);
    }
    let pixel = in.position.xy - frame.center;
    let approach = frame.normal_ahead + dot(frame.normal_per_pixel, pixel);
    if in.counted != ALL && (in.counted == RISING) != (is_coming_in != (approach > 0.0)) {
        return vec4f(0.0);
    }
    let slope = pixel * frame.slope_per_pixel;
    let length_per_depth = sqrt(1.0 + dot(slope, slope));
    let cosine = abs(approach) / length_per_depth;
    var depth = entry.a * in.matter.y / max(cosine, MIN_COSINE);
    if HAS_SURFACES {
        let end = textureLoad(surfaces, vec2u(in.position.xy), 0).a;
        let way = (end - in.matter.z) * length_per_depth;
        depth *= share_before(way, abs(in.matter.y) / max(cosine, MIN_COSINE), in.matter.w == 0.0);
    }
    let most = select(OPAQUE_DEPTH, MAX_STRIP_DEPTH, in.matter.w != 0.0);
    let opacity = opacity_of(clamp(depth, -MAX_STRIP_DEPTH, most));
    if IS_PARALLEL && in.matter.z < frame.eye_depth {
        return vec4f(0.0);
    }
    return vec4f(entry.rgb * opacity, opacity);
}
