//! The transfer function as its own antiderivative, so that a whole piece of ray is classified at once.
//!
//! # Method
//! Along a short piece of ray let the value run linearly from `v0` to `v1`. Then
//! `∫ s dt = L * (S(v1) - S(v0)) / (v1 - v0)` with `S` the antiderivative of the extinction in the value, and
//! likewise for the premultiplied colour `c s`. This is pre-integration (Engel, Kraus, Ertl 2001) reduced to
//! one dimension, exact for the optical depth at any length of piece; no table in two or three dimensions,
//! so changing the transfer function costs microseconds.
//!
//! Values are rounded to `num_bins` bins over the volume's value range; the antiderivatives are exact at the
//! edges of bins (each bin is cut at control points and integrated by Gauss-Legendre quadrature in f64, then
//! rounded once to f32). Two ends in the same bin count as a piece over one whole bin.
//!
//! # Colour inside a piece
//! The light of a piece is `(1 - exp(-tau)) * ΔQ / ΔS`: exact where the colour is constant over the piece,
//! else wrong by at most `tau * |Δc| / 12` of the piece's light to first order, since the front part hides
//! the back part a little.
//!
//! # Arithmetic
//! Entries are f32, so the extinction of a piece is the difference of two large numbers, off by up to `2^-23` of
//! the sum over the bins below. Thin matter whose values lie above those of opaque matter would drown in that sum.
//! Therefore the sum *starts anew* at a bin where it has grown to `2^13` times the bin's own extinction; a piece that
//! passes such a [`Restart`] takes the sum up to there into account. Hence a piece's extinction is off by at most
//! `2^-10` of itself or 4e-6 per unit length, whichever is more, however opaque other matter is, and its mean colour
//! by at most `2^-9` where the former holds. Transfer functions that rise have no restart at all, and cost nothing. Should more than
//! [`MAX_RESTARTS`] be needed, sums grow further, to as many times `2^4` as it takes.
//!
//! # Limits
//! Extinction is capped at [`MAX_DEPTH_PER_UNIT`] per unit length: a sixteenth of a cell of opaque matter lets
//! a millionth of the light behind it through.

use volery_scene::TransferFunction;

use crate::VolumeLayout;

/// Largest optical depth per unit length: `exp(-depth / 16)` is about a millionth.
pub const MAX_DEPTH_PER_UNIT: f64 = 221.0;

/// Most bins of a table; 16 bytes each.
pub const MAX_BINS: usize = 4096;

/// Most restarts of a table.
pub const MAX_RESTARTS: usize = 8;

/// Cells of more optical depth are dense.
const DENSE_CELL_DEPTH: f64 = 2.0;

/// Sums start anew where they have grown to this many times the extinction of the next bin.
const MAX_GROWTH: f64 = 8192.0;

/// Smaller sums lose no more than 4e-6 per unit length, which is nothing to see.
const MIN_SUM: f64 = 32.0;

/// Where the antiderivatives start anew from 0.
///
/// A piece from an entry below `bin` to one at or above it passes `sums` on its way: they are to be subtracted from
/// the lower end before the two are compared, since only so nothing is lost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Restart {
    /// The first entry that counts from here.
    pub bin: u32,
    /// What the antiderivatives had come to.
    pub sums: [f32; 4],
}

/// Antiderivatives of extinction and premultiplied colour over the bins of a value range.
#[derive(Clone, Debug, PartialEq)]
pub struct IntegratedTransfer {
    entries: Vec<[f32; 4]>,
    restarts: Vec<Restart>,
    max_depth: f64,
    bin_from_value: [f64; 2],
    unit_length: f64,
    next_opaque: Vec<u16>,
}

/// Nodes and weights of Gauss-Legendre quadrature on [-1, 1], exact to degree 7.
const GAUSS: [[f64; 2]; 4] = [
    [-0.861_136_311_594_052_6, 0.347_854_845_137_453_85],
    [-0.339_981_043_584_856_26, 0.652_145_154_862_546_1],
    [0.339_981_043_584_856_26, 0.652_145_154_862_546_1],
    [0.861_136_311_594_052_6, 0.347_854_845_137_453_85],
];

