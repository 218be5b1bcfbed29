//! The light of single cells, exactly but for the arithmetic: for cells that the table of a transfer function is too
//! coarse for.
//!
//! # Method
//! Along a ray a cell's field is a cubic. It is followed in *intervals*, each of which stays within one band of the
//! transfer function, where opacity and colour are linear in the field, and between turns of the cubic. In an interval
//! extinction is sampled at three Gauss nodes; the integral of its interpolant gives the optical depth at the nodes, and
//! Gauss quadrature there the colour (collocation, of order 6). An interval is made shorter where that would not do:
//! - towards and from a pole of the extinction, so that what is missing to opaque changes by at most [`MAX_GROWTH`];
//! - where much optical depth meets a change of colour, to [`MAX_DEPTH`].
//!
//! # Digits
//! The cubic is kept as its Taylor series about the place reached, the texel as its distance from the band's lower end.
//! Where the field enters a band it is set to the band's very end, so a shell between two texels has the length of its
//! width over the slope, to f32's relative precision, be it a millionth of the cell: nothing is the difference of two
//! places in the cell.
//!
//! # Error
//! Where the field comes to rest at an edge between bands, as near as rounding ([`PLACE_ROUNDING`]), it may be on the other
//! side. What that would change is added up apart ([`Light::touching`]): for a step that a turn touches, a short way; in
//! front of an opaque band all of the light. Elsewhere at most [`EXACT_DOUBT`] of the light that the cell takes, and mostly a hundredth of that: from quadrature near poles
//! and in deep, coloured intervals (test `cells_of_every_kind_are_those_of_the_reference`).

use fearless_simd::{f32x16, i32x16, mask32x16, prelude::*};
use volery_frame::ray_transfer::Band;

use crate::MIN_TRANSMITTANCE;
use crate::math::{axes, clear_log, clear_of_depth, opacity_of_depth, transpose};
use crate::walk::Light;

/// What is missing to opaque changes at most by this factor in one interval.
const MAX_GROWTH: f32 = 4.0;

/// What is missing to opaque counts as nothing below this: the light of the rest is that of its middle.
const MIN_CLEARNESS: f32 = 1e-3;

/// Largest optical depth of an interval along which the colour changes.
const MAX_DEPTH: f32 = 1.0;

/// A smaller change of a channel is none.
const MIN_TINT: f32 = 1e-3;

/// What a channel may be off by, as a share of the light that a cell takes: above all that was found in a test.
pub(crate) const EXACT_DOUBT: f32 = 0.003;

/// How exactly a place in a cell is known, in cells: what a field is off by, as a share of the range of the corners.
pub(crate) const PLACE_ROUNDING: f32 = 1e-5;

/// Of an extinction without end.
const OPAQUE: f32 = 1e30;

/// Gauss-Legendre nodes on [0, 1].
const NODES: [f32; 3] = [0.112_701_67, 0.5, 0.887_298_35];

/// Their weights.
const WEIGHTS: [f32; 3] = [5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0];

/// The integral from 0 to a node (row) of the parabola that is 1 at one of the nodes and 0 at the others.
const TO_NODE: [[f32; 3]; 3] = [
    [5.0 / 36.0, -0.035_976_67, 0.009_789_444],
    [0.300_263_2, 2.0 / 9.0, -0.022_485_417],
    [0.267_988_33, 0.480_421_12, 5.0 / 36.0],
];

/// The bands of a transfer function.
#[derive(Clone, Copy)]
pub(crate) struct Bands<'a> {
    pub(crate) bands: &'a [Band],
    /// Optical depth of a unit length per `-ln(1 - opacity)`.
    pub(crate) depth_scale: f32,
    /// Cells of a larger range, in texels, lie beside an outlier.
    pub(crate) huge: f32,
    /// How far from a step the texel of a constant cell may have been rounded across it.
    pub(crate) flat_rounding: f32,
}

/// A band per lane.
#[derive(Clone, Copy)]
struct Row<S: Simd> {
    base: f32x16<S>,
    low: f32x16<S>,
    high: f32x16<S>,
    opacity: f32x16<S>,
    opacity_slope: f32x16<S>,
    clearness: f32x16<S>,
    color: [f32x16<S>; 3],
    color_slope: [f32x16<S>; 3],
}

