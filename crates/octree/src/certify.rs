//! Cuts whose drawn, blended field keeps a bound everywhere.
//!
//! # Method
//! A caller knows, for each node, a bound on how far its field is from the finest one (in values, or in colours after
//! a transfer function): its own field, and where it blends into a coarser neighbour, what it shows of its parent's as
//! well. Starting from the coarsest cut whose nodes keep the bound by themselves, repeat until nothing changes:
//!
//! 1. balance, so that blending closes all seams, and leave out what is not to be seen;
//! 2. split the nodes whose own bound is too large (the children that balance made may be worse than their
//!    parent), and the coarser neighbours of a node whose bound is too large with what it shows of its parent.
//!
//! Each round splits a node and none is merged, so that this ends, with everything at level 0 at the latest,
//! where no node is coarse.
//!
//! # Guarantees
//! - Every drawn node above level 0 keeps `max_bound`, and so does the blending of every node; [`Certified::bound`] is
//!   the largest bound of all that is drawn.
//! - The cut is complete and balanced; the low corners are those of [`low_corners`].
//!
//! # How a caller bounds a blend
//! A node shows `f + d` with `d = (1 - r) d_high + r d_low`. Let `e_high`, `e_low` be the errors of the two fields, and
//! `X_high` within `X_low` the ranges in which the finest and the shown values lie. Then `f` and `f + d` are in
//! `X_low`, and `|d| <= (1 - r) e_high + r e_low`, which is largest at an end of the range of `r`.
//!
//! Who knows no `r` can still take, of any `b(X, e)` that holds for `f` and `f + d` in `X`, `|d| <= e`, the larger of
//! `b(X_high, e_high)` and `b(X_low, e_low)`, the parent's own bound. If `f + d` is in `X_high`, one of the two
//! applies, whichever error is larger. If not, say `f + d` is above `X_high`: then `f + d_high` is not, so `f + d_low`
//! is beyond `f + d`, and `|d| <= |d_low| <= e_low` with both values in `X_low`.

use std::collections::HashMap;

use volery_pyramid::{Layout, Node};

use crate::balance::balance;
use crate::blend::{drawn_at, low_corners, touching_parents};
use crate::cut::{Cut, canonical_order};
use crate::select::{Answer, Filter, select};

/// A cut that keeps a bound.
#[derive(Clone, Debug, PartialEq)]
pub struct Certified {
    /// Balanced and complete.
    pub cut: Cut,
    /// Of each drawn node.
    pub low_corners: Vec<u8>,
    /// The largest bound of what is drawn; 0 if nothing is. Above the bound asked for only where the finest level
    /// itself is.
    pub bound: f64,
}

/// The cut that keeps `max_bound`, no coarser than `filter` wants; see the [module](self).
///
/// `bound` is asked once for a node and the corners at which it shows its parent's samples, 0 for none. The filter is asked again for the children of nodes that it wanted drawn, and
/// for nodes that it was asked for before; of those answers only [`Answer::Skip`] counts. A bound that is NaN is kept
/// by no coarse node, an infinite one by none either, whatever `max_bound` is.
pub fn certified(
    layout: &Layout,
    mut filter: impl Filter,
    bound: impl FnMut(Node, u8) -> f64,
    max_bound: f64,
) -> Certified {
    let mut bounds = Bounds { bound, known: HashMap::new(), max_bound };
    let first = |node: Node| match filter.answer(node) {
        Answer::Draw if !bounds.keeps(node, 0) => Answer::Descend,
        answer => answer,
    };
    let mut cut = select(layout, first);
    loop {
        cut = without_unseen(&balance(layout, &cut), &mut filter);
        let low_corners = low_corners(layout, &cut);
        let too_coarse = too_coarse(layout, &cut, &low_corners, &mut bounds);
        if !too_coarse.contains(&true) {
            let drawn = cut.nodes.iter().zip(&low_corners);
            let bound = drawn.map(|(&node, &low)| bounds.get(node, low)).fold(0.0, f64::max);
            return Certified { cut, low_corners, bound };
        }
        cut = split(layout, &cut, &too_coarse, &mut filter);
    }
}

/// Moves the drawn nodes that a filter skips to those skipped.
///
/// Balancing splits nodes without knowing what is to be seen of them; this leaves out again what is not. What the
/// nodes cover, and so their balance, stays.
#[must_use]
pub fn without_unseen(cut: &Cut, filter: &mut impl Filter) -> Cut {
    let (unseen, nodes): (Vec<Node>, Vec<Node>) =
        cut.nodes.iter().partition(|&&node| filter.answer(node) == Answer::Skip);
    let mut skipped = [unseen, cut.skipped.clone()].concat();
    // Two sorted runs, which the sort finds and merges.
    skipped.sort_by(|&a, &b| canonical_order(a, b));
    Cut { nodes, skipped }
}

/// Bounds of nodes and their low corners, each asked for once.
struct Bounds<F> {
    bound: F,
    known: HashMap<(Node, u8), f64>,
    max_bound: f64,
}

impl<F: FnMut(Node, u8) -> f64> Bounds<F> {
    fn get(&mut self, node: Node, low_corners: u8) -> f64 {
        *self.known.entry((node, low_corners)).or_insert_with(|| (self.bound)(node, low_corners))
    }

    fn keeps(&mut self, node: Node, low_corners: u8) -> bool {
        let bound = self.get(node, low_corners);
        let is_finest = node.level == 0 && low_corners == 0;
        is_finest || (bound <= self.max_bound && bound < f64::INFINITY)
    }
}

/// Which drawn nodes must be split.
fn too_coarse<F: FnMut(Node, u8) -> f64>(
    layout: &Layout,
    cut: &Cut,
    low_corners: &[u8],
    bounds: &mut Bounds<F>,
) -> Vec<bool> {
    let mut too_coarse = vec![false; cut.nodes.len()];
    for (place, (&node, &low)) in cut.nodes.iter().zip(low_corners).enumerate() {
        too_coarse[place] |= !bounds.keeps(node, 0);
        if low != 0 && !bounds.keeps(node, low) {
            for (neighbour, _) in touching_parents(layout, node) {
                if let Some(coarser) = drawn_at(&cut.nodes, neighbour) {
                    too_coarse[coarser] = true;
                }
            }
        }
    }
    too_coarse
}

/// Replaces nodes by their children, as a walk that comes by them would.
pub(crate) fn split(layout: &Layout, cut: &Cut, too_coarse: &[bool], filter: &mut impl Filter) -> Cut {
    let mut result = Cut { nodes: Vec::with_capacity(cut.nodes.len()), skipped: cut.skipped.clone() };
    for (&node, &splits) in cut.nodes.iter().zip(too_coarse) {
        if splits {
            for child in layout.children(node) {
                let list = match filter.answer(child) {
                    Answer::Skip => &mut result.skipped,
                    Answer::Draw | Answer::Descend => &mut result.nodes,
                };
                list.push(child);
            }
        } else {
            result.nodes.push(node);
        }
    }
    result.skipped.sort_by(|&a, &b| canonical_order(a, b));
    result
}
