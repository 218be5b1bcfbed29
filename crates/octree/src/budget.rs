//! The best cut that fits in a number of bytes.
//!
//! # The problem
//! A cut covers the domain by nodes, and each node is held at one of its
//! [resolutions](volery_pyramid::Layout::resolutions), finer or coarser than its level (Boada, Navazo, Scopigno,
//! section 4.1). A caller prices what it could hold: bytes, and the error that the picture is predicted to have for
//! it. Wanted is the cut of the least error within a budget: a multiple-choice knapsack on a tree. (Mason and Blake
//! 1997 gave levels of detail that form, and a greedy; Carmona and Fröhlich 2011 an exact cut of bricks by dynamic
//! programming, to judge a greedy by.)
//!
//! *A sum, not a maximum.* The error of a cut is the sum over its nodes. The mean square of a picture is one: errors of
//! nodes that stand behind different pixels add up in squares, and so do, on average, independent ones behind the same.
//! A maximum would leave memory unused where one node cannot be better. Who wants it all the same, prices a node at
//! `e^p`: the cut of the least sum of those has a largest error at most `n^(1/p)` times the least possible, `n` being
//! the nodes of the cut that has that one, since `max e <= (sum e^p)^(1/p) <= n^(1/p) max e`.
//!
//! # Method
//! 1. *Hull* ([`Tradeoff::new`]). What a subtree can do is a set of points (bytes, error): its node at any of its
//!    resolutions, or all of its children, each at any of their points. The lower convex hull of a union is that of
//!    the hulls, and of a sum that of the sum of the hulls. So from the leaves up, each subtree's hull is *exactly* that
//!    of all its cuts, though these are exponentially many: the children's steps merged by slope, and the node's own
//!    points let in. Every vertex is a cut. Steps of one slope stay apart, so that a budget between them is used. All
//!    budgets share one hull.
//! 2. *Cut* ([`Tradeoff::cut`]). The last vertex of the root's hull that fits is an optimum for its own bytes. The line
//!    to the next bounds what any cut can do with what is left, and so how much could be gained.
//! 3. *Gap.* Two neighbours among the vertices differ in one subtree only. Between them come first the points that this
//!    subtree's hull leaves out: its other resolutions, and what its children do together. Where a budget could still
//!    gain more than [`GAP`] of its error, the cuts above the line, but below the corner of the two vertices, are
//!    searched.
//! 4. *Search.* With the line's slope as price of a byte, a choice costs its error and its bytes; what it costs more
//!    than the best of its subtree adds up over the tree, and what exceeds the height of the corner cannot be part of a
//!    better cut. Nor can what leaves too few bytes for the rest. Few choices remain; their points are listed from the
//!    leaves up, without those that others beat in both. Of a subtree at most [`MAX_POINTS`] are kept, of each of so many
//!    ranges of bytes the nearest to the line; and after a fixed number of steps the rest of the tree stays as the price
//!    of a byte has it.
//!
//! # Guarantees
//! - Never above the budget. [`Budgeted::lower_bound`] says how near the optimum an answer is. It is the optimum where
//!   the search was not cut off, and within [`GAP`] of it where none was needed.
//! - More bytes never give a larger error. Proof: budgets that have the same last vertex choose from the same list, as
//!   nothing in steps 3 and 4 depends on the budget but by the vertex; more bytes, more of the list. Every point of the
//!   list is a cut, so on or above the line, and has fewer bytes than the next vertex: so its error is above that one's,
//!   where the larger budgets begin. It holds to the bit, because errors are integers (below).
//! - Bytes that improve nothing are not spent: a homogeneous node is held at the coarsest resolution that is as good
//!   as any. A budget above everything gives the least error there is.
//! - The same bits whatever was asked before: plain recursion, in the order of the tree.
//! - Time and memory of the hull are linear in the prices, times the levels; those of a cut are bounded
//!   (`benches/budget.rs`).
//!
//! *Errors are integers.* Sums of `f64` depend on their order, and convexity is lost to rounding. Errors count in a unit
//! that is a power of two and about `2^-60` of the sum of the largest errors of all nodes, rounded up so that none but 0
//! is 0; products of bytes and errors are then exact in 128 bits. A reported error is above the exact sum by a unit a
//! node at most, and rounded to `f64`.
//!
//! *Errors that are none.* NaN and `+∞`, as of nodes with blank samples, are *unknown*: of two cuts that with less of
//! the domain unknown is better, whatever the rest (counted in finest nodes, so that splitting never makes it worse);
//! its error is `+∞`. Their presence coarsens the unit by the number of finest nodes. Errors below 0 count as 0.
//!
//! # Non-goals
//! No weights, which are a caller's and part of the price (interest, visibility; what is skipped costs nothing); 2:1
//! balance, which would spend bytes that this has already spent, is [`Balanced`]'s; no bytes moved: what of the last cut stays is for the
//! caller to see.

