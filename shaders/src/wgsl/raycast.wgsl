// Casts one ray per pixel through the bricks of a volume.
//
// *Units* cover the volume evenly and say which brick is there, or how far around space is empty: a ray leaps
// over such space. Elsewhere it visits the cells between samples: along a ray the trilinear field of a cell has no
// kinks. Two straight pieces are integrated through the transfer function's antiderivative, of a stretch so short that
// what that may be off by is little; where the table is too coarse, the cubic itself is, from control point to control
// point.
//
// Texels are counted from `texel_origin`, in the units of the samples.
//
// import exact
//
// Positions are in finest cells from the volume's lower corner, `t` is the way along the ray in finest cells, from
// a start that the CPU chose near the volume, so that 32 bits do.

struct Frame {
    // The ray of image point (x, y) starts at `origin + x * origin_dx + y * origin_dy`, directions likewise.
    origin: vec3f,
    // Pixels of this tile of the picture; image points count from its corner.
    width: u32,
    origin_dx: vec3f,
    height: u32,
    origin_dy: vec3f,
    // Whether this is the first part of the picture: 0 or 1.
    is_first: u32,
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
    texel_origin: f32,
    // One over the atlas's size in texels.
    atlas_scale: vec2f,
    // The entry of the antiderivatives that stands for all texels above the bins.
    last_entry: f32,
    // Of a brick in the atlas: slices side by side, the same the other way round, and rows of texels.
    slices_per_row: f32,
    rows_per_slice: f32,
    slot_height: f32,
    slots_per_layer: u32,
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
    // How far from a step the texel of a constant cell may have been rounded across it.
    flat_rounding: f32,
    // Of surfaces: what is added to their depth to count from the ray's start, and finest cells per depth for a
    // direction of length 1 as the frame has it.
    surface_offset: f32,
    cells_per_depth: f32,
    // Pixels per axis that share a ray, that of the pixel after so many halves; and the last pixel of the tile.
    stride: u32,
    last_pixel: vec2u,
}

// Whether texels may be blank.
override HAS_BLANKS: bool = false;
// Whether texels are whole numbers, which the atlas's formats round.
override IS_WHOLE: bool = false;
// Whether there are cells for which the table is too coarse. What is not compiled costs nothing: on llvmpipe the code
// of the exact way alone made rays take almost three times as long.
override HAS_EXACT: bool = true;
// Whether units hold bricks that are not of this part.
override HAS_OTHERS: bool = false;
// Whether bricks join coarser ones.
override HAS_SEAMS: bool = false;
// Whether rays end at surfaces.
override HAS_SURFACES: bool = false;

// Texels from here on are blank.
const BLANK: f32 = 1e38;
// Optical depth to the base 2 at which a ray stops: it lets 1/4096 of the light through.
const OPAQUE_DEPTH: f32 = 12.0;
// Changes of the transfer function's antiderivative below this are none: their inverse might not be finite.
const INVISIBLE: f32 = 1e-30;
// The largest doubt of a stretch of ray, as a difference of a colour channel: beyond, it is made shorter, but not than
// a part of a cell: beside an outlier what can be seen is passed in less than that, and holds nothing.
const MIN_STRETCH: f32 = 0.015625;
const MAX_DOUBT: f32 = 0.001;
// What a channel may be off by where a cell was integrated exactly, as a share of the light that it takes: above most that
// was found, in dense combs of opaque bands.
const EXACT_DOUBT: f32 = 0.0075;
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
// Of each pixel of this tile, the colour it has gathered from the front, and the share of light that still comes through.
@group(0) @binding(5) var<storage, read_write> gathered: array<vec4f>;
// Of each pixel of this tile, colour and depth.
@group(0) @binding(6) var surfaces: texture_2d<f32>;
// The transfer function's bands, three to a band: [base, low, high, opacity], [opacity slope, clearness, red, green],
// [blue, red slope, green slope, blue slope]. A texel's place in one is its distance u from the base; it holds those
// from low to high. Opacity is per unit distance, clearness what is missing to 1; slopes are per texel.
@group(0) @binding(7) var<storage, read> bands: array<vec4f>;
// The largest doubt of any ray, the longest way through cells that were read from the table, and the most that touched
// steps may change: bits of numbers of at least 0, which are in order as the numbers are.
@group(0) @binding(8) var<storage, read_write> worst: array<atomic<u32>>;
// A bit per slot, set where its brick is of this part.
@group(0) @binding(9) var<storage, read> chosen: array<u32>;
// Per slot, the seams of its brick: the faces and edges that join a coarser brick, each by the direction s in which it
// lies, of -1, 0 and 1: bit (s.x + 1) + 3 (s.y + 1) + 9 (s.z + 1).
@group(0) @binding(10) var<storage, read> seams: array<u32>;

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
    // Where it ends.
    end: f32,
}

