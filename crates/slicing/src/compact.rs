//! A mesh as its cause: quantised nodes of the grid, and which edge and plane each vertex lies on.
//!
//! # Method
//! Of a mesh with 256 slices every node of the grid is seen by a handful of vertices, and places, values and
//! gradients of all of them follow from it. So nodes are quantised, to the 12 bytes of [`QuantizedMesh`], and a
//! vertex is a pair of nodes and a plane; where it lies between the two follows from their distances from the plane.
//! [`expand`](CompactMesh::expand) makes the vertices of that, in a pass over them.
//!
//! Triangles are put into an order in which they reuse vertices while these are fresh, sheet by sheet (Forsyth's, as
//! meshoptimizer has it), and vertices, planes and nodes into that of their first use. That makes [`code`](crate::code)
//! small, and drawing faster.
//!
//! # Guarantees
//! - The mesh is that of a grid whose nodes have moved by half a step of each axis at most, rounded to whole steps: a
//!   vertex is off the exact one across its edge by a step, along its edge by a step over the sine of the edge's
//!   slope against the plane, and never leaves its edge. Its value is off by a step and what the place makes of it.
//! - Vertices on the same edge and plane are one, all others stay apart: what was watertight is, and strips share
//!   the vertices of slices. Triangles keep their orientation.
//! - The same bits on every machine and for any number of threads: f64 with the four operations and the square root.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use glam::DVec3;
use meshoptimizer_rs::{Limits, Workspace, optimize_vertex_cache};
use rayon::prelude::*;
use volery_scene::{Samples, for_samples};

use crate::mesh::{MeshSheet, RUN, SliceMesh, ValuesError, check_counts};
use crate::quantize::{self, Quantization, QuantizedMesh, STEPS};

/// Vertices on edges between quantised nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CompactMesh {
    /// The unit normal of all planes.
    pub normal: DVec3,
    /// World position that nodes are relative to.
    pub origin: DVec3,
    /// What the numbers of nodes mean.
    pub quantization: Quantization,
    /// `[x, y, z, value]` per node.
    pub nodes: Vec<[u16; 4]>,
    /// Gradients at the nodes, as in a [`QuantizedMesh`]; one per node, or none at all.
    pub gradients: Vec<[i8; 4]>,
    /// Positions of planes along the normal, relative to the origin.
    pub planes: Vec<f64>,
    /// Places of vertices.
    pub vertices: Vec<Place>,
    /// Vertex numbers.
    pub triangles: Vec<[u32; 3]>,
    /// As those of a [`SliceMesh`].
    pub sheets: Vec<MeshSheet>,
}

/// Where a vertex lies: where the edge between two nodes passes a plane, or at a node.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    /// The lower node, then the higher; equal for a node itself.
    pub nodes: [u32; 2],
    /// The plane; 0 for a node itself.
    pub plane: u32,
}

