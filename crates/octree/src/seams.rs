//! Cuts of several levels whose field is continuous sample by sample.
//!
//! # Method
//! Blending ([`blend`](crate::blend)) fades a whole node into its coarser neighbour, and what it shows is no longer
//! trilinear in a cell. Where cells are integrated, the field had better stay what it is: a node keeps its samples, but
//! those on a face or an edge that a coarser drawn node touches take the coarser field's values (Weiler, Westermann,
//! Hansen, Zimmerman, Ertl 2000; Li and Shen, section 3.1). On the decimated pyramid these are means of samples of the
//! same brick: a sample at an odd place of such a face or edge is the mean of its neighbours at even ones, two along an
//! edge, four across a face.
//!
//! [`seams`] says which faces and edges those are, in a bit for each direction (see there); [`joined`] finds a cut
//! whose joined field keeps a tolerance.
//!
//! # Why the field is continuous
//! Let drawn and skipped nodes together be balanced. Let `N`, `A` touch in a face or an edge `R` (or the part of one)
//! that they share. *Of one level*: whether a face or an edge is a seam depends on its place and level alone, so both
//! change the same samples to the same values. *`A` coarser by one*: `R` is a seam of `N`, which shows on it the field of
//! level `l + 1`. `A` shows that field too, since nothing of it in `R` is a seam: a node of level `l + 2` that touches
//! `A` there would touch a child of `N`'s parent, whose level is `l` at most. At a corner all levels have one sample.
//! Where the domain ends within a node, its sample `i` at level `l + 1` is sample `min(2 i, n - 1)` at level `l`, as
//! for blending.
//!
//! # What it costs
//! Let `e` be the error of the fine node, `d` that of its coarser neighbour. In the cells along the seam the field is
//! that of the fine node, plus the difference of the two fields on the seam, fading to nothing over one cell. At the
//! samples of level `l`, where the difference is largest, the finer field is exact: the difference is at most `d`. So the
//! field is off by at most `e + d`, in one layer of cells, and by `e` elsewhere; the finest level by `d` at most.

use std::collections::HashSet;

use volery_pyramid::{Layout, Node};

use crate::balance::balance;
use crate::blend::{drawn_at, touching_parents};
use crate::certify::{split, without_unseen};
use crate::cut::Cut;
use crate::select::{Answer, Filter, select};

/// A cut and its seams.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Joined {
    /// Balanced and complete.
    pub cut: Cut,
    /// Of each drawn node, as [`seams`] has them.
    pub seams: Vec<u32>,
}

impl Joined {
    /// Balances any cut and finds its seams. A cut of one level stays as it is.
    pub fn of(layout: &Layout, cut: &Cut, filter: &mut impl Filter) -> Self {
        let is_level = cut.nodes.windows(2).all(|pair| pair[0].level == pair[1].level);
        let cut = if is_level { cut.clone() } else { without_unseen(&balance(layout, cut), filter) };
        let seams = seams(layout, &cut);
        Self { cut, seams }
    }

    /// With the children of some of its nodes in their place; all nodes stay as they are where none is too coarse.
    #[must_use]
    pub fn split(&self, layout: &Layout, too_coarse: &[bool], filter: &mut impl Filter) -> Self {
        Self::of(layout, &split(layout, &self.cut, too_coarse, filter), filter)
    }
}

/// For each drawn node of `cut` its seams: the faces and edges that a coarser drawn node touches, each by the direction
/// `s` in which it lies, of -1, 0 and 1 along x, y, z: bit `(s.x + 1) + 3 (s.y + 1) + 9 (s.z + 1)`. Bits of corners mean
/// nothing.
///
/// The drawn nodes must be in canonical order, as in a valid cut.
pub fn seams(layout: &Layout, cut: &Cut) -> Vec<u32> {
    let finest = cut.nodes.iter().map(|node| node.level).min().unwrap_or(0);
    let coarser: Vec<Node> = cut.nodes.iter().copied().filter(|node| node.level > finest).collect();
    if coarser.is_empty() {
        return vec![0; cut.nodes.len()];
    }
    let seams_of = |&node: &Node| {
        let touching =
            touching_parents(layout, node).filter(|&(parent, _)| drawn_at(&coarser, parent).is_some());
        touching.fold(0, |seams, (_, corners)| seams | directions(corners))
    };
    cut.nodes.iter().map(seams_of).collect()
}

/// The directions of the faces, edges and corners all of whose corners are among these (bits `x + 2 y + 4 z`).
fn directions(corners: u8) -> u32 {
    let mut bits = 0;
    for direction in (0..27_u32).filter(|&direction| direction != 13) {
        let side = |axis: u32| direction / 3_u32.pow(axis) % 3;
        // A side of 0 has the lower corners, one of 2 the upper ones, one of 1 both.
        let has = |corner: u32| (0..3).all(|axis| side(axis) == 1 || side(axis) / 2 == corner >> axis & 1);
        let is_seam = (0..8).filter(|&corner| has(corner)).all(|corner| corners >> corner & 1 == 1);
        bits |= u32::from(is_seam) << direction;
    }
    bits
}

/// The cut whose joined field is nowhere farther than `tolerance` from the finest one, no coarser than `filter` wants;
/// see the [module](self).
///
/// `error` is how far a node's own field is from the finest one: exact, or above. Starting from the coarsest cut
/// whose nodes keep the tolerance (strictly, or have no error at all), nodes are split that balance made and that do
/// not keep it, and neighbours of nodes with which they do not keep it together, until all do. As in
/// [`certified`](crate::certified), the filter is asked again, and only [`Answer::Skip`] counts then.
pub fn joined(
    layout: &Layout,
    mut filter: impl Filter,
    error: impl Fn(Node) -> f64,
    tolerance: f64,
) -> Joined {
    let keeps = |error: f64| error == 0.0 || error < tolerance;
    let is_good = |node: Node| node.level == 0 || keeps(error(node));
    let mut cut = select(layout, |node: Node| match filter.answer(node) {
        Answer::Draw if !is_good(node) => Answer::Descend,
        answer => answer,
    });
    loop {
        let joined = Joined::of(layout, &cut, &mut filter);
        let mut too_coarse: HashSet<Node> = HashSet::new();
        for (&node, &seams) in joined.cut.nodes.iter().zip(&joined.seams) {
            if !is_good(node) {
                too_coarse.insert(node);
            }
            if seams == 0 || node.level == 0 {
                continue;
            }
            for (neighbour, _) in touching_parents(layout, node) {
                let coarser = drawn_at(&joined.cut.nodes, neighbour).map(|place| joined.cut.nodes[place]);
                too_coarse.extend(
                    coarser.filter(|&coarser| {
                        coarser.level > node.level && !keeps(error(node) + error(coarser))
                    }),
                );
            }
        }
        if too_coarse.is_empty() {
            return joined;
        }
        let too_coarse: Vec<bool> = joined.cut.nodes.iter().map(|node| too_coarse.contains(node)).collect();
        cut = split(layout, &joined.cut, &too_coarse, &mut filter);
    }
}
