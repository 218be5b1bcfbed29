//! The tree of cubes over voxels: means, and what they miss (Schussman and Max 2001, section 6).
//!
//! # Method
//! Each voxel is a cube of constant value around its sample, and eight cubes, or as many as there are, make one of
//! the next level. A cube's value is the mean of all its voxels; its error is the largest distance of a voxel from
//! that, `max(max - mean, mean - min)`, exact. (The paper takes the mean of the children's means, which at odd ends
//! of a volume is another number.)
//!
//! Values are kept as *texels*, `texel = (value - offset) / scale` in `f32`: exact for integers of up to 24 bits
//! where the scale is 1, and within 2^-24 of the range for others, given a scale that makes the range 1.
//!
//! Voxel `i` covers `[i - 1/2, i + 1/2]` in finest-sample coordinates, a cube of level `l` and index `i`
//! `[i 2^l - 1/2, (i + 1) 2^l - 1/2]`, both clipped to the domain.
//!
//! # Guarantees
//! The same bits whatever the number of threads. Level 0 is not copied: voxels are read from the grid's samples.
//!
//! # Why not `NodeStats`
//! Statistics of a [`Pyramid`](crate::Pyramid)'s nodes are of all samples that a node's trilinear field depends on,
//! which are more than those in the cube, and take 56 bytes; a cube takes 12.

use rayon::prelude::*;
use volery_scene::{Sample, VoxelGrid, for_samples};

/// What is known of a cube, in texels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cube {
    /// Mean of its voxels; NaN if some are blank.
    pub mean: f32,
    /// Smallest voxel; `+∞` if all are blank.
    pub min: f32,
    /// Largest voxel; `-∞` if all are blank.
    pub max: f32,
}

impl Cube {
    /// The cube of one voxel.
    #[inline]
    pub fn of_voxel(texel: f32) -> Self {
        if texel.is_finite() {
            Self { mean: texel, min: texel, max: texel }
        } else {
            Self { mean: f32::NAN, min: f32::INFINITY, max: f32::NEG_INFINITY }
        }
    }

    /// Largest distance of a voxel from the mean; infinite where some voxels are blank, 0 where all are.
    #[inline]
    pub fn error(&self) -> f32 {
        if self.min > self.max {
            0.0
        } else if self.mean.is_nan() {
            f32::INFINITY
        } else {
            (self.max - self.mean).max(self.mean - self.min)
        }
    }

    /// Whether no voxel has a value.
    #[inline]
    pub fn is_blank(&self) -> bool {
        self.min > self.max
    }
}

/// The cubes of every level above the voxels.
#[derive(Clone, Debug)]
pub struct CubeTree {
    /// Voxels along x, y, z.
    dims: [usize; 3],
    scale: f64,
    offset: f64,
    /// From level 1 on, x fastest; the last has one cube.
    levels: Vec<Vec<Cube>>,
}

impl CubeTree {
    /// Builds the tree over the first channel of a grid.
    ///
    /// # Panics
    /// When `scale` is zero or not a number.
    pub fn build(grid: &VoxelGrid, scale: f64, offset: f64) -> Self {
        assert!(scale != 0.0 && !scale.is_nan(), "scale {scale}, expected a number that can be divided by");
        let mut tree = Self { dims: grid.dims(), scale, offset, levels: Vec::new() };
        while tree.level_dims(tree.levels.len() as u32) != [1; 3] {
            let level = tree.levels.len() as u32 + 1;
            let cubes = match tree.levels.last() {
                None => for_samples!(grid.samples(), |values| tree
                    .coarsen(1, |place| { Cube::of_voxel(tree.texel(values[place].channel(0))) })),
                Some(finer) => tree.coarsen(level, |place| finer[place]),
            };
            tree.levels.push(cubes);
        }
        tree
    }

    /// The texel of a value.
    #[inline]
    pub fn texel(&self, value: f64) -> f32 {
        ((value - self.offset) / self.scale) as f32
    }

    /// How many levels there are, that of the voxels included; the coarsest has one cube.
    pub fn num_levels(&self) -> u32 {
        self.levels.len() as u32 + 1
    }

    /// Cubes of a level along x, y, z.
    #[inline]
    pub fn level_dims(&self, level: u32) -> [usize; 3] {
        self.dims.map(|n| ((n - 1) >> level) + 1)
    }

