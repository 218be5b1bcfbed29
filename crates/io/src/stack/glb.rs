//! `.glb`: a stack that any viewer of glTF 2.0 shows, and that reads back to the bit.
//!
//! # Layout
//! One buffer view has the vertices, 16 or 20 bytes each, another the triangles. Attributes, as KHR_mesh_quantization
//! allows them:
//! - `POSITION`: three whole numbers of 16 bits; translation and scale of the node make places in the world of them;
//! - `_VALUE`: a whole number of 16 bits;
//! - `COLOR_0`: what a transfer function makes of the value, opacity that of a slice, linear, for viewers;
//! - `_GRADIENT`, where there are gradients: direction in 127ths, and the magnitude as an unsigned byte.
//!
//! Mesh `slices` has a primitive per slice. Mesh `outline` has the strips between them, which take matter away as well
//! and mean nothing to a viewer; no node shows it. The `extras` of a primitive are `position` and `thickness` of its
//! sheet; those of the file, under `volery`, are `normal`, `origin`, `low`, `scale` and `magnitude_scale`, as the fields
//! of `QuantizedMesh` have them.
//!
//! With [`GlbOptions::is_coded`] both views are compressed as EXT_meshopt_compression says, to about a quarter; then
//! a viewer must know that too.
//!
//! # Limits
//! Sheets without triangles are left out. A viewer that does not sort primitives shows slices right from above alone.

mod read;
mod write;

pub(super) use read::read;
pub use write::{GlbOptions, write_glb};

/// Name of the extension that compresses views.
const MESHOPT: &str = "EXT_meshopt_compression";

/// Names of attributes that glTF does not know.
const VALUE: &str = "_VALUE";
const GRADIENT: &str = "_GRADIENT";

/// Types of numbers.
const BYTE: u32 = 5120;
const UNSIGNED_BYTE: u32 = 5121;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;
