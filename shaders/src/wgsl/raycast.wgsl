// Casts one ray per pixel through the bricks of a volume.
//
// *Units* cover the volume evenly and say which brick is there, or how far around space is empty: a ray leaps
// over such space. Elsewhere it visits the cells between samples: along a ray the trilinear field of a cell has no
// kinks. Two straight pieces are integrated through the transfer function's antiderivative; where what that may be off
// by is too much, or the table too coarse, the cubic itself is, from control point to control point.
//
// Texels are counted from `texel_origin`, in the units of the samples.
//
// Positions are in finest cells from the volume's lower corner, `t` is the way along the ray in finest cells, from
// a start that the CPU chose near the volume, so that 32 bits do.

struct Frame {
    // The ray of image point (x, y) starts at `origin + x * origin_dx + y * origin_dy`, directions likewise.
    origin: vec3f,
    width: u32,
    origin_dx: vec3f,
    // One past the last row of this band of the picture.
    end_row: u32,
    origin_dy: vec3f,
    first_row: u32,
    toward: vec3f,
    // Finest cells per edge of a unit.
    unit_cells: f32,
    toward_dx: vec3f,
    units_per_cell: f32,
    toward_dy: vec3f,
    // A brick's own cells per edge of a brick, and the same the other way round.
    brick_cells: f32,
    // Of the volume, in finest cells.
    cells: vec3f,
    bricks_per_cell: f32,
    // Per axis: optical depth to the base 2 per finest cell of matter that has depth 1 per unit length.
    depth_per_cell: vec3f,
    // What one step of the atlas's numbers is in texels, and where texels are counted from.
    texels_per_step: f32,
    background: vec3f,
    texel_origin: f32,
    // One over the atlas's size in texels.
    atlas_scale: vec2f,
    // The entry of the antiderivatives that stands for all texels above the bins.
    last_entry: f32,
    // Of a brick in the atlas: slices side by side, the same the other way round, and rows of texels.
    slices_per_row: f32,
    rows_per_slice: f32,
    slot_height: f32,
    // bin = texel * bins_per_texel + first_bin
    bins_per_texel: f32,
    first_bin: f32,
    // Largest change of light per texel, and optical depth to the base 2 that a stretch of depth 1 has.
    slope: f32,
    // Optical depth per -ln(1 - opacity) of a stretch, as a share of the depth that it has in units of length.
    depth_scale: f32,
    num_bands: u32,
    // Cells of a larger range, in texels, lie beside an outlier.
    huge_range: f32,
    // Of surfaces: what is added to their depth to count from the ray's start, and finest cells per depth for a
    // direction of length 1 as the frame has it.
    surface_offset: f32,
    cells_per_depth: f32,
}

// Whether texels may be blank.
override HAS_BLANKS: bool = false;
// Whether texels are whole numbers, which the atlas's formats round.
override IS_WHOLE: bool = false;
// Whether rays end at surfaces.
override HAS_SURFACES: bool = false;

// Texels from here on are blank.
const BLANK: f32 = 1e38;
// Optical depth to the base 2 at which a ray stops: it lets 1/4096 of the light through.
const OPAQUE_DEPTH: f32 = 12.0;
// Changes of the transfer function's antiderivative below this are none: their inverse might not be finite.
const INVISIBLE: f32 = 1e-30;
// The largest doubt of a stretch of ray, as a difference of a colour channel: beyond, it is halved, and where that
// cannot be enough integrated exactly.
const MAX_DOUBT: f32 = 0.003;
// What a channel may be off by where a cell was integrated exactly, as a share of the light that it takes.
const EXACT_DOUBT: f32 = 0.0025;
// Longer than any ray.
const FAR: f32 = 1e30;
// Pixels per edge of a workgroup's tile.
const TILE: u32 = 8;
// In a unit's first word: set where it holds matter; then come the level, and the layer and row of the brick's
// slot.
const OCCUPIED: u32 = 0x80000000;
const LEVEL_SHIFT: u32 = 26;
const LEVEL_MASK: u32 = 31;
const NO_LEVEL: u32 = 32;
const LAYER_SHIFT: u32 = 13;
const SLOT_MASK: u32 = 0x1fff;
// In a unit's second word: set where the table is too coarse; the brick's cells per axis.
const EXACT: u32 = 0x40000000;
const CELLS_SHIFT: u32 = 10;
const CELLS_MASK: u32 = 1023;

