//! Opacity where samples stand farther apart than the transfer function counts them.
//!
//! # Method
//! A transfer function says what one sample hides; where one sample stands for `m` of them, it must hide what they
//! would. Boada, Navazo and Scopigno (section 4.1.1) correct it for the two kinds of nodes that their tree calls
//! homogeneous: (i) all samples are equal, (ii) inner samples interpolate the outer ones. Both come from compositing
//! the samples that are left out, and both are misprinted in the general form: `a0 - (1-a0)(1-a0)^n` is negative for
//! small `a0`, and the ramp lacks a factor `i`. Here they are as compositing has them,
//!
//! - (i) [`homogeneous`]: `1 - (1-a0)^m`,
//! - (ii) [`ramp`]: `1 - prod (1-a_i)`, `a_i = ((m-i) a0 + i am) / m`, over `i` from 0 to `m-1`;
//!
//! for `m = 2` they are the paper's equations (2) and (3), with `a1 = (a0 + a2) / 2` where it prints a minus. So the
//! sample at `a0` stands for itself and what lies between it and the next, which stands for itself.
//!
//! (ii) interpolates opacities and adds one sample per place: a sum of Riemann's, wrong by first order in the distance of
//! the finest samples. The [`integral`] interpolates *values*, as the field does, and integrates extinction exactly
//! between control points, where opacity is linear and the mean of `-ln(1 - a)` has a closed form.
//!
//! # Guarantees
//! - Within 1e-12 of what they say, relative as well for opacities down to 1e-300: nothing is subtracted from 1.
//! - Opacity 1 hides all, in any stretch that has a length; no stretch of no length hides anything.
//!
//! # Non-goals
//! Colour: [`Tracer`](crate::Tracer) has the light of a whole ray. These say what one step of a renderer should hide.

use volery_scene::TransferFunction;

/// The opacity of `num_samples` samples of one opacity, the paper's case (i); both in [0, 1].
pub fn homogeneous(opacity: f64, num_samples: u32) -> f64 {
    if num_samples == 0 {
        return 0.0;
    }
    0.0 - (f64::from(num_samples) * (-opacity).ln_1p()).exp_m1()
}

/// The opacity of `num_samples` samples whose opacities go evenly from `first` to just before `last`, the paper's
/// case (ii); all in [0, 1].
pub fn ramp(first: f64, last: f64, num_samples: u32) -> f64 {
    let log_of_clear = |sample: u32| {
        let share = f64::from(sample) / f64::from(num_samples);
        (-(first * (1.0 - share) + last * share)).ln_1p()
    };
    // Not the sum's own zero, which is negative.
    0.0 - (0..num_samples).map(log_of_clear).sum::<f64>().exp_m1()
}

/// The opacity of a stretch, `length` world units long, along which values go evenly from `first` to `last`.
///
/// Blank values, NaN or infinite, hide nothing.
pub fn integral(transfer: &TransferFunction, first: f64, last: f64, length: f64) -> f64 {
    if length <= 0.0 || !first.is_finite() || !last.is_finite() {
        return 0.0;
    }
    let mean = if first == last {
        mean_extinction([transfer.classify(first).1; 2])
    } else {
        mean_between(transfer, first.min(last), first.max(last))
    };
    let units = length / transfer.unit_distance();
    0.0 - (-mean * units).exp_m1()
}

/// The mean extinction per unit distance over all values between two that differ.
fn mean_between(transfer: &TransferFunction, low: f64, high: f64) -> f64 {
    let points = transfer.points();
    let [start, end] = [points[0], points[points.len() - 1]];
    let share = |from: f64, to: f64| (to.min(high) - from.max(low)).max(0.0) / (high - low);
    let part =
        |share: f64, opacities: [f64; 2]| if share > 0.0 { share * mean_extinction(opacities) } else { 0.0 };
    let before = part(share(low, start.value), [start.opacity; 2]);
    let after = part(share(end.value, high), [end.opacity; 2]);
    let between = points.windows(2).map(|pair| {
        let [a, b] = [pair[0], pair[1]];
        // Not through `classify`, which would take a value at a step to its upper side.
        let opacity = |value: f64| {
            let above = ((value - a.value) / (b.value - a.value)).clamp(0.0, 1.0);
            a.opacity * (1.0 - above) + b.opacity * above
        };
        let share = share(a.value, b.value);
        part(share, if share > 0.0 { [a.value.max(low), b.value.min(high)].map(opacity) } else { [0.0; 2] })
    });
    before + between.sum::<f64>() + after
}

/// The mean of `-ln(1 - a)` for `a` going evenly between two opacities.
fn mean_extinction([a, b]: [f64; 2]) -> f64 {
    let (low, high) = (a.min(b), a.max(b));
    if low == 1.0 {
        return f64::INFINITY;
    }
    // With c = 1 - a going from c0 to c0 (1 + x): the mean of -ln c is -ln c0 - g, g = (1 + x) ln(1 + x) / x - 1.
    let x = (low - high) / (1.0 - low);
    let g = if x > -0.125 {
        // The series of g, all of whose terms are negative; the next would be below 1e-19 of the first.
        let terms = (1..=20).rev().map(f64::from);
        terms.fold(0.0, |sum, k| x * (1.0 / (k * (k + 1.0)) - sum))
    } else if x > -1.0 {
        (1.0 + x) * x.ln_1p() / x - 1.0
    } else {
        -1.0
    };
    -(-low).ln_1p() - g
}
