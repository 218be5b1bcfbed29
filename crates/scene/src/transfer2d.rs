//! The transfer function over value and gradient magnitude: boundaries apart from what they bound.
//!
//! # Method
//! Section 3.3 of Benölken and Graf, *Direct Volume Rendering of Unstructured Grids in a PC based VR Environment* (WSCG
//! 2005). A [`Palette`] gives colour and opacity at even steps of value and magnitude, bilinear between and constant
//! outside. [`Sliders`] change the opacity of all of it without touching it:
//!
//! ```text
//! opacity = palette(value, magnitude) · global · (1 - weight + weight · magnitude / largest) · selection(magnitude)
//! ```
//!
//! The paper names the sliders and not their formulas; these are ours. The selection is soft, so that it can be drawn
//! from a table: a half at both ends of its range, with a smooth step over a quarter of the range around each, so that
//! what counts adds up to the range. As in [`TransferFunction`] an opacity is per
//! `unit_distance` of matter, and extinction follows as `s = -ln(1 - opacity) / unit_distance`.
//!
//! Clones share the palette until one of them edits it, so a [`History`](crate::History) of moved sliders costs little.
//! For edits by hand, heights that tell small opacities apart: [`height_from_opacity`].

use std::sync::Arc;

use crate::transfer::{TransferFunction, extinction};

mod height;

pub use height::{height_from_opacity, opacity_from_height};

/// Colour and opacity at one value and magnitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Straight linear RGB, each in [0, 1].
    pub color: [f64; 3],
    /// In [0, 1], per unit distance; 1 is opaque at once.
    pub opacity: f64,
}

/// Colours and opacities at even steps of value and magnitude.
#[derive(Clone, Debug, PartialEq)]
pub struct Palette {
    /// Values of the first and the last column, in data units.
    pub values: [f64; 2],
    /// Gradient magnitudes of the first and the last row, in data units per world length; not negative.
    pub magnitudes: [f64; 2],
    /// Entries of a row.
    pub columns: usize,
    /// Row after row, each of one magnitude, the lowest first.
    pub entries: Vec<Entry>,
    /// The world length that opacities refer to.
    pub unit_distance: f64,
}

impl Palette {
    /// The most columns, and the most rows.
    pub const MAX_SIDE: usize = 4096;

    /// The most entries.
    pub const MAX_ENTRIES: usize = 1 << 18;

    /// How many rows there are; a single one means that magnitudes do not count.
    pub fn rows(&self) -> usize {
        self.entries.len().checked_div(self.columns).unwrap_or(0)
    }

    /// A palette in which magnitudes do not count, from a function of the value at even steps. Where its control points
    /// lie between columns it is rounded off by less than a column.
    ///
    /// # Errors
    /// When a range or size is not meaningful.
    pub fn from_transfer(
        transfer: &TransferFunction,
        values: [f64; 2],
        magnitudes: [f64; 2],
        [columns, rows]: [usize; 2],
    ) -> Result<Self, Error> {
        let unit_distance = transfer.unit_distance();
        let mut palette = Self { values, magnitudes, columns, entries: Vec::new(), unit_distance };
        let mut defects = palette.range_defects();
        defects.extend(size_defect(columns, columns.saturating_mul(rows)));
        if !defects.is_empty() {
            return Err(Error { defects });
        }
        let [low, high] = values;
        let entry = |column: usize| {
            let (color, opacity) = match column {
                0 => transfer.classify(low),
                last if last + 1 == columns => transfer.classify(high),
                _ => transfer.classify(low + (high - low) * (column as f64 / (columns - 1) as f64)),
            };
            Entry { color, opacity }
        };
        palette.entries = (0..columns).map(entry).collect::<Vec<_>>().repeat(rows);
        Ok(palette)
    }

    fn range_defects(&self) -> Vec<Defect> {
        let mut defects = Vec::new();
        let rises = |[low, high]: [f64; 2]| high - low > 0.0 && (high - low).is_finite();
        if !rises(self.values) {
            defects.push(Defect::Values { found: self.values });
        }
        if !(rises(self.magnitudes) && self.magnitudes[0] >= 0.0) {
            defects.push(Defect::Magnitudes { found: self.magnitudes });
        }
        defects
    }

    fn defects(&self) -> Vec<Defect> {
        let mut defects = self.range_defects();
        let size = size_defect(self.columns, self.entries.len());
        let columns = self.columns;
        if size.is_none() {
            for (at, entry) in self.entries.iter().enumerate() {
                let (column, row) = (at % columns, at / columns);
                if !entry.color.into_iter().all(is_share) {
                    defects.push(Defect::Color { column, row, found: entry.color });
                }
                if !is_share(entry.opacity) {
                    defects.push(Defect::Opacity { column, row, found: entry.opacity });
                }
            }
        }
        defects.extend(size);
        if !(self.unit_distance > 0.0 && self.unit_distance.is_finite()) {
            defects.push(Defect::UnitDistance { found: self.unit_distance });
        }
        defects
    }

