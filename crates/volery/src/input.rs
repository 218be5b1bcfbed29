//! From a file name to samples or cells, and what a scene says about them.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use volery_io::mesh::MAX_MESH_BYTES;
use volery_io::scene_file::{InputKind, SceneError, SceneInput, SceneMesh, SceneOrientation};
use volery_io::{Format, GridFile, OpenedFile, ReadError, SceneFile, Volume};
use volery_io::{is_grid, read_grid, read_mesh, read_stack, read_volume, recording_files};
use volery_scene::TriangleMesh;
use volery_slicing::QuantizedMesh;

use crate::data::{VolumeData, VolumeError};

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
    /// Where samples are; of a file without a scene where it says.
    pub orientation: SceneOrientation,
    /// The opaque surfaces of the scene, for [`View::meshes`](crate::View::meshes).
    pub meshes: Arc<[TriangleMesh]>,
    /// Every file that was opened for it.
    pub files: Vec<OpenedFile>,
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

impl InputData {
    /// What it is, for people.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Volume(_) => "a volume",
            Self::Grid(_) => "an unstructured grid",
            Self::Stack(_) => "a stack of slices",
        }
    }
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
    /// Samples cannot be drawn.
    #[error("{}: {problem}", .path.display().to_string().escape_debug())]
    Volume {
        /// The file.
        path: PathBuf,
        /// Why.
        problem: VolumeError,
    },
    /// The file has nothing that the option could choose or change.
    #[error("{}: is {found}, expected {expected} for {option}", .path.display().to_string().escape_debug())]
    Unread {
        /// The file.
        path: PathBuf,
        /// What it is.
        found: String,
        /// What has what the option asks for.
        expected: &'static str,
        /// The option, as on the command line.
        option: &'static str,
    },
}

/// How to read an input: what is given goes before what a scene says.
#[derive(Clone, Debug, Default)]
pub struct InputOptions {
    /// Folder that paths in a scene are relative to; else that of the scene file.
    pub data_dir: Option<PathBuf>,
    /// What the caller knows of the file or wants of it; [`SceneInput::file`] is not read.
    pub input: SceneInput,
}

/// Reads a scene file (its name ends in `.json`) and its volume or grid, or one of these alone. Paths in a scene are
/// relative to `data_dir`, or else to the scene file's folder.
///
/// # Errors
/// When a file cannot be read.
pub fn read_input(path: &Path, data_dir: Option<&Path>) -> Result<Input, InputError> {
    let data_dir = data_dir.map(Path::to_owned);
    InputOptions { data_dir, ..InputOptions::default() }.find(path)?.read()
}

/// What an input consists of, before its data are read.
#[derive(Clone, Debug)]
pub struct InputPlan {
    /// The scene file, if there is one.
    pub scene_path: Option<PathBuf>,
    /// What the scene file says.
    pub scene: Option<SceneFile>,
    /// The file of the data and how to read it: options and scene together.
    pub input: SceneInput,
    /// The opaque surfaces of the scene.
    pub meshes: Vec<SceneMesh>,
}

impl InputOptions {
    /// Reads the scene file, if `path` is one (its name ends in `.json`), and says which files the input is of.
    ///
    /// # Errors
    /// When the scene file cannot be read.
    pub fn find(&self, path: &Path) -> Result<InputPlan, InputError> {
        let is_scene = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"));
        let own = self.input.clone();
        if !is_scene {
            let input = SceneInput { file: path.to_owned(), ..own };
            return Ok(InputPlan { scene_path: None, scene: None, input, meshes: Vec::new() });
        }
        let scene = SceneFile::read(path)?;
        let folder = self.data_dir.as_deref().unwrap_or_else(|| path.parent().unwrap_or(Path::new("")));
        let SceneInput { kind, file, dims, dtype, spacing, orientation, array, channel, time_step } =
            scene.input.clone();
        let input = SceneInput {
            kind: own.kind.or(kind),
            file: folder.join(file),
            dims: own.dims.or(dims),
            dtype: own.dtype.or(dtype),
            spacing: own.spacing.or(spacing),
            orientation: own.orientation.or(orientation),
            array: own.array.or(array),
            channel: own.channel.or(channel),
            time_step: own.time_step.or(time_step),
        };
        let mesh = |mesh: &SceneMesh| SceneMesh { file: folder.join(&mesh.file), color: mesh.color };
        let meshes = scene.meshes.iter().map(mesh).collect();
        Ok(InputPlan { scene_path: Some(path.to_owned()), scene: Some(scene), input, meshes })
    }
}

