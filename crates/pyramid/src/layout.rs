//! Where everything in a pyramid lies: levels, nodes, their samples and their bounds.
//!
//! All positions are in *finest-sample coordinates*, in which sample `(i, j, k)` of level 0 is at
//! `(i, j, k)`; times [`Layout::spacing`] they are world positions.
//!
//! | | decimated | averaged |
//! |---|---|---|
//! | cells per axis of `n` samples | `n - 1` | `n` |
//! | samples of level `l` | `ceil((n - 1) / 2^l) + 1` | `ceil(n / 2^l)` |
//! | position of sample `i` | `i * 2^l` | `(i + 1/2) * 2^l - 1/2` |
//! | bounds of node `k`, `s = brick_cells * 2^l` | `k * s`, `(k + 1) * s` | `k * s - 1/2`, `(k + 1) * s - 1/2` |
//!
//! Bounds are clipped to the domain `[0, n - 1]`; sample positions are not, so that the samples of a level
//! stand evenly: the last of a level may lie past the domain (by less than `2^l`), and stands for the end.

use std::ops::Range;

use glam::DVec3;

use crate::brick::BrickShape;
use crate::node::Node;

/// How a coarser level is made from a finer one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Vertex aligned: a coarse sample is the finest sample at its place (LaMar).
    Decimated,
    /// Cell centred: a coarse sample is the mean of 2x2x2 finer ones (Li-Shen, Schussman-Max).
    Averaged,
}

/// Why a [`Layout`] could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// A brick size that is odd or out of range.
    #[error("brick_cells is {found}, expected an even number from 2 to {max}", max = Layout::MAX_BRICK_CELLS)]
    BrickCells {
        /// The size as given.
        found: usize,
    },
    /// An axis that is empty or longer than can be numbered.
    #[error("axis {axis} has {found} samples, expected 1 to {max}", max = Layout::MAX_AXIS)]
    Axis {
        /// 0, 1, 2 for x, y, z.
        axis: usize,
        /// Its samples as given.
        found: usize,
    },
}

/// The shape of a pyramid; see the [module](self) for where things lie.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    dims: [usize; 3],
    spacing: DVec3,
    kind: Kind,
    brick_cells: usize,
    num_levels: u32,
}

impl Layout {
    /// The largest brick.
    pub const MAX_BRICK_CELLS: usize = 1 << 12;
    /// The longest axis, in samples.
    pub const MAX_AXIS: usize = 1 << 31;

    /// The pyramid over `dims` samples, `spacing` apart in world units, whose nodes have `brick_cells`
    /// cells of their own level along each axis.
    ///
    /// # Errors
    /// When an axis is empty or too long, or `brick_cells` is odd or out of range.
    pub fn new(dims: [usize; 3], spacing: DVec3, kind: Kind, brick_cells: usize) -> Result<Self, Error> {
        if !(2..=Self::MAX_BRICK_CELLS).contains(&brick_cells) || brick_cells % 2 == 1 {
            return Err(Error::BrickCells { found: brick_cells });
        }
        if let Some(axis) = (0..3).find(|&axis| !(1..=Self::MAX_AXIS).contains(&dims[axis])) {
            return Err(Error::Axis { axis, found: dims[axis] });
        }
        let mut layout = Self { dims, spacing, kind, brick_cells, num_levels: 1 };
        while layout.nodes(layout.num_levels - 1) != [1; 3] {
            layout.num_levels += 1;
        }
        Ok(layout)
    }

    /// Finest samples along x, y, z.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// World distance of neighbouring finest samples along x, y, z.
    pub fn spacing(&self) -> DVec3 {
        self.spacing
    }

    /// How coarser levels are made.
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// Cells of its own level that a node has along each axis (fewer where the domain ends).
    pub fn brick_cells(&self) -> usize {
        self.brick_cells
    }

    /// How many levels there are; the coarsest has one node.
    pub fn num_levels(&self) -> u32 {
        self.num_levels
    }

    /// Samples of a level along x, y, z.
    pub fn level_dims(&self, level: u32) -> [usize; 3] {
        self.dims.map(|n| match self.kind {
            Kind::Decimated => (n - 1).div_ceil(1 << level) + 1,
            Kind::Averaged => n.div_ceil(1 << level),
        })
    }

    /// Nodes of a level along x, y, z.
    pub fn nodes(&self, level: u32) -> [u32; 3] {
        self.dims.map(|n| {
            let cells = match self.kind {
                Kind::Decimated => n - 1,
                Kind::Averaged => n,
            };
            // At most MAX_AXIS / 2, which fits.
            cells.div_ceil(self.brick_cells << level).max(1) as u32
        })
    }

