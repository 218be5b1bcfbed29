//! An unstructured grid: cells of several types over shared nodes, with scalars at the nodes.
//!
//! # Conventions
//! Cells list their nodes in VTK's order. A tetrahedron, pyramid, hexahedron or voxel has positive volume when
//! the first face, taken by the right hand, points into the cell. Wedges occur both ways in the wild, since VTK
//! itself changed its mind; either is valid. Nodes may repeat within a cell (a hexahedron collapsed to a
//! wedge), faces of four nodes need not be planar, and faces match between cells when they have the same nodes.
//!
//! A cell is *blank*, and holds no matter, when the grid says so or when a coordinate of one of its nodes is NaN
//! or infinite. A value that is NaN or infinite makes the cells around that node blank for that array only.
//!
//! # Non-goals
//! No cell scalars (readers average them to nodes), no cells of higher order, no neighbours.

mod cell;
mod validate;

use std::fmt;

use glam::DVec3;

pub use cell::CellType;
pub use validate::{Defect, Fault, PLANAR, defects};

use crate::samples::{SampleType, Samples};

/// Which nodes make which cells. Consistent in itself; whether its nodes exist is for the grid to say.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Cells {
    types: Vec<CellType>,
    starts: Vec<u32>,
    nodes: Vec<u32>,
}

/// Why cells or a grid could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// The types ask for another number of nodes than there are.
    #[error(
        "unstructured grid: {found} nodes of cells, expected {expected} by the types of {num_cells} cells"
    )]
    NodeCount {
        /// Entries of connectivity given.
        found: usize,
        /// The sum of the types' numbers of nodes.
        expected: usize,
        /// Number of cells.
        num_cells: usize,
    },
    /// More than 32 bits can number.
    #[error("unstructured grid: {found} {what}, expected at most {}", u32::MAX)]
    TooMany {
        /// Points, or nodes of cells.
        what: &'static str,
        /// How many.
        found: usize,
    },
    /// A cell names a node that does not exist. The first such cell; [`defects`] lists all.
    #[error("unstructured grid: cell {cell} ({cell_type}) has node {node}, expected below {num_points}")]
    NodeOutOfRange {
        /// Number of the cell.
        cell: usize,
        /// Its type.
        cell_type: CellType,
        /// The node it names.
        node: u32,
        /// Number of points.
        num_points: usize,
    },
    /// An array or list that has not one entry per node or cell.
    #[error("unstructured grid: {name} has {found} values, expected {expected}")]
    ArrayLength {
        /// Name of the array.
        name: String,
        /// Values given.
        found: usize,
        /// Number of points, or of cells.
        expected: usize,
    },
    /// An array of colours.
    #[error("unstructured grid: array {name} is of type {found}, expected scalars")]
    NotScalar {
        /// Name of the array.
        name: String,
        /// Its type.
        found: SampleType,
    },
    /// Two arrays of one name.
    #[error("unstructured grid: two arrays are named {name}, expected different names")]
    SameName {
        /// The name.
        name: String,
    },
}

impl Cells {
    /// Cells of these types; `nodes` has the nodes of the first cell, then of the second, and so on.
    ///
    /// # Errors
    /// When the number of nodes is not what the types ask for, or is above `u32::MAX`.
    pub fn new(types: Vec<CellType>, nodes: Vec<u32>) -> Result<Self, Error> {
        let expected = types.iter().map(|cell_type| cell_type.num_nodes()).sum();
        if nodes.len() != expected {
            return Err(Error::NodeCount { found: nodes.len(), expected, num_cells: types.len() });
        }
        let mut starts = Vec::with_capacity(types.len() + 1);
        let mut start = 0;
        starts.push(0);
        for cell_type in &types {
            start += cell_type.num_nodes();
            let fits = u32::try_from(start);
            starts.push(fits.map_err(|_| Error::TooMany { what: "nodes of cells", found: nodes.len() })?);
        }
        Ok(Self { types, starts, nodes })
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.types.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.types.is_empty()
    }

