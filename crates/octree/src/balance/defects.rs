//! Which leaves break the rule of a balanced tree.

use std::fmt;

use volery_pyramid::Node;

use super::leaf::Leaf;
use crate::cut::Cut;

/// Two leaves that touch by face, edge or corner and are more than one level apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{coarse} touches {fine}, expected at most one level between them")]
pub struct Defect<N: fmt::Debug + fmt::Display> {
    /// The leaf that would have to be refined.
    pub coarse: N,
    /// The one that touches it.
    pub fine: N,
}

/// Lists the pairs of a cut, drawn and skipped nodes together, that keep it from being balanced; nothing
/// for a balanced one. Ordered by the finer node, then the coarser.
///
/// The cut is taken to be valid otherwise, which [`validate`](crate::validate::defects) tells.
pub fn defects(cut: &Cut) -> Vec<Defect<Node>> {
    let leaves: Vec<Leaf<3>> = cut.nodes.iter().chain(&cut.skipped).map(|&node| node.into()).collect();
    let as_nodes = |pair: Defect<Leaf<3>>| Defect { coarse: pair.coarse.into(), fine: pair.fine.into() };
    leaf_defects(&leaves).into_iter().map(as_nodes).collect()
}

/// Lists the pairs of leaves, none inside another, that keep a tree from being balanced; nothing for a
/// balanced one. Ordered by the finer leaf, then the coarser.
///
/// Each leaf looks up the leaf that covers each of its neighbours, with `n` leaves in `O(3^D n log n)`. It
/// shares nothing with the operation.
pub fn leaf_defects<const D: usize>(leaves: &[Leaf<D>]) -> Vec<Defect<Leaf<D>>> {
    let mut sorted = leaves.to_vec();
    sorted.sort_unstable_by(|&a, &b| a.canonical_order(b));
    let mut defects = Vec::new();
    for &fine in &sorted {
        let found = (0..3_u32.pow(D as u32)).filter_map(|direction| {
            let neighbour = neighbour(fine, direction)?;
            let after = sorted.partition_point(|leaf| leaf.canonical_order(neighbour).is_le());
            let coarse = *sorted[..after].last()?;
            (coarse.level > fine.level.saturating_add(1) && coarse.covers(neighbour)).then_some(coarse)
        });
        let mut found: Vec<_> = found.collect();
        found.sort_unstable_by(|&a, &b| a.canonical_order(b));
        found.dedup();
        defects.extend(found.into_iter().map(|coarse| Defect { coarse, fine }));
    }
    defects
}

/// One of the `3^D` nodes around and at `node`, each digit of `direction` a step of -1, 0 or 1 along an axis.
fn neighbour<const D: usize>(node: Leaf<D>, direction: u32) -> Option<Leaf<D>> {
    let (mut index, mut rest) = (node.index, direction);
    for i in &mut index {
        *i = i.checked_add_signed(rest as i32 % 3 - 1)?;
        rest /= 3;
    }
    Some(Leaf::new(node.level, index))
}
