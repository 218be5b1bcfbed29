//! Interpolating colours in the spaces that ParaView's colour maps name.
//!
//! All colours in and out are sRGB in [0, 1], as files hold them and as pictures of VTK show them. *Lab* is
//! CIELAB over sRGB with white D65; what falls outside the gamut is scaled until its largest channel is 1
//! and then cut at 0, as VTK does. *Diverging* is Moreland's Msh, the polar form of Lab (Moreland 2009,
//! *Diverging Color Maps for Scientific Visualization*), with his unsaturated middle between two saturated
//! colours of different hue.

use std::f64::consts::PI;

pub(super) type Triple = [f64; 3];

/// White of illuminant D65, Y = 1.
const WHITE: Triple = [0.9505, 1.0, 1.089];

/// XYZ from linear sRGB, IEC 61966-2-1.
const XYZ_FROM_RGB: [Triple; 3] =
    [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]];

/// Linear sRGB from XYZ, IEC 61966-2-1.
const RGB_FROM_XYZ: [Triple; 3] =
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]];

/// The space in which the colours between two control points lie on a straight line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColorSpace {
    /// RGB as stored.
    Rgb,
    /// Hue, saturation, value; hue does not pass through red.
    Hsv,
    /// Hue, saturation, value; hue takes the shorter way round.
    HsvWrapped,
    /// CIELAB.
    Lab,
    /// Moreland's Msh, through an unsaturated middle.
    Diverging,
    /// No interpolation: an interval has the colour of its upper end.
    Step,
}

impl ColorSpace {
    /// The colour at `s` in [0, 1] of the way from `a` to `b`.
    pub(super) fn interpolate(self, a: Triple, b: Triple, s: f64) -> Triple {
        match self {
            Self::Rgb => mix(a, b, s),
            Self::Hsv => rgb_from_hsv(mix(hsv_from_rgb(a), hsv_from_rgb(b), s)),
            Self::HsvWrapped => {
                let [mut from, mut to] = [hsv_from_rgb(a), hsv_from_rgb(b)];
                if to[0] - from[0] > 0.5 {
                    to[0] -= 1.0;
                } else if from[0] - to[0] > 0.5 {
                    from[0] -= 1.0;
                }
                let [hue, saturation, value] = mix(from, to, s);
                rgb_from_hsv([hue.rem_euclid(1.0), saturation, value])
            }
            Self::Lab => rgb_from_lab(mix(lab_from_rgb(a), lab_from_rgb(b), s)),
            Self::Diverging => diverging(a, b, s),
            Self::Step => b,
        }
    }
}

fn mix(a: Triple, b: Triple, s: f64) -> Triple {
    std::array::from_fn(|i| a[i] + (b[i] - a[i]) * s)
}

fn multiply(matrix: &[Triple; 3], v: Triple) -> Triple {
    std::array::from_fn(|row| (0..3).map(|column| matrix[row][column] * v[column]).sum())
}

fn hsv_from_rgb([r, g, b]: Triple) -> Triple {
    let max = r.max(g).max(b);
    let range = max - r.min(g).min(b);
    if range <= 0.0 {
        return [0.0, 0.0, max];
    }
    let sixth = if max == r {
        (g - b) / range
    } else if max == g {
        2.0 + (b - r) / range
    } else {
        4.0 + (r - g) / range
    };
    [(sixth / 6.0).rem_euclid(1.0), range / max, max]
}

fn rgb_from_hsv([hue, saturation, value]: Triple) -> Triple {
    // Each channel is a trapezoid of the hue, shifted by a third of the circle.
    [0.0, 2.0 / 3.0, 1.0 / 3.0].map(|shift| {
        let distance = ((hue + shift).rem_euclid(1.0) * 6.0 - 3.0).abs();
        value * (1.0 - saturation * (1.0 - (distance - 1.0).clamp(0.0, 1.0)))
    })
}

fn lab_from_rgb(rgb: Triple) -> Triple {
    let linear = rgb.map(|c| if c > 0.04045 { ((c + 0.055) / 1.055).powf(2.4) } else { c / 12.92 });
    let xyz = multiply(&XYZ_FROM_RGB, linear);
    let f = |t: f64| if t > 0.008856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 };
    let [x, y, z] = std::array::from_fn(|i| f(xyz[i] / WHITE[i]));
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn rgb_from_lab([lightness, a, b]: Triple) -> Triple {
    let y = (lightness + 16.0) / 116.0;
    let inverse = |f: f64| if f.powi(3) > 0.008856 { f.powi(3) } else { (f - 16.0 / 116.0) / 7.787 };
    let f = [a / 500.0 + y, y, y - b / 200.0];
    let linear = multiply(&RGB_FROM_XYZ, std::array::from_fn(|i| inverse(f[i]) * WHITE[i]));
    let rgb = linear.map(|c| if c > 0.0031308 { 1.055 * c.powf(1.0 / 2.4) - 0.055 } else { 12.92 * c });
    let largest = rgb[0].max(rgb[1]).max(rgb[2]).max(1.0);
    rgb.map(|c| (c / largest).clamp(0.0, 1.0))
}

/// Below this saturation (an angle) a colour has no hue worth keeping.
const UNSATURATED: f64 = 0.05;

/// Magnitude, saturation, hue: the polar form of Lab.
fn msh_from_rgb(rgb: Triple) -> Triple {
    let [lightness, a, b] = lab_from_rgb(rgb);
    let magnitude = lightness.hypot(a).hypot(b);
    let saturation = if magnitude > 0.001 { (lightness / magnitude).clamp(-1.0, 1.0).acos() } else { 0.0 };
    let hue = if saturation > 0.001 { b.atan2(a) } else { 0.0 };
    [magnitude, saturation, hue]
}