impl Bands<'_> {
    /// The band of each texel, counted from the origin.
    #[inline(always)]
    fn find<S: Simd>(&self, simd: S, texel: f32x16<S>) -> i32x16<S> {
        let texels: [f32; 16] = texel.into();
        let above = &self.bands[1..];
        let band = texels.map(|texel| above.partition_point(|band| band.base <= texel) as i32);
        i32x16::from_slice(simd, &band)
    }

    #[inline(always)]
    fn rows<S: Simd>(&self, simd: S, band: i32x16<S>) -> Row<S> {
        let bands: [i32; 16] = band.into();
        let mut parts = [[0.0_f32; 64]; 3];
        for (lane, &band) in bands.iter().enumerate() {
            let row: &[f32; 12] = bytemuck::cast_ref(&self.bands[band as usize]);
            for (part, numbers) in parts.iter_mut().enumerate() {
                numbers[4 * lane..4 * lane + 4].copy_from_slice(&row[4 * part..4 * part + 4]);
            }
        }
        let [base, low, high, opacity] = transpose(simd, &parts[0]);
        let [opacity_slope, clearness, r, g] = transpose(simd, &parts[1]);
        let [b, r_slope, g_slope, b_slope] = transpose(simd, &parts[2]);
        let (color, color_slope) = ([r, g, b], [r_slope, g_slope, b_slope]);
        Row { base, low, high, opacity, opacity_slope, clearness, color, color_slope }
    }
}

impl<S: Simd> Row<S> {
    /// What is missing to opaque at `u` texels from the base.
    #[inline(always)]
    fn clearness(&self, u: f32x16<S>) -> f32x16<S> {
        self.clearness - self.opacity_slope * u
    }

    /// `-ln(1 - opacity)`, at most [`OPAQUE`].
    #[inline(always)]
    fn extinction(&self, simd: S, u: f32x16<S>) -> f32x16<S> {
        let (zero, one) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 1.0));
        let opacity = self.opacity_slope.mul_add(u, self.opacity).max(zero).min(one);
        let clearness = self.clearness(u).max(zero).min(one);
        // Where rounding alone makes a texel opaque there is a pole nearby, not here.
        let is_flat = self.opacity_slope.simd_eq(0.0);
        let least = is_flat.select(f32x16::splat(simd, 1e-37), f32x16::splat(simd, f32::EPSILON / 4.0));
        clear_log(simd, opacity, clearness.max(least))
    }

    /// The extinction at `u` as that of a whole stretch; without end in an opaque band.
    #[inline(always)]
    fn whole_extinction(&self, simd: S, u: f32x16<S>) -> f32x16<S> {
        self.is_opaque().select(f32x16::splat(simd, OPAQUE), self.extinction(simd, u))
    }

    /// Whether a band is opaque throughout.
    #[inline(always)]
    fn is_opaque(&self) -> mask32x16<S> {
        self.clearness.simd_eq(0.0) & self.opacity_slope.simd_eq(0.0)
    }
}

/// A polynomial of degree 3 about the place of each lane, by powers.
pub(crate) type Cubic<S> = [f32x16<S>; 4];

#[inline(always)]
fn at<S: Simd>(cubic: &Cubic<S>, x: f32x16<S>) -> f32x16<S> {
    cubic[3].mul_add(x, cubic[2]).mul_add(x, cubic[1]).mul_add(x, cubic[0])
}

#[inline(always)]
fn slope_at<S: Simd>(cubic: &Cubic<S>, x: f32x16<S>) -> f32x16<S> {
    (cubic[3] * 3.0).mul_add(x, cubic[2] * 2.0).mul_add(x, cubic[1])
}

/// The cubic about `x`.
#[inline(always)]
fn shifted<S: Simd>(cubic: &Cubic<S>, x: f32x16<S>) -> Cubic<S> {
    [at(cubic, x), slope_at(cubic, x), (cubic[3] * 3.0).mul_add(x, cubic[2]), cubic[3]]
}

