#![doc = include_str!("../README.md")]
//!
//! # Modules
//! - [`place`]: boxes and eyes; why neighbours agree.
//! - [`aspect`]: which faces are seen, the three classes and ten cases.
//! - [`table`]: the tables, for shaders as well.
//! - [`fans`]: vertices, triangles, thickness: method and guarantees.
//! - [`clip`]: triangles cut by planes.
//! - [`chord`](mod@chord): the length of any ray inside a box.

pub mod aspect;
pub mod chord;
pub mod clip;
pub mod fans;
pub mod place;
pub mod real;
pub mod table;

pub use aspect::{Aspect, Case};
pub use chord::chord;
pub use clip::{HalfSpace, Polygon};
pub use fans::{Fans, Vertex};
pub use place::{Cuboid, LatticeEye, Relative, Viewpoint};
pub use real::Real;
