//! Stacks of slices in files: `.vsl` for few bytes, `.glb` for everyone's viewer.
//!
//! A `.vsl` file is what [`CompactMesh::encode`](volery_slicing::CompactMesh::encode) gives. What a `.glb` file has is
//! said in [`glb`].
//!
//! Both hold the same numbers: what is read has the bits of what was written.

pub mod glb;
mod vsl;

use std::path::Path;

use volery_slicing::QuantizedMesh;

use crate::bytes::load;
use crate::error::{Problem, ReadError};
pub use glb::{GlbOptions, write_glb};
pub use vsl::write_vsl;

/// First bytes of a binary glTF.
const GLB_MAGIC: &[u8] = b"glTF";

/// Reads a stack that [`write_vsl`] or [`write_glb`] wrote, whatever the name of the file, if it needs at most
/// `max_bytes` of memory.
///
/// # Errors
/// When the file cannot be read, is no such stack, or one that needs more.
pub fn read_stack(path: &Path, max_bytes: u64) -> Result<QuantizedMesh, ReadError> {
    let read = || {
        let bytes = load(path)?;
        if bytes.starts_with(GLB_MAGIC) { glb::read(&bytes, max_bytes) } else { vsl::read(&bytes, max_bytes) }
    };
    read().map_err(|problem: Problem| ReadError { path: path.to_owned(), problem })
}
