//! Our own JSON of transfer functions, in and out: over values, and over values and gradient magnitudes.
//!
//! Numbers are written with as many digits as bring them back bit for bit.

use std::io::Write;
use std::path::Path;

use serde::{Deserialize, Serialize};
use volery_scene::transfer2d::{self, Entry, Palette, Selection, Sliders};
use volery_scene::{ControlPoint, TransferFunction, TransferFunction2d, transfer};

use super::{MAX_FILE_BYTES, TransferError, TransferProblem, json_problem};
use crate::bytes::load_text;
use crate::out::{WriteError, write_atomically};

/// The transfer function in a scene file and in a file of its own.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TransferJson {
    points: Vec<PointJson>,
    unit_distance: f64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PointJson {
    value: f64,
    color: [f64; 3],
    opacity: f64,
}

impl TransferJson {
    pub(crate) fn new(transfer: &TransferFunction) -> Self {
        let point = |&ControlPoint { value, color, opacity }: &_| PointJson { value, color, opacity };
        let points = transfer.points().iter().map(point).collect();
        Self { points, unit_distance: transfer.unit_distance() }
    }

    pub(crate) fn validated(self) -> Result<TransferFunction, transfer::Error> {
        let point = |PointJson { value, color, opacity }| ControlPoint { value, color, opacity };
        TransferFunction::new(self.points.into_iter().map(point).collect(), self.unit_distance)
    }
}

/// The transfer function over value and gradient magnitude.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Transfer2dJson {
    values: [f64; 2],
    magnitudes: [f64; 2],
    columns: usize,
    rows: usize,
    colors: Vec<[f64; 3]>,
    opacities: Vec<f64>,
    unit_distance: f64,
    #[serde(default = "neutral_opacity")]
    global_opacity: f64,
    #[serde(default)]
    gradient_weight: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    selection: Option<SelectionJson>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SelectionJson {
    mean: f64,
    range: f64,
}

fn neutral_opacity() -> f64 {
    Sliders::default().global_opacity
}

/// Why fields of the right types make no transfer function over value and gradient magnitude.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Transfer2dProblem {
    /// A list that has not one entry per column and row.
    #[error("{field} has {found} entries, expected {columns} columns x {rows} rows")]
    Count {
        /// The list.
        field: &'static str,
        /// Its entries.
        found: usize,
        /// As given.
        columns: usize,
        /// As given.
        rows: usize,
    },
    /// The function is not meaningful.
    #[error("2D transfer function: {}", crate::error::first_of(&.0.defects))]
    Defects(transfer2d::Error),
}

impl Transfer2dJson {
    pub(crate) fn new(function: &TransferFunction2d) -> Self {
        let palette = function.palette();
        let Sliders { global_opacity, gradient_weight, selection } = function.sliders();
        Self {
            values: palette.values,
            magnitudes: palette.magnitudes,
            columns: palette.columns,
            rows: palette.rows(),
            colors: palette.entries.iter().map(|entry| entry.color).collect(),
            opacities: palette.entries.iter().map(|entry| entry.opacity).collect(),
            unit_distance: palette.unit_distance,
            global_opacity,
            gradient_weight,
            selection: selection.map(|Selection { mean, range }| SelectionJson { mean, range }),
        }
    }

    pub(crate) fn validated(self) -> Result<TransferFunction2d, Transfer2dProblem> {
        let Self { values, magnitudes, columns, rows, colors, opacities, unit_distance, .. } = self;
        for (field, found) in [("colors", colors.len()), ("opacities", opacities.len())] {
            if columns.checked_mul(rows) != Some(found) {
                return Err(Transfer2dProblem::Count { field, found, columns, rows });
            }
        }
        let entries = colors.into_iter().zip(opacities);
        let entries = entries.map(|(color, opacity)| Entry { color, opacity }).collect();
        let sliders = Sliders {
            global_opacity: self.global_opacity,
            gradient_weight: self.gradient_weight,
            selection: self.selection.map(|SelectionJson { mean, range }| Selection { mean, range }),
        };
        let palette = Palette { values, magnitudes, columns, entries, unit_distance };
        TransferFunction2d::new(palette, sliders).map_err(Transfer2dProblem::Defects)
    }
}

/// Reads a transfer function over value and gradient magnitude:
///
/// ```json
/// {"values": [0, 255], "magnitudes": [0, 40], "columns": 2, "rows": 2,
///  "colors": [[0, 0, 1], [1, 0, 0], [0, 1, 1], [1, 1, 0]], "opacities": [0, 0.1, 0, 0.8], "unit_distance": 1,
///  "global_opacity": 0.5, "gradient_weight": 1, "selection": {"mean": 30, "range": 10}}
/// ```
/// Lists go row after row, each of one magnitude, the lowest first. The last three fields, the sliders, may be missing.
///
/// # Errors
/// When the file cannot be read, is none of this kind or makes no valid function.
pub fn read_transfer_2d(path: &Path) -> Result<TransferFunction2d, TransferError> {
    let read = || {
        let text = load_text(path, MAX_FILE_BYTES).map_err(TransferProblem::File)?;
        let json: Transfer2dJson = serde_json::from_str(&text).map_err(json_problem)?;
        json.validated().map_err(TransferProblem::TwoDimensional)
    };
    read().map_err(|problem| TransferError { path: path.to_owned(), problem })
}

/// Writes a transfer function as our JSON; [`read_transfer`](super::read_transfer) brings it back bit for bit.
///
/// # Errors
/// When the file cannot be written.
pub fn write_transfer(path: &Path, transfer: &TransferFunction) -> Result<(), WriteError> {
    write(path, &TransferJson::new(transfer))
}

/// Writes a transfer function over value and gradient magnitude; [`read_transfer_2d`] brings it back bit for bit.
///
/// # Errors
/// When the file cannot be written.
pub fn write_transfer_2d(path: &Path, transfer: &TransferFunction2d) -> Result<(), WriteError> {
    write(path, &Transfer2dJson::new(transfer))
}

fn write(path: &Path, json: &impl Serialize) -> Result<(), WriteError> {
    write_atomically(path, |file| {
        serde_json::to_writer(&mut *file, json)?;
        writeln!(file)
    })
}
