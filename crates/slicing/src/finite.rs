//! Cells whose values are no numbers.

use rayon::prelude::*;
use volery_scene::{Sample, Samples, UnstructuredGrid, for_samples};

/// For every cell whether it holds no matter as far as these values go: blank cells of the grid, and those around a
/// node whose value is NaN or infinite.
///
/// A slicer cuts what is not blank and knows no values, and a mesh interpolates whatever they are. So of an array
/// with holes slice the grid with these flags ([`UnstructuredGrid::with_blank`]), and for another time step with
/// other holes slice it anew.
///
/// # Panics
/// When there are fewer values than the grid has nodes.
pub fn blank_where_not_finite(grid: &UnstructuredGrid, values: &Samples) -> Vec<bool> {
    fn flags<T: Sample>(grid: &UnstructuredGrid, values: &[T]) -> Vec<bool> {
        let is_blank = |cell: usize| {
            let (_, nodes) = grid.cells().get(cell);
            grid.is_blank(cell) || nodes.iter().any(|&node| !values[node as usize].channel(0).is_finite())
        };
        (0..grid.cells().len()).into_par_iter().map(is_blank).collect()
    }
    for_samples!(values, |values| flags(grid, values))
}
