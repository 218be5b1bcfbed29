//! How much a part of the picture matters: the functions of Li and Shen (2001, section 4.3), and their sum.
//!
//! All return a finite number of at least 0, whatever they are given; what cannot be judged is 0. Any function of the
//! caller's does as well: the scheduler takes numbers.

/// The largest importance returned.
const MAX_IMPORTANCE: f64 = 1e15;

/// NaN and negative numbers as 0, infinity as a large number.
fn sane(number: f64) -> f64 {
    if number > 0.0 { number.min(MAX_IMPORTANCE) } else { 0.0 }
}

fn distance<const N: usize>(a: [f64; N], b: [f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// The largest opacity in the part, from 0 to 1.
pub fn max_opacity(opacities: impl IntoIterator<Item = f64>) -> f64 {
    opacities.into_iter().map(|opacity| sane(opacity).min(1.0)).fold(0.0, f64::max)
}

/// The reciprocal of the distance from the eye to the centre of a part. At less than `near`, all are as close as that;
/// where `near` is not positive, a millionth.
pub fn nearness(eye: [f64; 3], centre: [f64; 3], near: f64) -> f64 {
    let near = if near > 0.0 { near } else { 1e-6 };
    let distance = distance(eye, centre);
    if distance.is_nan() { 0.0 } else { sane(1.0 / distance.max(near)) }
}

/// The part of the screen that a part's bounding box covers, both as `[low, high]` in pixels: from 0 to 1.
pub fn projected_area(bounds: [[f64; 2]; 2], screen: [[f64; 2]; 2]) -> f64 {
    let area = |side: &dyn Fn(usize) -> f64| sane(side(0)) * sane(side(1));
    let whole = area(&|axis| screen[1][axis] - screen[0][axis]);
    // min and max would take the other side where a corner is NaN.
    if whole == 0.0 || bounds.as_flattened().iter().any(|corner| corner.is_nan()) {
        return 0.0;
    }
    let seen = area(&|axis| bounds[1][axis].min(screen[1][axis]) - bounds[0][axis].max(screen[0][axis]));
    sane(seen / whole).min(1.0)
}

/// Falls with the distance on the screen from the centre of the gaze to the centre of a part: 1 there, 1/2 at `radius`,
/// as `1 / (1 + (distance / radius)^2)`. 0 where `radius` is not positive.
pub fn gaze(gaze: [f64; 2], centre: [f64; 2], radius: f64) -> f64 {
    if radius > 0.0 { sane(1.0 / (1.0 + (distance(gaze, centre) / radius).powi(2))) } else { 0.0 }
}

/// The sum of (weight, importance). For terms of different units, bring each to a mean of 1 first: [`normalise`].
pub fn weighted_sum(terms: impl IntoIterator<Item = (f64, f64)>) -> f64 {
    sane(terms.into_iter().map(|(weight, importance)| sane(weight) * sane(importance)).sum())
}

/// Divides importance of all parts by its mean, so that terms of different units can be added. All 0 stays so.
pub fn normalise(importance: &mut [f64]) {
    importance.iter_mut().for_each(|number| *number = sane(*number));
    let mean = importance.iter().sum::<f64>() / importance.len().max(1) as f64;
    if mean > 0.0 {
        importance.iter_mut().for_each(|number| *number = sane(*number / mean));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ODD: [f64; 8] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, -1.0, 0.0, 1e-320, 3.0];

    #[test]
    fn closed_forms() {
        assert_eq!(max_opacity([0.2, 0.7, f64::NAN, 0.1]), 0.7);
        assert_eq!(max_opacity([]), 0.0);
        assert_eq!(nearness([0.0; 3], [3.0, 0.0, 4.0], 1.0), 0.2);
        assert_eq!(nearness([0.0; 3], [0.0; 3], 0.5), 2.0);
        assert_eq!(projected_area([[-5.0, 0.0], [5.0, 20.0]], [[0.0, 0.0], [10.0, 10.0]]), 0.5);
        assert_eq!(projected_area([[11.0, 0.0], [12.0, 9.0]], [[0.0, 0.0], [10.0, 10.0]]), 0.0);
        assert_eq!(gaze([1.0, 1.0], [1.0, 1.0], 2.0), 1.0);
        assert_eq!(gaze([0.0, 0.0], [0.0, 2.0], 2.0), 0.5);
        assert_eq!(weighted_sum([(1.0, 2.0), (0.5, 4.0), (f64::NAN, 1.0)]), 4.0);
        let mut importance = [1.0, 3.0, f64::NAN, -2.0];
        normalise(&mut importance);
        assert_eq!(importance, [1.0, 3.0, 0.0, 0.0]);
    }

    #[test]
    fn whatever_the_numbers_importance_is_finite_and_not_negative() {
        for a in ODD {
            for b in ODD {
                for c in ODD {
                    let mut several = [a, b, c];
                    normalise(&mut several);
                    let found = [
                        max_opacity([a, b, c]),
                        nearness([a, b, c], [b, c, a], c),
                        projected_area([[a, b], [c, a]], [[b, c], [a, b]]),
                        projected_area([[a, b], [c, a]], [[0.0, 0.0], [8.0, 8.0]]),
                        gaze([a, b], [c, a], b),
                        weighted_sum([(a, b), (c, a)]),
                    ];
                    let is_sane = |number: &f64| number.is_finite() && *number >= 0.0;
                    assert!(found.iter().chain(&several).all(is_sane), "{a} {b} {c}: {found:?} {several:?}");
                }
            }
        }
    }
}
