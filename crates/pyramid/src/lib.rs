//! Voxel pyramids: levels, bricks, and exact statistics of every node.
//!
//! # Method
//! A pyramid has levels of halving resolution over one domain, and each level is cut into nodes of equal
//! size in its own cells; [`layout`] says where everything lies. Two kinds are in use, and both are here:
//! *decimated*, whose coarse samples are fine samples (LaMar, Duchaineau, Hamann, Joy 2000; their high tile
//! of 31 samples is `brick_cells = 30`, the low one the part of the parent's brick over the node), and
//! *averaged*, whose coarse samples are means (Schussman, Max 2001; Li, Shen). A renderer reads
//! [bricks](Brick), which hold all that trilinear sampling inside a node needs, and decides by
//! [statistics](NodeStats); both come through one trait, [`NodeSource`], of which [`Pyramid`] is the one in
//! memory.
//!
//! What we changed: any dims, any sample type, blank samples; nodes at the domain's end are clipped, not
//! padded; and a node's error is not an estimate. Both fields of a node are trilinear on nested grids, so
//! their largest difference is at a vertex of the common refinement, and is found there, exactly.
//!
//! # Guarantees
//! With `M` the largest size of a finite sample in the node and the coarse samples around it:
//!
//! | | integers | floats |
//! |---|---|---|
//! | `min`, `max`, counts | exact | exact |
//! | `mean` | exact sum, rounded twice | within `1e-14 M` |
//! | `std_dev` | exact sums, within 8 units in the last place | within `1e-12` relative |
//! | `error` | exact while `bits + 3 s <= 53`, else within `2^-48 M` | within `2^-48 M` |
//!
//! `s` is the level for the decimated kind, the level + 1 for the averaged kind: 8 and 16 bits are exact up
//! to level 11, which bricks of 32 reach at 65,536 samples an axis; 32 bits up to level 6. In a
//! node all of whose finite samples are equal, deviation and error are exactly 0.
//!
//! - *Blank* samples, NaN or infinite, are in no statistics but their count. A node (above level 0) whose
//!   support holds blank and finite samples has error `+∞`, one of blank samples alone has error 0 and an
//!   empty range. Inside a node, the coarse field lies in `[min - error, max + error]`.
//! - The result is the same to the bit on any number of threads and with any SIMD instructions.
//! - Levels above 0 take 1/7 of the samples' bytes, statistics 56 bytes per node and channel (0.2 % of a
//!   volume of `u8` in bricks of 32). While building, a few times the statistics are taken for
//!   what the blocks find.
//! - All statistics are `f64`: they decide, and are few. Samples stay in their type.
//!
//! # Non-goals
//! No files, no cache, no tree walk, no picture. Squares of deviations above `1e154` and differences above
//! `1e308` overflow to infinity.

mod analysis;
pub mod brick;
pub mod cubes;
pub mod held;
pub mod layout;
mod levels;
pub mod node;
pub mod pyramid;
pub mod source;
pub mod stats;

pub use brick::{Brick, BrickSamples, BrickShape};
pub use cubes::{Cube, CubeTree};
pub use held::held_error;
pub use layout::{Kind, Layout};
pub use node::Node;
pub use pyramid::Pyramid;
pub use source::{NodeSource, ReadError};
pub use stats::NodeStats;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
