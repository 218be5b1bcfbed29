//! What one frame asks of a backend, and what comes back.
//!
//! A technique (in `volery`) turns a scene and its dials into plain data: which bricks must be resident,
//! and a [`Frame`] that places them in visibility order. A [`Backend`] executes it: `volery-software` on
//! the CPU, `volery-wgpu` on a GPU. Both pass the same `conformance` suite (a feature), so a technique is written
//! once and each executor checks the other.
//!
//! # Method
//! A brick holds the samples of one octree node, shared boundary included, so that the trilinear field is
//! continuous across bricks of one level without looking at a neighbour. A backend casts a ray per pixel
//! through the bricks front to back. Inside a brick it walks the cells between samples: along a ray the
//! field in one cell is a cubic without kinks, so splitting at cell faces removes the error of the field's
//! curvature that keeps fixed steps at first order. Each piece is integrated through an
//! [`IntegratedTransfer`], the antiderivative of extinction and of colour times extinction, which sees
//! every control point between the ends of a piece, however steep the field.
//!
//! # Guarantees
//! A picture depends on the frame alone: not on the number of threads, nor on the order of uploads.
//!
//! # Non-goals
//! No choice of bricks (`volery-octree`), no clock, no file, no GPU type.

pub mod backend;
pub mod brick;
#[cfg(feature = "conformance")]
pub mod conformance;
pub mod integral;

pub use backend::{Backend, Device, DeviceKind, DrawError, Drawn, Image, UploadError};
pub use brick::{Brick, BrickId, PlacedBrick, TexelType, Texels, VolumeLayout};
pub use integral::IntegratedTransfer;

use volery_scene::Camera;

/// One picture to draw of the volume that a backend holds.
#[derive(Clone, Debug)]
pub struct Frame<'a> {
    /// Pixels from left to right, at least 1.
    pub width: u32,
    /// Pixels from top to bottom, at least 1.
    pub height: u32,
    /// Where the picture is taken from; without defects.
    pub camera: Camera,
    /// Colour and extinction, made for the layout's value range.
    pub transfer: &'a IntegratedTransfer,
    /// Linear RGB behind the volume.
    pub background: [f32; 3],
    /// What to draw, front to back: no brick hides one that comes before it. Bricks do not overlap; what
    /// no brick covers is empty.
    pub bricks: &'a [PlacedBrick],
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
