//! The transfer function as rays read it: a table of antiderivatives for ordinary cells, control points for others.
//!
//! # Method
//! Along a short piece of ray let the texel run linearly from `w0` to `w1`. Then
//! `∫ s dt = L * (S(w1) - S(w0)) / (w1 - w0)` with `S` the antiderivative of the extinction, and likewise for the
//! premultiplied colour `c s`. This is pre-integration (Engel, Kraus, Ertl 2001) reduced to one dimension: exact for
//! the optical depth of a piece of any length, in one look-up per end of a piece, and rebuilt in microseconds. `S` is
//! tabled over *bins* of texels and read at the nearest edge of a bin; two ends at one edge count as a piece over the
//! whole bin above it.
//!
//! A table is right where the transfer function is nearly constant within a bin and a cell holds little optical depth.
//! Nothing says that it is: bands of opacity may be narrower than a bin, or opaque. So each bin knows how much a cell
//! could be wrong there ([`RayTransfer::exact_bins`]), and where that is too much executors leave the table alone and
//! integrate the field, a cubic along the ray, from control point to control point by the [`Band`]s.
//!
//! # What the bins cover
//! The texels that can be seen: from the first control point behind which there is matter to the last one, within the
//! values that the volume has. What lies outside of that, padding, fill values, outliers, costs no bin: it is transparent
//! and reads as the sums at the ends. Matter that goes on far beyond the control points is left to the exact way.
//!
//! # Texels from an origin
//! Texels are counted from [`RayTransfer::texel_origin`], in the middle of what can be seen, so that `f32` keeps the
//! digits that matter: exactly for integers, and to `2^-24` of a difference for others.
//!
//! # Error
//! - *Rounding to bins*: half a bin at each end of a piece, a whole one where both are at one edge; see
//!   [`RayTransfer::rounding`]. Bins in which extinction or premultiplied colour vary, with
//!   their neighbours, by more than [`MAX_BIN_VARIATION`] per longest chord of a cell are left to the exact way.
//! - *Sums in f32*: extinction counts up to [`MAX_TABLE_DEPTH`] per chord only (what is denser is never read), so the
//!   extinction of one bin is off by at most `2^-23 * MAX_BINS * MAX_TABLE_DEPTH` = .001 per chord.
//! - *A straight piece for a bent field*: see [`RayTransfer::slope`].

mod bins;
mod segments;

use volery_scene::{Revision, TransferFunction};

use crate::{TexelType, VolumeLayout};
pub use bins::BinSet;
use segments::Segment;

/// Most bins of a table; 16 bytes each.
pub const MAX_BINS: usize = 4096;

/// The most that extinction or a channel of premultiplied colour may vary over three bins, as optical depth of the
/// longest chord of a cell, where the table is read.
pub const MAX_BIN_VARIATION: f64 = 0.01;

/// The largest optical depth of the longest chord of a cell where the table is read.
pub const MAX_TABLE_DEPTH: f64 = 2.0;

/// Where matter goes on at the values beyond the control points, bins do so over this many times the width between them.
const MAX_EXTENSION: f64 = 4.0;

/// In widths of what the bins cover.
const HUGE_RANGE: f64 = 1e3;

/// Entries before the first bin, so that what lies below reads as two equal sums.
const PADDING: usize = 2;

/// Nodes and weights of Gauss-Legendre quadrature on [-1, 1], exact to degree 7.
const GAUSS: [[f64; 2]; 4] = [
    [-0.861_136_311_594_052_6, 0.347_854_845_137_453_85],
    [-0.339_981_043_584_856_26, 0.652_145_154_862_546_1],
    [0.339_981_043_584_856_26, 0.652_145_154_862_546_1],
    [0.861_136_311_594_052_6, 0.347_854_845_137_453_85],
];

