//! What planes show of a part of a node, finest cell by finest cell.
//!
//! In a finest cell the finest field is trilinear, and so are the fields of all coarser levels, whose cells it lies in.
//! Their differences are largest at its eight vertices. A mix of levels is off by the same mix of the two, at most by
//! that at the least or the greatest ratio in the cell. Only cells that a plane meets count, so that this is what
//! pixels can show and little more; it reads samples where statistics do not, so it is for the worst parts alone.

use glam::DVec3;
use volery_octree::CuttingPlanes;
use volery_octree::section::ratio;
use volery_pyramid::{Layout, Node, NodeStats};
use volery_scene::{Plane, VoxelGrid};

use super::mix;
use crate::data::BRICK_CELLS;

/// The finest cells that planes meet.
pub(crate) struct Cells<'a> {
    grid: &'a VoxelGrid,
    planes: CuttingPlanes<'a>,
}

impl<'a> Cells<'a> {
    pub(crate) fn new(grid: &'a VoxelGrid, layout: &'a Layout, planes: &[Plane]) -> Self {
        Self { grid, planes: CuttingPlanes::new(layout, planes) }
    }

    /// Visits the cells that planes meet in the box `[low, high)` of cells, which lies in `node` as it is drawn with
    /// these low corners: the range of values that a cell shows, and how far they are off, per channel. Returns how
    /// many.
    pub(crate) fn visit(
        &self,
        node: Node,
        low_corners: u8,
        [low, high]: [[usize; 3]; 2],
        mut take: impl FnMut(&[NodeStats]),
    ) -> usize {
        let mut stats =
            vec![
                NodeStats { min: 0.0, max: 0.0, mean: 0.0, std_dev: 0.0, error: 0.0, count: 0, blank: 0 };
                self.grid.sample_type().channels()
            ];
        let mut num_met = 0;
        for z in low[2]..high[2] {
            for y in low[1]..high[1] {
                for x in low[0]..high[0] {
                    let ends = [[x, y, z], self.upper([x, y, z])];
                    let corners = ends.map(|corner| DVec3::from_array(corner.map(|i| i as f64)));
                    if self.planes.may_meet(corners) {
                        self.measure(node, low_corners, ends, &mut stats);
                        take(&stats);
                        num_met += 1;
                    }
                }
            }
        }
        num_met
    }

    /// The upper corner of a cell; where there is one sample along an axis, it is the lower one.
    fn upper(&self, cell: [usize; 3]) -> [usize; 3] {
        let dims = self.grid.dims();
        std::array::from_fn(|axis| (cell[axis] + 1).min(dims[axis] - 1))
    }

    fn measure(&self, node: Node, low_corners: u8, ends: [[usize; 3]; 2], stats: &mut [NodeStats]) {
        let vertices: [[usize; 3]; 8] =
            std::array::from_fn(|corner| [0, 1, 2].map(|axis| ends[corner >> axis & 1][axis]));
        let span = (BRICK_CELLS << node.level) as f64;
        let shares = vertices.map(|vertex| {
            let local = [0, 1, 2].map(|axis| vertex[axis] as f64 / span - f64::from(node.index[axis]));
            ratio(low_corners, DVec3::from_array(local))
        });
        let [least, most] =
            shares.iter().fold([1.0_f64, 0.0_f64], |[a, b], &share| [a.min(share), b.max(share)]);
        for (channel, stats) in stats.iter_mut().enumerate() {
            let (mut min, mut max) = (f64::INFINITY, f64::NEG_INFINITY);
            let (mut high_off, mut low_off) = (0.0_f64, 0.0_f64);
            for vertex in vertices {
                let finest = self.level(0, vertex, channel);
                let mut include = |value: f64| {
                    (min, max) = (min.min(value), max.max(value));
                    let off = (value - finest).abs();
                    if off.is_nan() { f64::INFINITY } else { off }
                };
                include(finest);
                if least < 1.0 {
                    high_off = high_off.max(include(self.level(node.level, vertex, channel)));
                }
                if most > 0.0 {
                    low_off = low_off.max(include(self.level(node.level + 1, vertex, channel)));
                }
            }
            let error = mix(high_off, low_off, least).max(mix(high_off, low_off, most));
            *stats = NodeStats { min, max, error, ..*stats };
        }
    }

    /// The field of a level at a finest sample's place.
    fn level(&self, level: u32, vertex: [usize; 3], channel: usize) -> f64 {
        let dims = self.grid.dims();
        let mut sum = 0.0;
        for corner in 0..8 {
            let mut weight = 1.0;
            let mut place = 0;
            for axis in (0..3).rev() {
                let below = vertex[axis] >> level;
                let part = (vertex[axis] - (below << level)) as f64 / (1_u64 << level) as f64;
                let upper = corner >> axis & 1;
                weight *= if upper == 1 { part } else { 1.0 - part };
                // The last sample of a level stands for the end.
                place = place * dims[axis] + ((below + upper) << level).min(dims[axis] - 1);
            }
            if weight > 0.0 {
                sum += weight * self.grid.samples().value(place, channel);
            }
        }
        sum
    }
}