    /// Colour and opacity without sliders.
    fn classify(&self, value: f64, magnitude: f64) -> ([f64; 3], f64) {
        let place = |x: f64, [low, high]: [f64; 2], count: usize| {
            // `max` takes the other where x is NaN.
            let at = ((x - low) / (high - low) * (count - 1) as f64).max(0.0).min((count - 1) as f64);
            let below = (at as usize).min(count.saturating_sub(2));
            (below, (below + 1).min(count - 1), at - below as f64)
        };
        let (left, right, u) = place(value, self.values, self.columns);
        let (lower, upper, v) = place(magnitude, self.magnitudes, self.rows());
        let mix = |from: f64, to: f64, w: f64| from + (to - from) * w;
        let at = |of: fn(&Entry, usize) -> f64, channel: usize| {
            let [a, b, c, d] = [(lower, left), (lower, right), (upper, left), (upper, right)]
                .map(|(row, column)| of(&self.entries[row * self.columns + column], channel));
            mix(mix(a, b, u), mix(c, d, u), v)
        };
        let color = std::array::from_fn(|channel| at(|entry, channel| entry.color[channel], channel));
        (color, at(|entry, _| entry.opacity, 0))
    }
}

/// What acts on all of a palette.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sliders {
    /// Multiplies every opacity; in [0, 1].
    pub global_opacity: f64,
    /// How much the opacity follows the magnitude, as a part of the palette's largest; in [0, 1]. At 0 not at all, at 1
    /// matter without gradient is clear and only boundaries are left.
    pub gradient_weight: f64,
    /// The magnitudes that are left.
    pub selection: Option<Selection>,
}

impl Default for Sliders {
    /// Sliders that change nothing.
    fn default() -> Self {
        Self { global_opacity: 1.0, gradient_weight: 0.0, selection: None }
    }
}

impl Sliders {
    /// Whether the opacity follows the magnitude by more than the palette.
    pub fn depend_on_magnitude(&self) -> bool {
        self.gradient_weight > 0.0 || self.selection.is_some()
    }

    fn factor(&self, magnitude: f64, largest: f64) -> f64 {
        let weighted = 1.0 - self.gradient_weight + self.gradient_weight * (magnitude / largest);
        self.global_opacity * weighted * self.selection.map_or(1.0, |selection| selection.share(magnitude))
    }

    fn defects(&self) -> Vec<Defect> {
        let mut defects = Vec::new();
        if !is_share(self.global_opacity) {
            defects.push(Defect::GlobalOpacity { found: self.global_opacity });
        }
        if !is_share(self.gradient_weight) {
            defects.push(Defect::GradientWeight { found: self.gradient_weight });
        }
        if let Some(Selection { mean, range }) = self.selection
            && !(mean >= 0.0 && range > 0.0 && mean.is_finite() && range.is_finite())
        {
            defects.push(Defect::Selection { mean, range });
        }
        defects
    }
}

/// Magnitudes of gradients around a mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Selection {
    /// The middle, in data units per world length.
    pub mean: f64,
    /// The whole width, from half below the mean to half above it.
    pub range: f64,
}

impl Selection {
    /// How much matter of a magnitude counts, in [0, 1].
    pub fn share(&self, magnitude: f64) -> f64 {
        let from_mean = (magnitude - self.mean).abs() / self.range;
        let t = ((0.625 - from_mean) * 4.0).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    }
}

/// One thing that is wrong with a transfer function over value and magnitude.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Defect {
    /// Entries that make no palette, or too large a one.
    #[error(
        "{entries} entries in rows of {columns}, expected whole rows, 1 to {} columns and rows and at most {} entries",
        Palette::MAX_SIDE,
        Palette::MAX_ENTRIES
    )]
    Size {
        /// Entries of a row.
        columns: usize,
        /// All entries.
        entries: usize,
    },
    /// Values that do not rise.
    #[error("values are {found:?}, expected two rising numbers")]
    Values {
        /// As given.
        found: [f64; 2],
    },
    /// Magnitudes that do not rise, or are negative.
    #[error("magnitudes are {found:?}, expected two rising numbers, none negative")]
    Magnitudes {
        /// As given.
        found: [f64; 2],
    },
    /// A colour component outside [0, 1].
    #[error("column {column}, row {row}: colour {found:?}, expected three numbers in [0, 1]")]
    Color {
        /// Its place over values.
        column: usize,
        /// Its place over magnitudes.
        row: usize,
        /// As given.
        found: [f64; 3],
    },
    /// An opacity outside [0, 1].
    #[error("column {column}, row {row}: opacity {found}, expected a number in [0, 1]")]
    Opacity {
        /// Its place over values.
        column: usize,
        /// Its place over magnitudes.
        row: usize,
        /// As given.
        found: f64,
    },
    /// An entry that does not exist.
    #[error("column {column}, row {row}: no such entry, expected below column {columns} and row {rows}")]
    Place {
        /// As asked for.
        column: usize,
        /// As asked for.
        row: usize,
        /// How many there are.
        columns: usize,
        /// How many there are.
        rows: usize,
    },
    /// A unit distance that is not positive and finite.
    #[error("unit_distance is {found}, expected a positive finite number")]
    UnitDistance {
        /// As given.
        found: f64,
    },
    /// A global opacity outside [0, 1].
    #[error("global_opacity is {found}, expected a number in [0, 1]")]
    GlobalOpacity {
        /// As given.
        found: f64,
    },
    /// A gradient weight outside [0, 1].
    #[error("gradient_weight is {found}, expected a number in [0, 1]")]
    GradientWeight {
        /// As given.
        found: f64,
    },
    /// A selection of nothing.
    #[error("selection has mean {mean} and range {range}, expected finite numbers, the range above 0")]
    Selection {
        /// As given.
        mean: f64,
        /// As given.
        range: f64,
    },
}

