//! Stacks of slices: written, read, refused.

use std::path::Path;

use serde_json::Value;
use volery_io::{GlbOptions, ReadError, read_stack, write_glb, write_vsl};
use volery_slicing::QuantizedMesh;

use crate::Folder;
use crate::make_stack::stack;

const MAX_BYTES: u64 = 1 << 20;

/// With every triangle from its least corner on.
fn turned(mut mesh: QuantizedMesh) -> QuantizedMesh {
    let turn = |[a, b, c]: [u32; 3]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap();
    mesh.triangles.iter_mut().for_each(|triangle| *triangle = turn(*triangle));
    mesh
}

fn color(value: f64) -> [f64; 4] {
    [0.5, value, 1.0 - value, 0.1]
}

/// The text and the binary part.
fn parts(bytes: &[u8]) -> (Value, Vec<u8>) {
    let word = |at: usize| u32::from_le_bytes(*bytes[at..].first_chunk().unwrap()) as usize;
    let text = &bytes[20..20 + word(12)];
    (serde_json::from_slice(text).unwrap(), bytes[28 + word(12)..].to_vec())
}

fn glb(document: &Value, blob: &[u8]) -> Vec<u8> {
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend(((28 + text.len() + blob.len()) as u32).to_le_bytes());
    for (kind, content) in [(b"JSON", &text[..]), (b"BIN\0", blob)] {
        bytes.extend((content.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(content);
    }
    bytes
}

#[track_caller]
fn refusal(result: Result<QuantizedMesh, ReadError>, path: &Path) -> String {
    let line = result.unwrap_err().to_string();
    assert!(!line.contains('\n') && line.len() < 1000, "{line}");
    line.strip_prefix(&format!("{}: ", path.display())).unwrap().to_owned()
}

#[test]
fn what_is_read_has_the_bits_of_what_was_written() {
    let folder = Folder::new();
    for (side, num_planes, has_gradients) in [(1, 1, false), (3, 20, true), (4, 50, false)] {
        let compact = stack(side, num_planes, has_gradients);
        let mesh = compact.clone().expand();
        let vsl = folder.path("a.vsl");
        let vsl_bytes = write_vsl(&vsl, &compact).unwrap();
        assert_eq!(vsl_bytes, std::fs::metadata(&vsl).unwrap().len());
        assert_eq!(turned(read_stack(&vsl, MAX_BYTES).unwrap()), turned(mesh.clone()));
        for is_coded in [false, true] {
            let path = folder.path("a.glb");
            let num_bytes = write_glb(&path, &mesh, color, GlbOptions { is_coded }).unwrap();
            assert_eq!(num_bytes, std::fs::metadata(&path).unwrap().len());
            let found = read_stack(&path, MAX_BYTES).unwrap();
            if is_coded {
                assert_eq!(turned(found), turned(mesh.clone()));
            } else {
                assert_eq!(found, mesh);
            }
            println!("{num_planes} planes: {vsl_bytes} bytes, as glTF {num_bytes}, coded: {is_coded}");
        }
    }
}

#[test]
fn a_viewer_finds_places_and_colors() {
    let folder = Folder::new();
    let path = folder.path("a.glb");
    let mesh = stack(3, 10, true).expand();
    write_glb(&path, &mesh, color, GlbOptions::default()).unwrap();
    let (document, blob) = parts(&std::fs::read(&path).unwrap());
    let numbers = |value: &Value| -> Vec<f64> {
        value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
    };
    let node = &document["nodes"][0];
    let (low, size) = (numbers(&node["translation"]), numbers(&node["scale"]));
    let decoded = mesh.to_mesh();
    for (at, vertex) in blob.chunks_exact(20).take(mesh.points.len()).enumerate() {
        let number = |byte: usize| f64::from(u16::from_le_bytes([vertex[byte], vertex[byte + 1]]));
        let point = decoded.points[at];
        for part in 0..3 {
            let world = low[part] + size[part] * number(2 * part);
            let expected = f64::from(point[part]) + mesh.origin.to_array()[part];
            assert!((world - expected).abs() < 1e-5, "{world}, expected {expected}");
        }
        let expected = color(f64::from(point[3])).map(|part| (part * 255.0).round() as u8);
        let off = (0..4).map(|part| vertex[12 + part].abs_diff(expected[part])).max().unwrap();
        assert!(off <= 1, "{:?}, expected {expected:?}", &vertex[12..16]);
    }
    // Slices are shown, the outline is not.
    assert_eq!(node["mesh"], 0);
    assert_eq!(document["meshes"][0]["name"], "slices");
    assert_eq!(document["meshes"][0]["primitives"].as_array().unwrap().len(), 10);
    assert_eq!(document["nodes"].as_array().unwrap().len(), 1);
    let surface = volery_io::read_mesh(&path, [1.0; 3], MAX_BYTES).unwrap().mesh;
    let slices = mesh.sheets.iter().filter(|sheet| sheet.thickness[1] == 0.0);
    assert_eq!(surface.triangles().len(), slices.map(|sheet| sheet.triangles.len()).sum::<usize>());
}

#[test]
fn a_stack_without_triangles_is_no_gltf() {
    let folder = Folder::new();
    let path = folder.path("a.glb");
    let error = write_glb(&path, &QuantizedMesh::default(), color, GlbOptions::default()).unwrap_err();
    assert!(error.to_string().ends_with("no slice has a triangle, expected at least one"), "{error}");
    assert!(!path.exists());
}

#[test]
fn what_gltf_says_is_not_believed() {
    let folder = Folder::new();
    let path = folder.path("a.glb");
    for is_coded in [false, true] {
        write_glb(&path, &stack(2, 5, true).expand(), color, GlbOptions { is_coded }).unwrap();
        let (document, blob) = parts(&std::fs::read(&path).unwrap());
        let with = |pointer: &str, value: Value| {
            let mut document = document.clone();
            *document.pointer_mut(pointer).unwrap_or_else(|| panic!("{pointer}")) = value;
            let path = folder.put("b.glb", glb(&document, &blob));
            refusal(read_stack(&path, MAX_BYTES), &path)
        };
        for (pointer, value, expected) in [
            ("/extras/volery", Value::Null, "extras.volery is missing"),
            ("/extras/volery/normal", [0, 0, 2].into(), "the normal is"),
            ("/extras/volery/scale", [1, 1, -1, 1].into(), "a step is -1.0"),
            ("/extras/volery/low", "low".into(), "the JSON is damaged"),
            ("/meshes", Value::Array(vec![]), "a primitive is missing"),
            ("/accessors/0/count", 7.into(), "count of accessor 1"),
            ("/accessors/0/count", (-7).into(), "the JSON is damaged"),
            ("/accessors/0/count", 1e18.into(), "the JSON is damaged"),
            ("/accessors/0/count", 1_000_000_000_000_000_000u64.into(), "needs 8000000000000000000 bytes"),
            ("/accessors/0/byteOffset", u64::MAX.into(), "a buffer view holds"),
            ("/accessors/0/componentType", 5126.into(), "componentType of accessor 0 is 5126"),
            ("/accessors/1/type", "VEC2".into(), "type of accessor 1 is 'VEC2'"),
            ("/accessors/4/bufferView", 9.into(), "bufferView is 9"),
            ("/accessors/4/count", 4.into(), "the number of indices is 4"),
            ("/accessors/4/byteOffset", 1_000_000.into(), "a buffer view holds"),
            ("/bufferViews/0/byteStride", 1.into(), "a buffer view holds"),
            (
                "/bufferViews/0/byteLength",
                1_000_000_000.into(),
                if is_coded { "count of EXT" } else { "the binary part" },
            ),
            ("/meshes/0/primitives/0/indices", 999.into(), "an accessor is 999"),
            ("/meshes/0/primitives/0/attributes", serde_json::json!({}), "POSITION"),
            ("/meshes/0/primitives/1/attributes/POSITION", 2.into(), "the attributes of a primitive"),
            ("/meshes/0/primitives/0/extras/thickness", [0].into(), "the JSON is damaged"),
        ] {
            let found = with(pointer, value.clone());
            let first = pointer == "/meshes/0/primitives/0/attributes" && found.contains("the attributes");
            assert!(found.contains(expected) || first, "{pointer} {value}: {found}, expected {expected}");
        }
        if !is_coded {
            // A vertex that is not there.
            let mut blob = blob.clone();
            let end = blob.len();
            blob[end - 4..].fill(255);
            let path = folder.put("b.glb", glb(&document, &blob));
            let found = refusal(read_stack(&path, MAX_BYTES), &path);
            assert!(found.contains("a vertex number is 4294967295"), "{found}");
        }
        let whole = std::fs::read(&path).unwrap();
        for end in (1..whole.len()).step_by(97) {
            let path = folder.put("b.glb", &whole[..end]);
            refusal(read_stack(&path, MAX_BYTES), &path);
        }
        let found = refusal(read_stack(&path, 1000), &path);
        assert!(found.contains("expected at most 1000"), "{found}");
    }
    for (bytes, expected) in
        [(&b"VSLICES\x02"[..], "the first bytes are"), (b"hello", "the first bytes are"), (b"", "is empty")]
    {
        let path = folder.put("c.vsl", bytes);
        let found = refusal(read_stack(&path, MAX_BYTES), &path);
        assert!(found.contains(expected), "{found}");
    }
}
