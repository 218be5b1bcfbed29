//! Cubes of constant colour and extinction, drawn from back to front (Schussman and Max 2001).
//!
//! # Method
//! A cube of extinction `s` lets `exp(-s l)` of the light behind it through, where `l` is the length of the ray
//! inside it, and adds `1 - exp(-s l)` of its colour (by `expm1`, so that thin matter is not lost). In a picture a
//! cube is the union of at most twelve triangles, in fans whose vertices know the length (crate `volery-cubefan`).
//!
//! # Places
//! A cube of level `l` and index `i` covers `[i 2^l - 1/2, (i + 1) 2^l - 1/2]` in finest-sample coordinates, clipped
//! to the domain `[0, cells]`. Twice that are whole numbers, the *lattice*, so that neighbours share the very same
//! planes: [`Cube::lattice_bounds`].

use crate::{Revision, VolumeLayout};

/// Cubes to see, and how. No brick is read.
#[derive(Clone, Copy, Debug)]
pub struct Cubes<'a> {
    /// Names the list of cubes: an executor may keep what it made of it for parts that give the same revision, which
    /// promise the same contents in the same order. `None` is never kept.
    pub revision: Option<Revision>,
    /// Back to front: no cube is hidden by one that comes before it. Cubes do not overlap.
    pub cubes: &'a [Cube],
    /// How the length of the ray in a cube is found.
    pub thickness: Thickness,
}

/// A cube of constant colour and extinction.
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Cube {
    /// Which cube of its level, along x, y, z.
    pub index: [u16; 3],
    /// 0 for a voxel.
    pub level: u16,
    /// Straight linear RGB.
    pub color: [f32; 3],
    /// Per world length, at least 0; infinite is opaque.
    pub extinction: f32,
}

/// How the length of the ray in a cube is found, per fragment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Thickness {
    /// The exact chord.
    #[default]
    Exact,
    /// Linear on the screen between the vertices of a triangle, as the paper has it: exact for parallel rays, too
    /// little or too much in perspective where a cube is large and near.
    Interpolated,
}

impl Thickness {
    /// Its name on the command line and in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Interpolated => "interpolated",
        }
    }
}

impl Cube {
    /// Lower and upper corner on the lattice: twice the finest-sample coordinates.
    #[inline]
    pub fn lattice_bounds(&self, layout: &VolumeLayout) -> [[i32; 3]; 2] {
        let size = 2_i64 << self.level.min(32);
        // Cells are below 2^31, so twice that fits in 33 bits; cubes that can be numbered by 16 bits end before.
        let clipped = |axis: usize, i: i64| (i * size - 1).clamp(0, 2 * i64::from(layout.cells[axis])) as i32;
        let low = std::array::from_fn(|axis| clipped(axis, i64::from(self.index[axis])));
        let high = std::array::from_fn(|axis| clipped(axis, i64::from(self.index[axis]) + 1));
        [low, high]
    }
}
