//! Scene files: what to draw and how, in JSON.
//!
//! ```json
//! {"input": {"file": "engine_256x256x128_uint8.raw"}, "size": [512, 512], "background": [0, 0, 0],
//!  "camera": {"projection": "perspective", "eye": [470, -190, 330], "target": [127, 127, 63],
//!             "up": [0, 0, 1], "fov_y_deg": 30},
//!  "transfer_function": {"points": [{"value": 0, "color": [0, 0, 0], "opacity": 0},
//!                                   {"value": 255, "color": [1, 1, 1], "opacity": 0.5}],
//!                        "unit_distance": 1}}
//! ```
//! `input` with its `file` is all that a scene needs. What is missing is found as it is without a scene; every field but
//! the camera means what the option of its name means on the command line. `docs/scene.schema.json` describes every
//! field. An unknown one is an error, so that a slip of the pen is found.

use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use volery_scene::{Camera, TransferFunction, TransferFunction2d};

use crate::bytes::load_text;
use crate::error::{OneLine, Problem};
use crate::grid::GridOptions;
use crate::layout::Element;
use crate::out::{WriteError, write_atomically};
use crate::volume::ReadOptions;

mod camera;
mod check;
mod transfer;

pub use camera::serialize_camera;
pub use check::{MAX_PIXELS, MAX_SIDE, SizeError, check_interest, check_size};
pub use transfer::serialize as serialize_transfer;

/// Scene files larger than this are refused.
const MAX_FILE_BYTES: u64 = 16 << 20;

/// A scene: what to draw, and as much of how as somebody said.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFile {
    /// Its name, for people.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// What is drawn.
    pub input: SceneInput,
    /// Width and height of the picture in pixels.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "check::size")]
    pub size: Option<[u32; 2]>,
    /// Linear RGB behind everything, each in [0, 1].
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "check::background")]
    pub background: Option<[f64; 3]>,
    /// Where it is seen from; without defects.
    #[serde(default, skip_serializing_if = "Option::is_none", with = "camera")]
    pub camera: Option<Camera>,
    /// Colour and opacity of values.
    #[serde(
        default,
        rename = "transfer_function",
        skip_serializing_if = "Option::is_none",
        with = "transfer"
    )]
    pub transfer: Option<SceneTransfer>,
    /// The values over which automatic colours run.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "check::range")]
    pub range: Option<[f64; 2]>,
    /// How to draw.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub technique: Option<SceneTechnique>,
    /// Largest difference of a value from the full resolution, as a fraction of the value range.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "check::tolerance")]
    pub tolerance: Option<f64>,
    /// Milliseconds until the picture shall be there.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "check::budget")]
    pub budget_ms: Option<f64>,
    /// Bytes of device memory that bricks may take.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub memory: Option<u64>,
    /// Where somebody looks, as shares of the picture from its upper left corner.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "check::gaze")]
    pub gaze: Option<[f64; 2]>,
    /// Regions that matter more than the rest, or less, with `memory`.
    #[serde(default, skip_serializing_if = "Vec::is_empty", deserialize_with = "check::interest")]
    pub interest: Vec<SceneInterest>,
    /// Cutting planes.
    #[serde(default, skip_serializing_if = "Vec::is_empty", deserialize_with = "check::planes")]
    pub planes: Vec<ScenePlane>,
    /// Where planes are in full detail.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "check::focus")]
    pub focus: Option<SceneFocus>,
    /// Largest difference of a colour that coarse data may make, in [0, 1]; of rays and planes.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "check::error")]
    pub error: Option<f64>,
    /// Whether planes let light through where the transfer function's opacity is below 1.
    #[serde(default, skip_serializing_if = "is_false")]
    pub transparent: bool,
    /// Whether planes show the nearest sample in place of interpolating.
    #[serde(default, skip_serializing_if = "is_false")]
    pub nearest: bool,
    /// Whether the nodes of planes are outlined.
    #[serde(default, skip_serializing_if = "is_false")]
    pub show_nodes: bool,
    /// How fans find the length of a ray in a cube.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub thickness: Option<SceneThickness>,
    /// Planes over the extent of a grid.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "check::slices")]
    pub slices: Option<u32>,
    /// Share of a grid's cells that planes are to meet.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "check::adaptive")]
    pub adaptive: Option<f64>,
    /// Whether a grid is sliced along its axes.
    #[serde(default, skip_serializing_if = "is_false")]
    pub axes: bool,
    /// Whether matter of a grid is shaded.
    #[serde(default, skip_serializing_if = "is_false")]
    pub shade: bool,
    /// Whether a grid's slices are drawn from few bytes.
    #[serde(default, skip_serializing_if = "is_false")]
    pub quantized: bool,
    /// Who draws; missing for whoever is best.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub backend: Option<SceneBackend>,
    /// Opaque surfaces among the data.
    #[serde(default, skip_serializing_if = "Vec::is_empty", deserialize_with = "check::meshes")]
    pub meshes: Vec<SceneMesh>,
}

/// The file of a scene and what the scene says about it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneInput {
    /// Volume or grid; missing where the file says so itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kind: Option<InputKind>,
    /// As written: relative to the scene file or the data folder.
    pub file: PathBuf,
    /// Samples along x, y, z, for raw files.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "check::dims")]
    pub dims: Option<[usize; 3]>,
    /// Sample type and byte order, for raw files.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "check::dtype")]
    pub dtype: Option<Element>,
    /// World distance of neighbouring samples, in place of the file's.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "check::spacing")]
    pub spacing: Option<[f64; 3]>,
    /// Where samples are; missing for those at index times spacing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orientation: Option<SceneOrientation>,
    /// The array to draw.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub array: Option<String>,
    /// Which of several numbers of each place to draw, from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub channel: Option<usize>,
    /// Which of several volumes or grids to draw, from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_step: Option<usize>,
}

