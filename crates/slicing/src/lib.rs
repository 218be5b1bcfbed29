//! Parallel planes through grids of mixed cells: watertight polygons, no tetrahedra made.
//!
//! ```text
//! UnstructuredGrid -> Slicer (once) -> Planes -> Stack of Layers, each a Section: vertices on edges, polygons
//!                                            -> SliceMesh: their triangles, and strips of the outline between
//!                                            -> CompactMesh, QuantizedMesh: the same in few bytes, to store and send
//! ```
//!
//! # Method
//! Incremental slicing as Benölken and Graf, *Direct Volume Rendering of Unstructured Grids in a PC based VR
//! Environment* (WSCG 2005), describe it: distances of nodes once, the range of slices of each cell, and for each
//! slice a table of polygons by the signs of the cell's nodes, of tetrahedra, pyramids, wedges, hexahedra and
//! voxels directly. What is changed:
//! - Signs come from integers, how many planes a node is above, and a node on a plane counts as above. The
//!   paper's index formulas mix two directions; here areas prove the one there is.
//! - Tables are made from the faces of a cell by following the section from face to face, not typed in.
//! - Faces of four nodes that are not planar are split by the diagonal at their lowest node. The paper cuts them
//!   as if planar, and its neighbours disagree where the signs alternate around a face.
//! - Slices stand for slabs, and strips of the outline for what slabs have too much or too little where the grid
//!   ends between planes: any line has its length in the grid. Cells too thin for the planes are not met by
//!   chance: semi-adaptive meshes give them planes and an outline of their own. The paper has slabs alone.
//! - Vertices are shared within a slice, so a slice is an indexed face set from the start, and hold no values but
//!   the edge and the weight. New values at the nodes (a time step) cost an interpolation.
//!
//! # Guarantees
//! - The section of a grid of cells that fit face to face is covered once: no hole, no overlap, no T-junction.
//!   Neighbours share vertices by number, not by rounding. That holds for planes through nodes, edges, faces
//!   and whole layers, for warped faces, both orientations of wedges and cells collapsed by repeated nodes.
//! - Summed over the sheets of a [`SliceMesh`], thicknesses along a ray are its length in the grid, but for the
//!   rounding of places to 32 bits: of cells that no plane meets too, whatever the ray's direction.
//! - The same bits whatever the number of threads; the same polygons whatever the order of cells.
//! - No input panics. A cell with a coordinate that is not finite is left out; one that is folded or
//!   turned over gives polygons with the right vertices, of area as wrong as the cell's volume.
//!
//! # Limits
//! A polygon of a cell with warped faces need not be convex; [`Section::triangles`] splits those too. Vertices of different edges may lie at the same
//! place, where the plane goes through a node; polygons of no area are kept there, since their neighbours share
//! their sides. A face of four nodes must not meet two triangles with another diagonal: such grids do not fit.
//!
//! # Non-goals
//! No pictures, no files, no colours; no isosurfaces.

mod adaptive;
mod assemble;
mod buckets;
mod classes;
mod code;
mod compact;
mod cut;
mod finite;
mod gradients;
mod levels;
mod mesh;
mod outline;
mod planes;
mod quantize;
mod section;
mod slicer;
mod stack;
mod strips;
mod table;
mod triangles;

/// What can go wrong, one type per operation.
pub mod error {
    pub use crate::adaptive::Error as Adaptive;
    pub use crate::assemble::Error as Mesh;
    pub use crate::classes::Error as MeshAdaptively;
    pub use crate::code::Error as Decode;
    pub use crate::compact::Error as Compact;
    pub use crate::cut::Error as Cut;
    pub use crate::mesh::ValuesError as Values;
    pub use crate::planes::Error as Planes;
    pub use crate::quantize::Error as Quantize;
    pub use crate::slicer::Error as Slicer;
    pub use crate::stack::NormalError as Merge;
}

pub use adaptive::{Refinement, Step};
pub use code::{check_frame, check_sheets};
pub use compact::{CompactMesh, Place};
pub use finite::blank_where_not_finite;
pub use gradients::node_gradients;
pub use mesh::{MeshSheet, Rays, SliceMesh};
pub use planes::Planes;
pub use quantize::{Quantization, QuantizedMesh};
pub use section::{Section, Sides};
pub use slicer::Slicer;
pub use stack::{Layer, Stack};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
