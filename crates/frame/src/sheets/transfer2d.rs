//! Tables of transfer functions over value and gradient magnitude.
//!
//! # Method
//! The function is bilinear in opacity, a table is in extinction, which adds up along a ray and so is what executors
//! need. They agree at entries of the table, and colours, which sliders leave alone, agree everywhere. So the table
//! starts with the entries of the palette, with more rows where a selection of magnitudes needs them, and steps are
//! halved, first along the axis with the larger error, until the opacity per unit distance half-way between
//! neighbours is within [`AIM`] of the function. Then it is within twice that everywhere, but for rounding, unless the
//! table has grown to [`MAX_ENTRIES`] first. Even then an opacity is never beyond those of the function at the four
//! entries around; what is next to opaque matter may come out opaque.

use volery_scene::TransferFunction2d;
use volery_scene::transfer2d::Palette;

use super::{MAX_EXTINCTION, SheetTransfer};

/// Opacity per unit distance by which a table may be off half-way between two entries.
const AIM: f64 = 1.0 / 1024.0;

/// Steps of a table per range of selected magnitudes, at the least; the edges of a selection are a quarter wide.
const STEPS_OF_SELECTION: f64 = 16.0;

/// The most entries that a table grows to: 4 MiB.
const MAX_ENTRIES: usize = Palette::MAX_ENTRIES;

/// The most columns or rows that a table grows to; places in it have ten more bits in 32.
const MAX_SIDE: usize = 1 << 14;

impl SheetTransfer {
    /// A table over value and gradient magnitude, sliders applied. Off from the function by at most 1/512 in opacity
    /// per unit distance, unless opacities rise so steeply over the palette that 262,144 entries do not follow them.
    pub fn new_2d(function: &TransferFunction2d) -> Self {
        let palette = function.palette();
        let mut size = Size { columns: palette.columns, rows: palette.rows() };
        if function.sliders().depend_on_magnitude() {
            size.rows = size.rows.max(2);
        }
        let [low, high] = palette.magnitudes;
        let selected = function.sliders().selection.map_or(f64::INFINITY, |selection| selection.range);
        while (high - low) / (size.rows.max(2) - 1) as f64 * STEPS_OF_SELECTION > selected {
            let Some(finer) = size.with_finer_rows() else { break };
            size = finer;
        }
        let mut samples = Samples::new(function, size);
        loop {
            let [columns, rows] = samples.errors();
            let by_columns = size.with_finer_columns().filter(|_| columns > AIM);
            let by_rows = size.with_finer_rows().filter(|_| rows > AIM);
            let finer = if columns >= rows { by_columns.or(by_rows) } else { by_rows.or(by_columns) };
            let Some(finer) = finer else { break };
            size = finer;
            samples = Samples::new(function, size);
        }
        Self::of_entries(samples.entries(), size.columns, palette.values, palette.magnitudes)
    }
}

#[derive(Clone, Copy, Debug)]
struct Size {
    columns: usize,
    rows: usize,
}

impl Size {
    fn with_finer_columns(self) -> Option<Self> {
        Self { columns: 2 * self.columns - 1, ..self }.checked(self)
    }

    fn with_finer_rows(self) -> Option<Self> {
        Self { rows: 2 * self.rows - 1, ..self }.checked(self)
    }

    /// A single column or row has nothing between.
    fn checked(self, from: Self) -> Option<Self> {
        let Self { columns, rows } = self;
        let has_grown = columns > from.columns || rows > from.rows;
        (has_grown && columns.max(rows) <= MAX_SIDE && columns * rows <= MAX_ENTRIES).then_some(self)
    }
}

/// A function at the entries of a table.
struct Samples<'a> {
    function: &'a TransferFunction2d,
    size: Size,
    /// Straight colour, and opacity per unit distance.
    classified: Vec<([f64; 3], f64)>,
}

impl<'a> Samples<'a> {
    fn new(function: &'a TransferFunction2d, size: Size) -> Self {
        let mut samples = Self { function, size, classified: Vec::new() };
        let all =
            (0..size.rows).flat_map(|row| (0..size.columns).map(move |column| (column as f64, row as f64)));
        samples.classified = all.map(|(column, row)| samples.at(column, row)).collect();
        samples
    }