/// Whether the input is a voxel volume or an unstructured grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum InputKind {
    /// Samples on a regular grid.
    Volume,
    /// Cells.
    Grid,
}

/// Where the samples of a volume are in the world of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SceneOrientation {
    /// Where their file says: in right, anterior, superior for anatomical files.
    File,
    /// At index times spacing, whatever the file says.
    Index,
}

/// How a scene is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SceneTechnique {
    /// Rays through matter.
    Raycast,
    /// Cutting planes.
    Plane,
    /// Cubes of constant value.
    Fans,
    /// Slices through cells.
    Stack,
}

/// How the length of a ray in a cube is found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SceneThickness {
    /// The exact chord.
    Exact,
    /// Linear on the screen.
    Interpolated,
}

/// Who draws a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SceneBackend {
    /// The CPU.
    Software,
    /// The best device that wgpu finds.
    Wgpu,
}

/// Colour and opacity of values, as a scene gives them.
#[derive(Clone, Debug, PartialEq)]
pub enum SceneTransfer {
    /// Over values.
    Values(TransferFunction),
    /// Over values and gradient magnitudes.
    Magnitudes(TransferFunction2d),
    /// By name, for the program to know.
    Preset(String),
}

/// All points x with `normal` . x = `distance`, in world units.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScenePlane {
    /// Of any length above 0.
    pub normal: [f64; 3],
    /// The right side of the equation.
    pub distance: f64,
}

/// Where planes are in full detail.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneFocus {
    /// World position.
    pub point: [f64; 3],
    /// A node is drawn where its centre is farther than so many of its diagonals.
    #[serde(default = "usual_quality")]
    pub quality: f64,
}

/// A region of interest: a box or a sphere.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneInterest {
    /// Least and greatest corner in world space, in place of a sphere.
    #[serde(default, rename = "box", skip_serializing_if = "Option::is_none")]
    pub corners: Option<[[f64; 3]; 2]>,
    /// In place of a box.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sphere: Option<SceneSphere>,
    /// How many times a difference of colour counts there.
    pub weight: f64,
}

/// A sphere in world space.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneSphere {
    /// Its middle.
    pub center: [f64; 3],
    /// Above 0.
    pub radius: f64,
}

/// An opaque surface of a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneMesh {
    /// As written: relative to the scene file or the data folder, for [`read_mesh`](crate::read_mesh).
    pub file: PathBuf,
    /// Linear RGB, each in [0, 1].
    pub color: [f64; 3],
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes fields by reference")]
fn is_false(value: &bool) -> bool {
    !value
}

fn usual_quality() -> f64 {
    1.0
}

impl SceneInput {
    /// How to read the file with [`read_volume`](crate::read_volume).
    pub fn read_options(&self) -> ReadOptions {
        let Self { dims, dtype, spacing, array, channel, time_step, .. } = self.clone();
        let spacing = spacing.map(glam::DVec3::from_array);
        ReadOptions { dims, element: dtype, spacing, array, channel, time_step, ..ReadOptions::default() }
    }

    /// How to read the file with [`read_grid`](crate::read_grid).
    pub fn grid_options(&self) -> GridOptions {
        let Self { array, channel, time_step, .. } = self.clone();
        GridOptions { array, channel, time_step, ..GridOptions::default() }
    }
}

/// A file that could not be read as a scene.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", OneLine(.path.display()))]
pub struct SceneError {
    /// The file as asked for.
    pub path: PathBuf,
    /// What is wrong with it.
    pub problem: SceneProblem,
}

/// What is wrong with a scene.
#[derive(Debug, thiserror::Error)]
pub enum SceneProblem {
    /// The file itself.
    #[error("{0}")]
    File(Problem),
    /// It is no JSON, or a field is missing, unknown, of the wrong type, or has a value that makes no sense.
    #[error("{0}")]
    Json(String),
}

impl SceneFile {
    /// Reads a scene file.
    ///
    /// # Errors
    /// When it cannot be read, is no scene or asks for something impossible: one line that names the field.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        let fail = |problem| SceneError { path: path.to_owned(), problem };
        let text = load_text(path, MAX_FILE_BYTES).map_err(|problem| fail(SceneProblem::File(problem)))?;
        Self::parse(&text).map_err(fail)
    }

    /// Parses the text of a scene file.
    ///
    /// # Errors
    /// As [`SceneFile::read`].
    pub fn parse(text: &str) -> Result<Self, SceneProblem> {
        serde_json::from_str(text).map_err(|error| SceneProblem::Json(OneLine(error).to_string()))
    }

    /// Writes a scene file; [`SceneFile::read`] brings it back bit for bit.
    ///
    /// # Errors
    /// When the file cannot be written, or names a file whose name is not UTF-8, which JSON cannot hold.
    pub fn write(&self, path: &Path) -> Result<(), WriteError> {
        let text = serde_json::to_string_pretty(self)
            .map_err(|source| WriteError { path: path.to_owned(), source: std::io::Error::other(source) })?;
        write_atomically(path, |file| writeln!(file, "{text}"))
    }
}