struct Light {
    color: vec3f,
    depth: f32,
    transmittance: f32,
    // What a channel may be off by, but for the arithmetic; and the way through cells that were read from the table, as
    // depth to the base 2 of matter that has depth 1 per unit length, as it is seen.
    doubt: f32,
    table_way: f32,
    // What a channel may be off by where rounding says on which side of a step the field is.
    touching: f32,
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

// Of an exponent, counted from -127.
fn power_of_2(exponent: u32) -> f32 {
    return bitcast<f32>(exponent << 23u);
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
    if HAS_SURFACES {
        let place = min(pixel * frame.stride + frame.stride / 2u, frame.last_pixel);
        let depth = textureLoad(surfaces, place, 0).a;
        end = (depth + frame.surface_offset) * frame.cells_per_depth * length(way);
    }
    let motion = select(direction, vec3f(0.0), is_still);
    return Ray(start, direction, motion, 1.0 / direction, select(vec3f(0.0), vec3f(1.0), rising), depth_per_t, end);
}

// Where a gather reads the corners of a cell in the slice z of a brick.
fn slice_place(corner: vec2f, z: f32) -> vec2f {
    let row = floor((z + 0.5) * frame.rows_per_slice);
    return (corner + (frame.brick_cells + 1.0) * vec2f(z - row * frame.slices_per_row, row)) * frame.atlas_scale;
}

// A brick's cells per axis, from a unit's second word.
fn cells_of(word: u32) -> vec3f {
    return vec3f((vec3u(word) >> vec3u(0u, CELLS_SHIFT, 2u * CELLS_SHIFT)) & vec3u(CELLS_MASK));
}

// Layer and row of a brick's slot, from a unit's first word.
fn slot_of(word: u32) -> vec2u {
    return vec2u(word >> LAYER_SHIFT, word) & vec2u(SLOT_MASK);
}

// The number of a brick's slot, from a unit's first word.
fn slot_number(word: u32) -> u32 {
    let slot = slot_of(word);
    return slot.x * frame.slots_per_layer + slot.y;
}

// Whether a brick is no part of what is drawn, from a unit's first word.
fn is_other(word: u32) -> bool {
    let slot = slot_number(word);
    return ((chosen[slot / 32u] >> (slot % 32u)) & 1u) == 0u;
}

fn corners_of_cell(slot: vec2u, cell: vec3f) -> Corners {
    let corner = vec2f(0.0, f32(slot.y) * frame.slot_height) + cell.xy + 1.0;
    let low = textureGather(0, atlas, atlas_sampler, slice_place(corner, cell.z), slot.x);
    let high = textureGather(0, atlas, atlas_sampler, slice_place(corner, cell.z + 1.0), slot.x);
    return Corners(low, high - low);
}

fn is_blank(corners: Corners) -> bool {
    let peak = max(corners.low, corners.low + corners.rise);
    return HAS_BLANKS && max(max(peak.x, peak.y), max(peak.z, peak.w)) >= BLANK;
}

// What the atlas holds as texels from their origin. What is no matter may be anything, and must not count.
fn texels_of(stored: Corners, is_matter: bool) -> Corners {
    var texels = Corners(stored.low - frame.texel_origin, stored.rise);
    if IS_WHOLE {
        let low = round(stored.low * frame.texels_per_step);
        let high = round((stored.low + stored.rise) * frame.texels_per_step);
        texels = Corners(low - frame.texel_origin, high - low);
    }
    return Corners(select(vec4f(0.0), texels.low, is_matter), select(vec4f(0.0), texels.rise, is_matter));
}

// A sample of a brick, as a texel from the origin.
fn sample_at(slot: vec2u, place: vec3f) -> f32 {
    let row = floor((place.z + 0.5) * frame.rows_per_slice);
    let slice = (frame.brick_cells + 1.0) * vec2f(place.z - row * frame.slices_per_row, row);
    let at = vec2f(0.0, f32(slot.y) * frame.slot_height) + place.xy + slice;
    let stored = textureLoad(atlas, vec2i(at), slot.x, 0).x;
    return select(stored, round(stored * frame.texels_per_step), IS_WHOLE) - frame.texel_origin;
}

// A sample of a brick of `cells` cells, or what a seam makes of it: at an odd place the mean of its neighbours at even ones.
fn joined_sample(seam: u32, slot: vec2u, place: vec3f, cells: vec3f, own: f32) -> f32 {
    let side = select(vec3f(1.0), vec3f(0.0), place == vec3f(0.0)) + select(vec3f(0.0), vec3f(1.0), place == vec3f(frame.brick_cells));
    let is_odd = (side == vec3f(1.0)) & (floor(place * 0.5) * 2.0 != place);
    if ((seam >> u32(dot(side, vec3f(1.0, 3.0, 9.0)))) & 1u) == 0u || !any(is_odd) {
        return own;
    }
    // One step along the first axis of odd place, one along the others: of those there is one at most.
    let first = vec3<bool>(is_odd.x, is_odd.y && !is_odd.x, is_odd.z && !is_odd.x && !is_odd.y);
    let a = select(vec3f(0.0), vec3f(1.0), first);
    let b = select(vec3f(0.0), vec3f(1.0), is_odd) - a;
    var sum = sample_at(slot, place - a - b) + sample_at(slot, min(place + a - b, cells));
    sum += sample_at(slot, min(place - a + b, cells)) + sample_at(slot, min(place + a + b, cells));
    return 0.25 * sum;
}

// The corners of a cell of the brick that a unit's words name, along a seam or not; without a brick as they are.
fn joined_corners(corners: Corners, words: vec2u, cell: vec3f) -> Corners {
    if !HAS_SEAMS || words.x == 0u || !any((cell == vec3f(0.0)) | (cell == vec3f(frame.brick_cells - 1.0))) {
        return corners;
    }
    let seam = seams[slot_number(words.x)];
    if seam == 0u {
        return corners;
    }
    let slot = slot_of(words.x);
    let cells = cells_of(words.y);
    var low = corners.low;
    var high = corners.low + corners.rise;
    for (var i = 0u; i < 4u; i++) {
        // Gathered in the order (0, 1), (1, 1), (1, 0), (0, 0) of (x, y).
        let place = cell + vec3f(f32(((i + 1u) >> 1u) & 1u), f32(1u - (i >> 1u)), 0.0);
        low[i] = joined_sample(seam, slot, place, cells, low[i]);
        high[i] = joined_sample(seam, slot, place + vec3f(0.0, 0.0, 1.0), cells, high[i]);
    }
    return Corners(low, high - low);
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

// How far the two straight lines over a balanced middle are from the field, a parabola, in the mean.
fn mean_distance(first: f32, middle: f32, last: f32, moved: f32) -> f32 {
    let bend = 2.0 * middle - first - last;
    // A sixth of the bend takes a middle where it is in balance.
    let is_balanced = abs(6.0 * (moved - middle) - bend) <= 0.01 * abs(bend);
    return abs(bend) * select(1.0 / 12.0, 4.0 / 81.0, is_balanced);
}

fn piece_to(from_end: End, texel: f32, depth_scale: f32) -> Piece {
    let bin = bin_of(texel);
    let is_flat = bin == from_end.bin;
    let entry = i32(clamp(bin, 0.0, frame.last_entry));
    // Two ends at one edge count as the whole bin above it: values are on the upper side of a step.
    let other = select(entry, entry + 1, is_flat);
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
// `1/2 - 1/x + 1/(exp(x) - 1)` of the optical depth x. As numerator and denominator.
fn front_weight(depth: f32) -> vec2f {
    let x = min(depth * 0.6931472, 8.0);
    return vec2f(x, 0.2 * x * x + 12.0);
}

fn add_pair(light: ptr<function, Light>, a: Piece, b: Piece) {
    let weight_a = front_weight(a.depth);
    let weight_b = front_weight(b.depth);
    let thick = max(max(a.depth, b.depth), INVISIBLE);
    let divisors = weight_a.y * weight_b.y;
    // One division for three.
    let inverse = 1.0 / (divisors * thick);
    // Where one piece is much thinner than the other, its colour tells little of the other's.
    let slope = (min(a.depth, b.depth) * divisors * inverse) * (b.color - a.color);
    let middle_depth = (*light).depth + a.depth;
    let depth = middle_depth + b.depth;
    let middle = exp2(-middle_depth);
    let transmittance = exp2(-depth);
    // The differences of transmittance add up to exactly what is missing behind.
    let share_a = (*light).transmittance - middle;
    let share_b = middle - transmittance;
    let shift = (share_a * weight_a.x * weight_b.y + share_b * weight_b.x * weight_a.y) * thick * inverse;
    (*light).color += share_a * a.color + share_b * b.color - shift * slope;
    (*light).depth = depth;
    (*light).transmittance = transmittance;
}

// What straight pieces in place of the field may be off by, per depth of half the way.
fn doubt_of_field(corners: Corners, distance: f32, way: vec3f) -> f32 {
    let twist = abs(corners.rise.w - corners.rise.z - corners.rise.x + corners.rise.y) * abs(way.x * way.y * way.z);
    return (2.0 * distance + twist * (1.0 / 16.0)) * frame.slope;
}

// The share of a stretch whose doubt is good: it falls with the third power.
fn good_share(doubt: f32) -> f32 {
    return exp2(log2(MAX_DOUBT / doubt) / 3.0);
}

// What the change of colour hides: within a piece the light of its front and its back are told apart by the
// neighbouring piece only.
fn doubt_of_color(a: Piece, b: Piece) -> f32 {
    let depth = max(a.depth, b.depth) * 0.6931472;
    return depth * depth * largest(abs(b.color - a.color)) * (1.0 / 32.0);
}

// A stretch of a cell: the texels in its middle and at its end, and the balanced middle.
struct Stretch {
    middle: f32,
    last: f32,
    over: f32,
}

// The stretch between two places of a ray that starts at `origin` and goes by `step`, whose first texel is known.
fn stretch_of(corners: Corners, first: f32, origin: vec3f, places: vec2f, step: vec3f) -> Stretch {
    let middle = texel_at(corners, origin + 0.5 * (places.x + places.y) * step);
    let last = texel_at(corners, origin + places.y * step);
    return Stretch(middle, last, balanced(first, middle, last));
}

// The texel at a place of a cell of the brick that a unit's words name, if it lies beside an outlier: there the field a
// hair from a face is nothing like that on it, and places are known to a hair. Those near a face count as on it, as they do
// for the cell on its other side, and corners without weight count for nothing.
fn texel_beside_outlier(corners: Corners, words: vec2u, cell: vec3f, place: vec3f, texel: f32) -> f32 {
    let range = range_of(corners);
    if !HAS_EXACT || words.x == 0u || !(range.y - range.x > frame.huge_range) {
        return texel;
    }
    let hair = max(PLACE_ROUNDING, 2.4e-7 * largest(frame.cells));
    let w = select(place, round(place), abs(place - round(place)) <= vec3f(hair));
    let slot = slot_of(words.x);
    var sum = 0.0;
    for (var i = 0u; i < 8u; i++) {
        let corner = vec3f(vec3u(i, i >> 1u, i >> 2u) & vec3u(1u));
        let weights = mix(1.0 - w, w, corner);
        let weight = weights.x * weights.y * weights.z;
        if weight != 0.0 {
            sum += weight * sample_at(slot, cell + corner);
        }
    }
    return sum;
}

// The finest cell that a ray is in from `t` on, in a box that it leaves at `faces` or beside it.
fn place_behind(ray: Ray, t: f32, low: vec3f, high: vec3f, faces: vec3f) -> vec3f {
    let inside = clamp(floor(ray.start + t * ray.direction), low, min(high, frame.cells) - 1.0);
    return select(inside, mix(low - 1.0, high, ray.rising), faces <= vec3f(t));
}

// The light of the matter along a ray, behind what it has gathered.
//
// One loop, each round of which leaves one box: a cell of a brick, or a cube of empty units. Nested loops would
// make the rays of a SIMD group wait for one another at the end of each inner one.
fn light_along(ray: Ray, before: vec4f) -> Light {
    let first_faces = (mix(frame.cells, vec3f(0.0), ray.rising) - ray.start) * ray.inverse;
    let last_faces = (mix(vec3f(0.0), frame.cells, ray.rising) - ray.start) * ray.inverse;
    var t = max(largest(first_faces), 0.0);
    let t_end = min(smallest(last_faces), ray.end);
    // The finest cell that the ray is in.
    var place = clamp(floor(ray.start + t * ray.direction), vec3f(0.0), frame.cells - 1.0);
    var light = Light(before.rgb, select(-log2(before.a), 0.0, before.a == 1.0), before.a, 0.0, 0.0, 0.0);
    // The texel at t, where the cell before was of the same level; its level, or none.
    var end = End(0.0, 0.0, vec4f(0.0));
    var end_level = NO_LEVEL;
    // The longest stretch that the next round may take of a cell.
    var reach = FAR;
    while t < t_end && light.depth < OPAQUE_DEPTH && all(place >= vec3f(0.0)) && all(place < frame.cells) {
        let unit = floor((place + 0.5) * frame.units_per_cell);
        let words = textureLoad(units, vec3i(unit), 0).xy;
        let is_occupied = (words.x & OCCUPIED) != 0u;
        let level = (words.x >> LEVEL_SHIFT) & LEVEL_MASK;
        let scale = power_of_2(127u + level);
        let inverse_scale = power_of_2(127u - level);
        let brick_low = floor((place + 0.5) * (frame.bricks_per_cell * inverse_scale)) * (scale * frame.brick_cells);
        let cell = floor((place + 0.5 - brick_low) * inverse_scale);
        let is_passed = HAS_OTHERS && is_occupied && is_other(words.x);
        let is_visible = is_occupied && !is_passed && all(cell < cells_of(words.y));
        let stored = corners_of_cell(slot_of(words.x), select(vec3f(0.0), cell, is_visible));
        let is_matter = is_visible && !is_blank(stored);
        let corners = joined_corners(texels_of(stored, is_matter), select(vec2u(0u), words, is_matter), cell);

        // The box that this round leaves.
        let around = f32(words.x);
        let low = select((unit + 1.0 - around) * frame.unit_cells, brick_low + select(cell, vec3f(0.0), is_passed) * scale, is_occupied);
        let high = low + select((2.0 * around - 1.0) * frame.unit_cells, select(1.0, frame.brick_cells, is_passed) * scale, is_occupied);
        let faces = (mix(low, high, ray.rising) - ray.start) * ray.inverse;
        let exit = max(min(smallest(faces), t_end), t);
        // A round without length finds the value where a run of cells begins.
        let is_start = is_matter && level != end_level;
        let t_far = select(min(exit, t + reach), t, is_start);
        let origin = ray.start - low;
        let light_behind = select(0.0, light.transmittance, is_matter && !is_start);
        let is_hard = HAS_EXACT && is_matter && (words.y & EXACT) != 0u;
        let is_exact = is_hard && light_behind > 0.0;
        let step = ray.direction * inverse_scale;
        var stretch = stretch_of(corners, end.texel, origin * inverse_scale, vec2f(t, t_far), step);
        let hard_words = select(vec2u(0u), words, is_hard);
        stretch.last = texel_beside_outlier(corners, hard_words, cell, origin * inverse_scale + t_far * step, stretch.last);
        let distance = mean_distance(end.texel, stretch.middle, stretch.last, stretch.over);
        let way = (t_far - t) * inverse_scale * ray.motion;
        var doubt = doubt_of_field(corners, distance, way) * 0.5 * (t_far - t) * ray.depth_per_t * light_behind;
        var t_next = t_far;
        if doubt > MAX_DOUBT && !is_exact {
            t_next = min(t + max(good_share(doubt) * (t_far - t), MIN_STRETCH * scale), t_far);
            stretch = stretch_of(corners, end.texel, origin * inverse_scale, vec2f(t, t_next), step);
            doubt = min(doubt, MAX_DOUBT);
        }
        let depth = select(0.0, 0.5 * (t_next - t) * ray.depth_per_t, is_matter);
        let a = piece_to(end, stretch.over, depth);
        let b = piece_to(a.end, stretch.last, depth);
        let color_doubt = doubt_of_color(a, b) * light_behind;
        if color_doubt > MAX_DOUBT && !is_exact && t_next - t > MIN_STRETCH * scale {
            reach = 0.5 * (t_next - t);
            continue;
        }
        reach = min(2.0 * reach, FAR);
        if is_exact {
            let cubic = cubic_along(corners, (origin + t * ray.direction) * inverse_scale, way);
            add_exactly(&light, cubic, vec2f(end.texel, stretch.last), range_of(corners), 2.0 * depth * frame.depth_scale);
            light.doubt += EXACT_DOUBT * (light_behind - light.transmittance);
        } else {
            light.doubt += color_doubt + doubt;
            light.table_way += 2.0 * depth * light_behind;
            add_pair(&light, a, b);
        }
        end = b.end;
        end_level = select(NO_LEVEL, level, is_matter);

        place = select(place_behind(ray, t_next, low, high, faces), place, vec3<bool>(is_start));
        t = t_next;
    }
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
    let pixel = group.xy * TILE + place_in_tile(lane);
    if pixel.x >= frame.width || pixel.y >= frame.height {
        return;
    }
    let index = pixel.y * frame.width + pixel.x;
    var before = vec4f(0.0, 0.0, 0.0, 1.0);
    if frame.is_first == 0u {
        before = gathered[index];
    }
    let light = light_along(ray_of_pixel(pixel), before);
    atomicMax(&worst[0], bitcast<u32>(light.doubt));
    atomicMax(&worst[1], bitcast<u32>(light.table_way));
    atomicMax(&worst[2], bitcast<u32>(light.touching));
    gathered[index] = vec4f(light.color, light.transmittance);
}
