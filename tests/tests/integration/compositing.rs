//! What a target's number of bits does to thousands of thin layers: why colour accumulates in 32 bits.
//!
//! The backends themselves are held to this by the suite of `volery-conformance`
//! (`thousands_of_thin_layers`); here the alternatives are measured.

use volery_tests::at_most;

/// Light and transmittance after `layers` layers of white at `opacity`, front to back, each sum rounded.
fn composited(layers: usize, opacity: f64, rounded: impl Fn(f64) -> f64) -> [f64; 2] {
    let mut target = [0.0, 1.0];
    for _ in 0..layers {
        target = [rounded(target[0] + target[1] * opacity), rounded(target[1] * (1.0 - opacity))];
    }
    target
}

/// To the nearest of `levels` steps of [0, 1].
fn fixed(levels: f64) -> impl Fn(f64) -> f64 {
    move |value| (value * levels).round() / levels
}

/// To the nearest number of `digits` binary digits.
fn floating(digits: i32) -> impl Fn(f64) -> f64 {
    move |value: f64| {
        if value == 0.0 {
            return 0.0;
        }
        let unit = (value.abs().log2().floor() as i32 - (digits - 1)).max(-24);
        (value / f64::from(unit).exp2()).round() * f64::from(unit).exp2()
    }
}

/// Error of light or transmittance, whichever is larger, after thousands of layers in a target.
fn error(opacity: f64, target: &str, rounded: impl Fn(f64) -> f64) -> f64 {
    let layers = 4096;
    let exact = -f64::exp_m1(layers as f64 * f64::ln_1p(-opacity));
    let [light, transmittance] = composited(layers, opacity, rounded);
    let error = (light - exact).abs().max((transmittance - (1.0 - exact)).abs());
    println!("{layers} layers of {opacity:e} in {target}: error {error:.2e} of {exact:.4}");
    error
}

#[test]
fn thin_layers_need_32_bits() {
    let step_of_a_screen = 1.0 / 255.0;
    for opacity in [1e-4, 1e-5] {
        let all = -f64::exp_m1(4096.0 * f64::ln_1p(-opacity));
        let in_8 = error(opacity, "8 bits", fixed(255.0));
        assert!((in_8 - all).abs() < 1e-12, "8 bits lose every layer, but found {in_8} of {all}");
        assert!(error(opacity, "half floats", floating(11)) > step_of_a_screen);
        at_most(
            "error in 32-bit floats",
            error(opacity, "32-bit floats", |value| f64::from(value as f32)),
            2e-5,
        );
    }
    assert!(error(1e-5, "16 bits", fixed(65535.0)) > step_of_a_screen);
}