    /// How many nodes a level has.
    pub fn num_nodes(&self, level: u32) -> usize {
        self.nodes(level).map(|n| n as usize).iter().product()
    }

    /// The node that covers all.
    pub fn root(&self) -> Node {
        Node::new(self.num_levels - 1, [0; 3])
    }

    /// Whether the pyramid has this node.
    pub fn contains(&self, node: Node) -> bool {
        node.level < self.num_levels && {
            let nodes = self.nodes(node.level);
            (0..3).all(|axis| node.index[axis] < nodes[axis])
        }
    }

    /// The place of a node in a flat array of its level's nodes, x fastest.
    #[inline]
    pub fn node_index(&self, node: Node) -> usize {
        let [nx, ny, _] = self.nodes(node.level).map(|n| n as usize);
        let [i, j, k] = node.index.map(|i| i as usize);
        (k * ny + j) * nx + i
    }

    /// The nodes of a level, x fastest.
    pub fn level_nodes(&self, level: u32) -> impl Iterator<Item = Node> + use<> {
        let [nx, ny, nz] = self.nodes(level);
        (0..nz)
            .flat_map(move |k| (0..ny).flat_map(move |j| (0..nx).map(move |i| Node::new(level, [i, j, k]))))
    }

    /// The children of a node that exist, x fastest; none at level 0. Together they cover the node.
    pub fn children(&self, node: Node) -> impl Iterator<Item = Node> + use<> {
        let level = node.level.checked_sub(1);
        let nodes = level.map_or([0; 3], |level| self.nodes(level));
        (0..8u32).filter_map(move |octant| {
            let index = std::array::from_fn(|axis| 2 * node.index[axis] + (octant >> axis & 1));
            (0..3).all(|axis| index[axis] < nodes[axis]).then(|| Node::new(level.unwrap_or(0), index))
        })
    }

    /// Finest cells that a node of `level` covers along an axis, where the domain does not end.
    fn span(&self, level: u32) -> usize {
        self.brick_cells << level
    }

    /// The finest samples that belong to a node: each belongs to exactly one node of a level.
    pub fn owned(&self, node: Node) -> [Range<usize>; 3] {
        let (span, nodes) = (self.span(node.level), self.nodes(node.level));
        std::array::from_fn(|axis| {
            let k = node.index[axis];
            let end = if k + 1 == nodes[axis] { self.dims[axis] } else { (k as usize + 1) * span };
            k as usize * span..end
        })
    }

    /// The finest samples that the field inside the closed node depends on: those on shared boundaries for
    /// the decimated kind, one more on each side for the averaged kind, whose bounds lie between samples.
    pub fn support(&self, node: Node) -> [Range<usize>; 3] {
        let span = self.span(node.level);
        std::array::from_fn(|axis| {
            let first = node.index[axis] as usize * span;
            let last = (first + span).min(self.dims[axis] - 1);
            match self.kind {
                Kind::Decimated => first..last + 1,
                Kind::Averaged => first.saturating_sub(1)..last + 1,
            }
        })
    }

    /// The closed box of a node in finest-sample coordinates, clipped to the domain: `[low, high]`.
    pub fn bounds(&self, node: Node) -> [DVec3; 2] {
        let span = self.span(node.level) as f64;
        let offset = match self.kind {
            Kind::Decimated => 0.0,
            Kind::Averaged => 0.5,
        };
        let end = self.domain();
        let low = node.index.map(|i| f64::from(i) * span - offset);
        let high = node.index.map(|i| (f64::from(i) + 1.0) * span - offset);
        [DVec3::from_array(low).max(DVec3::ZERO), DVec3::from_array(high).min(end)]
    }

    /// The closed box of a node in world units: `[low, high]`.
    pub fn world_bounds(&self, node: Node) -> [DVec3; 2] {
        self.bounds(node).map(|corner| corner * self.spacing)
    }

    /// The last finest sample; the domain is `[0, domain]` in finest-sample coordinates.
    pub fn domain(&self) -> DVec3 {
        DVec3::from_array(self.dims.map(|n| (n - 1) as f64))
    }

    /// The finest-sample coordinate of sample `index` of a level, along any axis. Neighbours are `2^level`
    /// apart.
    pub fn sample_position(&self, level: u32, index: i64) -> f64 {
        let step = (1_u64 << level) as f64;
        match self.kind {
            Kind::Decimated => index as f64 * step,
            Kind::Averaged => (index as f64 + 0.5) * step - 0.5,
        }
    }

    /// Which samples of its level a node's brick holds.
    pub fn brick_shape(&self, node: Node) -> BrickShape {
        self.block_shape(node, node.level)
    }
}
