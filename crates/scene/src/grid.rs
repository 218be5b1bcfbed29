//! A voxel grid: samples at integer coordinates times spacing, trilinear in between.

use std::fmt;

use glam::{DAffine3, DVec3};

use crate::placement::{Placement, Sheared};
use crate::samples::{SampleType, Samples};

/// A regular grid of samples of any size and type.
#[derive(Clone, Debug)]
pub struct VoxelGrid {
    dims: [usize; 3],
    spacing: DVec3,
    world_from_index: DAffine3,
    samples: Samples,
}

/// Axes of length 1 that span less are taken to lie in a plane.
const MIN_ORIENTATION_VOLUME: f64 = 1e-9;

/// What is taken for rounding of the length of an axis, as a share of it.
const MAX_ROUNDING: f64 = 1e-5;

/// One thing that is wrong with a grid.
#[derive(Clone, Debug, PartialEq)]
pub enum Defect {
    /// An axis without samples.
    EmptyAxis {
        /// 0, 1, 2 for x, y, z.
        axis: usize,
    },
    /// The product of the dims does not fit in memory's address range.
    TooManySamples {
        /// The dims as given.
        dims: [usize; 3],
    },
    /// The number of samples is not the product of the dims.
    SampleCount {
        /// Samples given.
        found: usize,
        /// The product of the dims.
        expected: usize,
    },
    /// A spacing that is not positive and finite.
    Spacing {
        /// 0, 1, 2 for x, y, z.
        axis: usize,
        /// The spacing as given.
        found: f64,
    },
    /// An orientation that is not finite, or that maps space to a plane, a line or a point.
    Orientation,
}

impl fmt::Display for Defect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::EmptyAxis { axis } => write!(f, "axis {axis} has 0 samples, expected at least 1"),
            Self::TooManySamples { dims: [x, y, z] } => {
                write!(f, "{x} x {y} x {z} samples, more than can be addressed")
            }
            Self::SampleCount { found, expected } => write!(f, "{found} samples, expected {expected}"),
            Self::Spacing { axis, found } => {
                write!(f, "spacing {found} along axis {axis}, expected a positive finite number")
            }
            Self::Orientation => {
                write!(f, "an orientation that cannot be turned back, expected three finite independent axes")
            }
        }
    }
}

/// Why a [`VoxelGrid`] could not be made: everything that is wrong with it, at least one defect.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("voxel grid: {}", .defects.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))]
pub struct Error {
    /// All defects found.
    pub defects: Vec<Defect>,
}

/// Lists what would be wrong with a grid of this shape.
pub fn defects(dims: [usize; 3], spacing: DVec3, num_samples: usize) -> Vec<Defect> {
    let mut defects = Vec::new();
    defects.extend((0..3).filter(|&axis| dims[axis] == 0).map(|axis| Defect::EmptyAxis { axis }));
    match dims[0].checked_mul(dims[1]).and_then(|plane| plane.checked_mul(dims[2])) {
        None => defects.push(Defect::TooManySamples { dims }),
        Some(expected) if expected != num_samples => {
            defects.push(Defect::SampleCount { found: num_samples, expected });
        }
        Some(_) => {}
    }
    for axis in 0..3 {
        let found = spacing[axis];
        if !(found > 0.0 && found.is_finite()) {
            defects.push(Defect::Spacing { axis, found });
        }
    }
    defects
}

impl VoxelGrid {
    /// A grid of `dims` samples (x, y, z; x fastest in memory), `spacing` apart in world units.
    ///
    /// # Errors
    /// When dims, spacing and samples do not make a grid; the error lists every defect.
    pub fn new(dims: [usize; 3], spacing: DVec3, samples: impl Into<Samples>) -> Result<Self, Error> {
        let samples = samples.into();
        let defects = defects(dims, spacing, samples.len());
        if !defects.is_empty() {
            return Err(Error { defects });
        }
        Ok(Self { dims, spacing, world_from_index: DAffine3::from_scale(spacing), samples })
    }

    /// The same samples, with the place and orientation that their file gives them. Their space does not change:
    /// see [`VoxelGrid::in_world`].
    ///
    /// # Errors
    /// When the map is not finite or cannot be turned back.
    pub fn with_world_from_index(self, world_from_index: DAffine3) -> Result<Self, Error> {
        let [x, y, z] = world_from_index.matrix3.to_cols_array_2d().map(DVec3::from_array);
        // Against the lengths, so that small voxels are as good as large ones.
        let volume = x.normalize_or_zero().cross(y.normalize_or_zero()).dot(z.normalize_or_zero());
        if !world_from_index.is_finite() || volume.abs() < MIN_ORIENTATION_VOLUME {
            return Err(Error { defects: vec![Defect::Orientation] });
        }
        Ok(Self { world_from_index, ..self })
    }

