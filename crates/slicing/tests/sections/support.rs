//! Grids of every kind of cell by code, and the slow way to a section's area.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;
use volery_scene::{CellType, Cells, UnstructuredGrid};
use volery_slicing::{Section, Stack};

/// Numbers that look random and are always the same (splitmix64).
pub(crate) struct Random(pub u64);

impl Random {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut mixed = self.0;
        mixed = (mixed ^ mixed >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ mixed >> 31
    }

    pub(crate) fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    /// In [-1, 1).
    pub(crate) fn signed(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    pub(crate) fn vector(&mut self) -> DVec3 {
        DVec3::new(self.signed(), self.signed(), self.signed())
    }

    pub(crate) fn shuffled(&mut self, count: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..count).collect();
        (1..count).rev().for_each(|at| order.swap(at, self.below(at + 1)));
        order
    }
}

/// A grid under construction.
#[derive(Clone, Debug, Default)]
pub(crate) struct Parts {
    pub points: Vec<DVec3>,
    pub cells: Vec<(CellType, Vec<u32>)>,
}

impl Parts {
    pub(crate) fn grid(&self) -> UnstructuredGrid {
        let types = self.cells.iter().map(|cell| cell.0).collect();
        let nodes = self.cells.iter().flat_map(|cell| cell.1.clone()).collect();
        UnstructuredGrid::new(self.points.clone(), Cells::new(types, nodes).unwrap()).unwrap()
    }

    /// Cells in another order; nodes keep their numbers.
    pub(crate) fn shuffled(&self, random: &mut Random) -> Self {
        let order = random.shuffled(self.cells.len());
        let cells = order.into_iter().map(|cell| self.cells[cell].clone()).collect();
        Self { points: self.points.clone(), cells }
    }
}

/// One cell of unit size; nodes in VTK's order.
pub(crate) fn unit_cell(cell_type: CellType) -> Vec<DVec3> {
    let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let at = |[x, y]: [f64; 2], z| DVec3::new(x, y, z);
    let corners = |nodes: &[usize], z| nodes.iter().map(|&node| at(square[node], z)).collect::<Vec<_>>();
    match cell_type {
        CellType::Tetrahedron => [corners(&[0, 1, 3], 0.0), vec![DVec3::Z]].concat(),
        CellType::Pyramid => [corners(&[0, 1, 2, 3], 0.0), vec![DVec3::new(0.5, 0.5, 1.0)]].concat(),
        CellType::Wedge => [corners(&[0, 1, 3], 0.0), corners(&[0, 1, 3], 1.0)].concat(),
        CellType::Hexahedron => [corners(&[0, 1, 2, 3], 0.0), corners(&[0, 1, 2, 3], 1.0)].concat(),
        CellType::Voxel => [corners(&[0, 1, 3, 2], 0.0), corners(&[0, 1, 3, 2], 1.0)].concat(),
    }
}

