//! Which corners of a drawn node blend into a coarser neighbour.
//!
//! # Method
//! A node of level `l` holds its own samples, *high*, and among them every second one, *low*: the samples of
//! level `l + 1` over the node, since the pyramid is decimated. It draws `(1 - r) high + r low`, both trilinear,
//! with `r` trilinear in the node from one bit per corner: set where a coarser drawn node touches that corner
//! (LaMar, Duchaineau, Hamann, Joy 2000, section 4.3). [`ratio`](crate::section::ratio) evaluates it.
//!
//! The low tiles that the paper stores beside the high ones, an eighth of their memory, are not stored: low
//! sample `i` along an axis is high sample `min(2 i, n - 1)` of the same brick, at the place of `2 i`. That it is
//! the parent's brick bit for bit, at odd ends too, is the test
//! `low_samples_are_the_parents_brick_so_the_low_tile_is_dropped`.
//!
//! # Why the drawn field is continuous
//! Let the drawn and skipped nodes of a cut together be balanced: nodes that touch differ by one level at most.
//! Let `N` and `A` be drawn nodes that touch, `R` the face, edge or corner (or the part of one) that they share.
//! All nodes are taken whole here, as if the domain did not end.
//!
//! *Same level.* `R` is a common face, edge or corner of both. Whether a corner is low depends on the place and
//! the level alone, so `N` and `A` agree on the corners of `R`, and `r` on `R` depends on no others. High of both
//! is the field of level `l` on `R`, low that of level `l + 1` (bricks have an even number of cells, so that `R`
//! lies in planes of low samples). The drawn values agree.
//!
//! *`A` coarser, of level `l + 1`.*
//! 1. All corners of `N` in `R` touch `A`. So `r = 1` for `N` on `R`, where it draws low: the field of level
//!    `l + 1`.
//! 2. Let `P` be the parent of `N`, as large as `A`. `P` and `A` are aligned and touch, so they share a whole
//!    face, edge or corner `S`, which contains `R`. Every corner of `S` is touched by a child of `P`, inside which
//!    the cut has leaves of level `l` or finer; a leaf of level `l + 2` at that corner would differ from them by
//!    two. Hence no corner of `A` in `S` is low, `r = 0` for `A` on `S`, and it draws high: the field of
//!    level `l + 1`.
//!
//! Step 2 needs the balance of the *complete* cut: the child of `P` at that corner may be skipped. But only drawn
//! nodes make corners low, so a plane in full resolution, whose skipped surroundings are coarse, shows no low
//! sample at all.
//!
//! *Where the domain ends* within a node, the node keeps the corners it would have had, beyond the end. Nodes that
//! do not exist make no corner low, and no step above asks for one: `P` exists as `N` does, and of `P`'s children
//! the one at a corner of `S` exists or the corner lies beyond the domain's end, where all nodes that touch it
//! also touch the corner's neighbour on the near side along that axis. Both fields exist as far as the nodes do:
//! the last sample of a level stands for the domain's end, at its own place beyond it, at every level alike.
//!
//! Rounding aside, that is: both sides compute `r`, high and low from different corners and cells.
//!
//! # Costs
//! At most seven binary searches per node, in the nodes that are coarser than the finest.

use volery_pyramid::{Layout, Node};

use crate::cut::{Cut, canonical_order};

/// For each drawn node of `cut` its low corners: bit `x + 2 y + 4 z` is set where a coarser drawn node touches
/// that corner.
///
/// The drawn field is continuous when all nodes of the cut, drawn and skipped, are
/// [balanced](crate::balance()). The drawn nodes must be in canonical order, as in a valid cut.
pub fn low_corners(layout: &Layout, cut: &Cut) -> Vec<u8> {
    let finest = cut.nodes.iter().map(|node| node.level).min().unwrap_or(0);
    let coarser: Vec<Node> = cut.nodes.iter().copied().filter(|node| node.level > finest).collect();
    if coarser.is_empty() {
        return vec![0; cut.nodes.len()];
    }
    cut.nodes
        .iter()
        .map(|&node| {
            let touching = touching_parents(layout, node);
            let low = touching.filter(|&(parent, _)| drawn_at(&coarser, parent).is_some());
            low.fold(0, |bits, (_, corners)| bits | corners)
        })
        .collect()
}

/// The nodes as large as the parent of `node` that touch it, and the corners of `node` where they do: up to seven,
/// one for each set of axes along which to step away from the parent.
pub(crate) fn touching_parents(layout: &Layout, node: Node) -> impl Iterator<Item = (Node, u8)> {
    let parent = node.parent();
    (1..8_u32).filter_map(move |axes| {
        let mut neighbour = parent;
        let mut corners = u8::MAX;
        for axis in (0..3).filter(|axis| axes >> axis & 1 == 1) {
            let is_upper = node.index[axis] % 2 == 1;
            let step = if is_upper { 1 } else { -1 };
            neighbour.index[axis] = parent.index[axis].checked_add_signed(step)?;
            corners &= if is_upper { UPPER_CORNERS[axis] } else { !UPPER_CORNERS[axis] };
        }
        layout.contains(neighbour).then_some((neighbour, corners))
    })
}

/// The corners (bits `x + 2 y + 4 z`) on the upper side of an axis.
const UPPER_CORNERS: [u8; 3] = [0b1010_1010, 0b1100_1100, 0b1111_0000];

/// The place, in `nodes` in canonical order, of the one that is or contains `node`.
pub(crate) fn drawn_at(nodes: &[Node], node: Node) -> Option<usize> {
    // An ancestor comes before its descendants, and before it nothing that is disjoint comes between.
    let place = nodes.partition_point(|&other| canonical_order(other, node).is_le()).checked_sub(1)?;
    let found = nodes[place];
    (found.level >= node.level && node.ancestor(found.level) == found).then_some(place)
}
