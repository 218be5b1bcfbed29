//! The cuts between two vertices of the root's hull: those in the corner that the line between them cuts off.

use volery_pyramid::Node;

use super::hull::{Point, Step};
use super::{Held, MAX_POINTS, Tradeoff};

/// What can be bought on the way from a vertex of the root's hull to the next.
pub(super) struct Found {
    vertex: usize,
    /// Bytes rising, errors falling.
    listed: Vec<Listed>,
    picks: Vec<Pick>,
    /// Whether these are all that no other beats.
    pub(super) is_whole: bool,
}

/// A cut of a subtree.
#[derive(Clone, Copy)]
struct Listed {
    point: Point,
    pick: usize,
}

/// What a cut is made of: places in a list of these.
#[derive(Clone, Copy)]
enum Pick {
    Nothing,
    Held(Held),
    /// The first comes first in canonical order.
    Both(usize, usize),
}

/// What a part of a cut may take without making the whole useless.
#[derive(Clone, Copy)]
struct Room {
    /// Of the part; it may have as many.
    bytes: u64,
    /// What it may cost more than the best of its subtree; it must be below.
    excess: u128,
}

/// Lists the cuts that fewer bytes than those of the next vertex can buy, and that are better than a vertex.
pub(super) fn search(tradeoff: &Tradeoff, vertex: usize) -> Found {
    let root = tradeoff.hulls.root();
    let step = *root.step(vertex).expect("a vertex before the last");
    let from = root.point(vertex);
    let mut search = Search { tradeoff, step, picks: vec![Pick::Nothing], is_whole: true };
    // At the corner, that is at the bytes of the next vertex and the error of this one, a point costs this much more.
    let excess = u128::from(step.bytes) * u128::from(step.error);
    let mut listed = search.list(tradeoff.layout.root(), Room { bytes: from.bytes + step.bytes - 1, excess });
    listed.retain(|cut| cut.point.error < from.error);
    Found { vertex, listed, picks: search.picks, is_whole: search.is_whole }
}

impl Found {
    /// Lists what the best cut within a budget holds; the vertex itself if there is none better.
    pub(super) fn take(&self, tradeoff: &Tradeoff, max_bytes: u64, held: &mut Vec<Held>) -> Point {
        let num_within = self.listed.partition_point(|cut| cut.point.bytes <= max_bytes);
        match num_within.checked_sub(1) {
            Some(best) => {
                self.unfold(self.listed[best].pick, held);
                self.listed[best].point
            }
            None => {
                let layout = &tradeoff.layout;
                tradeoff.hulls.take(layout, layout.root(), self.vertex, held);
                tradeoff.hulls.root().point(self.vertex)
            }
        }
    }

    fn unfold(&self, pick: usize, held: &mut Vec<Held>) {
        match self.picks[pick] {
            Pick::Nothing => {}
            Pick::Held(one) => held.push(one),
            Pick::Both(first, second) => {
                self.unfold(first, held);
                self.unfold(second, held);
            }
        }
    }
}

struct Search<'a> {
    tradeoff: &'a Tradeoff,
    /// Its slope is the price of a byte.
    step: Step,
    picks: Vec<Pick>,
    is_whole: bool,
}

impl Search<'_> {
    fn cost(&self, point: Point) -> u128 {
        u128::from(self.step.bytes) * u128::from(point.error)
            + u128::from(self.step.error) * u128::from(point.bytes)
    }

    /// The least cost of a subtree, and its fewest bytes; none if it cannot be held.
    fn least(&self, node: Node) -> Option<(u128, u64)> {
        let hull = self.tradeoff.hulls.of(&self.tradeoff.layout, node)?;
        Some((self.cost(hull.point(hull.best_at(&self.step))), hull.first.bytes))
    }

    /// The cuts of a subtree that have room, without those that others beat.
    fn list(&mut self, node: Node, room: Room) -> Vec<Listed> {
        let Some((least, _)) = self.least(node) else { return Vec::new() };
        let mut cuts = Vec::new();
        for choice in self.tradeoff.prices.of(&self.tradeoff.layout, node) {
            if choice.point.bytes <= room.bytes && self.cost(choice.point) - least < room.excess {
                let held = Held { node, resolution: choice.resolution };
                cuts.push((choice.point, Pick::Held(held)));
            }
        }
        self.list_split(node, least, room, &mut cuts);
        self.keep(cuts)
    }

    /// The cuts of a subtree by its children, added to a list.
    fn list_split(&mut self, node: Node, least: u128, room: Room, cuts: &mut Vec<(Point, Pick)>) {
        let layout = &self.tradeoff.layout;
        let children: Vec<Node> = layout.children(node).collect();
        let Some(leasts) = children.iter().map(|&child| self.least(child)).collect::<Option<Vec<_>>>() else {
            return;
        };
        let fewest_bytes: u64 = leasts.iter().map(|&(_, bytes)| bytes).sum();
        let least_split: u128 = leasts.iter().map(|&(cost, _)| cost).sum();
        if children.is_empty() || fewest_bytes > room.bytes || least_split - least >= room.excess {
            return;
        }
        let excess = room.excess - (least_split - least);
        let spare = room.bytes - fewest_bytes;
        let mut joined = vec![Listed { point: Point { bytes: 0, error: 0 }, pick: 0 }];
        let (mut joined_least, mut joined_bytes) = (0, 0);
        for (place, (&child, (least, fewest))) in children.iter().zip(leasts).enumerate() {
            let listed = self.list(child, Room { bytes: fewest + spare, excess });
            joined_least += least;
            joined_bytes += fewest;
            let mut pairs = Vec::with_capacity(joined.len() * listed.len());
            for a in &joined {
                for b in &listed {
                    let point = a.point.plus(b.point);
                    if point.bytes <= joined_bytes + spare && self.cost(point) - joined_least < excess {
                        pairs.push((point, Pick::Both(a.pick, b.pick)));
                    }
                }
            }
            if place + 1 == children.len() {
                cuts.append(&mut pairs);
            } else {
                joined = self.keep(pairs);
            }
        }
    }

    /// Those that no other beats, of these the [`MAX_POINTS`] of the least cost; bytes rising, errors falling.
    fn keep(&mut self, mut cuts: Vec<(Point, Pick)>) -> Vec<Listed> {
        // Stable: of equal points the first stays.
        cuts.sort_by_key(|(point, _)| (point.bytes, point.error));
        let mut least = u64::MAX;
        cuts.retain(|(point, _)| {
            let is_better = point.error < least;
            least = least.min(point.error);
            is_better
        });
        if cuts.len() > MAX_POINTS {
            self.is_whole = false;
            cuts.sort_by_key(|&(point, _)| (self.cost(point), point.bytes));
            cuts.truncate(MAX_POINTS);
            cuts.sort_by_key(|(point, _)| point.bytes);
        }
        let first = self.picks.len();
        self.picks.extend(cuts.iter().map(|&(_, pick)| pick));
        (first..).zip(cuts).map(|(pick, (point, _))| Listed { point, pick }).collect()
    }
}
