//! The octree over a voxel pyramid: which nodes to draw, and in which order.
//!
//! # Method
//! A [`Filter`] answers [`Answer::Skip`], [`Answer::Draw`] or [`Answer::Descend`] for a node; [`select()`]
//! walks from the root and asks it (LaMar and others 2000, section 4.1). That is the one mechanism: data
//! tolerance, view frustum and transparency are filters ([`filters`]), a tuple of filters is a filter, and
//! so is a closure. The result, a [`Cut`], is plain data; [`validate`](validate::defects) lists what is
//! wrong with one that came from elsewhere. [`balance()`] refines a cut until nodes that touch differ by one
//! level at most. [`front_to_back`] sorts a cut for the eye. Where bytes are limited, a [`Tradeoff`] says what they buy
//! at best.
//!
//! # Guarantees
//! - Drawn and skipped nodes of a selected cut cover the domain exactly once, each sample belonging to one.
//! - Filters that skip do so only when nothing of the node can be seen, rounding included.
//! - The visibility order is exact for every position of the eye, inside the domain too.
//! - A balanced cut is the coarsest one that refines its input.
//! - Selecting and ordering are linear in the nodes visited; nothing depends on threads or hashing.
//!
//! # Non-goals
//! No samples, no pictures, no clock.
//!
//! Arithmetic is in integers or `f64`: it decides what is seen, and costs nothing beside the bricks.

pub mod balance;
pub mod blend;
pub mod budget;
pub mod certify;
pub mod cut;
pub mod filters;
pub mod order;
pub mod seams;
pub mod section;
pub mod select;
pub mod validate;

pub use balance::balance;
pub use blend::low_corners;
pub use budget::{Balanced, BudgetTooSmall, Budgeted, Held, Price, Tradeoff, Uncovered};
pub use certify::{Certified, certified, without_unseen};
pub use cut::Cut;
pub use filters::{CuttingPlanes, DataTolerance, Focus, Frustum, Transparency};
pub use order::{Viewpoint, front_to_back};
pub use seams::{Joined, joined, seams};
pub use section::{IndexPlane, Section, section};
pub use select::{Answer, Filter, select};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
