//! A grid of cells, a backend and the stacks made of it, kept from picture to picture.
//!
//! Opening a session numbers the grid's edges once. After that a picture costs what changed: of a new direction of
//! view the slicing, which [`Slicing::Axes`] spares, of a new time step an interpolation, of a
//! new transfer function drawing alone.

mod error;
mod slices;
mod stacks;
mod values;

use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;
use volery_frame::Backend;
use volery_reference::GridTracer;
use volery_scene::{CellType, Samples, TransferFunction, UnstructuredGrid};
use volery_slicing::{Slicer, node_gradients};

use crate::session::{Picture, RenderError, VerifyError, View, ViewOptions};
#[cfg(doc)]
use crate::technique::stack::Slicing;
use crate::technique::stack::{self, Frames, Tabulated};
use crate::transfer::Preset;
use crate::{fit, histogram, report};

pub use error::OpenError;
pub use slices::{SliceCounts, Slices, SlicesError};
pub use values::StepChange;

use stacks::Stacks;
use values::Matter;

/// Draws one grid again and again, by the technique stack.
pub struct GridSession {
    grid: Arc<UnstructuredGrid>,
    /// Name of the array that is drawn.
    array: String,
    /// Of the array, one per node.
    values: Samples,
    /// Of the nodes of cells that hold matter.
    range: [f64; 2],
    shape: Shape,
    backend: Box<dyn Backend>,
    /// At the nodes, once they were needed.
    gradients: Option<Vec<DVec3>>,
    stacks: Stacks,
    /// What the last time step took, until a picture says so.
    step_seconds: f64,
    table: Option<Tabulated>,
}

/// What does not depend on values: of the cells that hold matter.
struct Shape {
    slicer: Slicer,
    world_bounds: [DVec3; 2],
    build_seconds: f64,
}

impl Shape {
    fn new(grid: Arc<UnstructuredGrid>) -> Result<Self, OpenError> {
        let start = Instant::now();
        let world_bounds = grid.world_bounds().ok_or(OpenError::Blank)?;
        let longest = (world_bounds[1] - world_bounds[0]).max_element();
        if !(longest > 0.0 && longest <= OpenError::MAX_EXTENT) {
            return Err(OpenError::Extent { bounds: world_bounds });
        }
        let slicer = Slicer::new(grid)?;
        Ok(Self { slicer, world_bounds, build_seconds: start.elapsed().as_secs_f64() })
    }
}

impl GridSession {
    /// Makes a grid ready: one of its arrays by name, else the first.
    ///
    /// # Errors
    /// When there is no such array, every cell is blank, or there are too many edges.
    pub fn open(
        grid: impl Into<Arc<UnstructuredGrid>>,
        array: Option<&str>,
        backend: Box<dyn Backend>,
    ) -> Result<Self, OpenError> {
        let grid = grid.into();
        let (array, values) = values::choose(&grid, array)?;
        let Matter { grid: with_matter, range } = Matter::new(&grid, &values)?;
        let shape = Shape::new(with_matter)?;
        let stacks = Stacks::default();
        let (gradients, table, step_seconds) = (None, None, 0.0);
        Ok(Self { grid, array, values, range, shape, backend, gradients, stacks, step_seconds, table })
    }

    /// Points and cells; its arrays are those that it was opened with.
    pub fn grid(&self) -> &Arc<UnstructuredGrid> {
        &self.grid
    }

    /// Name of the array that is drawn.
    pub fn array(&self) -> &str {
        &self.array
    }

    /// Smallest and largest value at the nodes of cells that hold matter.
    pub fn value_range(&self) -> [f64; 2] {
        self.range
    }

    /// Size of the box around the cells that hold matter.
    pub fn extent(&self) -> DVec3 {
        self.shape.world_bounds[1] - self.shape.world_bounds[0]
    }