/// Why a [`TransferFunction2d`] could not be made or changed: everything that is wrong.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("2D transfer function: {}", .defects.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))]
pub struct Error {
    /// All defects found, at least one.
    pub defects: Vec<Defect>,
}

/// A valid transfer function over value and gradient magnitude.
#[derive(Clone, Debug, PartialEq)]
pub struct TransferFunction2d {
    palette: Arc<Palette>,
    sliders: Sliders,
}

impl TransferFunction2d {
    /// The function of a palette under sliders.
    ///
    /// # Errors
    /// When one of them is not meaningful; the error lists every defect.
    pub fn new(palette: Palette, sliders: Sliders) -> Result<Self, Error> {
        let mut defects = palette.defects();
        defects.extend(sliders.defects());
        if defects.is_empty() {
            Ok(Self { palette: Arc::new(palette), sliders })
        } else {
            Err(Error { defects })
        }
    }

    /// The palette, without sliders.
    pub fn palette(&self) -> &Palette {
        &self.palette
    }

    /// The sliders.
    pub fn sliders(&self) -> Sliders {
        self.sliders
    }

    /// Moves the sliders.
    ///
    /// # Errors
    /// When one is out of its range; none is moved then.
    pub fn set_sliders(&mut self, sliders: Sliders) -> Result<(), Error> {
        let defects = sliders.defects();
        if defects.is_empty() {
            self.sliders = sliders;
            Ok(())
        } else {
            Err(Error { defects })
        }
    }

    /// Changes the opacity of one entry of the palette.
    ///
    /// # Errors
    /// When there is no such entry, or the opacity is none.
    pub fn set_opacity(&mut self, column: usize, row: usize, opacity: f64) -> Result<(), Error> {
        let (columns, rows) = (self.palette.columns, self.palette.rows());
        let defect = if column >= columns || row >= rows {
            Defect::Place { column, row, columns, rows }
        } else if !is_share(opacity) {
            Defect::Opacity { column, row, found: opacity }
        } else {
            Arc::make_mut(&mut self.palette).entries[row * columns + column].opacity = opacity;
            return Ok(());
        };
        Err(Error { defects: vec![defect] })
    }

    /// Straight colour and opacity per unit distance at a value and magnitude, sliders applied. A NaN value, a blank
    /// sample, is black and clear; a NaN magnitude counts as the lowest.
    pub fn classify(&self, value: f64, magnitude: f64) -> ([f64; 3], f64) {
        if value.is_nan() {
            return ([0.0; 3], 0.0);
        }
        let [lowest, largest] = self.palette.magnitudes;
        let magnitude = magnitude.max(lowest).min(largest);
        let (color, opacity) = self.palette.classify(value, magnitude);
        (color, opacity * self.sliders.factor(magnitude, largest))
    }

    /// Opacity per unit distance at a value and magnitude, sliders applied.
    pub fn opacity_at(&self, value: f64, magnitude: f64) -> f64 {
        self.classify(value, magnitude).1
    }

    /// Extinction per world length of an opacity per unit distance: `-ln(1 - opacity) / unit_distance`.
    #[inline]
    pub fn extinction_of_opacity(&self, opacity: f64) -> f64 {
        extinction(opacity, self.palette.unit_distance)
    }
}

fn is_share(x: f64) -> bool {
    (0.0..=1.0).contains(&x)
}

fn size_defect(columns: usize, entries: usize) -> Option<Defect> {
    let sides = 1..=Palette::MAX_SIDE;
    let rows = entries.checked_div(columns).unwrap_or(0);
    let is_good = sides.contains(&columns)
        && sides.contains(&rows)
        && entries == rows * columns
        && entries <= Palette::MAX_ENTRIES;
    (!is_good).then_some(Defect::Size { columns, entries })
}

#[cfg(test)]
mod tests;
