#![doc = include_str!("../README.md")]
//!
//! # Modules
//! - [`scheduler`]: the method, what it guarantees, what it does not.
//! - [`cost`]: what a part will take. [`errors`]: how far that was off.
//! - [`plan`](mod@plan): levels for predicted costs, before a frame begins.
//! - [`item`]: items, levels, parts; the trait of all controllers.
//! - [`importance`]: opacity, distance, area, gaze.
//! - [`controllers`]: what else is in use, to compare with.
//! - [`simulate`]: a device of numbers, to compare on.

mod balance;
pub mod controllers;
pub mod cost;
pub mod errors;
pub mod importance;
pub mod item;
pub mod plan;
pub mod scheduler;
pub mod simulate;

pub use cost::CostModel;
pub use errors::ErrorRecord;
pub use item::{Controller, Item, Level, Part, Step, Summary};
pub use plan::{PlanItem, Rule, plan};
pub use scheduler::{Order, Scheduler, Settings};