    /// The function at a place in columns and rows.
    fn at(&self, column: f64, row: f64) -> ([f64; 3], f64) {
        let along = |[low, high]: [f64; 2], at: f64, count: usize| {
            low + (high - low) * (at / (count.max(2) - 1) as f64)
        };
        let palette = self.function.palette();
        let value = along(palette.values, column, self.size.columns);
        self.function.classify(value, along(palette.magnitudes, row, self.size.rows))
    }

    /// Extinction per world length of an opacity, as a table has it.
    fn extinction(&self, opacity: f64) -> f64 {
        self.function.extinction_of_opacity(opacity).min(MAX_EXTINCTION)
    }

    /// The largest error of the opacity per unit distance half-way between neighbours, along columns and along rows.
    fn errors(&self) -> [f64; 2] {
        let Size { columns, rows } = self.size;
        let unit_distance = self.function.palette().unit_distance;
        let error = |here: usize, there: usize, column: f64, row: f64| {
            let [here, there] = [here, there].map(|at| self.classified[at].1);
            // Equal neighbours with a selection between them are ruled out by the steps it is given.
            if here == there && (here == 0.0 || !self.function.sliders().depend_on_magnitude()) {
                return 0.0;
            }
            let extinction = 0.5 * (self.extinction(here) + self.extinction(there));
            (-(-extinction * unit_distance).exp_m1() - self.at(column, row).1).abs()
        };
        let mut errors = [0.0_f64; 2];
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            let (here, x, y) = (row * columns + column, column as f64, row as f64);
            if column + 1 < columns {
                errors[0] = errors[0].max(error(here, here + 1, x + 0.5, y));
            }
            if row + 1 < rows {
                errors[1] = errors[1].max(error(here, here + columns, x, y + 0.5));
            }
        }
        errors
    }

    fn entries(&self) -> Vec<[f32; 4]> {
        let entry =
            |&([r, g, b], opacity): &([f64; 3], f64)| [r, g, b, self.extinction(opacity)].map(|x| x as f32);
        self.classified.iter().map(entry).collect()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use volery_scene::transfer2d::{Entry, Selection, Sliders};
    use volery_scene::{ControlPoint, TransferFunction};

    use super::*;

    /// The largest differences of the table's colour and opacity per unit distance from the function's at places
    /// between entries and outside, and the size of the table.
    fn compared(function: &TransferFunction2d) -> ([f64; 2], [usize; 2]) {
        let table = SheetTransfer::new_2d(function);
        let Palette { values, magnitudes, unit_distance, .. } = *function.palette();
        let mut worst = [0.0_f64; 2];
        let count = 400;
        for (i, j) in (0..=count).flat_map(|i| (0..=count).map(move |j| (i, j))) {
            let place = |[low, high]: [f64; 2], i: i32| {
                f64::from((low + (high - low) * (1.2 * f64::from(i) / f64::from(count) - 0.1)) as f32)
            };
            let (value, magnitude) = (place(values, i), place(magnitudes, j));
            let (color, opacity) = function.classify(value, magnitude);
            let [r, g, b, extinction] = table.classify(value as f32, magnitude as f32).map(f64::from);
            for (found, expected) in [r, g, b].into_iter().zip(color) {
                worst[0] = worst[0].max((found - expected).abs());
            }
            worst[1] = worst[1].max((-(-extinction * unit_distance).exp_m1() - opacity).abs());
        }
        (worst, [table.columns(), table.rows()])
    }

    fn noise(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / f64::from(1 << 24)
        }
    }

    fn random(seed: u64, [columns, rows]: [usize; 2], most: f64, sliders: Sliders) -> TransferFunction2d {
        let mut next = noise(seed);
        let entries = (0..columns * rows)
            .map(|_| Entry { color: [next(), next(), next()], opacity: most * next() })
            .collect();
        let palette =
            Palette { values: [-3.0, 5.0], magnitudes: [0.5, 8.5], columns, entries, unit_distance: 0.25 };
        TransferFunction2d::new(palette, sliders).unwrap()
    }

    fn check(what: &str, function: &TransferFunction2d) {
        let ([color, opacity], size) = compared(function);
        println!(
            "{what}: {size:?} entries, colour off by {color:.1e} of 1e-4, opacity by {opacity:.1e} of 2.0e-3"
        );
        // Places in the table are rounded to 32 bits.
        assert!(color < 1e-4 && opacity < 2.0 * AIM + 1e-4, "{what}: {color:e}, {opacity:e}");
        assert!(size[0] * size[1] <= MAX_ENTRIES);
    }

    #[test]
    fn tables_follow_the_function() {
        let free = Sliders::default();
        let sliders = |mean, range| Sliders {
            global_opacity: 0.7,
            gradient_weight: 0.4,
            selection: Some(Selection { mean, range }),
        };
        check("as it is", &random(1, [9, 7], 0.9, free));
        check("pale", &random(2, [9, 7], 0.05, free));
        check("weighted", &random(3, [9, 7], 0.9, Sliders { gradient_weight: 1.0, ..free }));
        check("selected", &random(4, [9, 7], 0.9, sliders(3.0, 2.0)));
        check("narrowly selected", &random(5, [3, 2], 0.9, sliders(7.0, 0.05)));
        check("one row, selected", &random(6, [33, 1], 0.9, sliders(5.0, 1.0)));
        check("one column", &random(7, [1, 9], 0.9, sliders(5.0, 3.0)));
        check("one entry", &random(8, [1, 1], 0.9, free));
        check("many columns", &random(9, [512, 2], 0.3, free));
    }

    #[test]
    fn pale_palettes_are_taken_as_they_are() {
        let function = random(2, [64, 32], 0.05, Sliders::default());
        let table = SheetTransfer::new_2d(&function);
        assert_eq!([table.columns(), table.rows()], [64, 32]);
        let largest = random(2, [1024, 256], 0.9, Sliders::default());
        let table = SheetTransfer::new_2d(&largest);
        assert_eq!([table.columns(), table.rows()], [1024, 256]);
    }

    #[test]
    fn constant_over_magnitude_is_the_table_over_values() {
        let points = [(0.0, 0.1, 0.0), (3.0, 0.9, 0.6), (8.0, 0.2, 0.3)];
        let point = |(value, gray, opacity)| ControlPoint { value, color: [gray, 0.5, 1.0 - gray], opacity };
        let transfer = TransferFunction::new(points.map(point).to_vec(), 2.0).unwrap();
        let palette = Palette::from_transfer(&transfer, [0.0, 8.0], [0.0, 1.0], [4096, 1]).unwrap();
        let function = TransferFunction2d::new(palette, Sliders::default()).unwrap();
        assert_eq!(SheetTransfer::new_2d(&function).entries().len(), 4096);
        let [found, expected] = [SheetTransfer::new_2d(&function), SheetTransfer::new(&transfer, [0.0, 8.0])];
        for (found, expected) in found.entries().iter().zip(expected.entries()) {
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() <= 2e-7, "{found} is not {expected}");
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(6))]

        /// Whatever the palette, a table's opacity lies between those at the entries around.
        #[test]
        fn steep_palettes_stay_between_entries(seed in any::<u64>()) {
            let mut function = random(seed, [6, 5], 1.0, Sliders::default());
            for entry in [3, 8, 9, 20] {
                function.set_opacity(entry % 6, entry / 6, 1.0).unwrap();
                function.set_opacity(entry % 6, (entry / 6 + 1) % 5, 0.0).unwrap();
            }
            let table = SheetTransfer::new_2d(&function);
            let size = [table.columns(), table.rows()];
            prop_assert!(size[0] * size[1] > MAX_ENTRIES / 4, "{:?}", size);
            let mut next = noise(seed);
            for _ in 0..1000 {
                let place = [next() * (size[0] - 1) as f64, next() * (size[1] - 1) as f64];
                let at = |[x, y]: [f64; 2]| {
                    [-3.0 + 8.0 * x / (size[0] - 1) as f64, 0.5 + 8.0 * y / (size[1] - 1) as f64]
                };
                // Rounding to 32 bits may find the place in the next cell.
                let around = (0..16).map(|off| {
                    let off = [off % 4, off / 4].map(|off| f64::from(off) - 1.0);
                    let [value, magnitude] = at([0, 1].map(|i| place[i].floor() + off[i]));
                    function.opacity_at(value, magnitude)
                });
                let [value, magnitude] = at(place);
                let extinction = table.classify(value as f32, magnitude as f32)[3];
                let found = -(-f64::from(extinction) * 0.25).exp_m1();
                let exact = function.opacity_at(value, magnitude);
                let [low, high] = around.fold([exact; 2], |[low, high], x| [low.min(x), high.max(x)]);
                prop_assert!((low - 1e-5..=high + 1e-5).contains(&found), "{}: not in {} to {}", found, low, high);
            }
        }
    }
}
