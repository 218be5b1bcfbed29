//! Executes frames on a GPU, or on a CPU that pretends to be one, through wgpu.
//!
//! # Method
//! Bricks lie in one texture, the pool, as 2D slices: `textureGather` reads four corners of a cell at once, so
//! that two gathers make a cell whole in 32 bits, where a GPU's own trilinear filter rounds weights to 8. A
//! compute shader casts one ray per pixel. Space is divided into units; of each, one texel says which brick is
//! there, or how far around space is empty, so that a ray leaps over emptiness in few steps. In occupied space
//! the ray visits every cell between samples, cuts it in two pieces and integrates each through the table of the frame's
//! [`RayTransfer`](volery_frame::RayTransfer). What that may be off by is known per cell; where it is too much a stretch
//! is halved, or the cubic integrated from control point to control point, as in the software executor.
//!
//! Leaps and cells are rounds of one loop. On llvmpipe, 512x512 pixels of a 256x256x128 volume took 170 ms so,
//! and 250 ms with a loop over cells inside a loop over blocks, where the rays of a SIMD group wait for one
//! another.
//!
//! A picture lies in tiles of at most 64 MiB, in each the colour that pixels have gathered and the light that is left, in
//! 32 bits: parts go to the device one after the other, and nobody waits for them. What is rendered, not traced, is
//! rendered over nothing and then put behind what is there. The end puts surfaces or the background behind all and is
//! read back, or drawn into a texture of somebody else's.
//!
//! What does not depend on the camera is sent once: bricks, where they are, tables, cubes, sheets and surfaces, told by
//! revisions. A camera that moves sends how a part is seen, and a bit per brick where it shows some of them only.
//!
//! Rays are rebased in f64 to a start near the volume before they become f32, so an eye a million cells away
//! loses nothing. Light accumulates in 32 bits as differences of transmittance, which add up exactly. A ray
//! stops once it lets 1/4096 of the light through.
//!
//! Cutting planes share the pool. A workgroup draws a tile of 16x16 pixels, for which the CPU has found in f64 where
//! each plane lies; a grid of runs of bricks in Z order, or a short search in a run, tells the brick of a place.
//!
//! Cubes of constant matter are rendered, not traced: the vertex stage makes the fans of `volery-cubefan` from 24 bytes
//! per cube, the fragment stage the exact length of the ray and its opacity, and blending in 32 bits lays cube over
//! cube from back to front. On two cores llvmpipe draws 0.5 million cubes per second into 768x768 pixels (172,583 in
//! 316 ms), two thirds of it the same in a picture of 64x64: vertices and triangles, on one thread.
//!
//! Sheets of triangles are rendered too, one indexed draw each, whose number tells the vertex stage the sheet's
//! thickness. Vertices stay on the device under their revision, floats or the 12 bytes that the vertex stage decodes.
//! The fragment stage knows the angle of its ray, so it has the length in matter also in perspective; an opacity below
//! zero takes matter away, which blending in floats allows. On two cores llvmpipe draws 592,000 triangles in 256
//! sheets, 10 million fragments, in 230 ms; 48 ms of them are the triangles, 120 ms their rasterising and blending.
//! (`cargo bench -p volery-wgpu`)
//!
//! Opaque surfaces have a pass of their own before all else, see `surfaces`; it leaves colours and depths in a texture
//! at which the others end. Without meshes there is neither the pass nor the reading.
//!
//! # Guarantees
//! No panic: what a device refuses comes back as an error. The same frame gives the same bits on the same
//! device.
//!
//! # Limits
//! A device needs what `needed_limits` says. Bricks of at most about 400 cells, and a pool of at most about 2 GB of 8-bit texels, where textures have 8192
//! texels per axis and 256 layers. Positions are f32: to a thousandth of a cell in volumes of 10,000 cells.
//!
//! # Non-goals
//! No window, no interaction, no choice of bricks.

mod adapter;
mod backend;
mod bindings;
mod blocks;
mod choice;
mod cubes;
mod fan_view;
mod gpu;
mod jobs;
mod needs;
mod picture;
mod placed;
mod plane;
mod pool;
mod present;
mod raycast;
mod sheets;
mod surfaces;
mod tiles;
mod units;
mod view;

pub use adapter::{OpenError, adapters};
pub use backend::WgpuBackend;
pub use needs::{USEFUL_FEATURES, needed_limits};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
