//! Reading a volume: which format a file has, and what every reader is asked and answers.

use std::fmt;
use std::io::Read;
use std::path::Path;

use glam::DVec3;
use volery_scene::{Samples, VoxelGrid};

use crate::bytes::{self, Compression};
use crate::error::{Problem, ReadError, quoted};
use crate::layout::Element;

mod image;
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
    /// Limit of the decoded samples in bytes.
    pub max_bytes: u64,
}

impl Default for ReadOptions {
    /// Everything from the file, at most 64 GiB.
    fn default() -> Self {
        Self { dims: None, element: None, spacing: None, array: None, max_bytes: 64 << 30 }
    }
}

/// A format of volume files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// Samples and nothing else, plain, gzip or Zstandard.
    Raw,
    /// NIfTI-1, `.nii` and `.nii.gz`.
    Nifti,
    /// NRRD, attached or with a detached header.
    Nrrd,
    /// MetaImage, `.mha` and `.mhd`.
    MetaImage,
    /// VTK's XML image data, `.vti`.
    Vti,
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
            Self::Nifti => "NIfTI-1",
            Self::Nrrd => "NRRD",
            Self::MetaImage => "MetaImage",
            Self::Vti => "VTK image data",
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
    /// What the reader decided for the user, a sentence each: volumes left out, cell data taken as
    /// samples, and the like.
    pub notes: Vec<String>,
}

/// What one reader gets out of a file.
pub(crate) struct Decoded {
    pub(crate) dims: [usize; 3],
    pub(crate) spacing: DVec3,
    pub(crate) samples: Samples,
    pub(crate) array: Option<String>,
    pub(crate) notes: Vec<String>,
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
            Format::Tiff | Format::Png | Format::Jpeg => stack::read_file(path, format, options),
            Format::Folder => stack::read_folder(path, options),
        }?;
        let Decoded { dims, spacing, samples, array, notes } = decoded;
        let grid = VoxelGrid::new(dims, spacing, samples).map_err(Problem::Grid)?;
        Ok(Volume { grid, format, array, notes })
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
    let (file, _) = bytes::open(path)?;
    let mut head = Vec::new();
    file.take(352).read_to_end(&mut head).map_err(Problem::Io)?;
    let by_name = || {
        let endings: [(&[&str], Format); 7] = [
            (&[".nii"], Format::Nifti),
            (&[".nrrd", ".nhdr"], Format::Nrrd),
            (&[".mha", ".mhd"], Format::MetaImage),
            (&[".vti"], Format::Vti),
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
    Err(Problem::field(
        "file name",
        quoted(&name),
        "one that ends in .raw, .nii, .nrrd, .nhdr, .mha, .mhd, .vti, .tif, .png or .jpg, or dims and dtype (--dims, --dtype)",
    ))
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
    } else if head.get(344..348).is_some_and(|magic| magic == b"n+1\0") {
        Some(Format::Nifti)
    } else {
        None
    }
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