fn rgb_from_msh([magnitude, saturation, hue]: Triple) -> Triple {
    let chroma = magnitude * saturation.sin();
    rgb_from_lab([magnitude * saturation.cos(), chroma * hue.cos(), chroma * hue.sin()])
}

/// The hue that an unsaturated colour of this magnitude takes beside a saturated one: turned so that the
/// perceived change along the way stays even.
fn hue_beside(saturated: Triple, magnitude: f64) -> f64 {
    let [m, s, hue] = saturated;
    if m >= magnitude - 0.1 {
        return hue;
    }
    let spin = s * (magnitude * magnitude - m * m).sqrt() / (m * s.sin());
    // Away from 0, except among the purples.
    if hue > -0.3 * PI { hue + spin } else { hue - spin }
}

fn diverging(a: Triple, b: Triple, mut s: f64) -> Triple {
    let [mut from, mut to] = [msh_from_rgb(a), msh_from_rgb(b)];
    let apart = (from[2] - to[2]).rem_euclid(2.0 * PI);
    let apart = apart.min(2.0 * PI - apart);
    if from[1] > UNSATURATED && to[1] > UNSATURATED && apart > PI / 3.0 {
        let middle = [from[0].max(to[0]).max(88.0), 0.0, 0.0];
        if s < 0.5 {
            to = middle;
            s *= 2.0;
        } else {
            from = middle;
            s = 2.0 * s - 1.0;
        }
    }
    if from[1] < UNSATURATED && to[1] > UNSATURATED {
        from[2] = hue_beside(to, from[0]);
    } else if to[1] < UNSATURATED && from[1] > UNSATURATED {
        to[2] = hue_beside(from, to[0]);
    }
    rgb_from_msh(mix(from, to, s))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_close(found: Triple, expected: Triple, tolerance: f64) {
        let error = (0..3).map(|i| (found[i] - expected[i]).abs()).fold(0.0, f64::max);
        assert!(error <= tolerance, "{found:?}, expected {expected:?} within {tolerance}, measured {error}");
    }

    #[test]
    fn lab_of_the_primaries_is_as_published() {
        // CIELAB of sRGB's corners under D65, Bruce Lindbloom's calculator to two decimals; the matrices
        // of the standard have four digits.
        let known = [
            ([1.0, 1.0, 1.0], [100.0, 0.0, 0.0]),
            ([1.0, 0.0, 0.0], [53.24, 80.09, 67.20]),
            ([0.0, 1.0, 0.0], [87.73, -86.18, 83.18]),
            ([0.0, 0.0, 1.0], [32.30, 79.19, -107.86]),
            ([0.5, 0.5, 0.5], [53.39, 0.0, 0.0]),
            ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
        ];
        for (rgb, lab) in known {
            assert_close(lab_from_rgb(rgb), lab, 0.03);
        }
    }

    #[test]
    fn every_space_returns_the_ends_and_stays_in_range() {
        let spaces = [
            ColorSpace::Rgb,
            ColorSpace::Hsv,
            ColorSpace::HsvWrapped,
            ColorSpace::Lab,
            ColorSpace::Diverging,
        ];
        let levels = [0.0, 0.02, 0.3, 0.77, 1.0];
        let colors: Vec<Triple> =
            (0..125).map(|i| [levels[i % 5], levels[i / 5 % 5], levels[i / 25]]).collect();
        for space in spaces {
            for &a in &colors {
                for &b in &colors {
                    // Four-digit matrices are inverse to each other to about 1e-3 of a channel.
                    assert_close(space.interpolate(a, b, 0.0), a, 2e-3);
                    assert_close(space.interpolate(a, b, 1.0), b, 2e-3);
                    let middle = space.interpolate(a, b, 0.4);
                    assert!(
                        middle.iter().all(|c| (0.0..=1.0).contains(c)),
                        "{space:?} {a:?} {b:?} {middle:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn moreland_cool_to_warm_is_as_published() {
        // The 33-entry table of the paper's "cool to warm", from (59,76,192) to (180,4,38), in 8 bits.
        let published = [
            (0, [59.0, 76.0, 192.0]),
            (4, [98.0, 130.0, 234.0]),
            (8, [141.0, 176.0, 254.0]),
            (12, [184.0, 208.0, 249.0]),
            (16, [221.0, 221.0, 221.0]),
            (20, [245.0, 196.0, 173.0]),
            (24, [244.0, 154.0, 123.0]),
            (28, [222.0, 96.0, 77.0]),
            (32, [180.0, 4.0, 38.0]),
        ];
        let [cool, warm] = [[59.0, 76.0, 192.0], [180.0, 4.0, 38.0]].map(|c: Triple| c.map(|v| v / 255.0));
        for (entry, expected) in published {
            let found = ColorSpace::Diverging.interpolate(cool, warm, f64::from(entry) / 32.0);
            assert_close(found.map(|c| c * 255.0), expected, 1.0);
        }
    }

    #[test]
    fn hue_takes_the_way_it_is_told() {
        let [red, magenta] = [[1.0, 0.0, 0.0], [1.0, 0.0, 1.0]];
        assert_close(ColorSpace::HsvWrapped.interpolate(red, magenta, 0.5), [1.0, 0.0, 0.5], 1e-12);
        // From hue 0 up to 5/6 through green and blue; half way is 5/12.
        assert_close(ColorSpace::Hsv.interpolate(red, magenta, 0.5), [0.0, 1.0, 0.5], 1e-12);
        assert_close(rgb_from_hsv([0.5, 0.5, 0.8]), [0.4, 0.8, 0.8], 1e-12);
    }
}
