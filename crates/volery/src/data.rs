//! What is drawn: a volume, a grid of cells, or slices that were made before.

mod grid;
mod stack;
mod volume;

use glam::DVec3;
use volery_io::World;
use volery_pyramid::NodeSource;
use volery_scene::{Placement, TransferFunction};

use crate::report;
use crate::technique::Technique;
use crate::transfer::Preset;
use crate::view::How;

pub use grid::{GridData, GridError, SliceCounts, Slices, SlicesError, StepChange};
pub use stack::{StackData, StackError};
pub use volume::{BRICK_CELLS, VolumeData, VolumeError};

/// What a session can draw.
pub trait Data: Send + Sized + 'static {
    /// Every technique that draws it.
    fn techniques() -> Vec<Box<dyn Technique<Self>>>;

    /// How it is drawn where nobody says how.
    fn suiting(&self) -> How;

    /// Smallest and largest finite value; of colours, 0 and 255.
    fn value_range(&self) -> [f64; 2];

    /// The box around it.
    fn world_bounds(&self) -> [DVec3; 2];

    /// Its size.
    fn extent(&self) -> DVec3 {
        let [low, high] = self.world_bounds();
        high - low
    }

    /// Where the space of its techniques lies in the world.
    fn placement(&self) -> Placement {
        Placement::default()
    }

    /// What the axes of the world mean.
    fn world(&self) -> World {
        World::Plain
    }

    /// The transfer function of a preset for its values, of colours for their first channel; over a range of values, in
    /// place of those that are worth colours.
    fn preset_over(&self, preset: Preset, range: Option<[f64; 2]>) -> TransferFunction;

    /// Whether it has colours of its own, which no transfer function changes.
    fn has_colors(&self) -> bool {
        false
    }

    /// Whether values may be classified together with the magnitude of their gradient.
    fn has_magnitudes(&self) -> bool {
        false
    }

    /// As a report names it.
    fn input(&self) -> report::Input;

    /// Seconds that it took to make it ready.
    fn build_seconds(&self) -> f64;

    /// Where its bricks come from.
    fn bricks(&self) -> Option<&dyn NodeSource> {
        None
    }
}
