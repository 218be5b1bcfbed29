//! A smooth function as a polynomial of degree 7: the field along a ray through a cell that is not affine.
//!
//! It takes the function's values at the eight Chebyshev points. What the interpolant leaves of a smooth function is
//! nearly a multiple of the next Chebyshev polynomial, so it is measured where that is largest.

use crate::field::{Field, Rise, crossing};

const NUM_NODES: usize = 8;

/// The upper Chebyshev points `cos((2 k + 1) pi / 16)` on [-1, 1]; the lower are their negatives.
const NODES: [f64; 4] =
    [0.980_785_280_403_230_4, 0.831_469_612_302_545_2, 0.555_570_233_019_602_2, 0.195_090_322_016_128_28];

/// Where the eighth Chebyshev polynomial has its largest values: `cos(pi / 8)`, and 0.
const CHECKS: [f64; 2] = [0.923_879_532_511_286_7, 0.0];

/// `[i][k]`: coefficient of `x^(2 k)` of the polynomial in `x^2` that is 1 at node `i` and 0 at the others.
static EVEN: [[f64; 4]; 4] = even();

const fn even() -> [[f64; 4]; 4] {
    let mut matrix = [[0.0; 4]; 4];
    let mut i = 0;
    while i < 4 {
        let power = &mut matrix[i];
        power[0] = 1.0;
        let mut j = 0;
        while j < 4 {
            if j != i {
                let (own, other) = (NODES[i] * NODES[i], NODES[j] * NODES[j]);
                let scale = 1.0 / (own - other);
                let mut d = 3;
                while d > 0 {
                    power[d] = (power[d - 1] - other * power[d]) * scale;
                    d -= 1;
                }
                power[0] *= -other * scale;
            }
            j += 1;
        }
        i += 1;
    }
    matrix
}

/// A polynomial on the unit interval, by its powers of `x = 2 t - 1`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Septic {
    power: [f64; NUM_NODES],
}

impl Septic {
    /// The interpolant of a function of `t` in [0, 1], and the error found; `None` where the function has no value.
    pub(super) fn of(function: impl Fn(f64) -> Option<f64>) -> Option<(Self, f64)> {
        let function = |x: f64| function(0.5 + 0.5 * x);
        let mut power = [0.0; NUM_NODES];
        for (node, row) in NODES.into_iter().zip(&EVEN) {
            let (low, high) = (function(-node)?, function(node)?);
            let (mean, slope) = (0.5 * low + 0.5 * high, (0.5 * high - 0.5 * low) / node);
            for (k, weight) in row.iter().enumerate() {
                power[2 * k] += weight * mean;
                power[2 * k + 1] += weight * slope;
            }
        }
        let septic = Self { power };
        let mut error = 0.0;
        for check in CHECKS {
            error = f64::max(error, (evaluate(&power, check) - function(check)?).abs());
        }
        power.iter().all(|coefficient| coefficient.is_finite()).then_some((septic, error))
    }
}

fn evaluate(power: &[f64], x: f64) -> f64 {
    power.iter().rev().fold(0.0, |sum, coefficient| sum * x + coefficient)
}

impl Field<7> for Septic {
    #[inline]
    fn at(&self, t: f64) -> f64 {
        let [a, b, c, d, e, f, g, h] = self.power;
        let x = 2.0 * t - 1.0;
        a + x * (b + x * (c + x * (d + x * (e + x * (f + x * (g + x * h))))))
    }

    fn slope_at(&self, t: f64) -> f64 {
        let [_, b, c, d, e, f, g, h] = self.power;
        let x = 2.0 * t - 1.0;
        2.0 * (b + x
            * (2.0 * c + x * (3.0 * d + x * (4.0 * e + x * (5.0 * f + x * (6.0 * g + x * 7.0 * h))))))
    }

    fn range(&self) -> [f64; 2] {
        let reach: f64 = self.power[1..].iter().map(|coefficient| coefficient.abs()).sum();
        [self.power[0] - reach, self.power[0] + reach]
    }