/// A range of texels in which colour and opacity are linear. A texel's place in it is its distance `u` from `base`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Band {
    /// A texel from the origin: the lower end of the band; of the lowest band the upper one.
    pub base: f32,
    /// `u` at the lower end: 0, or the least number for the lowest band.
    pub low: f32,
    /// `u` at the upper end; 0 for the lowest band, the largest number for the highest.
    pub high: f32,
    /// Opacity per unit distance at `base`.
    pub opacity: f32,
    /// What is added per texel.
    pub opacity_slope: f32,
    /// `1 - opacity`, which keeps its digits where little is missing to opaque.
    pub clearness: f32,
    /// Straight colour at `base`.
    pub color: [f32; 3],
    /// What is added per texel.
    pub color_slope: [f32; 3],
}

/// A transfer function for rays through one volume.
#[derive(Clone, Debug)]
pub struct RayTransfer {
    revision: Revision,
    texel_origin: f64,
    bands: Vec<Band>,
    entries: Vec<[f32; 4]>,
    bin_from_texel: [f64; 2],
    visible: BinSet,
    /// Per bin: one over the longest chord, in unit lengths, for which the table is good enough.
    hardness: Vec<f32>,
    slope: f64,
    rounding: f64,
    unit_length: f64,
    depth_scale: f64,
    flat_rounding: f64,
}

/// What is known of a bin.
#[derive(Clone, Copy)]
struct Bin {
    /// Integral of `[r s, g s, b s, s]`, in bins.
    sums: [f64; 4],
    /// Least and greatest in it of [`aspects`].
    range: [[f64; 7]; 2],
    is_visible: bool,
    /// Whether the transfer function has a kink or a step in it.
    is_cut: bool,
}

impl Bin {
    const CLEAR: Self = Self { sums: [0.0; 4], range: [[0.0; 7]; 2], is_visible: false, is_cut: false };

    /// The most that any aspect of a value within half a bin of the edge between two differs from the mean of either:
    /// half of what each varies by, all of it where there is a step, and the step between them.
    fn rounding(below: &Self, above: &Self) -> f64 {
        let of = |i: usize| {
            let [b, a] = [below, above].map(|bin| [bin.range[0][i], bin.range[1][i]]);
            let gap = (a[0] - b[1]).max(b[0] - a[1]).max(0.0);
            let share = |bin: &Self| if bin.is_cut { 1.0 } else { 0.5 };
            gap + share(below) * (b[1] - b[0]) + share(above) * (a[1] - a[0])
        };
        (0..7).map(of).fold(0.0, f64::max)
    }

    /// The largest change of any aspect within some bins.
    fn variation(bins: &[Self]) -> f64 {
        let of = |i: usize| {
            let least = bins.iter().map(|bin| bin.range[0][i]).fold(f64::INFINITY, f64::min);
            bins.iter().map(|bin| bin.range[1][i]).fold(0.0, f64::max) - least
        };
        (0..7).map(of).fold(0.0, f64::max)
    }
}

/// Extinction, and what matter adds before white and before black, per channel: `[s, c s, (1 - c) s]`. In front of any
/// background in [0, 1] a picture changes by no more than the largest change of these.
fn aspects([r, g, b, s]: [f64; 4]) -> [f64; 7] {
    [s, r, g, b, s - r, s - g, s - b]
}