@group(0) @binding(0) var<uniform> frame: Frame;
// Of empty units the first word is the distance to the nearest occupied one in units, along the axis where it
// is largest.
@group(0) @binding(1) var units: texture_3d<u32>;
// A brick's slices of equal z lie side by side, in rows of `slices_per_row`; bricks one below the other, then
// in layers. So a brick is compact in memory, and a gather reads four corners of a cell at once.
@group(0) @binding(2) var atlas: texture_2d_array<f32>;
@group(0) @binding(3) var atlas_sampler: sampler;
@group(0) @binding(4) var transfer: texture_2d<f32>;
@group(0) @binding(5) var<storage, read_write> picture: array<f32>;
// Of each pixel of this band, colour and depth.
@group(0) @binding(6) var surfaces: texture_2d<f32>;
// The transfer function's bands, three to a band: [base, low, high, opacity], [opacity slope, clearness, red, green],
// [blue, red slope, green slope, blue slope]. A texel's place in one is its distance u from the base; it holds those
// from low to high. Opacity is per unit distance, clearness what is missing to 1; slopes are per texel.
@group(0) @binding(7) var<storage, read> bands: array<vec4f>;
// The largest doubt of any ray, and the longest way through cells that were read from the table: bits of numbers of at
// least 0, which are in order as the numbers are.
@group(0) @binding(8) var<storage, read_write> worst: array<atomic<u32>>;

struct Ray {
    start: vec3f,
    // Without components of 0.
    direction: vec3f,
    // With them.
    motion: vec3f,
    inverse: vec3f,
    // 1 along axes where the ray rises, 0 where it falls.
    rising: vec3f,
    // Optical depth per t of matter that has depth 1 per unit length.
    depth_per_t: f32,
    // Where it ends, and what is seen there.
    end: f32,
    behind: vec3f,
}

struct Light {
    color: vec3f,
    depth: f32,
    transmittance: f32,
    // What a channel may be off by, but for the arithmetic; and the way through cells that were read from the table, as
    // depth to the base 2 of matter that has depth 1 per unit length, as it is seen.
    doubt: f32,
    table_way: f32,
}

// One end of a piece of ray: the texel, its bin, and the antiderivatives there.
struct End {
    texel: f32,
    bin: f32,
    sums: vec4f,
}

// A piece of ray along which the value is taken as linear.
struct Piece {
    // Mean, weighted by extinction.
    color: vec3f,
    // Optical depth to the base 2.
    depth: f32,
    end: End,
}

// The corners of a cell below and above in z, as textureGather orders them.
struct Corners {
    low: vec4f,
    rise: vec4f,
}

fn smallest(v: vec3f) -> f32 {
    return min(v.x, min(v.y, v.z));
}

fn largest(v: vec3f) -> f32 {
    return max(v.x, max(v.y, v.z));
}

fn ray_of_pixel(pixel: vec2u) -> Ray {
    let at = vec2f(pixel) + 0.5;
    let way = frame.toward + at.x * frame.toward_dx + at.y * frame.toward_dy;
    let toward = normalize(way);
    let place = frame.origin + at.x * frame.origin_dx + at.y * frame.origin_dy;
    // A ray that stands still along an axis and, but for rounding, in a plane of samples is in that plane: the volume is
    // closed. It creeps away from the face behind which nothing is.
    let is_still = abs(toward) < vec3f(1e-12);
    let nearest = clamp(round(place), vec3f(0.0), frame.cells);
    let start = select(place, nearest, is_still & (abs(place - nearest) <= 1e-6 * frame.cells));
    let rising = select(toward >= vec3f(0.0), start < frame.cells, is_still);
    // No component is zero, so that no face is infinitely far or NaN away.
    let direction = select(min(toward, vec3f(-1e-12)), max(toward, vec3f(1e-12)), rising);
    let depth_per_t = length(direction * frame.depth_per_cell);
    var end = FAR;
    var behind = frame.background;
    if HAS_SURFACES {
        let surface = textureLoad(surfaces, pixel - vec2u(0u, frame.first_row), 0);
        end = (surface.a + frame.surface_offset) * frame.cells_per_depth * length(way);
        behind = surface.rgb;
    }
    let motion = select(direction, vec3f(0.0), is_still);
    return Ray(start, direction, motion, 1.0 / direction, select(vec3f(0.0), vec3f(1.0), rising), depth_per_t, end, behind);
}

