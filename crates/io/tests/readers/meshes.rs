use volery_io::mesh::{MeshFile, read_mesh};

use crate::Folder;
use crate::make::base64;
use crate::make_mesh::{OBJ, glb, gltf};

const COLOR: [f64; 3] = [0.25, 0.5, 0.75];
const MAX_BYTES: u64 = 1 << 20;

/// Corners of the triangles, as they stand in the file.
fn corners(file: &MeshFile) -> Vec<[[f64; 3]; 3]> {
    let points = file.mesh.points();
    file.mesh
        .triangles()
        .iter()
        .map(|triangle| triangle.map(|corner| points[corner as usize].to_array()))
        .collect()
}

#[track_caller]
fn read(folder: &Folder, name: &str, bytes: impl AsRef<[u8]>) -> MeshFile {
    let file =
        read_mesh(&folder.put(name, bytes), COLOR, MAX_BYTES).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(file.mesh.color(), COLOR);
    file
}

/// Reads a file that must be refused in one line that starts with its path; returns the rest.
#[track_caller]
fn refuse(folder: &Folder, name: &str, bytes: impl AsRef<[u8]>) -> String {
    let path = folder.put(name, bytes);
    let line = match read_mesh(&path, COLOR, MAX_BYTES) {
        Ok(file) => panic!("{name} was read: {file:?}"),
        Err(error) => error.to_string(),
    };
    assert!(!line.contains('\n') && line.len() < 1000, "{line}");
    let rest = line.strip_prefix(&format!("{}: ", path.display()));
    rest.unwrap_or_else(|| panic!("{line} does not name the file")).to_owned()
}

#[test]
fn every_face_of_an_obj_file_arrives() {
    let [a, b, c, d] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let top = [0.5, 0.5, 2.0];
    let expected = [[a, b, c], [a, c, d], [a, b, top], [b, c, top], [c, d, top], [d, a, top]];
    let folder = Folder::new();
    let latin = OBJ.replace("Caf\u{e9}", "Caf?").replace('?', "\u{1}");
    let latin: Vec<u8> = latin.bytes().map(|byte| if byte == 1 { 0xe9 } else { byte }).collect();
    for (name, bytes) in
        [("a.obj", OBJ.into()), ("B.OBJ", OBJ.replace('\n', "\r\n").into_bytes()), ("c.obj", latin)]
    {
        let file = read(&folder, name, bytes);
        assert_eq!(corners(&file), expected, "{name}");
        assert_eq!(file.notes, ["2 points left out: no surface", "1 line left out: no surface"], "{name}");
    }
}

#[test]
fn concave_faces_keep_their_outline() {
    let arrow = "v 0 0 0\nv 4 0 0\nv 1 1 0\nv 0 4 0\n";
    let folder = Folder::new();
    for face in ["f 1 2 3 4", "f 2 3 4 1", "f 4 3 2 1"] {
        let file = read(&folder, "arrow.obj", format!("{arrow}{face}\n"));
        let area = |[a, b, c]: [[f64; 3]; 3]| {
            ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs() / 2.0
        };
        let found: f64 = corners(&file).into_iter().map(area).sum();
        assert_eq!(found, 4.0, "{face}");
    }
}