impl RayTransfer {
    /// `transfer` for the volume of a layout.
    pub fn new(transfer: &TransferFunction, layout: &VolumeLayout) -> Self {
        let segments = segments::segments(transfer, layout);
        let unit_length = layout.spacing.min_element();
        let depth_scale = unit_length / transfer.unit_distance();
        let is_whole = matches!(layout.texel, TexelType::U8 | TexelType::U16);
        let held = layout.value_range.map(|value| (value - layout.value_offset) / layout.value_scale);
        let held = [held[0].min(held[1]), held[0].max(held[1])];
        // Where nothing can be seen any window will do.
        let seen = segments::visible(&segments).map(|seen| [seen[0].max(held[0]), seen[1].min(held[1])]);
        let seen = seen.filter(|seen| seen[0] <= seen[1]);
        // Matter without end need not take the bins from where it changes.
        let points = [segments[0].ends[1], segments[segments.len() - 1].ends[0]];
        let points = points.map(|texel| texel.clamp(held[0], held[1]));
        let beyond = MAX_EXTENSION * (points[1] - points[0]);
        let seen = seen.unwrap_or([points[0]; 2]);
        let window = [seen[0].max(points[0] - beyond), seen[1].min(points[1] + beyond)];
        let goes_on = [seen[0] < window[0], seen[1] > window[1]];
        let [low, high] = if is_whole { [window[0].floor(), window[1].ceil()] } else { window };
        let middle = (points[0] + (points[1] - points[0]) / 2.0).clamp(low, high);
        let texel_origin = if is_whole { middle.floor() } else { f64::from(middle as f32) };
        let width = if high > low { high - low } else { 1.0 };
        // Where texels are whole numbers bins end on them: control points mostly stand there.
        let num_bins = if is_whole && width <= MAX_BINS as f64 {
            MAX_BINS / width as usize * width as usize
        } else {
            MAX_BINS
        };
        let bin_width = width / num_bins as f64;

        let longest_chord = layout.spacing.length() / unit_length;
        let max_depth = 2.0 * MAX_TABLE_DEPTH / (longest_chord * depth_scale);
        let mut bins = vec![Bin::CLEAR; PADDING];
        for bin in 0..num_bins {
            let from = low + bin as f64 * bin_width;
            bins.push(measure(&segments, [from, from + bin_width], max_depth, depth_scale));
        }
        // What is seen at the very end has a bin of its own, and so that the last two entries are equal one or two more.
        let above = segments.iter().rfind(|segment| segment.ends[0] <= high).unwrap_or(&segments[0]);
        let end = end_bin(above, high, max_depth, depth_scale);
        bins.push(end);
        // Beyond both ends matter goes on as it is there, so that a step at the very end is told from none.
        bins.resize((bins.len() + 2).next_multiple_of(2), Bin { range: end.range, ..Bin::CLEAR });
        let below = segments.iter().find(|segment| segment.ends[1] >= low).unwrap_or(&segments[0]);
        let range = end_bin(below, low, max_depth, depth_scale).range;
        bins[..PADDING].fill(Bin { range, ..Bin::CLEAR });

        let mut hardness: Vec<f32> = (0..bins.len()).map(|bin| hardness(&bins, bin)).collect();
        // The table knows nothing of what goes on beyond its ends.
        let num = bins.len();
        for (goes_on, end) in goes_on.into_iter().zip([0..PADDING, PADDING + num_bins..num]) {
            if goes_on {
                hardness[end.clone()].fill(f32::INFINITY);
                bins[end].iter_mut().for_each(|bin| bin.is_visible = true);
            }
        }
        let is_easy = |bin: &usize| f64::from(hardness[*bin]) * longest_chord <= 1.0;
        let rise = |bin: usize| Bin::variation(&bins[bin..=bin]);
        let slope = (0..bins.len()).filter(is_easy).map(rise).fold(0.0, f64::max) / bin_width;
        let edges = (1..bins.len()).filter(|above| is_easy(above) && is_easy(&(above - 1)));
        let rounding = edges.map(|above| Bin::rounding(&bins[above - 1], &bins[above])).fold(0.0, f64::max);
        Self {
            revision: Revision::new(),
            texel_origin,
            bands: segments.iter().map(|segment| band(segment, texel_origin, is_whole)).collect(),
            entries: sum_up(&bins),
            bin_from_texel: [1.0 / bin_width, PADDING as f64 - (low - texel_origin) / bin_width],
            visible: BinSet::new(bins.iter().map(|bin| bin.is_visible)),
            hardness,
            slope,
            rounding,
            unit_length,
            depth_scale,
            flat_rounding: 0.0,
        }
    }

