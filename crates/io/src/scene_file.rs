//! Scene files: what to draw, from where, how large, in JSON.
//!
//! ```json
//! {"input": {"kind": "volume", "file": "engine_256x256x128_uint8.raw"}, "size": [512, 512],
//!  "background": [0, 0, 0],
//!  "camera": {"projection": "perspective", "eye": [470, -190, 330], "target": [127, 127, 63],
//!             "up": [0, 0, 1], "fov_y_deg": 30},
//!  "transfer_function": {"points": [{"value": 0, "color": [0, 0, 0], "opacity": 0},
//!                                   {"value": 255, "color": [1, 1, 1], "opacity": 0.5}],
//!                        "unit_distance": 1}}
//! ```
//! `input` may also have `dims`, `dtype`, `spacing` and `array`; an orthographic camera has `height` in place
//! of `fov_y_deg`; `name` is optional, and so are opaque surfaces among the data:
//! `"meshes": [{"file": "hull.obj", "color": [0.8, 0.8, 0.8]}]`. Any other field is an error, so that a slip of the pen is found.

use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::Deserialize;
use volery_scene::{Camera, Projection, TransferFunction, camera, transfer};

use crate::bytes::load_text;
use crate::error::{OneLine, Problem, first_of};
use crate::layout::{Element, ParseElementError};
use crate::transfer::TransferJson;
use crate::volume::ReadOptions;

/// Scene files larger than this are refused.
const MAX_FILE_BYTES: u64 = 16 << 20;

/// The largest width or height of a picture.
pub const MAX_SIDE: u32 = 1 << 16;

/// The most pixels of a picture.
pub const MAX_PIXELS: u64 = 1 << 28;

/// A scene: everything that a picture needs.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneFile {
    /// Its name, or the file's.
    pub name: String,
    /// What is drawn.
    pub input: SceneInput,
    /// Width and height of the picture in pixels.
    pub size: [u32; 2],
    /// Linear RGB behind everything, each in [0, 1].
    pub background: [f64; 3],
    /// Where it is seen from; without defects.
    pub camera: Camera,
    /// Colour and opacity of values.
    pub transfer: TransferFunction,
    /// Opaque surfaces among the data.
    pub meshes: Vec<SceneMesh>,
}

/// An opaque surface of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneMesh {
    /// As written: relative to the scene file or the data folder, for [`read_mesh`](crate::read_mesh).
    pub file: PathBuf,
    /// Linear RGB, each in [0, 1].
    pub color: [f64; 3],
}

/// Whether the input is a voxel volume or an unstructured grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum InputKind {
    /// Samples on a regular grid.
    Volume,
    /// Cells; parsed, so that the caller can say whether it draws them.
    Grid,
}

/// The file of a scene and what the scene says about it.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneInput {
    /// Volume or grid.
    pub kind: InputKind,
    /// As written: relative to the scene file or the data folder.
    pub file: PathBuf,
    /// Samples along x, y, z, for raw files.
    pub dims: Option<[usize; 3]>,
    /// Sample type and byte order, for raw files.
    pub element: Option<Element>,
    /// World distance of neighbouring samples.
    pub spacing: Option<DVec3>,
    /// The array to draw.
    pub array: Option<String>,
}

