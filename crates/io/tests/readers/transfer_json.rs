//! Transfer functions in our own JSON, out and in again.

use proptest::prelude::*;
use volery_io::transfer::{TransferOptions, TransferProblem};
use volery_io::{read_transfer, read_transfer_2d, write_transfer, write_transfer_2d};
use volery_scene::transfer2d::{Entry, Palette, Selection, Sliders};
use volery_scene::{ControlPoint, TransferFunction, TransferFunction2d};

use crate::Folder;

const ANY: TransferOptions = TransferOptions { map: None, range: None, unit_distance: 1.0 };

const TEXT: &str = r#"{"values": [0, 255], "magnitudes": [0, 40], "columns": 2, "rows": 3,
    "colors": [[0, 0, 1], [1, 0, 0], [0, 1, 1], [1, 1, 0], [0.5, 0.25, 1e-3], [1, 1, 1]],
    "opacities": [0, 0.1, 0, 0.8, 1, 0.5], "unit_distance": 2.5, "global_opacity": 0.5, "gradient_weight": 0.25,
    "selection": {"mean": 30, "range": 10}}"#;

fn read(folder: &Folder, text: &str) -> Result<TransferFunction2d, String> {
    let path = folder.put("palette.json", text);
    read_transfer_2d(&path).map_err(|error| {
        let line = error.to_string();
        assert!(!line.contains('\n') && line.len() < 1000, "{line}");
        line.strip_prefix(&format!("{}: ", path.display())).expect("the file is named").to_owned()
    })
}

#[test]
fn every_field_arrives() {
    let folder = Folder::new();
    let function = read(&folder, TEXT).unwrap();
    let palette = function.palette();
    assert_eq!((palette.values, palette.magnitudes, palette.unit_distance), ([0.0, 255.0], [0.0, 40.0], 2.5));
    assert_eq!((palette.columns, palette.rows()), (2, 3));
    assert_eq!(palette.entries[4], Entry { color: [0.5, 0.25, 1e-3], opacity: 1.0 });
    let selection = Some(Selection { mean: 30.0, range: 10.0 });
    assert_eq!(function.sliders(), Sliders { global_opacity: 0.5, gradient_weight: 0.25, selection });
    let end = TEXT.find(", \"global_opacity\"").unwrap();
    assert_eq!(read(&folder, &format!("{}}}", &TEXT[..end])).unwrap().sliders(), Sliders::default());
}

#[test]
fn what_a_palette_cannot_be() {
    let folder = Folder::new();
    for (from, to, expected) in [
        ("\"rows\"", "\"row\"", "unknown field `row`, expected one of `values`, `magnitudes`"),
        ("\"mean\"", "\"men\"", "unknown field `men`, expected `mean` or `range`"),
        (", \"unit_distance\": 2.5", "", "missing field `unit_distance`"),
        ("\"columns\": 2", "\"columns\": -2", "invalid value: integer `-2`"),
        ("\"columns\": 2", "\"columns\": 3", "colors has 6 entries, expected 3 columns x 3 rows"),
        (
            "\"columns\": 2",
            "\"columns\": 9223372036854775808",
            "colors has 6 entries, expected 9223372036854775808",
        ),
        ("[0, 0.1, 0, ", "[0, 0.1, ", "opacities has 5 entries, expected 2 columns x 3 rows"),
        ("[0, 0.1, 0, ", "[0, 1.1, 0, ", "2D transfer function: column 1, row 0: opacity 1.1, expected"),
        ("[0, 0, 1]", "[0, 0, 2]", "2D transfer function: column 0, row 0: colour [0.0, 0.0, 2.0], expected"),
        ("[0, 0, 1]", "[0, 0]", "invalid length 2"),
        (
            "[0, 255]",
            "[255, 0]",
            "2D transfer function: values are [255.0, 0.0], expected two rising numbers",
        ),
        ("[0, 40]", "[-1, 40]", "2D transfer function: magnitudes are [-1.0, 40.0], expected two rising"),
        (
            "_opacity\": 0.5",
            "_opacity\": 5",
            "2D transfer function: global_opacity is 5, expected a number in",
        ),
        ("\"gradient_weight\": 0.25", "\"gradient_weight\": null", "invalid type: null"),
        (
            "\"range\": 10",
            "\"range\": 0",
            "2D transfer function: selection has mean 30 and range 0, expected",
        ),
        ("255]", "1e999]", "number out of range"),
    ] {
        let damaged = TEXT.replacen(from, to, 1);
        assert_ne!(damaged, TEXT, "{from}");
        let line = read(&folder, &damaged).unwrap_err();
        assert!(line.starts_with(expected), "{line}, expected {expected}");
    }
    let many = vec!["0.5"; 513 * 512].join(",");
    let text = format!(
        r#"{{"values": [0, 1], "magnitudes": [0, 1], "columns": 513, "rows": 512, "colors": [{}],
        "opacities": [{many}], "unit_distance": 1}}"#,
        vec!["[0,0,0]"; 513 * 512].join(",")
    );
    let line = read(&folder, &text).unwrap_err();
    assert!(
        line.starts_with("2D transfer function: 262656 entries in rows of 513, expected whole rows"),
        "{line}"
    );
}

