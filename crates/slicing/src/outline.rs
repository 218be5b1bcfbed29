//! The outline of cells: the triangles that bound their matter.
//!
//! # Method
//! Every cell gives its faces around the outward normal. Of two cells at a face one gives it one way round and the
//! other the other way: these cancel. What is left is split into triangles, faces of four nodes as sections split
//! them, and cancels once more. What stays bounds the cells, also where faces are collapsed, where a face of four nodes meets two of
//! three, and where folded cells lie over one another (then a triangle may stay twice): on any line the signs with
//! which it leaves the outline above a place, less those with which it comes in, count the cells there.
//!
//! Triangles are gathered by their lowest node and come in the order of their nodes, whatever the order of cells.

use rayon::prelude::*;

use crate::slicer::{Slicer, number_edges};

/// Triangles that bound cells, over nodes and edges of their own numbering.
#[derive(Debug, Default)]
pub(crate) struct Outline {
    /// Nodes of the grid.
    pub(crate) nodes: Vec<u32>,
    /// Pairs of places in `nodes`.
    pub(crate) edges: Vec<[u32; 2]>,
    /// Places in `nodes`, around the outward normal.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Numbers of the edges from each corner to the next.
    pub(crate) sides: Vec<[u32; 3]>,
}

/// A face of a cell, around the outward normal from its lowest node on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Face {
    class: u32,
    lowest: u32,
    next: u32,
    /// The node across the face; [`TRIANGLE`] if there is none.
    across: u32,
    last: u32,
}

/// No node: there are at most so many points.
const TRIANGLE: u32 = u32::MAX;

impl Face {
    fn triangle(class: u32, [a, b, c]: [u32; 3]) -> Option<Self> {
        let [lowest, next, last] = match a.min(b).min(c) {
            low if low == a => [a, b, c],
            low if low == b => [b, c, a],
            _ => [c, a, b],
        };
        (a != b && b != c && c != a).then_some(Self { class, lowest, next, across: TRIANGLE, last })
    }

    /// A face of four nodes; one with nodes that repeat is a triangle or nothing.
    fn quad(class: u32, [a, b, c, d]: [u32; 4]) -> Option<Self> {
        if a == c || b == d {
            return None;
        }
        match () {
            () if a == b || b == c => Self::triangle(class, [a, c, d]),
            () if c == d || d == a => Self::triangle(class, [a, b, c]),
            () => {
                let [lowest, next, across, last] = match a.min(b).min(c).min(d) {
                    low if low == a => [a, b, c, d],
                    low if low == b => [b, c, d, a],
                    low if low == c => [c, d, a, b],
                    _ => [d, a, b, c],
                };
                Some(Self { class, lowest, next, across, last })
            }
        }
    }

    /// The same for a face of the same class and nodes, whichever way round.
    fn key(&self) -> (u64, u32, u32) {
        let [low, high] = [self.next.min(self.last), self.next.max(self.last)];
        (u64::from(low) << 32 | u64::from(high), self.across, self.class)
    }

    /// 1 one way round, -1 the other.
    fn sign(&self) -> i32 {
        if self.next < self.last { 1 } else { -1 }
    }

    /// Itself, or its halves, split as sections split it.
    fn triangles(self) -> impl Iterator<Item = Self> {
        let Self { class, lowest, next, across, last } = self;
        let [first, second] = match across {
            TRIANGLE => [Some([lowest, next, last]), None],
            _ => [Some([lowest, next, across]), Some([lowest, across, last])],
        };
        [first, second].into_iter().flatten().filter_map(move |nodes| Self::triangle(class, nodes))
    }
}

