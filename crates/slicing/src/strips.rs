//! Strips: the outline of cells, cut by the planes between which slices stand for its matter.
//!
//! # Method
//! A node's level, the number of planes at or below it, is also the number of the gap between planes that it lies
//! in. So a triangle has a part in every gap from the lowest level of its nodes to the highest: walking around it,
//! a side passes the planes between the levels of its ends, and the part in a gap has the nodes of that level and
//! the places where sides pass the two planes of the gap. These are the places, from the same nodes by the same
//! rounding, at which slices have their vertices. Every edge counts its places upwards, so neighbours share them by
//! number.

use rayon::prelude::*;

use crate::buckets::Buckets;
use crate::cut::Error;
use crate::levels::Levels;
use crate::outline::Outline;
use crate::slicer::Slicer;

/// The outline of cells by gaps between planes.
#[derive(Debug, Default)]
pub(crate) struct Strips {
    /// The two nodes of the edge that each vertex lies on, the lower first, equal for a node itself.
    pub(crate) edges: Vec<[u32; 2]>,
    /// The weight of the second.
    pub(crate) weights: Vec<f32>,
    /// The triangles below the first plane, then between planes, at last above the last, around the outward normal.
    pub(crate) gaps: Vec<Vec<[u32; 3]>>,
}

/// An outline between planes.
struct Cutter<'a> {
    outline: &'a Outline,
    /// Of each of its nodes.
    levels: Vec<u32>,
    /// The number of the first vertex on each edge.
    starts: Vec<u32>,
}

impl Strips {
    /// # Errors
    /// When there would be more parts of triangles than [`Slicer::MAX_SECTIONS`].
    pub(crate) fn new(outline: &Outline, levels: &Levels<'_>) -> Result<Self, Error> {
        let num_planes = levels.planes.len();
        let of_nodes: Vec<u32> = outline.nodes.iter().map(|&node| levels.of(node)).collect();
        let gaps_of = |triangle: usize| {
            let [a, b, c] = outline.triangles[triangle].map(|node| of_nodes[node as usize]);
            a.min(b).min(c)..a.max(b).max(c) + 1
        };
        let num_triangles = outline.triangles.len();
        let found = (0..num_triangles).map(|triangle| gaps_of(triangle).len() as u64).sum();
        if found > Slicer::MAX_SECTIONS {
            return Err(Error::TooManySections { found, num_planes });
        }
        let mut edges: Vec<[u32; 2]> = outline.nodes.iter().map(|&node| [node; 2]).collect();
        let mut weights = vec![0.0; edges.len()];
        let mut starts = Vec::with_capacity(outline.edges.len());
        for ends in &outline.edges {
            let [a, b] = ends.map(|node| outline.nodes[node as usize]);
            let edge = [a.min(b), a.max(b)];
            let [from, to] = edge.map(|node| levels.of(node));
            starts.push(edges.len() as u32);
            for plane in from.min(to)..from.max(to) {
                edges.push(edge);
                weights.push(levels.weight(plane, edge));
            }
        }
        let buckets = Buckets::new(num_triangles, gaps_of);
        let cutter = Cutter { outline, levels: of_nodes, starts };
        let gap = |gap: u32| {
            let mut triangles = Vec::with_capacity(2 * buckets.num_of(gap));
            buckets.of(gap).for_each(|triangle| cutter.part(triangle as usize, gap, &mut triangles));
            triangles
        };
        let gaps = (0..=num_planes as u32).into_par_iter().map(gap).collect();
        Ok(Self { edges, weights, gaps })
    }
}

impl Cutter<'_> {
    /// Appends the part of a triangle in a gap, as triangles.
    fn part(&self, triangle: usize, gap: u32, triangles: &mut Vec<[u32; 3]>) {
        // Two on each of two planes at most, and a node between.
        let (mut corners, mut count) = ([0; 5], 0);
        let mut push = |vertex: u32| {
            corners[count] = vertex;
            count += 1;
        };
        let (nodes, sides) = (self.outline.triangles[triangle], self.outline.sides[triangle]);
        for at in 0..3 {
            let [from, to] = [at, (at + 1) % 3].map(|at| self.levels[nodes[at] as usize]);
            let first = self.starts[sides[at] as usize];
            let (low, high) = (from.min(to), from.max(to));
            if from == gap {
                push(nodes[at]);
            }
            // The planes under and over the gap, where the side passes them.
            let under = (low < gap && gap <= high).then(|| first + (gap - 1 - low));
            let over = (low <= gap && gap < high).then(|| first + (gap - low));
            let passed = if from < to { [under, over] } else { [over, under] };
            passed.into_iter().flatten().for_each(&mut push);
        }
        let fan = corners[1..count.max(1)].windows(2).map(|side| [corners[0], side[0], side[1]]);
        triangles.extend(fan);
    }
}
