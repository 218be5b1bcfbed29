//! 2:1 balance: the coarsest refinement of a tree whose touching leaves differ by at most one level.
//!
//! # Method
//! Leaves *touch* when they share a face, an edge or a corner. Look at the nodes that a tree refines, its
//! *internal* nodes, in place of its leaves. The children of an internal node are leaves or finer, so the
//! tree is balanced exactly when
//!
//! > for every internal node, the parents of its neighbours of the same level are internal,
//!
//! its own parent among them. That rule only ever adds nodes, coarser ones than those that ask for them. So
//! the smallest set that obeys it and holds the internal nodes of the input is unique, and one sweep from the
//! finest level to the root finds it: at each level, add the parents of the neighbours of all that is there.
//! The coarsest balanced refinement replaces each leaf by its part of that tree.
//!
//! A level's set is a sorted list of blocks of 64 nodes (4^3 or 8^2), a bit each. The neighbours of a box are
//! the product of those along each axis, so shifts along one axis after the other turn a block into the
//! parents of all its neighbours: a window that meets `2^D` blocks of the next level. These are sorted and
//! merged. Leaves in canonical order read the blocks in order; nothing is searched twice.
//!
//! # Prior work
//! That the coarsest balanced refinement is unique, and that the sweep from the finest level finds it, is
//! known: Sundar, Sampath, Biros 2008 ("Bottom-up construction and 2:1 balance refinement of linear octrees
//! in parallel") balance blocks and ripple between them; Isaac, Burstedde, Ghattas 2012 ("Low-cost parallel
//! algorithms for 2:1 octree balance", in p4est) work on one leaf per family and rebuild what lies between.
//! Both insert and sort octants one by one, for machines with distributed memory. Here one memory holds the
//! tree, sets are bits, and only blocks are ever sorted.
//!
//! # Guarantees
//! - The result is balanced, refines the input, and no balanced refinement is coarser. Integers only.
//! - It does not depend on the order of the input or the number of threads, and a second balance changes
//!   nothing.
//! - Any box is a domain: where it is no power of two, children outside do not exist. An extent of 1 takes
//!   an axis away. Up to 32 levels.
//! - No input panics. A leaf outside the box stays as it is and asks for nothing; a gap stays, but passes on
//!   what it is asked for; of leaves inside one another, each is replaced by its own part of the tree.
//!
//! # Cost
//! Linear in the leaves before and after, apart from the sorting of the blocks of each level, of which there
//! are at most `2^D` per internal node, and some fifty times fewer than leaves where a surface is refined.
//! Unsorted input is sorted first. Working memory is 32 bytes for each block. All passes over leaves and
//! blocks use the current rayon pool. The bench `balance` gives leaves per second.
//!
//! # Non-goals
//! Balance over faces alone; domains that wrap around; trees in distributed memory.

mod block;
mod defects;
mod internal;
mod leaf;

use std::borrow::Cow;

use rayon::prelude::*;
use volery_pyramid::Layout;

pub use defects::{Defect, defects, leaf_defects};
pub use leaf::Leaf;

use crate::cut::Cut;
use internal::{Internal, Named};

/// The coarsest balanced refinement of a cut, drawn and skipped nodes taken together. What comes out of a
/// drawn node is drawn, what comes out of a skipped one is skipped; both lists are in canonical order.
///
/// A valid cut stays valid. See the [module](self) for what becomes of others.
pub fn balance(layout: &Layout, cut: &Cut) -> Cut {
    let mut internal = Internal::<3>::none(layout.nodes(0));
    let nodes = added(&mut internal, &cut.nodes);
    let skipped = added(&mut internal, &cut.skipped);
    internal.balance();
    Cut { nodes: internal.refine(&nodes), skipped: internal.refine(&skipped) }
}

/// The coarsest balanced refinement of the leaves of a tree over a box of `extent` finest nodes, in canonical
/// order. In one, two or three dimensions; others do not compile.
///
/// The leaves need no common root: trees side by side are balanced with each other.
///
/// ```
/// use volery_octree::balance::{Leaf, balance_leaves};
///
/// // A quadtree over 8 x 8, refined to the finest level beside the centre, in the lower left quarter.
/// let mut leaves: Vec<Leaf<2>> = [[1, 0], [0, 1], [1, 1]].map(|index| Leaf::new(2, index)).into();
/// leaves.extend([[0, 0], [1, 0], [0, 1]].map(|index| Leaf::new(1, index)));
/// leaves.extend([[2, 2], [3, 2], [2, 3], [3, 3]].map(|index| Leaf::new(0, index)));
///
/// let balanced = balance_leaves([8, 8], &leaves);
/// assert_eq!(balanced.len(), 3 * 4 + 3 + 4, "the three large ones were refined");
/// assert_eq!(balanced[0], Leaf::new(1, [0, 0]));
/// ```
pub fn balance_leaves<const D: usize>(extent: [u32; D], leaves: &[Leaf<D>]) -> Vec<Leaf<D>> {
    let mut internal = Internal::none(extent);
    let leaves = added(&mut internal, leaves);
    internal.balance();
    internal.refine(&leaves)
}

/// Adds the parents of `leaves` to `internal`; returns the leaves in canonical order.
fn added<'a, const D: usize, T: Named<D>>(internal: &mut Internal<D>, leaves: &'a [T]) -> Cow<'a, [T]> {
    if internal.add_parents(leaves) {
        return Cow::Borrowed(leaves);
    }
    let mut sorted = leaves.to_vec();
    sorted.par_sort_unstable_by(|&a, &b| a.into().canonical_order(b.into()));
    Cow::Owned(sorted)
}
