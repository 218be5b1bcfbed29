use volery_io::transfer::{ColorMap, ColorSpace, TransferOptions, parse_color_maps};
use volery_io::{NamedTransfer, read_transfer};

use crate::Folder;

const ANY: TransferOptions = TransferOptions { map: None, range: None, unit_distance: 1.0 };

fn read(folder: &Folder, text: &str, options: &TransferOptions) -> Result<NamedTransfer, String> {
    let path = folder.put("map.json", text);
    read_transfer(&path, options).map_err(|error| {
        let line = error.to_string();
        assert!(!line.contains('\n') && line.len() < 1000, "{line}");
        line.strip_prefix(&format!("{}: ", path.display())).expect("the file is named").to_owned()
    })
}

#[test]
fn our_json() {
    let folder = Folder::new();
    let text = r#"{"points": [{"value": 1, "color": [0, 0.5, 1], "opacity": 0},
        {"value": 3, "color": [1, 0.5, 0], "opacity": 0.5}], "unit_distance": 2.5}"#;
    let NamedTransfer { name, transfer, .. } = read(&folder, text, &ANY).unwrap();
    assert_eq!((name.as_str(), transfer.unit_distance()), ("map", 2.5));
    assert_eq!(transfer.classify(2.0), ([0.5, 0.5, 0.5], 0.25));
    for (from, to, expected) in [
        ("\"unit_distance\": 2.5", "\"unit_distance\": 0", "transfer function: unit_distance is 0, expected"),
        (", \"unit_distance\": 2.5", "", "missing field `unit_distance`"),
        ("\"value\": 1", "\"value\": 9", "transfer function: point 1: value 3 is below the point before"),
        (
            "\"value\": 1",
            "\"valeu\": 1",
            "unknown field `valeu`, expected one of `value`, `color`, `opacity`",
        ),
        ("\"opacity\": 0.5", "\"opacity\": 1.5", "transfer function: point 1: opacity 1.5, expected"),
        ("[1, 0.5, 0]", "[1, 0.5]", "invalid length 2"),
        ("\"value\": 1", "\"value\": 1e999", "number out of range"),
        ("\"points\"", "\"pionts\"", "RGBPoints of colour map '1' is empty, expected at least one point"),
        ("\"value\": 1,", "\"value\": 1", "expected `,` or `}`"),
    ] {
        let line = read(&folder, &text.replacen(from, to, 1), &ANY).unwrap_err();
        assert!(line.starts_with(expected), "{line}, expected {expected}");
    }
    for text in ["{}", "[]", "3", "null", "\"a\"", "{\"points\": 3}", "[[]]", "[{]", &"[".repeat(10_000)] {
        read(&folder, text, &ANY).unwrap_err();
    }
}

#[test]
fn paraview_maps_one_or_several_with_trailing_commas() {
    let folder = Folder::new();
    let one = r#"{"Name": "Gray, really", "Creator": "hand", "ColorSpace": "RGB", "NanColor": [1, 0, 0],
        "RGBPoints": [0, 0, 0, 0,  2, 1, 1, 1,], "Points": [0, 0, 0.5, 0, 2, 0.5, 0.5, 0],}"#;
    let NamedTransfer { name, transfer, .. } = read(&folder, one, &ANY).unwrap();
    assert_eq!(name, "Gray, really");
    assert_eq!(transfer.classify(1.0), ([0.5; 3], 0.25));
    let options = TransferOptions { range: Some([-10.0, 30.0]), unit_distance: 4.0, ..ANY };
    let stretched = read(&folder, one, &options).unwrap().transfer;
    assert_eq!(stretched.classify(0.0), ([0.25; 3], 0.125));
    assert_eq!(stretched.unit_distance(), 4.0);

    let several = format!("[{one}, {}, ]", one.replace("Gray, really", "B"));
    let options = TransferOptions { map: Some("B"), ..ANY };
    assert_eq!(read(&folder, &several, &options).unwrap().name, "B");
    let line = read(&folder, &several, &ANY).unwrap_err();
    assert_eq!(line, "the colour map asked for is none of 2, expected one of 'Gray, really, B'");
    let options = TransferOptions { map: Some("C"), ..ANY };
    let line = read(&folder, &several, &options).unwrap_err();
    assert_eq!(line, "the colour map asked for is 'C', expected one of 'Gray, really, B'");
}

