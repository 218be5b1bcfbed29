// Shows cutting planes: per pixel the places where its ray meets them, the brick of each, its samples.
//
// Places are in finest cells from a whole cell that the CPU chose for each plane and tile of the picture, so that
// 32 bits do. The nearest plane that a pixel has not yet seen comes next, until an opaque place hides the rest.

struct Frame {
    // Of the volume, in finest cells.
    cells: vec3f,
    // Pixels of this tile of the picture.
    width: u32,
    // Entries of the grid of bricks along each axis.
    grid_dims: vec3u,
    height: u32,
    // Whether this is the first part of the picture: 0 or 1.
    is_first: u32,
    brick_cells: f32,
    bricks_per_cell: f32,
    // Entries of the grid per finest cell.
    entries_per_cell: f32,
    num_planes: u32,
    num_points: u32,
    // Steps of the texels that were uploaded, per unit of what the texture gives; 0 where those are the same.
    texels_per_unit: f32,
    // So many pixels from a bound of bricks its line ends.
    outline_reach: f32,
    // Of a brick in the atlas: slices side by side, and rows of texels.
    slices_per_row: u32,
    slot_height: u32,
    // As numbers: 0 or 1.
    is_nearest: u32,
    is_transparent: u32,
    shows_bricks: u32,
    // Of surfaces.
    depths_per_length: f32,
}

// A plane as one tile of the picture sees it.
struct PlaneTile {
    // A whole cell of the volume, to which places are relative.
    base: vec3f,
    is_seen: u32,
    // Place and depth that the anchor sees; their change per pixel to the right and down, before the division.
    seen: vec4f,
    dx: vec4f,
    dy: vec4f,
    // Pixel of the tile to which all this refers.
    anchor: vec2f,
    // Change of the denominator per pixel right and down.
    shrink: vec2f,
    first_depth: f32,
    // What is added to the depth of surfaces to be one of the tile.
    surface_offset: f32,
}

struct Brick {
    first_cell: vec3f,
    // Level and low corners.
    kind: u32,
    outline: vec3f,
    // Layer and row of its slot.
    slot: u32,
    // Along each axis.
    last_sample: vec3f,
}

// Whether texels are colours.
override HAS_COLORS: bool = false;
// Whether the grid holds bricks that are not of this part.
override HAS_OTHERS: bool = false;
// Whether surfaces hide what is behind them.
override HAS_SURFACES: bool = false;

// Pixels per edge of a tile, which a workgroup draws.
const TILE: u32 = 16;
// Texels from here on are blank.
const BLANK: f32 = 1e38;
// Denominators below this are beyond a plane's horizon.
const HORIZON: f32 = 1e-12;
const NO_PLANE: u32 = 0xffffffff;
const NO_BRICK: u32 = 0xffffffff;
const LEVEL_MASK: u32 = 31;
const LOW_CORNERS_SHIFT: u32 = 8;
const LAYER_SHIFT: u32 = 16;
const ROW_MASK: u32 = 0xffff;

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var atlas: texture_2d_array<f32>;
// Of each tile, rows from the top, all planes.
@group(0) @binding(2) var<storage, read> tiles: array<PlaneTile>;
// In Z order.
@group(0) @binding(3) var<storage, read> bricks: array<Brick>;
// First brick and number of bricks in each entry of the grid.
@group(0) @binding(4) var<storage, read> entries: array<vec2u>;
// The transfer function's control points: texel, colour, opacity.
@group(0) @binding(5) var<storage, read> points: array<f32>;
// Of each pixel of this tile, the colour it has gathered from the front, and the share of light that still comes through.
@group(0) @binding(6) var<storage, read_write> gathered: array<vec4f>;
// Of each pixel of this tile, colour and depth in the world's lengths.
@group(0) @binding(7) var surfaces: texture_2d<f32>;
// A bit per brick, set where it is of this part.
@group(0) @binding(8) var<storage, read> chosen: array<u32>;

struct Hit {
    place: vec3f,
    depth: f32,
    inverse: f32,
    is_inside: bool,
}

