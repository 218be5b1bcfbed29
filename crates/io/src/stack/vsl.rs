//! `.vsl`: the bytes of a compact mesh.

use std::io::Write;
use std::path::Path;

use volery_slicing::{CompactMesh, QuantizedMesh};

use crate::error::Problem;
use crate::out::{WriteError, write_atomically};

/// Writes a stack in few bytes; returns how many.
///
/// # Errors
/// When the file cannot be written.
pub fn write_vsl(path: &Path, mesh: &CompactMesh) -> Result<u64, WriteError> {
    let bytes = mesh.encode();
    write_atomically(path, |file| file.write_all(&bytes))?;
    Ok(bytes.len() as u64)
}

pub(super) fn read(bytes: &[u8], max_bytes: u64) -> Result<QuantizedMesh, Problem> {
    CompactMesh::decode(bytes, max_bytes).map(CompactMesh::expand).map_err(Problem::Slices)
}
