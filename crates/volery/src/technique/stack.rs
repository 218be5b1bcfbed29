//! Slices through cells, each standing for a slab of matter, drawn one over another.
//!
//! # Method
//! Benölken and Graf 2005. *Immediate*: planes perpendicular to the direction of view, sliced for this picture.
//! *Axes*: three stacks along x, y and z made ahead; drawn is the one whose normal is nearest the direction of view,
//! so a camera that moves costs drawing alone. In perspective the way of a ray through a slab is found per fragment
//! (`volery_frame::sheets`), so a normal that is not the ray's own costs accuracy, not brightness.
//!
//! Strips of the outline carry what slabs have too much or too little where the grid ends. Their sign is a matter of
//! which side the ray comes in, so who draws them finds it out for each ray (`volery_frame::Counted`).
//!
//! # Accuracy
//! Of second order in the distance between planes where colour and extinction are continuous functions of the value and
//! several planes lie within the narrowest feature of the transfer function; with a step in it of first order. A slab
//! has the colour of its plane's value: nothing is integrated between slices. `docs/stacks.md` has the figures.
//!
//! # Guarantees
//! - Every colour lies between those of the transfer function and of what is behind, however few the slices.
//! - The same bits whatever the number of threads.
//! - New values at the nodes give the bits of a stack sliced anew.

use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;
use volery_frame::{Backend, Counted, Light, Revision, Sheet, SheetTransfer, SheetVertices, Sheets};
use volery_reference::GridTracer;
use volery_scene::mesh::AMBIENT;
use volery_scene::{Camera, Projection, Samples};
use volery_slicing::{MeshSheet, QuantizedMesh, SliceMesh, error};

mod stacks;

use crate::data::{Data, GridData, StackData};
use crate::fit::{self, Direction};
use crate::session::{RenderError, VerifyError};
use crate::technique::{Drawing, Kept, Plan, Technique, Work};
use crate::transfer::Preset;
use crate::view::{Dial, How, StackView, Transfer, View, ViewOptions};

use stacks::Stacks;

/// The fewest slices of a coarser level of detail.
const MIN_SLICES: usize = 8;

