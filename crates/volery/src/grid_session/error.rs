//! What can go wrong with grids.

use volery_slicing::error;

/// Why a grid, or another time step of it, cannot be drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OpenError {
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
