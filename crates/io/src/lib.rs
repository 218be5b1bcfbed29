//! Files in, files out: volumes, unstructured grids, opaque meshes, images, scene files, transfer functions.
//!
//! [`read_volume`] reads raw, NIfTI, NRRD, MetaImage, VTK image data, TIFF, PNG, JPEG and folders of
//! slices into a [`VoxelGrid`](volery_scene::VoxelGrid); [`read_grid`] reads VTK's XML and legacy unstructured
//! grids, also in parallel pieces and time steps, and Exodus II in netCDF-3 into an
//! [`UnstructuredGrid`](volery_scene::UnstructuredGrid); [`read_mesh`] reads opaque surfaces; [`SceneFile`] and [`ColorMap`] read what to draw;
//! [`write_png`], [`write_exr`] and [`write_nrrd`] save, through [`write_atomically`].
//!
//! # Guarantees
//! - *No file is believed.* Every size is checked against the file, the address range and
//!   [`ReadOptions::max_bytes`] or [`GridOptions::max_bytes`] before anything is allocated; every node of a cell
//!   exists. What a stream yields is stored as it comes, in
//!   at most twice the room (beside a decoder's own state; the window of Zstandard is at most 128 MiB, the
//!   dictionary of LZMA 64 MiB); an image may be at most 4096 times its file. No input panics, and none is waited for: devices and pipes are
//!   refused. An error is one line: which file, which field, what was found, what was expected.
//! - *Nothing is lost in silence.* Cells left out, values averaged, pieces joined: each is a note beside the data.
//! - *No half file.* Output is written beside its place and then takes it, whatever ends the process
//!   ([`write_atomically`]).
//! - *No copy without need.* Large uncompressed files of the machine's byte order are mapped. They must not
//!   be changed while the volume lives, as with every memory map.
//!
//! # Conventions
//! Where a file says that samples lie is carried beside them, as
//! [`world_from_index`](volery_scene::VoxelGrid::world_from_index): in right, anterior, superior for anatomical
//! files, in the file's own axes for others ([`World`]). Pictures hold linear values without gamma, row 0 at the top.
//!
//! # Non-goals
//! Materials of meshes; polyhedra and cells without volume; netCDF-4; DICOM; colours of palettes.

mod bytes;
mod choice;
mod error;
pub mod grid;
mod layout;
pub mod mesh;
mod near;
mod numbers;
mod orientation;
mod out;
mod raster;
pub mod scene_file;
pub mod stack;
pub mod transfer;
mod volume;
mod vtk_xml;

pub use bytes::{OpenedFile, recording_files};
pub use choice::Choices;
pub use error::{Problem, ReadError};
pub use grid::{GridFile, GridOptions, is_grid, read_grid};
pub use layout::{ByteOrder, Element, ParseElementError};
pub use mesh::{MeshFile, read_mesh};
pub use near::{nearest, one_of};
pub use orientation::{Orientation, World};
pub use out::{
    Abandoned, Picture, WriteError, abandon_unfinished, check_writable, read_png_rgb, write_atomically,
    write_exr, write_nrrd, write_png,
};
pub use scene_file::SceneFile;
pub use stack::{GlbOptions, read_stack, write_glb, write_vsl};
pub use transfer::{
    ColorMap, NamedTransfer, read_transfer, read_transfer_2d, write_transfer, write_transfer_2d,
};
pub use volume::{Format, ReadOptions, Volume, read_volume};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