/// Why cells could not be sliced.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// There are no such planes.
    #[error(transparent)]
    Planes(#[from] error::Planes),
    /// Too many polygons, vertices or triangles.
    #[error(transparent)]
    Mesh(#[from] error::Mesh),
    /// The same, of planes where cells are.
    #[error(transparent)]
    Adaptive(#[from] error::MeshAdaptively),
    /// Values that do not fit.
    #[error(transparent)]
    Values(#[from] error::Values),
    /// Vertices cannot be told in few bits.
    #[error(transparent)]
    Quantize(#[from] error::Quantize),
}

/// What the last picture was drawn with.
#[derive(Default)]
struct Drawn {
    /// Of its transfer function over a range of values.
    table: Kept<(Transfer, [f64; 2]), SheetTransfer>,
    /// Of its stack.
    revision: Option<Revision>,
}

/// Slices through a grid, for the last views.
#[derive(Default)]
pub(crate) struct OfGrid {
    stacks: Stacks,
    drawn: Drawn,
}

/// Slices that were made before.
#[derive(Default)]
pub(crate) struct OfStack {
    drawn: Drawn,
}

impl Technique<GridData> for OfGrid {
    fn draws(&self, how: &How) -> bool {
        matches!(how, How::Stack(_))
    }

    fn view(&self, grid: &GridData, options: &ViewOptions, how: How) -> View {
        let boxes = |transfer: &Transfer| match transfer {
            Transfer::Values(function) => fit::visible_cells(grid.with_matter(), grid.values(), function),
            Transfer::Magnitudes(_) => vec![grid.world_bounds()],
        };
        view(grid, options, options.direction.unwrap_or_default(), how, boxes)
    }

    fn check(&self, _: &GridData, view: &View) -> Result<(), RenderError> {
        view.obeyed(|dial| matches!(dial, Dial::Full | Dial::Deadline(_)))?;
        match &view.how {
            How::Stack(StackView { num_slices: 0, .. }) => Err(RenderError::NoSlice),
            _ => Ok(()),
        }
    }

    fn coarser(&self, view: &View, rung: usize) -> Option<View> {
        let How::Stack(stack) = &view.how else { return None };
        let num_slices = stack.num_slices >> rung;
        let how = How::Stack(StackView { num_slices, ..stack.clone() });
        (num_slices >= MIN_SLICES).then(|| View { how, ..view.clone() })
    }

    fn forget_view(&mut self) {
        self.stacks.forget_immediate();
    }

    fn plan(&mut self, grid: &mut GridData, view: &View, _: &dyn Backend) -> Result<Plan, RenderError> {
        let start = Instant::now();
        let default = StackView::default();
        let stack_view = if let How::Stack(of_view) = &view.how { of_view } else { &default };
        if needs_gradients(view) {
            grid.make_gradients();
        }
        self.stacks.follow(grid);
        self.stacks.make(stack_view, view, grid)?;
        let shown = self.stacks.shown(stack_view.slicing, &view.camera).ok_or(RenderError::NoSlice)?;
        let seconds = start.elapsed().as_secs_f64() + grid.take_step_seconds();
        let plan = plan(shown, &mut self.drawn, view, grid.value_range());
        let slice_bytes = plan.work.slice_bytes.map(|[_, sent]| [self.stacks.num_bytes(), sent]);
        let work = Work { slice_bytes, ..plan.work };
        Ok(Plan { geometry_seconds: Some(seconds), work, ..plan })
    }

    fn truth(
        &self,
        grid: &GridData,
        view: &View,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<volery_reference::Image, VerifyError> {
        view.check_verifiable()?;
        let Transfer::Values(transfer) = &view.transfer else {
            return Err(VerifyError::Unknown { what: "gradient magnitudes" });
        };
        let tracer = GridTracer::new(grid.with_matter(), grid.values(), transfer)?;
        let View { camera, background, width, height, meshes, .. } = view;
        Ok(tracer.among(meshes).render(camera, *background, *width, *height, progress)?)
    }
}

impl Technique<StackData> for OfStack {
    fn draws(&self, how: &How) -> bool {
        matches!(how, How::Slices { .. })
    }

    /// Straight at the slices where the options have no direction: seen from the side, slices are lines.
    fn view(&self, stack: &StackData, options: &ViewOptions, how: How) -> View {
        let direction = options.direction.unwrap_or_else(|| Direction::facing(stack.stack().normal()));
        view(stack, options, direction, how, |_| vec![stack.world_bounds()])
    }

    fn check(&self, stack: &StackData, view: &View) -> Result<(), RenderError> {
        view.obeyed(|dial| matches!(dial, Dial::Full | Dial::Deadline(_)))?;
        if needs_gradients(view) && !stack.has_gradients() { Err(RenderError::NoGradients) } else { Ok(()) }
    }

    fn plan(&mut self, stack: &mut StackData, view: &View, _: &dyn Backend) -> Result<Plan, RenderError> {
        Ok(plan(stack.stack(), &mut self.drawn, view, stack.value_range()))
    }

    /// # Errors
    /// Always: what slices were made of is not known.
    fn truth(
        &self,
        _: &StackData,
        _: &View,
        _: &(dyn Fn(f64) + Sync),
    ) -> Result<volery_reference::Image, VerifyError> {
        Err(VerifyError::Unknown { what: "cells that slices were made of" })
    }
}

/// Whether pictures need gradients at the nodes.
fn needs_gradients(view: &View) -> bool {
    is_lit(view) || matches!(view.transfer, Transfer::Magnitudes(_))
}

fn is_lit(view: &View) -> bool {
    match view.how {
        How::Stack(StackView { is_lit, .. }) | How::Slices { is_lit } => is_lit,
        _ => false,
    }
}

impl View {
    /// Whether the reference knows what such pictures of cells show.
    ///
    /// # Errors
    /// When they show light or gradient magnitudes.
    pub fn check_verifiable(&self) -> Result<(), VerifyError> {
        if matches!(self.transfer, Transfer::Magnitudes(_)) {
            Err(VerifyError::Unknown { what: "gradient magnitudes" })
        } else if is_lit(self) {
            Err(VerifyError::Unknown { what: "light" })
        } else {
            Ok(())
        }
    }
}

/// A view of all of the boxes that can be seen.
fn view<D: Data>(
    data: &D,
    options: &ViewOptions,
    direction: Direction,
    how: How,
    boxes: impl FnOnce(&Transfer) -> Vec<[DVec3; 2]>,
) -> View {
    let transfer = options.transfer_or(|| data.preset_over(Preset::Auto, options.range));
    let camera = fit::camera(&boxes(&transfer), &data.placement(), options.look(direction));
    options.view(camera, transfer, how)
}

/// The plan of a stack, with the values of `range`.
fn plan(stack: &Arc<Stack>, drawn: &mut Drawn, view: &View, range: [f64; 2]) -> Plan {
    let transfer = drawn.table.get(&(view.transfer.clone(), range), || match &view.transfer {
        Transfer::Values(transfer) => SheetTransfer::new(transfer, range),
        Transfer::Magnitudes(function) => SheetTransfer::new_2d(function),
    });
    let is_new = drawn.revision.replace(stack.revision) != Some(stack.revision);
    let bytes = stack.num_bytes();
    let work = Work {
        polygons: stack.mesh.num_polygons,
        slices: Some(stack.num_slices()),
        triangles: Some(stack.mesh.triangles.len()),
        slice_bytes: Some([bytes, if is_new { bytes } else { 0 }]),
        ..Work::default()
    };
    let drawing = Drawing::Sheets {
        sheets: stack.sheets(&view.camera),
        stack: stack.clone(),
        transfer,
        light: is_lit(view).then(|| Light::along_view(&view.camera, AMBIENT as f32)),
    };
    Plan { drawing, store: None, work, bound_max: None, predicted_rmse: None, geometry_seconds: None }
}

/// Slices and strips of the outline between them.
#[derive(Clone, Debug)]
pub struct Stack {
    mesh: SliceMesh,
    /// What is drawn in place of the mesh's own vertices.
    quantized: Option<QuantizedMesh>,
    /// Its sheets for any eye.
    sheets: Vec<MeshSheet>,
    /// Names the contents of the mesh.
    revision: Revision,
}

impl Stack {
    pub(crate) fn new(mesh: SliceMesh, quantized: Option<QuantizedMesh>) -> Self {
        let sheets = mesh.sheets_for_any_eye();
        Self { mesh, quantized, sheets, revision: Revision::new() }
    }

    /// Of a mesh from a file, drawn as it is there.
    pub(crate) fn of_file(quantized: QuantizedMesh) -> Self {
        Self::new(quantized.to_mesh(), Some(quantized))
    }

    /// Places relative to [`Stack::origin`], and values.
    pub(crate) fn points(&self) -> &[[f32; 4]] {
        &self.mesh.points
    }

    pub(crate) fn origin(&self) -> DVec3 {
        self.mesh.origin
    }

    pub(crate) fn normal(&self) -> DVec3 {
        self.mesh.normal
    }

    pub(crate) fn has_gradients(&self) -> bool {
        !self.mesh.gradients.is_empty()
    }

    /// Gives the vertices other values, and gradients where it has some.
    pub(crate) fn set_values(&mut self, values: &Samples, gradients: Option<&[DVec3]>) -> Result<(), Error> {
        let gradients = gradients.filter(|_| self.has_gradients());
        self.mesh.set_values(values, gradients)?;
        if self.quantized.is_some() {
            self.quantized = Some(QuantizedMesh::new(&self.mesh)?);
        }
        self.revision = Revision::new();
        Ok(())
    }

    /// For a backend.
    pub(crate) fn content<'a>(
        &'a self,
        sheets: &'a [Sheet],
        transfer: &'a SheetTransfer,
        light: Option<Light>,
    ) -> Sheets<'a> {
        let SliceMesh { normal, origin, points, gradients, triangles, .. } = &self.mesh;
        Sheets {
            revision: Some(self.revision),
            normal: *normal,
            origin: *origin,
            vertices: match &self.quantized {
                None => SheetVertices::Exact { points, gradients },
                Some(mesh) => quantized_vertices(mesh),
            },
            triangles,
            sheets,
            transfer,
            light,
        }
    }

    /// The sheets back to front.
    fn sheets(&self, camera: &Camera) -> Vec<Sheet> {
        let normal = self.mesh.normal;
        let eye = match camera.projection {
            Projection::Perspective { .. } => normal.dot(camera.eye - self.mesh.origin),
            Projection::Orthographic { .. } => f64::NEG_INFINITY * normal.dot(camera.axes()[2]).signum(),
        };
        let sheet = |sheet: &MeshSheet| Sheet {
            first: sheet.triangles.start,
            count: sheet.triangles.end - sheet.triangles.start,
            thickness: sheet.thickness.map(|part| part as f32),
            counted: match sheet.thickness[1] {
                0.0 => Counted::All,
                slope if slope > 0.0 => Counted::Rising,
                _ => Counted::Falling,
            },
        };
        MeshSheet::back_to_front(&self.sheets, eye).map(sheet).collect()
    }

    /// How many planes met cells.
    fn num_slices(&self) -> usize {
        let is_slice = |sheet: &&MeshSheet| sheet.thickness[1] == 0.0 && sheet.thickness[0] > 0.0;
        self.mesh.sheets.iter().filter(is_slice).count()
    }

    /// Bytes of vertices and triangles.
    pub(crate) fn num_bytes(&self) -> u64 {
        let SliceMesh { points, gradients, triangles, .. } = &self.mesh;
        let exact = || size_of_val(&points[..]) + size_of_val(&gradients[..]) + size_of_val(&triangles[..]);
        self.quantized.as_ref().map_or_else(exact, QuantizedMesh::num_bytes) as u64
    }
}

fn quantized_vertices(mesh: &QuantizedMesh) -> SheetVertices<'_> {
    SheetVertices::Quantized {
        points: &mesh.points,
        gradients: &mesh.gradients,
        quantization: mesh.quantization,
    }
}
