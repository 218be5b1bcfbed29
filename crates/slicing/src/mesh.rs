//! A stack as one indexed set of triangles, ready to be drawn, stored and sent.
//!
//! # Method
//! A slice stands for a slab of matter, half a distance to either side. Where the grid ends between two planes, slabs
//! have too much or too little by up to that half, an error of first order in the distance. So the outline of the grid
//! is cut by the planes as well, and its strips carry what is missing or too much: a thickness that is an affine
//! function of the place along the normal, negative where the slab has too much. What is left is of second order, for
//! matter that depends on the place without steps.
//!
//! Between two planes slabs meet in the middle `m`. A ray going up (along the normal) that leaves the grid at `x` has
//! `x - m` more than the slabs know, one that comes in has `m - x`; going down it is the other way round. Summed over
//! all sheets, whatever the distances, that is the ray's length in the grid, times its cosine with the normal: convex
//! or not, with cells that no plane meets, also where cells lie over one another.
//!
//! Whether a ray leaves at a triangle is a matter of the triangle's side that it sees. Triangles of strips go around
//! the outward normal, so [`SliceMesh::orient_strips`] finds their sheets for any eye, and a stack for one normal is
//! good for rays of every direction. The sign comes from the triangle as it is drawn, its places rounded, so slivers
//! that rounding turns over cancel as well.
//!
//! Every vertex, of slices and of strips, lies on an edge of the grid: two nodes and a weight. Other values at the
//! nodes (a time step) change values and gradients alone, by an interpolation. At a plane both have the same places,
//! to the bit; a strip has one more where the diagonal of a planar face of four nodes passes the plane.
//!
//! # Limits
//! Where an eye is level with a part of the grid, a triangle of a strip that reaches from below the eye to above it
//! counts as its middle does.

use std::ops::{Add, Mul, Range};

use glam::DVec3;
use rayon::prelude::*;
use volery_scene::{Sample, Samples, for_samples};

/// Triangles of slices and of the outline's strips, over shared vertices.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SliceMesh {
    /// The unit normal of all planes.
    pub normal: DVec3,
    /// World position that points are relative to.
    pub origin: DVec3,
    /// `[x, y, z, value]` per vertex, places relative to the origin in world lengths.
    pub points: Vec<[f32; 4]>,
    /// Unit direction in which the value rises (zero where it does not), and the magnitude of its gradient per world
    /// length; one per vertex, or none at all.
    pub gradients: Vec<[f32; 4]>,
    /// The two nodes of the edge that each vertex lies on, the lower first, equal for a node itself; empty for a mesh
    /// that was read from a file.
    pub edges: Vec<[u32; 2]>,
    /// The weight of the second node of each vertex; as many as edges.
    pub weights: Vec<f32>,
    /// Positions along the normal, from the origin of the mesh and ascending, of all planes that a vertex may lie on:
    /// those of slices, and those that pass the outline alone. Empty for a mesh that was read from a file.
    pub planes: Vec<f64>,
    /// Vertex numbers; those of slices around the normal, those of strips around the outward normal of the grid.
    pub triangles: Vec<[u32; 3]>,
    /// What the triangles stand for, by ascending position. Together they have every triangle once.
    pub sheets: Vec<MeshSheet>,
    /// How many polygons the slices were; `None` for a mesh that was read from a file.
    pub num_polygons: Option<usize>,
}

/// Triangles at or around one place along the normal that stand for matter of a thickness.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshSheet {
    /// Of a slice its plane, of strips the middle between two planes; along the normal, from the origin of the mesh.
    pub position: f64,
    /// `t = thickness[0] + thickness[1] * (normal . x)` with x relative to the origin, in world lengths: of a slice
    /// `[t, 0]`, negative where its triangles take matter away from another one there, of strips with a slope of 1 or -1.
    pub thickness: [f64; 2],
    /// Its triangles.
    pub triangles: Range<u32>,
}

/// The rays of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rays {
    /// Parallel, in this direction.
    Along(DVec3),
    /// From an eye, a place in the world.
    From(DVec3),
}

