//! The truth of unstructured grids: each ray through the cells that it meets, in `f64`.
//!
//! # The method
//! *Which cells, from where to where.* A tree of boxes ([`boxes`]) yields the cells near a ray, and each says where
//! the ray is inside of it ([`surface`]). That is decided by exact signs in the frame of the ray ([`view`]), so no
//! ray slips between two cells or is in both, even along faces and edges and through nodes. Walking from neighbour to
//! neighbour would be faster; it gets lost where cells are degenerate. The stretches are sorted by where they begin.
//!
//! *The field in a cell* is VTK's ([`shape`]). Along a ray it is linear in a tetrahedron. In the other types the
//! local coordinates are found by Newton's method in the frame of the ray, and the field is replaced by polynomials
//! of degree 7 ([`fit`]), halving until one is within [`FIT_TOLERANCE`]. A polynomial is then integrated like the
//! cubics of voxels ([`crate::integral`]): split where it crosses the value of a control point, by collocation in
//! between.
//!
//! # The error
//! A pixel is within 1e-6 of the exact integral for the rules below; tests find 1e-12 on linear and on voxel fields and
//! ask for 1e-8 on cells with curved coordinates, and 1e-7 on cells whose nodes are one in every way that leaves them a
//! volume. A field that is replaced keeps [`FIT_TOLERANCE`] except where local coordinates are singular, at the edge of
//! a collapsed cell: there halving ends after a 4,096th of the stretch. Where a ray only just touches the value of a
//! step of the transfer function, the error of the field counts with its root.
//!
//! # Rules where a grid leaves open what is true
//! - A face of four nodes is two triangles, split at its node of the lowest number.
//!   Between these and the cell's curved face, the cell's interpolation is continued.
//! - Where cells overlap, which valid ones do not, a stretch begins no earlier than those before it ended.
//! - Where the interpolation has no inverse near (a cell folded over), the field is linear along the stretch,
//!   between its values on the triangles where the ray enters and leaves.
//! - A ray along a face or an edge, or through a node, counts as moved aside by next to nothing: one way where that
//!   is in a cell, else into the cell that it touches. So cells are closed, to within rounding, and beside a blank
//!   one a face counts.
//! - Blank cells, and cells with a value that is not finite, are empty; cells of clear values only do not count as
//!   overlapping.
//!
//! # Limits
//! All stretches of a ray are gathered before the first is integrated, so an opaque grid is no faster. One scalar and
//! one transfer function of it: no classification by gradient, no light.

mod boxes;
mod course;
mod fit;
mod shape;
mod surface;
mod view;

use glam::DVec3;
use rayon::prelude::*;
use volery_scene::{Camera, Ray, Samples, TransferFunction, TriangleMesh, UnstructuredGrid};

use self::boxes::Boxes;
use self::course::Course;
use self::fit::Septic;
use self::surface::{SeenCell, Stretch};
use self::view::View;
use crate::image::Image;
use crate::integral::{Integrator, Light, OPAQUE, add_constant};
use crate::render::{Error, picture};
use crate::transfer::{Band, Bands};

/// Largest estimated error of one interval of a ray, in colour or transmittance.
const TOLERANCE: f64 = 1e-11;

/// Largest difference of a field from its polynomial, relative to the distance of control points that are near.
const FIT_TOLERANCE: f64 = 1e-9;

/// The same relative to the values as they are counted: below is rounding.
const ROUNDING: f64 = 1e-13;

/// How far beside a cell a ray still is in it where no other cell has it, relative to the size of the grid: rounding.
const CLOSED: f64 = 16.0 * f64::EPSILON;

/// A grid, one of its scalars, and how values look: everything that is the same for all rays.
#[derive(Debug)]
pub struct GridTracer<'a> {
    grid: &'a UnstructuredGrid,
    values: Vec<f64>,
    bands: Bands,
    /// Over the cells that are not blank and not clear.
    boxes: Boxes,
    meshes: &'a [TriangleMesh],
}

/// Stretches in order, each with the part of it that lies between two ends and behind the others.
fn arrange(mut stretches: Vec<Stretch>, [mut from, end]: [f64; 2]) -> Vec<(Stretch, [f64; 2])> {
    let key = |stretch: &Stretch| (stretch.enter.t, stretch.leave.t);
    stretches.sort_unstable_by(|a, b| {
        let ((a_enter, a_leave), (b_enter, b_leave)) = (key(a), key(b));
        a_enter.total_cmp(&b_enter).then(a_leave.total_cmp(&b_leave)).then(a.cell.cmp(&b.cell))
    });
    let mut parts = Vec::new();
    for stretch in stretches {
        let ends = [stretch.enter.t.max(from), stretch.leave.t.min(end)];
        if ends[0] < ends[1] {
            parts.push((stretch, ends));
            from = ends[1];
        }
    }
    parts
}

