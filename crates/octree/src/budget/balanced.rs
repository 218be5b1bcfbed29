//! The best balanced cut that fits in a number of bytes.
//!
//! # Why another
//! Rays want touching nodes to differ by one level at most ([`seams`](mod@crate::seams)). A [`Tradeoff`] does not know
//! that, and what balance adds to its cuts would break the budget. Here a node is held at its own level, and is split
//! together with all that its split forces.
//!
//! # Method
//! 1. *Slopes.* Of each node, from the hull of its subtree ([`super`]): the most error that a byte can save inside it,
//!    however many levels further down. (That is how the pruning of Breiman, Friedman, Olshen, Stone 1984 and Chou,
//!    Lookabaugh, Gray 1989 looks upwards; a greedy that looks at children alone is blind to what is below them.)
//! 2. *Path.* From the root on, the leaf of the steepest slope is split, and before it the nodes that
//!    [balance](mod@crate::balance) asks for: the parents of its neighbours of the same level, and so on. Each cut
//!    of the path is balanced and refines the one before, whatever the budget is.
//! 3. *Cut.* The path is followed as long as its cuts fit. From there on splits that fit are taken in the order of their
//!    slopes, as long as the cut stays below the next one of the path in bytes and is not better than it.
//!
//! # Guarantees
//! - Balanced, and never above the budget.
//! - More bytes never give a larger error, to the bit. Proof: errors are integers that are raised so that a node's is
//!   at least that of its children together, so a split never adds error. Budgets that leave the path at the same place
//!   choose from one list of cuts, each a refinement of the one before; its errors are not below that of the path's next
//!   cut, where larger budgets begin or go on from.
//! - [`Budgeted::lower_bound`] is that of cuts that need not be balanced.
//!
//! # Costs
//! Linear in the nodes for the hulls; a split costs its 26 neighbours, for each that it forces.

use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashSet};

use volery_pyramid::{Layout, Node};

use super::hull::{Hulls, Point, Prices, Step};
use super::{BudgetTooSmall, Budgeted, Held, Price, Tradeoff};

/// What every budget buys of balanced cuts.
#[derive(Clone, Debug)]
pub struct Balanced {
    tradeoff: Tradeoff,
}

impl Balanced {
    /// Takes the price of every node of the tree over `layout`, held at its own level. Errors below those of a node's
    /// children together are raised to them.
    pub fn new(layout: &Layout, mut price: impl FnMut(Node) -> Price) -> Self {
        let most_bytes = Prices::most_bytes(layout);
        let (mut prices, scale) = Prices::ask(layout, |node, resolution| {
            let own = (resolution == node.level).then(|| price(node))?;
            Some(Price { bytes: own.bytes.min(most_bytes), ..own })
        });
        prices.raise(layout);
        let hulls = Hulls::build(layout, &prices);
        Self { tradeoff: Tradeoff { layout: layout.clone(), prices, hulls, scale } }
    }

    /// Bytes of the cut that every budget begins with: the root, or what takes fewer and is no worse.
    pub fn min_bytes(&self) -> u64 {
        let mut walk = Walk::new(self);
        walk.take_free();
        walk.point.bytes
    }

    /// A balanced cut within `max_bytes`.
    ///
    /// # Errors
    /// When the budget is below [`min_bytes`](Self::min_bytes).
    pub fn cut(&self, max_bytes: u64) -> Result<Budgeted, BudgetTooSmall> {
        let mut walk = Walk::new(self);
        walk.take_free();
        if walk.point.bytes > max_bytes {
            return Err(BudgetTooSmall { max_bytes, min_bytes: walk.point.bytes });
        }
        while let Some(split) = walk.next() {
            if split.after.bytes > max_bytes {
                walk.fill(split.after, max_bytes);
                break;
            }
            walk.take(split);
        }
        let Tradeoff { layout, hulls, scale, .. } = &self.tradeoff;
        let mut held = Vec::new();
        walk.leaves(layout.root(), &mut held);
        let root = hulls.root();
        let line = root.last_within(max_bytes).map_or(0, |vertex| {
            let at = root.point(vertex);
            root.step(vertex).map_or(at.error, |step| at.error - step.gain(max_bytes - at.bytes))
        });
        let [error, lower_bound] = [walk.point.error, line].map(|units| scale.error_of(units));
        Ok(Budgeted { held, bytes: walk.point.bytes, error, lower_bound })
    }

    fn own(&self, node: Node) -> Point {
        self.tradeoff.prices.own(&self.tradeoff.layout, node)
    }
}

/// A leaf that may be split, and the steepest way on inside it.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    slope: Step,
    node: Node,
}

