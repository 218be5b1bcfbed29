//! VTK's legacy format with structured points, `.vtk`: what ITK, 3D Slicer and ImageJ write.

use std::path::Path;

use glam::DMat3;

use super::Decoded;
use super::image_data::{ImageArray, ImageData, ImagePiece};
use crate::bytes::load;
use crate::error::Problem;
use crate::grid::Place;
use crate::grid::legacy::{Legacy, POINTS_DATASET};
use crate::layout::ByteOrder;
use crate::volume::ReadOptions;

pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<Decoded, Problem> {
    let bytes = load(path)?;
    let legacy = Legacy::parse(&bytes, POINTS_DATASET)?;
    let lattice = &legacy.lattice;
    let dims = lattice.dims.ok_or_else(|| Problem::missing("DIMENSIONS", "three whole numbers"))?;
    // Each is below 2^63: their product could be addressed.
    let extent = [0, dims[0] as i64 - 1, 0, dims[1] as i64 - 1, 0, dims[2] as i64 - 1];
    let arrays = legacy.arrays_and_blocks().map(|(array, block)| ImageArray {
        on_cells: array.array.place == Place::Cells,
        name: Some(array.array.name.clone()),
        components: array.array.components as u64,
        scalar: Ok(block.scalar),
        is_active: array.is_active,
        order: ByteOrder::Big,
        open: Box::new(move |_| block.numbers()),
    });
    let piece = ImagePiece { extent, arrays: arrays.collect(), path: None };
    let image = ImageData {
        spacing: lattice.spacing,
        origin: lattice.origin,
        directions: DMat3::IDENTITY,
        pieces: vec![piece],
    };
    image.read(options)
}
