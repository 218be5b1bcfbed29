//! The table against integrals, and what it says of itself.

use glam::DVec3;
use proptest::prelude::*;
use volery_scene::{ControlPoint, TransferFunction};

use super::*;
use crate::Revision;

fn layout(texel: TexelType, value_range: [f64; 2]) -> VolumeLayout {
    VolumeLayout {
        revision: Revision::new(),
        cells: [9; 3],
        spacing: DVec3::ONE,
        brick_cells: 9,
        texel,
        value_scale: 1.0,
        value_offset: 0.0,
        value_range,
    }
}

/// Control points of value, gray and opacity, per unit distance.
fn gray(points: &[(f64, f64, f64)]) -> TransferFunction {
    let point = |&(value, gray, opacity): &(f64, f64, f64)| ControlPoint { value, color: [gray; 3], opacity };
    TransferFunction::new(points.iter().map(point).collect(), 1.0).unwrap()
}

fn floats(points: &[(f64, f64, f64)], value_range: [f64; 2]) -> RayTransfer {
    RayTransfer::new(&gray(points), &layout(TexelType::F32, value_range))
}

/// The entry that executors read for a bin.
fn entry(table: &RayTransfer, bin: f64) -> [f32; 4] {
    table.entries()[bin.round_ties_even().clamp(0.0, table.last_entry() as f64) as usize]
}

fn bin(table: &RayTransfer, texel: f64) -> f64 {
    let [scale, offset] = table.bin_from_texel();
    scale * (texel - table.texel_origin()) + offset
}

#[test]
fn the_integral_of_a_linear_opacity_is_the_closed_form() {
    // ∫ -ln(1 - a) da = (1 - a) ln(1 - a) + a
    let table = floats(&[(0.0, 0.5, 0.0), (1.0, 0.5, 0.5)], [0.0, 1.0]);
    let width = 1.0 / table.bin_from_texel()[0];
    for value in [0.001, 0.2, 0.5, 0.77, 0.9] {
        // At the edge of a bin, where entries are exact.
        let edge = bin(&table, value).round();
        let a = 0.5 * (edge - bin(&table, 0.0)) * width;
        let exact = 2.0 * ((1.0 - a) * (-a).ln_1p() + a) / width;
        let [r, .., s] = entry(&table, edge).map(f64::from);
        assert!((s - exact).abs() < 1e-6 * exact.max(1e-3), "at {value}: {s} against {exact}");
        assert!((r - exact / 2.0).abs() < 1e-6 * exact.max(1e-3));
    }
}

/// Steps and kinks that no edge of a bin meets, against sums of many points.
#[test]
fn bins_are_cut_at_control_points() {
    let points =
        [(0.0, 0.2, 0.0), (0.31234, 0.9, 0.1), (0.31234, 0.3, 0.4), (0.777, 0.1, 0.2), (1.0, 0.5, 0.3)];
    let (table, transfer) = (floats(&points, [0.0, 1.0]), gray(&points));
    let width = 1.0 / table.bin_from_texel()[0];
    for middle in [0.31234_f64, 0.777] {
        let first = bin(&table, middle).floor();
        let from = middle - (bin(&table, middle) - first) * width;
        let num = 100_000;
        let exact: f64 = (0..num)
            .map(|i| {
                let (_, opacity) = transfer.classify(from + width * (f64::from(i) + 0.5) / f64::from(num));
                -(-opacity).ln_1p() / f64::from(num)
            })
            .sum();
        let found = f64::from(entry(&table, first + 1.0)[3]) - f64::from(entry(&table, first)[3]);
        // Sums of some hundreds in f32.
        assert!((found - exact).abs() < 1e-4, "bin of {middle}: {found} against {exact}");
    }
}

#[test]
fn whole_numbers_fall_on_edges_of_bins() {
    let table =
        RayTransfer::new(&gray(&[(70.0, 0.0, 0.0), (110.0, 0.0, 0.3)]), &layout(TexelType::U8, [0.0, 255.0]));
    // Bins begin where something is seen.
    assert_eq!(bin(&table, 70.0), PADDING as f64);
    for value in 70..=255 {
        assert_eq!(bin(&table, f64::from(value)).fract(), 0.0, "{value}");
    }
    assert_eq!(table.texel_origin().fract(), 0.0);
    let sees =
        |low: f64, high: f64| table.visible_bins().meets(bin(&table, low) as f32, bin(&table, high) as f32);
    assert!(!sees(0.0, 69.9) && sees(0.0, 71.0) && sees(255.0, 255.0));
    assert!(!sees(80.0, 75.0) && !table.visible_bins().meets(f32::NAN, f32::NAN));
}

