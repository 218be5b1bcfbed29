//! What can be wrong with a cut.

use volery_pyramid::{Layout, Node};

use crate::cut::{Cut, canonical_order};

/// One thing that is wrong with a cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Defect {
    /// A node that the tree does not have.
    #[error("{node} is outside the tree")]
    Outside {
        /// The node.
        node: Node,
    },
    /// A node that is listed more than once, drawn or skipped.
    #[error("{node} is listed more than once")]
    Duplicate {
        /// The node.
        node: Node,
    },
    /// A node inside another one of the cut.
    #[error("{inner} lies inside {outer}")]
    Overlap {
        /// The coarser node.
        outer: Node,
        /// The finer node.
        inner: Node,
    },
    /// A part of the domain that is neither drawn nor skipped.
    #[error("{node} is not covered")]
    Gap {
        /// The largest node that is missing as a whole.
        node: Node,
    },
    /// A list that is not in canonical order.
    #[error("{node} comes too late in the canonical order")]
    Order {
        /// The first node of a list that belongs before its predecessor.
        node: Node,
    },
}

/// Lists everything that is wrong with a cut of the tree over `layout`; nothing for a valid one.
pub fn defects(layout: &Layout, cut: &Cut) -> Vec<Defect> {
    let mut defects = Vec::new();
    for list in [&cut.nodes, &cut.skipped] {
        let late = list.windows(2).find(|pair| canonical_order(pair[0], pair[1]).is_gt());
        defects.extend(late.map(|pair| Defect::Order { node: pair[1] }));
    }
    let (mut inside, outside): (Vec<Node>, Vec<Node>) =
        cut.nodes.iter().chain(&cut.skipped).partition(|&&node| layout.contains(node));
    defects.extend(outside.into_iter().map(|node| Defect::Outside { node }));
    inside.sort_by(|&a, &b| canonical_order(a, b));
    defects.extend(
        inside.windows(2).filter(|pair| pair[0] == pair[1]).map(|pair| Defect::Duplicate { node: pair[0] }),
    );
    inside.dedup();
    cover(layout, layout.root(), &inside, &mut defects);
    defects
}

/// Checks that `nodes`, all inside `node` and in canonical order, cover it once.
fn cover(layout: &Layout, node: Node, nodes: &[Node], defects: &mut Vec<Defect>) {
    let Some((&first, rest)) = nodes.split_first() else {
        defects.push(Defect::Gap { node });
        return;
    };
    if first == node {
        defects.extend(rest.iter().map(|&inner| Defect::Overlap { outer: node, inner }));
        return;
    }
    let mut nodes = nodes;
    for child in layout.children(node) {
        let inside = |other: &Node| other.level <= child.level && other.ancestor(child.level) == child;
        let (here, after) = nodes.split_at(nodes.partition_point(inside));
        cover(layout, child, here, defects);
        nodes = after;
    }
}
