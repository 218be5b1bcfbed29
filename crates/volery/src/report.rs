//! What a picture was made from, how long it took, and how far it is from the truth: one JSON object.
//!
//! A field that is missing does not apply or is not known; it is never zero for unknown.

use std::collections::BTreeMap;

use glam::DAffine3;
use serde::Serialize;
use volery_frame::{Device, DeviceKind};
use volery_io::scene_file::{SceneOrientation, SceneTransfer, serialize_camera, serialize_transfer};
use volery_io::{OpenedFile, World};
use volery_scene::Camera;

use crate::view::{Transfer, View};

pub use crate::ray_budget::RayBudget;

/// Everything about one picture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Of the library that drew.
    pub version: &'static str,
    /// What was drawn.
    pub input: Input,
    /// Every file that was read for it; missing for what came from memory.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub inputs: Vec<InputFile>,
    /// How: `raycast`, `plane`, `fans`, `stack`.
    pub technique: &'static str,
    /// Of fans, how lengths in cubes were found: `exact` or `interpolated`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thickness: Option<&'static str>,
    /// By whom.
    pub backend: Backend,
    /// Size of the picture.
    pub image: ImageSize,
    /// Where it was seen from, as a scene file has it.
    #[serde(serialize_with = "serialize_camera")]
    pub camera: Camera,
    /// Colour and opacity of values, as a scene file has them; missing where samples are colours.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "serialize_transfer")]
    pub transfer_function: Option<SceneTransfer>,
    /// Where the time went.
    pub seconds: Seconds,
    /// Every frame, in order.
    pub frames: Vec<Frame>,
    /// How much there was to do.
    pub work: Work,
    /// What the picture was asked to cost or to be allowed to miss.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dial: Option<Dial>,
    /// How far the picture is from the truth, where that is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<Error>,
}

/// What was drawn.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Input {
    /// The file; missing for a volume from memory.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<String>,
    /// `volume`, or `image` for a single slice, `grid` for cells, `stack` for slices from a file.
    pub kind: &'static str,
    /// Samples along x, y, z; of volumes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dims: Option<[usize; 3]>,
    /// Cells of each type that occurs; of grids.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cells: Option<BTreeMap<&'static str, usize>>,
    /// Type of a sample: `u8`, `f32`, ...
    pub scalar: &'static str,
    /// Where samples lie in the world of their file; missing if the file says no more than their distances.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub place: Option<Place>,
}

/// Where samples lie in the world of their file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Place {
    /// Which way the axes of the samples run, as `LPS` or `+x -y +z`.
    pub orientation: String,
    /// From the index of a sample to its place: three rows, each of the factors of x, y, z and what is added. Of
    /// anatomical files the world runs to the right, to the front and to the head.
    pub world_from_index: [[f64; 4]; 3],
    /// The world that the camera is in: `file`, that of the file, or `index`, where samples are at index times spacing.
    pub drawn_by: &'static str,
}

impl Place {
    /// That of a volume; `None` for other data, and if its file says no more than distances.
    pub fn of(input: &crate::Input) -> Option<Self> {
        let volume = input.volume().ok()?;
        let world_from_index = volume.grid.world_from_index();
        let is_plain = world_from_index == DAffine3::from_scale(volume.grid.spacing());
        let (matrix, origin) = (world_from_index.matrix3, world_from_index.translation);
        let row = |axis| matrix.row(axis).extend(origin[axis]).to_array();
        let place = || Self {
            orientation: volume.orientation().to_string(),
            world_from_index: [row(0), row(1), row(2)],
            drawn_by: match input.orientation {
                SceneOrientation::File => "file",
                SceneOrientation::Index => "index",
            },
        };
        (volume.world == World::Anatomical || !is_plain).then(place)
    }
}

/// A file that was read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct InputFile {
    /// Where it is.
    pub path: String,
    /// Its size.
    pub bytes: u64,
}

impl From<&OpenedFile> for InputFile {
    fn from(OpenedFile { path, bytes }: &OpenedFile) -> Self {
        Self { path: path.to_string_lossy().into_owned(), bytes: *bytes }
    }
}

/// Who drew.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Backend {
    /// `software` or `wgpu`.
    pub kind: &'static str,
    /// Name of the device.
    pub device: String,
    /// Why a GPU that was found does not draw.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub in_place_of: Option<String>,
}

/// Size of a picture in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct ImageSize {
    /// From left to right.
    pub width: u32,
    /// From top to bottom.
    pub height: u32,
}

/// Where the time went. `select`, `upload` and `draw` are those of the frame that `frame` is of: the median
/// one (of an even number the faster of the two in the middle).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Seconds {
    /// Reading and decoding the file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub load: Option<f64>,
    /// Building the pyramid; of grids, numbering edges.
    pub build: f64,
    /// Choosing and ordering the nodes or sheets, and integrating the transfer function.
    pub select: f64,
    /// Slicing; of grids.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub geometry: Option<f64>,
    /// Making bricks resident, reading them included; of volumes. Slices are uploaded as they are drawn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub upload: Option<f64>,
    /// Drawing and reading the picture back.
    pub draw: f64,
    /// What a user waits for per picture once data are loaded: select, geometry, upload, draw.
    pub frame: f64,
}

