//! A grid of cells, ready to be sliced.
//!
//! Making it ready numbers the grid's edges once. After that a picture costs what changed: of a new direction of
//! view the slicing, which [`Slicing::Axes`](crate::Slicing::Axes) spares, of a new time step an interpolation, of a
//! new transfer function drawing alone.

mod error;
mod slices;
mod values;

use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;
use volery_frame::Revision;
use volery_scene::{CellType, Samples, TransferFunction, UnstructuredGrid};
use volery_slicing::{Slicer, node_gradients};

use super::Data;
use crate::technique::{Technique, stack};
use crate::transfer::Preset;
use crate::view::{How, StackView};
use crate::{histogram, report};

pub use error::GridError;
pub use slices::{SliceCounts, Slices, SlicesError};
pub use values::StepChange;

use values::Matter;

/// A grid with the edges of its cells, and the values of one of its arrays.
pub struct GridData {
    grid: Arc<UnstructuredGrid>,
    /// Name of the array that is drawn.
    array: String,
    /// Of the array, one per node.
    values: Samples,
    /// Names the values.
    revision: Revision,
    /// Of the nodes of cells that hold matter.
    range: [f64; 2],
    shape: Shape,
    /// At the nodes, once they were needed.
    gradients: Option<Vec<DVec3>>,
    /// What the last time step took, until a picture says so.
    step_seconds: f64,
}

/// What does not depend on values: of the cells that hold matter.
struct Shape {
    slicer: Slicer,
    world_bounds: [DVec3; 2],
    /// Names points and cells.
    revision: Revision,
    build_seconds: f64,
}

impl Shape {
    fn new(grid: Arc<UnstructuredGrid>) -> Result<Self, GridError> {
        let start = Instant::now();
        let world_bounds = grid.world_bounds().ok_or(GridError::Blank)?;
        let longest = (world_bounds[1] - world_bounds[0]).max_element();
        if !(longest > 0.0 && longest <= GridError::MAX_EXTENT) {
            return Err(GridError::Extent { bounds: world_bounds });
        }
        let slicer = Slicer::new(grid)?;
        let build_seconds = start.elapsed().as_secs_f64();
        Ok(Self { slicer, world_bounds, revision: Revision::new(), build_seconds })
    }
}

impl GridData {
    /// Makes a grid ready: one of its arrays by name, else the first.
    ///
    /// # Errors
    /// When there is no such array, every cell is blank, or there are too many edges.
    pub fn new(grid: impl Into<Arc<UnstructuredGrid>>, array: Option<&str>) -> Result<Self, GridError> {
        let grid = grid.into();
        let (array, values) = values::choose(&grid, array)?;
        let Matter { grid: with_matter, range } = Matter::new(&grid, &values)?;
        let shape = Shape::new(with_matter)?;
        let revision = Revision::new();
        Ok(Self { grid, array, values, revision, range, shape, gradients: None, step_seconds: 0.0 })
    }

    /// Points and cells; its arrays are those that it was made with.
    pub fn grid(&self) -> &Arc<UnstructuredGrid> {
        &self.grid
    }

    /// Name of the array that is drawn.
    pub fn array(&self) -> &str {
        &self.array
    }

    /// The grid with cells blank where values are.
    pub(crate) fn with_matter(&self) -> &UnstructuredGrid {
        self.shape.slicer.grid()
    }

    pub(crate) fn slicer(&self) -> &Slicer {
        &self.shape.slicer
    }

    pub(crate) fn values(&self) -> &Samples {
        &self.values
    }

    /// Names points and cells.
    pub(crate) fn shape_revision(&self) -> Revision {
        self.shape.revision
    }

    /// Names the values.
    pub(crate) fn values_revision(&self) -> Revision {
        self.revision
    }

    /// At the nodes, if they were made.
    pub(crate) fn gradients(&self) -> Option<&[DVec3]> {
        self.gradients.as_deref()
    }

    pub(crate) fn make_gradients(&mut self) {
        if self.gradients.is_none() {
            self.gradients = Some(node_gradients(self.shape.slicer.grid(), &self.values));
        }
    }

    /// What the last time step took, once.
    pub(crate) fn take_step_seconds(&mut self) -> f64 {
        std::mem::take(&mut self.step_seconds)
    }
}

impl Data for GridData {
    fn techniques() -> Vec<Box<dyn Technique<Self>>> {
        vec![Box::<stack::OfGrid>::default()]
    }

    fn suiting(&self) -> How {
        How::Stack(StackView::default())
    }

    /// At the nodes of cells that hold matter.
    fn value_range(&self) -> [f64; 2] {
        self.range
    }

    /// Around the cells that hold matter.
    fn world_bounds(&self) -> [DVec3; 2] {
        self.shape.world_bounds
    }

    /// From the values in cells that hold matter, by their volume.
    ///
    /// # Panics
    /// Never: making it ready found finite values and their range.
    fn preset_over(&self, preset: Preset, range: Option<[f64; 2]>) -> TransferFunction {
        let samples = histogram::by_volume(self.with_matter(), &self.values);
        let transfer = preset.over(&samples, range, self.extent());
        transfer.expect("making it ready found finite values and their range")
    }

    fn has_magnitudes(&self) -> bool {
        true
    }

    fn input(&self) -> report::Input {
        let cells = CellType::ALL.iter().zip(self.grid.cells().count_by_type());
        let cells = cells.filter(|(_, count)| *count > 0).map(|(cell_type, count)| (cell_type.name(), count));
        report::Input {
            path: None,
            kind: "grid",
            dims: None,
            cells: Some(cells.collect()),
            scalar: self.values.sample_type().name(),
            place: None,
        }
    }

    fn build_seconds(&self) -> f64 {
        self.shape.build_seconds
    }
}
