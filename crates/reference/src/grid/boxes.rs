//! A tree of boxes over cells, to find those that a ray may meet.
//!
//! Cells are halved at the median of their middles along the longest side of the box around these. Boxes reach beyond
//! their cells by more than rounding can move a point, so no cell is missed that the ray meets.

use glam::DVec3;

use super::view::View;

/// Most cells of a leaf.
const LEAF: usize = 2;

/// How far boxes reach beyond their cells, relative to the size of the whole grid.
const SLACK: f64 = 1e-12;

#[derive(Debug)]
struct Node {
    low: DVec3,
    high: DVec3,
    /// The node after all those below this one.
    skip: u32,
    /// Cells of a leaf, `first..end` of the list; none of an inner node.
    first: u32,
    end: u32,
}

/// The tree; a node stands before those below it.
#[derive(Debug)]
pub(super) struct Boxes {
    nodes: Vec<Node>,
    cells: Vec<u32>,
    reach: f64,
}

impl Boxes {
    /// Over cells of these numbers and bounds.
    pub(super) fn new(cells: Vec<u32>, bounds: &[[DVec3; 2]]) -> Self {
        debug_assert_eq!(cells.len(), bounds.len());
        let mut boxes = Self { nodes: Vec::new(), cells: Vec::new(), reach: 0.0 };
        if !cells.is_empty() {
            let mut order: Vec<u32> = (0..cells.len() as u32).collect();
            boxes.add(&mut order, 0, bounds);
            boxes.cells = order.into_iter().map(|place| cells[place as usize]).collect();
            // No cell is farther from the ray's origin than twice the grid, nor are its coordinates in its frame.
            let [low, high] = [boxes.nodes[0].low, boxes.nodes[0].high];
            boxes.reach = (high - low).length().max(low.abs().max(high.abs()).max_element());
            let slack = SLACK * boxes.reach;
            for node in &mut boxes.nodes {
                node.low -= slack;
                node.high += slack;
            }
        }
        boxes
    }

    fn add(&mut self, order: &mut [u32], first: usize, bounds: &[[DVec3; 2]]) {
        let of = |place: u32| bounds[place as usize];
        let middle = |place: u32| of(place)[0] / 2.0 + of(place)[1] / 2.0;
        let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let wider = |[low, high]: [DVec3; 2], [a, b]: [DVec3; 2]| [low.min(a), high.max(b)];
        let [low, high] = order.iter().map(|&place| of(place)).fold(none, wider);
        let index = self.nodes.len();
        let (first, end) = (first as u32, (first + order.len()) as u32);
        self.nodes.push(Node { low, high, skip: 0, first, end });
        if order.len() > LEAF {
            self.nodes[index].end = first;
            let [low, high] = order.iter().map(|&place| [middle(place); 2]).fold(none, wider);
            let axis = (high - low).max_position();
            let half = order.len() / 2;
            order.select_nth_unstable_by(half, |&a, &b| middle(a)[axis].total_cmp(&middle(b)[axis]));
            let (left, right) = order.split_at_mut(half);
            self.add(left, first as usize, bounds);
            self.add(right, first as usize + half, bounds);
        }
        self.nodes[index].skip = self.nodes.len() as u32;
    }

    /// Smallest and largest corner of all; `None` if there is no cell.
    pub(super) fn bounds(&self) -> Option<[DVec3; 2]> {
        self.nodes.first().map(|root| [root.low, root.high])
    }

    /// The size of all cells together, or how far they are from the zero of coordinates: what their rounding is of.
    pub(super) fn reach(&self) -> f64 {
        self.reach
    }

    /// Calls `found` for every cell that the ray may meet, and for some more.
    pub(super) fn along(&self, view: &View, mut found: impl FnMut(u32)) {
        let inverse = view.direction.recip();
        let mut index = 0;
        while let Some(node) = self.nodes.get(index) {
            let (a, b) = ((node.low - view.origin) * inverse, (node.high - view.origin) * inverse);
            let (near, far) = (a.min(b).max_element().max(view.start), a.max(b).min_element().min(view.end));
            // Not `near <= far`: what is no number must count as met.
            if near > far {
                index = node.skip as usize;
            } else {
                self.cells[node.first as usize..node.end as usize].iter().for_each(|&cell| found(cell));
                index += 1;
            }
        }
    }
}
