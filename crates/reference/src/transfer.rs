//! The transfer function cut into bands: ranges of values in which colour and opacity are linear.

use std::ops::Range;

use volery_scene::{ControlPoint, TransferFunction};

/// Extinction per unit distance that stands for the pole at opacity 1 when a single point of a piece hits
/// it: `-ln` of the smallest positive number. Its contribution vanishes with the point's.
const POLE: f64 = 745.0;

/// A range of values in which colour and opacity are linear.
#[derive(Clone, Debug)]
pub(crate) struct Band {
    low: ControlPoint,
    high: ControlPoint,
}

impl Band {
    /// No matter at any value of the band.
    pub(crate) fn is_clear(&self) -> bool {
        self.low.opacity == 0.0 && self.high.opacity == 0.0
    }

    /// Opaque at once at every value of the band.
    pub(crate) fn is_opaque(&self) -> bool {
        self.low.opacity == 1.0 && self.high.opacity == 1.0
    }

    /// The same colour and opacity at every value of the band.
    pub(crate) fn is_uniform(&self) -> bool {
        self.low.opacity == self.high.opacity && self.low.color == self.high.color
    }

    /// From its lowest to its highest value; infinite outside the outermost control points.
    pub(crate) fn width(&self) -> f64 {
        if self.low.value < self.high.value { self.high.value - self.low.value } else { f64::INFINITY }
    }

    /// The largest change of a colour channel per change of value.
    pub(crate) fn color_slope(&self) -> f64 {
        let change = |i: usize| (self.high.color[i] - self.low.color[i]).abs();
        change(0).max(change(1)).max(change(2)) / self.width()
    }
}

/// A value in a band, by how far it is from both ends: near either of them it keeps its digits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place<'a> {
    pub(crate) band: &'a Band,
    above_low: f64,
    below_high: f64,
}

impl Place<'_> {
    /// A value higher than this one by `rise`.
    pub(crate) fn up(&self, rise: f64) -> Self {
        Self { above_low: self.above_low + rise, below_high: self.below_high - rise, ..*self }
    }

    /// A mean of something at the ends of the band. With both weights from their own differences and nothing
    /// subtracted, it has all digits of the smallest of means.
    fn mix(&self, low: f64, high: f64) -> f64 {
        let width = self.band.width();
        let share = |part: f64| {
            let share = part / width;
            if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) }
        };
        low * share(self.below_high) + high * share(self.above_low)
    }

    pub(crate) fn color(&self) -> [f64; 3] {
        let Band { low, high } = self.band;
        if low.color == high.color {
            return low.color;
        }
        std::array::from_fn(|i| self.mix(low.color[i], high.color[i]))
    }

    pub(crate) fn opacity(&self) -> f64 {
        let Band { low, high } = self.band;
        if low.opacity == high.opacity { low.opacity } else { self.mix(low.opacity, high.opacity) }
    }

    /// Extinction per unit distance, infinite where the opacity is 1.
    pub(crate) fn extinction(&self) -> f64 {
        let opacity = self.opacity();
        if opacity < 0.5 {
            return -(-opacity).ln_1p();
        }
        // Near 1 it is the rest to 1 that must keep its digits.
        let [low, high] = [1.0 - self.band.low.opacity, 1.0 - self.band.high.opacity];
        -(if low == high { low } else { self.mix(low, high) }).ln()
    }

    /// Colour and extinction, the latter finite, for points inside a piece.
    pub(crate) fn classify(&self) -> ([f64; 3], f64) {
        (self.color(), self.extinction().min(POLE))
    }
}

/// The bands of a transfer function and the values that part them.
///
/// Fields are given by how far they are above a *base* near them: values of a large offset would have lost the digits
/// in which they differ. Control points are taken relative to the same base, which is exact where they are near it.
#[derive(Clone, Debug)]
pub(crate) struct Bands {
    /// Rising, all different: band `i` holds the values `v` with `edges[i - 1] <= v < edges[i]`.
    edges: Vec<f64>,
    bands: Vec<Band>,
    unit_distance: f64,
}

impl Bands {
    pub(crate) fn new(transfer: &TransferFunction) -> Self {
        let points = transfer.points();
        let constant = |point: ControlPoint| Band { low: point, high: point };
        let between = points
            .windows(2)
            .filter(|pair| pair[0].value < pair[1].value)
            .map(|pair| Band { low: pair[0], high: pair[1] });
        let mut edges: Vec<f64> = points.iter().map(|point| point.value).collect();
        edges.dedup();
        let first = constant(points[0]);
        let last = constant(points[points.len() - 1]);
        let bands = std::iter::once(first).chain(between).chain([last]).collect();
        Self { edges, bands, unit_distance: transfer.unit_distance() }
    }

