//! A search of the cuts in the corner that a step of the root's hull cuts off.

use volery_pyramid::Node;

use super::hull::{Point, Step};
use super::{Held, MAX_POINTS, Tradeoff};

/// How many points of the root's first children together are kept.
const MAX_JOINED: usize = 256;

/// Pairs of cuts that are looked at in a search, or as many in nodes; then subtrees are no longer searched.
const MAX_WORK: usize = 1 << 18;

/// What a visit of a node costs beside its pairs, in pairs.
const VISIT_WORK: usize = 32;

/// Cuts of the whole tree.
#[derive(Default)]
pub(super) struct Cuts {
    /// Bytes rising, errors falling.
    pub(super) listed: Vec<Listed>,
    picks: Vec<Pick>,
    /// Whether these are all that no other beats.
    pub(super) is_whole: bool,
}

/// A cut of a subtree.
#[derive(Clone, Copy)]
pub(super) struct Listed {
    pub(super) point: Point,
    pick: u32,
}

/// What a cut is made of: places in a list of these.
#[derive(Clone, Copy)]
enum Pick {
    Nothing,
    Held(Held),
    /// A vertex of a subtree's hull.
    Vertex(Node, usize),
    /// Places before this one; the first comes first in canonical order.
    Both([u32; 2]),
}

/// A cut of a subtree before it is known to be kept: two picks together.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Candidate {
    point: Point,
    parts: [u32; 2],
}

/// The place of [`Pick::Nothing`].
const NOTHING: u32 = 0;

/// What a part of a cut may take without making the whole useless.
#[derive(Clone, Copy)]
struct Room {
    /// Of the part; it may have as many.
    bytes: u64,
    /// What it may cost more than the best of its subtree; it must be below.
    excess: u128,
}

/// The least cost of a subtree.
#[derive(Clone, Copy)]
struct Least {
    cost: u128,
    /// A vertex that has it, and its point.
    vertex: usize,
    point: Point,
    /// The fewest bytes of any cut of the subtree.
    fewest_bytes: u64,
}

/// Lists the cuts better than a vertex of the root's hull, `from`, that take fewer bytes than the next, `step` away.
pub(super) fn cuts(tradeoff: &Tradeoff, from: Point, step: Step) -> Cuts {
    let mut search = Search { tradeoff, step, picks: vec![Pick::Nothing], work: 0, is_whole: true };
    // At the corner, that is at the bytes of the next vertex and the error of this one, a point costs this much more.
    let excess = u128::from(step.bytes) * u128::from(step.error);
    let mut listed = search.list(tradeoff.layout.root(), Room { bytes: from.bytes + step.bytes - 1, excess });
    listed.retain(|cut| cut.point.error < from.error);
    Cuts { listed, picks: search.picks, is_whole: search.is_whole }
}

impl Cuts {
    /// Lists what the cut at a place holds.
    pub(super) fn take(&self, tradeoff: &Tradeoff, place: usize, held: &mut Vec<Held>) {
        self.unfold(tradeoff, self.listed[place].pick, held);
    }

    fn unfold(&self, tradeoff: &Tradeoff, pick: u32, held: &mut Vec<Held>) {
        match self.picks[pick as usize] {
            Pick::Nothing => {}
            Pick::Held(one) => held.push(one),
            Pick::Vertex(node, vertex) => tradeoff.hulls.take(&tradeoff.layout, node, vertex, None, held),
            Pick::Both([first, second]) => {
                self.unfold(tradeoff, first, held);
                self.unfold(tradeoff, second, held);
            }
        }
    }
}

struct Search<'a> {
    tradeoff: &'a Tradeoff,
    /// Its slope is the price of a byte.
    step: Step,
    picks: Vec<Pick>,
    /// Pairs looked at so far.
    work: usize,
    is_whole: bool,
}