    /// Type and nodes of a cell.
    ///
    /// # Panics
    /// When `cell` is not below [`len`](Self::len).
    #[inline]
    pub fn get(&self, cell: usize) -> (CellType, &[u32]) {
        (self.types[cell], &self.nodes[self.starts[cell] as usize..self.starts[cell + 1] as usize])
    }

    /// Type and nodes of every cell, in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (CellType, &[u32])> {
        (0..self.len()).map(|cell| self.get(cell))
    }

    /// The types, one per cell.
    pub fn types(&self) -> &[CellType] {
        &self.types
    }

    /// How many cells of each type there are, in the order of [`CellType::ALL`].
    pub fn count_by_type(&self) -> [usize; CellType::ALL.len()] {
        let mut counts = [0; CellType::ALL.len()];
        for &cell_type in &self.types {
            counts[cell_type as usize] += 1;
        }
        counts
    }
}

/// A named scalar at every node.
#[derive(Clone, Debug)]
pub struct PointArray {
    /// Its name, as in the file.
    pub name: String,
    /// One value per node.
    pub values: Samples,
}

/// Cells over shared nodes, with any number of scalars at the nodes.
#[derive(Clone)]
pub struct UnstructuredGrid {
    points: Vec<DVec3>,
    cells: Cells,
    arrays: Vec<PointArray>,
    blank: Vec<bool>,
}

impl fmt::Debug for UnstructuredGrid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<_> = self.arrays.iter().map(|array| &array.name).collect();
        write!(f, "UnstructuredGrid({} points, {} cells, {names:?})", self.points.len(), self.cells.len())
    }
}

impl UnstructuredGrid {
    /// A grid without arrays and without blank cells.
    ///
    /// # Errors
    /// When a cell names a node that does not exist, or there are more than `u32::MAX` points.
    pub fn new(points: Vec<DVec3>, cells: Cells) -> Result<Self, Error> {
        if u32::try_from(points.len()).is_err() {
            return Err(Error::TooMany { what: "points", found: points.len() });
        }
        let is_bad = |&node: &u32| node as usize >= points.len();
        if cells.nodes.iter().any(is_bad) {
            for (cell, (cell_type, nodes)) in cells.iter().enumerate() {
                if let Some(&node) = nodes.iter().find(|node| is_bad(node)) {
                    let num_points = points.len();
                    return Err(Error::NodeOutOfRange { cell, cell_type, node, num_points });
                }
            }
        }
        Ok(Self { points, cells, arrays: Vec::new(), blank: Vec::new() })
    }

    /// The same with one more scalar at the nodes.
    ///
    /// # Errors
    /// When it has not one value per node, is no scalar, or its name is taken.
    pub fn with_array(mut self, name: impl Into<String>, values: impl Into<Samples>) -> Result<Self, Error> {
        let (name, values) = (name.into(), values.into());
        let (found, expected) = (values.len(), self.points.len());
        if found != expected {
            return Err(Error::ArrayLength { name, found, expected });
        }
        if values.sample_type().channels() != 1 {
            return Err(Error::NotScalar { name, found: values.sample_type() });
        }
        if self.array(&name).is_some() {
            return Err(Error::SameName { name });
        }
        self.arrays.push(PointArray { name, values });
        Ok(self)
    }

    /// The same with these cells blank, one flag per cell; takes the place of earlier flags.
    ///
    /// # Errors
    /// When there is not one flag per cell.
    pub fn with_blank(mut self, blank: Vec<bool>) -> Result<Self, Error> {
        let (found, expected) = (blank.len(), self.cells.len());
        if found != expected {
            return Err(Error::ArrayLength { name: "list of blank cells".to_owned(), found, expected });
        }
        self.blank = blank;
        Ok(self)
    }

    /// World positions of the nodes.
    pub fn points(&self) -> &[DVec3] {
        &self.points
    }

    /// Types and nodes of the cells.
    pub fn cells(&self) -> &Cells {
        &self.cells
    }

    /// The scalars, in the order they were added.
    pub fn arrays(&self) -> &[PointArray] {
        &self.arrays
    }