// Between which samples of a brick a place is, and the weights of the upper ones.
struct Interval {
    lower: vec3f,
    upper: vec3f,
    weight: vec3f,
}

struct Light {
    color: vec3f,
    transmittance: f32,
}

fn hit_of(plane: u32, pixel: vec2f) -> Hit {
    let at = pixel - tiles[plane].anchor;
    let denominator = 1.0 + dot(at, tiles[plane].shrink);
    let inverse = 1.0 / max(denominator, HORIZON);
    let seen = tiles[plane].seen + (at.x * tiles[plane].dx + at.y * tiles[plane].dy) * inverse;
    let base = tiles[plane].base;
    let is_inside = tiles[plane].is_seen != 0u && denominator > HORIZON && seen.w >= tiles[plane].first_depth
        && all(seen.xyz >= -base) && all(seen.xyz <= frame.cells - base);
    return Hit(seen.xyz, seen.w, inverse, is_inside);
}

// Finest cells that places change by from pixel to pixel, along each axis.
fn slope_of(plane: u32, hit: Hit) -> vec3f {
    let moved = hit.place - tiles[plane].seen.xyz;
    let x = (tiles[plane].dx.xyz - moved * tiles[plane].shrink.x) * hit.inverse;
    let y = (tiles[plane].dy.xyz - moved * tiles[plane].shrink.y) * hit.inverse;
    return sqrt(x * x + y * y);
}

// Whether `a` comes before `b` by the highest bit in which any coordinate differs, or is the same.
fn is_in_order(a: vec3u, b: vec3u) -> bool {
    let differ = a ^ b;
    var highest = differ.z;
    var order = vec2u(a.z, b.z);
    if highest < differ.y && highest < (highest ^ differ.y) {
        highest = differ.y;
        order = vec2u(a.y, b.y);
    }
    if highest < differ.x && highest < (highest ^ differ.x) {
        order = vec2u(a.x, b.x);
    }
    return order.x <= order.y;
}

// Bricks of level 0 below a cell.
fn node_of(cell: vec3f) -> vec3u {
    return vec3u((cell + 0.5) * frame.bricks_per_cell);
}

fn size_of(brick: u32) -> f32 {
    return frame.brick_cells * f32(1u << (bricks[brick].kind & LEVEL_MASK));
}

// The brick that holds a finest cell of the volume.
fn find(cell: vec3f) -> u32 {
    let at = min(vec3u((cell + 0.5) * frame.entries_per_cell), frame.grid_dims - 1u);
    var run = entries[(at.z * frame.grid_dims.y + at.y) * frame.grid_dims.x + at.x];
    let node = node_of(cell);
    while run.y > 1u {
        let half = run.y / 2u;
        let is_before = is_in_order(node_of(bricks[run.x + half].first_cell), node);
        run = select(vec2u(run.x, half), vec2u(run.x + half, run.y - half), is_before);
    }
    let from_low = cell - bricks[run.x].first_cell;
    if HAS_OTHERS && ((chosen[run.x / 32u] >> (run.x % 32u)) & 1u) == 0u {
        return NO_BRICK;
    }
    let is_held = run.y == 1u && all(from_low >= vec3f(0.0)) && all(from_low < vec3f(size_of(run.x)));
    return select(NO_BRICK, run.x, is_held);
}

fn interval_of(place: vec3f, last: vec3f, step: f32) -> Interval {
    let at = place / step;
    if frame.is_nearest != 0u {
        let nearest = clamp(floor(at + 0.5) * step, vec3f(0.0), last);
        return Interval(nearest, nearest, vec3f(0.0));
    }
    let last_cell = max(ceil(last / step) - 1.0, vec3f(0.0));
    let cell = clamp(floor(at), vec3f(0.0), last_cell);
    let lower = cell * step;
    return Interval(lower, min(lower + step, last), clamp(at - cell, vec3f(0.0), vec3f(1.0)));
}

