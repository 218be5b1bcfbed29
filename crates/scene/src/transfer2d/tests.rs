use proptest::prelude::*;

use super::*;
use crate::transfer::ControlPoint;

fn gray(gray: f64, opacity: f64) -> Entry {
    Entry { color: [gray; 3], opacity }
}

/// Two values, three magnitudes.
fn small() -> Palette {
    let entries =
        vec![gray(0.0, 0.0), gray(1.0, 0.2), gray(0.5, 0.4), gray(0.5, 0.8), gray(0.0, 1.0), gray(1.0, 0.0)];
    Palette { values: [10.0, 20.0], magnitudes: [0.0, 4.0], columns: 2, entries, unit_distance: 2.0 }
}

fn plain(palette: Palette) -> TransferFunction2d {
    TransferFunction2d::new(palette, Sliders::default()).unwrap()
}

#[test]
fn bilinear_between_entries_and_constant_outside() {
    let function = plain(small());
    assert_eq!(function.classify(10.0, 0.0), ([0.0; 3], 0.0));
    assert_eq!(function.classify(20.0, 2.0), ([0.5; 3], 0.8));
    let (color, opacity) = function.classify(15.0, 1.0);
    assert_eq!(color, [0.5; 3]);
    assert!((opacity - 0.35).abs() < 1e-15, "{opacity}");
    assert_eq!(function.classify(12.5, 3.0), ([0.375; 3], (0.5 + 0.75) / 2.0));
    assert_eq!(function.classify(-1e300, 1e300), ([0.0; 3], 1.0));
    assert_eq!(function.classify(f64::INFINITY, f64::INFINITY), ([1.0; 3], 0.0));
    assert_eq!(function.classify(f64::NAN, 1.0), ([0.0; 3], 0.0));
    assert_eq!(function.classify(20.0, f64::NAN), function.classify(20.0, 0.0));
    assert_eq!(function.extinction_of_opacity(1.0), f64::INFINITY);
    assert!((function.extinction_of_opacity(0.5) - 0.5 * std::f64::consts::LN_2).abs() < 1e-16);
}

#[test]
fn a_single_row_or_column_is_constant_across() {
    let row = plain(Palette { entries: small().entries[..2].to_vec(), ..small() });
    let column = plain(Palette { columns: 1, entries: small().entries[..3].to_vec(), ..small() });
    for i in 0..=10 {
        let share = f64::from(i) / 10.0;
        assert_eq!(row.opacity_at(15.0, 4.0 * share), 0.1);
        assert_eq!(column.opacity_at(10.0 + 10.0 * share, 1.0), 0.1);
    }
}

#[test]
fn sliders_scale_what_the_palette_says() {
    let mut function = plain(small());
    let whole = function.opacity_at(15.0, 1.0);
    function.set_sliders(Sliders { global_opacity: 0.5, ..Sliders::default() }).unwrap();
    assert_eq!(function.opacity_at(15.0, 1.0), 0.5 * whole);
    function.set_sliders(Sliders { gradient_weight: 0.4, ..Sliders::default() }).unwrap();
    assert!((function.opacity_at(15.0, 1.0) - whole * (0.6 + 0.4 * 0.25)).abs() < 1e-16);
    assert_eq!(function.opacity_at(10.0, 9.0), 1.0, "beyond the largest magnitude nothing changes");
    let selection = Some(Selection { mean: 1.0, range: 0.8 });
    function.set_sliders(Sliders { selection, ..Sliders::default() }).unwrap();
    for (magnitude, share) in [(1.0, 1.0), (0.71, 1.0), (1.4, 0.5), (0.6, 0.5), (1.51, 0.0), (0.0, 0.0)] {
        let expected = share * plain(small()).opacity_at(15.0, magnitude);
        assert!((function.opacity_at(15.0, magnitude) - expected).abs() < 1e-14, "at {magnitude}");
    }
    assert_eq!(function.classify(15.0, 3.0).0, plain(small()).classify(15.0, 3.0).0, "colours stay");
    assert_eq!(function.palette(), &small());
}

#[test]
fn a_selection_counts_as_much_as_its_range() {
    let selection = Selection { mean: 3.0, range: 1.6 };
    let steps = 100_000;
    let sum: f64 = (0..steps).map(|i| selection.share(6.0 * (f64::from(i) + 0.5) / f64::from(steps))).sum();
    assert!((sum * 6.0 / f64::from(steps) - 1.6).abs() < 1e-9);
}

