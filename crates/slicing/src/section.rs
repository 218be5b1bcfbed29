//! The polygons in which one plane meets the cells.

use std::collections::BTreeMap;

use glam::DVec3;
use volery_scene::{Samples, for_samples};

/// The polygons of one plane, over shared vertices, in the order of cells.
///
/// A vertex is a place on an edge of the grid: two nodes, the lower first, and the weight of the second. So
/// polygons know nothing of values, and new values at the nodes need no new polygons. Polygons go around the
/// plane's normal; a cell may have up to four, one that repeats nodes more. Polygons of neighbours share their
/// vertices by number.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Section {
    pub(crate) edges: Vec<[u32; 2]>,
    pub(crate) weights: Vec<f32>,
    pub(crate) corners: Vec<u32>,
    pub(crate) ends: Vec<u32>,
    pub(crate) cells: Vec<u32>,
}

impl Section {
    /// Number of polygons.
    pub fn num_polygons(&self) -> usize {
        self.ends.len()
    }

    /// Number of vertices.
    pub fn num_vertices(&self) -> usize {
        self.edges.len()
    }

    /// The nodes of the edge that each vertex lies on, the lower first.
    pub fn edges(&self) -> &[[u32; 2]] {
        &self.edges
    }

    /// The weight of the second node of each vertex, in [0, 1]; the first has the rest.
    pub fn weights(&self) -> &[f32] {
        &self.weights
    }

    /// Vertex numbers of all polygons, one polygon after another.
    pub fn corners(&self) -> &[u32] {
        &self.corners
    }

    /// Where each polygon ends in [`corners`](Self::corners).
    pub fn ends(&self) -> &[u32] {
        &self.ends
    }

    /// The cell of each polygon, ascending.
    pub fn cells(&self) -> &[u32] {
        &self.cells
    }

    /// The vertex numbers of each polygon, three or more.
    pub fn polygons(&self) -> impl ExactSizeIterator<Item = &[u32]> {
        (0..self.num_polygons()).map(|polygon| {
            let start = if polygon == 0 { 0 } else { self.ends[polygon - 1] };
            &self.corners[start as usize..self.ends[polygon] as usize]
        })
    }

    /// World positions of the vertices.
    ///
    /// # Panics
    /// When `points` are not those of the grid and too few.
    pub fn positions(&self, points: &[DVec3]) -> Vec<DVec3> {
        let position = |(edge, &weight): (&[u32; 2], &f32)| {
            let [from, to] = edge.map(|node| points[node as usize]);
            let weight = f64::from(weight);
            (1.0 - weight) * from + weight * to
        };
        self.edges.iter().zip(&self.weights).map(position).collect()
    }

    /// Values at the vertices, from values at the nodes; the first channel of colours.
    ///
    /// # Panics
    /// When there are fewer values than the grid has nodes.
    pub fn values(&self, nodes: &Samples) -> Vec<f32> {
        fn between<T: volery_scene::Sample>(section: &Section, nodes: &[T]) -> Vec<f32> {
            let value = |(edge, &weight): (&[u32; 2], &f32)| {
                let [from, to] = edge.map(|node| nodes[node as usize].channel(0));
                let weight = f64::from(weight);
                ((1.0 - weight) * from + weight * to) as f32
            };
            section.edges.iter().zip(&section.weights).map(value).collect()
        }
        for_samples!(nodes, |nodes| between(self, nodes))
    }

    /// The area of each polygon, positive around the unit normal `normal`, where `positions` are those of its
    /// vertices.
    ///
    /// # Panics
    /// When there are fewer positions than vertices.
    pub fn areas(&self, normal: DVec3, positions: &[DVec3]) -> Vec<f64> {
        let area = |polygon: &[u32]| {
            let [first, rest @ ..] = polygon else { return 0.0 };
            let from_first = |&vertex: &u32| positions[vertex as usize] - positions[*first as usize];
            let triangles = rest.windows(2);
            0.5 * triangles
                .map(|sides| normal.dot(from_first(&sides[0]).cross(from_first(&sides[1]))))
                .sum::<f64>()
        };
        self.polygons().map(area).collect()
    }

    /// The sides of polygons that no other polygon shares the opposite way; see [`Sides`].
    pub fn unmatched_sides(&self) -> Sides {
        let mut count: BTreeMap<[u32; 2], i32> = BTreeMap::new();
        for polygon in self.polygons() {
            for (at, &from) in polygon.iter().enumerate() {
                let to = polygon[(at + 1) % polygon.len()];
                *count.entry([from.min(to), from.max(to)]).or_default() += if from < to { 1 } else { -1 };
            }
        }
        let mut found = Sides::default();
        for ([low, high], count) in count {
            match count {
                0 => {}
                1 => found.open.push([low, high]),
                -1 => found.open.push([high, low]),
                _ => found.overlapping.push([low, high]),
            }
        }
        found
    }
}

/// What keeps polygons from covering a section once, as pairs of vertex numbers.
///
/// Where every polygon goes around the normal, and the open sides are the outline of the grid, the polygons have
/// neither hole nor overlap nor T-junction.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sides {
    /// Sides of one polygon that is alone there: outline, or the rim of a hole.
    pub open: Vec<[u32; 2]>,
    /// Sides that polygons pass more often one way than the other by two or more.
    pub overlapping: Vec<[u32; 2]>,
}
