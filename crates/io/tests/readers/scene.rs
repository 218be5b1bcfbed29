use volery_io::scene_file::{
    InputKind, SceneBackend, SceneFile, SceneFocus, SceneInput, SceneMesh, ScenePlane, SceneTechnique,
    SceneThickness, SceneTransfer,
};
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
    let scene = SceneFile::parse(SCENE).unwrap();
    assert_eq!(scene.name.as_deref(), Some("tooth"));
    assert_eq!((scene.size, scene.background), (Some([512, 256]), Some([0.0, 0.5, 1.0])));
    assert_eq!(scene.input.kind, Some(InputKind::Volume));
    assert_eq!(scene.input.file.to_str(), Some("tooth.raw"));
    let options = scene.input.read_options();
    assert_eq!(options.dims, Some([103, 94, 161]));
    assert_eq!(options.element, Some(Element { sample: SampleType::U16, order: ByteOrder::Big }));
    assert_eq!(options.spacing.map(|s| s.to_array()), Some([1.0, 1.0, 2.5]));
    let camera = scene.camera.unwrap();
    assert_eq!(camera.projection, Projection::Perspective { fov_y_deg: 30.0 });
    assert_eq!(camera.eye.to_array(), [240.0, -150.0, 180.0]);
    let Some(SceneTransfer::Values(transfer)) = scene.transfer else { panic!("no points") };
    assert_eq!(transfer.points().len(), 1);
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
    assert_eq!((scene.name, scene.input.kind), (None, Some(InputKind::Grid)));
    assert_eq!(scene.input.array.as_deref(), Some("Umag"));
    assert_eq!(scene.camera.unwrap().projection, Projection::Orthographic { height: 12.5 });
}

#[test]
fn meshes_of_a_scene() {
    assert_eq!(SceneFile::parse(SCENE).unwrap().meshes, []);
    let text =
        SCENE.replace("\"name\"", "\"meshes\": [{\"file\": \"hull.obj\", \"color\": [0, 0.5, 1]}], \"name\"");
    let meshes = SceneFile::parse(&text).unwrap().meshes;
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
        ("\"file\": \"tooth.raw\", ", "", "missing field `file`"),
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
        ("\"points\": [{", "\"points\": [], \"x\": [{", "transfer_function: unknown field `x`"),
        ("\"name\"", "\"range\": [3, 2], \"name\"", "range is [3.0, 2.0], expected two finite values"),
        ("\"name\"", "\"tolerance\": 2, \"name\"", "tolerance is 2.0, expected a number in [0, 1]"),
        ("\"name\"", "\"error\": -1, \"name\"", "error is -1.0, expected a number in [0, 1]"),
        ("\"name\"", "\"adaptive\": 1.5, \"name\"", "adaptive is 1.5, expected a number in [0, 1]"),
        ("\"name\"", "\"slices\": 0, \"name\"", "slices is 0, expected 1 to"),
        (
            "\"name\"",
            "\"technique\": \"rays\", \"name\"",
            "unknown variant `rays`, expected one of `raycast`",
        ),
        (
            "\"name\"",
            "\"focus\": {\"point\": [0, 0, 0], \"quality\": -1}, \"name\"",
            "focus.quality is -1.0, expected at least 0",
        ),
        (
            "\"name\"",
            "\"planes\": [{\"normal\": [0, 0, 0], \"distance\": 1}], \"name\"",
            "planes[0]: normal [0, 0, 0]",
        ),
        ("[103, 94, 161]", "[103, 0, 161]", "input.dims is [103, 0, 161], expected three counts"),
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
        assert!(SceneFile::parse(text).is_err());
    }
    let binary = SceneFile::read(&folder.put("scene.json", b"\xff\xfe{}")).unwrap_err().to_string();
    assert!(binary.contains("the text is damaged"), "{binary}");
    assert!(
        SceneFile::read(folder.0.path()).unwrap_err().to_string().ends_with("is a folder, expected a file")
    );
}

#[test]
fn a_scene_needs_its_input_alone_and_comes_back_bit_for_bit() {
    let least = SceneFile::parse(r#"{"input": {"file": "a.nrrd"}}"#).unwrap();
    let input = SceneInput { file: "a.nrrd".into(), ..SceneInput::default() };
    assert_eq!(least, SceneFile { input, ..SceneFile::default() });
    let whole = SceneFile::parse(SCENE).unwrap();
    let full = SceneFile {
        range: Some([0.1, 1e300]),
        technique: Some(SceneTechnique::Plane),
        tolerance: Some(0.1 + 0.2),
        planes: vec![ScenePlane { normal: [0.3, 0.5, 0.81], distance: 1.0 / 3.0 }],
        focus: Some(SceneFocus { point: [1.0, -2e-300, 3.0], quality: 0.7 }),
        error: Some(f64::MIN_POSITIVE),
        transparent: true,
        nearest: true,
        show_nodes: true,
        thickness: Some(SceneThickness::Interpolated),
        slices: Some(7),
        adaptive: Some(0.9),
        axes: true,
        shade: true,
        quantized: true,
        backend: Some(SceneBackend::Software),
        meshes: vec![SceneMesh { file: "b.obj".into(), color: [0.1, 0.2, 0.3] }],
        ..whole.clone()
    };
    let named = SceneFile { transfer: Some(SceneTransfer::Preset("viridis".to_owned())), ..whole.clone() };
    let folder = Folder::new();
    for scene in [least, whole, full, named] {
        let path = folder.path("scene.json");
        scene.write(&path).unwrap();
        assert_eq!(SceneFile::read(&path).unwrap(), scene);
    }
}

#[test]
fn the_name_of_a_type_is_read_as_that_type() {
    for name in
        ["u1", "i1", "<u2", ">u2", "<i2", ">i2", "<u4", ">u4", "<i4", ">i4", "<f4", ">f4", "<f8", ">f8"]
    {
        let element: Element = name.parse().unwrap();
        assert_eq!(element.to_string(), name);
    }
}