/// Where the cubic turns in (0, 1), in order; 1 where it does not.
#[inline(always)]
fn turns<S: Simd>(simd: S, [_, b, c, d]: &Cubic<S>) -> [f32x16<S>; 2] {
    let (zero, one) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 1.0));
    let root = (*c * *c - *d * *b * 3.0).sqrt();
    let q = zero - (*c + c.simd_lt(zero).select(zero - root, root));
    let [s, t] = [q / (*d * 3.0), *b / q].map(
        #[inline(always)]
        |x| (x.simd_gt(zero) & x.simd_lt(one)).select(x, one),
    );
    [s.min(t), s.max(t)]
}

/// Where a cubic, monotone on `[0, span]`, comes to `target` in `lanes`; `span` in others. Newton's method in a
/// bracket that shrinks.
#[inline(always)]
fn reach<S: Simd>(
    simd: S,
    cubic: &Cubic<S>,
    span: f32x16<S>,
    [u_end, target]: [f32x16<S>; 2],
    lanes: mask32x16<S>,
) -> f32x16<S> {
    if lanes.all_false() {
        return span;
    }
    let zero = f32x16::splat(simd, 0.0);
    let rises = (u_end - cubic[0]).simd_ge(zero);
    let (mut low, mut high) = (zero, span);
    let total = u_end - cubic[0];
    let share = total.simd_ne(zero).select((target - cubic[0]) / total, zero);
    let mut x = (share.max(zero).min(f32x16::splat(simd, 1.0))) * span;
    for _ in 0..24 {
        let residual = at(cubic, x) - target;
        let is_before = residual.simd_lt(zero) ^ !rises;
        low = is_before.select(x, low);
        high = is_before.select(high, x);
        let newton = x - residual / slope_at(cubic, x);
        let inside = newton.simd_ge(low) & newton.simd_le(high);
        let next = inside.select(newton, (low + high) * 0.5);
        let moves = (next - x).abs().simd_gt(next.abs() * 2e-7) & residual.simd_ne(zero) & lanes;
        x = residual.simd_ne(zero).select(next, x);
        if moves.all_false() {
            break;
        }
    }
    lanes.select(x, span)
}

/// The field along the way of each lane through its cell.
pub(crate) struct Field<S: Simd> {
    /// The texel from the origin, by powers of the share of the way.
    pub(crate) cubic: Cubic<S>,
    /// What it is at both ends as the neighbouring cells have it: beside an outlier, where rounding is more than all that
    /// can be seen, no band between the two may be passed unseen.
    pub(crate) ends: [f32x16<S>; 2],
    /// Least and greatest corner of the cell: no value lies beyond, whatever rounding says, so that a field that only
    /// touches a step stays on its side.
    pub(crate) range: [f32x16<S>; 2],
    /// The way in unit lengths.
    pub(crate) length: f32x16<S>,
}

/// Where each lane stands in its cell.
struct Course<S: Simd> {
    /// The texel from the band's base, about the place reached; the whole way through the cell is 1.
    cubic: Cubic<S>,
    /// The way through the cell, as optical depth per `-ln(1 - opacity)`.
    length: f32x16<S>,
    turns: [f32x16<S>; 2],
    /// No slope is larger.
    steepest: f32x16<S>,
    /// Of the corners, and the texel at the end of the cell, from the origin of texels.
    range: [f32x16<S>; 2],
    last: f32x16<S>,
    /// What the field may be off by.
    rounding: f32x16<S>,
    is_huge: mask32x16<S>,
    band: i32x16<S>,
    row: Row<S>,
    /// Where the section between turns ends, and how far that is.
    section_end: f32x16<S>,
    span: f32x16<S>,
    rises: mask32x16<S>,
    active: mask32x16<S>,
}

/// The next interval of each lane.
struct Interval<S: Simd> {
    width: f32x16<S>,
    /// The texel at its end.
    target: f32x16<S>,
    /// Whether the next band begins there.
    crosses: mask32x16<S>,
    /// Whether it ends for another reason before the section does.
    is_cut: mask32x16<S>,
}

