//! Leaves of a quadtree or octree in any number of dimensions.

use std::cmp::Ordering;
use std::fmt;

use volery_pyramid::Node;

/// A leaf in `D` dimensions: place `index` among the nodes of `level`, whose edges are `2^level` finest
/// nodes long. [`Node`] is the same in three dimensions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Leaf<const D: usize> {
    /// 0 is the finest.
    pub level: u32,
    /// Which node of its level, along each axis.
    pub index: [u32; D],
}

impl<const D: usize> Leaf<D> {
    /// The node `index` of `level`.
    pub const fn new(level: u32, index: [u32; D]) -> Self {
        Self { level, index }
    }

    /// Compares by the order of a depth-first walk that visits children x fastest (Morton order), then
    /// coarser before finer.
    pub fn canonical_order(self, other: Self) -> Ordering {
        let mut order = Ordering::Equal;
        let mut parted = 0;
        // The coarsest level at which they part decides; there the walk goes by the last axis first.
        for axis in (0..D).rev() {
            let place = |leaf: Self| u64::from(leaf.index[axis]).checked_shl(leaf.level).unwrap_or(0);
            let (here, there) = (place(self), place(other));
            let differing = here ^ there;
            // Whether the highest bit of `differing` is above that of `parted`.
            if parted < differing && parted < (parted ^ differing) {
                parted = differing;
                order = here.cmp(&there);
            }
        }
        order.then(other.level.cmp(&self.level))
    }

    /// Whether `next` may follow in canonical order; quick where it mostly is a sibling.
    #[inline]
    pub(super) fn may_precede(self, next: Self) -> bool {
        let beyond_octant = (0..D).fold(0, |bits, axis| bits | self.index[axis] ^ next.index[axis]) >> 1;
        if self.level != next.level || beyond_octant != 0 {
            return self.canonical_order(next).is_le();
        }
        let octant = |leaf: Self| (0..D).fold(0, |bits, axis| bits | (leaf.index[axis] & 1) << axis);
        octant(self) <= octant(next)
    }

    /// The node of the next coarser level that covers this one.
    pub(super) fn parent(self) -> Self {
        Self { level: self.level + 1, index: self.index.map(|i| i >> 1) }
    }

    /// Whether `other` is this node or inside it.
    pub(super) fn covers(self, other: Self) -> bool {
        let shifted = |i: u32| i.checked_shr(self.level - other.level).unwrap_or(0);
        other.level <= self.level && other.index.map(shifted) == self.index
    }
}

impl From<Node> for Leaf<3> {
    fn from(node: Node) -> Self {
        Self { level: node.level, index: node.index }
    }
}

impl From<Leaf<3>> for Node {
    fn from(leaf: Leaf<3>) -> Self {
        Self { level: leaf.level, index: leaf.index }
    }
}

impl<const D: usize> fmt::Display for Leaf<D> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "node {:?} of level {}", self.index, self.level)
    }
}
