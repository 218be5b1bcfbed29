//! Sessions of each kind of data: what stays, what a dial does, what is refused.

mod deadlines;
mod grids;
mod moving;
mod planes;
mod volumes;
