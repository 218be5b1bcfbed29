//! Where a ray is inside a cell.
//!
//! The surface of a cell is made of triangles; a face of four nodes is split at its node of the lowest number, so the
//! cells on both sides split it alike. Which triangles the ray meets is decided exactly ([`side`]), hence for all
//! cells without contradiction; how far away it meets one is computed from the nodes in the order of their numbers,
//! so both cells get the same bits. Between neighbours there is neither gap nor overlap, whichever face, edge or node
//! the ray runs through.
//!
//! The ray is inside where it has entered the surface more or less often than it has left it: cells may be inverted
//! or turn back on themselves.

use std::cmp::Ordering;

use glam::DVec3;
use volery_scene::CellType;

use super::shape::local_nodes;
use super::view::{area, side};

/// A cell in the frame of a ray; of the arrays as many entries count as the cell has nodes.
pub(super) struct SeenCell<'a> {
    pub(super) cell_type: CellType,
    pub(super) nodes: &'a [u32],
    pub(super) places: [DVec3; 8],
    pub(super) values: [f64; 8],
}

/// Where the ray passes a cell's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Passage {
    /// Along the ray.
    pub(super) t: f64,
    /// The corners of the triangle that is passed, and their weights there.
    corners: [usize; 3],
    weights: [f64; 3],
    /// Local coordinates, linear in the triangle: right on triangles and parallelograms.
    pub(super) local: DVec3,
    /// 1 where the ray crosses the triangle clockwise, else -1.
    turn: i32,
}

impl Passage {
    /// What is linear in the triangle, given what it is at the nodes.
    pub(super) fn mix(&self, of: impl Fn(usize) -> f64) -> f64 {
        self.corners.into_iter().zip(self.weights).map(|(corner, weight)| weight * of(corner)).sum()
    }
}

/// A stretch of a ray inside a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stretch {
    pub(super) cell: u32,
    pub(super) enter: Passage,
    pub(super) leave: Passage,
}

impl SeenCell<'_> {
    /// Calls `found` for each stretch of the ray inside the cell, in order; `cell` is its number.
    pub(super) fn stretches(&self, cell: u32, mut found: impl FnMut(Stretch)) {
        if self.is_aside() {
            return;
        }
        // A triangle is passed at most once, and there are at most two for each of six faces.
        let mut passages = [None; 12];
        let mut count = 0;
        self.triangles(|triangle| {
            if let Some(passage) = self.passage(triangle) {
                passages[count] = Some(passage);
                count += 1;
            }
        });
        let passages = &mut passages[..count];
        passages.sort_by(|a: &Option<Passage>, b| match (a, b) {
            (Some(a), Some(b)) => a.t.total_cmp(&b.t),
            _ => Ordering::Equal,
        });
        let (mut winding, mut entered) = (0, None);
        for passage in passages.iter().flatten() {
            winding += passage.turn;
            match entered {
                None => entered = Some(*passage),
                Some(enter) if winding == 0 => {
                    found(Stretch { cell, enter, leave: *passage });
                    entered = None;
                }
                Some(_) => {}
            }
        }
    }

    /// Moves the cell across the ray, its middle nearer to it.
    pub(super) fn move_nearer(&mut self, distance: f64) {
        let places = &mut self.places[..self.nodes.len()];
        let middle: DVec3 = places.iter().sum();
        let shift = middle.with_z(0.0).normalize_or_zero() * distance;
        places.iter_mut().for_each(|place| *place -= shift);
    }

    /// Whether all nodes lie to one side of the ray, as is most often so.
    fn is_aside(&self) -> bool {
        let places = &self.places[..self.nodes.len()];
        let all = |is: fn(&DVec3) -> bool| places.iter().all(is);
        all(|p| p.x > 0.0) || all(|p| p.x < 0.0) || all(|p| p.y > 0.0) || all(|p| p.y < 0.0)
    }

    fn triangles(&self, mut found: impl FnMut([usize; 3])) {
        for face in self.cell_type.faces() {
            match **face {
                [a, b, c] => found([a, b, c].map(usize::from)),
                [a, b, c, d] => {
                    let [a, b, c, d] = [a, b, c, d].map(usize::from);
                    let lowest = |a: usize, b: usize| self.nodes[a].min(self.nodes[b]);
                    let halves = if lowest(a, c) <= lowest(b, d) {
                        [[a, b, c], [a, c, d]]
                    } else {
                        [[b, c, d], [b, d, a]]
                    };
                    halves.into_iter().for_each(&mut found);
                }
                _ => {}
            }
        }
    }

    fn passage(&self, corners: [usize; 3]) -> Option<Passage> {
        let [a, b, c] = corners.map(|corner| self.places[corner]);
        let turn = side(a, b);
        if turn == Ordering::Equal || side(b, c) != turn || side(c, a) != turn {
            return None;
        }
        let mut corners = corners;
        corners.sort_unstable_by_key(|&corner| self.nodes[corner]);
        let places = corners.map(|corner| self.places[corner]);
        let weights: [f64; 3] = std::array::from_fn(|i| area(places[(i + 1) % 3], places[(i + 2) % 3]).abs());
        let sum = weights[0] + weights[1] + weights[2];
        // Edge-on to the last bit: anywhere in the triangle is right.
        let weights = if sum > 0.0 { weights.map(|weight| weight / sum) } else { [1.0 / 3.0; 3] };
        let local = local_nodes(self.cell_type);
        let mut passage = Passage { t: 0.0, corners, weights, local: DVec3::ZERO, turn: turn as i32 };
        passage.t = passage.mix(|corner| self.places[corner].z);
        passage.local = DVec3::from_array([0, 1, 2].map(|axis| passage.mix(|corner| local[corner][axis])));
        Some(passage)
    }
}
