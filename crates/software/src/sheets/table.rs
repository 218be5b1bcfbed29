//! The transfer function of sheets, as fragments read it.

use volery_frame::SheetTransfer;

/// Colours and extinctions, at least two columns.
#[derive(Debug)]
pub(super) struct Table {
    /// `[r, g, b, -1]`: times opacity and transmittance it is what a fragment adds to light and transmittance.
    pub(super) colors: Vec<[f32; 4]>,
    /// Per world length.
    pub(super) extinctions: Vec<f32>,
    pub(super) columns: usize,
    pub(super) rows: usize,
    pub(super) column_from_value: [f32; 2],
    pub(super) row_from_magnitude: [f32; 2],
    pub(super) max_extinction: f32,
    /// Entries with extinction above and left of each corner between entries: `(rows + 1) * (columns + 1)`.
    sums: Vec<u32>,
}

impl Table {
    pub(super) fn new(transfer: &SheetTransfer, has_magnitudes: bool) -> Self {
        let (found, wanted) = (transfer.columns(), transfer.columns().max(2));
        let rows = if has_magnitudes { transfer.rows() } else { 1 };
        let entries: Vec<[f32; 4]> = (0..rows * wanted)
            .map(|i| transfer.entries()[i / wanted * found + (i % wanted).min(found - 1)])
            .collect();
        let mut sums = vec![0; (rows + 1) * (wanted + 1)];
        for row in 0..rows {
            let mut in_row = 0;
            for column in 0..wanted {
                in_row += u32::from(entries[row * wanted + column][3] != 0.0);
                let above = sums[row * (wanted + 1) + column + 1];
                sums[(row + 1) * (wanted + 1) + column + 1] = above + in_row;
            }
        }
        Self {
            colors: entries.iter().map(|&[r, g, b, _]| [r, g, b, -1.0]).collect(),
            extinctions: entries.iter().map(|entry| entry[3]).collect(),
            columns: wanted,
            rows,
            column_from_value: transfer.column_from_value(),
            row_from_magnitude: transfer.row_from_magnitude(),
            max_extinction: entries.iter().map(|entry| entry[3]).fold(0.0, f32::max),
            sums,
        }
    }

    /// Whether no value between these has extinction, with magnitudes between those.
    #[inline(always)]
    pub(super) fn is_clear(&self, values: [f32; 3], magnitudes: impl FnOnce() -> [f32; 3]) -> bool {
        let Some([left, right]) = places(values, self.column_from_value, self.columns) else { return false };
        let [top, bottom] = if self.rows == 1 {
            [0, 1]
        } else {
            let Some(rows) = places(magnitudes(), self.row_from_magnitude, self.rows) else { return false };
            rows
        };
        let at = |row: usize, column: usize| self.sums[row * (self.columns + 1) + column];
        at(bottom, right) + at(top, left) == at(bottom, left) + at(top, right)
    }
}

/// The first entry that counts for numbers between three, and the one after the last; none if one is not a number.
#[inline(always)]
fn places([a, b, c]: [f32; 3], [scale, offset]: [f32; 2], count: usize) -> Option<[usize; 2]> {
    if (a + b + c).is_nan() {
        return None;
    }
    // Interpolation may leave the range of the three by rounding.
    let (low, high) = (scale * a.min(b).min(c) + offset, scale * a.max(b).max(c) + offset);
    let slack = 1e-3;
    let end = (count - 1) as f32;
    let first = (low.min(high) - slack).max(0.0).min(end) as usize;
    let last = (low.max(high) + slack).max(0.0).min(end).ceil() as usize;
    Some([first, last + 1])
}