/// Values that do not fit a mesh.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ValuesError {
    /// Fewer or more than one per node.
    #[error("slice mesh: {found} {what} at nodes, expected {expected}")]
    Count {
        /// Values or gradients.
        what: &'static str,
        /// How many.
        found: usize,
        /// Number of nodes; of a mesh that only has its vertices left, the least number.
        expected: usize,
    },
    /// A mesh that does not know the nodes that its vertices lie between.
    #[error("slice mesh: {found} edges and {num_weights} weights of vertices, expected {expected} of both")]
    NoEdges {
        /// Number of edges.
        found: usize,
        /// Number of weights.
        num_weights: usize,
        /// Number of vertices.
        expected: usize,
    },
}

impl MeshSheet {
    /// Whether its triangles are of the outline; else of a slice.
    pub fn is_strip(&self) -> bool {
        self.thickness[1] != 0.0
    }

    /// Whether two that follow one another are strips of one gap.
    fn is_one_gap(&self, next: &Self) -> bool {
        let is_same = self.thickness == next.thickness || self.thickness == next.thickness.map(|part| -part);
        self.is_strip() && self.triangles.end == next.triangles.start && is_same
    }

    /// Sheets in the order of a mesh's, from back to front: see [`SliceMesh::back_to_front`].
    pub fn back_to_front(sheets: &[Self], eye: f64) -> impl Iterator<Item = &Self> {
        // Rays from the eye go up or down: neither kind meets what the other meets. Only strips of the gap that the
        // eye is in may reach to both sides; nothing is nearer.
        let (below, above) = sheets.split_at(sheets.partition_point(|sheet| sheet.position < eye));
        let (near, above) = above.split_at(above.iter().take_while(|sheet| sheet.is_strip()).count());
        above.iter().rev().chain(below).chain(near.iter().rev())
    }
}

impl SliceMesh {
    /// The sheets from back to front, seen from a place `eye` along the normal (relative to the origin); of parallel
    /// rays an infinite one: negative where rays go along the normal.
    pub fn back_to_front(&self, eye: f64) -> impl Iterator<Item = &MeshSheet> {
        MeshSheet::back_to_front(&self.sheets, eye)
    }

    /// The sheets with all strips of a gap listed as two of the same triangles, the first with a thickness that rises
    /// along the normal: for those who find out for each ray which of them count.
    pub fn sheets_for_any_eye(&self) -> Vec<MeshSheet> {
        let mut sheets = Vec::with_capacity(self.sheets.len());
        for gap in self.sheets.chunk_by(MeshSheet::is_one_gap) {
            let [first, last] = [&gap[0], &gap[gap.len() - 1]];
            if !first.is_strip() {
                sheets.extend_from_slice(gap);
                continue;
            }
            let triangles = first.triangles.start..last.triangles.end;
            for sign in [first.thickness[1].signum(), -first.thickness[1].signum()] {
                let thickness = first.thickness.map(|part| part * sign);
                sheets.push(MeshSheet { thickness, triangles: triangles.clone(), ..first.clone() });
            }
        }
        sheets
    }

    /// Puts every triangle of a strip into the sheet with the slope that these rays ask for: where a ray leaves the
    /// grid, its thickness rises along the ray, where it comes in, it falls. A new mesh is oriented for rays along
    /// its normal. Triangles keep their ranges, all strips of a gap together.
    pub fn orient_strips(&mut self, rays: Rays) {
        let gaps: Vec<&[MeshSheet]> = self.sheets.chunk_by(MeshSheet::is_one_gap).collect();
        let split = |gap: &&[MeshSheet]| {
            let (first, last) = (gap.first()?, gap.last()?);
            let range = first.triangles.start as usize..last.triangles.end as usize;
            first.is_strip().then(|| {
                let triangles = self.triangles[range].iter().copied();
                triangles.partition::<Vec<_>, _>(|&triangle| self.rises(triangle, rays))
            })
        };
        let split: Vec<Option<(Vec<_>, Vec<_>)>> = gaps.par_iter().map(split).collect();
        let mut sheets = Vec::with_capacity(self.sheets.len());
        for (gap, split) in gaps.into_iter().zip(split) {
            let Some((rising, falling)) = split else {
                sheets.extend_from_slice(gap);
                continue;
            };
            let slope = gap[0].thickness[1].signum();
            let mut start = gap[0].triangles.start;
            for (sign, part) in [(slope, rising), (-slope, falling)] {
                let end = start + part.len() as u32;
                self.triangles[start as usize..end as usize].copy_from_slice(&part);
                let thickness = gap[0].thickness.map(|part| part * sign);
                if !part.is_empty() {
                    sheets.push(MeshSheet { thickness, triangles: start..end, ..gap[0].clone() });
                }
                start = end;
            }
        }
        self.sheets = sheets;
    }

