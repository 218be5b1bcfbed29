//! From a file name to samples or cells, and what a scene says about them.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use volery_io::mesh::MAX_MESH_BYTES;
use volery_io::scene_file::{InputKind, SceneError, SceneMesh};
use volery_io::{GridFile, GridOptions, ReadError, ReadOptions, SceneFile, Volume};
use volery_io::{is_grid, read_grid, read_mesh, read_stack, read_volume};
use volery_scene::TriangleMesh;
use volery_slicing::QuantizedMesh;

/// Memory that a stack may need: 64 GiB.
const MAX_STACK_BYTES: u64 = 64 << 30;

/// What a file holds, as read, and its scene if it came with one.
#[derive(Clone, Debug)]
pub struct Input {
    /// The file that holds the samples or cells.
    pub path: PathBuf,
    /// What it holds.
    pub data: InputData,
    /// What the scene file says.
    pub scene: Option<SceneFile>,
    /// The opaque surfaces of the scene, for [`View::meshes`](crate::View::meshes).
    pub meshes: Arc<[TriangleMesh]>,
    /// Seconds of reading and decoding.
    pub load_seconds: f64,
}

/// What a file holds.
#[derive(Clone, Debug)]
pub enum InputData {
    /// Samples.
    Volume(Volume),
    /// Cells.
    Grid(GridFile),
    /// Slices.
    Stack(QuantizedMesh),
}

/// Why an input could not be read.
#[derive(Debug, thiserror::Error)]
pub enum InputError {
    /// The scene file.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The file of samples, cells or a mesh.
    #[error(transparent)]
    File(#[from] ReadError),
    /// Samples were asked for, and there are others.
    #[error("{}: is {found}, expected a volume", .path.display().to_string().escape_debug())]
    NoVolume {
        /// The file.
        path: PathBuf,
        /// What it is.
        found: &'static str,
    },
}

/// How to read an input.
#[derive(Clone, Copy, Debug, Default)]
pub struct InputOptions<'a> {
    /// Folder that paths in a scene are relative to; else that of the scene file.
    pub data_dir: Option<&'a Path>,
    /// The array to read, in place of the scene's or the file's own.
    pub array: Option<&'a str>,
}

/// Reads a scene file (its name ends in `.json`) and its volume or grid, or one of these alone. Paths in a scene are
/// relative to `data_dir`, or else to the scene file's folder.
///
/// # Errors
/// When a file cannot be read.
pub fn read_input(path: &Path, data_dir: Option<&Path>) -> Result<Input, InputError> {
    InputOptions { data_dir, array: None }.read(path)
}

impl InputOptions<'_> {
    /// As [`read_input`].
    ///
    /// # Errors
    /// When a file cannot be read.
    pub fn read(&self, path: &Path) -> Result<Input, InputError> {
        let start = Instant::now();
        let is_scene = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"));
        let mut notes = Vec::new();
        let (path, scene, meshes) = if is_scene {
            let scene = SceneFile::read(path)?;
            let folder = self.data_dir.unwrap_or_else(|| path.parent().unwrap_or(Path::new("")));
            let meshes = read_meshes(&scene, folder, &mut notes)?;
            (folder.join(&scene.input.file), Some(scene), meshes)
        } else {
            (path.to_owned(), None, [].into())
        };
        let is_stack = scene.is_none() && is_stack(&path);
        let has_cells = match &scene {
            Some(scene) => scene.input.kind == InputKind::Grid,
            None => path.is_file() && is_grid(&path),
        };
        let array = || self.array.map(str::to_owned);
        let mut data = if is_stack {
            InputData::Stack(read_stack(&path, MAX_STACK_BYTES)?)
        } else if has_cells {
            let array = array().or_else(|| scene.as_ref()?.input.array.clone());
            InputData::Grid(read_grid(&path, &GridOptions { array, ..GridOptions::default() })?)
        } else {
            let mut options =
                scene.as_ref().map_or_else(ReadOptions::default, |scene| scene.input.read_options());
            options.array = array().or(options.array);
            InputData::Volume(read_volume(&path, &options)?)
        };
        match &mut data {
            InputData::Volume(volume) => volume.notes.extend(notes),
            InputData::Grid(file) => file.notes.extend(notes),
            // No scene has one.
            InputData::Stack(_) => {}
        }
        Ok(Input { path, data, scene, meshes, load_seconds: start.elapsed().as_secs_f64() })
    }
}

/// Whether a file is a stack of slices, by the ending of its name.
fn is_stack(path: &Path) -> bool {
    path.extension()
        .is_some_and(|ending| ["vsl", "glb"].iter().any(|known| ending.eq_ignore_ascii_case(known)))
}

/// The meshes of a scene; what their reader left out is added to the notes.
fn read_meshes(
    scene: &SceneFile,
    folder: &Path,
    notes: &mut Vec<String>,
) -> Result<Arc<[TriangleMesh]>, ReadError> {
    let read = |mesh: &SceneMesh| {
        let file = read_mesh(&folder.join(&mesh.file), mesh.color, MAX_MESH_BYTES)?;
        notes.extend(file.notes.iter().map(|note| format!("{}: {note}", mesh.file.display())));
        Ok(file.mesh)
    };
    scene.meshes.iter().map(read).collect()
}

impl Input {
    /// The samples.
    ///
    /// # Errors
    /// When there are cells.
    pub fn volume(&self) -> Result<&Volume, InputError> {
        match &self.data {
            InputData::Volume(volume) => Ok(volume),
            InputData::Grid(_) => {
                Err(InputError::NoVolume { path: self.path.clone(), found: "an unstructured grid" })
            }
            InputData::Stack(_) => {
                Err(InputError::NoVolume { path: self.path.clone(), found: "a stack of slices" })
            }
        }
    }

    /// What the reader decided, a sentence each.
    pub fn notes(&self) -> &[String] {
        match &self.data {
            InputData::Volume(volume) => &volume.notes,
            InputData::Grid(file) => &file.notes,
            InputData::Stack(_) => &[],
        }
    }
}