/// What lies outside of the control points costs nothing: one outlier, a fill value, padding.
#[test]
fn values_that_are_not_seen_take_no_bins() {
    let points = [(10.0, 0.2, 0.0), (20.0, 0.9, 0.3), (30.0, 0.3, 0.0)];
    let plain = floats(&points, [10.0, 30.0]);
    for range in [[0.0, 40.0], [-32_768.0, 1000.0], [10.0, 1e20], [-1e30, 1e30]] {
        let table = floats(&points, range);
        assert_eq!(table.entries(), plain.entries(), "{range:?}");
        assert_eq!(table.bin_from_texel(), plain.bin_from_texel());
        // Far values read as the sums at the ends, on both of two neighbouring entries.
        let last = table.last_entry();
        assert_eq!(table.entries()[last], table.entries()[last + 1]);
        assert_eq!(table.entries()[0], [0.0; 4]);
        assert_eq!(table.entries()[1], [0.0; 4]);
    }
}

#[test]
fn the_table_is_not_read_where_it_is_too_coarse() {
    let is_exact = |table: &RayTransfer, value: f64| {
        let bins = table.exact_bins(&layout(TexelType::F32, [0.0, 1.0]), 0);
        bins.meets(bin(table, value) as f32, bin(table, value) as f32)
    };
    let smooth = floats(&[(0.0, 0.2, 0.0), (1.0, 0.9, 0.6)], [0.0, 1.0]);
    assert!((0..=100).all(|i| !is_exact(&smooth, f64::from(i) / 100.0)), "nothing is hard of a ramp");
    let step = floats(&[(0.0, 0.5, 0.0), (0.4, 0.5, 0.1), (0.4, 0.5, 0.3), (1.0, 0.5, 0.4)], [0.0, 1.0]);
    assert!(is_exact(&step, 0.4) && !is_exact(&step, 0.39) && !is_exact(&step, 0.41));
    let color = [(0.0, 0.0, 0.3), (0.4, 0.0, 0.3), (0.4, 1.0, 0.3), (1.0, 1.0, 0.3)];
    assert!(is_exact(&floats(&color, [0.0, 1.0]), 0.4), "a step of colour alone");
    let dense = floats(&[(0.0, 0.5, 0.0), (1.0, 0.5, 1.0)], [0.0, 1.0]);
    assert!(is_exact(&dense, 1.0) && is_exact(&dense, 0.9) && !is_exact(&dense, 0.1));
    let ends = floats(&[(0.2, 0.5, 0.3), (0.8, 0.5, 0.3)], [0.2, 0.8]);
    assert!(!is_exact(&ends, 0.2) && !is_exact(&ends, 0.8), "matter that goes on is no step");
    let step_at_end = floats(&[(0.2, 0.5, 0.0), (0.2, 0.5, 0.3), (0.8, 0.5, 0.3)], [0.0, 0.8]);
    assert!(is_exact(&step_at_end, 0.2));
    // What goes on far beyond the control points is left to the bands.
    let far = floats(&[(0.0, 0.5, 0.1), (1.0, 0.5, 0.2)], [-1e20, 1e20]);
    assert!(is_exact(&far, 1e19) && is_exact(&far, -1e19) && !is_exact(&far, 0.5));
    assert!(far.visible_bins().meets(bin(&far, 1e19) as f32, bin(&far, 1e19) as f32));
    // Coarse levels have longer chords.
    let bins = |level| smooth.exact_bins(&layout(TexelType::F32, [0.0, 1.0]), level);
    assert!(bins(0).is_empty() && !bins(3).is_empty());
}

#[test]
fn bands_are_the_transfer_function() {
    let points = [(1.0, 0.2, 0.0), (2.0, 0.9, 0.5), (2.0, 0.1, 1.0), (5.0, 0.6, 1.0), (7.0, 0.4, 0.25)];
    let (table, transfer) = (floats(&points, [0.0, 9.0]), gray(&points));
    assert_eq!(table.bands().len(), 5);
    for i in 0..=90 {
        let value = f64::from(i) / 10.0;
        let texel = (value - table.texel_origin()) as f32;
        let band = &table.bands()[table.bands()[1..].partition_point(|band| band.base <= texel)];
        let u = texel - band.base;
        assert!(u >= band.low && u <= band.high * (1.0 + 1e-6), "{value} in {band:?}");
        let ([gray, ..], opacity) = transfer.classify(value);
        assert!((f64::from(band.opacity + band.opacity_slope * u) - opacity).abs() < 1e-6, "{value}");
        assert!((f64::from(band.clearness - band.opacity_slope * u) - (1.0 - opacity)).abs() < 1e-6);
        assert!((f64::from(band.color[0] + band.color_slope[0] * u) - gray).abs() < 1e-6, "{value}");
    }
}

