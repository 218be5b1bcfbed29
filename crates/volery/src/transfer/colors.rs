//! Colour maps by the names that people expect.
//!
//! Viridis, inferno, plasma, magma (Smith, van der Walt 2015) and turbo (Mikhailov 2019) are stood for by
//! 13 evenly spaced colours, linear in between, fitted so that the largest difference from the original
//! table of 256 colours is smallest: at most 0.022 in any channel. Cool to warm is computed from its
//! definition (Moreland, "Diverging color maps for scientific visualization", 2009). Black body runs from
//! black through red and yellow to white, not along the colours of physical glow.

/// A colour map over [0, 1].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColorMap {
    /// Black to white.
    Grayscale,
    /// Dark violet over green to yellow; even in lightness.
    Viridis,
    /// Black over red to light yellow.
    Inferno,
    /// Blue over red to yellow.
    Plasma,
    /// Black over violet to light rose.
    Magma,
    /// A rainbow without its bands.
    Turbo,
    /// Blue over light grey to red: for values on two sides of a middle.
    CoolToWarm,
    /// Black, red, yellow, white.
    BlackBody,
}

const VIRIDIS: [u32; 13] = [
    0x440150, 0x48206d, 0x443a80, 0x395286, 0x2f6889, 0x277c89, 0x1f9088, 0x1fa482, 0x34b777, 0x5bc85e,
    0x8ed746, 0xc6e01b, 0xfee720,
];
const INFERNO: [u32; 13] = [
    0x000000, 0x0e0b2c, 0x300a5f, 0x540e6a, 0x751b6a, 0x972761, 0xb83551, 0xd54a3a, 0xed672a, 0xf68b05,
    0xffb314, 0xf1e056, 0xf9ffa0,
];
const PLASMA: [u32; 13] = [
    0x0f0787, 0x3c0398, 0x5c00a5, 0x7c02a7, 0x9b169d, 0xb42e89, 0xca4676, 0xdc5e63, 0xec7851, 0xf79343,
    0xfdb22c, 0xfad427, 0xeff824,
];
const MAGMA: [u32; 13] = [
    0x000005, 0x0e0c2b, 0x2b1162, 0x4f107e, 0x70217f, 0x912a81, 0xb43578, 0xd6436a, 0xf25f5b, 0xfa855e,
    0xfdad75, 0xfcd496, 0xfafbbd,
];
const TURBO: [u32; 13] = [
    0x341240, 0x3f4ebd, 0x4a85ff, 0x25bbf1, 0x16e6b2, 0x53fc79, 0xa5fe37, 0xd5e63a, 0xfebc39, 0xf8801d,
    0xe54405, 0xb72000, 0x7b0300,
];
const GRAYSCALE: [u32; 2] = [0x000000, 0xffffff];
const BLACK_BODY: [u32; 4] = [0x000000, 0xe60000, 0xe6e600, 0xffffff];

/// Colours that a map with a formula is sampled at.
const NUM_COMPUTED: usize = 17;

impl ColorMap {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Grayscale,
        Self::Viridis,
        Self::Inferno,
        Self::Plasma,
        Self::Magma,
        Self::Turbo,
        Self::CoolToWarm,
        Self::BlackBody,
    ];

    /// Its name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Grayscale => "grayscale",
            Self::Viridis => "viridis",
            Self::Inferno => "inferno",
            Self::Plasma => "plasma",
            Self::Magma => "magma",
            Self::Turbo => "turbo",
            Self::CoolToWarm => "cool-to-warm",
            Self::BlackBody => "black-body",
        }
    }

    /// Straight RGB of evenly spaced places of [0, 1], linear in between.
    pub fn stops(self) -> Vec<[f64; 3]> {
        let table: &[u32] = match self {
            Self::Grayscale => &GRAYSCALE,
            Self::Viridis => &VIRIDIS,
            Self::Inferno => &INFERNO,
            Self::Plasma => &PLASMA,
            Self::Magma => &MAGMA,
            Self::Turbo => &TURBO,
            Self::BlackBody => &BLACK_BODY,
            Self::CoolToWarm => {
                return (0..NUM_COMPUTED)
                    .map(|i| cool_to_warm(i as f64 / (NUM_COMPUTED - 1) as f64))
                    .collect();
            }
        };
        from_hex(table)
    }

    /// The colour at `t`, of the nearer end outside [0, 1].
    pub fn color(self, t: f64) -> [f64; 3] {
        interpolate(&self.stops(), t)
    }
}

/// `0xrrggbb` as RGB in [0, 1].
pub(super) fn from_hex(colors: &[u32]) -> Vec<[f64; 3]> {
    let channel = |color: u32, shift: u32| f64::from(color >> shift & 0xff) / 255.0;
    colors.iter().map(|&color| [16, 8, 0].map(|shift| channel(color, shift))).collect()
}

/// The colour at `t` of two or more evenly spaced stops over [0, 1].
pub(super) fn interpolate(stops: &[[f64; 3]], t: f64) -> [f64; 3] {
    let at = t.clamp(0.0, 1.0) * (stops.len() - 1) as f64;
    let first = (at as usize).min(stops.len() - 2);
    let w = at - first as f64;
    std::array::from_fn(|i| stops[first][i] * (1.0 - w) + stops[first + 1][i] * w)
}

