//! Bricks: the samples of one octree node, as a backend holds them.

use glam::DVec3;

use crate::Revision;

/// The volume that bricks are cut from. Decimated pyramids only: the samples of level `l` lie at multiples
/// of `2^l` finest cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VolumeLayout {
    /// Names the volume, and the way its bricks are stored.
    pub revision: Revision,
    /// Finest cells along x, y, z: samples less one. Zero along an axis leaves nothing to integrate; a
    /// plane along it shows an image.
    pub cells: [u32; 3],
    /// World size of a finest cell.
    pub spacing: DVec3,
    /// Cells of a brick per axis, so that a full brick has `brick_cells + 1` samples per axis.
    pub brick_cells: u32,
    /// How texels are stored.
    pub texel: TexelType,
    /// `value = value_offset + value_scale * texel`, texels as integers for the integer types.
    pub value_scale: f64,
    /// See `value_scale`.
    pub value_offset: f64,
    /// Smallest and largest value of the volume.
    pub value_range: [f64; 2],
}

/// How a backend stores a texel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TexelType {
    /// 8 bits, unsigned.
    U8,
    /// 16 bits, unsigned.
    U16,
    /// 32 bits, float; NaN is blank: a cell with a blank corner holds no matter.
    F32,
    /// A colour and its opacity, straight, 8 bits each, 255 for 1: for cutting planes, as it has no extinction.
    /// `value_scale` and the like are not read.
    Rgba8,
}

impl TexelType {
    /// Bytes of a texel.
    pub const fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 => 2,
            Self::F32 | Self::Rgba8 => 4,
        }
    }
}

/// Texels of one brick, x fastest.
#[derive(Clone, Copy, Debug)]
pub enum Texels<'a> {
    /// 8 bits, unsigned.
    U8(&'a [u8]),
    /// 16 bits, unsigned.
    U16(&'a [u16]),
    /// 32 bits, float.
    F32(&'a [f32]),
    /// Red, green, blue, opacity.
    Rgba8(&'a [[u8; 4]]),
}

impl Texels<'_> {
    /// Their type.
    pub const fn texel_type(&self) -> TexelType {
        match self {
            Self::U8(_) => TexelType::U8,
            Self::U16(_) => TexelType::U16,
            Self::F32(_) => TexelType::F32,
            Self::Rgba8(_) => TexelType::Rgba8,
        }
    }

    /// How many.
    pub const fn len(&self) -> usize {
        match self {
            Self::U8(texels) => texels.len(),
            Self::U16(texels) => texels.len(),
            Self::F32(texels) => texels.len(),
            Self::Rgba8(texels) => texels.len(),
        }
    }

    /// Whether there is none.
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Names the content of a brick within one volume, for residency; the technique chooses the numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BrickId(pub u64);

/// Samples to make resident.
#[derive(Clone, Copy, Debug)]
pub struct Brick<'a> {
    /// Its name.
    pub id: BrickId,
    /// Samples along x, y, z; each from 1 to `brick_cells + 1`.
    pub samples: [u32; 3],
    /// `samples[0] * samples[1] * samples[2]` texels, x fastest.
    pub texels: Texels<'a>,
}

/// Where a resident brick stands in the picture's volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PlacedBrick {
    /// Which brick.
    pub id: BrickId,
    /// Finest cell at its lower corner; a multiple of `brick_cells << level`.
    pub first_cell: [u32; 3],
    /// Its samples are `1 << level` finest cells apart.
    pub level: u32,
}

/// A brick and how it joins coarser neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct JoinedBrick {
    /// Which brick, and where.
    pub placed: PlacedBrick,
    /// Its seams: the faces and edges whose samples take the values that the next coarser level has there, each by the
    /// direction `s` in which it lies, of -1, 0 and 1 along x, y, z: bit `(s.x + 1) + 3 (s.y + 1) + 9 (s.z + 1)`. An edge
    /// of a seam's face is one as well. What they change are samples at odd places: each becomes the mean of its
    /// neighbours at even ones, two along an edge, four across a face, where beyond the brick's last sample that one
    /// counts. 0 where there is none.
    pub seams: u32,
}

impl From<PlacedBrick> for JoinedBrick {
    /// Without seams.
    fn from(placed: PlacedBrick) -> Self {
        Self { placed, seams: 0 }
    }
}

impl PlacedBrick {
    /// Lower and upper corner in finest cells, clipped to the volume: the part of space that it draws.
    pub fn bounds(&self, layout: &VolumeLayout) -> [[u32; 3]; 2] {
        let size = layout.brick_cells << self.level;
        let end = std::array::from_fn(|axis| (self.first_cell[axis] + size).min(layout.cells[axis]));
        [self.first_cell, end]
    }
}
