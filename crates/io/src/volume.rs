//! Reading a volume: which format a file has, and what every reader is asked and answers.

use std::fmt;
use std::io::Read;
use std::path::Path;

use glam::DVec3;
use volery_scene::{Samples, VoxelGrid};

use crate::bytes::{self, Compression};
use crate::choice::Choices;
use crate::error::{Problem, ReadError, quoted};
use crate::layout::Element;
use crate::orientation::{Orientation, Placement, World};

mod foreign;
mod image;
mod image_data;
mod legacy;
mod metaimage;
mod nifti;
mod nrrd;
mod png;
mod raw;
mod stack;
mod text;
mod tiff;
mod vti;

pub(crate) use png::read_png;

/// What is looked at to tell the format of a file.
const HEAD_BYTES: u64 = 1024;

/// What the caller knows or wants beside the file.
#[derive(Clone, Debug)]
pub struct ReadOptions {
    /// Samples along x, y, z: needed for a raw file whose name does not tell; a file that says otherwise
    /// is refused.
    pub dims: Option<[usize; 3]>,
    /// Type and byte order: needed for a raw file whose name does not tell; a file of another type is
    /// refused.
    pub element: Option<Element>,
    /// World distance of neighbouring samples, in place of the file's.
    pub spacing: Option<DVec3>,
    /// The array to read where a file has several.
    pub array: Option<String>,
    /// The channel or component to read, from 0, where samples have several; else colours as colours, vectors by
    /// their magnitude, and of other channels the first.
    pub channel: Option<usize>,
    /// Which of several volumes to read, from 0; else the first.
    pub time_step: Option<usize>,
    /// Limit of the decoded samples in bytes.
    pub max_bytes: u64,
}

impl Default for ReadOptions {
    /// Everything from the file, at most 64 GiB.
    fn default() -> Self {
        Self {
            dims: None,
            element: None,
            spacing: None,
            array: None,
            channel: None,
            time_step: None,
            max_bytes: 64 << 30,
        }
    }
}

/// A format of volume files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// Samples and nothing else, plain, gzip or Zstandard.
    Raw,
    /// NIfTI-1 or NIfTI-2, `.nii` and `.nii.gz`.
    Nifti,
    /// NRRD, attached or with a detached header.
    Nrrd,
    /// MetaImage, `.mha` and `.mhd`.
    MetaImage,
    /// VTK's XML image data, `.vti`.
    Vti,
    /// The same in pieces, each a file of its own, `.pvti`.
    Pvti,
    /// VTK's legacy format with structured points, `.vtk`.
    LegacyVtk,
    /// One TIFF of one or more pages.
    Tiff,
    /// One PNG image.
    Png,
    /// One JPEG image.
    Jpeg,
    /// A folder of PNG or TIFF slices.
    Folder,
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Raw => "raw",
            Self::Nifti => "NIfTI",
            Self::Nrrd => "NRRD",
            Self::MetaImage => "MetaImage",
            Self::Vti => "VTK image data",
            Self::Pvti => "VTK parallel image data",
            Self::LegacyVtk => "legacy VTK structured points",
            Self::Tiff => "TIFF",
            Self::Png => "PNG",
            Self::Jpeg => "JPEG",
            Self::Folder => "folder of slices",
        })
    }
}

/// A volume as read.
#[derive(Clone, Debug)]
pub struct Volume {
    /// The samples and where they lie.
    pub grid: VoxelGrid,
    /// The format of the file.
    pub format: Format,
    /// The name of the array, where the format names arrays.
    pub array: Option<String>,
    /// What the file has of which this is one.
    pub choices: Choices,
    /// What the world of the file is, which [`VoxelGrid::world_from_index`] leads to.
    pub world: World,
    /// The smallest and largest value that the file asks to show.
    pub display_range: Option<[f64; 2]>,
    /// What the reader decided for the user, a sentence each: volumes left out, cell data taken as
    /// samples, and the like.
    pub notes: Vec<String>,
}

impl Volume {
    /// How the axes of the samples lie in the world of the file.
    pub fn orientation(&self) -> Orientation {
        Orientation::of(&self.grid.world_from_index(), self.world)
    }
}

/// What one reader gets out of a file.
pub(crate) struct Decoded {
    pub(crate) dims: [usize; 3],
    pub(crate) spacing: DVec3,
    pub(crate) samples: Samples,
    pub(crate) array: Option<String>,
    pub(crate) choices: Choices,
    /// Where the file says that the samples lie; `None` where it says nothing.
    pub(crate) placement: Option<Placement>,
    pub(crate) display_range: Option<[f64; 2]>,
    pub(crate) notes: Vec<String>,
}

impl Decoded {
    /// Samples of a file that says no more.
    pub(crate) fn new(dims: [usize; 3], spacing: DVec3, samples: Samples, notes: Vec<String>) -> Self {
        let choices = Choices::default();
        Self { dims, spacing, samples, array: None, choices, placement: None, display_range: None, notes }
    }

    /// The volume, in the place that its file gives it unless the caller's spacing is another.
    fn volume(self, format: Format, options: &ReadOptions) -> Result<Volume, Problem> {
        let Self { dims, spacing, samples, array, choices, placement, display_range, mut notes } = self;
        let mut grid = VoxelGrid::new(dims, spacing, samples).map_err(Problem::Grid)?;
        let placement = match options.spacing {
            Some(spacing) => placement.map(|placement| placement.with_spacing(spacing)),
            None => placement,
        };
        let mut world = World::Plain;
        if let Some(Placement { world_from_index, world: of_file }) = placement {
            match grid.clone().with_world_from_index(world_from_index) {
                Ok(placed) => (grid, world) = (placed, of_file),
                Err(_) => {
                    notes.push("the axes of the file span no space; its orientation is not used".to_owned())
                }
            }
        }
        Ok(Volume { grid, format, array, choices, world, display_range, notes })
    }
}