/// Where the parts of a glTF file are makes no difference.
#[test]
fn every_triangle_of_a_gltf_file_arrives_in_its_place() {
    let folder = Folder::new();
    let (text, bytes) = gltf("");
    let binary = read(&folder, "a.glb", glb(&text, &bytes));
    // Turned by a quarter, twice as large, moved.
    let place = |[x, y, z]: [f64; 3]| [10.0 - 2.0 * y, 2.0 * x, 2.0 * z];
    let [a, b, c, d] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let strip = |x: f64, z: f64| {
        let [a, b, c, d] = [[x, 0.0, z], [x + 1.0, 0.0, z], [x, 1.0, z], [x + 1.0, 1.0, z]];
        [[a, b, c], [b, c, d]]
    };
    let expected = [[[a, b, c].map(place), [a, c, d].map(place)], strip(10.0, 5.0), strip(0.0, 0.0)].concat();
    for (found, expected) in corners(&binary).as_flattened().iter().zip(expected.as_flattened()) {
        let off = (0..3).map(|axis| (found[axis] - expected[axis]).abs()).fold(0.0, f64::max);
        assert!(off < 1e-6, "{found:?}, expected {expected:?}");
    }
    assert_eq!(binary.mesh.triangles().len(), expected.len());
    assert_eq!(
        binary.notes,
        [
            "1 set of points left out: no surface",
            "1 set of lines left out: no surface",
            "1 skin left out: rest shapes are shown"
        ]
    );
    folder.put("of it.bin", &bytes);
    for uri in ["of%20it.bin".to_owned(), format!("data:application/octet-stream;base64,{}", base64(&bytes))]
    {
        let (text, _) = gltf(&format!("\"uri\": \"{uri}\", "));
        assert_eq!(corners(&read(&folder, "a.gltf", text)), corners(&binary), "{uri:.20}");
    }
    let (without_scenes, _) = gltf("");
    let without_scenes = without_scenes.replace(r#""scene": 0, "scenes": [{"nodes": [0, 3]}],"#, "");
    assert_eq!(corners(&read(&folder, "a.glb", glb(&without_scenes, &bytes))), corners(&binary));
}

#[test]
fn sparse_positions_are_changed_ones() {
    let (text, mut bytes) = gltf("");
    // The second point goes to (7, 8, 9).
    bytes.extend([1_u8, 0, 0, 0]);
    bytes.extend([7.0_f32, 8.0, 9.0].iter().flat_map(|x| x.to_le_bytes()));
    let sparse = r#""sparse": {"count": 1, "indices": {"bufferView": 2, "componentType": 5121},
        "values": {"bufferView": 2, "byteOffset": 4}}, "count": 4, "type": "VEC3"}"#;
    let text = text
        .replacen("\"count\": 4, \"type\": \"VEC3\"}", sparse, 1)
        .replace(
            "\"byteStride\": 8}",
            "\"byteStride\": 8}, {\"buffer\": 0, \"byteOffset\": 116, \"byteLength\": 16}",
        )
        .replace("\"byteLength\": 116}]", "\"byteLength\": 132}]");
    let folder = Folder::new();
    let file = read(&folder, "a.glb", glb(&text, &bytes));
    let [x, y, z] = corners(&file)[0][1];
    assert!((x - (10.0 - 16.0)).abs() < 1e-5 && (y - 14.0).abs() < 1e-5 && z == 18.0, "{x} {y} {z}");
}

/// A triangle and a square beside it.
const PLAIN_OBJ: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 1\nf 1 2 3 4\nf 2 5 3\n";

#[test]
fn obj_lines_are_joined_only_where_a_statement_goes_on() {
    let folder = Folder::new();
    let expected = corners(&read(&folder, "a.obj", PLAIN_OBJ));
    assert_eq!(expected.len(), 3);
    for (from, to) in [
        ("v 1 0 0\n", "v 1 \\\n0 \\\r\n 0\n"),
        ("f 1 2 3 4\n", "f 1 2 \\\n3 4\n"),
        // What follows none of these is part of them.
        ("v 1 0 0\n", "# a path a:\\\nv 1 0 0\n"),
        ("v 1 0 0\n", "usemtl a:\\\nv 1 0 0\n"),
        ("v 1 0 0\n", "g a\\\nv 1 0 0\n"),
        ("f 1 2 3 4\n", "mtllib x\\\nf 1 2 3 4\n"),
        ("v 0 0 0\n", "#\\\nv 0 0 0\n"),
    ] {
        assert!(PLAIN_OBJ.contains(from), "{from}");
        let mesh = read(&folder, "a.obj", PLAIN_OBJ.replacen(from, to, 1));
        assert_eq!(corners(&mesh), expected, "{to}");
    }
}

