//! Semi-adaptive slicing: more planes where cells are small.
//!
//! # Method
//! Section 3.2 of Benölken and Graf: cut the grid by even planes, mark the cells that a plane met, double the
//! number of planes for the rest, and so on until all cells or a given share are met. The planes lie in the middles
//! of their slabs, so no plane comes twice, and planes that meet none of the remaining cells are not made.
//!
//! # Limits
//! A polygon of a later step stands for the thickness of that step. Summed over steps that counts thin cells more
//! than once: a cell thinner than the first distance is met by the first step with a probability that alone makes
//! its mean right, and later steps add to it. [`Slicer::mesh_adaptively`] does without that bias. The test `the_share_of_thin_cells_*` states by how much. A cell
//! without extent along the normal, or collapsed to a line, is never met.

use std::collections::BTreeSet;

use glam::DVec3;

use crate::cut;
use crate::planes::{self, Planes, extent};
use crate::slicer::Slicer;
use crate::stack::Stack;

/// What to refine until when.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refinement {
    /// Planes of the first step, at least 1.
    pub first_planes: usize,
    /// Share of the cells, blank ones aside, that are to be met, in [0, 1].
    pub share: f64,
}

/// What one step did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Distance between its planes.
    pub distance: f64,
    /// Its planes that met cells, and so are in the stack; of the first step all.
    pub num_planes: usize,
    /// Its polygons.
    pub num_polygons: usize,
    /// Cells that it met, and no step before.
    pub num_met: usize,
}

/// Why a grid could not be sliced semi-adaptively.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// The planes of a step could not be made.
    #[error(transparent)]
    Planes(#[from] planes::Error),
    /// A step would have too many polygons.
    #[error(transparent)]
    Cut(#[from] cut::Error),
    /// A share that is none.
    #[error("semi-adaptive slicing: share {found} of the cells, expected a number from 0 to 1")]
    Share {
        /// As given.
        found: f64,
    },
    /// No plane to start from.
    #[error("semi-adaptive slicing: {found} planes at first, expected 1 to {}", Planes::MAX)]
    FirstPlanes {
        /// As given.
        found: usize,
    },
}

impl Slicer {
    /// How often the number of planes is doubled at most; cells thinner than the first distance by a factor of
    /// more than a billion are taken for flat.
    pub const MAX_DOUBLINGS: u32 = 30;

    /// Slices with more planes for the cells that fewer have missed, and says what each step did.
    ///
    /// # Errors
    /// When the refinement says nothing sensible, the normal has no direction, the grid no extent, or there would
    /// be too many polygons.
    pub fn slice_adaptively(
        &self,
        normal: DVec3,
        refinement: Refinement,
    ) -> Result<(Stack, Vec<Step>), Error> {
        let planes = self.first_planes(normal, refinement)?;
        let [low, _] = extent(self.grid(), planes.normal())?;
        let mut stack = self.slice(&planes)?;
        let mut missed: Vec<bool> = (0..self.num_cells()).map(|cell| !self.is_blank(cell)).collect();
        let num_cells = missed.iter().filter(|&&missed| missed).count();
        let allowed = num_cells - (refinement.share * num_cells as f64).ceil() as usize;
        let num_met = mark_met(&stack, &mut missed);
        let mut num_missed = num_cells - num_met;
        let (distance, num_polygons) = (planes.distance(), stack.num_polygons());
        let mut steps = vec![Step { distance, num_planes: planes.len(), num_polygons, num_met }];
        for doubling in 1..=Self::MAX_DOUBLINGS {
            if num_missed <= allowed {
                break;
            }
            let distance = planes.distance() / f64::from(1u32 << doubling);
            let positions = self.positions_for(&missed, planes.normal(), low, distance);
            if positions.is_empty() {
                continue;
            }
            let finer = Planes::of_unit(planes.normal(), positions, distance)?;
            let mut added = self.slice_cells(&finer, |cell| missed[cell])?;
            added.retain(|layer| layer.section.is_some());
            let num_met = mark_met(&added, &mut missed);
            num_missed -= num_met;
            let (num_planes, num_polygons) = (added.layers().len(), added.num_polygons());
            steps.push(Step { distance, num_planes, num_polygons, num_met });
            stack.append(added);
        }
        Ok((stack, steps))
    }

    /// The planes of the first step, for a refinement that says something sensible.
    pub(crate) fn first_planes(&self, normal: DVec3, refinement: Refinement) -> Result<Planes, Error> {
        let Refinement { first_planes, share } = refinement;
        if !(0.0..=1.0).contains(&share) {
            return Err(Error::Share { found: share });
        }
        if !(1..=Planes::MAX).contains(&first_planes) {
            return Err(Error::FirstPlanes { found: first_planes });
        }
        Ok(Planes::over(self.grid(), normal, first_planes)?)
    }

    /// Middles of slabs of a thickness, the first at `low`, that lie within cells.
    fn positions_for(&self, cells: &[bool], normal: DVec3, low: f64, distance: f64) -> Vec<f64> {
        let mut slabs = BTreeSet::new();
        for cell in (0..cells.len()).filter(|&cell| cells[cell]) {
            let (_, nodes) = self.grid().cells().get(cell);
            let along = nodes.iter().map(|&node| normal.dot(self.grid().points()[node as usize]));
            let [first, last] = along.fold([f64::INFINITY, f64::NEG_INFINITY], |[first, last], position| {
                [first.min(position), last.max(position)]
            });
            let slab = |position: f64| (position - low) / distance - 0.5;
            // One that is longer has been met by planes twice as far apart, and has no polygon.
            if first < last && last - first <= 3.0 * distance {
                slabs.extend(slab(first).ceil() as u64..=slab(last) as u64);
            }
        }
        let mut positions: Vec<f64> =
            slabs.into_iter().map(|slab| low + (slab as f64 + 0.5) * distance).collect();
        positions.dedup();
        positions
    }
}

/// Takes the mark from every cell that has a polygon, and counts them.
pub(crate) fn mark_met(stack: &Stack, missed: &mut [bool]) -> usize {
    let cells = stack.sections().flat_map(|(_, section)| section.cells());
    cells.filter(|&&cell| std::mem::take(&mut missed[cell as usize])).count()
}
