//! What else is in use, to compare with: the same trait, so that a simulator and a renderer drive all alike.
//!
//! - [`FixedLevels`]: the finest always, or the coarsest within a fixed tolerance.
//! - [`Feedback`]: the tolerance follows the last frame's time, by PI control or by fuzzy rules, as in Li and Shen,
//!   "Adaptive volume rendering using fuzzy logic control" (2001).
//! - [`FourSteps`]: pixels in four sizes, as the volume mappers of VTK choose them.
//! - [`ResolutionScaling`]: pixels of any size by a history of frames, as games do.
//!
//! None looks at the time within a frame: each draws every item once, in the order given. All learn from
//! [`Controller::finish`](crate::Controller::finish) alone, and ignore frames whose time is no positive number.

mod feedback;
mod fixed;
mod scaling;
mod script;

pub use feedback::{Feedback, Law};
pub use fixed::FixedLevels;
pub use scaling::{FourSteps, ResolutionScaling};
