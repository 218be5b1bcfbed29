//! Volumes and cells by code: small grids with known formulas, for tests, demos and benchmarks.
//!
//! Every generator is a pure function of its arguments: the same bits on every machine with the same
//! `f64` mathematics library, no file, no clock, no random state. Where a closed form of the picture is
//! wanted ([`uniform`], [`ramp`], [`half_space`]) the samples are exact; where a picture shall look like
//! something ([`head`], [`tissue`], [`zone_plate`], [`marschner_lobb`]) they are smooth enough for it; where an algorithm shall be
//! broken ([`noise`], [`holes`]) they have no structure at all.
//!
//! # Non-goals
//! No real data and no files: see `volery-io`. Speed beyond "128^3 in a moment".

use std::f64::consts::PI;

use glam::DVec3;
use volery_scene::{Samples, VoxelGrid};

mod cells;
mod head;
mod tissue;
mod zone_plate;

pub use cells::{CYLINDER_RADIUS, cylinder, cylinder_at};
pub use head::{head, head_u8};
pub use tissue::tissue;
pub use zone_plate::zone_plate;

/// Frequency of the rings of [`marschner_lobb`], `f_M` in the paper.
const RING_FREQUENCY: f64 = 6.0;
/// Their amplitude, `α` in the paper.
const RING_AMPLITUDE: f64 = 0.25;

/// One value per grid point, x fastest, of its index along each axis.
pub fn fill<T>(dims: [usize; 3], mut value_at: impl FnMut([usize; 3]) -> T) -> Vec<T> {
    let [nx, ny, nz] = dims;
    let mut values = Vec::with_capacity(nx * ny * nz);
    for z in 0..nz {
        for y in 0..ny {
            values.extend((0..nx).map(|x| value_at([x, y, z])));
        }
    }
    values
}

fn grid(dims: [usize; 3], spacing: DVec3, samples: impl Into<Samples>) -> VoxelGrid {
    VoxelGrid::new(dims, spacing, samples).expect("a generator is asked for a grid that can be")
}

/// Where grid point `index` lies when the grid spans `[-1, 1]` on every axis; an axis of one sample is at 0.
fn centered(dims: [usize; 3], index: [usize; 3]) -> DVec3 {
    let at = |axis: usize| match dims[axis] {
        1 => 0.0,
        n => 2.0 * index[axis] as f64 / (n - 1) as f64 - 1.0,
    };
    DVec3::new(at(0), at(1), at(2))
}

fn world(spacing: DVec3, [x, y, z]: [usize; 3]) -> DVec3 {
    DVec3::new(x as f64, y as f64, z as f64) * spacing
}

/// The signal of Marschner and Lobb at a point of `[-1, 1]^3`, in [0, 1].
///
/// `ρ(x, y, z) = (1 - sin(πz/2) + α (1 + cos(2π f cos(π r/2)))) / (2 (1 + α))`, `r = √(x² + y²)`, `f = 6`,
/// `α = 1/4`. Source: S. R. Marschner, R. J. Lobb, "An evaluation of reconstruction filters for volume
/// rendering", IEEE Visualization 1994.
pub fn marschner_lobb_at(point: DVec3) -> f64 {
    let r = point.truncate().length();
    let rings = (2.0 * PI * RING_FREQUENCY * (PI * r / 2.0).cos()).cos();
    (1.0 - (PI * point.z / 2.0).sin() + RING_AMPLITUDE * (1.0 + rings)) / (2.0 * (1.0 + RING_AMPLITUDE))
}

/// The Marschner-Lobb signal ([`marschner_lobb_at`]) on `n` samples per axis, f32 in [0, 1], spacing 1.
/// The paper's own grid has 41 samples, just above the signal's Nyquist rate.
///
/// # Panics
/// When `n` is 0.
pub fn marschner_lobb(n: usize) -> VoxelGrid {
    let dims = [n; 3];
    grid(dims, DVec3::ONE, fill(dims, |index| marschner_lobb_at(centered(dims, index)) as f32))
}

/// [`marschner_lobb`] times 255, rounded to u8.
///
/// # Panics
/// When `n` is 0.
pub fn marschner_lobb_u8(n: usize) -> VoxelGrid {
    let dims = [n; 3];
    let value = |index| (255.0 * marschner_lobb_at(centered(dims, index))).round() as u8;
    grid(dims, DVec3::ONE, fill(dims, value))
}

/// The same value everywhere.
///
/// # Panics
/// When an axis of `dims` is 0 or `spacing` is not positive.
pub fn uniform(dims: [usize; 3], spacing: DVec3, value: f32) -> VoxelGrid {
    grid(dims, spacing, fill(dims, |_| value))
}

/// A linear field, `offset + gradient · p` at world position `p`, in f64: trilinear interpolation gives it
/// back everywhere but for rounding.
///
/// # Panics
/// When an axis of `dims` is 0 or `spacing` is not positive.
pub fn ramp(dims: [usize; 3], spacing: DVec3, gradient: DVec3, offset: f64) -> VoxelGrid {
    grid(dims, spacing, fill(dims, |index| offset + gradient.dot(world(spacing, index))))
}

/// A step: 255 at the samples with `normal · p >= distance`, 0 elsewhere, `p` in world units. Between two
/// unlike samples the field is a ramp one cell wide.
///
/// # Panics
/// When an axis of `dims` is 0 or `spacing` is not positive.
pub fn half_space(dims: [usize; 3], spacing: DVec3, normal: DVec3, distance: f64) -> VoxelGrid {
    let value = |index| if normal.dot(world(spacing, index)) >= distance { 255u8 } else { 0 };
    grid(dims, spacing, fill(dims, value))
}

/// 64 bits that depend on every bit of `key`: the finaliser of SplitMix64 (Steele, Lea, Flood, "Fast
/// splittable pseudorandom number generators", OOPSLA 2014).
pub fn hash(key: u64) -> u64 {
    let mut bits = key.wrapping_add(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

/// A number in [0, 1) for sample `number` of the noise called `seed`.
fn unit_random(seed: u64, number: u64) -> f64 {
    (hash(hash(seed) ^ number) >> 11) as f64 / (1u64 << 53) as f64
}

/// White noise: every sample an independent u8, spacing 1. The field with the most detail there can be.
///
/// # Panics
/// When an axis of `dims` is 0.
pub fn noise(dims: [usize; 3], seed: u64) -> VoxelGrid {
    let mut number = 0;
    let value = |_| {
        number += 1;
        (256.0 * unit_random(seed, number)) as u8
    };
    grid(dims, DVec3::ONE, fill(dims, value))
}

/// White noise in [0, 1), f32, spacing 1, in which about `share` of the samples are blank: NaN mostly, one in
/// four of them plus or minus infinity.
///
/// # Panics
/// When an axis of `dims` is 0.
pub fn holes(dims: [usize; 3], seed: u64, share: f64) -> VoxelGrid {
    let mut number = 0;
    let value = |_| {
        number += 1;
        if unit_random(!seed, number) < share {
            [f32::NAN, f32::NAN, f32::NAN, f32::NAN, f32::NAN, f32::NAN, f32::INFINITY, f32::NEG_INFINITY]
                [(hash(number) % 8) as usize]
        } else {
            unit_random(seed, number) as f32
        }
    };
    grid(dims, DVec3::ONE, fill(dims, value))
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

#[cfg(test)]
mod tests;