#[test]
fn obj_comments_capitals_and_line_ends_do_no_harm() {
    let folder = Folder::new();
    let expected = corners(&read(&folder, "a.obj", PLAIN_OBJ));
    let cases: [Vec<u8>; 8] = [
        PLAIN_OBJ.replace("f 1 2 3 4", "f 1 2 3 4 # bottom").into(),
        PLAIN_OBJ.replace("f 1 2 3 4", "f 1 2 3 4 #bottom \\").into(),
        PLAIN_OBJ.replace("v 1 1 0", "v 1 1 0 #corner").into(),
        PLAIN_OBJ.replace('\n', "\r").into(),
        PLAIN_OBJ.replace('\n', "\r\n").into(),
        PLAIN_OBJ.to_ascii_uppercase().into(),
        [b"\xef\xbb\xbf", PLAIN_OBJ.as_bytes()].concat(),
        PLAIN_OBJ.replace(' ', "\t ").replace("f\t", "  f\t").into(),
    ];
    for case in cases {
        assert_eq!(corners(&read(&folder, "a.obj", &case)), expected, "{}", String::from_utf8_lossy(&case));
    }
}

#[test]
fn what_an_obj_file_cannot_be() {
    let folder = Folder::new();
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\n";
    for (text, expected) in [
        (
            format!("{square}f 1 2 4\n"),
            "a corner of a face is a point that does not exist, expected one of the 3 of the file",
        ),
        (format!("{square}f 1 2 0\n"), "a corner of a face is a point that does not exist"),
        (format!("{square}f 1 2 -4\n"), "a corner of a face is a point that does not exist"),
        (format!("{square}f 1 2 9223372036854775807\n"), "a corner of a face is a point that does not exist"),
        (format!("{square}f 1 2 x\n"), "line 4 is f 1 2 x, expected 'f' and the numbers of points"),
        ("v 1 2\nf 1 1 1\n".to_owned(), "line 1 is v 1 2, expected 'v' and three numbers"),
        ("v 1 2 3 0\nf 1 1 1\n".to_owned(), "line 1 is v 1 2 3 0, expected 'v' and three numbers"),
        ("v nan 2 3\nf 1 1 1\n".to_owned(), "mesh: point 0 is [NaN, 2, 3], expected finite"),
        (format!("{square}l 1 2\n"), "number of triangles is none (1 line left out: no surface), expected"),
        ("\u{0}\u{1}".to_owned(), "number of triangles is none, expected at least 1"),
    ] {
        let line = refuse(&folder, "a.obj", &text);
        assert!(line.starts_with(expected), "{line}, expected {expected}");
    }
    assert_eq!(
        refuse(&folder, "a.stl", "solid"),
        "ending of the name is a.stl, expected .obj, .gltf or .glb"
    );
    assert_eq!(refuse(&folder, "a.obj", ""), "is empty, expected a file with content");
    let path = folder.put("a.obj", OBJ);
    let line = read_mesh(&path, COLOR, 100).unwrap_err().to_string();
    assert!(line.ends_with("bytes, expected at most 100"), "{line}");
    let line = read_mesh(&path, [2.0, 0.0, 0.0], MAX_BYTES).unwrap_err().to_string();
    assert!(line.ends_with("mesh: colour [2.0, 0.0, 0.0], expected three numbers in [0, 1]"), "{line}");
    let line = read_mesh(&folder.path("none.obj"), COLOR, MAX_BYTES).unwrap_err().to_string();
    assert!(line.contains("none.obj: cannot be read: "), "{line}");
}