// Where a gather reads the corners of a cell in the slice z of a brick.
fn slice_place(corner: vec2f, z: f32) -> vec2f {
    let row = floor((z + 0.5) * frame.rows_per_slice);
    return (corner + (frame.brick_cells + 1.0) * vec2f(z - row * frame.slices_per_row, row)) * frame.atlas_scale;
}

fn corners_of_cell(slot: vec2u, cell: vec3f) -> Corners {
    let corner = vec2f(0.0, f32(slot.y) * frame.slot_height) + cell.xy + 1.0;
    let low = textureGather(0, atlas, atlas_sampler, slice_place(corner, cell.z), slot.x);
    let high = textureGather(0, atlas, atlas_sampler, slice_place(corner, cell.z + 1.0), slot.x);
    return Corners(low, high - low);
}

// What the atlas holds as texels from their origin.
fn texels_of(corners: Corners) -> Corners {
    if IS_WHOLE {
        let low = round(corners.low * frame.texels_per_step);
        let high = round((corners.low + corners.rise) * frame.texels_per_step);
        return Corners(low - frame.texel_origin, high - low);
    }
    return Corners(corners.low - frame.texel_origin, corners.rise);
}

fn texel_at(corners: Corners, w: vec3f) -> f32 {
    let face = corners.low + w.z * corners.rise;
    // Gathered in the order (0, 1), (1, 1), (1, 0), (0, 0) of (x, y).
    let front = face.w + w.x * (face.z - face.w);
    let back = face.x + w.x * (face.y - face.x);
    return front + w.y * (back - front);
}

// The nearest edge of a bin: a whole number, however far beyond the table.
fn bin_of(texel: f32) -> f32 {
    return round(texel * frame.bins_per_texel + frame.first_bin);
}

// The value for the middle of a stretch, so that each of the straight lines to it from the ends has the mean of
// the field over its half: a parabola bulges from its chord by a third of what the middle must give. Only where
// the field runs one way, and never past the ends.
fn balanced(first: f32, middle: f32, last: f32) -> f32 {
    let low = min(first, last);
    let high = max(first, last);
    let moved = (8.0 * middle - first - last) * (1.0 / 6.0);
    return select(middle, clamp(moved, low, high), middle >= low && middle <= high);
}

fn piece_to(from_end: End, texel: f32, depth_scale: f32) -> Piece {
    let bin = bin_of(texel);
    let is_flat = bin == from_end.bin;
    let entry = i32(clamp(bin, 0.0, frame.last_entry));
    // Two ends in one bin count as one whole bin.
    let other = select(entry, entry ^ 1, is_flat);
    let sums = textureLoad(transfer, vec2i(other, 0), 0);
    let change = sums - from_end.sums;
    // One division for two: by the bins passed and by the change of depth.
    let num_bins = (bin - from_end.bin) + f32(other - entry);
    let inverse = 1.0 / (num_bins * select(change.w, 1.0, abs(change.w) < INVISIBLE));
    let depth = depth_scale * change.w * (change.w * inverse);
    let end = End(texel, bin, select(sums, from_end.sums, is_flat));
    return Piece((num_bins * inverse) * change.rgb, depth, end);
}

// How far the light of a piece is from that of its mean colour, as a share of the change of colour along it:
// `1/2 - 1/x + 1/(exp(x) - 1)` of the optical depth x.
fn front_weight(depth: f32) -> f32 {
    let x = min(depth * 0.6931472, 8.0);
    return x / (0.2 * x * x + 12.0);
}

