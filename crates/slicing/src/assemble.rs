//! Making one mesh of slices and strips.
//!
//! # Method
//! Sections bring their vertices and polygons, strips their vertices and triangles; a mesh has the vertices of all,
//! and their triangles sheet after sheet by position. Places are computed in f64 relative to the middle of the
//! grid's bounds, so that a grid far from the origin loses nothing, and rounded once.
//!
//! A polygon against the normal takes matter away: a hole in another one, of a cell that lists nodes more than once,
//! or what a folded cell counts twice. Such polygons are turned around and come in a sheet of their own, of negative
//! thickness, before the one of the others.

use glam::DVec3;
use rayon::prelude::*;
use volery_scene::Samples;

use crate::cut;
use crate::levels::Levels;
use crate::mesh::{MeshSheet, RUN, Rays, SliceMesh, ValuesError, between, check_counts};
use crate::planes::Planes;
use crate::section::Section;
use crate::slicer::Slicer;
use crate::stack::{Layer, Stack};
use crate::strips::Strips;

/// How far across a polygon against the normal is to be, over how far the outline reaches: less is rounding of its
/// places to 32 bits.
const LEAST_WIDTH: f64 = 1e-6;

/// How far the outline may reach from its middle: places, and what executors make of them, are 32 bits.
const MAX_REACH: f64 = 1e30;

/// Why a mesh could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// The grid could not be cut.
    #[error(transparent)]
    Cut(#[from] cut::Error),
    /// Values that do not fit the grid.
    #[error(transparent)]
    Values(#[from] ValuesError),
    /// Places too far apart for the 32 bits of a vertex.
    #[error("slice mesh: the grid reaches {found:e} from its middle, expected at most {MAX_REACH:e}")]
    TooFar {
        /// Along x, y or z.
        found: f64,
    },
    /// More than can be numbered.
    #[error("slice mesh: {found} {what}, expected at most {}", u32::MAX)]
    TooMany {
        /// Vertices or triangles.
        what: &'static str,
        /// How many.
        found: usize,
    },
}

/// Slices of some cells, and the outline of these cells between them.
pub(crate) struct Part {
    stack: Stack,
    strips: Strips,
    /// World positions of the middles of the strips' gaps; none where there are no strips.
    slab_ends: Vec<f64>,
}

impl Part {
    /// Slices as they are.
    pub(crate) fn of_stack(stack: Stack) -> Self {
        Self { stack, strips: Strips::default(), slab_ends: Vec::new() }
    }

    pub(crate) fn new(stack: Stack, strips: Strips, planes: &Planes) -> Self {
        Self { stack, strips, slab_ends: planes.slab_ends() }
    }

    /// Positions of the planes that vertices may lie on: a cell without volume has an outline, and no slice.
    fn planes(&self, origin: f64) -> impl Iterator<Item = f64> {
        let has_vertices = move |&(place, layer): &(usize, &Layer)| {
            let mut beside = self.strips.gaps.iter().skip(place).take(2);
            layer.section.is_some() || beside.any(|gap| !gap.is_empty())
        };
        let layers = self.stack.layers().iter().enumerate().filter(has_vertices);
        layers.map(move |(_, layer)| layer.position - origin)
    }

    /// What is to be drawn, with vertices numbered from `first_vertex` on: those of sections, then those of strips.
    fn pieces<'a>(&'a self, origin: f64, mut first_vertex: u32, pieces: &mut Vec<Piece<'a>>) {
        for (place, layer) in self.stack.layers().iter().enumerate() {
            let Some(section) = &layer.section else { continue };
            let position = layer.position - origin;
            // Slabs that fill the space between planes, also where these are not even.
            let thickness = match self.slab_ends.get(place..=place + 1) {
                Some(&[low, high]) => high - low,
                _ => layer.thickness,
            };
            let count = section.num_triangles();
            let shape = Shape::Section(section);
            pieces.push(Piece { position, thickness: [thickness, 0.0], shape, first_vertex, count });
            first_vertex += section.num_vertices() as u32;
        }
        for (triangles, middle) in self.strips.gaps.iter().zip(&self.slab_ends) {
            let position = middle - origin;
            let (thickness, count) = ([-position, 1.0], triangles.len());
            if count > 0 {
                pieces.push(Piece {
                    position,
                    thickness,
                    shape: Shape::Strip(triangles),
                    first_vertex,
                    count,
                });
            }
        }
    }
}

/// A sheet to be.
struct Piece<'a> {
    position: f64,
    thickness: [f64; 2],
    shape: Shape<'a>,
    first_vertex: u32,
    /// Of triangles.
    count: usize,
}

