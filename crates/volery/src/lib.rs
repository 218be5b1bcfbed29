//! Volume visualisation: from a file to a picture, its time, and its distance from the truth.
//!
//! # Objects
//! - An [`Input`] is a file with what a scene file says about it; [`read_input`] reads it.
//! - A [`Backend`] draws: [`open_backend`] takes the best there is.
//! - A [`GridSession`] holds one grid of cells, ready to be sliced, and the stacks made of it; a [`StackSession`] a stack
//!   from a file.
//! - A [`Session`] holds one volume's pyramid and what is resident in a backend. [`Session::open`] costs one
//!   walk over the samples; after that every picture costs what changed.
//! - A [`View`] says what to see: size, camera, transfer function, background, and the dial `tolerance`.
//!   [`Session::view`] fills in what a user leaves open.
//! - A [`Picture`] is pixels and a [`Report`]; [`Session::verify`] adds its distance from the exact picture.
//!
//! # Guarantees
//! - The same bits for any number of threads.
//! - A tolerance of 0 is the full resolution, bit for bit.
//! - Beside the samples and what the backend keeps, drawing needs the coarse levels (1/7 of the samples) and
//!   [`technique::residency::BATCH_BYTES`].
//! - No input panics. An error is one line that says what was found and what was expected.
//!
//! # Non-goals
//! Lighting and shading of volumes; windows and interaction.

mod backend;
pub mod error;
pub mod fit;
mod grid_session;
pub mod histogram;
pub mod info;
mod input;
pub mod output;
mod ray_budget;
pub mod report;
mod session;
mod stack_session;
pub mod technique;
mod texels;
pub mod transfer;

pub use backend::{BackendChoice, BackendError, open_backend};
pub use grid_session::{
    GridSession, OpenError as GridOpenError, SliceCounts, Slices, SlicesError, StepChange,
};
pub use histogram::Histogram;
pub use info::{GridInfo, Info, StackInfo};
pub use input::{Input, InputData, InputError, InputOptions, InputPlan, read_input};
pub use report::Report;
pub use session::{
    BACKGROUND, Focus, OpenError, Picture, PlaneView, Progressive, Refinements, RenderError, Session, Step,
    VerifyError, View, ViewOptions,
};
pub use stack_session::{OpenError as StackOpenError, StackSession};
pub use technique::Technique;
pub use technique::stack::{Slicing, StackView};
pub use transfer::{ColorMap, Preset};

pub use glam;
pub use volery_frame::{Backend, Device, DeviceKind, Image, Sampling, Thickness};
pub use volery_io as io;
pub use volery_reference as reference;
pub use volery_scene::{
    Camera, CellType, Cells, ControlPoint, Plane, Projection, SampleType, Samples, TransferFunction,
    TransferFunction2d, UnstructuredGrid, VoxelGrid, camera, grid,
};
pub use volery_slicing::QuantizedMesh;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