impl IntegratedTransfer {
    /// Integrates `transfer` over `value_range`, the finite values of the volume, with extinction per
    /// `unit_length` in world units (the smallest spacing of the volume suits f32 best).
    pub fn new(transfer: &TransferFunction, value_range: [f64; 2], unit_length: f64) -> Self {
        let [low, high] = value_range;
        let width = if high > low { high - low } else { low.abs().max(1.0) };
        // Where values are whole numbers, bins end on them: control points mostly stand there.
        let whole = width == width.trunc() && width <= MAX_BINS as f64 && low == low.trunc();
        let num_bins = if whole { MAX_BINS / width as usize * width as usize } else { MAX_BINS };
        let bin_width = width / num_bins as f64;
        let mut bins = Vec::with_capacity(num_bins + 1);
        let mut opaque = Vec::with_capacity(num_bins + 1);
        for bin in 0..=num_bins {
            // The last round is the bin beyond the range, where values are those of its upper end.
            let start = low + bin.min(num_bins - 1) as f64 * bin_width;
            let [from, to] = if bin < num_bins { [start, start + bin_width] } else { [high, high] };
            opaque.push(transfer.max_opacity(from, to) > 0.0);
            bins.push(integrate_bin(transfer, from, to, unit_length));
        }
        let (entries, restarts) = sum_up(&bins);
        let max_depth = bins.iter().map(|bin| bin[3]).fold(0.0, f64::max);
        let mut next_opaque = vec![u16::MAX; num_bins + 1];
        let mut next = u16::MAX;
        for bin in (0..=num_bins).rev() {
            next = if opaque[bin] { bin as u16 } else { next };
            next_opaque[bin] = next;
        }
        let scale = 1.0 / bin_width;
        Self { entries, restarts, max_depth, bin_from_value: [scale, -low * scale], unit_length, next_opaque }
    }

    /// At the lower edge of each bin `[∫ r s, ∫ g s, ∫ b s, ∫ s]` from the last [restart](Self::restarts) on, the
    /// width of a bin as the unit of value and extinction per [`unit_length`](Self::unit_length). `num_bins + 2` entries: behind the upper end of the
    /// range comes one more bin, so that a piece inside one bin can start there too.
    pub fn entries(&self) -> &[[f32; 4]] {
        &self.entries
    }

    /// Where the entries start anew, in ascending order; mostly nowhere, at most [`MAX_RESTARTS`].
    pub fn restarts(&self) -> &[Restart] {
        &self.restarts
    }

    /// Whether a ray can meet so much optical depth in one cell of a level that a few pieces are too few for it.
    pub fn is_dense(&self, layout: &VolumeLayout, level: u32) -> bool {
        let longest_chord = layout.spacing.length() * f64::from(level).exp2();
        self.max_depth * longest_chord / self.unit_length > DENSE_CELL_DEPTH
    }

    /// Bins over the value range; a multiple of the range for whole-numbered data.
    pub fn num_bins(&self) -> usize {
        self.entries.len() - 2
    }

    /// `[scale, offset]` with `bin = scale * value + offset`, in `[0, num_bins]` over the value range.
    pub fn bin_from_value(&self) -> [f64; 2] {
        self.bin_from_value
    }

    /// The world length that extinction refers to.
    pub fn unit_length(&self) -> f64 {
        self.unit_length
    }

    /// Whether everything between two positions in bins is perfectly transparent; never says so wrongly.
    /// True for an empty range (`low` above `high`, or NaN), so for blank matter.
    #[inline]
    pub fn is_transparent(&self, low_bin: f32, high_bin: f32) -> bool {
        let last = self.num_bins();
        // `as` saturates: below the range is bin 0.
        let first = (low_bin.floor() as usize).min(last);
        low_bin > high_bin
            || low_bin.is_nan()
            || self.next_opaque[first] > (high_bin.max(0.0) as usize).min(last) as u16
    }
}