    /// The same of texels that are rounded, so that one at a step of the transfer function may stand for a value on either
    /// side of it: where a cell is constant there, it counts as touching the step.
    #[must_use]
    pub fn of_rounded_texels(self) -> Self {
        let [from, to] = [&self.bands[0], &self.bands[self.bands.len() - 1]].map(|band| f64::from(band.base));
        let most = [from, to].map(|base| (base + self.texel_origin).abs());
        Self { flat_rounding: most[0].max(most[1]) * f64::from(f32::EPSILON), ..self }
    }

    /// Names the table, which never changes; that of clones is the same.
    pub fn revision(&self) -> Revision {
        self.revision
    }

    /// The texel that texels are counted from; `f32` holds it, and it is whole where texels are.
    pub fn texel_origin(&self) -> f64 {
        self.texel_origin
    }

    /// `[∫ r s, ∫ g s, ∫ b s, ∫ s]` up to the lower edge of each bin, the width of a bin as the unit of texels and
    /// extinction per [`unit_length`](Self::unit_length). The first two are equal, and the last two, whose number is
    /// even: where the table ends nothing is seen, however far a texel is beyond.
    pub fn entries(&self) -> &[[f32; 4]] {
        &self.entries
    }

    /// The entry that stands for all texels above the bins.
    pub fn last_entry(&self) -> usize {
        self.entries.len() - 2
    }

    /// `[scale, offset]` with `bin = scale * texel + offset`, texels counted from the origin.
    pub fn bin_from_texel(&self) -> [f64; 2] {
        self.bin_from_texel
    }

    /// The bins of texels that are not all perfectly transparent.
    pub fn visible_bins(&self) -> &BinSet {
        &self.visible
    }

    /// The bins that a ray should not read in cells of a level, which are `2^level` finest cells long.
    pub fn exact_bins(&self, layout: &VolumeLayout, level: u32) -> BinSet {
        let longest_chord = (layout.spacing.length() / self.unit_length * f64::from(level).exp2()) as f32;
        BinSet::new(self.hardness.iter().map(|hardness| hardness * longest_chord > 1.0))
    }

    /// Where texels `low..=high` stand among the bins, in order; not a number if either is not.
    #[inline]
    pub fn bins_of(&self, low: f32, high: f32) -> [f32; 2] {
        let [scale, offset] = self.bin_from_texel;
        [low, high].map(|texel| (scale * (f64::from(texel) - self.texel_origin) + offset) as f32)
    }

    /// The largest change of extinction, or of a channel of premultiplied colour, per texel in bins that are read
    /// at the finest level; per unit length. Where a straight piece of ray is `d` texels off the field, its depth is
    /// off by at most `d` times this times its length.
    pub fn slope(&self) -> f64 {
        self.slope
    }

    /// The largest change of extinction, or of a channel of premultiplied colour, that rounding a texel to bins makes in
    /// bins that are read at the finest level; per unit length.
    pub fn rounding(&self) -> f64 {
        self.rounding
    }

    /// A cell whose corners differ by more texels lies beside an outlier: `f32` rounds its field to more than what tells
    /// one thing that can be seen from another.
    pub fn huge_range(&self) -> f64 {
        HUGE_RANGE * self.entries.len() as f64 / self.bin_from_texel[0]
    }

    /// How far from a step of the transfer function the texel of a constant cell may have been rounded across it, in
    /// texels; 0 where texels are exact.
    pub fn flat_rounding(&self) -> f64 {
        self.flat_rounding
    }

    /// The bands in order, without a gap; at least two.
    pub fn bands(&self) -> &[Band] {
        &self.bands
    }

    /// The world length that extinction refers to: the smallest spacing.
    pub fn unit_length(&self) -> f64 {
        self.unit_length
    }

