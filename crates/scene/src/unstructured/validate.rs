//! What is wrong with the cells of a grid, by type and cell.
//!
//! # Method
//! Volume by the divergence theorem over the faces, a face of four nodes as the mean of its two pairs of
//! triangles, which is the bilinear patch. The volume counts as zero when it is within the rounding of that sum,
//! so a thin cell is not taken for a flat one. A corner with three edges is turned over when the determinant of
//! its edges has not the sign of the cell. A face is not planar when the lines of its diagonals pass each other at
//! more than [`PLANAR`] of the longer one; coordinates stored in 32 bits stay below that by two orders.

use std::fmt;

use glam::DVec3;

use super::{CellType, Cells};

/// Distance of a face's diagonals, over the length of the longer, up to which the face counts as planar.
pub const PLANAR: f64 = 1e-5;

/// Rounding of a volume, over the sum of its products without signs.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// One thing that is wrong with one cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Defect {
    /// Number of the cell.
    pub cell: usize,
    /// Its type.
    pub cell_type: CellType,
    /// What is wrong.
    pub fault: Fault,
}

/// What can be wrong with a cell. None of it stops a cell from being drawn, but for the first two.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// It names a node that does not exist. Nothing else is said of such a cell.
    NodeOutOfRange {
        /// The node it names.
        node: u32,
    },
    /// A coordinate of this node is NaN or infinite; the cell is blank. Nothing else is said of it.
    NotFinite {
        /// The node.
        node: u32,
    },
    /// No volume, to rounding.
    ZeroVolume,
    /// Negative volume. Never said of wedges, which are valid both ways.
    Inverted,
    /// The corner at this node is turned over against the rest of the cell.
    FoldedCorner {
        /// The node.
        node: u32,
    },
    /// A face of four nodes that do not lie in a plane.
    NonPlanarFace {
        /// Place of the face in [`CellType::faces`].
        face: usize,
        /// Distance of the lines of its diagonals, over the length of the longer.
        relative_distance: f64,
    },
}

impl Fault {
    /// The name used in reports: `zero volume`, `inverted`, ...
    pub const fn name(&self) -> &'static str {
        match self {
            Self::NodeOutOfRange { .. } => "node out of range",
            Self::NotFinite { .. } => "coordinate not finite",
            Self::ZeroVolume => "zero volume",
            Self::Inverted => "inverted",
            Self::FoldedCorner { .. } => "folded corner",
            Self::NonPlanarFace { .. } => "non-planar face",
        }
    }
}

impl fmt::Display for Defect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { cell, cell_type, fault } = self;
        write!(f, "cell {cell} ({cell_type}): {}", fault.name())?;
        match fault {
            Fault::NodeOutOfRange { node } | Fault::NotFinite { node } | Fault::FoldedCorner { node } => {
                write!(f, ", node {node}")
            }
            Fault::NonPlanarFace { face, relative_distance } => {
                write!(f, ", face {face} by {relative_distance:.1e} of its diagonal")
            }
            Fault::ZeroVolume | Fault::Inverted => Ok(()),
        }
    }
}

/// Lists what is wrong with cells over these points, in the order of cells. Takes the parts, so that it can say
/// why they make no grid.
pub fn defects(points: &[DVec3], cells: &Cells) -> Vec<Defect> {
    let mut defects = Vec::new();
    for (cell, (cell_type, nodes)) in cells.iter().enumerate() {
        let mut add = |fault| defects.push(Defect { cell, cell_type, fault });
        if let Some(&node) = nodes.iter().find(|&&node| node as usize >= points.len()) {
            add(Fault::NodeOutOfRange { node });
            continue;
        }
        if let Some(&node) = nodes.iter().find(|&&node| !points[node as usize].is_finite()) {
            add(Fault::NotFinite { node });
            continue;
        }
        let mut corners = [DVec3::ZERO; CellType::MAX_NODES];
        for (corner, &node) in corners.iter_mut().zip(nodes) {
            // Around the first node, so that a grid far from the origin keeps its digits.
            *corner = points[node as usize] - points[nodes[0] as usize];
        }
        shape_faults(cell_type, nodes, &corners, add);
    }
    defects
}

