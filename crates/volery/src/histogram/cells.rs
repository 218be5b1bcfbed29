//! Values of cells by their volume: small cells are many where values change fast, and few see them.
//!
//! # Method
//! Places are spread evenly over the sum of the cells' volumes. Each takes the value of a node of its cell, one node
//! after the other, so that values stay those of the file, whole numbers too.

use glam::DVec3;
use volery_scene::{Samples, UnstructuredGrid, for_samples};

/// Places over a grid.
const NUM_PLACES: usize = 1 << 18;

/// Values at the nodes of cells that are not blank, each as often as its share of the volume; of cells without volume
/// each once.
pub(crate) fn by_volume(grid: &UnstructuredGrid, values: &Samples) -> Samples {
    let cells = || grid.cells().iter().enumerate().filter(|&(cell, _)| !grid.is_blank(cell));
    let volumes: Vec<f64> =
        cells().map(|(_, (cell_type, nodes))| volume(grid, cell_type.faces(), nodes)).collect();
    let whole: f64 = volumes.iter().sum();
    let has_volume = whole > 0.0 && whole.is_finite();
    let mut picked: Vec<usize> = Vec::with_capacity(NUM_PLACES);
    let mut sum = 0.0;
    for ((_, (_, nodes)), volume) in cells().zip(volumes) {
        sum += volume;
        let end = if has_volume {
            (sum / whole * NUM_PLACES as f64).round() as usize
        } else {
            picked.len() + nodes.len()
        };
        picked.extend((picked.len()..end).map(|place| nodes[place % nodes.len()] as usize));
    }
    for_samples!(values, |values| picked.iter().map(|&node| values[node]).collect::<Vec<_>>().into())
}

/// Volume of a cell, whichever way round it is, its faces split at their first nodes.
fn volume(grid: &UnstructuredGrid, faces: &[&[u8]], nodes: &[u32]) -> f64 {
    let point = |place: u8| grid.points()[nodes[usize::from(place)] as usize];
    let from = point(0);
    let of_face = |face: &&[u8]| {
        let corner = |at: usize| -> DVec3 { point(face[at]) - from };
        (1..face.len() - 1).map(|at| corner(0).dot(corner(at).cross(corner(at + 1)))).sum::<f64>()
    };
    let volume = faces.iter().map(of_face).sum::<f64>().abs() / 6.0;
    if volume.is_finite() { volume } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use volery_scene::{CellType, Cells};

    /// A tower of boxes of these heights, each of one value of its own but for its top.
    fn tower(heights: &[f64]) -> (UnstructuredGrid, Samples) {
        let (mut points, mut nodes, mut height) = (Vec::new(), Vec::new(), 0.0);
        for (floor, own) in (0_u32..).zip(heights) {
            for z in [height, height + own] {
                points.extend((0..4).map(|at| DVec3::new(f64::from(at & 1), f64::from(at >> 1), z)));
            }
            nodes.extend(8 * floor..8 * floor + 8);
            height += own;
        }
        let values: Vec<u16> = (0..points.len()).map(|node| (node / 8) as u16).collect();
        let cells = Cells::new(vec![CellType::Voxel; heights.len()], nodes).unwrap();
        (UnstructuredGrid::new(points, cells).unwrap(), values.into())
    }

    #[test]
    fn a_value_occurs_by_its_share_of_the_volume() {
        let heights = [1.0, 0.001, 10.0, 0.0, 5.0];
        let (grid, values) = tower(&heights);
        let samples = by_volume(&grid, &values);
        assert_eq!(samples.sample_type(), values.sample_type());
        assert_eq!(samples.len(), NUM_PLACES);
        let whole: f64 = heights.iter().sum();
        for (value, height) in heights.iter().enumerate() {
            let found = (0..samples.len()).filter(|&i| samples.value(i, 0) == value as f64).count();
            let expected = height / whole * NUM_PLACES as f64;
            assert!((found as f64 - expected).abs() <= 1.0, "{value}: {found} for {expected}");
        }
        let blank = grid.with_blank(vec![false, false, true, false, false]).unwrap();
        let samples = by_volume(&blank, &values);
        assert!((0..samples.len()).all(|i| samples.value(i, 0) != 2.0));
    }

    #[test]
    fn cells_without_volume_count_each_once() {
        let (grid, values) = tower(&[0.0, 0.0]);
        assert_eq!(by_volume(&grid, &values).len(), 16);
    }
}