fn add_pair(light: ptr<function, Light>, a: Piece, b: Piece) {
    // Where one piece is much thinner than the other, its colour tells little of the other's.
    let slope = (min(a.depth, b.depth) / max(max(a.depth, b.depth), INVISIBLE)) * (b.color - a.color);
    let middle_depth = (*light).depth + a.depth;
    let depth = middle_depth + b.depth;
    let middle = exp2(-middle_depth);
    let transmittance = exp2(-depth);
    // The differences of transmittance add up to exactly what is missing behind.
    let share_a = (*light).transmittance - middle;
    let share_b = middle - transmittance;
    let shift = share_a * front_weight(a.depth) + share_b * front_weight(b.depth);
    (*light).color += share_a * a.color + share_b * b.color - shift * slope;
    (*light).depth = depth;
    (*light).transmittance = transmittance;
}

// What the change of colour hides: within a piece the light of its front and its back are told apart by the
// neighbouring piece only.
fn doubt_of_color(a: Piece, b: Piece) -> f32 {
    let depth = max(a.depth, b.depth) * 0.6931472;
    return depth * depth * largest(abs(b.color - a.color)) * (1.0 / 32.0);
}

// What follows is the exact way, the same as in the software executor (`exact.rs`), which says why it is so.

// What is missing to opaque changes at most by this factor in one interval, and counts as nothing below the second.
const MAX_GROWTH: f32 = 4.0;
const MIN_CLEARNESS: f32 = 1e-3;
// Largest optical depth of an interval along which the colour changes, by at least so much in a channel.
const MAX_INTERVAL_DEPTH: f32 = 1.0;
const MIN_TINT: f32 = 1e-3;
// Of an extinction without end.
const OPAQUE: f32 = 1e30;

// One band of the transfer function.
struct Band {
    base: f32,
    low: f32,
    high: f32,
    opacity: f32,
    opacity_slope: f32,
    clearness: f32,
    color: vec3f,
    color_slope: vec3f,
}

fn band_at(index: u32) -> Band {
    let a = bands[3u * index];
    let b = bands[3u * index + 1u];
    let c = bands[3u * index + 2u];
    return Band(a.x, a.y, a.z, a.w, b.x, b.y, vec3f(b.zw, c.x), c.yzw);
}

fn find_band(texel: f32) -> u32 {
    var low = 0u;
    var high = frame.num_bands - 1u;
    while low < high {
        let middle = (low + high + 1u) / 2u;
        if bands[3u * middle].x <= texel {
            low = middle;
        } else {
            high = middle - 1u;
        }
    }
    return low;
}

// -ln(1 - opacity), from the opacity and what is missing to 1.
fn clear_log(opacity: f32, clearness: f32) -> f32 {
    let bits = bitcast<u32>(clearness);
    let digits = bitcast<f32>((bits & 0x007fffffu) | (126u << 23u));
    let is_clear = opacity <= 0.5;
    let missing = select(1.0 - digits, opacity, is_clear);
    let halvings = select(f32(i32(bits >> 23u) - 126), 0.0, is_clear);
    let z = missing / (2.0 - missing);
    let s = z * z;
    let series = ((((2.0 / 11.0 * s + 2.0 / 9.0) * s + 2.0 / 7.0) * s + 2.0 / 5.0) * s + 2.0 / 3.0) * s + 2.0;
    return series * z - halvings * 0.6931472;
}

fn is_opaque_band(band: Band) -> bool {
    return band.clearness == 0.0 && band.opacity_slope == 0.0;
}

fn extinction_at(band: Band, u: f32) -> f32 {
    let opacity = clamp(band.opacity + band.opacity_slope * u, 0.0, 1.0);
    let clearness = clamp(band.clearness - band.opacity_slope * u, 2.9802322e-8, 1.0);
    return select(clear_log(opacity, clearness), OPAQUE, is_opaque_band(band));
}

