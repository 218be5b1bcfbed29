//! Values at the nodes: of which array, where there are none, and those of another time.

use std::sync::Arc;
use std::time::Instant;

use volery_frame::Revision;
use volery_scene::{Samples, UnstructuredGrid, for_samples};
use volery_slicing::blank_where_not_finite;

use super::{GridData, GridError, Shape};

/// What a time step changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepChange {
    /// Values alone: stacks stay, and their vertices have new values.
    Values,
    /// Points or cells, or which cells are blank: stacks are sliced anew when they are needed.
    Cells,
}

impl GridData {
    /// Takes another time step: the array of the same name of another grid. From then on pictures are those of new
    /// data of it, bit for bit. Where points and cells are the same, no stack is sliced for that.
    ///
    /// # Errors
    /// As [`GridData::new`]; then nothing has changed.
    pub fn set_step(&mut self, grid: impl Into<Arc<UnstructuredGrid>>) -> Result<StepChange, GridError> {
        let grid = grid.into();
        let (_, values) = choose(&grid, Some(&self.array))?;
        if is_same_shape(&grid, &self.grid) {
            return self.set_values(values);
        }
        let matter = Matter::new(&grid, &values)?;
        self.shape = Shape::new(matter.grid)?;
        (self.grid, self.values, self.range, self.gradients) = (grid, values, matter.range, None);
        self.revision = Revision::new();
        Ok(StepChange::Cells)
    }

    /// As [`GridData::set_step`], with other values at the nodes of the grid that there is.
    ///
    /// # Errors
    /// When there is not one value per node, or as [`GridData::new`]; then nothing has changed.
    pub fn set_values(&mut self, values: impl Into<Samples>) -> Result<StepChange, GridError> {
        let values = values.into();
        let (found, expected) = (values.len(), self.grid.points().len());
        if found != expected {
            return Err(GridError::NumValues { found, expected });
        }
        let start = Instant::now();
        let matter = Matter::new(&self.grid, &values)?;
        let is_kept = is_same_shape(&matter.grid, self.with_matter());
        if !is_kept {
            // Other cells hold matter.
            self.shape = Shape::new(matter.grid)?;
        }
        (self.values, self.range, self.gradients) = (values, matter.range, None);
        self.revision = Revision::new();
        self.step_seconds += start.elapsed().as_secs_f64();
        Ok(if is_kept { StepChange::Values } else { StepChange::Cells })
    }
}

/// Where there is matter, and between which values.
pub(super) struct Matter {
    /// With the cells blank that have a blank value.
    pub(super) grid: Arc<UnstructuredGrid>,
    /// Of the nodes of cells that are not blank.
    pub(super) range: [f64; 2],
}

impl Matter {
    pub(super) fn new(grid: &Arc<UnstructuredGrid>, values: &Samples) -> Result<Self, GridError> {
        let grid = without_blank_values(grid, values);
        let range = of_used_nodes(&grid, values).range(0).ok_or(GridError::Blank)?;
        if (range[1] - range[0]).is_finite() {
            Ok(Self { grid, range })
        } else {
            Err(GridError::TooWide { range })
        }
    }
}

/// The array of this name, else the first.
pub(super) fn choose(grid: &UnstructuredGrid, name: Option<&str>) -> Result<(String, Samples), GridError> {
    let array = match name {
        Some(name) => grid.array(name).ok_or_else(|| {
            let found = grid.arrays().iter().map(|array| array.name.clone()).collect();
            GridError::NoArray { name: name.to_owned(), found }
        })?,
        None => grid.arrays().first().ok_or(GridError::NoArrays)?,
    };
    Ok((array.name.clone(), array.values.clone()))
}

/// The grid with cells around blank values blank; itself if there are none.
fn without_blank_values(grid: &Arc<UnstructuredGrid>, values: &Samples) -> Arc<UnstructuredGrid> {
    let blank = blank_where_not_finite(grid, values);
    if blank.iter().enumerate().all(|(cell, &blank)| blank == grid.is_blank(cell)) {
        return grid.clone();
    }
    let changed = UnstructuredGrid::clone(grid).with_blank(blank);
    Arc::new(changed.expect("one flag was made per cell"))
}

/// The values of nodes that cells with matter have.
pub(super) fn of_used_nodes(drawn: &UnstructuredGrid, values: &Samples) -> Samples {
    let mut is_used = vec![false; drawn.points().len()];
    for (cell, (_, nodes)) in drawn.cells().iter().enumerate() {
        if !drawn.is_blank(cell) {
            nodes.iter().for_each(|&node| is_used[node as usize] = true);
        }
    }
    for_samples!(values, |values| {
        let used = values.iter().zip(&is_used).filter(|(_, is_used)| **is_used);
        used.map(|(value, _)| *value).collect::<Vec<_>>().into()
    })
}

/// Whether two grids have the same points, to the bit, and the same cells, of which the same are blank.
fn is_same_shape(a: &UnstructuredGrid, b: &UnstructuredGrid) -> bool {
    let bits = |grid: &UnstructuredGrid| {
        grid.points().iter().map(|point| point.to_array().map(f64::to_bits)).collect::<Vec<_>>()
    };
    a.points().len() == b.points().len()
        && a.cells() == b.cells()
        && bits(a) == bits(b)
        && (0..a.cells().len()).all(|cell| a.is_blank(cell) == b.is_blank(cell))
}