/// Why a mesh could not be made compact.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// Places or values that cannot be quantised.
    #[error(transparent)]
    Quantize(#[from] quantize::Error),
    /// Values that do not fit the nodes, or a mesh that does not know its edges.
    #[error(transparent)]
    Values(#[from] ValuesError),
    /// A vertex between nodes that lies on no plane of the mesh.
    #[error("compact mesh: vertex {vertex} at {found} along the normal, expected it on a plane")]
    Plane {
        /// Its number.
        vertex: usize,
        /// Its position.
        found: f64,
    },
    /// Sheets that do not come one after another, or have not every triangle.
    #[error("compact mesh: a sheet of the triangles {found:?}, expected one from {expected} on")]
    Sheets {
        /// Its triangles.
        found: Range<u32>,
        /// The first triangle that no sheet before it has.
        expected: u32,
    },
    /// A triangle or a vertex that names what does not exist.
    #[error("compact mesh: {what} {found}, expected at most {expected}")]
    Number {
        /// What has the number.
        what: &'static str,
        /// The number.
        found: u32,
        /// The greatest there is.
        expected: usize,
    },
}

/// How far from its plane a vertex may lie, as a part of the greatest distance from the origin: a few
/// roundings to `f32`.
const OFF_PLANE: f64 = 1e-6;

impl CompactMesh {
    /// From a mesh, and what it was made of: places of the grid's nodes, values, and gradients where it has any.
    ///
    /// # Errors
    /// When there are fewer places, values or gradients than nodes, the mesh does not know its edges, a vertex is on
    /// no plane, or the numbers cannot be quantised.
    pub fn new(
        mesh: &SliceMesh,
        points: &[DVec3],
        values: &Samples,
        gradients: Option<&[DVec3]>,
    ) -> Result<Self, Error> {
        let (expected, found, num_weights) = (mesh.points.len(), mesh.edges.len(), mesh.weights.len());
        if found != expected || num_weights != expected {
            return Err(ValuesError::NoEdges { found, num_weights, expected }.into());
        }
        check_numbers(mesh, points.len())?;
        check_counts(values, gradients, points.len())?;
        let (vertices, numbers) = without_twins(&places(mesh)?);
        let triangles = mesh.triangles.iter().map(|triangle| triangle.map(|vertex| numbers[vertex as usize]));
        let mut compact = Self {
            normal: mesh.normal,
            origin: mesh.origin,
            planes: mesh.planes.clone(),
            triangles: triangles.collect(),
            sheets: mesh.sheets.clone(),
            vertices,
            ..Self::default()
        };
        compact.reorder();
        let used = compact.number_nodes(points.len());
        compact.quantize(&used, points, values, gradients)?;
        Ok(compact)
    }

    /// Of a mesh that does not know what it was made of: each vertex is a node.
    pub fn of_vertices(mesh: QuantizedMesh) -> Self {
        let QuantizedMesh { normal, origin, quantization, points, gradients, triangles, sheets } = mesh;
        let vertices = (0..points.len() as u32).map(|node| Place { nodes: [node; 2], plane: 0 }).collect();
        Self {
            normal,
            origin,
            quantization,
            nodes: points,
            gradients,
            planes: Vec::new(),
            vertices,
            triangles,
            sheets,
        }
    }

    /// Puts the triangles of each sheet into an order that reuses vertices, and vertices into that of first use.
    fn reorder(&mut self) {
        let num_vertices = self.vertices.len();
        let (mut jobs, mut rest) = (Vec::with_capacity(self.sheets.len()), self.triangles.as_mut_slice());
        for sheet in &self.sheets {
            let (own, others) = rest.split_at_mut(sheet.triangles.len());
            jobs.push(own);
            rest = others;
        }
        // What a thread reuses from sheet to sheet.
        let scratch: Mutex<Vec<(Vec<u32>, Workspace)>> = Mutex::default();
        jobs.into_par_iter().for_each(|triangles| {
            let lock = || scratch.lock().unwrap_or_else(PoisonError::into_inner);
            let kept = lock().pop();
            let (mut local, mut workspace) =
                kept.unwrap_or_else(|| (vec![u32::MAX; num_vertices], workspace()));
            let used = number_by_first_use(triangles, &mut local);
            let corners = triangles.as_flattened_mut();
            // The order is a matter of bytes and speed alone: where there is none, the one there is stays.
            if let Ok(ordered) = optimize_vertex_cache(corners, used.len(), &mut workspace) {
                corners.copy_from_slice(&ordered);
            }
            corners.iter_mut().for_each(|corner| *corner = used[*corner as usize]);
            lock().push((local, workspace));
        });
        let mut numbers = vec![u32::MAX; num_vertices];
        let used = number_by_first_use(&mut self.triangles, &mut numbers);
        self.vertices = used.iter().map(|&vertex| self.vertices[vertex as usize]).collect();
    }

    /// Numbers the nodes that vertices lie between, in their order; returns them.
    fn number_nodes(&mut self, num_nodes: usize) -> Vec<u32> {
        let mut numbers = vec![u32::MAX; num_nodes];
        for node in self.vertices.iter().flat_map(|place| place.nodes) {
            numbers[node as usize] = 0;
        }
        let used: Vec<u32> =
            (0..num_nodes as u32).filter(|&node| numbers[node as usize] != u32::MAX).collect();
        for (number, &node) in (0..).zip(&used) {
            numbers[node as usize] = number;
        }
        for place in &mut self.vertices {
            place.nodes = place.nodes.map(|node| numbers[node as usize]);
        }
        used
    }

    fn quantize(
        &mut self,
        used: &[u32],
        points: &[DVec3],
        values: &Samples,
        gradients: Option<&[DVec3]>,
    ) -> Result<(), quantize::Error> {
        let place = |&node: &u32| points[node as usize] - self.origin;
        let values: Vec<f64> = for_samples!(values, |values| {
            used.iter().map(|&node| volery_scene::Sample::channel(values[node as usize], 0)).collect()
        });
        let gradients: Vec<DVec3> =
            gradients.map_or_else(Vec::new, |all| used.iter().map(|&node| all[node as usize]).collect());
        let magnitudes = gradients.iter().map(|gradient| gradient.length());
        let quantization =
            quantize::quantization_over(used.iter().map(place), values.iter().copied(), magnitudes)?;
        let node = |(node, &value): (&u32, &f64)| quantization.point(place(node), value);
        self.nodes = used.iter().zip(&values).map(node).collect();
        self.gradients = gradients
            .iter()
            .map(|gradient| quantization.gradient(gradient.normalize_or_zero(), gradient.length()))
            .collect();
        self.quantization = quantization;
        Ok(())
    }

    /// The vertices themselves.
    ///
    /// # Panics
    /// When a vertex names a node or a plane that does not exist.
    pub fn expand(self) -> QuantizedMesh {
        let along = |&node: &[u16; 4]| self.normal.dot(self.quantization.place(node));
        let along: Vec<f64> = self.nodes.par_iter().with_min_len(RUN).map(along).collect();
        let weight = |&Place { nodes, plane }: &Place| {
            let [from, to] = nodes.map(|node| along[node as usize]);
            let weight = (self.planes[plane as usize] - from) / (to - from);
            // Where quantising has put both at one place along the normal, in the middle.
            if weight.is_finite() { weight.clamp(0.0, 1.0) } else { 0.5 }
        };
        let point = |place: &Place| {
            let [from, to] = place.nodes.map(|node| self.nodes[node as usize]);
            if place.nodes[0] == place.nodes[1] { from } else { between(from, to, weight(place)) }
        };
        let gradient = |place: &Place| {
            let [from, to] = place.nodes.map(|node| self.gradients[node as usize]);
            if place.nodes[0] == place.nodes[1] { from } else { gradient_between(from, to, weight(place)) }
        };
        let vertices = self.vertices.par_iter().with_min_len(RUN);
        QuantizedMesh {
            normal: self.normal,
            origin: self.origin,
            quantization: self.quantization,
            points: vertices.clone().map(point).collect(),
            gradients: if self.gradients.is_empty() { Vec::new() } else { vertices.map(gradient).collect() },
            triangles: self.triangles,
            sheets: self.sheets,
        }
    }
}

/// A workspace for what is our own.
pub(crate) fn workspace() -> Workspace {
    Workspace::new(Limits { max_bytes: usize::MAX, max_work: u64::MAX })
}

#[inline]
fn between(from: [u16; 4], to: [u16; 4], weight: f64) -> [u16; 4] {
    std::array::from_fn(|part| {
        let [from, to] = [from[part], to[part]].map(f64::from);
        // Within the range of both: the weight is in [0, 1].
        (from + (to - from) * weight + 0.5).min(STEPS) as u16
    })
}

fn gradient_between(from: [i8; 4], to: [i8; 4], weight: f64) -> [i8; 4] {
    let vector = |[x, y, z, magnitude]: [i8; 4]| {
        // One that counts as 0 still has a direction.
        let magnitude = f64::from(magnitude.cast_unsigned()).max(0.25);
        DVec3::new(x.into(), y.into(), z.into()) * (magnitude / 127.0)
    };
    let (from, to) = (vector(from), vector(to));
    let gradient = from + (to - from) * weight;
    let magnitude = (gradient.x * gradient.x + gradient.y * gradient.y + gradient.z * gradient.z).sqrt();
    if magnitude == 0.0 {
        return [0; 4];
    }
    let [x, y, z] = (gradient * (127.0 / magnitude)).to_array().map(|part| part.round() as i8);
    [x, y, z, (magnitude.round() as u8).cast_signed()]
}

fn check_numbers(mesh: &SliceMesh, num_nodes: usize) -> Result<(), Error> {
    let check = |what, found: Option<u32>, count: usize| match found {
        Some(found) if found as usize >= count => {
            Err(Error::Number { what, found, expected: count.saturating_sub(1) })
        }
        _ => Ok(()),
    };
    check("a triangle has vertex", mesh.triangles.as_flattened().iter().copied().max(), mesh.points.len())?;
    check("a vertex has node", mesh.edges.as_flattened().iter().copied().max(), num_nodes)?;
    check_sheets(&mesh.sheets, mesh.triangles.len())
}

/// Whether sheets come one after another and have every triangle.
fn check_sheets(sheets: &[MeshSheet], num_triangles: usize) -> Result<(), Error> {
    let mut end = 0;
    for sheet in sheets {
        let found = sheet.triangles.clone();
        if found.start != end || found.end < end {
            return Err(Error::Sheets { found, expected: end });
        }
        end = found.end;
    }
    if end as usize == num_triangles {
        Ok(())
    } else {
        Err(Error::Sheets { found: end..end, expected: num_triangles as u32 })
    }
}

/// The nodes and the plane of each vertex.
fn places(mesh: &SliceMesh) -> Result<Vec<Place>, Error> {
    let planes = &mesh.planes;
    let dvec3 = |&[x, y, z, _]: &[f32; 4]| DVec3::new(x.into(), y.into(), z.into());
    let reach = mesh.points.par_iter().map(|point| dvec3(point).abs()).reduce(|| DVec3::ZERO, DVec3::max);
    let allowed = OFF_PLANE * mesh.normal.abs().dot(reach);
    let place = |(vertex, (&nodes, point)): (usize, (&[u32; 2], &[f32; 4]))| {
        if nodes[0] == nodes[1] {
            return Ok(Place { nodes, plane: 0 });
        }
        let found = mesh.normal.dot(dvec3(point));
        let above = planes.partition_point(|&plane| plane < found);
        let off = |&plane: &usize| planes.get(plane).map_or(f64::INFINITY, |plane| (plane - found).abs());
        let nearest = if off(&above) < off(&above.wrapping_sub(1)) { above } else { above.wrapping_sub(1) };
        if off(&nearest) <= allowed {
            Ok(Place { nodes: [nodes[0].min(nodes[1]), nodes[0].max(nodes[1])], plane: nearest as u32 })
        } else {
            Err(Error::Plane { vertex, found })
        }
    };
    mesh.edges.par_iter().zip(&mesh.points).enumerate().with_min_len(RUN).map(place).collect()
}

/// Every place once, ascending, and the number that each had there.
fn without_twins(places: &[Place]) -> (Vec<Place>, Vec<u32>) {
    let mut sorted: Vec<(Place, u32)> = places.iter().copied().zip(0..).collect();
    sorted.par_sort_unstable();
    let (mut unique, mut numbers): (Vec<Place>, _) = (Vec::new(), vec![0; places.len()]);
    for (place, vertex) in sorted {
        if unique.last() != Some(&place) {
            unique.push(place);
        }
        numbers[vertex as usize] = unique.len() as u32 - 1;
    }
    (unique, numbers)
}

/// Numbers what triangles name by its first use, and returns what has which number; `numbers` is all `u32::MAX`
/// before and after.
fn number_by_first_use(triangles: &mut [[u32; 3]], numbers: &mut [u32]) -> Vec<u32> {
    let mut used = Vec::new();
    for corner in triangles.as_flattened_mut() {
        let number = &mut numbers[*corner as usize];
        if *number == u32::MAX {
            *number = used.len() as u32;
            used.push(*corner);
        }
        *corner = *number;
    }
    used.iter().for_each(|&vertex| numbers[vertex as usize] = u32::MAX);
    used
}