fn cubic_at(cubic: vec4f, x: f32) -> f32 {
    return ((cubic.w * x + cubic.z) * x + cubic.y) * x + cubic.x;
}

fn cubic_slope(cubic: vec4f, x: f32) -> f32 {
    return (3.0 * cubic.w * x + 2.0 * cubic.z) * x + cubic.y;
}

// The field on the way from a place in a cell, by powers of the share of the way.
fn cubic_along(corners: Corners, enter: vec3f, way: vec3f) -> vec4f {
    // Lines in z at the four edges, then parabolas in x, then the cubic in y.
    let start = corners.low + enter.z * corners.rise;
    let slope = way.z * corners.rise;
    let front = vec2f(start.z - start.w, slope.z - slope.w);
    let back = vec2f(start.y - start.x, slope.y - slope.x);
    let near = vec3f(start.w + front.x * enter.x, slope.w + front.y * enter.x + front.x * way.x, front.y * way.x);
    let far = vec3f(start.x + back.x * enter.x, slope.x + back.y * enter.x + back.x * way.x, back.y * way.x);
    let across = far - near;
    return vec4f(near + enter.y * across, 0.0) + vec4f(0.0, way.y * across);
}

// Where a cubic, monotone on [0, span], comes to a value.
fn reach(cubic: vec4f, span: f32, u_end: f32, goal: f32) -> f32 {
    let total = u_end - cubic.x;
    var low = 0.0;
    var high = span;
    var x = span * clamp(select((goal - cubic.x) / total, 0.0, total == 0.0), 0.0, 1.0);
    for (var i = 0; i < 24; i++) {
        let residual = cubic_at(cubic, x) - goal;
        if residual == 0.0 {
            break;
        }
        if (residual < 0.0) == (total >= 0.0) {
            low = x;
        } else {
            high = x;
        }
        let newton = x - residual / cubic_slope(cubic, x);
        let next = select(0.5 * (low + high), newton, newton >= low && newton <= high);
        let moved = abs(next - x);
        x = next;
        if moved <= 2e-7 * abs(next) {
            break;
        }
    }
    return x;
}

// Adds the light of an interval of this width.
fn add_interval(light: ptr<function, Light>, band: Band, cubic: vec4f, width: f32, length: f32) {
    let nodes = vec3f(cubic_at(cubic, 0.11270167 * width), cubic_at(cubic, 0.5 * width), cubic_at(cubic, 0.88729835 * width));
    let u = clamp(nodes, vec3f(band.low), vec3f(band.high));
    let is_opaque = nodes.x == nodes.z && band.clearness - band.opacity_slope * nodes.y <= 0.0;
    let extinctions = vec3f(extinction_at(band, u.x), extinction_at(band, u.y), extinction_at(band, u.z));
    let depths = select(extinctions, vec3f(OPAQUE), is_opaque) * (length * width);
    let weights = vec3f(5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0);
    let front = vec3f(
        dot(depths, vec3f(5.0 / 36.0, -0.03597667, 0.009789444)),
        dot(depths, vec3f(0.3002632, 2.0 / 9.0, -0.022485417)),
        dot(depths, vec3f(0.26798833, 0.48042112, 5.0 / 36.0)));
    let scale = 1.0 / max(largest(depths), 1e-37);
    let seen = depths * scale * weights * exp2(-clamp(front, vec3f(0.0), vec3f(60.0)));
    let sum = seen.x + seen.y + seen.z;
    if sum > 0.0 {
        let depth = (*light).depth + dot(depths, weights);
        let transmittance = exp2(-depth);
        let color = band.color + band.color_slope * (dot(seen, u) / sum);
        (*light).color += ((*light).transmittance - transmittance) * color;
        (*light).depth = depth;
        (*light).transmittance = transmittance;
    }
}

