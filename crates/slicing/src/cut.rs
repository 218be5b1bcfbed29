//! Cutting a grid by parallel planes.
//!
//! # Method
//! A node's *level* is the number of planes at or below it, found once. The node is above plane `s` if and only
//! if `s` is smaller than its level, so all that follows is comparisons of integers: a cell meets the planes from
//! the lowest level of its nodes to one below the highest, and the signs of its nodes are the index into its
//! table. A node on a plane counts as above it, everywhere alike: that is the plane moved down by an amount
//! too small to see, so sections of planes through nodes, edges and faces are those of planes in general
//! position, and a layer of faces in the plane is drawn once, by the cells below.
//!
//! Cells are put into the buckets of the slices they meet; then slices are made in parallel, each on its own. A
//! vertex is made when a polygon first comes to its edge; its number is noted at the edge in a list that threads
//! reuse without clearing: a note holds if the vertex it names lies on this very edge.

use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use crate::buckets::Buckets;
use crate::levels::Levels;
use crate::planes::Planes;
use crate::section::Section;
use crate::slicer::Slicer;
use crate::stack::{Layer, Stack};

/// Why a grid could not be cut.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// More sections of cells than memory is likely to hold.
    #[error(
        "slicing: {found} sections of cells in {num_planes} planes, expected at most {}",
        Slicer::MAX_SECTIONS
    )]
    TooManySections {
        /// How many there would be.
        found: u64,
        /// Number of planes.
        num_planes: usize,
    },
}

/// What a thread reuses from slice to slice: the vertex last made on each edge.
type Notes = Vec<u32>;

impl Slicer {
    /// The most sections of cells, summed over all planes, in one stack.
    pub const MAX_SECTIONS: u64 = 1 << 28;

    /// The polygons of all planes, cell by cell.
    ///
    /// # Errors
    /// When there would be more than [`MAX_SECTIONS`](Self::MAX_SECTIONS).
    pub fn slice(&self, planes: &Planes) -> Result<Stack, Error> {
        self.slice_cells(planes, |_| true)
    }

    /// The same for the cells that `wanted` names, as if there were no others.
    pub(crate) fn slice_cells(
        &self,
        planes: &Planes,
        wanted: impl Fn(usize) -> bool + Sync,
    ) -> Result<Stack, Error> {
        self.slice_levels(&Levels::new(self.grid(), planes), wanted)
    }

    /// The same where the nodes have been put between the planes already.
    pub(crate) fn slice_levels(
        &self,
        levels: &Levels<'_>,
        wanted: impl Fn(usize) -> bool + Sync,
    ) -> Result<Stack, Error> {
        let planes = levels.planes;
        let slices_of = |cell: usize| {
            if self.is_blank(cell) || !wanted(cell) {
                return 0..0;
            }
            let (_, nodes) = self.grid().cells().get(cell);
            let [low, high] = nodes.iter().fold([u32::MAX, 0], |[low, high], &node| {
                let level = levels.of(node);
                [low.min(level), high.max(level)]
            });
            low..high
        };
        let found = (0..self.num_cells()).into_par_iter().map(|cell| slices_of(cell).len() as u64).sum();
        if found > Self::MAX_SECTIONS {
            return Err(Error::TooManySections { found, num_planes: planes.len() });
        }
        let buckets = Buckets::new(self.num_cells(), slices_of);
        let notes: Mutex<Vec<Notes>> = Mutex::default();
        let layer = |slice: usize| {
            let lock = || notes.lock().unwrap_or_else(PoisonError::into_inner);
            let mut own = lock().pop().unwrap_or_else(|| vec![0; self.num_edges()]);
            let section = levels.section(self, slice as u32, &buckets, &mut own);
            lock().push(own);
            Layer { position: planes.positions()[slice], thickness: planes.distance(), section }
        };
        Ok(Stack::new(planes.normal(), (0..planes.len()).into_par_iter().map(layer).collect()))
    }
}

impl Levels<'_> {
    /// The polygons of one plane; `None` if no cell meets it.
    fn section(&self, slicer: &Slicer, slice: u32, buckets: &Buckets, notes: &mut Notes) -> Option<Section> {
        let num_cells = buckets.num_of(slice);
        if num_cells == 0 {
            return None;
        }
        let mut section = Section::default();
        let mut on_edges: Vec<u32> = Vec::with_capacity(2 * num_cells);
        section.corners.reserve(5 * num_cells);
        section.ends.reserve(num_cells);
        section.cells.reserve(num_cells);
        for cell in buckets.of(slice) {
            let ready = slicer.cell(cell as usize);
            let above = ready
                .nodes
                .iter()
                .enumerate()
                .fold(0, |above, (place, &node)| above | u32::from(self.of(node) > slice) << place);
            let vertex = |edge: u32| {
                let note = notes[edge as usize];
                if on_edges.get(note as usize) == Some(&edge) {
                    return note;
                }
                let vertex = on_edges.len() as u32;
                notes[edge as usize] = vertex;
                on_edges.push(edge);
                vertex
            };
            ready.cut(above, vertex, &mut section.corners, &mut section.ends);
            section.cells.resize(section.ends.len(), cell);
        }
        section.edges = on_edges.iter().map(|&edge| slicer.edges[edge as usize]).collect();
        section.weights = section.edges.iter().map(|&edge| self.weight(slice, edge)).collect();
        (!section.ends.is_empty()).then_some(section)
    }
}
