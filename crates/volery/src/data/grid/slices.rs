//! Slices of a grid in files, small enough to send.

use std::path::Path;
use std::time::Instant;

use glam::DVec3;
use volery_io::{GlbOptions, WriteError, write_glb, write_vsl};
use volery_scene::TransferFunction;
use volery_slicing::{CompactMesh, Planes, QuantizedMesh, error, node_gradients};

use super::GridData;
use crate::data::Data as _;
use crate::transfer::Preset;

/// Bytes of a corner of a polygon where nothing is shared: place, gradient and value as 32-bit numbers.
const FLOAT_BYTES: usize = 28;

/// Slices through a grid and the outline between them, with gradients.
pub struct Slices {
    compact: CompactMesh,
    transfer: TransferFunction,
    /// Distance between planes.
    pub distance: f64,
    /// What it took.
    pub counts: SliceCounts,
}

/// What slices need, from step to step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SliceCounts {
    /// Planes.
    pub planes: usize,
    /// Polygons in which planes meet cells.
    pub polygons: usize,
    /// Triangles of slices and of the outline between them.
    pub triangles: usize,
    /// Vertices of them, each once.
    pub vertices: usize,
    /// Bytes of the polygons with each corner on its own: place, gradient and value as 32-bit numbers.
    pub float_bytes: u64,
    /// Bytes of the same corners in 12 bytes each.
    pub quantized_bytes: u64,
    /// Bytes of the polygons over vertices that they share: 12 for a vertex, 4 for a corner.
    pub indexed_bytes: u64,
    /// Bytes of what a device draws: vertices and triangles, the outline between planes included.
    pub drawn_bytes: u64,
    /// Seconds of slicing.
    pub slice_seconds: f64,
    /// Seconds of making it small.
    pub compact_seconds: f64,
}

/// Why a grid could not be sliced.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SlicesError {
    /// No planes.
    #[error(transparent)]
    Planes(#[from] error::Planes),
    /// Too many polygons.
    #[error(transparent)]
    Cut(#[from] error::Cut),
    /// Too many triangles.
    #[error(transparent)]
    Mesh(#[from] error::Mesh),
    /// Places or values beyond what can be quantised.
    #[error(transparent)]
    Compact(#[from] error::Compact),
}

impl GridData {
    /// Slices by so many planes, evenly over the grid's extent along a normal of any length.
    ///
    /// # Errors
    /// When the normal has no direction, or there would be too many polygons.
    pub fn slices(&self, normal: DVec3, num_planes: usize) -> Result<Slices, SlicesError> {
        let slicer = &self.shape.slicer;
        let start = Instant::now();
        let planes = Planes::over(slicer.grid(), normal, num_planes)?;
        let stack = slicer.slice(&planes)?;
        let polygons = stack.num_polygons();
        let corners: usize = stack.sections().map(|(_, section)| section.corners().len()).sum();
        let indexed_bytes = (12 * stack.num_vertices() + 4 * corners) as u64;
        drop(stack);
        let gradients = node_gradients(slicer.grid(), &self.values);
        let mesh = slicer.mesh(&planes, &self.values, Some(&gradients))?;
        let slice_seconds = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let compact = CompactMesh::new(&mesh, slicer.grid().points(), &self.values, Some(&gradients))?;
        let compact_seconds = start.elapsed().as_secs_f64();
        let counts = SliceCounts {
            planes: planes.len(),
            polygons,
            triangles: compact.triangles.len(),
            vertices: compact.vertices.len(),
            float_bytes: (FLOAT_BYTES * corners) as u64,
            quantized_bytes: 12 * corners as u64,
            indexed_bytes,
            drawn_bytes: 12 * (compact.vertices.len() + compact.triangles.len()) as u64,
            slice_seconds,
            compact_seconds,
        };
        Ok(Slices {
            compact,
            transfer: self.preset_over(Preset::Auto, None),
            distance: planes.distance(),
            counts,
        })
    }
}

impl Slices {
    /// What a device draws.
    pub fn mesh(&self) -> QuantizedMesh {
        self.compact.clone().expand()
    }

    /// What is stored.
    pub fn compact(&self) -> &CompactMesh {
        &self.compact
    }

    /// Writes a `.vsl` file; returns the number of bytes.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write_vsl(&self, path: &Path) -> Result<u64, WriteError> {
        write_vsl(path, &self.compact)
    }

    /// Writes a `.glb` file in the colours of [`Preset::Auto`], each slice with the opacity of its slab; returns the
    /// number of bytes.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write_glb(&self, path: &Path, options: GlbOptions) -> Result<u64, WriteError> {
        let color = |value: f64| {
            let ([r, g, b], opacity) = self.transfer.classify(value);
            let depth = self.transfer.extinction_of_opacity(opacity) * self.distance;
            [r, g, b, -(-depth).exp_m1()]
        };
        write_glb(path, &self.mesh(), color, options)
    }
}