    /// The scalar of a name.
    pub fn array(&self, name: &str) -> Option<&PointArray> {
        self.arrays.iter().find(|array| array.name == name)
    }

    /// Whether a cell holds no matter: marked so, or with a node that is nowhere.
    ///
    /// # Panics
    /// When there is no such cell.
    pub fn is_blank(&self, cell: usize) -> bool {
        let (_, nodes) = self.cells.get(cell);
        self.blank.get(cell).is_some_and(|&blank| blank)
            || nodes.iter().any(|&node| !self.points[node as usize].is_finite())
    }

    /// Smallest and largest corner of the nodes that cells use, blank cells aside; `None` if there is none.
    pub fn world_bounds(&self) -> Option<[DVec3; 2]> {
        let mut bounds: Option<[DVec3; 2]> = None;
        for cell in (0..self.cells.len()).filter(|&cell| !self.is_blank(cell)) {
            for &node in self.cells.get(cell).1 {
                let point = self.points[node as usize];
                let [low, high] = bounds.unwrap_or([point; 2]);
                bounds = Some([low.min(point), high.max(point)]);
            }
        }
        bounds
    }

    /// What is wrong with its cells; see [`defects`].
    pub fn defects(&self) -> Vec<Defect> {
        defects(&self.points, &self.cells)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> UnstructuredGrid {
        let cells = Cells::new(vec![CellType::Tetrahedron], vec![0, 1, 2, 3]).unwrap();
        UnstructuredGrid::new(vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z], cells).unwrap()
    }

    #[test]
    fn counts_that_do_not_fit_are_errors() {
        let error = Cells::new(vec![CellType::Wedge, CellType::Pyramid], vec![0; 10]).unwrap_err();
        assert_eq!(error, Error::NodeCount { found: 10, expected: 11, num_cells: 2 });
        let error = tetrahedron().with_array("p", vec![1f32; 3]).unwrap_err();
        assert_eq!(error, Error::ArrayLength { name: "p".to_owned(), found: 3, expected: 4 });
        assert!(tetrahedron().with_array("p", vec![[0u8; 3]; 4]).is_err());
        assert!(tetrahedron().with_blank(vec![]).is_err());
        let named = tetrahedron().with_array("p", vec![1f32; 4]).unwrap();
        assert_eq!(
            named.with_array("p", vec![1f64; 4]).unwrap_err(),
            Error::SameName { name: "p".to_owned() }
        );
    }

    #[test]
    fn a_node_out_of_range_is_an_error() {
        let cells = Cells::new(vec![CellType::Tetrahedron; 2], vec![0, 1, 2, 3, 1, 2, 3, 4]).unwrap();
        let error = UnstructuredGrid::new(vec![DVec3::ZERO; 4], cells).unwrap_err();
        let cell_type = CellType::Tetrahedron;
        assert_eq!(error, Error::NodeOutOfRange { cell: 1, cell_type, node: 4, num_points: 4 });
        assert_eq!(error.to_string(), "unstructured grid: cell 1 (tetrahedron) has node 4, expected below 4");
    }

    #[test]
    fn blank_cells_do_not_count_for_the_bounds() {
        let points = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::NAN, DVec3::splat(9.0)];
        let nodes = vec![0, 1, 2, 3, 1, 2, 3, 4, 0, 1, 2, 5];
        let cells = Cells::new(vec![CellType::Tetrahedron; 3], nodes).unwrap();
        let grid = UnstructuredGrid::new(points, cells).unwrap();
        assert_eq!([0, 1, 2].map(|cell| grid.is_blank(cell)), [false, true, false]);
        assert_eq!(grid.world_bounds(), Some([DVec3::ZERO, DVec3::splat(9.0)]));
        let grid = grid.with_blank(vec![false, false, true]).unwrap();
        assert_eq!(grid.world_bounds(), Some([DVec3::ZERO, DVec3::ONE]));
        let nothing = UnstructuredGrid::new(vec![], Cells::new(vec![], vec![]).unwrap()).unwrap();
        assert_eq!(nothing.world_bounds(), None);
    }
}