    /// The same samples as far apart as their orientation says, and where that lies in the world.
    ///
    /// # Errors
    /// When the axes of the samples are not at right angles.
    pub fn in_world(self) -> Result<(Self, Placement), Sheared> {
        let placement = Placement::of(&self.world_from_index)?;
        let mut spacing = self.spacing;
        for axis in 0..3 {
            let length = self.world_from_index.matrix3.col(axis).length();
            // What 32 bits do to a direction does not count.
            if (length - spacing[axis]).abs() > MAX_ROUNDING * length {
                spacing[axis] = length;
            }
        }
        Ok((Self { spacing, ..self }, placement))
    }

    /// Samples along x, y, z; each at least 1.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// World distance of neighbouring samples along x, y, z.
    pub fn spacing(&self) -> DVec3 {
        self.spacing
    }

    /// From the index of a sample to its place in the world of its file; index times spacing where the file
    /// says nothing. The lengths of its axes are those of the file, which the spacing may differ from.
    pub fn world_from_index(&self) -> DAffine3 {
        self.world_from_index
    }

    /// The samples, x fastest.
    pub fn samples(&self) -> &Samples {
        &self.samples
    }

    /// The type of a sample.
    pub fn sample_type(&self) -> SampleType {
        self.samples.sample_type()
    }

    /// Number of samples.
    pub fn num_samples(&self) -> usize {
        self.samples.len()
    }

    /// World position of the last sample; the domain is `[0, extent]`.
    pub fn extent(&self) -> DVec3 {
        DVec3::from_array(self.dims.map(|n| (n - 1) as f64)) * self.spacing
    }

    /// Index of sample `(x, y, z)` in the flat array.
    #[inline]
    pub fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.dims[1] + y) * self.dims[0] + x
    }

    /// Smallest and largest finite value of a channel; `None` if every sample is blank.
    ///
    /// # Panics
    /// When the grid has no such channel.
    pub fn value_range(&self, channel: usize) -> Option<[f64; 2]> {
        assert!(channel < self.sample_type().channels(), "channel {channel} of {}", self.sample_type());
        self.samples.range(channel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_defect_is_listed() {
        let error = VoxelGrid::new([0, 2, 3], DVec3::new(1.0, f64::NAN, -1.0), vec![1u8]).unwrap_err();
        assert_eq!(error.defects.len(), 4, "{error}");
        assert_eq!(error.defects[0], Defect::EmptyAxis { axis: 0 });
        assert_eq!(error.defects[1], Defect::SampleCount { found: 1, expected: 0 });
        assert!(matches!(error.defects[2], Defect::Spacing { axis: 1, .. }));
        assert_eq!(error.defects[3], Defect::Spacing { axis: 2, found: -1.0 });
    }

    #[test]
    fn dims_that_overflow_are_a_defect() {
        let huge = usize::MAX / 2;
        let error = VoxelGrid::new([huge, 3, 1], DVec3::ONE, Vec::<f32>::new()).unwrap_err();
        assert_eq!(error.defects, [Defect::TooManySamples { dims: [huge, 3, 1] }]);
    }

    #[test]
    fn orientation_is_carried_and_must_be_invertible() {
        let grid = VoxelGrid::new([2, 1, 1], DVec3::new(2.0, 3.0, 4.0), vec![1u8, 2]).unwrap();
        assert_eq!(grid.world_from_index().transform_point3(DVec3::ONE), DVec3::new(2.0, 3.0, 4.0));
        let mirror = DAffine3::from_translation(DVec3::X) * DAffine3::from_scale(DVec3::new(-1e-9, 3.0, 4.0));
        let grid = grid.with_world_from_index(mirror).unwrap();
        assert_eq!((grid.world_from_index(), grid.spacing().x), (mirror, 2.0));
        for bad in [DVec3::new(1.0, 0.0, 1.0), DVec3::new(1.0, f64::NAN, 1.0)] {
            let error = grid.clone().with_world_from_index(DAffine3::from_scale(bad)).unwrap_err();
            assert_eq!(error.defects, [Defect::Orientation]);
        }
    }

    #[test]
    fn range_ignores_blank_samples() {
        let values = vec![f32::NAN, -2.0, f32::INFINITY, 5.0];
        let grid = VoxelGrid::new([2, 2, 1], DVec3::ONE, values).unwrap();
        assert_eq!(grid.value_range(0), Some([-2.0, 5.0]));
        let blank = VoxelGrid::new([1, 1, 1], DVec3::ONE, vec![f64::NAN]).unwrap();
        assert_eq!(blank.value_range(0), None);
    }
}