/// Reads a volume from a file, or from a folder of slices.
///
/// A name that ends in `.raw`, `.raw.gz`, `.raw.zst` or `.nii.gz` says what the file is; otherwise its
/// first bytes do, and where they do not, the ending of its name. A file that says nothing is raw if
/// `options` give dims and type.
///
/// Large uncompressed files are mapped into memory: they must not be changed while the volume lives.
///
/// # Errors
/// When the file cannot be read, is damaged, is larger than `options` allow, or is of a kind that is not
/// supported: one line that says what was found and what was expected.
pub fn read_volume(path: &Path, options: &ReadOptions) -> Result<Volume, ReadError> {
    let read = || {
        let format = format_of(path, options)?;
        let decoded = match format {
            Format::Raw => raw::read(path, options),
            Format::Nifti => nifti::read(path, options),
            Format::Nrrd => nrrd::read(path, options),
            Format::MetaImage => metaimage::read(path, options),
            Format::Vti => vti::read(path, options),
            Format::Pvti => vti::read_parallel(path, options),
            Format::LegacyVtk => legacy::read(path, options),
            Format::Tiff | Format::Png | Format::Jpeg => stack::read_file(path, format, options),
            Format::Folder => stack::read_folder(path, options),
        }?;
        decoded.volume(format, options)
    };
    read().map_err(|problem| ReadError { path: path.to_owned(), problem })
}

fn format_of(path: &Path, options: &ReadOptions) -> Result<Format, Problem> {
    if path.is_dir() {
        return Ok(Format::Folder);
    }
    let name = lower_name(path);
    let ends = |endings: &[&str]| endings.iter().any(|ending| name.ends_with(ending));
    if ends(&[".raw", ".raw.gz", ".raw.zst"]) {
        return Ok(Format::Raw);
    }
    if ends(&[".nii.gz"]) {
        return Ok(Format::Nifti);
    }
    let head = head_of(path)?;
    let by_name = || {
        let endings: [(&[&str], Format); 9] = [
            (&[".nii"], Format::Nifti),
            (&[".nrrd", ".nhdr"], Format::Nrrd),
            (&[".mha", ".mhd"], Format::MetaImage),
            (&[".vti"], Format::Vti),
            (&[".pvti"], Format::Pvti),
            (&[".vtk"], Format::LegacyVtk),
            (&[".tif", ".tiff"], Format::Tiff),
            (&[".png"], Format::Png),
            (&[".jpg", ".jpeg"], Format::Jpeg),
        ];
        endings.into_iter().find(|(endings, _)| ends(endings)).map(|(_, format)| format)
    };
    if let Some(format) = magic_format(&head).or_else(by_name) {
        return Ok(format);
    }
    if options.dims.is_some() && options.element.is_some() {
        return Ok(Format::Raw);
    }
    if let Some((format, way)) = foreign::format_of(&name, &head) {
        return Err(Problem::field("format", format, way));
    }
    Err(Problem::field("file name", quoted(&name), foreign::ENDINGS))
}

/// The first bytes of a file, unpacked if they are gzip.
fn head_of(path: &Path) -> Result<Vec<u8>, Problem> {
    let mut head = Vec::new();
    bytes::open(path)?.0.take(HEAD_BYTES).read_to_end(&mut head).map_err(Problem::Io)?;
    if head.starts_with(&[0x1f, 0x8b]) {
        let mut unpacked = Vec::new();
        // What does not unpack says nothing.
        let stream = bytes::open_stream(path, Compression::Gzip)?;
        if stream.take(HEAD_BYTES).read_to_end(&mut unpacked).is_ok() {
            return Ok(unpacked);
        }
    }
    Ok(head)
}

/// The format that the first bytes of a file prove.
fn magic_format(head: &[u8]) -> Option<Format> {
    let starts = |magic: &[u8]| head.starts_with(magic);
    if starts(b"NRRD") {
        Some(Format::Nrrd)
    } else if starts(b"\x89PNG") {
        Some(Format::Png)
    } else if starts(b"\xff\xd8\xff") {
        Some(Format::Jpeg)
    } else if [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"].into_iter().any(|magic| starts(magic)) {
        Some(Format::Tiff)
    } else if nifti::is_nifti(head) {
        Some(Format::Nifti)
    } else if starts(b"# vtk DataFile") {
        Some(Format::LegacyVtk)
    } else if is_vtk_xml(head, "ImageData") {
        Some(Format::Vti)
    } else if is_vtk_xml(head, "PImageData") {
        Some(Format::Pvti)
    } else {
        None
    }
}

/// Whether the first bytes of a file are VTK's XML of a type.
pub(crate) fn is_vtk_xml(head: &[u8], name: &str) -> bool {
    let head = String::from_utf8_lossy(head);
    let root = head.split_once("<VTKFile").map(|(_, root)| root.split('>').next().unwrap_or_default());
    root.is_some_and(|root| {
        ['"', '\''].into_iter().any(|quote| root.contains(&format!("{quote}{name}{quote}")))
    })
}

/// The name of a file in lower case; bytes that are not UTF-8 become replacement characters.
pub(crate) fn lower_name(path: &Path) -> String {
    path.file_name().map(|name| name.to_string_lossy().to_lowercase()).unwrap_or_default()
}

/// The compression that the ending of a name stands for.
fn compression_of_name(path: &Path) -> Compression {
    let name = lower_name(path);
    if name.ends_with(".gz") {
        Compression::Gzip
    } else if name.ends_with(".zst") {
        Compression::Zstd
    } else {
        Compression::None
    }
}
