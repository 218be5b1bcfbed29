//! What can go wrong with grids.

use glam::DVec3;
use volery_slicing::error;

/// Why a grid, or another time step of it, cannot be drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GridError {
    /// An array that is not there.
    #[error("array '{}' is missing, expected one of: {}", .name.escape_debug(), .found.join(", ").escape_debug())]
    NoArray {
        /// As asked for.
        name: String,
        /// Those that are there.
        found: Vec<String>,
    },
    /// Nothing to colour by.
    #[error("0 arrays of values, expected at least one")]
    NoArrays,
    /// Fewer or more than one value per node.
    #[error("{found} values, expected {expected}, one per node")]
    NumValues {
        /// Values given.
        found: usize,
        /// Nodes.
        expected: usize,
    },
    /// Cells that are all at one place, or so far apart that there is no picture of them: a place for what is missing.
    #[error(
        "cells from {} to {}, expected an extent above 0 and at most {:e}",
        at(.bounds[0]), at(.bounds[1]), Self::MAX_EXTENT
    )]
    Extent {
        /// The ends of the box around the cells that hold matter.
        bounds: [DVec3; 2],
    },
    /// No cell holds matter.
    #[error("every cell is blank, expected some with finite places and values")]
    Blank,
    /// Values so far apart that their difference is no number.
    #[error("values from {:e} to {:e}, expected a range below 1.8e308", .range[0], .range[1])]
    TooWide {
        /// Smallest and largest value.
        range: [f64; 2],
    },
    /// The grid could not be made ready for slicing.
    #[error(transparent)]
    Slicer(#[from] error::Slicer),
}

impl GridError {
    /// The longest side of the box around the cells: the vertices of slices are 32 bits.
    pub const MAX_EXTENT: f64 = 2e30;
}

/// A place in few digits, whatever its size.
fn at(place: DVec3) -> String {
    let [x, y, z] = place
        .to_array()
        .map(|x| if (1e-3..1e6).contains(&x.abs()) || x == 0.0 { format!("{x}") } else { format!("{x:e}") });
    format!("({x}, {y}, {z})")
}