impl SceneInput {
    /// How to read the file with [`read_volume`](crate::read_volume).
    pub fn read_options(&self) -> ReadOptions {
        let Self { kind: _, file: _, dims, element, spacing, array } = self.clone();
        ReadOptions { dims, element, spacing, array, ..ReadOptions::default() }
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
    /// It is no JSON, a field is missing, has the wrong type or is unknown.
    #[error("{0}")]
    Json(String),
    /// The picture's size.
    #[error("size is {} x {}, expected 1 to {MAX_SIDE} each and at most {MAX_PIXELS} pixels", .found[0], .found[1])]
    Size {
        /// Width and height as given.
        found: [u32; 2],
    },
    /// The background is no colour.
    #[error("background is {found:?}, expected three numbers in [0, 1]")]
    Background {
        /// As given.
        found: [f64; 3],
    },
    /// The colour of a mesh is none.
    #[error("meshes[{index}].color is {found:?}, expected three numbers in [0, 1]")]
    MeshColor {
        /// Place of the mesh in the list.
        index: usize,
        /// As given.
        found: [f64; 3],
    },
    /// The spacing.
    #[error("input.spacing is {found:?}, expected three positive finite numbers")]
    Spacing {
        /// As given.
        found: [f64; 3],
    },
    /// The sample type is unknown.
    #[error("input.{0}")]
    Dtype(ParseElementError),
    /// The projection lacks its measure, or has the other's.
    #[error("camera.{found}, expected {expected}")]
    Projection {
        /// What there is.
        found: &'static str,
        /// What would be right.
        expected: &'static str,
    },
    /// The camera cannot take a picture: its first defect.
    #[error("{0}")]
    Camera(camera::Defect),
    /// The transfer function is not meaningful.
    #[error("transfer function: {}", first_of(&.0.defects))]
    Transfer(transfer::Error),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneJson {
    name: Option<String>,
    input: InputJson,
    size: [u32; 2],
    background: [f64; 3],
    camera: CameraJson,
    transfer_function: TransferJson,
    #[serde(default)]
    meshes: Vec<MeshJson>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MeshJson {
    file: PathBuf,
    color: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct InputJson {
    kind: InputKind,
    file: PathBuf,
    dims: Option<[usize; 3]>,
    dtype: Option<String>,
    spacing: Option<[f64; 3]>,
    array: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraJson {
    projection: ProjectionName,
    eye: [f64; 3],
    target: [f64; 3],
    up: [f64; 3],
    fov_y_deg: Option<f64>,
    height: Option<f64>,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum ProjectionName {
    Perspective,
    Orthographic,
}

impl SceneFile {
    /// Reads a scene file.
    ///
    /// # Errors
    /// When it cannot be read, is no scene or asks for something impossible: one line that names the field.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        let fail = |problem| SceneError { path: path.to_owned(), problem };
        let text = load_text(path, MAX_FILE_BYTES).map_err(|problem| fail(SceneProblem::File(problem)))?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        Self::parse(&text, &name).map_err(fail)
    }

    /// Parses the text of a scene file; `name` is used where it has none.
    ///
    /// # Errors
    /// As [`SceneFile::read`].
    pub fn parse(text: &str, name: &str) -> Result<Self, SceneProblem> {
        let json: SceneJson =
            serde_json::from_str(text).map_err(|error| SceneProblem::Json(OneLine(error).to_string()))?;
        let SceneJson { name: own_name, input, size, background, camera, transfer_function, meshes } = json;
        check_size(size)?;
        if !is_color(background) {
            return Err(SceneProblem::Background { found: background });
        }
        let mesh = |(index, MeshJson { file, color })| match color {
            found if !is_color(found) => Err(SceneProblem::MeshColor { index, found }),
            color => Ok(SceneMesh { file, color }),
        };
        Ok(Self {
            name: own_name.unwrap_or_else(|| name.to_owned()),
            input: input.validated()?,
            size,
            background,
            camera: camera.validated()?,
            transfer: transfer_function.validated().map_err(SceneProblem::Transfer)?,
            meshes: meshes.into_iter().enumerate().map(mesh).collect::<Result<_, _>>()?,
        })
    }
}

fn is_color(color: [f64; 3]) -> bool {
    color.iter().all(|channel| (0.0..=1.0).contains(channel))
}

/// Checks the size of a picture, from a scene or elsewhere.
///
/// # Errors
/// [`SceneProblem::Size`] when a side is 0 or above [`MAX_SIDE`], or there are more than [`MAX_PIXELS`].
pub fn check_size(size: [u32; 2]) -> Result<(), SceneProblem> {
    let [width, height] = size.map(u64::from);
    let sides = size.iter().all(|side| (1..=MAX_SIDE).contains(side));
    if sides && width * height <= MAX_PIXELS { Ok(()) } else { Err(SceneProblem::Size { found: size }) }
}

impl InputJson {
    fn validated(self) -> Result<SceneInput, SceneProblem> {
        let Self { kind, file, dims, dtype, spacing, array } = self;
        if let Some(found) = spacing
            && !found.iter().all(|&distance| distance > 0.0 && distance.is_finite())
        {
            return Err(SceneProblem::Spacing { found });
        }
        let element = dtype.map(|dtype| dtype.parse()).transpose().map_err(SceneProblem::Dtype)?;
        Ok(SceneInput { kind, file, dims, element, spacing: spacing.map(DVec3::from_array), array })
    }
}

impl CameraJson {
    fn validated(self) -> Result<Camera, SceneProblem> {
        let projection = match (self.projection, self.fov_y_deg, self.height) {
            (ProjectionName::Perspective, Some(fov_y_deg), None) => Projection::Perspective { fov_y_deg },
            (ProjectionName::Orthographic, None, Some(height)) => Projection::Orthographic { height },
            (ProjectionName::Perspective, None, _) => {
                let expected = "the full vertical angle of a perspective camera";
                return Err(SceneProblem::Projection { found: "fov_y_deg is missing", expected });
            }
            (ProjectionName::Orthographic, _, None) => {
                let expected = "the height of an orthographic picture in world units";
                return Err(SceneProblem::Projection { found: "height is missing", expected });
            }
            (_, Some(_), Some(_)) => {
                let expected = "fov_y_deg in perspective or height in an orthographic camera";
                return Err(SceneProblem::Projection {
                    found: "fov_y_deg and height are both there",
                    expected,
                });
            }
        };
        let [eye, target, up] = [self.eye, self.target, self.up].map(DVec3::from_array);
        let camera = Camera { eye, target, up, projection };
        match camera.defects().into_iter().next() {
            None => Ok(camera),
            Some(defect) => Err(SceneProblem::Camera(defect)),
        }
    }
}
