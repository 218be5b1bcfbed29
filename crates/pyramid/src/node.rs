//! The name of a node: its level and its place among the nodes of that level.

use std::fmt;

/// A node of the tree over a pyramid. Level 0 is the finest; the root has the highest level and the index
/// `[0, 0, 0]`. Ordered by level, then x, y, z.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Node {
    /// 0 is the finest.
    pub level: u32,
    /// Which node of its level, along x, y, z.
    pub index: [u32; 3],
}

impl Node {
    /// The node `index` of `level`.
    pub const fn new(level: u32, index: [u32; 3]) -> Self {
        Self { level, index }
    }

    /// The node of the next coarser level that covers this one. The root has one too, beyond the pyramid.
    pub fn parent(self) -> Self {
        Self { level: self.level + 1, index: self.index.map(|i| i / 2) }
    }

    /// The ancestor at `level`, the node itself at its own.
    ///
    /// # Panics
    /// When `level` is finer than the node's.
    pub fn ancestor(self, level: u32) -> Self {
        let up = level.checked_sub(self.level).expect("an ancestor is not finer than its descendant");
        Self { level, index: self.index.map(|i| i.checked_shr(up).unwrap_or(0)) }
    }
}

impl fmt::Display for Node {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [i, j, k] = self.index;
        write!(f, "node ({i}, {j}, {k}) of level {}", self.level)
    }
}
