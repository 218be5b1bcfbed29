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
#[inline(always)]
pub(crate) fn opacity_of_depth<S: Simd>(simd: S, depth: f32x16<S>) -> f32x16<S> {
    let (scale, p) = exponential(simd, depth);
    // (1 - 2^n) - 2^n p
    (1.0 - scale) - scale * p
}

/// `exp(-depth)` for `depth >= 0`, with relative error below 3e-7 down to 2^-126, which is the least.
#[inline(always)]
pub(crate) fn clear_of_depth<S: Simd>(simd: S, depth: f32x16<S>) -> f32x16<S> {
    let (scale, p) = exponential(simd, depth);
    scale.mul_add(p, scale)
}

/// `exp(-depth) = 2^n (1 + p(r))` as `(2^n, p)`, with `n` the nearest whole number to `-depth log2(e)`; near zero `n`
/// is 0 and `p` a polynomial without a constant term.
#[inline(always)]
fn exponential<S: Simd>(simd: S, depth: f32x16<S>) -> (f32x16<S>, f32x16<S>) {
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
    (((exponent + 127) << 23).bitcast(), p)
}

/// How far the light of a piece of ray is from that of its mean colour, as a share of the change of colour
/// along it: `1/2 - 1/depth + 1/(exp(depth) - 1)`, the distance from the middle of the piece to the centre of
/// what is seen of it. Within 0.002 up to a depth of 3; beyond, where a piece is opaque, too small by up to 0.2. As
/// numerator and denominator, for a caller who has more to divide by.
#[inline(always)]
pub(crate) fn front_weight<S: Simd>(simd: S, depth: f32x16<S>) -> [f32x16<S>; 2] {
    let depth = depth.min(f32x16::splat(simd, 8.0));
    [depth, (depth * depth).mul_add(f32x16::splat(simd, 0.2), f32x16::splat(simd, 12.0))]
}

/// `-ln(1 - opacity)` from the opacity and from `clearness = 1 - opacity` above 0, both in [0, 1]; relative error below
/// 4e-7 where each of the two is that exact.
///
/// `-ln m = 2 artanh((1 - m) / (1 + m))` for `m` in [1/2, 1]: the clearness itself, or its digits.
#[inline(always)]
pub(crate) fn clear_log<S: Simd>(simd: S, opacity: f32x16<S>, clearness: f32x16<S>) -> f32x16<S> {
    let is_clear = opacity.simd_le(f32x16::splat(simd, 0.5));
    let bits: i32x16<S> = clearness.bitcast();
    let exponent = (bits >> 23) - 126;
    let digits: f32x16<S> = ((bits & 0x007f_ffff) | (126 << 23)).bitcast();
    let missing = is_clear.select(opacity, 1.0 - digits);
    let exponent: f32x16<S> = exponent.to_float();
    let halvings = is_clear.select(f32x16::splat(simd, 0.0), exponent);
    let z = missing / (2.0 - missing);
    let square = z * z;
    let mut series = f32x16::splat(simd, 2.0 / 11.0);
    for term in [2.0 / 9.0, 2.0 / 7.0, 2.0 / 5.0, 2.0 / 3.0, 2.0] {
        series = series.mul_add(square, f32x16::splat(simd, term));
    }
    series * z - halvings * std::f32::consts::LN_2
}

/// Four columns of sixteen rows.
#[inline(always)]
pub(crate) fn transpose<S: Simd>(simd: S, rows: &[f32; 64]) -> [f32x16<S>; 4] {
    let [q0, q1, q2, q3] = four(
        #[inline(always)]
        |i| f32x16::from_slice(simd, &rows[16 * i..16 * i + 16]),
    );
    let (even01, odd01) = (q0.unzip_low(q1), q0.unzip_high(q1));
    let (even23, odd23) = (q2.unzip_low(q3), q2.unzip_high(q3));
    [even01.unzip_low(even23), odd01.unzip_low(odd23), even01.unzip_high(even23), odd01.unzip_high(odd23)]
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
                let [weight, divisor] = front_weight(simd, f32x16::splat(simd, depth as f32));
                (weight / divisor).into()
            });
            worst = worst.max((f64::from(found[0]) - exact).abs());
        }
        println!("error {worst:.2e}, threshold 2e-3");
        assert!(worst < 2e-3);
    }
}