#[test]
fn a_map_without_opacities_gets_a_ramp() {
    let folder = Folder::new();
    let text = r#"[{"Name": "Cool to Warm", "ColorSpace": "Diverging", "RGBPoints":
        [0, 0.23137254902, 0.298039215686, 0.752941176471, 1, 0.705882352941, 0.0156862745098, 0.149019607843]}]"#;
    let options = TransferOptions { range: Some([0.0, 255.0]), ..ANY };
    let transfer = read(&folder, text, &options).unwrap().transfer;
    for (value, opacity) in [(-1.0, 0.0), (51.0, 0.2), (255.0, 1.0)] {
        assert!((transfer.classify(value).1 - opacity).abs() < 1e-12);
    }
    let (middle, _) = transfer.classify(127.5);
    assert!(
        middle.iter().all(|c| (c - 221.0 / 255.0).abs() < 1.0 / 255.0),
        "{middle:?} is the paper's 221 gray"
    );
}

#[test]
fn what_a_map_cannot_be() {
    let folder = Folder::new();
    for (text, expected) in [
        (
            r#"{"Name": "A", "IndexedColors": [1, 0, 0]}"#,
            "IndexedColors of colour map 'A' is a list, expected RGBPoints",
        ),
        (
            r#"{"Name": "A", "ColorSpace": "CMYK", "RGBPoints": []}"#,
            "ColorSpace of colour map 'A' is 'CMYK', expected RGB, HSV",
        ),
        (r#"{"Name": "A", "ColorSpace": 3, "RGBPoints": []}"#, "ColorSpace of colour map 'A' is no text"),
        (
            r#"{"Name": "A", "RGBPoints": [1, 2, 3]}"#,
            "RGBPoints of colour map 'A' is 3 numbers, expected numbers in groups",
        ),
        (r#"{"Name": "A", "RGBPoints": ["x"]}"#, "RGBPoints of colour map 'A' is something else"),
        (r#"{"Name": "A", "RGBPoints": [0, 1, 2, 3]}"#, "transfer function: point 0: colour"),
        (r#"{"RGBPoints": [0, 1, 1, 1], "Points": [0, 9, 0.5, 0]}"#, "transfer function: point 0: opacity 9"),
    ] {
        let line = read(&folder, text, &ANY).unwrap_err();
        assert!(line.starts_with(expected), "{line}, expected {expected}");
    }
}

#[test]
fn every_space_is_parsed() {
    let names = [
        ("RGB", ColorSpace::Rgb),
        ("HSV", ColorSpace::Hsv),
        ("Lab", ColorSpace::Lab),
        ("CIELAB", ColorSpace::Lab),
        ("Diverging", ColorSpace::Diverging),
        ("Step", ColorSpace::Step),
    ];
    for (name, space) in names {
        let text = format!(r#"{{"ColorSpace": "{name}", "RGBPoints": [2, 1, 0, 0, 1, 0, 0, 1]}}"#);
        let expected = ColorMap {
            name: "1".to_owned(),
            space,
            colors: vec![(1.0, [0.0, 0.0, 1.0]), (2.0, [1.0, 0.0, 0.0])],
            opacities: Vec::new(),
        };
        assert_eq!(parse_color_maps(&text).unwrap(), [expected], "points are sorted");
    }
    let text = r#"{"ColorSpace": "HSV", "HSVWrap": 1, "RGBPoints": [0, 1, 0, 0]}"#;
    assert_eq!(parse_color_maps(text).unwrap()[0].space, ColorSpace::HsvWrapped);
}