/// Entries and restarts from the integrals over each bin.
fn sum_up(bins: &[[f64; 4]]) -> (Vec<[f32; 4]>, Vec<Restart>) {
    let narrow = |sums: [f64; 4]| sums.map(|sum| sum as f32);
    let mut max_growth = MAX_GROWTH;
    loop {
        let mut sums = [0.0_f64; 4];
        let mut entries = Vec::with_capacity(bins.len() + 1);
        let mut restarts = Vec::new();
        for (index, bin) in (0..).zip(bins) {
            if bin[3] > 0.0 && sums[3] > MIN_SUM.max(max_growth * bin[3]) {
                restarts.push(Restart { bin: index, sums: narrow(sums) });
                sums = [0.0; 4];
            }
            entries.push(narrow(sums));
            (0..4).for_each(|i| sums[i] += bin[i]);
        }
        entries.push(narrow(sums));
        if restarts.len() <= MAX_RESTARTS {
            return (entries, restarts);
        }
        max_growth *= 16.0;
    }
}

/// `[∫ r s, ∫ g s, ∫ b s, ∫ s]` over `[from, to]`, divided by the bin's width; a point counts as one bin of
/// its value.
fn integrate_bin(transfer: &TransferFunction, from: f64, to: f64, unit_length: f64) -> [f64; 4] {
    let at = |value: f64, weight: f64, sum: &mut [f64; 4]| {
        let ([r, g, b], opacity) = transfer.classify(value);
        let depth = (transfer.extinction_of_opacity(opacity) * unit_length).min(MAX_DEPTH_PER_UNIT) * weight;
        [r, g, b, 1.0].iter().zip(sum).for_each(|(color, sum)| *sum += color * depth);
    };
    let mut sum = [0.0; 4];
    if from == to {
        at(from, 1.0, &mut sum);
        return sum;
    }
    let mut start = from;
    let cuts = transfer.points().iter().map(|p| p.value).filter(|&value| value > from && value < to);
    for end in cuts.chain([to]) {
        let (middle, half) = ((start + end) / 2.0, (end - start) / 2.0);
        for [node, weight] in GAUSS {
            at(middle + half * node, weight * half / (to - from), &mut sum);
        }
        start = end;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use volery_scene::ControlPoint;

    fn ramp(points: &[(f64, f64, f64)]) -> TransferFunction {
        let point =
            |&(value, gray, opacity): &(f64, f64, f64)| ControlPoint { value, color: [gray; 3], opacity };
        TransferFunction::new(points.iter().map(point).collect(), 1.0).unwrap()
    }

    #[test]
    fn the_integral_of_a_linear_opacity_is_the_closed_form() {
        // ∫ -ln(1 - a) da = (1 - a) ln(1 - a) + a
        let table = IntegratedTransfer::new(&ramp(&[(0.0, 0.5, 0.0), (1.0, 0.5, 1.0)]), [0.0, 1.0], 1.0);
        let n = table.num_bins();
        for bin in [1, 7, 1000, 2048, 4000] {
            let a = bin as f64 / n as f64;
            let exact = ((1.0 - a) * (-a).ln_1p() + a) * n as f64;
            let found = f64::from(table.entries()[bin][3]);
            assert!((found - exact).abs() < 1e-6 * exact.max(1e-3), "bin {bin}: {found} against {exact}");
            assert!((f64::from(table.entries()[bin][0]) - exact / 2.0).abs() < 1e-6 * exact.max(1e-3));
        }
    }

    #[test]
    fn whole_numbers_fall_on_edges_of_bins() {
        let table = IntegratedTransfer::new(&ramp(&[(70.0, 0.0, 0.0), (110.0, 0.0, 0.3)]), [0.0, 255.0], 1.0);
        assert_eq!(table.num_bins(), 4080);
        let [scale, offset] = table.bin_from_value();
        assert_eq!(scale * 70.0 + offset, 1120.0);
        assert!(table.is_transparent(0.0, 1119.9));
        assert!(!table.is_transparent(0.0, 1121.0));
        assert!(table.is_transparent(1.0, 0.0) && table.is_transparent(f32::NAN, f32::NAN));
    }

    #[test]
    fn constant_and_opaque_data_stay_finite() {
        let table = IntegratedTransfer::new(&ramp(&[(0.0, 1.0, 1.0)]), [5.0, 5.0], 1e-6);
        let [_, _, _, depth] = table.entries()[1];
        assert!((f64::from(depth) - MAX_DEPTH_PER_UNIT).abs() < 1e-4);
        assert!(table.entries().iter().flatten().all(|x| x.is_finite()));
        let thin = IntegratedTransfer::new(&ramp(&[(0.0, 1.0, 1e-30)]), [0.0, 1.0], 1.0);
        assert!(thin.entries()[1][3] > 0.0, "an extinction of 1e-30 is kept");
        assert!(!thin.is_transparent(0.0, 1.0));
    }

    /// A piece's depth and colours as executors find them, against the f64 sums over its bins.
    #[test]
    fn thin_matter_above_opaque_values_keeps_its_digits() {
        let opaque_then = |thin: f64| {
            let points = [(0.0, 0.2, 1.0), (0.4, 0.2, 1.0), (0.5, 0.9, thin), (0.8, 0.3, 2.0 * thin)];
            ramp(&[&points[..], &[(0.9, 0.3, 1.0), (1.0, 0.7, thin)]].concat())
        };
        for thin in [0.3, 1e-2, 1e-5, 1e-30] {
            let tf = opaque_then(thin);
            let table = IntegratedTransfer::new(&tf, [0.0, 1.0], 1.0);
            println!("opacity {thin:e}: restarts {:?}", table.restarts());
            assert!(table.restarts().len() <= MAX_RESTARTS);
            let n = table.num_bins();
            let width = 1.0 / n as f64;
            let bins: Vec<_> =
                (0..n).map(|i| integrate_bin(&tf, i as f64 * width, (i + 1) as f64 * width, 1.0)).collect();
            let mut worst = 0.0_f64;
            for (from, length) in (0..n).flat_map(|from| [1, 2, 7, 100, 1500].map(|length| (from, length))) {
                let to = (from + length).min(n);
                for channel in [0, 3] {
                    let mut lower = table.entries()[from][channel];
                    let passed = |r: &&Restart| (from as u32) < r.bin && r.bin <= to as u32;
                    table.restarts().iter().filter(passed).for_each(|r| lower -= r.sums[channel]);
                    let found = f64::from(table.entries()[to][channel] - lower);
                    let exact: f64 = bins[from..to].iter().map(|bin| bin[channel]).sum();
                    let depth: f64 = bins[from..to].iter().map(|bin| bin[3]).sum();
                    let floor = 4e-6 * (to - from) as f64;
                    worst = worst.max((found - exact).abs() / (depth * 2.0_f64.powi(-10)).max(floor));
                }
            }
            println!("opacity {thin:e}: error {worst:.3} of the bound (threshold 1)");
            assert!(worst <= 1.0);
        }
    }

    #[test]
    fn transfer_functions_that_rise_have_no_restart_and_wild_ones_few() {
        let rising: Vec<_> = (0..=10).map(|i| (f64::from(i) / 10.0, 0.5, f64::from(i * i) / 100.0)).collect();
        let table = IntegratedTransfer::new(&ramp(&rising), [0.0, 1.0], 1.0);
        assert!(table.restarts().is_empty(), "{:?}", table.restarts());
        let wild: Vec<_> =
            (0..=400).map(|i| (f64::from(i) / 400.0, 0.5, if i % 2 == 0 { 1.0 } else { 1e-12 })).collect();
        let table = IntegratedTransfer::new(&ramp(&wild), [0.0, 1.0], 1.0);
        assert!(table.restarts().len() <= MAX_RESTARTS, "{:?}", table.restarts());
    }

    proptest! {
        #[test]
        fn what_is_called_transparent_is(
            opacities in proptest::collection::vec(prop_oneof![Just(0.0), 0.0..1.0f64], 2..6),
            low in 0.0..1.0f64, length in 0.0..1.0f64,
        ) {
            let last = (opacities.len() - 1) as f64;
            let points: Vec<_> =
                opacities.iter().enumerate().map(|(i, &a)| (i as f64 / last, 0.0, a)).collect();
            let tf = ramp(&points);
            let table = IntegratedTransfer::new(&tf, [0.0, 1.0], 1.0);
            let high = (low + length).min(1.0);
            let [scale, offset] = table.bin_from_value();
            if table.is_transparent((scale * low + offset) as f32, (scale * high + offset) as f32) {
                prop_assert_eq!(tf.max_opacity(low, high), 0.0);
            }
        }
    }
}
