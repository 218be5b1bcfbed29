//! The pyramid against slow oracles.

mod bricks;
mod oracle;
mod statistics;
