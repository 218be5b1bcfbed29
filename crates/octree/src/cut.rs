//! A cut: the nodes that stand for the whole domain.

use std::cmp::Ordering;

use volery_pyramid::Node;

use crate::balance::Leaf;

/// Nodes that together cover the domain exactly once, some drawn, some skipped.
///
/// Both lists are in *canonical order*: that of a depth-first walk which visits children x fastest, then y,
/// then z. So the descendants of any node are neighbours in it, and equal cuts are equal lists.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Cut {
    /// The nodes to draw.
    pub nodes: Vec<Node>,
    /// The largest nodes that were skipped: nothing of them is to be seen.
    pub skipped: Vec<Node>,
}

impl Cut {
    /// How many nodes to draw at each level, finest first, up to the coarsest level that has one.
    pub fn nodes_by_level(&self) -> Vec<usize> {
        let mut counts = Vec::new();
        for node in &self.nodes {
            let level = node.level as usize;
            if counts.len() <= level {
                counts.resize(level + 1, 0);
            }
            counts[level] += 1;
        }
        counts
    }
}

/// Compares two nodes by the canonical order: by the place of their first finest descendants along the
/// walk, then coarser before finer.
pub fn canonical_order(a: Node, b: Node) -> Ordering {
    Leaf::from(a).canonical_order(Leaf::from(b))
}