/// A field that is constant at a step has the colour above it: texels are rounded, and so are the ends of bands.
#[test]
fn a_texel_at_a_control_point_is_in_the_band_above_it() {
    for third in 1..300 {
        let value = f64::from(third) / 3.0;
        let points = [(0.1, 0.5, 0.1), (value, 0.5, 0.2), (value, 0.5, 0.9), (1000.7, 0.5, 0.1)];
        let table = floats(&points, [0.0, 2000.0]);
        let texel = value as f32 - table.texel_origin() as f32;
        let band = table.bands()[1..].partition_point(|band| band.base <= texel);
        assert_eq!(band, 2, "{value}: texel {texel} in {:?}", table.bands()[band]);
        assert_eq!(texel - table.bands()[band].base, 0.0);
    }
}

/// What the table reads for a value is no farther from the truth than it says: beside kinks, at steps within a bin and
/// between two.
#[test]
fn rounding_to_bins_is_bounded() {
    let weak_step = [(0.0, 0.5, 0.001), (1.0, 0.5, 0.001), (1.0, 0.5, 0.002), (3.0, 0.5, 0.003)];
    let whole = RayTransfer::new(&gray(&weak_step), &layout(TexelType::U8, [0.0, 3.0]));
    let odd_step = [(0.0, 0.5, 0.001), (0.31234, 0.5, 0.001), (0.31234, 0.5, 0.003), (1.0, 0.5, 0.002)];
    let ramp = [(0.0, 0.2, 0.0), (0.777, 0.9, 0.6), (1.0, 0.1, 0.5)];
    for (what, table, points, most) in [
        ("a step between bins", whole, gray(&weak_step), 3.0),
        ("a step in a bin", floats(&odd_step, [0.0, 1.0]), gray(&odd_step), 1.0),
        ("a ramp", floats(&ramp, [0.0, 1.0]), gray(&ramp), 1.0),
    ] {
        let mut worst = 0.0_f64;
        for i in 0..40_000 {
            let value = most * (f64::from(i) + 0.5) / 40_000.0;
            let edge = bin(&table, value).round_ties_even();
            let found = f64::from(entry(&table, edge + 1.0)[3]) - f64::from(entry(&table, edge)[3]);
            worst = worst.max((found - points.extinction(value)).abs());
        }
        // The sums are rounded to f32.
        let sums = f64::from(table.entries()[table.last_entry()][3] * f32::EPSILON);
        println!("{what}: {worst:.2e}, said {:.2e}", table.rounding());
        assert!(worst <= table.rounding() + sums, "{what}: {worst} for {}", table.rounding());
        assert!(worst >= 0.3 * table.rounding(), "{what}: {worst} is far below {}", table.rounding());
    }
}

#[test]
fn texels_may_fall_with_values() {
    let falling = VolumeLayout { value_scale: -2.0, value_offset: 3.0, ..layout(TexelType::F32, [0.0, 3.0]) };
    let table = RayTransfer::new(&gray(&[(0.5, 0.2, 0.0), (2.5, 0.9, 0.4)]), &falling);
    // Value 3 is texel 0, and seen.
    assert!(table.visible_bins().meets(bin(&table, 0.0) as f32, bin(&table, 0.0) as f32));
    assert!(!table.visible_bins().meets(bin(&table, 1.3) as f32, bin(&table, 1.5) as f32));
    assert!(table.bands().windows(2).all(|pair| pair[0].base <= pair[1].base));
}

#[test]
fn constant_and_opaque_data_stay_finite() {
    for (points, range) in [
        (vec![(0.0, 1.0, 1.0)], [5.0, 5.0]),
        (vec![(0.0, 1.0, 1e-30)], [0.0, 1.0]),
        (vec![(0.0, 1.0, 0.0)], [0.0, 1.0]),
        (vec![(7.0, 1.0, 0.0), (9.0, 1.0, 1.0)], [-3.0, -2.0]),
    ] {
        let table = floats(&points, range);
        assert!(table.entries().iter().flatten().all(|x| x.is_finite()), "{points:?}");
        assert!(table.slope().is_finite() && table.bin_from_texel().iter().all(|x| x.is_finite()));
    }
}

proptest! {
    #[test]
    fn what_is_called_transparent_is(
        opacities in proptest::collection::vec(prop_oneof![Just(0.0), 0.0..1.0f64], 2..6),
        low in 0.0..1.0f64, length in 0.0..1.0f64,
    ) {
        let last = (opacities.len() - 1) as f64;
        let points: Vec<_> = opacities.iter().enumerate().map(|(i, &a)| (i as f64 / last, 0.0, a)).collect();
        let (table, transfer) = (floats(&points, [0.0, 1.0]), gray(&points));
        let high = (low + length).min(1.0);
        let [first, last] = table.bins_of(low as f32, high as f32);
        if !table.visible_bins().meets(first - 0.5, last + 0.5) {
            prop_assert!(transfer.is_transparent(low, high));
        }
    }
}
