//! Slices from a file.

use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;
use volery_scene::{Samples, TransferFunction};
use volery_slicing::QuantizedMesh;

use super::Data;
use crate::report;
use crate::technique::Technique;
use crate::technique::stack::{OfStack, Stack};
use crate::transfer::Preset;
use crate::view::How;

/// Slices that were made elsewhere: [`volery_io::read_stack`]. Which planes, and whether vertices are quantised, is not
/// for a view to say; there is no truth to compare with.
pub struct StackData {
    stack: Arc<Stack>,
    range: [f64; 2],
    world_bounds: [DVec3; 2],
    build_seconds: f64,
}

/// Why slices cannot be drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StackError {
    /// There is nothing to see.
    #[error("0 vertices with finite places and values, expected at least one")]
    Empty,
}

impl StackData {
    /// Makes slices ready.
    ///
    /// # Errors
    /// When they have no vertex.
    pub fn new(mesh: QuantizedMesh) -> Result<Self, StackError> {
        let start = Instant::now();
        let stack = Stack::of_file(mesh);
        let range = values(&stack).range(0).ok_or(StackError::Empty)?;
        let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let world_bounds = stack.points().iter().fold(none, |[low, high], &[x, y, z, _]| {
            let place = stack.origin() + DVec3::new(x.into(), y.into(), z.into());
            [low.min(place), high.max(place)]
        });
        let build_seconds = start.elapsed().as_secs_f64();
        Ok(Self { stack: Arc::new(stack), range, world_bounds, build_seconds })
    }

    /// Whether vertices have gradients, as light and classification by magnitude need.
    pub fn has_gradients(&self) -> bool {
        self.stack.has_gradients()
    }

    pub(crate) fn stack(&self) -> &Arc<Stack> {
        &self.stack
    }
}

impl Data for StackData {
    fn techniques() -> Vec<Box<dyn Technique<Self>>> {
        vec![Box::<OfStack>::default()]
    }

    fn suiting(&self) -> How {
        How::Slices { is_lit: false }
    }

    /// At the vertices.
    fn value_range(&self) -> [f64; 2] {
        self.range
    }

    /// Around the vertices.
    fn world_bounds(&self) -> [DVec3; 2] {
        self.world_bounds
    }

    /// From the values at the vertices.
    ///
    /// # Panics
    /// Never: making it ready found finite values.
    fn preset_over(&self, preset: Preset, range: Option<[f64; 2]>) -> TransferFunction {
        let transfer = preset.over(&values(&self.stack), range, self.extent());
        transfer.expect("making it ready found finite values")
    }

    fn has_magnitudes(&self) -> bool {
        true
    }

    fn input(&self) -> report::Input {
        report::Input { path: None, kind: "stack", dims: None, cells: None, scalar: "u16", place: None }
    }

    fn build_seconds(&self) -> f64 {
        self.build_seconds
    }
}

fn values(stack: &Stack) -> Samples {
    stack.points().iter().map(|point| point[3]).collect::<Vec<f32>>().into()
}
