//! Transfer functions by name, and one made from a histogram for a picture without any option.

mod auto;
mod colors;

pub(crate) use auto::threshold;
pub use colors::ColorMap;

use glam::DVec3;
use volery_scene::{ControlPoint, Samples, TransferFunction};

use crate::histogram::Histogram;

/// A transfer function by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preset {
    /// Opacity and colour from the histogram: dark violet for the bulk of matter to ivory for rare high values.
    Auto,
    /// Grey and opacity rise together over the range of values, whatever the histogram.
    Ramp,
    /// Values in Hounsfield units: bone alone.
    CtBone,
    /// Values in Hounsfield units: fat, muscle and vessels around bone.
    CtSoftTissue,
    /// Opacity from the histogram, in the colours of flesh and bone: MRI has no units.
    Mri,
    /// Opacity from the histogram, a colour map over the values of visible matter.
    Colors(ColorMap),
}

/// Colours of [`Preset::Auto`] from the bulk to the rare.
const AUTO_COLORS: [u32; 5] = [0x27356b, 0x8a3d5c, 0xd9704a, 0xf5c074, 0xfffbe6];
/// Colours of [`Preset::Mri`].
const FLESH_COLORS: [u32; 6] = [0x1c2a4a, 0x7a3b2e, 0xc4703f, 0xe8b77a, 0xf7e6c4, 0xffffff];

/// Value in Hounsfield units, straight RGB, opacity per [`unit_distance`].
type HounsfieldPoint = (f64, [f64; 3], f64);

const CT_BONE: [HounsfieldPoint; 5] = [
    (180.0, [0.55, 0.28, 0.18], 0.0),
    (300.0, [0.80, 0.58, 0.40], 0.10),
    (700.0, [0.96, 0.88, 0.75], 0.50),
    (1500.0, [1.0, 1.0, 0.97], 0.85),
    (3000.0, [1.0, 1.0, 1.0], 0.95),
];

const CT_SOFT_TISSUE: [HounsfieldPoint; 7] = [
    (-200.0, [0.55, 0.35, 0.20], 0.0),
    (-90.0, [0.95, 0.78, 0.45], 0.015),
    (-20.0, [0.85, 0.45, 0.30], 0.02),
    (60.0, [0.80, 0.30, 0.25], 0.04),
    (180.0, [0.95, 0.50, 0.40], 0.10),
    (400.0, [1.0, 0.93, 0.80], 0.20),
    (1500.0, [1.0, 1.0, 0.97], 0.60),
];

impl Preset {
    /// All of them.
    pub fn all() -> impl Iterator<Item = Self> {
        [Self::Auto, Self::Ramp, Self::CtBone, Self::CtSoftTissue, Self::Mri]
            .into_iter()
            .chain(ColorMap::ALL.map(Self::Colors))
    }

    /// Its name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Ramp => "ramp",
            Self::CtBone => "ct-bone",
            Self::CtSoftTissue => "ct-soft-tissue",
            Self::Mri => "mri",
            Self::Colors(map) => map.name(),
        }
    }

    /// The preset of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::all().find(|preset| preset.name() == name)
    }

    /// Whether it depends on the values that it is for.
    pub const fn is_automatic(self) -> bool {
        !matches!(self, Self::CtBone | Self::CtSoftTissue)
    }

    /// The transfer function for samples: over a range of values, or over those that are worth colours
    /// ([`Histogram::of_matter`]). `None` if every sample is blank, or the range too wide for an `f64`.
    ///
    /// # Panics
    /// Never: samples have a first channel.
    pub fn over(self, samples: &Samples, range: Option<[f64; 2]>, extent: DVec3) -> Option<TransferFunction> {
        let histogram = match range {
            Some(range) => Histogram::within(samples, 0, range),
            None => Histogram::of_matter(samples, 0),
        };
        Some(self.transfer(&histogram?, extent))
    }

    /// The transfer function for a volume with this histogram and extent in world units.
    ///
    /// # Panics
    /// When the histogram is not one that [`Histogram::of`] makes.
    pub fn transfer(self, histogram: &Histogram, extent: DVec3) -> TransferFunction {
        let unit = unit_distance(extent);
        let mut points = match self {
            Self::Auto => {
                let colors = colors::from_hex(&AUTO_COLORS);
                auto::points(histogram, extent, unit, |place| colors::interpolate(&colors, place.mixed))
            }
            Self::Mri => {
                let colors = colors::from_hex(&FLESH_COLORS);
                auto::points(histogram, extent, unit, |place| colors::interpolate(&colors, place.mixed))
            }
            Self::Colors(map) => {
                let stops = map.stops();
                auto::points(histogram, extent, unit, |place| colors::interpolate(&stops, place.linear))
            }
            Self::Ramp => {
                let [low, high] = histogram.range;
                vec![
                    ControlPoint { value: low, color: [0.0; 3], opacity: 0.0 },
                    ControlPoint { value: high, color: [1.0; 3], opacity: 0.15 },
                ]
            }
            Self::CtBone => hounsfield(&CT_BONE),
            Self::CtSoftTissue => hounsfield(&CT_SOFT_TISSUE),
        };
        if let Some(&last) = points.last().filter(|_| self.is_automatic() && histogram.counted[1].is_finite())
        {
            // Nothing of what is above stands for matter.
            let ceiling = histogram.counted[1].max(last.value).next_up();
            points.push(ControlPoint { value: ceiling, ..last });
            points.push(ControlPoint { value: ceiling, opacity: 0.0, ..last });
        }
        TransferFunction::new(points, unit)
            .expect("a preset has rising values, colours and opacities in [0, 1]")
    }
}

