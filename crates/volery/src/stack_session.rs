//! A stack from a file and a backend, kept from picture to picture.

use std::time::Instant;

use glam::DVec3;
use volery_frame::Backend;
use volery_scene::{Samples, TransferFunction};
use volery_slicing::QuantizedMesh;

use crate::fit::Direction;
use crate::report;
use crate::session::{Picture, RenderError, View, ViewOptions};
use crate::technique::stack::{self, Frames, Stack, Tabulated};
use crate::transfer::Preset;

/// Draws slices that were made elsewhere: [`volery_io::read_stack`]. Which planes, and whether vertices are quantised,
/// is not for a view to say; there is no truth to compare with.
pub struct StackSession {
    stack: Stack,
    range: [f64; 2],
    world_bounds: [DVec3; 2],
    table: Option<Tabulated>,
    backend: Box<dyn Backend>,
    build_seconds: f64,
}

/// Why a stack cannot be drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum OpenError {
    /// There is nothing to see.
    #[error("0 vertices with finite places and values, expected at least one")]
    Empty,
}

impl StackSession {
    /// Makes a stack ready.
    ///
    /// # Errors
    /// When it has no vertex.
    pub fn open(mesh: QuantizedMesh, backend: Box<dyn Backend>) -> Result<Self, OpenError> {
        let start = Instant::now();
        let stack = Stack::of_file(mesh);
        let range = values(&stack).range(0).ok_or(OpenError::Empty)?;
        let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        let world_bounds = stack.points().iter().fold(none, |[low, high], &[x, y, z, _]| {
            let place = stack.origin() + DVec3::new(x.into(), y.into(), z.into());
            [low.min(place), high.max(place)]
        });
        let build_seconds = start.elapsed().as_secs_f64();
        Ok(Self { stack, range, world_bounds, table: None, backend, build_seconds })
    }

    /// Smallest and largest value at the vertices.
    pub fn value_range(&self) -> [f64; 2] {
        self.range
    }

    /// Size of the box around the vertices.
    pub fn extent(&self) -> DVec3 {
        self.world_bounds[1] - self.world_bounds[0]
    }

    /// Whether vertices have gradients, as light and classification by magnitude need.
    pub fn has_gradients(&self) -> bool {
        self.stack.has_gradients()
    }

    /// A view of all of it, straight at its slices where the options have no direction: seen from the side, slices
    /// are lines. Else as [`GridSession::view`](crate::GridSession::view).
    pub fn view(&self, options: &ViewOptions) -> View {
        let direction = options.direction.unwrap_or_else(|| Direction::facing(self.stack.normal()));
        let options = ViewOptions { direction: Some(direction), ..options.clone() };
        let transfer = || self.preset_over(Preset::Auto, options.range);
        stack::view(&options, transfer, |_| vec![self.world_bounds])
    }

    /// The transfer function of a preset, from the values at the vertices.
    pub fn preset(&self, preset: Preset) -> TransferFunction {
        self.preset_over(preset, None)
    }

    /// The same over a range of values, in place of those that are worth colours.
    ///
    /// # Panics
    /// Never: opening found finite values.
    pub fn preset_over(&self, preset: Preset, range: Option<[f64; 2]>) -> TransferFunction {
        preset.over(&values(&self.stack), range, self.extent()).expect("opening found finite values")
    }

    /// Draws the same picture `num_frames` times and reports the time of each.
    ///
    /// # Errors
    /// When the view is not meaningful or needs gradients that there are not, `num_frames` is 0, or the backend fails.
    pub fn render_frames(&mut self, view: &View, num_frames: usize) -> Result<Picture, RenderError> {
        view.check()?;
        if view.stack.needs_gradients() && !self.has_gradients() {
            return Err(RenderError::NoGradients);
        }
        let mut frames = Frames::default();
        for _ in 0..num_frames {
            frames.draw(&mut self.stack, &mut self.table, (view, self.range), self.backend.as_mut(), None)?;
        }
        let input =
            report::Input { path: None, kind: "stack", dims: None, cells: None, scalar: "u16", place: None };
        frames.picture(view, input, (self.backend.device(), self.stack.num_bytes()), self.build_seconds)
    }
}

fn values(stack: &Stack) -> Samples {
    stack.points().iter().map(|point| point[3]).collect::<Vec<f32>>().into()
}