    /// A view of all that can be seen of the grid: the camera as near as it can be, the transfer function
    /// [`Preset::Auto`] where [`ViewOptions`] has none.
    pub fn view(&self, options: &ViewOptions) -> View {
        let boxes = |transfer: &TransferFunction| match &options.stack.classification {
            Some(_) => vec![self.shape.world_bounds],
            None => fit::visible_cells(self.shape.slicer.grid(), &self.values, transfer),
        };
        stack::view(options, || self.preset_over(Preset::Auto, options.range), boxes)
    }

    /// The transfer function of a preset for this grid, from the values in cells that hold matter, by their volume.
    pub fn preset(&self, preset: Preset) -> TransferFunction {
        self.preset_over(preset, None)
    }

    /// The same over a range of values, in place of those that are worth colours.
    ///
    /// # Panics
    /// Never: opening found finite values and their range.
    pub fn preset_over(&self, preset: Preset, range: Option<[f64; 2]>) -> TransferFunction {
        let samples = histogram::by_volume(self.shape.slicer.grid(), &self.values);
        let transfer = preset.over(&samples, range, self.extent());
        transfer.expect("opening found finite values and their range")
    }

    /// Draws one picture. What an earlier picture sliced is used again where it is what this one needs.
    ///
    /// # Errors
    /// When the view is not meaningful, the grid cannot be sliced so, or the backend fails.
    pub fn render(&mut self, view: &View) -> Result<Picture, RenderError> {
        self.render_frames(view, 1)
    }

    /// Draws the same picture `num_frames` times and reports the time of each. Of several pictures
    /// [`Slicing::Immediate`] slices for each anew, as for a camera that moves, [`Slicing::Axes`] before the first.
    ///
    /// # Errors
    /// As [`GridSession::render`], and when `num_frames` is 0.
    pub fn render_frames(&mut self, view: &View, num_frames: usize) -> Result<Picture, RenderError> {
        view.check()?;
        view.stack.check()?;
        let mut frames = Frames::default();
        for _ in 0..num_frames {
            if num_frames > 1 {
                self.stacks.forget_immediate();
            }
            let start = Instant::now();
            self.slice(view)?;
            let seconds = start.elapsed().as_secs_f64() + std::mem::take(&mut self.step_seconds);
            let stack = self.stacks.shown(view.stack.slicing, &view.camera).ok_or(RenderError::NoSlice)?;
            frames.draw(stack, &mut self.table, (view, self.range), self.backend.as_mut(), Some(seconds))?;
        }
        let cells = CellType::ALL.iter().zip(self.grid.cells().count_by_type());
        let cells = cells.filter(|(_, count)| *count > 0).map(|(cell_type, count)| (cell_type.name(), count));
        let input = report::Input {
            path: None,
            kind: "grid",
            dims: None,
            cells: Some(cells.collect()),
            scalar: self.values.sample_type().name(),
            place: None,
        };
        let resident = self.stacks.num_bytes();
        frames.picture(view, input, (self.backend.device(), resident), self.shape.build_seconds)
    }

    /// Makes the stacks that a view needs.
    fn slice(&mut self, view: &View) -> Result<(), RenderError> {
        let slicer = &self.shape.slicer;
        if view.stack.needs_gradients() && self.gradients.is_none() {
            self.gradients = Some(node_gradients(slicer.grid(), &self.values));
        }
        let nodes = (&self.values, self.gradients.as_deref());
        Ok(self.stacks.make(&view.stack, &view.camera, slicer, nodes)?)
    }

    /// Compares a picture of this grid with the truth: the exact picture in `f64`, by VTK's interpolation in cells.
    /// Writes the error into the picture's report and returns the truth. `progress` hears a number in [0, 1] now and
    /// then.
    ///
    /// # Errors
    /// When the truth cannot be computed, or the picture is of another size than the view.
    pub fn verify(
        &self,
        view: &View,
        picture: &mut Picture,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<volery_reference::Image, VerifyError> {
        view.stack.check_verifiable()?;
        let tracer = GridTracer::new(self.shape.slicer.grid(), &self.values, &view.transfer)?;
        let View { camera, background, width, height, meshes, .. } = view;
        let truth = tracer.among(meshes).render(camera, *background, *width, *height, progress)?;
        picture.measure(&truth)?;
        Ok(truth)
    }
}