// The width of an interval, or of a part of it where it is deep and coloured.
fn shallow_width(band: Band, cubic: vec4f, width: f32, goal: f32, length: f32) -> f32 {
    let first = extinction_at(band, cubic.x) * length;
    let is_tinted = largest(abs(band.color_slope)) * abs(goal - cubic.x) > MIN_TINT;
    if !is_tinted || width * max(first, extinction_at(band, goal) * length) <= MAX_INTERVAL_DEPTH * 1.442695 {
        return width;
    }
    var part = width;
    for (var i = 0; i < 4; i++) {
        let steepest = max(first, extinction_at(band, cubic_at(cubic, part)) * length);
        part = min(part, sqrt(part) * sqrt(MAX_INTERVAL_DEPTH * 1.442695 / steepest));
    }
    let steepest = max(first, extinction_at(band, cubic_at(cubic, part)) * length);
    return min(part, 1.5 * MAX_INTERVAL_DEPTH * 1.442695 / steepest);
}

// Adds the light of one cell, along whose way the texel is this cubic; `length` is the way's optical depth to the base
// 2 per -ln(1 - opacity).
fn add_exactly(light: ptr<function, Light>, field: vec4f, ends: vec2f, range: vec2f, length: f32) {
    // No value lies beyond the corners, whatever rounding says: a field that only touches a step stays on its side. And
    // beside an outlier its ends are those of the neighbouring cells: no band between the two may be passed unseen.
    let is_huge = range.y - range.x > frame.huge_range;
    let first = clamp(select(field.x, ends.x, is_huge), range.x, range.y);
    let last = clamp(ends.y, range.x, range.y);
    let whole = vec4f(first, field.yzw);
    let steepest = abs(whole.y) + 2.0 * abs(whole.z) + 3.0 * abs(whole.w);
    // Where the cubic turns.
    let root = sqrt(whole.z * whole.z - 3.0 * whole.w * whole.y);
    let q = -(whole.z + select(root, -root, whole.z < 0.0));
    let s = q / (3.0 * whole.w);
    let r = whole.y / q;
    let turn_s = select(1.0, s, s > 0.0 && s < 1.0);
    let turn_r = select(1.0, r, r > 0.0 && r < 1.0);
    let turns = vec2f(min(turn_s, turn_r), max(turn_s, turn_r));
    var index = find_band(whole.x);
    var band = band_at(index);
    var cubic = whole - vec4f(band.base, 0.0, 0.0, 0.0);
    var section_end = 0.0;
    var span = 0.0;
    var rises = true;
    var is_start = true;
    for (var i = 0u; i < 64u + 64u * frame.num_bands; i++) {
        if is_start {
            if section_end >= 1.0 {
                break;
            }
            let next = select(select(1.0, turns.y, turns.y > section_end), turns.x, turns.x > section_end);
            span = next - section_end;
            section_end = next;
            rises = select(cubic_at(cubic, span), last - band.base, is_huge && section_end >= 1.0) >= cubic.x;
            is_start = false;
        }
        let u_end = select(cubic_at(cubic, span), last - band.base, is_huge && section_end >= 1.0);
        let edge = select(band.low, band.high, rises);
        let falls_past = u_end < edge && range.x - band.base < edge;
        let is_beyond = select(falls_past, (edge < u_end && edge < range.y - band.base), rises);
        var goal = select(u_end, edge, is_beyond);
        let now = band.clearness - band.opacity_slope * cubic.x;
        let then = band.clearness - band.opacity_slope * goal;
        let least = max(now / MAX_GROWTH, MIN_CLEARNESS);
        let greatest = max(now, MIN_CLEARNESS) * MAX_GROWTH;
        let falls = now > 1.01 * MIN_CLEARNESS && then < 0.99 * least;
        var is_cut = falls || then > 1.01 * greatest;
        if is_cut {
            goal = (band.clearness - select(greatest, least, falls)) / band.opacity_slope;
        }
        var width = span;
        if is_cut || is_beyond {
            width = reach(cubic, span, u_end, goal);
            // Beside an outlier bands are passed in less than rounding. Yet not in nothing.
            let least = abs(goal - cubic.x) / steepest;
            width = select(width, max(width, least), is_huge && !is_cut && least <= 1.0);
        }
        let part = shallow_width(band, cubic, width, goal, length);
        let is_deep = part < width;
        if is_deep {
            width = part;
            goal = cubic_at(cubic, part);
        }
        let crosses = is_beyond && !is_cut && !is_deep;
        is_cut = is_cut || is_deep;

        add_interval(light, band, cubic, width, length);
        if (*light).depth >= OPAQUE_DEPTH {
            break;
        }
        cubic = vec4f(
            cubic_at(cubic, width), cubic_slope(cubic, width), 3.0 * cubic.w * width + cubic.z, cubic.w);
        span = max(span - width, 0.0);
        if crosses {
            index = select(index - 1u, index + 1u, rises);
            band = band_at(index);
            cubic.x = select(band.high, band.low, rises);
        } else if is_cut {
            cubic.x = goal;
        } else {
            is_start = true;
        }
    }
}

