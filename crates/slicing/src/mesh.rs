//! A stack as one indexed set of triangles, ready to be drawn, stored and sent.
//!
//! # Method
//! A slice stands for a slab of matter, half a distance to either side. Where the grid ends between two planes, slabs
//! have too much or too little by up to that half, an error of first order in the distance. So the outline of the grid
//! is cut by the planes as well, and its strips carry what is missing or too much: a thickness that is an affine
//! function of the place along the normal, negative where the slab has too much. What is left is of second order.
//!
//! Every vertex, of slices and of strips, lies on an edge of the grid: two nodes and a weight. Other values at the
//! nodes (a time step) change values and gradients alone, by an interpolation.

use std::ops::Range;

use glam::DVec3;

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
    /// Vertex numbers.
    pub triangles: Vec<[u32; 3]>,
    /// What the triangles stand for, by ascending position. Together they have every triangle once.
    pub sheets: Vec<MeshSheet>,
}

/// Triangles at or around one place along the normal that stand for matter of a thickness.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshSheet {
    /// Of a slice its plane, of strips the middle between two planes; along the normal, from the origin of the mesh.
    pub position: f64,
    /// `t = thickness[0] + thickness[1] * (normal . x)` with x relative to the origin, in world lengths: of a slice
    /// `[t, 0]`, of strips with a slope of 1 or -1.
    pub thickness: [f64; 2],
    /// Its triangles.
    pub triangles: Range<u32>,
}

impl SliceMesh {
    /// The sheets from back to front, seen from a place `eye` along the normal (relative to the origin); of parallel
    /// rays an infinite one: negative where rays go along the normal.
    pub fn back_to_front(&self, eye: f64) -> impl Iterator<Item = &MeshSheet> {
        let below = self.sheets.partition_point(|sheet| sheet.position < eye);
        // Rays from the eye go up or down: neither kind meets what the other meets.
        self.sheets[below..].iter().rev().chain(&self.sheets[..below])
    }
}