mod balanced;
mod fixed;
mod gap;
mod hull;
mod search;

use volery_pyramid::{Layout, Node};

pub use balanced::Balanced;
use fixed::Scale;
use gap::Gap;
use hull::{Hulls, Prices};

/// Gains below this part of the error are not searched for.
pub const GAP: f64 = 1.0 / 1024.0;

/// How many points of a subtree are kept in a search.
pub const MAX_POINTS: usize = 64;

/// What it takes to hold a node at a resolution, and what the picture loses by it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Price {
    /// Device bytes. Above `2^62` over the number of nodes they count as more than there can be.
    pub bytes: u64,
    /// Predicted error, additive over nodes: a weighted squared error, say. NaN and `+∞` are unknown, below 0 is 0.
    pub error: f64,
}

/// A node and the level whose samples hold it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Held {
    /// The part of the domain.
    pub node: Node,
    /// The level of the samples: as the node's, finer (smaller) or coarser.
    pub resolution: u32,
}

/// A cut within a budget.
#[derive(Clone, Debug, PartialEq)]
pub struct Budgeted {
    /// Covers the domain exactly once, in canonical order.
    pub held: Vec<Held>,
    /// Bytes of all; within the budget.
    pub bytes: u64,
    /// Predicted error of all, `+∞` if that of one is unknown.
    pub error: f64,
    /// No cut within the budget has an error below this one; it equals `error` where that is known to be the least.
    pub lower_bound: f64,
}

/// A part of the domain that no node can hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{node} has a price at no resolution, nor has a node around it; expected one at least")]
pub struct Uncovered {
    /// A finest node.
    pub node: Node,
}

/// A budget below that of the smallest cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a budget of {max_bytes} bytes, expected at least {min_bytes}: the smallest cut takes that many")]
pub struct BudgetTooSmall {
    /// As given.
    pub max_bytes: u64,
    /// The least that covers the domain.
    pub min_bytes: u64,
}

/// What every budget buys: the trade-off of bytes and error of all cuts of a tree.
#[derive(Clone, Debug)]
pub struct Tradeoff {
    layout: Layout,
    prices: Prices,
    hulls: Hulls,
    scale: Scale,
}

impl Tradeoff {
    /// Takes the price of every node of the tree over `layout` at each of its
    /// [resolutions](Layout::resolutions); `None` where a node cannot be held so.
    ///
    /// # Errors
    /// When a part of the domain cannot be held by any node.
    pub fn new(layout: &Layout, price: impl FnMut(Node, u32) -> Option<Price>) -> Result<Self, Uncovered> {
        let (prices, scale) = Prices::ask(layout, price);
        let hulls = Hulls::build(layout, &prices);
        match hulls.uncovered(layout) {
            Some(node) => Err(Uncovered { node }),
            None => Ok(Self { layout: layout.clone(), prices, hulls, scale }),
        }
    }

    /// The least bytes that cover the domain.
    pub fn min_bytes(&self) -> u64 {
        self.hulls.root().first.bytes
    }

    /// The bytes that give the least error there is: more are of no use.
    pub fn max_bytes(&self) -> u64 {
        self.hulls.root().last().bytes
    }

    /// A cut within `max_bytes`, near the one of the least error or it; see the [module](self).
    ///
    /// # Errors
    /// When the budget is below [`min_bytes`](Self::min_bytes).
    pub fn cut(&self, max_bytes: u64) -> Result<Budgeted, BudgetTooSmall> {
        let root = self.hulls.root();
        let Some(vertex) = root.last_within(max_bytes) else {
            return Err(BudgetTooSmall { max_bytes, min_bytes: root.first.bytes });
        };
        let (at, mut held) = (root.point(vertex), Vec::new());
        let (point, lower_bound) = match root.step(vertex) {
            None => {
                self.hulls.take(&self.layout, self.layout.root(), vertex, None, &mut held);
                (at, at.error)
            }
            Some(step) => {
                let gap = Gap::after(self, vertex);
                let point = gap.take(self, max_bytes, &mut held);
                let line = at.error - step.gain(max_bytes - at.bytes);
                (point, if gap.is_whole { point.error } else { line })
            }
        };
        let [error, lower_bound] = [point.error, lower_bound].map(|units| self.scale.error_of(units));
        Ok(Budgeted { held, bytes: point.bytes, error, lower_bound })
    }
}
