//! Stacks of slices through a few cubes.

use glam::DVec3;
use volery_scene::{CellType, Cells, Samples, UnstructuredGrid};
use volery_slicing::{CompactMesh, Planes, Slicer, node_gradients};

/// Slices through `side`^3 voxels, with gradients if wanted.
pub(crate) fn stack(side: u32, num_planes: usize, has_gradients: bool) -> CompactMesh {
    let nodes = side + 1;
    let at =
        |n: u32| DVec3::new(f64::from(n % nodes), f64::from(n / nodes % nodes), f64::from(n / nodes / nodes));
    let points: Vec<DVec3> =
        (0..nodes.pow(3)).map(|n| DVec3::new(0.1, 7.0, 1.0) * at(n) + DVec3::X).collect();
    let voxel = |n: u32| {
        let first = (n / side / side * nodes + n / side % side) * nodes + n % side;
        (0..8).map(move |corner| {
            first + (corner & 1) + (corner >> 1 & 1) * nodes + (corner >> 2) * nodes * nodes
        })
    };
    let cells =
        Cells::new(vec![CellType::Voxel; side.pow(3) as usize], (0..side.pow(3)).flat_map(voxel).collect());
    let grid = UnstructuredGrid::new(points, cells.unwrap()).unwrap();
    let values: Vec<f32> = grid.points().iter().map(|p| (p.x * p.y - p.z) as f32).collect();
    let values = Samples::from(values);
    let gradients = has_gradients.then(|| node_gradients(&grid, &values));
    let slicer = Slicer::new(grid).unwrap();
    let planes = Planes::over(slicer.grid(), DVec3::new(0.3, 0.5, 0.81), num_planes).unwrap();
    let mesh = slicer.mesh(&planes, &values, gradients.as_deref()).unwrap();
    CompactMesh::new(&mesh, slicer.grid().points(), &values, gradients.as_deref()).unwrap()
}