    /// The cubes of a level from 1 on, x fastest.
    ///
    /// # Panics
    /// When there is no such level.
    pub fn level(&self, level: u32) -> &[Cube] {
        &self.levels[level as usize - 1]
    }

    /// Bytes that the tree takes beside the samples of the grid.
    pub fn bytes(&self) -> usize {
        self.levels.iter().map(|level| size_of_val(level.as_slice())).sum()
    }

    fn coarsen(&self, level: u32, finer: impl Fn(usize) -> Cube + Sync) -> Vec<Cube> {
        let (from, to) = (self.level_dims(level - 1), self.level_dims(level));
        let mut cubes = vec![Cube::of_voxel(f32::NAN); to.iter().product()];
        // Voxels along an axis of child `i` of the finer level.
        let voxels = |axis: usize, i: usize| {
            let size = 1_usize << (level - 1);
            (self.dims[axis] - i * size).min(size) as f64
        };
        cubes.par_chunks_mut(to[0]).enumerate().for_each(|(row, out)| {
            let (y, z) = (row % to[1], row / to[1]);
            for (x, cube) in out.iter_mut().enumerate() {
                let (mut sum, mut count) = (0.0, 0.0);
                let (mut min, mut max) = (f32::INFINITY, f32::NEG_INFINITY);
                for k in 2 * z..(2 * z + 2).min(from[2]) {
                    for j in 2 * y..(2 * y + 2).min(from[1]) {
                        let weight = voxels(1, j) * voxels(2, k);
                        for i in 2 * x..(2 * x + 2).min(from[0]) {
                            let child = finer((k * from[1] + j) * from[0] + i);
                            let weight = weight * voxels(0, i);
                            sum += weight * f64::from(child.mean);
                            count += weight;
                            (min, max) = (min.min(child.min), max.max(child.max));
                        }
                    }
                }
                *cube = Cube { mean: (sum / count) as f32, min, max };
            }
        });
        cubes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use proptest::prelude::*;

    /// All voxels of a cube, straight from the samples.
    fn slow(dims: [usize; 3], values: &[f64], level: u32, index: [usize; 3]) -> (f64, f64, f64, bool) {
        let range = |axis: usize| index[axis] << level..((index[axis] + 1) << level).min(dims[axis]);
        let (mut sum, mut count, mut min, mut max, mut blank) =
            (0.0, 0.0, f64::INFINITY, f64::NEG_INFINITY, false);
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    let value = values[(z * dims[1] + y) * dims[0] + x];
                    blank |= !value.is_finite();
                    sum += value;
                    count += 1.0;
                    if value.is_finite() {
                        (min, max) = (min.min(value), max.max(value));
                    }
                }
            }
        }
        (sum / count, min, max, blank)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn cubes_are_the_means_and_extremes_of_their_voxels(
            dims in proptest::array::uniform3(1..9_usize),
            seed in any::<u64>(),
            blanks in 0..3_u64,
        ) {
            let mut state = seed | 1;
            let mut next = || { state ^= state << 13; state ^= state >> 7; state ^= state << 17; state };
            let values: Vec<f64> = (0..dims.iter().product::<usize>())
                .map(|_| if next() % 20 < blanks { f64::NAN } else { (next() % 1000) as f64 })
                .collect();
            let stored: Vec<f32> = values.iter().map(|&value| value as f32).collect();
            let tree = CubeTree::build(&VoxelGrid::new(dims, DVec3::ONE, stored).unwrap(), 1.0, 0.0);
            prop_assert_eq!(tree.level_dims(tree.num_levels() - 1), [1; 3]);
            for level in 1..tree.num_levels() {
                let [nx, ny, _] = tree.level_dims(level);
                for (place, cube) in tree.level(level).iter().enumerate() {
                    let (mean, min, max, blank) =
                        slow(dims, &values, level, [place % nx, place / nx % ny, place / nx / ny]);
                    prop_assert_eq!((f64::from(cube.min), f64::from(cube.max)), (min, max));
                    prop_assert_eq!(cube.mean.is_nan(), blank);
                    if blank {
                        prop_assert_eq!(cube.error(), if cube.is_blank() { 0.0 } else { f32::INFINITY });
                    } else {
                        prop_assert!((f64::from(cube.mean) - mean).abs() <= 3e-7 * mean.abs(), "{} {}", cube.mean, mean);
                        let error = (max - mean).max(mean - min);
                        prop_assert!((f64::from(cube.error()) - error).abs() <= 6e-7 * max.abs());
                    }
                }
            }
        }
    }
}