    /// Optical depth of a unit length is this times `-ln(1 - opacity)`.
    pub fn depth_scale(&self) -> f64 {
        self.depth_scale
    }
}

/// A segment as executors read it. Its base is rounded as texels are: a field that is constant at a control point has its
/// colour, and that of the right side of a step.
fn band(segment: &Segment, origin: f64, is_whole: bool) -> Band {
    let [low, high] = segment.ends;
    let held = |texel: f64| if is_whole { texel } else { f64::from(texel as f32) };
    let is_lowest = low == f64::NEG_INFINITY;
    let width = high - low;
    let slope = |[from, to]: [f64; 2]| if width.is_finite() { ((to - from) / width) as f32 } else { 0.0 };
    Band {
        base: (held(if is_lowest { high } else { low }) - origin) as f32,
        low: if is_lowest { f32::MIN } else { 0.0 },
        high: if is_lowest { 0.0 } else { width.min(f64::from(f32::MAX)) as f32 },
        opacity: segment.opacity[0] as f32,
        opacity_slope: slope(segment.opacity),
        clearness: (1.0 - segment.opacity[0]) as f32,
        color: segment.color[0].map(|c| c as f32),
        color_slope: std::array::from_fn(|i| slope([segment.color[0][i], segment.color[1][i]])),
    }
}

/// A bin of one texel, the end of a segment.
fn end_bin(segment: &Segment, texel: f64, max_depth: f64, depth_scale: f64) -> Bin {
    let light = segment.light(texel, f64::MAX).map(|x| x * depth_scale);
    let sums = segment.light(texel, max_depth).map(|x| x * depth_scale);
    Bin { sums, range: [aspects(light); 2], is_visible: light[3] > 0.0, is_cut: false }
}

/// Integral and range over `[from, to]` in texels.
fn measure(segments: &[Segment], [from, to]: [f64; 2], max_depth: f64, depth_scale: f64) -> Bin {
    let mut bin = Bin { range: [[f64::INFINITY; 7], [0.0; 7]], ..Bin::CLEAR };
    let first = segments.partition_point(|segment| segment.ends[1] <= from);
    for segment in segments[first..].iter().take_while(|segment| segment.ends[0] < to) {
        let (start, end) = (from.max(segment.ends[0]), to.min(segment.ends[1]));
        let (middle, half) = ((start + end) / 2.0, (end - start) / 2.0);
        bin.is_visible |= !segment.is_clear();
        bin.is_cut |= start > from;
        for texel in [start, end] {
            let aspects = aspects(segment.light(texel, f64::MAX).map(|x| x * depth_scale));
            for (i, aspect) in aspects.into_iter().enumerate() {
                bin.range[0][i] = bin.range[0][i].min(aspect);
                bin.range[1][i] = bin.range[1][i].max(aspect);
            }
        }
        for [node, weight] in GAUSS {
            let light = segment.light(middle + half * node, max_depth);
            let weight = weight * half / (to - from) * depth_scale;
            (0..4).for_each(|i| bin.sums[i] += weight * light[i]);
        }
    }
    bin
}

/// One over the longest chord, in unit lengths, for which a bin is good enough.
fn hardness(bins: &[Bin], bin: usize) -> f32 {
    let near = &bins[bin.saturating_sub(1)..(bin + 2).min(bins.len())];
    (Bin::variation(near) / MAX_BIN_VARIATION).max(bins[bin].range[1][0] / MAX_TABLE_DEPTH) as f32
}

/// The sums below each bin.
fn sum_up(bins: &[Bin]) -> Vec<[f32; 4]> {
    let mut sums = [0.0_f64; 4];
    let mut entries = Vec::with_capacity(bins.len());
    for bin in bins {
        entries.push(sums.map(|sum| sum as f32));
        (0..4).for_each(|i| sums[i] += bin.sums[i]);
    }
    entries
}

#[cfg(test)]
mod tests;
