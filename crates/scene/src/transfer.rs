//! The transfer function: value to straight colour and extinction, piecewise linear.
//!
//! A control point gives the *opacity* that matter of this value has per `unit_distance`; between points
//! colour and opacity are linear in the value, outside they are constant. Extinction follows exactly:
//! `s = -ln(1 - opacity) / unit_distance` per world length. Two points of the same value make a step;
//! at the value itself the last of them counts.

/// Colour and opacity at one value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlPoint {
    /// In data units.
    pub value: f64,
    /// Straight linear RGB, each in [0, 1].
    pub color: [f64; 3],
    /// In [0, 1], per unit distance; 1 is opaque at once.
    pub opacity: f64,
}

/// One thing that is wrong with a transfer function.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Defect {
    /// There is no control point.
    #[error("no control point, expected at least 1")]
    NoPoints,
    /// A value that is not finite.
    #[error("point {index}: value {found}, expected a finite number")]
    Value {
        /// Which point.
        index: usize,
        /// Its value.
        found: f64,
    },
    /// Values that fall.
    #[error("point {index}: value {found} is below the point before, expected rising values")]
    Order {
        /// Which point.
        index: usize,
        /// Its value.
        found: f64,
    },
    /// A colour component outside [0, 1].
    #[error("point {index}: colour {found:?}, expected three numbers in [0, 1]")]
    Color {
        /// Which point.
        index: usize,
        /// Its colour.
        found: [f64; 3],
    },
    /// An opacity outside [0, 1].
    #[error("point {index}: opacity {found}, expected a number in [0, 1]")]
    Opacity {
        /// Which point.
        index: usize,
        /// Its opacity.
        found: f64,
    },
    /// A unit distance that is not positive and finite.
    #[error("unit_distance is {found}, expected a positive finite number")]
    UnitDistance {
        /// The distance as given.
        found: f64,
    },
}

/// Why a [`TransferFunction`] could not be made: everything that is wrong with it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("transfer function: {}", .defects.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))]
pub struct Error {
    /// All defects found, at least one.
    pub defects: Vec<Defect>,
}

/// A valid one-dimensional transfer function.
#[derive(Clone, Debug, PartialEq)]
pub struct TransferFunction {
    points: Vec<ControlPoint>,
    unit_distance: f64,
}

impl TransferFunction {
    /// A transfer function of these control points, in order of value; opacities are per `unit_distance`
    /// world units.
    ///
    /// # Errors
    /// When points or distance are not meaningful; the error lists every defect.
    pub fn new(points: Vec<ControlPoint>, unit_distance: f64) -> Result<Self, Error> {
        let mut defects = Vec::new();
        if points.is_empty() {
            defects.push(Defect::NoPoints);
        }
        let unit = |x: f64| (0.0..=1.0).contains(&x);
        for (index, point) in points.iter().enumerate() {
            let found = point.value;
            if !found.is_finite() {
                defects.push(Defect::Value { index, found });
            } else if index > 0 && found < points[index - 1].value {
                defects.push(Defect::Order { index, found });
            }
            if !point.color.into_iter().all(unit) {
                defects.push(Defect::Color { index, found: point.color });
            }
            if !unit(point.opacity) {
                defects.push(Defect::Opacity { index, found: point.opacity });
            }
        }
        if !(unit_distance > 0.0 && unit_distance.is_finite()) {
            defects.push(Defect::UnitDistance { found: unit_distance });
        }
        if defects.is_empty() { Ok(Self { points, unit_distance }) } else { Err(Error { defects }) }
    }

    /// The control points, values not falling.
    pub fn points(&self) -> &[ControlPoint] {
        &self.points
    }

    /// The world length that opacities refer to.
    pub fn unit_distance(&self) -> f64 {
        self.unit_distance
    }

    /// Straight colour and opacity per unit distance at a value. NaN, a blank sample, is black and clear.
    pub fn classify(&self, value: f64) -> ([f64; 3], f64) {
        if value.is_nan() {
            return ([0.0; 3], 0.0);
        }
        let above = self.points.partition_point(|p| p.value <= value);
        if above == 0 || above == self.points.len() {
            let end = &self.points[above.saturating_sub(1)];
            return (end.color, end.opacity);
        }
        let (a, b) = (&self.points[above - 1], &self.points[above]);
        let w = (value - a.value) / (b.value - a.value);
        let mix = |from: f64, to: f64| from + (to - from) * w;
        let color = std::array::from_fn(|i| mix(a.color[i], b.color[i]));
        (color, mix(a.opacity, b.opacity))
    }