/// One frame of several.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Frame {
    /// All of it.
    pub seconds: f64,
    /// Of one with a deadline.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub paced: Option<PacedFrame>,
}

/// How a frame was drawn by a deadline.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PacedFrame {
    /// What it was asked to take.
    pub budget_seconds: f64,
    /// What it was expected to take when its parts were chosen.
    pub predicted_seconds: f64,
    /// Spent on decisions.
    pub control_seconds: f64,
    /// Parts that were drawn.
    pub parts: usize,
    /// Those among them that drew something again, finer.
    pub refinements: usize,
    /// Share of the pixels that have a ray or sample of their own.
    pub rays_per_pixel: f64,
    /// Level of detail of the data: 0 is the finest.
    pub rung: usize,
    /// Whether nothing could be drawn more coarsely.
    pub is_at_floor: bool,
}

/// How much there was to do.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Work {
    /// Nodes drawn; of volumes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nodes: Option<usize>,
    /// Nodes drawn of each level, the finest first; of volumes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nodes_by_level: Option<Vec<usize>>,
    /// Bricks that became resident for these frames; of volumes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bricks: Option<usize>,
    /// What the backend holds after the last frame: bricks, or vertices and triangles of stacks.
    pub bytes_resident: u64,
    /// Texels, or vertices and triangles, sent to the backend for these frames.
    pub bytes_uploaded: u64,
    /// Polygons in which planes cut the nodes or cells drawn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub polygons: Option<usize>,
    /// Planes that met cells; of grids.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slices: Option<usize>,
    /// Triangles of the fans of the cubes drawn, whichever way the backend takes to draw them; of a stack, those of
    /// its slices and of its outline.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub triangles: Option<usize>,
}

/// The dials that were turned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Dial {
    /// Largest difference of a value from the full resolution, as a fraction of the file's value range.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<f64>,
    /// Largest difference of a colour channel from the full resolution.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<f64>,
    /// Milliseconds until the picture was to be there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub budget_ms: Option<f64>,
    /// Bytes of device memory that bricks might take.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub memory: Option<u64>,
    /// Where somebody looked, as shares of the picture.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gaze: Option<[f64; 2]>,
    /// Of a focus: how many of its diagonals away a node may be drawn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quality: Option<f64>,
}

/// Distance from the truth, of colour channels in [0, 1].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Error {
    /// No channel of any pixel differs by more, because data are coarse; computed without the truth. Of planes that is
    /// against the picture of the full resolution: what separates that from the truth (rounding to texels, and of `f32`)
    /// comes on top. Of rays it is against the exact picture, and `budget` comes on top.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bound_max: Option<f64>,
    /// The root mean square over all pixels of what they may differ by: no rmse is above it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bound_rms: Option<f64>,
    /// With a budget of memory: what the root mean square of the difference from the full resolution is predicted to be,
    /// by which the cut was chosen. No bound, and its errors are larger than rounding's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub predicted_rmse: Option<f64>,
    /// What the bounds are against.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bound_against: Option<&'static str>,
    /// Of rays: what each stage may add to the distance from the exact picture of the field that is drawn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub budget: Option<RayBudget>,
    /// What was found by comparing pictures.
    #[serde(flatten)]
    pub measured: Option<Measured>,
}

/// Distance of a picture from the true one, of colour channels in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Measured {
    /// Largest difference of any channel of any pixel.
    pub measured_max: f64,
    /// Root of the mean squared difference over all channels of all pixels.
    pub measured_rmse: f64,
    /// The same in decibels; missing where pictures are equal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measured_psnr_db: Option<f64>,
    /// What the truth was, for the measured numbers.
    pub against: &'static str,
}

impl Backend {
    pub(crate) fn of(device: Device) -> Self {
        let kind = match device.kind {
            DeviceKind::Software => "software",
            DeviceKind::Gpu | DeviceKind::CpuDevice => "wgpu",
        };
        Self { kind, device: device.name, in_place_of: device.in_place_of }
    }
}

/// The transfer function of a view, as a scene has it.
pub(crate) fn transfer_of(view: &View) -> SceneTransfer {
    match &view.transfer {
        Transfer::Magnitudes(function) => SceneTransfer::Magnitudes(function.as_ref().clone()),
        Transfer::Values(transfer) => SceneTransfer::Values(transfer.clone()),
    }
}

/// What bounds of rays are against.
pub(crate) const AGAINST_EXACT: &str = "the exact picture, but for what `budget` says";

/// The version of this library.
pub(crate) const VERSION: &str = env!("CARGO_PKG_VERSION");

impl Report {
    /// The report as the JSON text that `--report` writes.
    ///
    /// # Panics
    /// Never: there is nothing in a report that JSON cannot hold.
    pub fn to_json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).expect("plain data without maps");
        text.push('\n');
        text
    }
}
