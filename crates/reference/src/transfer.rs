//! The transfer function cut into bands: ranges of values in which colour and opacity are linear.

use volery_scene::{ControlPoint, TransferFunction};

/// Extinction per unit distance that stands for the pole at opacity 1 when a single point of a piece hits
/// it: `-ln` of the smallest positive number. Its contribution vanishes with the point's.
const POLE: f64 = 745.0;

/// A range of values in which colour and opacity are linear.
#[derive(Clone, Debug)]
pub(crate) struct Band {
    low: ControlPoint,
    high: ControlPoint,
    /// 1 / (high value - low value); 0 outside the outermost control points, where all is constant.
    per_value: f64,
}

impl Band {
    fn weight(&self, value: f64) -> f64 {
        let w = (value - self.low.value) * self.per_value;
        if w.is_nan() { 0.0 } else { w.clamp(0.0, 1.0) }
    }

    pub(crate) fn color(&self, value: f64) -> [f64; 3] {
        let w = self.weight(value);
        std::array::from_fn(|i| self.low.color[i] + (self.high.color[i] - self.low.color[i]) * w)
    }

    /// Extinction per unit distance at a value, infinite where the opacity is 1.
    pub(crate) fn extinction(&self, value: f64) -> f64 {
        let w = self.weight(value);
        let opacity = self.low.opacity + (self.high.opacity - self.low.opacity) * w;
        if opacity < 0.5 {
            return -(-opacity).ln_1p();
        }
        // Near 1 it is the rest to 1 that must keep its digits.
        let [low, high] = [1.0 - self.low.opacity, 1.0 - self.high.opacity];
        -(low + (high - low) * w).max(0.0).ln()
    }

    /// Colour and extinction, the latter finite, for points inside a piece.
    pub(crate) fn classify(&self, value: f64) -> ([f64; 3], f64) {
        (self.color(value), self.extinction(value).min(POLE))
    }

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
        1.0 / self.per_value
    }

    /// The largest change of a colour channel per change of value.
    pub(crate) fn color_slope(&self) -> f64 {
        let change = |i: usize| (self.high.color[i] - self.low.color[i]).abs() * self.per_value;
        change(0).max(change(1)).max(change(2))
    }
}

/// The bands of a transfer function and the values that part them.
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
        let constant = |point: ControlPoint| Band { low: point, high: point, per_value: 0.0 };
        let between = points.windows(2).filter(|pair| pair[0].value < pair[1].value).map(|pair| Band {
            low: pair[0],
            high: pair[1],
            per_value: 1.0 / (pair[1].value - pair[0].value),
        });
        let mut edges: Vec<f64> = points.iter().map(|point| point.value).collect();
        edges.dedup();
        let first = constant(points[0]);
        let last = constant(points[points.len() - 1]);
        let bands = std::iter::once(first).chain(between).chain([last]).collect();
        Self { edges, bands, unit_distance: transfer.unit_distance() }
    }

    /// World length that extinctions of [`Band`] refer to.
    pub(crate) fn unit_distance(&self) -> f64 {
        self.unit_distance
    }

    fn index(&self, value: f64) -> usize {
        self.edges.partition_point(|&edge| edge <= value)
    }

    /// The band of a value.
    pub(crate) fn at(&self, value: f64) -> &Band {
        &self.bands[self.index(value)]
    }

    /// The values strictly between `low` and `high` where colour or opacity have a kink or a step.
    pub(crate) fn edges_between(&self, low: f64, high: f64) -> &[f64] {
        let first = self.index(low);
        let end = first + self.edges[first..].partition_point(|&edge| edge < high);
        &self.edges[first..end]
    }

    /// The bands of all values in `[low, high]`.
    pub(crate) fn of_range(&self, low: f64, high: f64) -> &[Band] {
        &self.bands[self.index(low)..=self.index(high)]
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
            let band = bands.at(value);
            for (found, expected) in band.color(value).into_iter().zip(color) {
                assert!((found - expected).abs() < 1e-15, "{value}");
            }
            let expected = transfer.extinction_of_opacity(opacity) * 2.0;
            let found = band.extinction(value);
            assert!(found == expected || (found - expected).abs() < 1e-13 * expected, "{value}");
        }
    }

    #[test]
    fn edges_are_strictly_inside_and_clear_ranges_are_found() {
        let bands = bands(&[(0.0, 0.0), (1.0, 0.0), (2.0, 0.5), (3.0, 0.0)]);
        assert_eq!(bands.edges_between(0.0, 2.0), [1.0]);
        assert_eq!(bands.edges_between(-1.0, 9.0), [0.0, 1.0, 2.0, 3.0]);
        assert!(bands.edges_between(1.0, 1.5).is_empty());
        let is_clear = |low, high| bands.of_range(low, high).iter().all(Band::is_clear);
        assert!(is_clear(-5.0, 0.5) && is_clear(3.0, 8.0));
        assert!(!is_clear(0.5, 1.5) && !is_clear(0.0, 4.0));
    }
}