    /// Extinction per world length at a value; infinite where the opacity is 1.
    pub fn extinction(&self, value: f64) -> f64 {
        self.extinction_of_opacity(self.classify(value).1)
    }

    /// Extinction per world length of an opacity per unit distance: `-ln(1 - opacity) / unit_distance`.
    #[inline]
    pub fn extinction_of_opacity(&self, opacity: f64) -> f64 {
        extinction(opacity, self.unit_distance)
    }

    /// The largest opacity of any value in `[low, high]`, exactly. Zero for an empty range, so for a
    /// region of blank samples.
    pub fn max_opacity(&self, low: f64, high: f64) -> f64 {
        // Not `low > high`: a NaN must count as empty too.
        if low.partial_cmp(&high).is_none_or(|order| order.is_gt()) {
            return 0.0;
        }
        let inside = self.points.iter().filter(|p| (low..=high).contains(&p.value)).map(|p| p.opacity);
        inside.chain([self.classify(low).1, self.classify(high).1]).fold(0.0, f64::max)
    }

    /// Whether every value in `[low, high]` is perfectly transparent.
    pub fn is_transparent(&self, low: f64, high: f64) -> bool {
        self.max_opacity(low, high) == 0.0
    }
}

/// Extinction per world length of an opacity per unit distance.
#[inline]
pub(crate) fn extinction(opacity: f64, unit_distance: f64) -> f64 {
    -(-opacity).ln_1p() / unit_distance
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point(value: f64, gray: f64, opacity: f64) -> ControlPoint {
        ControlPoint { value, color: [gray; 3], opacity }
    }

    #[test]
    fn linear_between_constant_outside_and_stepping_at_equal_values() {
        let points =
            vec![point(0.0, 0.0, 0.0), point(2.0, 1.0, 0.5), point(2.0, 0.2, 0.1), point(4.0, 0.2, 0.1)];
        let tf = TransferFunction::new(points, 1.0).unwrap();
        assert_eq!(tf.classify(-1.0), ([0.0; 3], 0.0));
        assert_eq!(tf.classify(1.0), ([0.5; 3], 0.25));
        assert_eq!(tf.classify(2.0), ([0.2; 3], 0.1));
        assert!((tf.classify(2.0 - 1e-12).1 - 0.5).abs() < 1e-9);
        assert_eq!(tf.classify(9.0), ([0.2; 3], 0.1));
        assert_eq!(tf.classify(f64::NAN), ([0.0; 3], 0.0));
        assert_eq!(tf.max_opacity(1.9, 2.1), 0.5);
    }

    #[test]
    fn extinction_is_exact_at_the_ends() {
        let tf = TransferFunction::new(vec![point(0.0, 0.0, 0.0), point(1.0, 1.0, 1.0)], 2.0).unwrap();
        assert_eq!(tf.extinction(0.0), 0.0);
        assert_eq!(tf.extinction(1.0), f64::INFINITY);
        assert_eq!(tf.extinction(1e-30), 0.5e-30, "expm1 and ln_1p keep tiny opacities");
        assert!((tf.extinction(0.5) - 0.5 * std::f64::consts::LN_2).abs() < 1e-15);
    }

    #[test]
    fn every_defect_is_listed() {
        let points = vec![point(1.0, 2.0, 0.0), point(0.0, 0.0, -1.0), point(f64::NAN, 0.0, 0.0)];
        let error = TransferFunction::new(points, 0.0).unwrap_err();
        assert_eq!(error.defects.len(), 5, "{error}");
        assert_eq!(TransferFunction::new(vec![], 1.0).unwrap_err().defects, [Defect::NoPoints]);
    }

    proptest! {
        #[test]
        fn no_value_in_a_range_is_more_opaque_than_its_maximum(
            opacities in proptest::collection::vec(0.0..=1.0f64, 1..6),
            low in -2.0..8.0f64, length in 0.0..5.0f64, at in 0.0..=1.0f64,
        ) {
            let points = opacities.iter().enumerate().map(|(i, &o)| point(i as f64, 0.0, o)).collect();
            let tf = TransferFunction::new(points, 1.0).unwrap();
            let max = tf.max_opacity(low, low + length);
            prop_assert!(tf.classify(low + at * length).1 <= max + 1e-15);
            prop_assert_eq!(tf.is_transparent(low, low + length), max == 0.0);
        }
    }
}