#[test]
fn a_palette_is_not_taken_for_a_function_of_the_value() {
    let folder = Folder::new();
    let error = read_transfer(&folder.put("palette.json", TEXT), &ANY).unwrap_err();
    assert!(matches!(error.problem, TransferProblem::HasMagnitudes), "{error}");
    let points = r#"{"points": [{"value": 1, "color": [0, 0.5, 1], "opacity": 0}], "unit_distance": 2.5}"#;
    assert!(
        read(&folder, points).unwrap_err().starts_with("unknown field `points`, expected one of `values`")
    );
}

#[test]
fn a_file_that_is_there_stays_until_the_new_one_is_whole() {
    let folder = Folder::new();
    let function = read(&folder, TEXT).unwrap();
    let path = folder.path("out.json");
    write_transfer_2d(&path, &function).unwrap();
    let mut pale = function.clone();
    pale.set_sliders(Sliders::default()).unwrap();
    write_transfer_2d(&path, &pale).unwrap();
    assert_eq!(read_transfer_2d(&path).unwrap(), pale);
    assert!(!std::fs::read_to_string(&path).unwrap().contains("selection"));
    let error = write_transfer_2d(&folder.path("no/such/folder.json"), &function).unwrap_err();
    assert!(error.to_string().contains("folder.json: cannot be written"), "{error}");
}

/// Any finite number, by its bits.
fn number() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(f64::from_bits).prop_filter("finite", |x| x.is_finite())
}

/// Any number in [0, 1], most of them with many digits, some subnormal.
fn share() -> impl Strategy<Value = f64> {
    (0..=1.0f64.to_bits()).prop_map(f64::from_bits)
}

proptest! {
    #[test]
    fn points_come_back_bit_for_bit(
        points in proptest::collection::vec((number(), [share(), share(), share()], share()), 1..20),
        unit_distance in number().prop_map(f64::abs).prop_filter("above 0", |&x| x > 0.0),
    ) {
        let folder = Folder::new();
        let mut points: Vec<ControlPoint> =
            points.into_iter().map(|(value, color, opacity)| ControlPoint { value, color, opacity }).collect();
        points.sort_by(|a, b| a.value.total_cmp(&b.value));
        let transfer = TransferFunction::new(points, unit_distance).unwrap();
        let path = folder.path("points.json");
        write_transfer(&path, &transfer).unwrap();
        let found = read_transfer(&path, &ANY).unwrap().transfer;
        prop_assert_eq!(format!("{:?}", &found), format!("{:?}", &transfer), "the same shortest digits");
        prop_assert_eq!(found, transfer);
    }

    #[test]
    fn palettes_come_back_bit_for_bit(
        entries in proptest::collection::vec(([share(), share(), share()], share()), 12),
        values in [-1e300..0.0f64, 0.0..1e300f64], magnitudes in [0.0..1e-3f64, 1e-3..1e300f64],
        sliders in (share(), share()), selection in proptest::option::of((share(), 1e-300..1.0f64)),
    ) {
        let folder = Folder::new();
        let entries = entries.into_iter().map(|(color, opacity)| Entry { color, opacity }).collect();
        let palette = Palette { values, magnitudes, columns: 4, entries, unit_distance: 0.1 };
        let selection = selection.map(|(mean, range)| Selection { mean, range });
        let sliders = Sliders { global_opacity: sliders.0, gradient_weight: sliders.1, selection };
        let function = TransferFunction2d::new(palette, sliders).unwrap();
        let path = folder.path("palette.json");
        write_transfer_2d(&path, &function).unwrap();
        prop_assert_eq!(read_transfer_2d(&path).unwrap(), function);
    }
}