#[test]
fn what_a_gltf_file_cannot_be() {
    let folder = Folder::new();
    let (text, bytes) = gltf("");
    for (from, to, expected) in [
        ("\"children\": [1, 2]", "\"children\": [1, 0]", "node 0 is a child more than once, expected"),
        ("\"children\": [1, 2]", "\"children\": [1, 1]", "node 1 is a child more than once, expected"),
        ("\"children\": [1, 2]", "\"children\": [1, 9]", "a node is 9, expected below 4"),
        ("\"mesh\": 0", "\"mesh\": 7", "node 1: mesh is 7, expected below 2"),
        ("\"scene\": 0", "\"scene\": 3", "scene is 3, expected below 1"),
        (
            "\"indices\": 1",
            "\"indices\": 0",
            "mesh 0: primitive 0: accessor 0: type is another one, expected SCALAR",
        ),
        ("\"indices\": 1", "\"indices\": 8", "mesh 0: primitive 0: accessor is 8, expected below 3"),
        ("\"count\": 4", "\"count\": 3", "mesh 0: primitive 0: an index is 3, expected below 3"),
        (
            "\"count\": 4",
            "\"count\": 4000000000",
            "mesh 0: primitive 0: size of the mesh is 96000000000 bytes, expected",
        ),
        (
            "\"count\": 6",
            "\"count\": 7",
            "mesh 0: primitive 0: accessor 1: the buffer holds 84 bytes, expected 88",
        ),
        ("5126", "5125000", "mesh 0: primitive 0: accessor 0: componentType is another number, expected"),
        ("5125", "5126", "mesh 0: primitive 0: accessor 1: componentType is F32, expected an unsigned"),
        (
            "\"byteLength\": 84",
            "\"byteLength\": 18446744073709551615",
            "mesh 0: primitive 0: accessor 0: the buffer holds",
        ),
        (
            "\"byteStride\": 8",
            "\"byteStride\": 4",
            "mesh 1: primitive 0: accessor 2: byteStride is 4, expected at least 6",
        ),
        ("\"byteLength\": 116", "\"byteLength\": 117", "buffer 0: it holds 116 bytes, expected 117"),
        (
            "\"byteLength\": 116",
            "\"byteLength\": 2000000",
            "size of the buffers is 2000000 bytes, expected at most",
        ),
        ("\"mode\": 5", "\"mode\": 9", "mesh 1: primitive 0: mode is another number, expected 0 to 6"),
        (
            "Required\": [\"KHR_mesh_quantization\"",
            "Required\": [\"EXT_meshopt_compression\"",
            "extensionsRequired is 'EXT_meshopt_compression', expected none that changes shapes",
        ),
        ("\"asset\"", "\"essat\"", "the JSON is damaged: missing field `asset`"),
    ] {
        assert!(text.contains(from), "{from}");
        let line = refuse(&folder, "a.glb", glb(&text.replacen(from, to, 1), &bytes));
        assert!(line.starts_with(expected), "{line}, expected {expected}");
    }
    let whole = glb(&text, &bytes);
    for length in [4, 8, 11, 12, 19, 20, 500, whole.len() - 1] {
        refuse(&folder, "a.glb", &whole[..length]);
    }
    for (uri, expected) in [
        ("http://x/y.bin", "buffer 0: uri is 'http://x/y.bin', expected a relative path"),
        ("/etc/passwd", "buffer 0: uri is '/etc/passwd', expected a relative path"),
        ("data:text/plain,abc", "buffer 0: uri is 'data:text/plain,abc', expected data in base64"),
        ("data:;base64,???", "buffer 0: its base64 text is damaged"),
        ("%zz", "buffer 0: uri is '%zz', expected a relative path"),
    ] {
        let line = refuse(&folder, "a.gltf", gltf(&format!("\"uri\": \"{uri}\", ")).0);
        assert!(line.starts_with(expected), "{line}, expected {expected}");
    }
    let line = refuse(&folder, "a.gltf", gltf("\"uri\": \"none.bin\", ").0);
    assert!(line.contains("none.bin: cannot be read: "), "{line}");
    let line = refuse(&folder, "a.gltf", gltf("").0);
    assert_eq!(line, "buffer 0: uri is missing, expected one, or a binary part of the file");
}

/// A chain of so many nodes would overflow a stack that visits them one in the other.
#[test]
fn deep_trees_are_no_danger() {
    let (text, bytes) = gltf("");
    let num = 300_000;
    let chain: String = (0..num).map(|i| format!("{{\"children\": [{}]}}, ", i + 1)).collect();
    let start = text.find("\"nodes\": [{\"children\"").unwrap();
    let end = text.find("\"skins\"").unwrap();
    let text = format!(
        "{}\"nodes\": [{chain}{{\"mesh\": 0}}], {}",
        &text[..start].replace("[0, 3]", "[0]"),
        &text[end..]
    );
    let folder = Folder::new();
    let path = folder.put("deep.glb", glb(&text, &bytes));
    let file = read_mesh(&path, COLOR, 64 << 20).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(file.mesh.triangles().len(), 2);
}
