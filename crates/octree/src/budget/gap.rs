//! What can be bought on the way from a vertex of the root's hull to the next.

use super::GAP;
use super::hull::{Inside, Point, Step};
use super::search::{self, Cuts};
use super::{Held, Tradeoff};

/// The cuts between two vertices of the root's hull, as far as they are known.
pub(super) struct Gap {
    vertex: usize,
    /// The part of the tree in which the two vertices differ.
    inside: Inside,
    /// Bytes rising, errors falling; first the vertex itself.
    listed: Vec<(Point, Way)>,
    searched: Cuts,
    /// Whether these are all that no other beats.
    pub(super) is_whole: bool,
}

/// How to come to a cut.
#[derive(Clone, Copy)]
enum Way {
    Vertex,
    /// The vertex, with one of the points that the hull of the part leaves out.
    Inside(usize),
    /// One of the cuts of a search.
    Searched(usize),
}

impl Gap {
    /// Lists the cuts that are better than a vertex and take fewer bytes than the next.
    pub(super) fn after(tradeoff: &Tradeoff, vertex: usize) -> Self {
        let root = tradeoff.hulls.root();
        let (from, step) = (root.point(vertex), *root.step(vertex).expect("a vertex before the last"));
        let inside = tradeoff.hulls.inside(&tradeoff.layout, &tradeoff.prices, vertex);
        let mut listed = vec![(from, Way::Vertex)];
        listed.extend((0..).zip(&inside.points).map(|(place, &(point, _))| {
            let bytes = from.bytes + (point.bytes - inside.from.bytes);
            let error = from.error - (inside.from.error - point.error);
            (Point { bytes, error }, Way::Inside(place))
        }));
        let mut gap = Self { vertex, inside, listed, searched: Cuts::default(), is_whole: false };
        if !gap.is_near(from, &step) {
            gap.searched = search::cuts(tradeoff, from, step);
            gap.is_whole = gap.searched.is_whole;
            let found = (0..).zip(&gap.searched.listed).map(|(place, cut)| (cut.point, Way::Searched(place)));
            gap.listed.extend(found);
            // Stable: of equal cuts the first stays.
            gap.listed.sort_by_key(|&(point, _)| point);
            let mut least = u64::MAX;
            gap.listed.retain(|(point, _)| {
                let is_better = point.error < least;
                least = least.min(point.error);
                is_better
            });
        }
        gap
    }

    /// Whether no budget on the way would gain by a search more than a part [`GAP`] of its error.
    fn is_near(&self, from: Point, step: &Step) -> bool {
        let ends = self.listed[1..].iter().map(|(point, _)| point.bytes).chain([from.bytes + step.bytes]);
        self.listed.iter().zip(ends).all(|((point, _), end)| {
            let bound = from.error - step.gain(end - from.bytes);
            (point.error - bound) as f64 <= GAP * bound as f64
        })
    }

    /// Lists what the best cut within a budget holds. The budget is that of the vertex at least.
    pub(super) fn take(&self, tradeoff: &Tradeoff, max_bytes: u64, held: &mut Vec<Held>) -> Point {
        let num_within = self.listed.partition_point(|(point, _)| point.bytes <= max_bytes);
        let (point, way) = self.listed[num_within - 1];
        let replaced = match way {
            Way::Vertex => None,
            Way::Inside(place) => Some((self.inside.node, self.inside.points[place].1)),
            Way::Searched(place) => {
                self.searched.take(tradeoff, place, held);
                return point;
            }
        };
        tradeoff.hulls.take(&tradeoff.layout, tradeoff.layout.root(), self.vertex, replaced, held);
        point
    }
}