impl<S: Simd> Course<S> {
    #[inline(always)]
    fn new(simd: S, bands: Bands<'_>, field: &Field<S>, lanes: mask32x16<S>) -> Self {
        let zero = f32x16::splat(simd, 0.0);
        // Other lanes may hold anything, blanks too.
        let mut cubic = field.cubic.map(
            #[inline(always)]
            |coefficient| lanes.select(coefficient, zero),
        );
        let range = field.range.map(
            #[inline(always)]
            |end| lanes.select(end, zero),
        );
        let is_huge = (range[1] - range[0]).simd_gt(bands.huge);
        let last = cubic[0] + cubic[1] + cubic[2] + cubic[3];
        let [first, last] = [(field.ends[0], cubic[0]), (field.ends[1], last)].map(
            #[inline(always)]
            |(held, end)| is_huge.select(held, end).max(range[0]).min(range[1]),
        );
        cubic[0] = first;
        let steepest = cubic[1].abs() + cubic[2].abs() * 2.0 + cubic[3].abs() * 3.0;
        let reach = range[1] - range[0];
        let digits = range[0].abs().max(range[1].abs()) * f32::EPSILON;
        let flat = f32x16::splat(simd, bands.flat_rounding);
        let rounding =
            reach.simd_gt(zero).select(reach.mul_add(f32x16::splat(simd, PLACE_ROUNDING), digits), flat);
        let turns = turns(simd, &cubic);
        let band = bands.find(simd, cubic[0]);
        let row = bands.rows(simd, band);
        let mut course = Self {
            cubic: [cubic[0] - row.base, cubic[1], cubic[2], cubic[3]],
            length: field.length * bands.depth_scale,
            turns,
            steepest,
            range,
            last,
            rounding,
            is_huge,
            band,
            row,
            section_end: zero,
            span: zero,
            rises: lanes,
            active: lanes,
        };
        course.start_section(simd, lanes);
        course
    }

    /// Goes on to the next section between turns.
    #[inline(always)]
    fn start_section(&mut self, simd: S, lanes: mask32x16<S>) {
        let one = f32x16::splat(simd, 1.0);
        let [first, second] = self.turns;
        let next = first.simd_gt(self.section_end).select(first, second);
        let next = next.simd_gt(self.section_end).select(next, one);
        self.active &= !(lanes & self.section_end.simd_ge(one));
        self.span = lanes.select(next - self.section_end, self.span);
        self.section_end = lanes.select(next, self.section_end);
        let rises = self.end(simd).simd_ge(self.cubic[0]);
        self.rises = (lanes & rises) | (!lanes & self.rises);
    }

    /// The texel at the end of the section: at that of the cell what the next one begins with.
    #[inline(always)]
    fn end(&self, simd: S) -> f32x16<S> {
        let is_last = self.section_end.simd_ge(f32x16::splat(simd, 1.0)) & self.is_huge;
        is_last.select(self.last - self.row.base, at(&self.cubic, self.span))
    }

    /// The interval that begins where the lanes stand.
    #[inline(always)]
    fn next(&self, simd: S) -> Interval<S> {
        let row = &self.row;
        let u = self.cubic[0];
        let u_end = self.end(simd);
        let [least, greatest] = [self.range[0] - row.base, self.range[1] - row.base];
        let edge = self.rises.select(row.high, row.low);
        let above = self.rises & u_end.simd_gt(edge) & greatest.simd_gt(edge);
        let beyond = above | (!self.rises & u_end.simd_lt(edge) & least.simd_lt(edge));
        let target = beyond.select(edge, u_end);

        let floor = f32x16::splat(simd, MIN_CLEARNESS);
        let (now, then) = (row.clearness(u), row.clearness(target));
        let least = (now * (1.0 / MAX_GROWTH)).max(floor);
        let greatest = now.max(floor) * MAX_GROWTH;
        let falls = now.simd_gt(floor * 1.01) & then.simd_lt(least * 0.99);
        let grows = then.simd_gt(greatest * 1.01);
        let is_cut = (falls | grows) & self.active;
        let limit = (row.clearness - falls.select(least, greatest)) / row.opacity_slope;
        let target = is_cut.select(limit, target);
        let crosses = beyond & !is_cut & self.active;
        let width = reach(simd, &self.cubic, self.span, [u_end, target], crosses | is_cut);
        // Beside an outlier bands are passed in less than rounding. Yet not in nothing.
        let least = (target - u).abs() / self.steepest;
        let width = (self.is_huge & !is_cut & least.simd_le(1.0)).select(width.max(least), width);
        self.shallow(simd, Interval { width, target, crosses, is_cut })
    }

