//! What can go wrong in a session.

use volery_frame::DrawError;
use volery_frame::planes::MAX_PLANES;
use volery_scene::{SampleType, camera, plane};

use crate::interest::Interest;
use crate::residency;
use crate::technique::stack;
use crate::view::{Deadline, Dial, Focus};

/// Why a picture could not be made.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// A technique for other data.
    #[error("{technique}: data are a {found}, expected {}", if *.technique == "stack" { "cells or slices" } else { "a volume" })]
    OtherData {
        /// Name of the technique.
        technique: &'static str,
        /// What the data are.
        found: &'static str,
    },
    /// A dial that the technique does not obey.
    #[error("{technique}: dial is {dial:?}, expected {}", match *.technique { "stack" => "Full or Deadline", "fans" => "Full or Tolerance", _ => "Full, Tolerance, Error or Deadline" })]
    Dial {
        /// Name of the technique.
        technique: &'static str,
        /// As given.
        dial: Dial,
    },
    /// A transfer function of gradients where there are none.
    #[error("{technique}: transfer function reads magnitudes of gradients, expected one of values")]
    Magnitudes {
        /// Name of the technique.
        technique: &'static str,
    },
    /// Samples that are colours.
    #[error(
        "{technique}: samples are {found}, expected one channel of numbers (technique plane draws colours)"
    )]
    Colors {
        /// Name of the technique.
        technique: &'static str,
        /// Type of the samples.
        found: SampleType,
    },
    /// An axis along which there is nothing to integrate.
    #[error("{technique}: {} x {} x {} samples, expected at least 2 along each axis (technique plane draws images)", .dims[0], .dims[1], .dims[2])]
    Flat {
        /// Name of the technique.
        technique: &'static str,
        /// Samples along x, y, z.
        dims: [usize; 3],
    },
    /// An axis that is longer than cubes can be numbered.
    #[error("fans: {} x {} x {} samples, expected at most {max} along each axis", .dims[0], .dims[1], .dims[2])]
    TooLong {
        /// Samples along x, y, z.
        dims: [usize; 3],
        /// Most along an axis.
        max: usize,
    },
    /// The camera cannot take a picture.
    #[error(transparent)]
    Camera(#[from] camera::Defect),
    /// A tolerance that is no fraction of the range.
    #[error("tolerance is {found}, expected a number of at least 0")]
    Tolerance {
        /// As given.
        found: f64,
    },
    /// A deadline that is no time, or a gaze that is at no place of the picture.
    #[error("deadline {} s with gaze {:?}, expected a number of at least 0, and shares from 0 to 1", .found.budget_secs, .found.gaze)]
    Deadline {
        /// As given.
        found: Deadline,
    },
    /// A background that is no colour.
    #[error("background is {found:?}, expected three numbers in [0, 1]")]
    Background {
        /// As given.
        found: [f64; 3],
    },
    /// A picture without pixels.
    #[error("picture of {width}x{height} pixels, expected at least 1x1")]
    Empty {
        /// Pixels from left to right.
        width: u32,
        /// Pixels from top to bottom.
        height: u32,
    },
    /// A plane that is none.
    #[error("plane {index}: {defect}")]
    Plane {
        /// Which of the view's planes.
        index: usize,
        /// What is wrong with it.
        defect: plane::Defect,
    },
    /// No plane to draw, or too many.
    #[error("{found} planes, expected 1 to {MAX_PLANES}")]
    NumPlanes {
        /// As given.
        found: usize,
    },
    /// A focus that is no place, or a quality that is no number.
    #[error("focus {} of quality {}, expected finite coordinates and a quality of at least 0", .found.point, .found.quality)]
    Focus {
        /// As given.
        found: Focus,
    },
    /// A largest error that is no difference of colours.
    #[error("error is {found}, expected a number from 0 to 1")]
    MaxError {
        /// As given.
        found: f64,
    },
    /// A budget of memory that holds not even the coarsest cut.
    #[error(
        "memory is {found} bytes, expected at least {least}: the coarsest cut of this view takes that many"
    )]
    Memory {
        /// As given.
        found: u64,
        /// What is needed on this backend.
        least: u64,
    },
    /// A region of interest that is none, or that nothing reads.
    #[error(
        "{found:?} with dial {dial:?}, expected finite coordinates in order, a radius above 0, a weight of at least 0, and a budget of memory"
    )]
    Interest {
        /// As given.
        found: Interest,
        /// Of the view.
        dial: Dial,
    },
    /// A technique whose pictures are made at once.
    #[error("progressive: technique {technique}, expected plane")]
    NotProgressive {
        /// Its name.
        technique: &'static str,
    },
    /// No planes to slice cells by.
    #[error("0 slices, expected at least 1")]
    NoSlice,
    /// Light, or classification by magnitude, of vertices that have none.
    #[error("the stack has no gradients, expected some for light and for classification by their magnitude")]
    NoGradients,
    /// Cells could not be sliced.
    #[error(transparent)]
    Stack(#[from] stack::Error),
    /// Nobody knows how far a picture can be from the exact one.
    #[error("bounds of pixels are known of raycast without a deadline, found {technique}{}", if *.has_deadline { " with a deadline" } else { "" })]
    NoBound {
        /// What draws.
        technique: &'static str,
        /// Whether it is the deadline's fault.
        has_deadline: bool,
    },
    /// No frame was asked for.
    #[error("0 frames, expected at least 1")]
    NoFrame,
    /// Bricks could not be made resident.
    #[error(transparent)]
    Bricks(#[from] residency::Error),
    /// The backend could not draw.
    #[error(transparent)]
    Draw(#[from] DrawError),
}

/// Why a picture could not be compared with the truth.
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// There is no such picture.
    #[error(transparent)]
    View(#[from] Box<RenderError>),
    /// The picture shows what the reference does not.
    #[error("reference: knows no {what}, expected a picture without")]
    Unknown {
        /// What is shown.
        what: &'static str,
    },
    /// The truth could not be computed.
    #[error("reference: {0}")]
    Reference(#[from] volery_reference::Error),
    /// The picture has not as many pixels as it says.
    #[error(transparent)]
    Pixels(#[from] volery_reference::SizeMismatch),
    /// The picture is of another size than the view.
    #[error(transparent)]
    Size(#[from] volery_reference::metrics::Error),
}