    /// Whether the ray that meets a triangle of the outline leaves matter going along the normal, or comes in going
    /// against it.
    fn rises(&self, triangle: [u32; 3], rays: Rays) -> bool {
        let [a, b, c] = triangle.map(|vertex| {
            let [x, y, z, _] = self.points[vertex as usize];
            DVec3::new(f64::from(x), f64::from(y), f64::from(z))
        });
        let outward = (b - a).cross(c - a);
        let (to_plane, to_middle) = match rays {
            Rays::Along(direction) => (direction, direction),
            Rays::From(eye) => {
                let from_eye = a - (eye - self.origin);
                (from_eye, from_eye + ((b - a) + (c - a)) / 3.0)
            }
        };
        (outward.dot(to_plane) > 0.0) == (self.normal.dot(to_middle) > 0.0)
    }

    /// Other values at the nodes, and other gradients, or none: a time step. Has the bits of a new mesh.
    ///
    /// # Errors
    /// When there is not one value, or gradient, for every node that a vertex names, or the mesh names none; then
    /// nothing has changed.
    pub fn set_values(&mut self, values: &Samples, gradients: Option<&[DVec3]>) -> Result<(), ValuesError> {
        let (expected, found, num_weights) = (self.points.len(), self.edges.len(), self.weights.len());
        if found != expected || num_weights != expected {
            return Err(ValuesError::NoEdges { found, num_weights, expected });
        }
        let num_nodes =
            self.edges.par_iter().map(|edge| edge[0].max(edge[1]) as usize + 1).max().unwrap_or(0);
        check_counts(values, gradients, num_nodes)?;
        for_samples!(values, |values| self.interpolate(values));
        self.gradients = gradients.map_or_else(Vec::new, |nodes| {
            let at = self.edges.par_iter().zip(&self.weights).with_min_len(RUN);
            at.map(|(&edge, &weight)| gradient(edge.map(|node| nodes[node as usize]), weight)).collect()
        });
        Ok(())
    }

    fn interpolate<T: Sample>(&mut self, nodes: &[T]) {
        let at = self.edges.par_iter().zip(&self.weights);
        self.points.par_iter_mut().zip(at).with_min_len(RUN).for_each(|(point, (edge, &weight))| {
            let [from, to] = edge.map(|node| nodes[node as usize].channel(0));
            point[3] = between(from, to, weight) as f32;
        });
    }
}

/// Vertices that a thread takes at once at least.
pub(crate) const RUN: usize = 4096;

/// Checks for one value, and gradient, per node.
pub(crate) fn check_counts(
    values: &Samples,
    gradients: Option<&[DVec3]>,
    expected: usize,
) -> Result<(), ValuesError> {
    let found = [("values", values.len()), ("gradients", gradients.map_or(expected, <[_]>::len))];
    match found.into_iter().find(|&(_, found)| found < expected) {
        Some((what, found)) => Err(ValuesError::Count { what, found, expected }),
        None => Ok(()),
    }
}

/// What lies between two nodes at a weight of the second.
#[inline]
pub(crate) fn between<T: Add<Output = T>>(from: T, to: T, weight: f32) -> T
where
    f64: Mul<T, Output = T>,
{
    let weight = f64::from(weight);
    (1.0 - weight) * from + weight * to
}

/// Unit direction and magnitude.
fn gradient([from, to]: [DVec3; 2], weight: f32) -> [f32; 4] {
    let gradient = between(from, to, weight);
    let magnitude = gradient.length();
    if !(magnitude > 0.0 && magnitude.is_finite()) {
        return [0.0; 4];
    }
    let [x, y, z] = (gradient / magnitude).to_array();
    [x, y, z, magnitude].map(|part| part as f32)
}