/// Moreland's two ends in 8 bits.
const COOL: [u8; 3] = [59, 76, 192];
const WARM: [u8; 3] = [180, 4, 38];
/// Lightness of the middle, a grey as light as Moreland asks for.
const MIDDLE_LIGHTNESS: f64 = 88.0;

/// Moreland's diverging map: straight lines in the polar form of CIELAB, hue turned away where the
/// saturation vanishes.
fn cool_to_warm(t: f64) -> [f64; 3] {
    let end = msh_from_lab(lab_from_srgb(if t < 0.5 { COOL } else { WARM }.map(|c| f64::from(c) / 255.0)));
    let w = (2.0 * t - 1.0).abs();
    let magnitude = MIDDLE_LIGHTNESS + (end[0] - MIDDLE_LIGHTNESS) * w;
    let saturation = end[1] * w;
    let hue_of_middle = unsaturated_hue(end, MIDDLE_LIGHTNESS);
    let hue = hue_of_middle + (end[2] - hue_of_middle) * w;
    srgb_from_lab([
        magnitude * saturation.cos(),
        magnitude * saturation.sin() * hue.cos(),
        magnitude * saturation.sin() * hue.sin(),
    ])
}

fn unsaturated_hue([m, s, h]: [f64; 3], middle: f64) -> f64 {
    if m >= middle {
        return h;
    }
    let spin = s * (middle * middle - m * m).sqrt() / (m * s.sin());
    if h > -std::f64::consts::FRAC_PI_3 { h + spin } else { h - spin }
}

fn msh_from_lab([l, a, b]: [f64; 3]) -> [f64; 3] {
    let m = (l * l + a * a + b * b).sqrt();
    [m, (l / m).acos(), b.atan2(a)]
}

/// CIE XYZ of sRGB's primaries and of D65 white (IEC 61966-2-1).
const XYZ_FROM_RGB: [[f64; 3]; 3] =
    [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]];
const RGB_FROM_XYZ: [[f64; 3]; 3] =
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]];
const WHITE: [f64; 3] = [0.9505, 1.0, 1.0890];

fn transform(matrix: [[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    matrix.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn lab_from_srgb(rgb: [f64; 3]) -> [f64; 3] {
    let linear = rgb.map(|c| if c > 0.04045 { ((c + 0.055) / 1.055).powf(2.4) } else { c / 12.92 });
    let xyz = transform(XYZ_FROM_RGB, linear);
    let f = |i: usize| {
        let t: f64 = xyz[i] / WHITE[i];
        if t > 0.008856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 }
    };
    [116.0 * f(1) - 16.0, 500.0 * (f(0) - f(1)), 200.0 * (f(1) - f(2))]
}

fn srgb_from_lab([l, a, b]: [f64; 3]) -> [f64; 3] {
    let fy = (l + 16.0) / 116.0;
    let inverse = |f: f64| if f > 0.206_893 { f * f * f } else { (f - 16.0 / 116.0) / 7.787 };
    let xyz = [inverse(fy + a / 500.0) * WHITE[0], inverse(fy), inverse(fy - b / 200.0) * WHITE[2]];
    transform(RGB_FROM_XYZ, xyz).map(|c| {
        let c = if c > 0.003_130_8 { 1.055 * c.powf(1.0 / 2.4) - 0.055 } else { 12.92 * c };
        c.clamp(0.0, 1.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_valid_and_meet_their_ends() {
        for map in ColorMap::ALL {
            let stops = map.stops();
            assert!(stops.iter().flatten().all(|c| (0.0..=1.0).contains(c)), "{}", map.name());
            assert_eq!(map.color(-1.0), stops[0]);
            assert_eq!(map.color(2.0), stops[stops.len() - 1]);
        }
        assert_eq!(ColorMap::Grayscale.color(0.25), [0.25; 3]);
    }

    #[test]
    fn cool_to_warm_has_the_published_colours() {
        // Moreland's table of the map in 8 bits: both ends and the middle.
        let near = |t: f64, rgb: [u8; 3]| {
            let found = ColorMap::CoolToWarm.color(t);
            let worst = (0..3).map(|i| (found[i] - f64::from(rgb[i]) / 255.0).abs()).fold(0.0, f64::max);
            assert!(worst < 0.006, "at {t}: {found:?} against {rgb:?}");
        };
        near(0.0, [59, 76, 192]);
        near(0.5, [221, 221, 221]);
        near(1.0, [180, 4, 38]);
        near(0.25, [141, 176, 254]);
        near(0.75, [244, 154, 123]);
    }

    #[test]
    fn viridis_gets_lighter_all_the_way() {
        let lightness: Vec<f64> =
            (0..=24).map(|i| lab_from_srgb(ColorMap::Viridis.color(f64::from(i) / 24.0))[0]).collect();
        assert!(lightness.is_sorted(), "{lightness:?}");
    }
}
