//! The truth: pictures in `f64`, straight from the full-resolution samples; and metrics on pictures.
//!
//! Every approximate picture of Volery is judged by the ones made here, so this crate shares no code with the
//! others but [`volery_scene`]'s plain data: no pyramid, no cut, no table, no GPU.
//!
//! # The method
//! A ray meets the cells between eight neighbouring samples one after the other ([`Tracer`] walks them). In
//! each the trilinear field along the ray is exactly a cubic polynomial. Where it crosses the value of a
//! control point, colour and opacity have a kink or a step, so the ray is split there, at the roots of the
//! cubic; inside a *piece*, colour is a cubic, extinction the logarithm of one, and
//! `∫ c s exp(-∫ s) dt` is integrated by Gauss collocation, halving until the halves agree with the whole.
//! (Splitting at control points: S. Weiss, R. Westermann, "Analytic ray splitting for controlled precision
//! DVR", EuroVis 2021. The control of precision is Novins and Arvo's, 1992.)
//!
//! Values are counted twice from something near them: in a cell from one of its samples, and in a piece from
//! the control point where it starts. So neither an offset nor an outlier costs digits, and a shell is as
//! exact as its own width, be it far thinner than the rounding of a place.
//!
//! Unstructured grids are traced cell by cell too, each with VTK's interpolation: [`GridTracer`]. Cutting planes have
//! their own truth, without any integral: [`PlaneScene`].
//!
//! # Guarantees
//! - A pixel is within 1e-9 of the exact integral of the scene given, in colour differences of [0, 1]: an
//!   interval is accepted when its estimated error is below [`PIECE_TOLERANCE`]. Away from poles of the
//!   extinction pictures are within 1e-12. Of unstructured grids a pixel is within 1e-6.
//! - This ends where `f64` does. A ray that turns back within `d` of the value of a step (in units of the range
//!   of a cell) is off by some `1e-16 / sqrt(d)` of a cell in what it has behind the step, at most 4e-8: one
//!   that only touches opacity 1 may be opaque or not, and so may one that has it for less than 1e-16 of a cell,
//!   as at the end of a cell with an outlier of 1e20. The places of faces are rounded to 1e-15 of a cell, so
//!   where a cell is more than 1e5 unit distances long a shell that a face cuts may be off by more than 1e-9.
//! - Time does not depend on offsets.
//! - The same bits whatever the number of threads.
//! - Opacity 1 is exact: a stretch of it is opaque at once and shows its colour where the ray enters it; a
//!   point of it, where extinction has a logarithmic pole, is integrated like any other.
//! - No input that [`volery_scene`] lets through panics or hangs; sample magnitudes above 1e300 may overflow
//!   to pixels that are not numbers.
//!
//! # Conventions beyond those of [`volery_scene`]
//! The domain is closed: rays in its faces and edges are in it. A cell owns its lower faces: where a ray runs
//! exactly between two cells, the upper one counts (it matters only if one of them is blank; of unstructured
//! grids, whose cells have no order, the one that is not). A domain without thickness along some axis holds no
//! matter.
//!
//! # Non-goals
//! Speed at the price of truth; matter of colour samples; classification by gradients, and light.

mod cell;
mod cubic;
mod field;
mod grid;
mod image;
mod integral;
pub mod metrics;
pub mod opacity;
mod planes;
mod render;
mod surfaces;
mod tracer;
mod transfer;

pub use grid::GridTracer;
pub use image::{Image, SizeMismatch};
pub use integral::{Light, PIECE_TOLERANCE};
pub use planes::PlaneScene;
pub use render::{Error, render};
pub use tracer::Tracer;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