#[test]
fn edits_change_one_entry_of_one_clone() {
    let before = plain(small());
    let mut after = before.clone();
    after.set_opacity(1, 2, 0.25).unwrap();
    assert_eq!((before.opacity_at(20.0, 4.0), after.opacity_at(20.0, 4.0)), (0.0, 0.25));
    assert_eq!(before.opacity_at(10.0, 4.0), after.opacity_at(10.0, 4.0));
    for (column, row, opacity) in [(2, 0, 0.1), (0, 3, 0.1), (usize::MAX, usize::MAX, 0.1), (0, 0, 1.5)] {
        assert_eq!(after.set_opacity(column, row, opacity).unwrap_err().defects.len(), 1);
    }
    let mut moved = before.clone();
    moved.set_sliders(Sliders { global_opacity: 0.1, ..Sliders::default() }).unwrap();
    assert!(Arc::ptr_eq(&before.palette, &moved.palette), "sliders share the palette");
    assert!(moved.set_sliders(Sliders { gradient_weight: f64::NAN, ..Sliders::default() }).is_err());
    assert_eq!(moved.sliders().global_opacity, 0.1);
}

#[test]
fn every_defect_is_listed() {
    let mut palette = small();
    palette.values = [1.0, 1.0];
    palette.magnitudes = [-1.0, 1.0];
    palette.entries[1] = gray(2.0, -0.5);
    palette.unit_distance = f64::INFINITY;
    let selection = Some(Selection { mean: 1.0, range: 0.0 });
    let sliders = Sliders { global_opacity: 1.1, gradient_weight: -0.1, selection };
    let error = TransferFunction2d::new(palette, sliders).unwrap_err();
    assert_eq!(error.defects.len(), 8, "{error}");
    assert!(
        error.to_string().starts_with("2D transfer function: values are [1.0, 1.0], expected two rising")
    );
    for (columns, entries) in [(0, 0), (0, 6), (4, 6), (7, 6), (4097, 4097), (513, 512 * 513), (1, 4097)] {
        let palette = Palette { columns, entries: vec![gray(0.0, 0.0); entries], ..small() };
        let error = TransferFunction2d::new(palette, Sliders::default()).unwrap_err();
        assert_eq!(error.defects, [Defect::Size { columns, entries }]);
    }
    for values in [[f64::NAN, 1.0], [2.0, 1.0], [0.0, f64::INFINITY], [-1e308, 1e308]] {
        let palette = Palette { values, ..small() };
        assert_eq!(TransferFunction2d::new(palette, Sliders::default()).unwrap_err().defects.len(), 1);
    }
}

#[test]
fn a_function_of_the_value_stays_what_it_is() {
    let points = [(0.0, 0.0, 0.0), (1.0, 1.0, 0.5), (4.0, 0.2, 0.1)];
    let points =
        points.map(|(value, gray, opacity)| ControlPoint { value, color: [gray; 3], opacity }).to_vec();
    let transfer = TransferFunction::new(points, 3.0).unwrap();
    let palette = Palette::from_transfer(&transfer, [0.0, 4.0], [0.0, 1.0], [9, 3]).unwrap();
    assert_eq!((palette.columns, palette.rows(), palette.unit_distance), (9, 3, 3.0));
    let function = plain(palette);
    for i in -10..=50 {
        let value = f64::from(i) / 10.0;
        let (color, opacity) = transfer.classify(value);
        for magnitude in [0.0, 0.3, 0.9, 7.0] {
            let (found, found_opacity) = function.classify(value, magnitude);
            assert!(
                (found_opacity - opacity).abs() < 1e-15 && (found[0] - color[0]).abs() < 1e-15,
                "at {value}"
            );
        }
    }
    for size in [[0, 1], [1, 0], [1 << 40, 1 << 40], [usize::MAX, 2], [1024, 1024]] {
        let error = Palette::from_transfer(&transfer, [0.0, 1.0], [0.0, 1.0], size).unwrap_err();
        assert!(matches!(error.defects[..], [Defect::Size { .. }]), "{error}");
    }
    assert!(Palette::from_transfer(&transfer, [1.0, 1.0], [0.0, 1.0], [2, 2]).is_err());
}

proptest! {
    #[test]
    fn opacities_stay_between_the_least_and_the_largest(
        opacities in proptest::collection::vec(0.0..=1.0f64, 12),
        value in -2.0..3.0f64, magnitude in -1.0..4.0f64,
        global_opacity in 0.0..=1.0f64, gradient_weight in 0.0..=1.0f64, mean in 0.0..3.0f64, range in 0.01..3.0f64,
    ) {
        let entries = opacities.iter().map(|&opacity| gray(opacity, opacity)).collect();
        let palette = Palette { values: [-1.0, 2.0], magnitudes: [0.5, 3.0], columns: 4, entries, unit_distance: 1.0 };
        let whole = plain(palette.clone()).opacity_at(value, magnitude);
        let [least, most] = opacities.iter().fold([1.0_f64, 0.0], |[low, high], &x| [low.min(x), high.max(x)]);
        prop_assert!((least - 1e-15..=most + 1e-15).contains(&whole));
        let sliders = Sliders { global_opacity, gradient_weight, selection: Some(Selection { mean, range }) };
        let scaled = TransferFunction2d::new(palette, sliders).unwrap().opacity_at(value, magnitude);
        prop_assert!((0.0..=global_opacity * whole + 1e-15).contains(&scaled));
    }
}