// The light that a ray sees.
//
// One loop, each round of which leaves one box: a cell of a brick, or a cube of empty units. Nested loops would
// make the rays of a SIMD group wait for one another at the end of each inner one.
fn light_along(ray: Ray) -> Light {
    let first_faces = (mix(frame.cells, vec3f(0.0), ray.rising) - ray.start) * ray.inverse;
    let last_faces = (mix(vec3f(0.0), frame.cells, ray.rising) - ray.start) * ray.inverse;
    var t = max(largest(first_faces), 0.0);
    let t_end = min(smallest(last_faces), ray.end);
    // The finest cell that the ray is in.
    var place = clamp(floor(ray.start + t * ray.direction), vec3f(0.0), frame.cells - 1.0);
    var light = Light(vec3f(0.0), 0.0, 1.0, 0.0, 0.0);
    // The texel at t, where the cell before was of the same level; its level, or none.
    var end = End(0.0, 0.0, vec4f(0.0));
    var end_level = NO_LEVEL;
    let unit_size = frame.unit_cells;
    while t < t_end && light.depth < OPAQUE_DEPTH && all(place >= vec3f(0.0)) && all(place < frame.cells) {
        let unit = floor((place + 0.5) * frame.units_per_cell);
        let words = textureLoad(units, vec3i(unit), 0).xy;
        let is_occupied = (words.x & OCCUPIED) != 0u;
        let level = (words.x >> LEVEL_SHIFT) & LEVEL_MASK;
        // Powers of two, from their exponents.
        let scale = bitcast<f32>((127u + level) << 23u);
        let inverse_scale = bitcast<f32>((127u - level) << 23u);
        // Of the brick and its cell: lower corner.
        let brick_size = scale * frame.brick_cells;
        let brick_low = floor((place + 0.5) * (frame.bricks_per_cell * inverse_scale)) * brick_size;
        let cell = floor((place + 0.5 - brick_low) * inverse_scale);
        let cells = vec3f((vec3u(words.y) >> vec3u(0u, CELLS_SHIFT, 2u * CELLS_SHIFT)) & vec3u(CELLS_MASK));
        let is_visible = is_occupied && all(cell < cells);
        let slot = vec2u(words.x >> LAYER_SHIFT, words.x) & vec2u(SLOT_MASK);
        let stored = corners_of_cell(slot, select(vec3f(0.0), cell, is_visible));
        let peak = max(stored.low, stored.low + stored.rise);
        let is_blank = HAS_BLANKS && max(max(peak.x, peak.y), max(peak.z, peak.w)) >= BLANK;
        let is_matter = is_visible && !is_blank;
        // What is no matter may be anything, and must not count.
        let texels = texels_of(stored);
        let corners = Corners(select(vec4f(0.0), texels.low, is_matter), select(vec4f(0.0), texels.rise, is_matter));

        // The box that this round leaves.
        let radius = f32(words.x) - 1.0;
        let low = select((unit - radius) * unit_size, brick_low + cell * scale, is_occupied);
        let high = low + select((2.0 * radius + 1.0) * unit_size, scale, is_occupied);
        let faces = (mix(low, high, ray.rising) - ray.start) * ray.inverse;
        let exit = max(min(smallest(faces), t_end), t);
        // A round without length finds the value where a run of cells begins.
        let is_start = is_matter && level != end_level;
        let t_far = select(exit, t, is_start);
        let origin = ray.start - low;
        let far_middle = texel_at(corners, (origin + 0.5 * (t + t_far) * ray.direction) * inverse_scale);
        let far = texel_at(corners, (origin + t_far * ray.direction) * inverse_scale);
        let bend = abs(2.0 * far_middle - end.texel - far);
        let way = (t_far - t) * inverse_scale * ray.motion;
        let twist = abs(corners.rise.w - corners.rise.z - corners.rise.x + corners.rise.y) * abs(way.x * way.y * way.z);
        let light_behind = select(0.0, light.transmittance, is_matter && !is_start);
        let far_depth = 0.5 * (t_far - t) * ray.depth_per_t;
        let doubt = (bend * (1.0 / 6.0) + twist * (1.0 / 16.0)) * frame.slope * far_depth * light_behind;
        var is_exact = (is_matter && !is_start && (words.y & EXACT) != 0u) || doubt > 4.0 * MAX_DOUBT;
        let is_halved = !is_exact && doubt > MAX_DOUBT;
        let t_next = select(t_far, 0.5 * (t + t_far), is_halved);
        let last = select(far, far_middle, is_halved);
        var middle = far_middle;
        if is_halved {
            middle = texel_at(corners, (origin + 0.5 * (t + t_next) * ray.direction) * inverse_scale);
        }
        let depth = select(0.0, 0.5 * (t_next - t) * ray.depth_per_t, is_matter);
        let a = piece_to(end, balanced(end.texel, middle, last), depth);
        let b = piece_to(a.end, last, depth);
        let color_doubt = doubt_of_color(a, b) * light_behind;
        is_exact = is_exact || color_doubt > MAX_DOUBT;
        if is_exact {
            let enter = (origin + t * ray.direction) * inverse_scale;
            let length = (t_next - t) * ray.depth_per_t * frame.depth_scale;
            let top = corners.low + corners.rise;
            let least = min(corners.low, top);
            let greatest = max(corners.low, top);
            let range = vec2f(
                min(min(least.x, least.y), min(least.z, least.w)),
                max(max(greatest.x, greatest.y), max(greatest.z, greatest.w)));
            let cubic = cubic_along(corners, enter, (t_next - t) * inverse_scale * ray.motion);
            add_exactly(&light, cubic, vec2f(end.texel, last), range, length);
            light.doubt += EXACT_DOUBT * (light_behind - light.transmittance);
        } else {
            light.doubt += color_doubt + select(doubt, 0.125 * doubt, is_halved);
            light.table_way += 2.0 * depth * light_behind;
            add_pair(&light, a, b);
        }
        end = b.end;
        end_level = select(NO_LEVEL, level, is_matter);

        let inside = clamp(floor(ray.start + t_next * ray.direction), low, min(high, frame.cells) - 1.0);
        let beyond = mix(low - 1.0, high, ray.rising);
        place = select(select(inside, beyond, faces <= vec3f(t_next)), place, vec3<bool>(is_start));
        t = t_next;
    }
    light.color += light.transmittance * ray.behind;
    return light;
}

// Pixels of a tile in an order that keeps neighbours in one SIMD group of 8 or more.
fn place_in_tile(lane: u32) -> vec2u {
    let x = (lane & 3u) | (((lane >> 3u) & 1u) << 2u);
    let y = ((lane >> 2u) & 1u) | ((lane >> 4u) << 1u);
    return vec2u(x, y);
}

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let pixel = group.xy * TILE + place_in_tile(lane) + vec2u(0u, frame.first_row);
    if pixel.x >= frame.width || pixel.y >= frame.end_row {
        return;
    }
    let light = light_along(ray_of_pixel(pixel));
    let color = light.color;
    atomicMax(&worst[0], bitcast<u32>(light.doubt));
    atomicMax(&worst[1], bitcast<u32>(light.table_way));
    let index = 3u * ((pixel.y - frame.first_row) * frame.width + pixel.x);
    picture[index] = color.r;
    picture[index + 1u] = color.g;
    picture[index + 2u] = color.b;
}
