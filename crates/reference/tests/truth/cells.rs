//! Grids of every type of cell over a block, for tests.

use glam::DVec3;
use volery_data::hash;
use volery_scene::{CellType, Cells, UnstructuredGrid};

/// How each box of a lattice is filled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Filling {
    Hexahedra,
    Voxels,
    Wedges,
    TurnedWedges,
    Pyramids,
    Tetrahedra,
    /// Hexahedra two by two collapsed to wedges: some nodes twice.
    CollapsedHexahedra,
    /// Negative volumes.
    InvertedHexahedra,
    /// All of the above but the pyramids, whose middle nodes a lattice has not, by turns.
    Mixed,
}

pub(crate) const FILLINGS: [Filling; 9] = [
    Filling::Hexahedra,
    Filling::Voxels,
    Filling::Wedges,
    Filling::TurnedWedges,
    Filling::Pyramids,
    Filling::Tetrahedra,
    Filling::CollapsedHexahedra,
    Filling::InvertedHexahedra,
    Filling::Mixed,
];

/// Corners of the unit box in the order of hexahedra.
const BOX: [[usize; 3]; 8] =
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];

/// The cells of one box with these corners in the order of hexahedra, and a node in its middle.
fn fill(filling: Filling, at: usize, corners: [u32; 8], middle: u32) -> Vec<(CellType, Vec<u32>)> {
    let pick = |places: &[usize]| places.iter().map(|&place| corners[place]).collect::<Vec<_>>();
    let cells = |cell_type, lists: &[&[usize]]| lists.iter().map(|list| (cell_type, pick(list))).collect();
    match filling {
        Filling::Hexahedra => cells(CellType::Hexahedron, &[&[0, 1, 2, 3, 4, 5, 6, 7]]),
        Filling::InvertedHexahedra => cells(CellType::Hexahedron, &[&[4, 5, 6, 7, 0, 1, 2, 3]]),
        Filling::Voxels => cells(CellType::Voxel, &[&[0, 1, 3, 2, 4, 5, 7, 6]]),
        Filling::Wedges => cells(CellType::Wedge, &[&[0, 1, 2, 4, 5, 6], &[0, 2, 3, 4, 6, 7]]),
        Filling::TurnedWedges => cells(CellType::Wedge, &[&[4, 5, 6, 0, 1, 2], &[0, 3, 2, 4, 7, 6]]),
        Filling::CollapsedHexahedra => {
            cells(CellType::Hexahedron, &[&[0, 1, 2, 2, 4, 5, 6, 6], &[0, 0, 2, 3, 4, 4, 6, 7]])
        }
        Filling::Tetrahedra => cells(
            CellType::Tetrahedron,
            &[&[0, 1, 2, 6], &[0, 2, 3, 6], &[0, 3, 7, 6], &[0, 7, 4, 6], &[0, 4, 5, 6], &[0, 5, 1, 6]],
        ),
        Filling::Pyramids => {
            let apex = |base: &[usize]| (CellType::Pyramid, [pick(base), vec![middle]].concat());
            let faces: [&[usize]; 6] =
                [&[0, 1, 2, 3], &[4, 7, 6, 5], &[0, 4, 5, 1], &[1, 5, 6, 2], &[2, 6, 7, 3], &[3, 7, 4, 0]];
            faces.map(apex).to_vec()
        }
        Filling::Mixed => {
            let fillings: Vec<Filling> =
                FILLINGS.into_iter().filter(|&f| f != Filling::Pyramids && f != Filling::Mixed).collect();
            fill(fillings[hash(at as u64) as usize % fillings.len()], at, corners, middle)
        }
    }
}

/// A lattice of boxes of size 1, moved to where `place` says; nodes in the order x, y, z, then the middles.
pub(crate) fn lattice(
    boxes: [usize; 3],
    filling: Filling,
    place: impl Fn(DVec3) -> DVec3,
) -> UnstructuredGrid {
    let dims = boxes.map(|n| n + 1);
    let number = |[x, y, z]: [usize; 3]| (x + dims[0] * (y + dims[1] * z)) as u32;
    let at = |[x, y, z]: [usize; 3]| DVec3::new(x as f64, y as f64, z as f64);
    let each = |dims: [usize; 3]| {
        (0..dims.iter().product())
            .map(move |i: usize| [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]])
    };
    let mut points: Vec<DVec3> = each(dims).map(|node| place(at(node))).collect();
    let (mut types, mut nodes) = (Vec::new(), Vec::new());
    for (index, first) in each(boxes).enumerate() {
        let corners = BOX.map(|corner| number([0, 1, 2].map(|axis| first[axis] + corner[axis])));
        let middle = points.len() as u32;
        points.push(place(at(first) + 0.5));
        for (cell_type, list) in fill(filling, index, corners, middle) {
            types.push(cell_type);
            nodes.extend(list);
        }
    }
    UnstructuredGrid::new(points, Cells::new(types, nodes).expect("as many nodes as the types ask for"))
        .expect("nodes that exist")
}

/// Inner nodes of a lattice moved by up to a quarter of a box each way, differently for each; those on the outside
/// stay.
pub(crate) fn shaken(boxes: [usize; 3]) -> impl Fn(DVec3) -> DVec3 {
    move |p| {
        let inside = (0..3).all(|axis| p[axis] > 0.0 && p[axis] < boxes[axis] as f64);
        let key = (p.x * 2.0 + 64.0 * (p.y * 2.0 + 64.0 * p.z * 2.0)) as u64;
        let unit = |axis: u64| (hash(3 * key + axis) >> 11) as f64 / (1u64 << 53) as f64 - 0.5;
        if inside { p + 0.5 * DVec3::new(unit(0), unit(1), unit(2)) } else { p }
    }
}

/// The same grid with its cells in another order.
pub(crate) fn shuffled(grid: &UnstructuredGrid) -> UnstructuredGrid {
    let mut order: Vec<usize> = (0..grid.cells().len()).collect();
    order.sort_by_key(|&cell| hash(cell as u64));
    let types = order.iter().map(|&cell| grid.cells().get(cell).0).collect();
    let nodes = order.iter().flat_map(|&cell| grid.cells().get(cell).1.to_vec()).collect();
    UnstructuredGrid::new(
        grid.points().to_vec(),
        Cells::new(types, nodes).expect("as many nodes as the types ask for"),
    )
    .expect("nodes that exist")
}
