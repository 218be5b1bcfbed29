use volery_io::scene_file::{InputKind, SceneFile};
use volery_io::{ByteOrder, Element};
use volery_scene::{Projection, SampleType};

use crate::Folder;

const SCENE: &str = r#"{"name": "tooth", "input": {"kind": "volume", "file": "tooth.raw", "dims": [103, 94, 161],
    "dtype": ">u2", "spacing": [1, 1, 2.5]}, "size": [512, 256], "background": [0, 0.5, 1],
    "camera": {"projection": "perspective", "eye": [240, -150, 180], "target": [51, 46.5, 80], "up": [0, 0, 1],
    "fov_y_deg": 30}, "transfer_function": {"points": [{"value": 0, "color": [0, 0, 0], "opacity": 0}],
    "unit_distance": 1.0}}"#;

#[test]
fn every_field_arrives() {
    let scene = SceneFile::parse(SCENE, "unused").unwrap();
    assert_eq!((scene.name.as_str(), scene.size, scene.background), ("tooth", [512, 256], [0.0, 0.5, 1.0]));
    assert_eq!(scene.input.kind, InputKind::Volume);
    assert_eq!(scene.input.file.to_str(), Some("tooth.raw"));
    let options = scene.input.read_options();
    assert_eq!(options.dims, Some([103, 94, 161]));
    assert_eq!(options.element, Some(Element { sample: SampleType::U16, order: ByteOrder::Big }));
    assert_eq!(options.spacing.map(|s| s.to_array()), Some([1.0, 1.0, 2.5]));
    assert_eq!(scene.camera.projection, Projection::Perspective { fov_y_deg: 30.0 });
    assert_eq!(scene.camera.eye.to_array(), [240.0, -150.0, 180.0]);
    assert_eq!(scene.transfer.points().len(), 1);
}

#[test]
fn a_grid_an_orthographic_camera_and_a_scene_without_a_name() {
    let text = SCENE
        .replace("\"kind\": \"volume\"", "\"kind\": \"grid\", \"array\": \"Umag\"")
        .replace("perspective", "orthographic")
        .replace("\"fov_y_deg\": 30", "\"height\": 12.5")
        .replace("\"name\": \"tooth\", ", "");
    let folder = Folder::new();
    let scene = SceneFile::read(&folder.put("beside.json", text)).unwrap();
    assert_eq!((scene.name.as_str(), scene.input.kind), ("beside", InputKind::Grid));
    assert_eq!(scene.input.array.as_deref(), Some("Umag"));
    assert_eq!(scene.camera.projection, Projection::Orthographic { height: 12.5 });
}

#[test]
fn meshes_of_a_scene() {
    assert_eq!(SceneFile::parse(SCENE, "").unwrap().meshes, []);
    let text =
        SCENE.replace("\"name\"", "\"meshes\": [{\"file\": \"hull.obj\", \"color\": [0, 0.5, 1]}], \"name\"");
    let meshes = SceneFile::parse(&text, "").unwrap().meshes;
    assert_eq!(meshes.len(), 1);
    assert_eq!((meshes[0].file.to_str(), meshes[0].color), (Some("hull.obj"), [0.0, 0.5, 1.0]));
}

#[test]
fn what_a_scene_cannot_be() {
    let cases = [
        ("\"name\"", "\"nmae\"", "unknown field `nmae`, expected one of `name`, `input`"),
        ("\"fov_y_deg\"", "\"fov\"", "unknown field `fov`, expected one of"),
        ("\"dims\"", "\"dim\"", "unknown field `dim`, expected one of"),
        ("\"kind\": \"volume\"", "\"kind\": \"mesh\"", "unknown variant `mesh`, expected `volume` or `grid`"),
        ("\"size\": [512, 256], ", "", "missing field `size`"),
        ("[512, 256]", "[0, 256]", "size is 0 x 256, expected 1 to 65536 each"),
        ("[512, 256]", "[65537, 1]", "size is 65537 x 1, expected"),
        ("[512, 256]", "[65536, 65536]", "size is 65536 x 65536, expected"),
        ("[512, 256]", "[-1, 256]", "invalid value: integer `-1`"),
        ("[512, 256]", "[4294967296, 256]", "invalid value: integer `4294967296`"),
        ("[0, 0.5, 1]", "[0, 0.5, 2]", "background is [0.0, 0.5, 2.0], expected three numbers in [0, 1]"),
        ("[1, 1, 2.5]", "[1, 0, 2.5]", "input.spacing is [1.0, 0.0, 2.5], expected three positive"),
        (">u2", ">u3", "input.dtype is '>u3', expected one of uint8"),
        (
            "\"fov_y_deg\": 30",
            "\"fov_y_deg\": 180",
            "camera: fov_y_deg is 180, expected above 0 and below 180",
        ),
        ("\"fov_y_deg\": 30", "\"height\": 30", "camera.fov_y_deg is missing, expected"),
        (
            "\"fov_y_deg\": 30",
            "\"fov_y_deg\": 30, \"height\": 1",
            "camera.fov_y_deg and height are both there",
        ),
        ("perspective", "orthographic", "camera.height is missing, expected"),
        ("[240, -150, 180]", "[51, 46.5, 80]", "camera: eye and target are the same point"),
        ("\"up\": [0, 0, 1]", "\"up\": [0, 0, 0]", "camera: up is parallel"),
        ("[240, -150, 180]", "[1e999, 0, 0]", "number out of range"),
        ("\"name\"", "\"meshes\": [{\"file\": \"a.obj\"}], \"name\"", "missing field `color`"),
        (
            "\"name\"",
            "\"meshes\": [{\"file\": \"a.obj\", \"color\": [0, 0, 1]}, {\"file\": \"b\", \"color\": [0, 2, 0]}], \"name\"",
            "meshes[1].color is [0.0, 2.0, 0.0], expected three numbers in [0, 1]",
        ),
        ("\"opacity\": 0", "\"opacity\": 2", "transfer function: point 0: opacity 2"),
        ("\"points\": [{", "\"points\": [], \"x\": [{", "unknown field `x`"),
    ];
    let folder = Folder::new();
    for (from, to, expected) in cases {
        assert!(SCENE.contains(from), "{from}");
        let path = folder.put("scene.json", SCENE.replacen(from, to, 1));
        let line = SceneFile::read(&path).unwrap_err().to_string();
        let rest = line.strip_prefix(&format!("{}: ", path.display())).expect("the file is named");
        assert!(rest.starts_with(expected) && !line.contains('\n'), "{line}, expected {expected}");
    }
    for text in ["", "{", "[]", "null", "\u{0}", &"[".repeat(100_000), &SCENE[..300]] {
        assert!(SceneFile::parse(text, "").is_err());
    }
    let binary = SceneFile::read(&folder.put("scene.json", b"\xff\xfe{}")).unwrap_err().to_string();
    assert!(binary.contains("the text is damaged"), "{binary}");
    assert!(
        SceneFile::read(folder.0.path()).unwrap_err().to_string().ends_with("is a folder, expected a file")
    );
}