impl InputPlan {
    /// The files that are known before any data are read: those that data files name are in [`Input::files`].
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        let meshes = self.meshes.iter().map(|mesh| mesh.file.as_path());
        self.scene_path.iter().map(PathBuf::as_path).chain([self.input.file.as_path()]).chain(meshes)
    }

    /// Where samples are. Scenes are older than orientation, and other programs draw them: they have to ask for it.
    fn orientation(&self) -> SceneOrientation {
        let usual = if self.scene.is_some() { SceneOrientation::Index } else { SceneOrientation::File };
        self.input.orientation.unwrap_or(usual)
    }

    /// Reads the data.
    ///
    /// # Errors
    /// When a file cannot be read, or has nothing that an option asks for.
    pub fn read(&self) -> Result<Input, InputError> {
        let start = Instant::now();
        let (read, mut files) = recording_files(|| {
            let mut notes = Vec::new();
            let meshes = self.read_meshes(&mut notes)?;
            Ok::<_, InputError>((self.read_data(notes)?, meshes))
        });
        let (data, meshes) = read?;
        if let Some(scene) = &self.scene_path {
            let bytes = std::fs::metadata(scene).map_or(0, |metadata| metadata.len());
            files.insert(0, OpenedFile { path: scene.clone(), bytes });
        }
        let (path, scene) = (self.input.file.clone(), self.scene.clone());
        let orientation = self.orientation();
        let load_seconds = start.elapsed().as_secs_f64();
        Ok(Input { path, data, scene, orientation, meshes, files, load_seconds })
    }

    fn read_data(&self, mesh_notes: Vec<String>) -> Result<InputData, InputError> {
        let SceneInput { kind, file: path, .. } = &self.input;
        let data = match kind {
            None if is_stack(path) => {
                self.refuse_unread(&[], "a stack of slices")?;
                return Ok(InputData::Stack(read_stack(path, MAX_STACK_BYTES)?));
            }
            Some(InputKind::Volume) => self.read_volume(mesh_notes)?,
            None if !path.is_file() || !is_grid(path) => self.read_volume(mesh_notes)?,
            _ => {
                self.refuse_unread(&["--array", "--channel", "--time-step"], "an unstructured grid")?;
                let mut file = read_grid(path, &self.input.grid_options())?;
                file.notes.extend(mesh_notes);
                InputData::Grid(file)
            }
        };
        Ok(data)
    }

    fn read_volume(&self, mesh_notes: Vec<String>) -> Result<InputData, InputError> {
        let mut volume = read_volume(&self.input.file, &self.input.read_options())?;
        if self.input.array.is_some() && volume.array.is_none() {
            let found = format!("a volume, {}", volume.format);
            return Err(self.unread("--array", &found, "a file whose format names arrays"));
        }
        if volume.format == Format::Raw {
            self.refuse_unread(
                &["--dims", "--dtype", "--spacing", "--orientation"],
                "a raw file, which holds one volume of numbers",
            )?;
        }
        volume.notes.extend(mesh_notes);
        Ok(InputData::Volume(volume))
    }

    /// Refuses options but for those that such a file reads.
    fn refuse_unread(&self, read: &[&str], found: &str) -> Result<(), InputError> {
        let SceneInput { kind: _, file: _, dims, dtype, spacing, orientation, array, channel, time_step } =
            &self.input;
        let given = [
            ("--dims", dims.is_some(), "a volume"),
            ("--dtype", dtype.is_some(), "a volume"),
            ("--spacing", spacing.is_some(), "a volume"),
            ("--orientation", orientation.is_some(), "a volume"),
            ("--array", array.is_some(), "a file whose format names arrays"),
            ("--channel", channel.is_some(), "a file whose format knows several"),
            ("--time-step", time_step.is_some(), "a file whose format knows several"),
        ];
        match given.into_iter().find(|(option, is_given, _)| *is_given && !read.contains(option)) {
            None => Ok(()),
            Some((option, _, expected)) => Err(self.unread(option, found, expected)),
        }
    }

    fn unread(&self, option: &'static str, found: &str, expected: &'static str) -> InputError {
        InputError::Unread { path: self.input.file.clone(), found: found.to_owned(), expected, option }
    }

    /// The meshes of a scene; what their reader left out is added to the notes.
    fn read_meshes(&self, notes: &mut Vec<String>) -> Result<Arc<[TriangleMesh]>, ReadError> {
        let names = self.scene.iter().flat_map(|scene| &scene.meshes).map(|mesh| mesh.file.display());
        let read = |(mesh, name): (&SceneMesh, std::path::Display)| {
            let file = read_mesh(&mesh.file, mesh.color, MAX_MESH_BYTES)?;
            notes.extend(file.notes.iter().map(|note| format!("{name}: {note}")));
            Ok(file.mesh)
        };
        self.meshes.iter().zip(names).map(read).collect()
    }
}

/// Whether a file is a stack of slices, by the ending of its name.
fn is_stack(path: &Path) -> bool {
    path.extension()
        .is_some_and(|ending| ["vsl", "glb"].iter().any(|known| ending.eq_ignore_ascii_case(known)))
}

impl Input {
    /// The samples.
    ///
    /// # Errors
    /// When there are cells or slices.
    pub fn volume(&self) -> Result<&Volume, InputError> {
        match &self.data {
            InputData::Volume(volume) => Ok(volume),
            other => Err(InputError::NoVolume { path: self.path.clone(), found: other.kind() }),
        }
    }

    /// The samples, made ready to be drawn where they are.
    ///
    /// # Errors
    /// When there are none, or they cannot be drawn.
    pub fn volume_data(&self) -> Result<VolumeData, InputError> {
        let volume = self.volume()?;
        let grid = volume.grid.clone();
        let data = match self.orientation {
            SceneOrientation::File => VolumeData::in_world(grid, volume.world),
            SceneOrientation::Index => VolumeData::new(grid),
        };
        data.map_err(|problem| InputError::Volume { path: self.path.clone(), problem })
    }

    /// What the reader decided, a sentence each, and where the picture is turned against the file.
    pub fn notes(&self) -> Vec<String> {
        match &self.data {
            InputData::Volume(volume) => {
                let is_by_index = self.orientation == SceneOrientation::Index;
                let turned = is_by_index.then(|| volume.orientation().note()).flatten();
                volume.notes.iter().cloned().chain(turned).collect()
            }
            InputData::Grid(file) => file.notes.clone(),
            InputData::Stack(_) => Vec::new(),
        }
    }
}
