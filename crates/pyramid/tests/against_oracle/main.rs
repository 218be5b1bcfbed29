//! The pyramid against slow oracles.

mod bricks;
mod held;
mod oracle;
mod statistics;