/// `size`^3 unit cubes, each a hexahedron, a voxel, six pyramids around its centre with some made tetrahedra, or,
/// column by column, two wedges of either orientation; some cells written as collapsed ones of a higher type.
/// Nodes are numbered at random and moved by up to `jitter` of a cube, so faces are warped. All fit face to face.
pub(crate) fn mixed(size: usize, jitter: f64, seed: u64) -> Parts {
    let mut random = Random(seed);
    let side = size + 1;
    let names = random.shuffled(side * side * side + size * size * size);
    let node = |x: usize, y: usize, z: usize| names[(z * side + y) * side + x] as u32;
    let center = |x: usize, y: usize, z: usize| names[side * side * side + (z * size + y) * size + x] as u32;
    let mut parts = Parts { points: vec![DVec3::ZERO; names.len()], cells: Vec::new() };
    for at in 0..side * side * side {
        let [x, y, z] = [at % side, at / side % side, at / side / side];
        let point = DVec3::new(x as f64, y as f64, z as f64) + jitter * random.vector();
        parts.points[node(x, y, z) as usize] = point;
    }
    let columns: Vec<usize> = (0..size * size).map(|_| random.below(4)).collect();
    for at in 0..size * size * size {
        let [x, y, z] = [at % size, at / size % size, at / size / size];
        let corner = |[dx, dy, dz]: [usize; 3]| node(x + dx, y + dy, z + dz);
        let bottom = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]].map(corner);
        let top = [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]].map(corner);
        let hexahedron = [bottom, top].concat();
        match columns[y * size + x] {
            2 => wedges(&mut parts, &mut random, [[0, 1, 2], [0, 2, 3]], bottom, top),
            3 => wedges(&mut parts, &mut random, [[0, 1, 3], [1, 2, 3]], bottom, top),
            _ if random.below(2) == 0 => {
                let middle = center(x, y, z);
                let sum: DVec3 = hexahedron.iter().map(|&node| parts.points[node as usize]).sum();
                parts.points[middle as usize] = sum / 8.0 + 0.1 * jitter * random.vector();
                for face in CellType::Hexahedron.faces() {
                    // Inwards, so that the apex is on the side that the base points to.
                    let base: Vec<u32> =
                        face.iter().rev().map(|&place| hexahedron[usize::from(place)]).collect();
                    pyramid(&mut parts, &mut random, &base, middle);
                }
            }
            _ if random.below(3) == 0 => {
                let [b, t] = [bottom, top];
                let nodes = vec![b[0], b[1], b[3], b[2], t[0], t[1], t[3], t[2]];
                parts.cells.push((CellType::Voxel, nodes));
            }
            _ => parts.cells.push((CellType::Hexahedron, hexahedron)),
        }
    }
    parts
}

/// A pyramid as what it is, or as a hexahedron whose top is one node.
fn pyramid(parts: &mut Parts, random: &mut Random, base: &[u32], apex: u32) {
    if random.below(4) == 0 {
        parts.cells.push((CellType::Hexahedron, [base, &[apex; 4]].concat()));
    } else {
        parts.cells.push((CellType::Pyramid, [base, &[apex]].concat()));
    }
}

/// Two wedges between triangles of the bottom and the top: either way round, or as collapsed hexahedra.
fn wedges(parts: &mut Parts, random: &mut Random, split: [[usize; 3]; 2], bottom: [u32; 4], top: [u32; 4]) {
    for triangle in split {
        let [[a, b, c], [d, e, f]] = [bottom, top].map(|nodes| triangle.map(|place| nodes[place]));
        parts.cells.push(match random.below(4) {
            0 => (CellType::Wedge, vec![d, e, f, a, b, c]),
            1 => (CellType::Hexahedron, vec![a, b, c, c, d, e, f, f]),
            _ => (CellType::Wedge, vec![a, b, c, d, e, f]),
        });
    }
}

/// The triangles of a cell's surface, outward, each face of four nodes split at its lowest node.
pub(crate) fn surface(cell_type: CellType, nodes: &[u32]) -> Vec<[u32; 3]> {
    let mut triangles = Vec::new();
    for face in cell_type.faces() {
        let face: Vec<u32> = face.iter().map(|&place| nodes[usize::from(place)]).collect();
        match *face {
            [a, b, c] => triangles.push([a, b, c]),
            [a, b, c, d] if a.min(c) <= b.min(d) => triangles.extend([[a, b, c], [a, c, d]]),
            [a, b, c, d] => triangles.extend([[a, b, d], [b, c, d]]),
            _ => panic!("face of {} nodes", face.len()),
        }
    }
    triangles
}

/// Area of a cell's section by cutting it into tetrahedra around its centre and clipping each.
pub(crate) fn clipped_area(
    points: &[DVec3],
    cell_type: CellType,
    nodes: &[u32],
    normal: DVec3,
    plane: f64,
) -> f64 {
    let center = nodes.iter().map(|&node| points[node as usize]).sum::<DVec3>() / nodes.len() as f64;
    let (mut area, mut volume) = (0.0, 0.0);
    for triangle in surface(cell_type, nodes) {
        let [a, b, c] = triangle.map(|node| points[node as usize]);
        let part = (a - center).dot((b - center).cross(c - center)) / 6.0;
        volume += part;
        area += part.signum() * tetrahedron_area([a, b, c, center], normal, plane);
    }
    area * volume.signum()
}

