//! From a file name to samples and what a scene says about them.

use std::path::{Path, PathBuf};
use std::time::Instant;

use volery_io::scene_file::{InputKind, SceneError};
use volery_io::{ReadError, ReadOptions, SceneFile, Volume, is_grid, read_volume};

/// A volume as read, and its scene if it came with one.
#[derive(Clone, Debug)]
pub struct Input {
    /// The file that holds the samples.
    pub path: PathBuf,
    /// The samples.
    pub volume: Volume,
    /// What the scene file says.
    pub scene: Option<SceneFile>,
    /// Seconds of reading and decoding.
    pub load_seconds: f64,
}

/// Why an input could not be read.
#[derive(Debug, thiserror::Error)]
pub enum InputError {
    /// The scene file.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The volume.
    #[error(transparent)]
    Volume(#[from] ReadError),
    /// A grid, or a scene of one.
    #[error("{}: is an unstructured grid, expected a volume: grids cannot be drawn yet", .path.display().to_string().escape_debug())]
    Grid {
        /// The grid or the scene file.
        path: PathBuf,
    },
}

/// Reads a scene file (its name ends in `.json`) and its volume, or a volume alone. Paths in a scene are
/// relative to `data_dir`, or else to the scene file's folder.
///
/// # Errors
/// When a file cannot be read, or is a grid, or a scene of one.
pub fn read_input(path: &Path, data_dir: Option<&Path>) -> Result<Input, InputError> {
    let start = Instant::now();
    let is_scene = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"));
    let (path, scene, options) = if is_scene {
        let scene = SceneFile::read(path)?;
        if scene.input.kind == InputKind::Grid {
            return Err(InputError::Grid { path: path.to_owned() });
        }
        let folder = data_dir.unwrap_or_else(|| path.parent().unwrap_or(Path::new("")));
        let options = scene.input.read_options();
        (folder.join(&scene.input.file), Some(scene), options)
    } else if path.is_file() && is_grid(path) {
        return Err(InputError::Grid { path: path.to_owned() });
    } else {
        (path.to_owned(), None, ReadOptions::default())
    };
    let volume = read_volume(&path, &options)?;
    Ok(Input { path, volume, scene, load_seconds: start.elapsed().as_secs_f64() })
}