fn hounsfield(points: &[HounsfieldPoint]) -> Vec<ControlPoint> {
    points.iter().map(|&(value, color, opacity)| ControlPoint { value, color, opacity }).collect()
}

/// Grey from black to white over a range of values, opacity as well: how planes are shown where nobody says
/// otherwise.
///
/// # Panics
/// When the range is not of finite values, or falls.
pub fn gray([low, high]: [f64; 2], extent: DVec3) -> TransferFunction {
    let point = |value, level| ControlPoint { value, color: [level; 3], opacity: level };
    TransferFunction::new(vec![point(low, 0.0), point(high, 1.0)], unit_distance(extent))
        .expect("a range that rises, and levels in [0, 1]")
}

/// The world length that opacities of presets refer to: 1/128 of the longest edge of the domain, so that a
/// picture looks the same whatever the unit of length and the number of samples.
pub fn unit_distance(extent: DVec3) -> f64 {
    let longest = extent.max_element();
    let unit = longest / 128.0;
    if unit > 0.0 && unit.is_finite() { unit } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use volery_scene::VoxelGrid;

    #[test]
    fn names_are_unique_and_found_again() {
        for preset in Preset::all() {
            assert_eq!(Preset::from_name(preset.name()), Some(preset));
        }
        assert_eq!(Preset::from_name("no such preset"), None);
    }

    fn transfer_of(preset: Preset, grid: &VoxelGrid) -> TransferFunction {
        preset.transfer(&Histogram::of(grid, 0).unwrap(), grid.extent())
    }

    #[test]
    fn every_preset_is_valid_on_every_kind_of_data() {
        let spacing = DVec3::ONE;
        let grids = [
            volery_data::head([24, 30, 30], DVec3::splat(8.0)),
            volery_data::marschner_lobb(20),
            volery_data::uniform([4, 4, 4], spacing, 7.0),
            volery_data::noise([16, 16, 16], 1),
            volery_data::holes([16, 16, 16], 2, 0.5),
            volery_data::ramp([9, 9, 9], spacing, DVec3::splat(1e300), -1e300),
            volery_data::ramp([9, 9, 9], spacing, DVec3::splat(1e-310), 0.0),
            VoxelGrid::new([2, 1, 1], DVec3::ONE, vec![i32::MIN, i32::MAX]).unwrap(),
            VoxelGrid::new([1, 1, 1], DVec3::splat(f64::MIN_POSITIVE), vec![3u8]).unwrap(),
        ];
        for grid in &grids {
            for preset in Preset::all() {
                let transfer = transfer_of(preset, grid);
                assert!(!transfer.points().is_empty(), "{}", preset.name());
            }
        }
    }

    #[test]
    fn auto_clears_the_air_and_shows_the_rest() {
        let head = volery_data::head([48, 60, 60], DVec3::splat(3.5));
        let transfer = transfer_of(Preset::Auto, &head);
        assert!(transfer.is_transparent(-1000.0, -900.0), "air");
        let [brain, bone] = [38.0, 1000.0].map(|value| transfer.classify(value).1);
        assert!(brain > 0.0 && bone > 2.0 * brain, "brain {brain}, bone {bone}");
    }

    #[test]
    fn auto_looks_the_same_in_millimetres_and_metres() {
        let [millimetres, metres] = [3.5, 0.0035].map(|spacing| {
            transfer_of(Preset::Auto, &volery_data::head([24, 30, 30], DVec3::splat(spacing)))
        });
        assert!((millimetres.unit_distance() / metres.unit_distance() - 1000.0).abs() < 1e-9);
        for (a, b) in millimetres.points().iter().zip(metres.points()) {
            assert!((a.opacity - b.opacity).abs() < 1e-12);
        }
    }
}