    fn rise(&self, start: f64) -> Rise<7> {
        // Horner's scheme again and again: each pass leaves one more coefficient about the start.
        let (mut power, x) = (self.power, 2.0 * start - 1.0);
        for first in 0..NUM_NODES {
            for k in (first..NUM_NODES - 1).rev() {
                power[k] += x * power[k + 1];
            }
        }
        let mut scale = 1.0;
        Rise {
            power: std::array::from_fn(|k| {
                scale *= 2.0;
                power[k + 1] * scale
            }),
        }
    }

    /// Between two neighbouring zeros of its derivative a function has at most one zero; so the zeros of the
    /// derivatives are found from the highest, which is a line, down.
    fn turns(&self) -> impl Iterator<Item = f64> {
        // The ends of the interval and the zeros between them.
        let mut ends = [-1.0; NUM_NODES + 1];
        ends[1] = 1.0;
        let mut count = 2;
        for order in (1..NUM_NODES - 1).rev() {
            let mut derived = self.power;
            let degree = NUM_NODES - 1 - order;
            for _ in 0..order {
                for k in 1..NUM_NODES {
                    derived[k - 1] = derived[k] * k as f64;
                }
                derived[NUM_NODES - 1] = 0.0;
            }
            let mut slope = [0.0; NUM_NODES];
            (1..=degree).for_each(|k| slope[k - 1] = derived[k] * k as f64);
            let at = |x: f64| evaluate(&derived[..=degree], x);
            let slope_at = |x: f64| evaluate(&slope[..degree], x);
            let mut zeros = [-1.0; NUM_NODES + 1];
            let mut num_zeros = 1;
            for pair in ends[..count].windows(2) {
                let (first, last) = (at(pair[0]), at(pair[1]));
                if first * last < 0.0 {
                    zeros[num_zeros] = crossing(at, slope_at, pair[0], pair[1]);
                    num_zeros += 1;
                } else if last == 0.0 && pair[1] < 1.0 {
                    zeros[num_zeros] = pair[1];
                    num_zeros += 1;
                }
            }
            zeros[num_zeros] = 1.0;
            (ends, count) = (zeros, num_zeros + 1);
        }
        let inner = ends.into_iter().take(count - 1).skip(1);
        inner.map(|x| 0.5 + 0.5 * x).filter(|t| *t > 0.0 && *t < 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The Chebyshev polynomial of degree 7, whose turns and values there are known.
    #[test]
    fn a_polynomial_of_degree_7_is_itself_and_turns_where_it_should() {
        let chebyshev = |t: f64| (7.0 * (2.0 * t - 1.0).acos()).cos();
        let (septic, error) = Septic::of(|t| Some(chebyshev(t))).unwrap();
        assert!(error < 1e-13, "{error:e}");
        let turns: Vec<f64> = septic.turns().collect();
        let expected = (1..7).rev().map(|k| 0.5 + 0.5 * (f64::from(k) * std::f64::consts::PI / 7.0).cos());
        let expected: Vec<f64> = expected.collect();
        assert_eq!(turns.len(), expected.len(), "{turns:?}");
        for (found, expected) in turns.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{turns:?}");
        }
        let [low, high] = septic.range();
        for i in 0..=64 {
            let t = f64::from(i) / 64.0;
            assert!((septic.at(t) - chebyshev(t)).abs() < 1e-12);
            assert!(low <= chebyshev(t) && chebyshev(t) <= high);
            assert!(septic.slope_at(t).abs() <= septic.rise(0.0).max_slope());
            let rise = septic.rise(t).at(0.25);
            let expected = septic.at(t + 0.25) - septic.at(t);
            assert!((rise - expected).abs() < 1e-11, "{t}: {rise} {expected}");
        }
    }

    #[test]
    fn the_error_of_what_is_no_polynomial_is_found() {
        let (septic, error) = Septic::of(|t| Some(1.0 / (1.2 + t))).unwrap();
        let largest = (0..=1000)
            .map(f64::from)
            .map(|i| (septic.at(i / 1000.0) - 1.0 / (1.2 + i / 1000.0)).abs())
            .fold(0.0, f64::max);
        assert!(error > 0.3 * largest && error < 2.0 * largest, "{error:e} of {largest:e}");
        assert!(Septic::of(|t| (t < 0.5).then_some(t)).is_none());
    }
}