enum Shape<'a> {
    Section(&'a Section),
    Strip(&'a [[u32; 3]]),
}

impl Slicer {
    /// The slices of these planes, and strips of the outline between them, with the values at the nodes, and with
    /// gradients where they are given. With no plane there is no triangle.
    ///
    /// Where planes are not even, a slice stands for the slab between the middles of the gaps beside it.
    ///
    /// # Errors
    /// When there are fewer values or gradients than nodes, or too many vertices or triangles.
    pub fn mesh(
        &self,
        planes: &Planes,
        values: &Samples,
        gradients: Option<&[DVec3]>,
    ) -> Result<SliceMesh, Error> {
        let levels = Levels::new(self.grid(), planes);
        let stack = self.slice_levels(&levels, |_| true)?;
        let strips = Strips::new(self.outline(), &levels)?;
        self.assemble(&[Part::new(stack, strips, planes)], planes.normal(), values, gradients)
    }

    /// The slices of a stack as they are, without strips.
    ///
    /// # Errors
    /// As [`mesh`](Self::mesh).
    pub fn mesh_of_stack(
        &self,
        stack: Stack,
        values: &Samples,
        gradients: Option<&[DVec3]>,
    ) -> Result<SliceMesh, Error> {
        let normal = stack.normal();
        self.assemble(&[Part::of_stack(stack)], normal, values, gradients)
    }

    pub(crate) fn assemble(
        &self,
        parts: &[Part],
        normal: DVec3,
        values: &Samples,
        gradients: Option<&[DVec3]>,
    ) -> Result<SliceMesh, Error> {
        check_counts(values, gradients, self.grid().points().len())?;
        let count = |part: &Part| part.stack.num_vertices() + part.strips.edges.len();
        let num_vertices = parts.iter().map(count).sum();
        if u32::try_from(num_vertices).is_err() {
            return Err(Error::TooMany { what: "vertices", found: num_vertices });
        }
        let [origin, reach] = self.middle_and_reach();
        if reach.max_element() > MAX_REACH {
            return Err(Error::TooFar { found: reach.max_element() });
        }
        let num_polygons = Some(parts.iter().map(|part| part.stack.num_polygons()).sum());
        let mut mesh = SliceMesh { normal, origin, num_polygons, ..SliceMesh::default() };
        (mesh.edges, mesh.weights) = (Vec::with_capacity(num_vertices), Vec::with_capacity(num_vertices));
        let mut pieces = Vec::new();
        for part in parts {
            part.pieces(normal.dot(origin), mesh.edges.len() as u32, &mut pieces);
            for (_, section) in part.stack.sections() {
                mesh.edges.extend_from_slice(section.edges());
                mesh.weights.extend_from_slice(section.weights());
            }
            mesh.edges.extend_from_slice(&part.strips.edges);
            mesh.weights.extend_from_slice(&part.strips.weights);
        }
        mesh.planes = parts.iter().flat_map(|part| part.planes(normal.dot(origin))).collect();
        mesh.planes.sort_by(f64::total_cmp);
        mesh.planes.dedup();
        mesh.points = self.points(&mesh);
        mesh.set_values(values, gradients)?;
        pieces.sort_by(|a, b| a.position.total_cmp(&b.position));
        mesh.triangulate(&pieces, LEAST_WIDTH * reach.max_element())?;
        mesh.orient_strips(Rays::Along(normal));
        Ok(mesh)
    }

    /// Places of vertices, without values.
    fn points(&self, mesh: &SliceMesh) -> Vec<[f32; 4]> {
        let nodes = self.grid().points();
        let point = |(edge, &weight): (&[u32; 2], &f32)| {
            let [from, to] = edge.map(|node| nodes[node as usize] - mesh.origin);
            let [x, y, z] = between(from, to, weight).to_array().map(|part| part as f32);
            [x, y, z, 0.0]
        };
        mesh.edges.par_iter().zip(&mesh.weights).with_min_len(RUN).map(point).collect()
    }
}

impl SliceMesh {
    /// A polygon against the normal counts where it is more than `least_width` across.
    fn triangulate(&mut self, pieces: &[Piece<'_>], least_width: f64) -> Result<(), Error> {
        let found = pieces.iter().map(|piece| piece.count).sum();
        if u32::try_from(found).is_err() {
            return Err(Error::TooMany { what: "triangles", found });
        }
        let mut triangles = vec![[0; 3]; found];
        let (mut jobs, mut rest) = (Vec::with_capacity(pieces.len()), triangles.as_mut_slice());
        for piece in pieces {
            let (own, others) = rest.split_at_mut(piece.count);
            jobs.push((piece, own));
            rest = others;
        }
        let (normal, points) = (self.normal, &self.points);
        // Returns how many triangles take matter away: the first ones.
        let fill = |(piece, own): (&Piece<'_>, &mut [[u32; 3]])| {
            let numbered = |triangle: &[u32; 3]| triangle.map(|vertex| vertex + piece.first_vertex);
            let place = |vertex: u32| {
                let [x, y, z, _] = points[(piece.first_vertex + vertex) as usize];
                DVec3::new(f64::from(x), f64::from(y), f64::from(z))
            };
            match piece.shape {
                Shape::Section(section) => {
                    let (mut given, mut taken) = (0, Vec::new());
                    let mut give = |triangle: [u32; 3]| {
                        own[given] = numbered(&triangle);
                        given += 1;
                    };
                    section.for_triangles((normal, least_width), place, &mut give, |triangle| {
                        taken.push(triangle);
                    });
                    taken.iter().for_each(|&triangle| give(triangle));
                    own.rotate_right(taken.len());
                    taken.len()
                }
                Shape::Strip(triangles) => {
                    own.iter_mut().zip(triangles).for_each(|(own, triangle)| *own = numbered(triangle));
                    0
                }
            }
        };
        let num_taken: Vec<usize> = jobs.into_par_iter().map(fill).collect();
        let mut start = 0;
        for (&Piece { position, thickness, count, .. }, taken) in pieces.iter().zip(num_taken) {
            for (sign, count) in [(-1.0, taken), (1.0, count - taken)] {
                let triangles = start..start + count as u32;
                start = triangles.end;
                if !triangles.is_empty() {
                    let thickness = if sign < 0.0 { thickness.map(|part| -part) } else { thickness };
                    self.sheets.push(MeshSheet { position, thickness, triangles });
                }
            }
        }
        self.triangles = triangles;
        Ok(())
    }
}
