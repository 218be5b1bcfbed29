//! What one frame asks of a backend, and what comes back.
//!
//! A technique (in `volery`) turns a scene and its dials into plain data: which bricks must be resident,
//! and a [`Frame`] that places them in visibility order. A [`Backend`] executes it: `volery-software` on
//! the CPU, `volery-wgpu` on a GPU. Both pass the suite of `volery-conformance`, so a technique is written
//! once and each executor checks the other.
//!
//! # Method
//! A brick holds the samples of one octree node, shared boundary included, so that the trilinear field is
//! continuous across bricks of one level without looking at a neighbour. A backend casts a ray per pixel
//! through the bricks front to back. Inside a brick it walks the cells between samples: along a ray the
//! field in one cell is a cubic without kinks, so splitting at cell faces removes the error of the field's
//! curvature that keeps fixed steps at first order. Each piece is integrated through a [`RayTransfer`]: in most cells
//! by the antiderivative of extinction and of colour times extinction, which sees every control point between the ends
//! of a piece, however steep the field; where that might be wrong, from control point to control point.
//!
//! # Pictures in parts
//! A picture is made of parts, which come front to back in visibility order: nothing of a part hides anything of one
//! before it. Between parts a backend keeps of each pixel the colour it has gathered and what light is left, in `f32`, so
//! each part goes on where the one before ended; surfaces and background come at the end. Within a part the order is
//! the content's own. So a picture may show what would not fit a device at one time, be looked at between parts, and be
//! left when there is no more time.
//!
//! Or a picture is drawn window by window, each shows one content in place of what it showed: by coarse bricks first,
//! by better ones as long as there is time.
//!
//! # Guarantees
//! A picture depends on the frame alone: not on the number of threads, nor on the order of uploads, nor on what a
//! backend kept of others.
//!
//! # Non-goals
//! No choice of bricks (`volery-octree`), no clock, no file, no GPU type.

pub mod backend;
pub mod brick;
pub mod brick_grid;
pub mod cubes;
pub mod plane_tiles;
pub mod planes;
pub mod ray_transfer;
pub mod sheets;

pub use backend::{
    Backend, Device, DeviceKind, DrawError, Drawn, FinishedPart, Image, RayDoubt, UploadError, UploadedBytes,
    Window,
};
pub use brick::{Brick, BrickId, JoinedBrick, PlacedBrick, TexelType, Texels, VolumeLayout};
pub use brick_grid::BrickGrid;
pub use cubes::{Cube, Cubes, Thickness};
pub use plane_tiles::{PlaneTile, PlaneTiles};
pub use planes::{BlendedBrick, Planes, PointTransfer, Sampling};
pub use ray_transfer::RayTransfer;
pub use sheets::{Counted, Light, Quantization, Sheet, SheetTransfer, SheetVertices, Sheets};

pub use volery_scene::Revision;
use volery_scene::{Camera, TriangleMesh};

/// A picture of one part.
#[derive(Clone, Debug)]
pub struct Frame<'a> {
    /// How the picture is taken.
    pub view: PictureView<'a>,
    /// What is to be seen.
    pub content: Content<'a>,
}

/// How a picture is taken: all but what is to be seen.
#[derive(Clone, Copy, Debug)]
pub struct PictureView<'a> {
    /// Pixels from left to right, at least 1.
    pub width: u32,
    /// Pixels from top to bottom, at least 1.
    pub height: u32,
    /// Where the picture is taken from; without defects.
    pub camera: Camera,
    /// Linear RGB behind everything.
    pub background: [f32; 3],
    /// Opaque surfaces among the content. The ray of a pixel's centre ends at the nearest, of equals at the first in
    /// the list; the mesh's colour times [`shade`](volery_scene::mesh::shade) then is what is behind everything. Matter
    /// and cubes count up to there, planes before it; of a sheet, that part of its slab, half before and half behind the
    /// triangle along the ray, which is before it. Triangles whose thickness has a slope count whole if they are.
    pub meshes: &'a [TriangleMesh],
}

/// What is to be seen of a volume.
#[derive(Clone, Copy, Debug)]
pub enum Content<'a> {
    /// Its matter, along one ray per pixel.
    Rays(Rays<'a>),
    /// Cutting planes through it.
    Planes(Planes<'a>),
    /// Cubes of constant colour and extinction.
    Cubes(Cubes<'a>),
    /// Slices through matter, each standing for a slab of it.
    Sheets(Sheets<'a>),
}

impl Content<'_> {
    /// The bricks that must be resident.
    pub fn bricks(&self) -> impl Iterator<Item = &PlacedBrick> {
        let (rays, planes): (&[JoinedBrick], &[BlendedBrick]) = match self {
            Self::Rays(rays) => (rays.bricks, &[]),
            Self::Planes(planes) => (&[], planes.bricks),
            Self::Cubes(_) | Self::Sheets(_) => (&[], &[]),
        };
        rays.iter().map(|brick| &brick.placed).chain(planes.iter().map(|brick| &brick.placed))
    }
}

/// Emitting and absorbing matter, integrated along one ray per pixel.
#[derive(Clone, Copy, Debug)]
pub struct Rays<'a> {
    /// Colour and extinction, made for the layout.
    pub transfer: &'a RayTransfer,
    /// What to draw, front to back: no brick hides one that comes before it. Bricks do not overlap; what
    /// no brick covers is empty.
    pub bricks: &'a [JoinedBrick],
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
