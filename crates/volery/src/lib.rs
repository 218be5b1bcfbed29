//! Volume visualisation: from a file to a picture, its time, and its distance from the truth.
//!
//! # Objects
//! - An [`Input`] is a file with what a scene file says about it; [`read_input`] reads it.
//! - A [`Backend`] draws: [`open_backend`] takes the best there is. One serves any number of sessions.
//! - [`VolumeData`], [`GridData`] and [`StackData`] are data ready to be drawn. To make a volume ready costs one walk
//!   over the samples, a grid the numbering of its edges.
//! - A [`Session`] draws them: every picture costs what changed.
//! - A [`View`] says what to see, how ([`How`]: a technique with its options), and how well ([`Dial`]).
//!   [`Session::view`] fills in what a user leaves open.
//! - A [`Picture`] is pixels and a [`Report`]; [`Session::verify`] adds its distance from the exact picture.
//!
//! # Guarantees
//! - The same bits for any number of threads.
//! - A tolerance of 0 is the full resolution, bit for bit.
//! - Beside the samples and what the backend keeps, drawing needs the coarse levels (1/7 of the samples) and
//!   [`residency::BATCH_BYTES`].
//! - No input panics. An error is one line that says what was found and what was expected.
//!
//! # Non-goals
//! Lighting and shading of volumes; windows and interaction.

mod backend;
pub mod color_change;
pub mod data;
pub mod fit;
pub mod histogram;
pub mod info;
mod input;
mod interest;
pub mod matter_bound;
pub mod output;
mod path;
mod ray_budget;
pub mod report;
pub mod residency;
mod session;
pub mod technique;
mod texels;
pub mod transfer;
mod view;

pub use backend::{BackendChoice, BackendError, open_backend};
pub use data::{
    Data, GridData, GridError, SliceCounts, Slices, SlicesError, StackData, StackError, StepChange,
    VolumeData, VolumeError,
};
pub use histogram::Histogram;
pub use info::{GridInfo, Info, StackInfo};
pub use input::{Input, InputData, InputError, InputOptions, InputPlan, read_input};
pub use interest::{Interest, Region};
pub use matter_bound::MatterBound;
pub use path::Path;
pub use report::Report;
pub use session::{Picture, Refinements, RenderError, Session, VerifyError};
pub use technique::planes::{Progressive, Step};
pub use transfer::{ColorMap, Preset};
pub use view::{
    BACKGROUND, Deadline, Dial, Focus, How, PlaneView, Slicing, StackView, Transfer, View, ViewOptions,
};

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