    /// The interval, or where it is deep and coloured a part of it.
    #[inline(always)]
    fn shallow(&self, simd: S, interval: Interval<S>) -> Interval<S> {
        let row = &self.row;
        let u = self.cubic[0];
        let slope = row.color_slope[0].abs().max(row.color_slope[1].abs()).max(row.color_slope[2].abs());
        let is_tinted = (slope * (interval.target - u).abs()).simd_gt(MIN_TINT);
        let first = self.depth_per_width(simd, u);
        let depth = interval.width * first.max(self.depth_per_width(simd, interval.target));
        let is_deep = is_tinted & depth.simd_gt(MAX_DEPTH) & self.active;
        if is_deep.all_false() {
            return interval;
        }
        let mut width = interval.width;
        for _ in 0..4 {
            let steepest = first.max(self.depth_per_width(simd, at(&self.cubic, width)));
            // The roots apart, lest their product be nothing.
            width = width.min(width.sqrt() * (MAX_DEPTH / steepest).sqrt());
        }
        let steepest = first.max(self.depth_per_width(simd, at(&self.cubic, width)));
        let width = is_deep.select(width.min(1.5 * MAX_DEPTH / steepest), interval.width);
        Interval {
            width,
            target: is_deep.select(at(&self.cubic, width), interval.target),
            crosses: interval.crosses & !is_deep,
            is_cut: interval.is_cut | is_deep,
        }
    }

    #[inline(always)]
    fn depth_per_width(&self, simd: S, u: f32x16<S>) -> f32x16<S> {
        self.row.whole_extinction(simd, u) * self.length
    }

    /// The light of an interval.
    #[inline(always)]
    fn add(&self, simd: S, interval: &Interval<S>, light: &mut Light<S>) {
        let row = &self.row;
        let zero = f32x16::splat(simd, 0.0);
        let nodes = axes(
            #[inline(always)]
            |i| at(&self.cubic, interval.width * NODES[i]),
        );
        let texels = axes(
            #[inline(always)]
            |i| nodes[i].max(row.low).min(row.high),
        );
        let is_opaque = nodes[0].simd_eq(nodes[2]) & row.clearness(nodes[1]).simd_le(zero) | row.is_opaque();
        let depths = axes(
            #[inline(always)]
            |i| {
                let extinction =
                    is_opaque.select(f32x16::splat(simd, OPAQUE), row.extinction(simd, texels[i]));
                extinction * (self.length * interval.width)
            },
        );
        let depth = depths[0] * WEIGHTS[0] + depths[1] * WEIGHTS[1] + depths[2] * WEIGHTS[2];
        let depth = self.active.select(depth, zero);
        // What counts is the share of each node in what is seen: of depths of any size.
        let scale = 1.0 / depths[0].max(depths[1]).max(depths[2]).max(f32x16::splat(simd, 1e-37));
        let seen = axes(
            #[inline(always)]
            |i| {
                let [a, b, c] = TO_NODE[i];
                let front = (depths[0] * a + depths[1] * b + depths[2] * c).max(zero);
                let clear = clear_of_depth(simd, front.min(f32x16::splat(simd, 40.0)));
                depths[i] * scale * WEIGHTS[i] * clear
            },
        );
        let sum = seen[0] + seen[1] + seen[2];
        let share = sum.simd_gt(zero).select(light.transmittance * opacity_of_depth(simd, depth) / sum, zero);
        let shift = seen[0] * texels[0] + seen[1] * texels[1] + seen[2] * texels[2];
        light.color = axes(
            #[inline(always)]
            |i| {
                let color = row.color[i] * sum + row.color_slope[i] * shift;
                color.mul_add(share, light.color[i])
            },
        );
        light.transmittance -= light.transmittance * opacity_of_depth(simd, depth);
    }