fn texel_at(slot: u32, sample: vec3f) -> vec4f {
    let edge = u32(frame.brick_cells) + 1u;
    let at = vec3u(sample);
    let slice = vec2u(at.z % frame.slices_per_row, at.z / frame.slices_per_row);
    let place = at.xy + slice * edge + vec2u(0u, (slot & ROW_MASK) * frame.slot_height);
    let texel = textureLoad(atlas, place, slot >> LAYER_SHIFT, 0);
    // Integers exactly: a step of the transfer function may stand at one.
    return select(texel, floor(texel * frame.texels_per_unit + 0.5), frame.texels_per_unit > 0.0);
}

// Exact where both ends are the same, which `mix` need not be.
fn between(a: vec4f, b: vec4f, w: f32) -> vec4f {
    return a + (b - a) * w;
}

// Every `step`-th sample of a brick and the last, as a field; `BLANK` or more where a sample is blank.
fn sampled(brick: u32, place: vec3f, step: f32) -> vec4f {
    let interval = interval_of(place, bricks[brick].last_sample, step);
    let slot = bricks[brick].slot;
    let low = interval.lower;
    let high = interval.upper;
    let t000 = texel_at(slot, low);
    if frame.is_nearest != 0u {
        return t000;
    }
    let t100 = texel_at(slot, vec3f(high.x, low.y, low.z));
    let t010 = texel_at(slot, vec3f(low.x, high.y, low.z));
    let t110 = texel_at(slot, vec3f(high.x, high.y, low.z));
    let t001 = texel_at(slot, vec3f(low.x, low.y, high.z));
    let t101 = texel_at(slot, vec3f(high.x, low.y, high.z));
    let t011 = texel_at(slot, vec3f(low.x, high.y, high.z));
    let t111 = texel_at(slot, high);
    let peak = max(max(max(t000, t100), max(t010, t110)), max(max(t001, t101), max(t011, t111)));
    if peak.x >= BLANK {
        return vec4f(BLANK);
    }
    let w = interval.weight;
    let near = between(between(t000, t100, w.x), between(t010, t110, w.x), w.y);
    let far = between(between(t001, t101, w.x), between(t011, t111, w.x), w.y);
    return between(near, far, w.z);
}

// How much of the low samples counts.
fn ratio_of(corners: u32, w: vec3f) -> f32 {
    let is_low = vec4f((vec4u(corners) >> vec4u(0u, 1u, 2u, 3u)) & vec4u(1u));
    let is_low_above = vec4f((vec4u(corners) >> vec4u(4u, 5u, 6u, 7u)) & vec4u(1u));
    let along_z = mix(is_low, is_low_above, w.z);
    let along_y = mix(along_z.xy, along_z.zw, w.y);
    return mix(along_y.x, along_y.y, w.x);
}

// High and low samples mixed; `BLANK` or more where a sample that counts is blank.
fn value_at(brick: u32, place: vec3f) -> vec4f {
    let corners = (bricks[brick].kind >> LOW_CORNERS_SHIFT) & 255u;
    var ratio = 0.0;
    if corners == 255u {
        ratio = 1.0;
    } else if corners != 0u {
        ratio = ratio_of(corners, place * frame.bricks_per_cell);
    }
    var high = vec4f(0.0);
    var low = vec4f(0.0);
    if ratio < 1.0 {
        high = sampled(brick, place, 1.0);
    }
    if ratio > 0.0 {
        low = sampled(brick, place, 2.0);
    }
    return select(between(high, low, ratio), vec4f(BLANK), max(high.x, low.x) >= BLANK);
}

fn point_color(point: u32) -> vec4f {
    return vec4f(points[5u * point + 1u], points[5u * point + 2u], points[5u * point + 3u], points[5u * point + 4u]);
}

// Straight colour and opacity of a texel.
fn classify(texel: f32) -> vec4f {
    // The first point above the texel.
    var first = 0u;
    var count = frame.num_points;
    while count > 0u {
        let half = count / 2u;
        let is_below = points[5u * (first + half)] <= texel;
        first = select(first, first + half + 1u, is_below);
        count = select(half, count - half - 1u, is_below);
    }
    let above = min(first, frame.num_points - 1u);
    let below = max(first, 1u) - 1u;
    let from_texel = points[5u * below];
    let width = points[5u * above] - from_texel;
    let w = select(0.0, (texel - from_texel) / width, above != below && width > 0.0);
    return mix(point_color(below), point_color(above), clamp(w, 0.0, 1.0));
}