impl<'a> GridTracer<'a> {
    /// Prepares to trace rays through `grid`, whose nodes have `values`, as `transfer` shows them.
    ///
    /// # Errors
    /// When the values are colours, or not one per node.
    pub fn new(
        grid: &'a UnstructuredGrid,
        values: &Samples,
        transfer: &TransferFunction,
    ) -> Result<Self, Error> {
        if values.sample_type().channels() > 1 {
            return Err(Error::ColorSamples { found: values.sample_type() });
        }
        let (found, expected) = (values.len(), grid.points().len());
        if found != expected {
            return Err(Error::NodeValues { found, expected });
        }
        let values: Vec<f64> = (0..found).map(|node| values.value(node, 0)).collect();
        let bands = Bands::new(transfer);
        let holds_matter = |cell: usize| {
            let of_nodes = || grid.cells().get(cell).1.iter().map(|&node| values[node as usize]);
            let low = of_nodes().fold(f64::INFINITY, f64::min);
            let high = of_nodes().fold(f64::NEG_INFINITY, f64::max);
            let is_finite = of_nodes().all(f64::is_finite);
            is_finite && !bands.of_range(low, high).iter().all(Band::is_clear) && !grid.is_blank(cell)
        };
        let cells: Vec<u32> = (0..grid.cells().len())
            .into_par_iter()
            .filter(|&cell| holds_matter(cell))
            .map(|cell| cell as u32)
            .collect();
        let bounds = |&cell: &u32| {
            let places = grid.cells().get(cell as usize).1.iter().map(|&node| grid.points()[node as usize]);
            places.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], place| {
                [low.min(place), high.max(place)]
            })
        };
        let bounds: Vec<_> = cells.par_iter().map(bounds).collect();
        Ok(Self { grid, boxes: Boxes::new(cells, &bounds), values, bands, meshes: &[] })
    }

    /// The same with opaque surfaces among the matter: a ray ends at the nearest. Pictures show them, single rays do
    /// not.
    #[must_use]
    pub fn among(self, meshes: &'a [TriangleMesh]) -> Self {
        Self { meshes, ..self }
    }

    /// The light that comes along a ray to its origin.
    pub fn trace(&self, ray: &Ray) -> Light {
        self.trace_to(ray, f64::INFINITY)
    }

    /// The light of a ray that ends at a distance.
    fn trace_to(&self, ray: &Ray, distance: f64) -> Light {
        let mut light = Light::CLEAR;
        let Some([low, high]) = self.boxes.bounds() else { return light };
        let Some(view) = View::new(ray, low / 2.0 + high / 2.0, distance) else { return light };
        let (mut inside, mut beside) = (Vec::new(), Vec::new());
        self.boxes.along(&view, |cell| {
            let mut seen = self.see(&view, cell);
            let count = inside.len();
            seen.stretches(cell, |stretch| inside.push(stretch));
            if inside.len() == count {
                seen.move_nearer(CLOSED * self.boxes.reach());
                seen.stretches(cell, |stretch| beside.push(stretch));
            }
        });
        let mut parts = arrange(inside, [view.start, view.end]);
        if !beside.is_empty() {
            let ends = parts.iter().flat_map(|(_, ends)| *ends);
            let gaps: Vec<f64> = [view.start].into_iter().chain(ends).chain([view.end]).collect();
            parts.extend(gaps.chunks_exact(2).flat_map(|gap| arrange(beside.clone(), [gap[0], gap[1]])));
            parts.sort_by(|(_, a), (_, b)| a[0].total_cmp(&b[0]));
        }
        let mut fits = Vec::new();
        for (stretch, ends) in &parts {
            self.cross(&view, stretch, *ends, &mut fits, &mut light);
            if light.transmittance <= OPAQUE {
                break;
            }
        }
        light
    }

    /// The picture in front of `background`: each pixel the light along the ray through its centre. Calls `progress`
    /// with the finished part of the picture, in [0, 1], after each row, from any thread. The result does not depend
    /// on the number of threads.
    ///
    /// # Errors
    /// When the camera or the size is not meaningful.
    pub fn render(
        &self,
        camera: &Camera,
        background: [f64; 3],
        width: u32,
        height: u32,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Image, Error> {
        picture(camera, [width, height], (self.meshes, background), progress, |ray, backdrop| {
            self.trace_to(ray, backdrop.distance).over(backdrop.color)
        })
    }

    fn see(&self, view: &View, cell: u32) -> SeenCell<'_> {
        let (cell_type, nodes) = self.grid.cells().get(cell as usize);
        let mut seen = SeenCell { cell_type, nodes, places: [DVec3::ZERO; 8], values: [0.0; 8] };
        for (place, &node) in nodes.iter().enumerate() {
            seen.places[place] = view.see(self.grid.points()[node as usize]);
            seen.values[place] = self.values[node as usize];
        }
        seen
    }

    /// Adds the light of a part of a stretch.
    fn cross(
        &self,
        view: &View,
        stretch: &Stretch,
        ends: [f64; 2],
        fits: &mut Vec<(Septic, [f64; 2])>,
        light: &mut Light,
    ) {
        let seen = self.see(view, stretch.cell);
        let values = &seen.values[..seen.nodes.len()];
        let length = (ends[1] - ends[0]) / self.bands.unit_distance();
        if values.iter().all(|value| *value == values[0]) {
            return add_constant(light, &self.bands.at(0.0, values[0]), length);
        }
        let is_sliver = ends[1] - ends[0] <= CLOSED * self.boxes.reach();
        let integrator = Integrator { bands: &self.bands, tolerance: TOLERANCE, is_sliver };
        let base = values[0];
        let course = Course::new(&seen, stretch, base);
        if !course.fit(ends, self.fit_tolerance(values, base), fits) {
            return integrator.add(light, &course.line(ends), base, length);
        }
        for (fit, [a, b]) in fits {
            integrator.add(light, fit, base, (*b - *a) / self.bands.unit_distance());
            if light.transmittance <= OPAQUE {
                return;
            }
        }
    }

    /// How near a polynomial must be to the field between these values.
    fn fit_tolerance(&self, values: &[f64], base: f64) -> f64 {
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        // Beside a step of the transfer function it is the place of the step that counts.
        let near =
            if self.bands.edges_between(low, high, 0.0).is_empty() { f64::INFINITY } else { high - low };
        let scale = self.bands.of_range(low, high).iter().map(Band::width).fold(near, f64::min);
        (FIT_TOLERANCE * scale).max(ROUNDING * (low - base).abs().max((high - base).abs()))
    }
}
