//! The exponential of a packet, and loops that are inlined for certain.

use fearless_simd::{f32x16, i32x16, prelude::*};

/// `f` of 0, 1, 2. `array::map` is not inlined for certain, and SIMD code that is not inlined goes through memory.
#[inline(always)]
pub(crate) fn axes<T>(f: impl Fn(usize) -> T) -> [T; 3] {
    [f(0), f(1), f(2)]
}

/// `f` of 0, 1, 2, 3; see [`axes`].
#[inline(always)]
pub(crate) fn four<T>(f: impl Fn(usize) -> T) -> [T; 4] {
    [f(0), f(1), f(2), f(3)]
}

/// `1 - exp(-depth)` for `depth >= 0`, without loss of digits near zero; relative error below 3e-7.
///
/// `exp(-depth) = 2^n (1 + p(r))` with `n` the nearest whole number to `-depth log2(e)`; near zero `n` is 0 and
/// the result is `-p(r)`, a polynomial without a constant term.
#[inline(always)]
pub(crate) fn opacity_of_depth<S: Simd>(simd: S, depth: f32x16<S>) -> f32x16<S> {
    let y = (depth * -std::f32::consts::LOG2_E).max(f32x16::splat(simd, -126.0));
    let n = y.round_ties_even();
    let r = y - n;
    // 2^r - 1 on [-1/2, 1/2]: the Taylor series in r ln 2.
    let mut p = f32x16::splat(simd, 1.525_273_4e-5);
    for c in [1.540_353e-4, 1.333_355_8e-3, 9.618_129e-3, 5.550_411e-2, 2.402_265e-1, std::f32::consts::LN_2]
    {
        p = p.mul_add(r, f32x16::splat(simd, c));
    }
    p *= r;
    let exponent: i32x16<S> = n.to_int();
    let scale: f32x16<S> = ((exponent + 127) << 23).bitcast();
    // (1 - 2^n) - 2^n p
    (1.0 - scale) - scale * p
}

/// How far the light of a piece of ray is from that of its mean colour, as a share of the change of colour
/// along it: `1/2 - 1/depth + 1/(exp(depth) - 1)`, the distance from the middle of the piece to the centre of
/// what is seen of it. Within 0.002 up to a depth of 3; beyond, where a piece is opaque, too small by up to 0.2.
#[inline(always)]
pub(crate) fn front_weight<S: Simd>(simd: S, depth: f32x16<S>) -> f32x16<S> {
    let depth = depth.min(f32x16::splat(simd, 8.0));
    depth / (depth * depth).mul_add(f32x16::splat(simd, 0.2), f32x16::splat(simd, 12.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use fearless_simd::{Level, dispatch};

    #[test]
    fn opacity_is_accurate_from_1e_30_to_1e30() {
        for level in [Level::new(), Level::baseline()] {
            let mut worst = 0.0_f64;
            let mut depth = 1e-30_f32;
            while depth < 1e30 {
                let all = dispatch!(level, simd => {
                    let result: [f32; 16] = opacity_of_depth(simd, f32x16::splat(simd, depth)).into();
                    result
                });
                let exact = -(-f64::from(depth)).exp_m1();
                worst = worst.max((f64::from(all[3]) / exact - 1.0).abs());
                depth *= 1.01;
            }
            println!("relative error {worst:.2e}, threshold 3e-7");
            assert!(worst < 3e-7);
        }
        let zero: [f32; 16] =
            dispatch!(Level::new(), simd => opacity_of_depth(simd, f32x16::splat(simd, 0.0)).into());
        assert_eq!(zero, [0.0; 16]);
    }

    #[test]
    fn front_weight_is_the_centre_of_what_is_seen() {
        let mut worst = 0.0_f64;
        for i in 1..=300 {
            let depth = f64::from(i) / 100.0;
            let exact = 0.5 - 1.0 / depth + 1.0 / depth.exp_m1();
            let found: [f32; 16] = dispatch!(Level::new(), simd => {
                front_weight(simd, f32x16::splat(simd, depth as f32)).into()
            });
            worst = worst.max((f64::from(found[0]) - exact).abs());
        }
        println!("error {worst:.2e}, threshold 2e-3");
        assert!(worst < 2e-3);
    }
}
