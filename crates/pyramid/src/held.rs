//! Nodes held at a resolution other than their own: which samples that takes, and how wrong it is.
//!
//! # Method
//! Boada, Navazo and Scopigno (section 4.1) part the size of a node from the distance of its samples: a node of
//! level `k` may be held by the samples of level `q`, finer or coarser than `k`, in a block that shares its
//! boundary with its neighbours. Their leaves are single voxels and their levels are counted from the root, so
//! their block is `(2^(q-k) + 2)^3` texels. Here level 0 is the finest and a node of any level has `B` cells of its
//! own level along an axis, so the same block has `B 2^(k-q) + 2`. That is the averaged kind's: one sample beyond
//! each bound of the node. The decimated kind has samples on the bounds, and needs no more than `B 2^(k-q) + 1`;
//! the paper's last layer only fills a texture of the size that its hardware takes.
//!
//! (The paper's "if q = k the texture is (2^1+2)^3" is no case of its formula, which gives `2^0 + 2`.)
//!
//! # Homogeneous nodes
//! The paper builds its tree by one of two criteria, and the statistics of a node hold both: (i) *all samples are
//! equal* is `max - min` within the threshold; (ii) *inner samples interpolate from the outer ones* is
//! [`held_error`] within the threshold, where the outer ones are those of the block.
//!
//! # Guarantees
//! - A block is enough for trilinear sampling anywhere in its closed node, so that neighbours of one resolution
//!   agree on their shared boundary.
//! - [`held_error`] is exact for resolutions as fine as the node or finer, an upper bound for coarser ones.
//!
//! # Non-goals
//! Which resolution to hold: that is `volery_octree::budget`.

use std::ops::RangeInclusive;

use crate::brick::BrickShape;
use crate::layout::{Kind, Layout};
use crate::node::Node;
use crate::source::NodeSource;

impl Layout {
    /// The levels at whose samples a node may be held, finest first: all that the pyramid has and whose samples the
    /// node's bounds fit.
    pub fn resolutions(&self, node: Node) -> RangeInclusive<u32> {
        let coarsest = node.level + self.brick_cells().trailing_zeros();
        0..=coarsest.min(self.num_levels() - 1)
    }

    /// Which samples of the level `resolution` hold a node; its [`brick_shape`](Self::brick_shape) at its own level.
    ///
    /// # Panics
    /// When the node cannot be held at that [resolution](Self::resolutions).
    pub fn block_shape(&self, node: Node, resolution: u32) -> BrickShape {
        let resolutions = self.resolutions(node);
        assert!(resolutions.contains(&resolution), "{node} at level {resolution}, expected {resolutions:?}");
        let cells = (self.brick_cells() << node.level) >> resolution;
        let dims = self.level_dims(resolution);
        let first_own = node.index.map(|i| i as usize * cells);
        match self.kind() {
            Kind::Decimated => BrickShape {
                first: first_own.map(|first| first as i64),
                count: std::array::from_fn(|a| (dims[a] - first_own[a]).min(cells + 1)),
            },
            Kind::Averaged => BrickShape {
                first: first_own.map(|first| first as i64 - 1),
                count: std::array::from_fn(|a| (dims[a] - first_own[a]).min(cells) + 2),
            },
        }
    }
}

/// The largest `|f~ - f|` of a channel anywhere in the closed node, where `f` is the finest field and `f~` that of the
/// level `resolution`; in units of the samples. `+∞` where one of the two is blank and the other is not.
///
/// Exact up to the node's own level: the largest error of the nodes of that level inside it. Of coarser levels it is
/// a bound, the error of the ancestor there; of the decimated kind no more than `max - min`, since its block
/// interpolates samples of the node itself.
///
/// # Panics
/// When the node cannot be held at that [resolution](Layout::resolutions), or there is no such channel.
pub fn held_error(source: &impl NodeSource, node: Node, resolution: u32, channel: usize) -> f64 {
    let layout = source.layout();
    let resolutions = layout.resolutions(node);
    assert!(resolutions.contains(&resolution), "{node} at level {resolution}, expected {resolutions:?}");
    if resolution > node.level {
        let bound = source.stats(node.ancestor(resolution))[channel].error;
        let own = source.stats(node)[channel];
        // A blank sample on the bounds is in no statistic of a finest node, but makes its ancestor infinite.
        let is_interpolation = layout.kind() == Kind::Decimated && bound.is_finite() && !own.is_blank();
        return if is_interpolation { bound.min(own.max - own.min) } else { bound };
    }
    largest_error(source, node, resolution, channel)
}

/// The largest error of the descendants at `level`.
fn largest_error(source: &impl NodeSource, node: Node, level: u32, channel: usize) -> f64 {
    if node.level == level {
        return source.stats(node)[channel].error;
    }
    let children = source.layout().children(node);
    children.map(|child| largest_error(source, child, level, channel)).fold(0.0, f64::max)
}
