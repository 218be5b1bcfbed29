//! Whole pictures.

use std::sync::atomic::{AtomicU32, Ordering};

use rayon::prelude::*;
use volery_scene::{Camera, Ray, SampleType, TransferFunction, TriangleMesh, VoxelGrid, camera};

use crate::image::Image;
use crate::surfaces::{Backdrop, Surfaces};
use crate::tracer::Tracer;

/// Why there is no reference picture.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// Colours have no transfer function.
    #[error("reference: samples are {found}, expected scalars")]
    ColorSamples {
        /// What the samples are.
        found: SampleType,
    },
    /// Values that are not those of a grid's nodes.
    #[error("reference: {found} values at the nodes of a grid, expected {expected}")]
    NodeValues {
        /// Values given.
        found: usize,
        /// Number of nodes.
        expected: usize,
    },
    /// The camera cannot take a picture.
    #[error("reference: {}", .defects.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))]
    Camera {
        /// All that is wrong with it.
        defects: Vec<camera::Defect>,
    },
    /// A picture without pixels, or with more than can be addressed.
    #[error("reference: picture of {width} x {height} pixels, expected 1 to 2^30 in all")]
    Size {
        /// Columns asked for.
        width: u32,
        /// Rows asked for.
        height: u32,
    },
}

/// Most pixels of a picture; 24 GiB of them.
const MAX_PIXELS: u64 = 1 << 30;

/// The true picture of `grid` in front of `background`: each pixel the light along the ray through its
/// centre, within 1e-9. Uses all threads of the current rayon pool; the result does not depend on how many.
///
/// # Errors
/// When the samples are colours, the camera is not meaningful, or the size is.
pub fn render(
    grid: &VoxelGrid,
    camera: &Camera,
    transfer: &TransferFunction,
    background: [f64; 3],
    width: u32,
    height: u32,
) -> Result<Image, Error> {
    Tracer::new(grid, transfer)?.render(camera, background, width, height, &|_| {})
}

/// What each pixel's ray sees before what it ends at, row by row on all threads.
pub(crate) fn picture(
    camera: &Camera,
    [width, height]: [u32; 2],
    (meshes, background): (&[TriangleMesh], [f64; 3]),
    progress: &(dyn Fn(f64) + Sync),
    trace: impl Fn(&Ray, &Backdrop) -> [f64; 3] + Sync,
) -> Result<Image, Error> {
    let defects = camera.defects();
    if !defects.is_empty() {
        return Err(Error::Camera { defects });
    }
    if !(1..=MAX_PIXELS).contains(&(u64::from(width) * u64::from(height))) {
        return Err(Error::Size { width, height });
    }
    let rays = camera.rays(width, height);
    let surfaces = Surfaces::new(meshes, camera, [width, height]);
    let num_done = AtomicU32::new(0);
    let mut pixels = vec![[0.0; 3]; width as usize * height as usize];
    pixels.par_chunks_mut(width as usize).zip(0..height).for_each(|(row_pixels, row)| {
        for (pixel, column) in row_pixels.iter_mut().zip(0..width) {
            let ray = rays.pixel(column, row);
            *pixel = trace(&ray, &surfaces.backdrop([column, row], &ray, background));
        }
        let done = num_done.fetch_add(1, Ordering::Relaxed) + 1;
        progress(f64::from(done) / f64::from(height));
    });
    Ok(Image::of_all_pixels(width, height, pixels))
}

impl Tracer<'_> {
    /// [`render`], calling `progress` with the finished part of the picture, in [0, 1], after each row, from
    /// any thread.
    ///
    /// # Errors
    /// When the camera or the size is not meaningful.
    pub fn render(
        &self,
        camera: &Camera,
        background: [f64; 3],
        width: u32,
        height: u32,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<Image, Error> {
        picture(camera, [width, height], (self.meshes(), background), progress, |ray, backdrop| {
            self.trace_to(ray, backdrop.distance).over(backdrop.color)
        })
    }
}
