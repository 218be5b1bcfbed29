// The light of single cells, exactly but for the arithmetic: a part of `raycast.wgsl`. The same as in the software
// executor (`exact.rs`), which says why it is so.

// What is missing to opaque changes at most by this factor in one interval, and counts as nothing below the second.
const MAX_GROWTH: f32 = 4.0;
const MIN_CLEARNESS: f32 = 1e-3;
// Largest optical depth of an interval along which the colour changes, by at least so much in a channel.
const MAX_INTERVAL_DEPTH: f32 = 1.0;
const MIN_TINT: f32 = 1e-3;
// How exactly a place in a cell is known, in cells: what a field is off by, as a share of the range of the corners.
const PLACE_ROUNDING: f32 = 1e-5;
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
    let least = select(2.9802322e-8, 1e-37, band.opacity_slope == 0.0);
    let clearness = clamp(band.clearness - band.opacity_slope * u, least, 1.0);
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

// Where a cubic turns in (0, 1), in order; 1 where it does not.
fn turns_of(cubic: vec4f) -> vec2f {
    let root = sqrt(cubic.z * cubic.z - 3.0 * cubic.w * cubic.y);
    let q = -(cubic.z + select(root, -root, cubic.z < 0.0));
    let s = q / (3.0 * cubic.w);
    let r = cubic.y / q;
    let turn_s = select(1.0, s, s > 0.0 && s < 1.0);
    let turn_r = select(1.0, r, r > 0.0 && r < 1.0);
    return vec2f(min(turn_s, turn_r), max(turn_s, turn_r));
}

// Least and greatest corner of a cell.
fn range_of(corners: Corners) -> vec2f {
    let top = corners.low + corners.rise;
    let least = min(corners.low, top);
    let greatest = max(corners.low, top);
    return vec2f(
        min(min(least.x, least.y), min(least.z, least.w)),
        max(max(greatest.x, greatest.y), max(greatest.z, greatest.w)));
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

// Adds what the neighbouring band would change where the field comes to rest at `u`, within rounding at the edge of its
// band. `index` is the band's.
fn touch(light: ptr<function, Light>, index: u32, cubic: vec4f, width: f32, u: f32, rounding: f32, length: f32) {
    let band = band_at(index);
    let is_low = abs(u - band.low) <= rounding;
    let slope = abs(cubic_slope(cubic, width));
    let curve = abs(3.0 * cubic.w * width + cubic.z);
    // A parabola at its turn; one that goes on steeper than this is past the edge at once.
    let square = 8.0 * curve * rounding;
    let rests = slope * slope <= square || slope <= 2.0 * rounding;
    if !rests || !(is_low || abs(u - band.high) <= rounding) {
        return;
    }
    let way = min(8.0 * rounding / max(slope + sqrt(slope * slope + square), 1e-30), 1.0);
    let other = band_at(select(index + 1u, index - 1u, is_low));
    let edge = select(band.high, band.low, is_low);
    // As far behind the edge as rounding may take the field: all of a spike that is narrower.
    let behind = clamp(select(other.low + rounding, other.high - rounding, is_low), other.low, other.high);
    let here = extinction_at(band, edge);
    let there = extinction_at(other, behind);
    let tint = largest(abs(band.color + band.color_slope * edge - other.color - other.color_slope * behind));
    let depth = (abs(here - there) + tint * min(here, there)) * length * way;
    (*light).touching += (*light).transmittance * (1.0 - exp2(-min(depth, 60.0)));
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

// How far rounding may take a texel of a cell with texels in this range.
fn rounding_of(range: vec2f) -> f32 {
    let width = range.y - range.x;
    let places = max(PLACE_ROUNDING, 2.4e-7 * largest(frame.cells));
    let digits = 1.2e-7 * max(abs(range.x), abs(range.y));
    return select(frame.flat_rounding, width * places + digits, width > 0.0);
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
    let rounding = rounding_of(range);
    let steepest = abs(whole.y) + 2.0 * abs(whole.z) + 3.0 * abs(whole.w);
    let turns = turns_of(whole);
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

        if !crosses && !is_cut && rounding > 0.0 {
            touch(light, index, cubic, width, goal, rounding, length);
        }
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