impl Outline {
    /// The outline of each of so many classes of cells: of a cell that has none, or is blank, nothing.
    pub(crate) fn of_classes(
        slicer: &Slicer,
        num_classes: usize,
        class_of: impl Fn(usize) -> Option<u32> + Sync,
    ) -> Vec<Self> {
        let num_nodes = slicer.grid().points().len();
        let run = |cells: &[usize]| {
            let mut found = Vec::with_capacity(6 * cells.len());
            for &cell in cells.iter().filter(|&&cell| !slicer.is_blank(cell)) {
                if let Some(class) = class_of(cell) {
                    slicer.for_faces(cell, |face| {
                        found.extend(match *face {
                            [a, b, c] => Face::triangle(class, [a, b, c]),
                            [a, b, c, d] => Face::quad(class, [a, b, c, d]),
                            _ => None,
                        });
                    });
                }
            }
            found
        };
        let cells: Vec<usize> = (0..slicer.num_cells()).collect();
        let faces: Vec<Vec<Face>> = cells.par_chunks(4096).map(run).collect();
        // What is left may still be a face of four nodes at two of three.
        let halves = uncancelled(num_nodes, &faces).into_iter().flat_map(Face::triangles).collect();
        let mut by_class = vec![Vec::new(); num_classes];
        for Face { class, lowest, next, last, .. } in uncancelled(num_nodes, &[halves]) {
            by_class[class as usize].push([lowest, next, last]);
        }
        let mut places = vec![u32::MAX; num_nodes];
        by_class.into_iter().map(|triangles| Self::new(triangles, &mut places)).collect()
    }

    /// Numbers nodes and edges; `places` has a place per node of the grid, each of them `u32::MAX` before and after.
    fn new(mut triangles: Vec<[u32; 3]>, places: &mut [u32]) -> Self {
        let mut nodes = Vec::new();
        for node in triangles.as_flattened_mut() {
            let place = &mut places[*node as usize];
            if *place == u32::MAX {
                *place = nodes.len() as u32;
                nodes.push(*node);
            }
            *node = *place;
        }
        nodes.iter().for_each(|&node| places[node as usize] = u32::MAX);
        let pairs = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        let pairs: Vec<[u32; 2]> = pairs.map(|[a, b]| [a.min(b), a.max(b)]).collect();
        let (edges, numbers) = number_edges(nodes.len(), &pairs);
        let sides = numbers.as_chunks().0.to_vec();
        Self { nodes, edges, triangles, sides }
    }
}

/// The faces that have no counterpart the other way round, by lowest node, then by the others.
fn uncancelled(num_nodes: usize, faces: &[Vec<Face>]) -> Vec<Face> {
    const RUN: usize = 4096;
    let mut starts = vec![0u32; num_nodes + 1];
    for face in faces.iter().flatten() {
        starts[face.lowest as usize + 1] += 1;
    }
    for node in 0..num_nodes {
        starts[node + 1] += starts[node];
    }
    let mut sorted = vec![Face::default(); starts[num_nodes] as usize];
    let mut next = starts.clone();
    for face in faces.iter().flatten() {
        let place = &mut next[face.lowest as usize];
        sorted[*place as usize] = *face;
        *place += 1;
    }
    let (mut runs, mut rest) = (Vec::new(), sorted.as_mut_slice());
    for first in (0..num_nodes).step_by(RUN) {
        let ends = &starts[first..=num_nodes.min(first + RUN)];
        let (part, others) = rest.split_at_mut((ends[ends.len() - 1] - ends[0]) as usize);
        runs.push((ends, part));
        rest = others;
    }
    let kept = runs.into_par_iter().map(|(ends, part)| {
        let mut kept = Vec::new();
        for range in ends.windows(2) {
            let bucket = &mut part[(range[0] - ends[0]) as usize..(range[1] - ends[0]) as usize];
            bucket.sort_unstable_by_key(Face::key);
            for same in bucket.chunk_by(|a, b| a.key() == b.key()) {
                let sum: i32 = same.iter().map(Face::sign).sum();
                let face = same.iter().find(|face| face.sign() == sum.signum());
                kept.extend(
                    face.iter().flat_map(|&&face| std::iter::repeat_n(face, sum.unsigned_abs() as usize)),
                );
            }
        }
        kept
    });
    kept.collect::<Vec<_>>().concat()
}
