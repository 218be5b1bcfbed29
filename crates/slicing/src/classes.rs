//! Semi-adaptive slicing for pictures: every cell by the planes that are close enough for it, its matter drawn once.
//!
//! # Method
//! Marking cells that planes happen to meet counts thin ones too often (see [`Slicer::slice_adaptively`]). Here the
//! distance between planes is halved as there, but a cell belongs to the coarsest distance that its extent along the
//! normal is not below: planes at that distance are sure to meet it, wherever they lie. All cells of one distance are
//! a class, with planes and an outline of its own, and so with strips of its own where classes meet. A line has its
//! length in each class, and so its length in the grid, whatever the shares are.
//!
//! Where only a share of the cells is to be met, the distance that reaches it is the last, and finer cells are cut by
//! its planes. If they lie between these, strips alone stand for them.
//!
//! Of a class only those planes are made that meet its cells, and the next one on either side, so that the slabs of
//! planes that do meet cells are of the class's distance.
//!
//! # Limits
//! A cell without extent along the normal belongs to the last class. Where classes meet within the grid both
//! have strips, which double the triangles there.

use glam::DVec3;
use rayon::prelude::*;
use volery_scene::Samples;

use crate::adaptive::{self, Refinement, Step, mark_met};
use crate::assemble::{self, Part};
use crate::levels::Levels;
use crate::mesh::SliceMesh;
use crate::outline::Outline;
use crate::planes::{Planes, extent};
use crate::slicer::Slicer;
use crate::strips::Strips;

/// Why a mesh could not be made semi-adaptively.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// What to refine, or the planes.
    #[error(transparent)]
    Refinement(#[from] adaptive::Error),
    /// What was cut could not become one mesh.
    #[error(transparent)]
    Mesh(#[from] assemble::Error),
}

/// Distances of planes, each half of the one before, and the cells of each.
struct Classes {
    /// Of each cell; of a blank one none.
    of_cell: Vec<Option<u32>>,
    num_classes: u32,
}

impl Slicer {
    /// A mesh with more planes for thinner cells, in which every cell's matter counts once, and what each class of
    /// cells took. `refinement` names the planes over the whole grid for the thickest cells, and the share of cells
    /// that are to be met for sure.
    ///
    /// # Errors
    /// When the refinement says nothing sensible, the normal has no direction, the grid no extent, there are fewer
    /// values or gradients than nodes, or there would be too many polygons.
    pub fn mesh_adaptively(
        &self,
        normal: DVec3,
        refinement: Refinement,
        values: &Samples,
        gradients: Option<&[DVec3]>,
    ) -> Result<(SliceMesh, Vec<Step>), Error> {
        let planes = self.first_planes(normal, refinement)?;
        let normal = planes.normal();
        let bounds = extent(self.grid(), normal).map_err(adaptive::Error::from)?;
        let extents = self.extents(normal);
        let classes = Classes::new(&extents, planes.distance(), finest(bounds), refinement.share);
        let class_of = |cell: usize| classes.of_cell[cell];
        let outlines = Outline::of_classes(self, classes.num_classes as usize, class_of);
        let mut is_left: Vec<bool> = (0..self.num_cells()).map(|cell| !self.is_blank(cell)).collect();
        let (mut parts, mut steps) = (Vec::new(), Vec::new());
        for (class, outline) in (0..classes.num_classes).zip(&outlines) {
            let planes = match class {
                0 => planes.clone(),
                _ => {
                    let distance = planes.distance() / f64::from(1u32 << class);
                    let own = |cell: usize| class_of(cell) == Some(class);
                    let positions = positions(&extents, own, bounds[0], distance);
                    Planes::of_unit(normal, positions, distance).map_err(adaptive::Error::from)?
                }
            };
            if outline.triangles.is_empty() || planes.is_empty() {
                continue;
            }
            let levels = Levels::new(self.grid(), &planes);
            let stack = self.slice_levels(&levels, |cell| class_of(cell) == Some(class));
            let stack = stack.map_err(assemble::Error::from)?;
            let strips = Strips::new(outline, &levels).map_err(assemble::Error::from)?;
            steps.push(Step {
                distance: planes.distance(),
                num_planes: stack.sections().count(),
                num_polygons: stack.num_polygons(),
                num_met: mark_met(&stack, &mut is_left),
            });
            parts.push(Part::new(stack, strips, &planes));
        }
        Ok((self.assemble(&parts, normal, values, gradients)?, steps))
    }

    /// Lowest and highest position of each cell along the normal; of a blank one the highest below the lowest.
    fn extents(&self, normal: DVec3) -> Vec<[f64; 2]> {
        let of_cell = |cell: usize| {
            let none = [f64::INFINITY, f64::NEG_INFINITY];
            if self.is_blank(cell) {
                return none;
            }
            let (_, nodes) = self.grid().cells().get(cell);
            let along = nodes.iter().map(|&node| normal.dot(self.grid().points()[node as usize]));
            along.fold(none, |[low, high], position| [low.min(position), high.max(position)])
        };
        (0..self.num_cells()).into_par_iter().map(of_cell).collect()
    }
}

impl Classes {
    /// The fewest classes, from `first` on, so that the share of cells is as long as the distance of theirs.
    fn new(extents: &[[f64; 2]], first: f64, finest: f64, share: f64) -> Self {
        let limit = (0..Slicer::MAX_DOUBLINGS).find(|&doubling| first / f64::from(2u32 << doubling) < finest);
        let limit = limit.unwrap_or(Slicer::MAX_DOUBLINGS);
        // One beyond the limit: too thin to be met for sure.
        let class = |&[low, high]: &[f64; 2]| {
            let is_long = |&class: &u32| first / f64::from(1u32 << class) <= high - low;
            (low <= high).then(|| (0..=limit).find(is_long).unwrap_or(limit + 1))
        };
        let mut of_cell: Vec<Option<u32>> = extents.par_iter().map(class).collect();
        let mut counts = vec![0usize; limit as usize + 2];
        of_cell.iter().flatten().for_each(|&class| counts[class as usize] += 1);
        let wanted = (share * counts.iter().sum::<usize>() as f64).ceil() as usize;
        let mut last = 0;
        let mut met = counts[0];
        for class in 1..=limit {
            if met >= wanted {
                break;
            }
            let count = counts[class as usize];
            met += count;
            // No finer than cells need.
            last = if count > 0 { class } else { last };
        }
        of_cell.par_iter_mut().flatten().for_each(|class| *class = last.min(*class));
        Self { of_cell, num_classes: last + 1 }
    }
}

/// The least distance that positions in these bounds can tell apart well.
fn finest([low, high]: [f64; 2]) -> f64 {
    64.0 * f64::EPSILON * low.abs().max(high.abs())
}

/// Middles of slabs of a thickness, the first at `low`, that lie within cells or next to them.
fn positions(
    extents: &[[f64; 2]],
    wanted: impl Fn(usize) -> bool + Sync,
    low: f64,
    distance: f64,
) -> Vec<f64> {
    let slabs_of = |cell: usize| {
        let [first, last] = extents[cell].map(|position| (position - low) / distance - 0.5);
        first.floor() as i64..=last.ceil() as i64
    };
    let cells = (0..extents.len()).into_par_iter().filter(|&cell| wanted(cell));
    let mut slabs: Vec<i64> = cells.flat_map_iter(slabs_of).collect();
    slabs.par_sort_unstable();
    slabs.dedup();
    let mut positions: Vec<f64> =
        slabs.into_iter().map(|slab| low + (slab as f64 + 0.5) * distance).collect();
    positions.dedup();
    positions
}
