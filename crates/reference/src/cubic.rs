//! A cubic polynomial on [0, 1] in Bernstein form: the field along a ray through one cell of a voxel grid.

use crate::field::{Field, Rise};

/// `Σ bᵢ Bᵢ(t)`. Its values lie in the range of its coefficients, and it starts and ends at the outer two.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cubic {
    bernstein: [f64; 4],
    power: [f64; 4],
}

impl Cubic {
    pub(crate) fn new(bernstein: [f64; 4]) -> Self {
        let [a, b, c, d] = bernstein;
        let power = [a, 3.0 * (b - a), 3.0 * ((c - b) - (b - a)), (d - c) - 2.0 * (c - b) + (b - a)];
        Self { bernstein, power }
    }

    /// Where the slope changes its sign inside (0, 1), in order; `None`s last.
    fn turning_points(&self) -> [Option<f64>; 2] {
        let [_, b, c, d] = self.power;
        // b + 2 c t + 3 d t² = 0; the two forms of its roots that do not cancel.
        let discriminant = c * c - 3.0 * d * b;
        if discriminant.is_nan() || discriminant < 0.0 {
            return [None; 2];
        }
        let q = -(c + discriminant.sqrt().copysign(c));
        let inside = |t: f64| (t > 0.0 && t < 1.0).then_some(t);
        match [inside(q / (3.0 * d)), inside(b / q)] {
            [Some(s), Some(t)] if s > t => [Some(t), Some(s)],
            [None, some] => [some, None],
            roots => roots,
        }
    }
}

impl Field<3> for Cubic {
    #[inline]
    fn at(&self, t: f64) -> f64 {
        if t == 1.0 {
            // To the last bit: a sample may be just where a band of opacity 1 begins.
            return self.bernstein[3];
        }
        let [a, b, c, d] = self.power;
        a + t * (b + t * (c + t * d))
    }

    fn slope_at(&self, t: f64) -> f64 {
        let [_, b, c, d] = self.power;
        b + t * (2.0 * c + t * 3.0 * d)
    }

    fn range(&self) -> [f64; 2] {
        let [a, b, c, d] = self.bernstein;
        [a.min(b).min(c.min(d)), a.max(b).max(c.max(d))]
    }

    fn turns(&self) -> impl Iterator<Item = f64> {
        self.turning_points().into_iter().flatten()
    }

    fn rise(&self, start: f64) -> Rise<3> {
        let [_, _, c, d] = self.power;
        Rise { power: [self.slope_at(start), c + 3.0 * d * start, d] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transfer::Bands;
    use proptest::prelude::*;
    use std::ops::ControlFlow;
    use volery_scene::{ControlPoint, TransferFunction};

    /// Ends of pieces inside (0, 1), turns and crossings of these values.
    fn splits_at(cubic: &Cubic, edges: &[f64]) -> Vec<f64> {
        let points = edges.iter().map(|&value| ControlPoint { value, color: [0.5; 3], opacity: 0.5 });
        let bands = Bands::new(&TransferFunction::new(points.collect(), 1.0).unwrap());
        let (mut ends, mut end) = (Vec::new(), 0.0);
        let flow = cubic.pieces(&bands, 0.0, |piece| {
            end += piece.width;
            ends.push(end);
            ControlFlow::Continue(())
        });
        assert!(flow.is_continue());
        // Each width is solved for: they are better known than their sums.
        assert!((ends.pop().unwrap() - 1.0).abs() < 1.8e-15);
        ends
    }

    #[test]
    fn three_crossings_of_one_value_are_found_to_the_last_bits() {
        // (t - 1/8)(t - 1/2)(t - 3/4), from its power form.
        let (p, q, r) = (0.125, 0.5, 0.75);
        let power = [-p * q * r, p * q + p * r + q * r, -(p + q + r), 1.0];
        let bernstein = [
            power[0],
            power[0] + power[1] / 3.0,
            power[0] + 2.0 * power[1] / 3.0 + power[2] / 3.0,
            power.iter().sum(),
        ];
        let cubic = Cubic::new(bernstein);
        let found = splits_at(&cubic, &[0.0]);
        assert_eq!(found.len(), 5, "three crossings and two turns: {found:?}");
        for root in [p, q, r] {
            assert!(found.iter().any(|t| (t - root).abs() < 1e-15), "{root} in {found:?}");
        }
    }

    #[test]
    fn a_constant_and_a_line_do_not_turn() {
        assert!(splits_at(&Cubic::new([7.3; 4]), &[7.3]).is_empty());
        let line = Cubic::new([0.0, 1.0, 2.0, 3.0]);
        assert_eq!(splits_at(&line, &[1.5]), [0.5]);
    }

    proptest! {
        #[test]
        fn between_splits_the_field_is_monotone_and_crosses_nothing(
            bernstein in proptest::array::uniform4(-2i32..=2),
            edges in proptest::collection::btree_set(-4i32..=4, 1..4),
        ) {
            // Small integers make double roots, flat ends and exact hits common.
            let cubic = Cubic::new(bernstein.map(f64::from));
            let edges: Vec<f64> = edges.into_iter().map(|e| f64::from(e) / 2.0).collect();
            let mut ends = vec![0.0];
            ends.extend(splits_at(&cubic, &edges));
            ends.push(1.0);
            for pair in ends.windows(2) {
                prop_assert!(pair[0] <= pair[1]);
                let values: Vec<f64> =
                    (0..=16).map(|i| cubic.at(pair[0] + (pair[1] - pair[0]) * f64::from(i) / 16.0)).collect();
                let (rise, fall) = (values[16] >= values[0], values[16] <= values[0]);
                for w in values.windows(2) {
                    prop_assert!((rise && w[1] >= w[0] - 1e-15) || (fall && w[1] <= w[0] + 1e-15));
                }
                for &edge in &edges {
                    // Ends are sums of at most twelve widths; `splits_at` holds the last to sixteen roundings of 1, 1.8e-15.
                    // With coefficients in [-2, 2] no slope is over 3 * 4. Values are rounded to 4e-15.
                    let inside = |v: f64| (v - edge).abs() > 12.0 * 1.8e-15 + 4e-15;
                    let above = values.iter().any(|&v| inside(v) && v > edge);
                    let below = values.iter().any(|&v| inside(v) && v < edge);
                    prop_assert!(!(above && below), "{:?} crosses {}", pair, edge);
                }
            }
        }
    }
}