/// Area of a tetrahedron's section.
fn tetrahedron_area(corners: [DVec3; 4], normal: DVec3, plane: f64) -> f64 {
    let distances = corners.map(|corner| normal.dot(corner) - plane);
    let above: Vec<usize> = (0..4).filter(|&at| distances[at] >= 0.0).collect();
    let below: Vec<usize> = (0..4).filter(|&at| distances[at] < 0.0).collect();
    let cross = |a: usize, b: usize| {
        corners[a] + distances[a] / (distances[a] - distances[b]) * (corners[b] - corners[a])
    };
    let triangle = |a: DVec3, b: DVec3, c: DVec3| 0.5 * (b - a).cross(c - a).length();
    match (&above[..], &below[..]) {
        (&[a], &[b, c, d]) | (&[b, c, d], &[a]) => triangle(cross(a, b), cross(a, c), cross(a, d)),
        (&[a, b], &[c, d]) => {
            let [ac, ad, bc, bd] = [cross(a, c), cross(a, d), cross(b, c), cross(b, d)];
            triangle(ac, ad, bd) + triangle(ac, bd, bc)
        }
        _ => 0.0,
    }
}

/// Faces that only one cell has, as sets of nodes; faces that collapsed to a line or point left out.
pub(crate) fn outline(grid: &UnstructuredGrid) -> Vec<BTreeSet<u32>> {
    let mut count: BTreeMap<BTreeSet<u32>, usize> = BTreeMap::new();
    for (cell_type, nodes) in grid.cells().iter() {
        for face in cell_type.faces() {
            let face: BTreeSet<u32> = face.iter().map(|&place| nodes[usize::from(place)]).collect();
            if face.len() > 2 {
                *count.entry(face).or_default() += 1;
            }
        }
    }
    count.into_iter().filter(|&(_, count)| count == 1).map(|(face, _)| face).collect()
}

/// Whether the polygons of a section leave sides open only on the grid's outline, and none overlap; and how many
/// sides are open.
pub(crate) fn num_open_on_outline(section: &Section, outline: &[BTreeSet<u32>]) -> Result<usize, String> {
    let sides = section.unmatched_sides();
    if let Some(side) = sides.overlapping.first() {
        return Err(format!("polygons overlap at side {side:?}"));
    }
    let mut faces_of: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (face, nodes) in outline.iter().enumerate() {
        nodes.iter().for_each(|&node| faces_of.entry(node).or_default().push(face));
    }
    for side in &sides.open {
        let nodes: BTreeSet<u32> = side.iter().flat_map(|&vertex| section.edges()[vertex as usize]).collect();
        let first = nodes.first().copied().unwrap_or_default();
        let is_outline = |&face: &usize| nodes.is_subset(&outline[face]);
        if !faces_of.get(&first).is_some_and(|faces| faces.iter().any(is_outline)) {
            return Err(format!("hole at side {side:?} between nodes {nodes:?}"));
        }
    }
    Ok(sides.open.len())
}

/// A polygon as the edges of its vertices and the bits of their weights, from the least on.
pub(crate) type Meaning = Vec<([u32; 2], u32)>;

/// The polygons of a stack as what they mean, layer by layer, sorted.
pub(crate) fn meaning(stack: &Stack) -> Vec<Vec<Meaning>> {
    let of_section = |section: &Section| {
        let vertex =
            |&vertex: &u32| (section.edges()[vertex as usize], section.weights()[vertex as usize].to_bits());
        let mut polygons: Vec<Vec<_>> = section
            .polygons()
            .map(|polygon| {
                let mut polygon: Vec<_> = polygon.iter().map(vertex).collect();
                let least = (0..polygon.len()).min_by_key(|&at| polygon[at]).unwrap_or(0);
                polygon.rotate_left(least);
                polygon
            })
            .collect();
        polygons.sort();
        polygons
    };
    stack.layers().iter().map(|layer| layer.section.as_ref().map(of_section).unwrap_or_default()).collect()
}