fn shape_faults(cell_type: CellType, nodes: &[u32], corners: &[DVec3; 8], mut add: impl FnMut(Fault)) {
    let (volume, rounding) = volume(cell_type, corners);
    if volume.abs() <= rounding {
        add(Fault::ZeroVolume);
    } else {
        if volume < 0.0 && cell_type != CellType::Wedge {
            add(Fault::Inverted);
        }
        for (place, &node) in nodes.iter().enumerate() {
            if corner_determinant(cell_type, corners, place).is_some_and(|found| found * volume < 0.0) {
                add(Fault::FoldedCorner { node });
            }
        }
    }
    for (face, places) in cell_type.faces().iter().enumerate() {
        if let [a, b, c, d] = **places {
            let [a, b, c, d] = [a, b, c, d].map(|place| corners[usize::from(place)]);
            let relative_distance = diagonal_distance([a, b, c, d]);
            if relative_distance > PLANAR {
                add(Fault::NonPlanarFace { face, relative_distance });
            }
        }
    }
}

/// The volume, and how far rounding may have moved it from zero.
fn volume(cell_type: CellType, corners: &[DVec3; 8]) -> (f64, f64) {
    let (mut sum, mut size) = (0.0, 0.0);
    let mut add = |weight: f64, [a, b, c]: [u8; 3]| {
        let [a, b, c] = [a, b, c].map(|place| corners[usize::from(place)]);
        sum += weight * a.dot(b.cross(c));
        // The same sum of products without signs.
        let [a, b, c] = [a.abs(), b.abs(), c.abs()];
        let sums = DVec3::new(b.y * c.z + b.z * c.y, b.z * c.x + b.x * c.z, b.x * c.y + b.y * c.x);
        size += weight * a.dot(sums);
    };
    for face in cell_type.faces() {
        match **face {
            [a, b, c] => add(2.0, [a, b, c]),
            [a, b, c, d] => {
                for triangle in [[a, b, c], [a, c, d], [a, b, d], [b, c, d]] {
                    add(1.0, triangle);
                }
            }
            _ => {}
        }
    }
    (sum / 12.0, ROUNDING * size / 12.0)
}

/// Determinant of the three edges at a corner, positive in a good cell; `None` where more than three meet.
fn corner_determinant(cell_type: CellType, corners: &[DVec3; 8], place: usize) -> Option<f64> {
    let around = cell_type.faces().iter().filter_map(|face| {
        let at = face.iter().position(|&other| usize::from(other) == place)?;
        Some([face[(at + face.len() - 1) % face.len()], face[(at + 1) % face.len()]])
    });
    let sides: Vec<[u8; 2]> = around.collect();
    let &[[previous, next], second, third] = sides.as_slice() else { return None };
    let other = second.into_iter().chain(third).find(|place| ![previous, next].contains(place))?;
    let [a, b, c] = [previous, next, other].map(|other| corners[usize::from(other)] - corners[place]);
    Some(a.dot(b.cross(c)))
}