    /// What the neighbouring band would change where the field comes to rest at it, within rounding.
    #[inline(always)]
    fn touch(&self, simd: S, bands: Bands<'_>, interval: &Interval<S>, light: &mut Light<S>) {
        let (row, rounding, u) = (&self.row, self.rounding, interval.target);
        let is_low = (u - row.low).abs().simd_le(rounding);
        let is_near = is_low | (u - row.high).abs().simd_le(rounding);
        let ends = self.active & !interval.crosses & !interval.is_cut & rounding.simd_gt(0.0);
        if (ends & is_near).all_false() {
            return;
        }
        let slope = slope_at(&self.cubic, interval.width).abs();
        let curve = (self.cubic[3] * 3.0).mul_add(interval.width, self.cubic[2]).abs();
        // A parabola at its turn; one that goes on steeper than this is past the edge at once.
        let square = curve * rounding * 8.0;
        let rests = (slope * slope).simd_le(square) | slope.simd_le(rounding * 2.0);
        let lanes = ends & is_near & rests;
        if lanes.all_false() {
            return;
        }
        let way = rounding * 8.0 / (slope + (slope * slope + square).sqrt());
        let length = self.length * way.min(f32x16::splat(simd, 1.0));
        let one = i32x16::splat(simd, 1);
        let beside = lanes.select(is_low.select(self.band - one, self.band + one), self.band);
        let other = bands.rows(simd, beside);
        // As far behind the edge as rounding may take the field: all of a spike that is narrower.
        let [edge, behind] =
            [is_low.select(row.low, row.high), is_low.select(other.high - rounding, other.low + rounding)];
        let behind = behind.max(other.low).min(other.high);
        let (here, there) = (row.whole_extinction(simd, edge), other.whole_extinction(simd, behind));
        let [r, g, b] = axes(
            #[inline(always)]
            |i| {
                let [here, there] = [(row, edge), (&other, behind)].map(
                    #[inline(always)]
                    |(row, u)| row.color_slope[i].mul_add(u, row.color[i]),
                );
                (here - there).abs()
            },
        );
        let change = r.max(g).max(b).mul_add(here.min(there), (here - there).abs());
        let seen = light.transmittance * opacity_of_depth(simd, change * length);
        light.touching += lanes.select(seen, f32x16::splat(simd, 0.0));
    }

    /// Takes the lanes to the end of an interval.
    #[inline(always)]
    fn advance(&mut self, simd: S, bands: Bands<'_>, interval: &Interval<S>) {
        self.cubic = shifted(&self.cubic, interval.width);
        self.span = (self.span - interval.width).max(f32x16::splat(simd, 0.0));
        self.cubic[0] = interval.is_cut.select(interval.target, self.cubic[0]);
        if interval.crosses.any_true() {
            let one = i32x16::splat(simd, 1);
            let next = self.rises.select(self.band + one, self.band - one);
            self.band = interval.crosses.select(next, self.band);
            self.row = bands.rows(simd, self.band);
            let start = self.rises.select(self.row.low, self.row.high);
            self.cubic[0] = interval.crosses.select(start, self.cubic[0]);
        }
        let ends = self.active & !interval.crosses & !interval.is_cut;
        if ends.any_true() {
            self.start_section(simd, ends);
        }
    }
}

/// Adds the light of one cell per lane.
#[inline(never)]
pub(crate) fn add_cells<S: Simd>(
    simd: S,
    bands: Bands<'_>,
    field: &Field<S>,
    lanes: mask32x16<S>,
    light: &mut Light<S>,
) {
    // A function of its own, once for all types of texels.
    simd.vectorize(
        #[inline(always)]
        || follow(simd, bands, field, lanes, light),
    );
}

#[inline(always)]
fn follow<S: Simd>(simd: S, bands: Bands<'_>, field: &Field<S>, lanes: mask32x16<S>, light: &mut Light<S>) {
    let mut course = Course::new(simd, bands, field, lanes);
    // Three sections of every band, each cut towards and from a pole; dense ones end by their depth.
    for _ in 0..64 + 64 * bands.bands.len() {
        if course.active.all_false() {
            return;
        }
        let interval = course.next(simd);
        course.touch(simd, bands, &interval, light);
        course.add(simd, &interval, light);
        course.advance(simd, bands, &interval);
        course.active &= light.transmittance.simd_gt(MIN_TRANSMITTANCE);
    }
}

#[cfg(test)]
mod tests;
