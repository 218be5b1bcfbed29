//! What is known of parts of nodes: a plane meets less of a node than all of it.
//!
//! # Method
//! A node's error is the largest in 27,000 cells, and a plane meets a thirtieth of those: on noisy data the bound
//! was five times what was measured. The same statistics are kept for boxes of [`CELLS`] cells of each node's own
//! level, so that only what the planes meet counts. They are the statistics of a pyramid of smaller bricks, whose
//! levels have the same samples.
//!
//! # Costs
//! One more walk over the samples, when a largest error is first asked for. Then 13 % of a volume of bytes, since
//! level 0, which has no error, is left out.

use glam::DVec3;
use volery_octree::section::ratio;
use volery_octree::{Answer, CuttingPlanes, Filter};
use volery_pyramid::{Kind, Layout, Node, NodeSource, NodeStats, Pyramid};
use volery_scene::{Plane, VoxelGrid};

use super::cells::Cells;
use crate::data::BRICK_CELLS;

/// Cells of a part per axis.
pub(crate) const CELLS: usize = 4;

/// Parts of a node per axis.
const PARTS: u32 = (BRICK_CELLS / CELLS) as u32;

/// Statistics of the parts of all nodes above level 0.
pub(crate) struct Parts {
    grid: VoxelGrid,
    /// That of the pyramid whose nodes are the parts.
    layout: Layout,
    num_channels: usize,
    /// From level 1 up, per part, per channel.
    levels: Vec<Vec<NodeStats>>,
}

impl Parts {
    /// Of a volume whose pyramid could be built.
    pub(crate) fn new(grid: &VoxelGrid) -> Self {
        let pyramid =
            Pyramid::build(grid, Kind::Decimated, CELLS).expect("axes as long as those of a pyramid");
        let layout = pyramid.layout().clone();
        let of_level =
            |level| layout.level_nodes(level).flat_map(|part| pyramid.stats(part)).copied().collect();
        let levels = (1..layout.num_levels()).map(of_level).collect();
        Self { grid: grid.clone(), layout, num_channels: grid.sample_type().channels(), levels }
    }

    /// The parts that planes meet of a node.
    pub(crate) fn met(&self, node: Node, planes: &[Plane]) -> impl Iterator<Item = Node> {
        let mut planes = CuttingPlanes::new(&self.layout, planes);
        let first = node.index.map(|i| i * PARTS);
        let part = move |place: u32| {
            let [x, y, z] = [place % PARTS, place / PARTS % PARTS, place / PARTS.pow(2)];
            Node::new(node.level, [first[0] + x, first[1] + y, first[2] + z])
        };
        let is_met = move |part: &Node| self.layout.contains(*part) && planes.answer(*part) != Answer::Skip;
        (0..PARTS.pow(3)).map(part).filter(is_met)
    }

    /// The finest cells that planes meet.
    pub(crate) fn cells(&self, planes: &[Plane]) -> Cells<'_> {
        Cells::new(&self.grid, &self.layout, planes)
    }

    /// The finest cells of a part, from the first to behind the last.
    pub(crate) fn cell_box(&self, part: Node) -> [[usize; 3]; 2] {
        let dims = self.grid.dims();
        let end = |i: u32, axis: usize| ((i as usize * CELLS) << part.level).min((dims[axis] - 1).max(1));
        [0, 1].map(|upper| std::array::from_fn(|axis| end(part.index[axis] + upper, axis)))
    }

    /// The statistics of a part, one per channel; none at level 0.
    pub(crate) fn stats(&self, part: Node) -> Option<&[NodeStats]> {
        let level = self.levels.get((part.level as usize).checked_sub(1)?)?;
        Some(&level[self.layout.node_index(part) * self.num_channels..][..self.num_channels])
    }
}

/// The least and the greatest share that a part of a node shows of its parent's samples: at its corners.
pub(crate) fn ratios(part: Node, low_corners: u8) -> [f64; 2] {
    let low = part.index.map(|i| f64::from(i % PARTS));
    let at = |corner: usize| {
        let local = [0, 1, 2].map(|axis| (low[axis] + (corner >> axis & 1) as f64) / f64::from(PARTS));
        ratio(low_corners, DVec3::from_array(local))
    };
    let shares = (0..8).map(at);
    shares.fold([1.0, 0.0], |[least, most], share| [share.min(least), share.max(most)])
}