/// Distance of the lines of a face's diagonals, over the length of the longer; 0 for a face without area.
fn diagonal_distance([a, b, c, d]: [DVec3; 4]) -> f64 {
    let (first, second) = (c - a, d - b);
    let normal = first.cross(second);
    let longer = first.length().max(second.length());
    let area = normal.length();
    if area > ROUNDING * longer * longer { (b - a).dot(normal).abs() / area / longer } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A unit cube in the order of hexahedra, then two nodes above it.
    fn points() -> Vec<DVec3> {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let layer = |z| square.map(|[x, y]| DVec3::new(x, y, z));
        [layer(0.0), layer(1.0)].concat().into_iter().chain([DVec3::new(0.5, 0.5, 2.0), DVec3::NAN]).collect()
    }

    fn faults(points: &[DVec3], cell_type: CellType, nodes: &[u32]) -> Vec<Fault> {
        let cells = Cells::new(vec![cell_type], nodes.to_vec()).unwrap();
        defects(points, &cells).into_iter().map(|defect| defect.fault).collect()
    }

    #[test]
    fn good_cells_have_no_fault_wherever_they_are() {
        let good: [(CellType, &[u32]); 6] = [
            (CellType::Tetrahedron, &[0, 1, 3, 4]),
            (CellType::Pyramid, &[4, 5, 6, 7, 8]),
            (CellType::Wedge, &[0, 1, 2, 4, 5, 6]),
            (CellType::Wedge, &[4, 5, 6, 0, 1, 2]),
            (CellType::Hexahedron, &[0, 1, 2, 3, 4, 5, 6, 7]),
            (CellType::Voxel, &[0, 1, 3, 2, 4, 5, 7, 6]),
        ];
        for [scale, offset] in [[1.0, 0.0], [1e-3, 1e6], [1e100, 0.0], [1e-60, 0.0]] {
            let points: Vec<DVec3> = points().iter().map(|&point| scale * point + offset).collect();
            for (cell_type, nodes) in good {
                assert_eq!(
                    faults(&points, cell_type, nodes),
                    [],
                    "{cell_type} {nodes:?} {scale:e} {offset:e}"
                );
            }
        }
    }

    #[test]
    fn nodes_that_are_nowhere_are_listed() {
        let points = points();
        let out_of_range = faults(&points, CellType::Tetrahedron, &[0, 1, 10, 9]);
        assert_eq!(out_of_range, [Fault::NodeOutOfRange { node: 10 }]);
        assert_eq!(faults(&points, CellType::Tetrahedron, &[0, 1, 2, 9]), [Fault::NotFinite { node: 9 }]);
    }

    #[test]
    fn inverted_and_flat_cells_are_listed() {
        let points = points();
        assert_eq!(faults(&points, CellType::Tetrahedron, &[0, 3, 1, 4]), [Fault::Inverted]);
        assert_eq!(faults(&points, CellType::Pyramid, &[0, 3, 2, 1, 4]), [Fault::Inverted]);
        let turned = [4, 5, 6, 7, 0, 1, 2, 3];
        assert_eq!(faults(&points, CellType::Hexahedron, &turned), [Fault::Inverted]);
        for nodes in [[0, 1, 2, 3], [0, 0, 1, 4], [5, 5, 5, 5]] {
            assert_eq!(faults(&points, CellType::Tetrahedron, &nodes), [Fault::ZeroVolume], "{nodes:?}");
        }
    }

    #[test]
    fn a_needle_is_not_flat() {
        for height in [1e-3, 1e-9, 1e-12] {
            let points = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(0.3, 0.3, height)];
            assert_eq!(faults(&points, CellType::Tetrahedron, &[0, 1, 2, 3]), [], "{height}");
        }
    }

    #[test]
    fn a_corner_pushed_through_the_cell_is_folded_and_its_faces_not_planar() {
        let mut points = points();
        points[6] = DVec3::new(-0.5, -0.2, 0.3);
        let found = faults(&points, CellType::Hexahedron, &[0, 1, 2, 3, 4, 5, 6, 7]);
        assert!(found.contains(&Fault::FoldedCorner { node: 6 }), "{found:?}");
        assert!(!found.contains(&Fault::FoldedCorner { node: 0 }), "{found:?}");
        let warped: Vec<usize> = found
            .iter()
            .filter_map(|fault| match fault {
                Fault::NonPlanarFace { face, .. } => Some(*face),
                _ => None,
            })
            .collect();
        // The three faces at node 6.
        assert_eq!(warped, [1, 3, 5]);
    }

    #[test]
    fn the_distance_of_diagonals_is_relative_to_the_longer() {
        let mut points = points();
        points[6].z += 4e-4;
        let found = faults(&points, CellType::Hexahedron, &[0, 1, 2, 3, 4, 5, 6, 7]);
        let [Fault::NonPlanarFace { face: 5, relative_distance }] = found[..] else { panic!("{found:?}") };
        // The middles of the diagonals are 2e-4 apart, and the diagonals sqrt(2) long.
        assert!((relative_distance - 2e-4 / 2f64.sqrt()).abs() < 1e-7, "{relative_distance}");
    }
}
