//! Height of an opacity, so that small opacities can be told apart and edited (Benölken and Graf 2005, section 3.3).
//!
//! `height = ln((b - 1) opacity + 1) / ln b` and `opacity = (b^height - 1) / (b - 1)`, both through `ln(1 + x)` and
//! `e^x - 1`, so no digits are lost at small opacities or where the base comes near 1, which is linear. Larger bases
//! give more of the height to small opacities, bases below 1 to large ones. Both rise from 0 to 1 over [0, 1]; outside,
//! the ends count. NaN where the base is not positive and finite, or its argument NaN.

/// The height in [0, 1] that stands for an opacity in [0, 1].
pub fn height_from_opacity(base: f64, opacity: f64) -> f64 {
    let opacity = opacity.clamp(0.0, 1.0);
    match checked(base) {
        1.0 => opacity,
        base => (((base - 1.0) * opacity).ln_1p() / base.ln()).clamp(0.0, 1.0),
    }
}

/// The opacity in [0, 1] that a height in [0, 1] stands for: the inverse of [`height_from_opacity`].
pub fn opacity_from_height(base: f64, height: f64) -> f64 {
    let height = height.clamp(0.0, 1.0);
    match checked(base) {
        1.0 => height,
        base => ((height * base.ln()).exp_m1() / (base - 1.0)).clamp(0.0, 1.0),
    }
}

fn checked(base: f64) -> f64 {
    if base > 0.0 && base.is_finite() { base } else { f64::NAN }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_papers_formulas_where_they_lose_no_digits() {
        for base in [0.01_f64, 0.5, 2.0, std::f64::consts::E, 10.0, 1000.0] {
            for i in 0..=100 {
                let x = f64::from(i) / 100.0;
                let height = ((base - 1.0) * x + 1.0).ln() / base.ln();
                let opacity = (base.powf(x) - 1.0) / (base - 1.0);
                let error = (height_from_opacity(base, x) - height).abs();
                assert!(error < 1e-14, "base {base}, opacity {x}: off by {error:e}");
                let error = (opacity_from_height(base, x) - opacity).abs();
                assert!(error < 1e-14, "base {base}, height {x}: off by {error:e}");
            }
        }
        assert!((height_from_opacity(100.0, 0.01) - 0.149_43).abs() < 1e-5, "ln 1.99 / ln 100");
    }

    #[test]
    fn near_a_base_of_1_it_is_linear_to_second_order() {
        for off in [0.0, f64::EPSILON, -f64::EPSILON, 1e-12, 1e-8, -1e-8, 1e-4] {
            for opacity in [0.0, 1e-200, 1e-9, 0.3, 0.999, 1.0] {
                // ln(1 + c a) / ln(1 + c) = a (1 + c (1 - a) / 2 + O(c²)).
                let expected = opacity * (1.0 + off * (1.0 - opacity) / 2.0);
                let error = (height_from_opacity(1.0 + off, opacity) - expected).abs();
                assert!(error <= opacity * (off * off + 1e-15), "1 + {off:e}, {opacity}: off by {error:e}");
            }
        }
    }

    #[test]
    fn the_ends_are_0_and_1_for_any_base() {
        for base in [f64::MIN_POSITIVE, 1e-9, 0.5, 1.0, 1.0 + f64::EPSILON, 7.0, 1e300, f64::MAX] {
            for (below, above) in [(0.0, 1.0), (-0.1, 1.1), (f64::NEG_INFINITY, f64::INFINITY)] {
                for map in [height_from_opacity, opacity_from_height] {
                    assert_eq!(map(base, below), 0.0, "{base}");
                    let full = map(base, above);
                    assert!((1.0 - 1e-12..=1.0).contains(&full), "{base}: {full}");
                }
            }
        }
        for base in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(
                height_from_opacity(base, 0.5).is_nan() && opacity_from_height(base, 0.5).is_nan(),
                "{base}"
            );
        }
    }

    proptest! {
        #[test]
        fn there_and_back_again(exponent in -6.0..12.0f64, opacity in 0.0..=1.0f64, small in -30.0..0.0f64) {
            let base = 10f64.powf(exponent);
            for opacity in [opacity, 10f64.powf(small)] {
                let back = opacity_from_height(base, height_from_opacity(base, opacity));
                // Below a base of 1, opacities near 1 lie on little height.
                let most = 1e-14 * if base < 1.0 { 1.0 } else { opacity * (1.0 + base.ln()) };
                prop_assert!((back - opacity).abs() <= most, "base {}: {} is not {}", base, back, opacity);
            }
            if base > 1.0 {
                let height = height_from_opacity(base, opacity_from_height(base, opacity));
                prop_assert!((height - opacity).abs() <= 1e-14, "base {}: {} is not {}", base, height, opacity);
            }
        }

        #[test]
        fn both_rise(exponent in -6.0..12.0f64, a in 0.0..=1.0f64, b in 0.0..=1.0f64) {
            let (base, [low, high]) = (10f64.powf(exponent), [a.min(b), a.max(b)]);
            prop_assert!(height_from_opacity(base, low) <= height_from_opacity(base, high));
            prop_assert!(opacity_from_height(base, low) <= opacity_from_height(base, high));
            if high - low > 1e-9 && base > 1e-3 && base < 1e3 {
                prop_assert!(height_from_opacity(base, low) < height_from_opacity(base, high));
                prop_assert!(opacity_from_height(base, low) < opacity_from_height(base, high));
            }
        }
    }
}
