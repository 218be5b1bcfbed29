//! The types of cells and how their faces lie.

use std::fmt;

/// A type of cell, nodes in VTK's order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CellType {
    /// Four nodes, four triangles.
    Tetrahedron,
    /// A base of four nodes, then the apex.
    Pyramid,
    /// Two triangles, three faces of four nodes between them.
    Wedge,
    /// Six faces of four nodes; the bottom around, then the top around.
    Hexahedron,
    /// A hexahedron with its nodes by x, then y, then z; a box when it is drawn as VTK means it.
    Voxel,
}

/// Faces, each around its outward normal in a cell of positive volume.
type Faces = &'static [&'static [u8]];

const TETRAHEDRON: Faces = &[&[0, 1, 3], &[1, 2, 3], &[2, 0, 3], &[0, 2, 1]];
const PYRAMID: Faces = &[&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]];
const WEDGE: Faces = &[&[0, 2, 1], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]];
const HEXAHEDRON: Faces =
    &[&[0, 4, 7, 3], &[1, 2, 6, 5], &[0, 1, 5, 4], &[3, 7, 6, 2], &[0, 3, 2, 1], &[4, 5, 6, 7]];
const VOXEL: Faces =
    &[&[0, 4, 6, 2], &[1, 3, 7, 5], &[0, 1, 5, 4], &[2, 6, 7, 3], &[0, 2, 3, 1], &[4, 5, 7, 6]];

impl CellType {
    /// Every type there is; a type's place here is its number (`cell_type as usize`).
    pub const ALL: [Self; 5] = [Self::Tetrahedron, Self::Pyramid, Self::Wedge, Self::Hexahedron, Self::Voxel];

    /// The most nodes a cell can have.
    pub const MAX_NODES: usize = 8;

    /// The type of a number in VTK's files, if it is one of these.
    pub const fn from_vtk(number: u8) -> Option<Self> {
        match number {
            10 => Some(Self::Tetrahedron),
            11 => Some(Self::Voxel),
            12 => Some(Self::Hexahedron),
            13 => Some(Self::Wedge),
            14 => Some(Self::Pyramid),
            _ => None,
        }
    }

    /// How many nodes it has.
    pub const fn num_nodes(self) -> usize {
        match self {
            Self::Tetrahedron => 4,
            Self::Pyramid => 5,
            Self::Wedge => 6,
            Self::Hexahedron | Self::Voxel => 8,
        }
    }

    /// Its faces of three or four nodes, as places in the cell's list, each around the outward normal. For a
    /// wedge that is so when the triangle of its first three nodes points into the cell.
    pub const fn faces(self) -> &'static [&'static [u8]] {
        match self {
            Self::Tetrahedron => TETRAHEDRON,
            Self::Pyramid => PYRAMID,
            Self::Wedge => WEDGE,
            Self::Hexahedron => HEXAHEDRON,
            Self::Voxel => VOXEL,
        }
    }

    /// The name used in reports: `tetrahedron`, `pyramid`, `wedge`, `hexahedron`, `voxel`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Tetrahedron => "tetrahedron",
            Self::Pyramid => "pyramid",
            Self::Wedge => "wedge",
            Self::Hexahedron => "hexahedron",
            Self::Voxel => "voxel",
        }
    }
}

impl fmt::Display for CellType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn faces_close_the_cell_once() {
        for cell_type in CellType::ALL {
            let mut sides = BTreeSet::new();
            for face in cell_type.faces() {
                for (at, &from) in face.iter().enumerate() {
                    let to = face[(at + 1) % face.len()];
                    assert!(sides.insert((from, to)), "{cell_type}: side {from} {to} twice");
                }
            }
            assert!(sides.iter().all(|&(from, to)| sides.contains(&(to, from))), "{cell_type}: open");
            let nodes: BTreeSet<u8> = sides.iter().map(|&(from, _)| from).collect();
            assert_eq!(nodes.len(), cell_type.num_nodes());
            let euler = nodes.len() + cell_type.faces().len() - sides.len() / 2;
            assert_eq!(euler, 2, "{cell_type}: not a ball");
        }
    }

    #[test]
    fn a_types_place_is_its_number() {
        for (place, cell_type) in CellType::ALL.into_iter().enumerate() {
            assert_eq!(cell_type as usize, place);
        }
        let known: Vec<_> = (0..=255).filter_map(CellType::from_vtk).collect();
        assert_eq!(known.len(), CellType::ALL.len());
    }
}
