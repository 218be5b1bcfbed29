//! Sections against the slow way, cell by cell and grid by grid.

#![allow(clippy::unwrap_used, reason = "what cannot be set up has failed")]

mod adaptive;
mod cells;
mod code;
mod collapsed;
mod compact;
mod gradients;
mod grids;
mod hard;
mod mesh;
mod steps;
mod support;