impl Search<'_> {
    fn cost(&self, point: Point) -> u128 {
        let product = |x: u64, y: u64| u128::from(x) * u128::from(y);
        product(self.step.bytes, point.error) + product(self.step.error, point.bytes)
    }

    /// None where the subtree cannot be held.
    fn least(&self, node: Node) -> Option<Least> {
        let hull = self.tradeoff.hulls.of(&self.tradeoff.layout, node)?;
        let vertex = hull.best_at(&self.step);
        let point = hull.point(vertex);
        Some(Least { cost: self.cost(point), vertex, point, fewest_bytes: hull.first.bytes })
    }

    /// The cuts of a subtree that have room, without those that others beat.
    fn list(&mut self, node: Node, room: Room) -> Vec<Listed> {
        let Some(least) = self.least(node) else { return Vec::new() };
        self.work += VISIT_WORK;
        if self.work > MAX_WORK {
            self.is_whole = false;
            let fits = least.point.bytes <= room.bytes;
            let best = fits.then(|| self.candidate(least.point, Pick::Vertex(node, least.vertex)));
            return self.keep(best.into_iter().collect(), MAX_POINTS);
        }
        let mut cuts = Vec::new();
        for choice in self.tradeoff.prices.of(&self.tradeoff.layout, node) {
            if choice.point.bytes <= room.bytes && self.cost(choice.point) - least.cost < room.excess {
                let held = Held { node, resolution: choice.resolution };
                cuts.push(self.candidate(choice.point, Pick::Held(held)));
            }
        }
        self.list_split(node, least.cost, room, &mut cuts);
        let is_root = node == self.tradeoff.layout.root();
        self.keep(cuts, if is_root { usize::MAX } else { MAX_POINTS })
    }

    fn candidate(&mut self, point: Point, pick: Pick) -> Candidate {
        self.picks.push(pick);
        Candidate { point, parts: [self.picks.len() as u32 - 1, NOTHING] }
    }

    /// The cuts of a subtree by its children, added to a list.
    fn list_split(&mut self, node: Node, least: u128, room: Room, cuts: &mut Vec<Candidate>) {
        let layout = &self.tradeoff.layout;
        let root = layout.root();
        let children: Vec<Node> = layout.children(node).collect();
        let Some(leasts) = children.iter().map(|&child| self.least(child)).collect::<Option<Vec<_>>>() else {
            return;
        };
        let fewest_bytes: u64 = leasts.iter().map(|least| least.fewest_bytes).sum();
        let least_split: u128 = leasts.iter().map(|least| least.cost).sum();
        if children.is_empty() || fewest_bytes > room.bytes || least_split - least >= room.excess {
            return;
        }
        let excess = room.excess - (least_split - least);
        let spare = room.bytes - fewest_bytes;
        let mut joined = vec![Listed { point: Point { bytes: 0, error: 0 }, pick: NOTHING }];
        let (mut joined_least, mut joined_bytes) = (0, 0);
        for (place, (&child, least)) in children.iter().zip(leasts).enumerate() {
            let listed = self.list(child, Room { bytes: least.fewest_bytes + spare, excess });
            self.work += joined.len() * listed.len();
            joined_least += least.cost;
            joined_bytes += least.fewest_bytes;
            let mut pairs = Vec::with_capacity(joined.len() * listed.len());
            for a in &joined {
                for b in &listed {
                    let point = a.point.plus(b.point);
                    if point.bytes <= joined_bytes + spare && self.cost(point) - joined_least < excess {
                        pairs.push(Candidate { point, parts: [a.pick, b.pick] });
                    }
                }
            }
            if place + 1 == children.len() {
                cuts.append(&mut pairs);
            } else {
                joined = self.keep(pairs, if node == root { MAX_JOINED } else { MAX_POINTS });
            }
        }
    }

    /// Those that no other beats, of these [`thin`](Self::thin)ly at most so many; bytes rising, errors falling.
    fn keep(&mut self, mut cuts: Vec<Candidate>, most: usize) -> Vec<Listed> {
        // By bytes, then errors; of equal points by which was found first.
        cuts.sort_unstable();
        let mut least = u64::MAX;
        cuts.retain(|cut| {
            let is_better = cut.point.error < least;
            least = least.min(cut.point.error);
            is_better
        });
        if cuts.len() > most {
            self.is_whole = false;
            self.thin(&mut cuts, most);
        }
        let first = self.picks.len() as u32;
        self.picks.extend(cuts.iter().map(|cut| Pick::Both(cut.parts)));
        (first..).zip(cuts).map(|(pick, cut)| Listed { point: cut.point, pick }).collect()
    }

    /// Keeps of each of so many ranges of bytes the cut of the least cost.
    fn thin(&self, cuts: &mut Vec<Candidate>, num_ranges: usize) {
        let first = cuts[0].point.bytes;
        let width = (cuts[cuts.len() - 1].point.bytes - first) / num_ranges as u64 + 1;
        let range_of = |cut: &Candidate| (cut.point.bytes - first) / width;
        let mut kept: Vec<Candidate> = Vec::with_capacity(num_ranges);
        for &cut in cuts.iter() {
            match kept.last_mut() {
                Some(last) if range_of(last) == range_of(&cut) => {
                    if self.cost(cut.point) < self.cost(last.point) {
                        *last = cut;
                    }
                }
                _ => kept.push(cut),
            }
        }
        *cuts = kept;
    }
}
