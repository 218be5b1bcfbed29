//! What Volery draws and from where: a [`VoxelGrid`] or an [`UnstructuredGrid`], a
//! [`TriangleMesh`], a [`Camera`], a [`TransferFunction`] or [`TransferFunction2d`].
//!
//! Plain data and its validation, in `f64`; every other crate of Volery speaks in these types.
//!
//! # Conventions
//! - *Space* of a grid: sample `(i, j, k)` lies at `(i, j, k) * spacing`, the first at the origin. The
//!   domain is the hull of the samples, `[0, (n - 1) * spacing]`; inside, the field is trilinear.
//! - *World*: what cameras, planes and meshes are in. It is the space of the grid, but for a [`Placement`].
//! - *Blank*: a sample that is NaN or infinite. A cell with a blank corner holds no matter.
//! - *Light*: emission and absorption, `I = ∫ c s T dt + T_end * background` with `T = exp(-∫ s)`, where
//!   `c` is the straight colour and `s` the extinction per world length.
//! - *Pictures*: row 0 is the top; a pixel's ray goes through its centre; colour is linear, without gamma.
//!
//! # Non-goals
//! No file formats, no pyramid, no pictures: see `volery-io`, `volery-pyramid`, `volery-frame`.

pub mod camera;
pub mod grid;
pub mod history;
pub mod mesh;
pub mod placement;
pub mod plane;
pub mod quantization;
pub mod revision;
pub mod samples;
pub mod transfer;
pub mod transfer2d;
pub mod unstructured;

pub use camera::{Camera, Projection, Ray, RayGrid};
pub use grid::VoxelGrid;
pub use history::History;
pub use mesh::TriangleMesh;
pub use placement::Placement;
pub use plane::Plane;
pub use quantization::Quantization;
pub use revision::Revision;
pub use samples::{Array, Sample, SampleType, Samples};
pub use transfer::{ControlPoint, TransferFunction};
pub use transfer2d::TransferFunction2d;
pub use unstructured::{CellType, Cells, UnstructuredGrid};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