impl Ord for Candidate {
    /// Steeper is greater; of equal slopes the coarser node, then the one that comes first.
    fn cmp(&self, other: &Self) -> Ordering {
        let of_nodes = || self.node.level.cmp(&other.node.level).then(other.node.index.cmp(&self.node.index));
        other.slope.by_slope(&self.slope).then_with(of_nodes)
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Eq for Candidate {}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

/// Nodes that are split together.
struct Split {
    /// Each after the nodes that it lies in.
    nodes: Vec<Node>,
    /// All of the cut then.
    after: Point,
}

/// A balanced cut under way.
struct Walk<'a> {
    balanced: &'a Balanced,
    /// What was split so far.
    internal: HashSet<Node>,
    leaves: BinaryHeap<Candidate>,
    point: Point,
}

impl<'a> Walk<'a> {
    fn new(balanced: &'a Balanced) -> Self {
        let root = balanced.tradeoff.layout.root();
        let point = balanced.own(root);
        let mut walk = Self { balanced, internal: HashSet::new(), leaves: BinaryHeap::new(), point };
        walk.offer(root);
        walk
    }

    /// Lists a leaf, where something can be gained in it.
    fn offer(&mut self, node: Node) {
        let Tradeoff { layout, hulls, .. } = &self.balanced.tradeoff;
        if let Some(slope) = hulls.of(layout, node).and_then(|hull| hull.slope_of_own()) {
            self.leaves.push(Candidate { slope, node });
        }
    }

    /// The steepest leaf's split, which is then no longer listed.
    fn next(&mut self) -> Option<Split> {
        loop {
            let Candidate { node, .. } = self.leaves.pop()?;
            // Others may have forced it.
            if !self.internal.contains(&node) {
                return Some(self.split(node));
            }
        }
    }

    fn split(&self, node: Node) -> Split {
        let layout = &self.balanced.tradeoff.layout;
        let mut nodes = Vec::new();
        self.force(node, &mut nodes);
        let mut after = self.point;
        for &node in &nodes {
            let own = self.balanced.own(node);
            let children = layout.children(node).map(|child| self.balanced.own(child));
            let children = children.fold(Point { bytes: 0, error: 0 }, Point::plus);
            after = after.plus(children);
            after = Point { bytes: after.bytes - own.bytes, error: after.error - own.error };
        }
        Split { nodes, after }
    }

    /// Adds a node, after all that must be split before it.
    fn force(&self, node: Node, nodes: &mut Vec<Node>) {
        let layout = &self.balanced.tradeoff.layout;
        for neighbour in neighbours(layout, node) {
            let parent = neighbour.parent();
            let is_split = parent.level >= layout.num_levels() || self.internal.contains(&parent);
            if !is_split && !nodes.contains(&parent) {
                self.force(parent, nodes);
            }
        }
        nodes.push(node);
    }

    fn take(&mut self, split: Split) {
        self.point = split.after;
        self.internal.extend(&split.nodes);
        for &node in &split.nodes {
            let layout = &self.balanced.tradeoff.layout;
            let children: Vec<Node> = layout.children(node).collect();
            children.into_iter().for_each(|child| self.offer(child));
        }
    }

    /// Splits as long as it costs nothing.
    fn take_free(&mut self) {
        while let Some(&Candidate { node, .. }) = self.leaves.peek() {
            // Others may have forced it.
            let split = (!self.internal.contains(&node)).then(|| self.split(node));
            if split.as_ref().is_some_and(|split| split.after.bytes > self.point.bytes) {
                return;
            }
            self.leaves.pop();
            split.into_iter().for_each(|split| self.take(split));
        }
    }

    /// Takes what fits, short of the path's next cut.
    fn fill(&mut self, next: Point, max_bytes: u64) {
        while let Some(split) = self.next() {
            if split.after.bytes >= next.bytes || split.after.error < next.error {
                continue;
            }
            if split.after.bytes > max_bytes {
                return;
            }
            self.take(split);
        }
    }

    /// Lists the cut in canonical order.
    fn leaves(&self, node: Node, held: &mut Vec<Held>) {
        if self.internal.contains(&node) {
            let layout = &self.balanced.tradeoff.layout;
            layout.children(node).for_each(|child| self.leaves(child, held));
        } else {
            held.push(Held { node, resolution: node.level });
        }
    }
}

/// The nodes of the same level that touch a node, itself among them.
fn neighbours(layout: &Layout, node: Node) -> impl Iterator<Item = Node> + use<> {
    let nodes = layout.nodes(node.level);
    (0..27_u32).filter_map(move |place| {
        let mut index = node.index;
        for (axis, width) in [1, 3, 9].into_iter().enumerate() {
            index[axis] = (index[axis] + place / width % 3).checked_sub(1)?;
        }
        (0..3).all(|axis| index[axis] < nodes[axis]).then(|| Node::new(node.level, index))
    })
}
