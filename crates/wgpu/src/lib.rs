//! Executes frames on a GPU, or on a CPU that pretends to be one, through wgpu.
//!
//! # Method
//! Bricks lie side by side in one texture, the [pool](pool), z as its layers: `textureGather` then reads four
//! corners of a cell at once, and two gathers make a cell whole in 32 bits, where a GPU's own trilinear
//! filter rounds weights to 8. A compute shader casts one ray per pixel. Space is divided into [units](units);
//! of each, one texel says which brick is there, or how far around space is empty, so that a ray leaps over
//! emptiness in few steps. In occupied space the ray visits every cell between samples, cuts it in two pieces
//! and integrates each through the frame's [`IntegratedTransfer`](volery_frame::IntegratedTransfer).
//!
//! Rays are rebased in f64 to a start near the volume before they become f32, so an eye a million cells away
//! loses nothing. Light accumulates in 32 bits as differences of transmittance, which add up exactly. A ray
//! stops once it lets 1/4096 of the light through.
//!
//! # Guarantees
//! No panic: what a device refuses comes back as an error. The same frame gives the same bits on the same
//! device.
//!
//! # Limits
//! Bricks of at most 1023 cells, and of one cell less than the device has texture layers (255 on any). The
//! pool is one texture: about 2 GB of 8-bit texels where textures have 8192 texels per axis.
//!
//! # Non-goals
//! No window, no interaction, no choice of bricks.

mod adapter;
mod backend;
mod blocks;
mod gpu;
mod picture;
mod pool;
mod raycast;
mod units;
mod view;

pub use adapter::{OpenError, adapters};
pub use backend::WgpuBackend;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