    /// World length that extinctions of [`Place`] refer to.
    pub(crate) fn unit_distance(&self) -> f64 {
        self.unit_distance
    }

    /// How far a value is from those between the first edge and the last.
    pub(crate) fn beyond_edges(&self, value: f64) -> f64 {
        (self.edges[0] - value).max(value - self.edges[self.edges.len() - 1]).max(0.0)
    }

    /// How far the edge between bands `index` and `index + 1` is above a base.
    pub(crate) fn edge(&self, index: usize, base: f64) -> f64 {
        self.edges[index] - base
    }

    /// The number of the band of a value.
    fn index(&self, value: f64, base: f64) -> usize {
        self.edges.partition_point(|&edge| edge - base <= value)
    }

    /// The edges strictly between two values above a base, where colour or opacity have a kink or a step.
    pub(crate) fn edges_between(&self, low: f64, high: f64, base: f64) -> Range<usize> {
        let first = self.index(low, base);
        first..first + self.edges[first..].partition_point(|&edge| edge - base < high)
    }

    /// A value above a base, in its own band.
    pub(crate) fn at(&self, value: f64, base: f64) -> Place<'_> {
        self.in_band(self.index(value, base), value, base)
    }

    /// A value above a base, in a band that holds it or ends at it.
    pub(crate) fn in_band(&self, index: usize, value: f64, base: f64) -> Place<'_> {
        let band = &self.bands[index];
        let above_low = value - (band.low.value - base);
        let below_high = (band.high.value - base) - value;
        Place { band, above_low, below_high }
    }

    /// The bands of all values in `[low, high]`.
    pub(crate) fn of_range(&self, low: f64, high: f64) -> &[Band] {
        &self.bands[self.index(low, 0.0)..=self.index(high, 0.0)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bands(points: &[(f64, f64)]) -> Bands {
        let points = points
            .iter()
            .map(|&(value, opacity)| ControlPoint { value, color: [opacity; 3], opacity })
            .collect();
        Bands::new(&TransferFunction::new(points, 2.0).unwrap())
    }

    #[test]
    fn bands_classify_like_the_transfer_function() {
        let points: Vec<ControlPoint> = [(0.0, 0.0), (1.0, 0.5), (1.0, 0.2), (1.0, 0.9), (3.0, 1.0)]
            .map(|(value, opacity)| ControlPoint { value, color: [opacity, 1.0 - opacity, 0.5], opacity })
            .to_vec();
        let transfer = TransferFunction::new(points, 2.0).unwrap();
        let bands = Bands::new(&transfer);
        for i in -20..60 {
            let value = f64::from(i) / 16.0;
            let (color, opacity) = transfer.classify(value);
            for base in [0.0, value, 0.5, 1.0, -2.0] {
                let place = bands.at(value - base, base);
                for (found, expected) in place.color().into_iter().zip(color) {
                    assert!((found - expected).abs() < 1e-15, "{value}");
                }
                let expected = transfer.extinction_of_opacity(opacity) * 2.0;
                let found = place.extinction();
                assert!(found == expected || (found - expected).abs() < 1e-13 * expected, "{value}");
            }
        }
    }

    #[test]
    fn edges_are_strictly_inside_and_clear_ranges_are_found() {
        let bands = bands(&[(0.0, 0.0), (1.0, 0.0), (2.0, 0.5), (3.0, 0.0)]);
        assert_eq!(bands.edges_between(0.0, 2.0, 0.0), 1..2);
        assert_eq!(bands.edges_between(-1.0, 9.0, 0.0), 0..4);
        assert!(bands.edges_between(1.0, 1.5, 0.0).is_empty());
        assert_eq!(bands.edges_between(-1.0, 1.0, 1.0), 1..2);
        assert_eq!(bands.edge(3, 1.0), 2.0);
        let is_clear = |low, high| bands.of_range(low, high).iter().all(Band::is_clear);
        assert!(is_clear(-5.0, 0.5) && is_clear(3.0, 8.0));
        assert!(!is_clear(0.5, 1.5) && !is_clear(0.0, 4.0));
    }
}