fn add(light: Light, color: vec3f, opacity: f32) -> Light {
    let share = light.transmittance * opacity;
    return Light(light.color + share * color, light.transmittance * (1.0 - opacity));
}

// How much of the pixel the bounds of a brick cover.
fn outline_coverage(plane: u32, hit: Hit, brick: u32) -> f32 {
    let base = tiles[plane].base;
    let low = bricks[brick].first_cell;
    let high = min(low + size_of(brick), frame.cells);
    let distance = min(hit.place - (low - base), (high - base) - hit.place);
    let slope = slope_of(plane, hit);
    let pixels = select(vec3f(BLANK), distance / slope, slope > vec3f(0.0));
    return clamp(frame.outline_reach - min(pixels.x, min(pixels.y, pixels.z)), 0.0, 1.0);
}

// Adds what is seen of a plane.
fn shade(light: Light, plane: u32, hit: Hit) -> Light {
    let base = tiles[plane].base;
    let cell = clamp(floor(hit.place) + base, vec3f(0.0), max(frame.cells - 1.0, vec3f(0.0)));
    let brick = find(cell);
    if brick == NO_BRICK {
        return light;
    }
    let scale = 1.0 / f32(1u << (bricks[brick].kind & LEVEL_MASK));
    let place = (hit.place - (bricks[brick].first_cell - base)) * scale;
    if any(place > bricks[brick].last_sample) {
        return light;
    }
    var sum = light;
    if frame.shows_bricks != 0u {
        sum = add(sum, bricks[brick].outline, outline_coverage(plane, hit, brick));
    }
    let value = value_at(brick, max(place, vec3f(0.0)));
    if value.x >= BLANK {
        return sum;
    }
    var color = value;
    if !HAS_COLORS {
        color = classify(value.x);
    }
    return add(sum, color.rgb, select(1.0, color.a, frame.is_transparent != 0u));
}

// The depth from which on nothing is seen, but for the offset of the tile.
fn end_of(pixel: vec2u) -> f32 {
    if !HAS_SURFACES {
        return BLANK;
    }
    return textureLoad(surfaces, pixel, 0).a * frame.depths_per_length;
}

// The light of all planes up to an end, behind what was gathered.
fn light_of(first_plane: u32, pixel: vec2f, end: f32, before: Light) -> Light {
    var light = before;
    // Planes that the pixel has still to see.
    var open = 0u;
    for (var i = 0u; i < frame.num_planes; i++) {
        let hit = hit_of(first_plane + i, pixel);
        open |= select(0u, 1u << i, hit.is_inside && hit.depth < end + tiles[first_plane + i].surface_offset);
    }
    while open != 0u && light.transmittance > 0.0 {
        var nearest = NO_PLANE;
        var depth = 0.0;
        for (var i = 0u; i < frame.num_planes; i++) {
            let hit = hit_of(first_plane + i, pixel);
            if ((open >> i) & 1u) != 0u && (nearest == NO_PLANE || hit.depth < depth) {
                nearest = i;
                depth = hit.depth;
            }
        }
        open &= ~(1u << nearest);
        light = shade(light, first_plane + nearest, hit_of(first_plane + nearest, pixel));
    }
    return light;
}

@compute @workgroup_size(16, 16)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) in_tile: vec3u) {
    let pixel = group.xy * TILE + in_tile.xy;
    if pixel.x >= frame.width || pixel.y >= frame.height {
        return;
    }
    let index = pixel.y * frame.width + pixel.x;
    var before = Light(vec3f(0.0), 1.0);
    if frame.is_first == 0u {
        before = Light(gathered[index].rgb, gathered[index].a);
    }
    let tiles_per_row = (frame.width + TILE - 1u) / TILE;
    let first_plane = (group.y * tiles_per_row + group.x) * frame.num_planes;
    let light = light_of(first_plane, vec2f(in_tile.xy), end_of(pixel), before);
    gathered[index] = vec4f(light.color, light.transmittance);
}
