//! Where the nodes of a grid lie between the planes of a family.

use rayon::prelude::*;
use volery_scene::UnstructuredGrid;

use crate::planes::Planes;

/// Where the nodes of a grid lie between the planes of a family.
pub(crate) struct Levels<'a> {
    pub(crate) planes: &'a Planes,
    /// Of each node along the normal.
    positions: Vec<f64>,
    /// How many planes each node is above.
    levels: Vec<u32>,
}

impl<'a> Levels<'a> {
    pub(crate) fn new(grid: &UnstructuredGrid, planes: &'a Planes) -> Self {
        let normal = planes.normal();
        let positions: Vec<f64> = grid.points().par_iter().map(|&point| normal.dot(point)).collect();
        let levels = positions.par_iter().map(|&position| planes.num_at_or_below(position)).collect();
        Self { planes, positions, levels }
    }

    /// How many planes a node is above: those with a smaller number.
    #[inline]
    pub(crate) fn of(&self, node: u32) -> u32 {
        self.levels[node as usize]
    }

    /// The weight of the second node of an edge that crosses a plane.
    #[inline]
    pub(crate) fn weight(&self, plane: u32, edge: [u32; 2]) -> f32 {
        let plane = self.planes.positions()[plane as usize];
        let [from, to] = edge.map(|node| self.positions[node as usize]);
        let weight = (plane - from) / (to - from);
        // In [0, 1], since rounding keeps order; not a number where both differences overflow.
        if weight.is_nan() { 0.0 } else { weight as f32 }
    }
}
