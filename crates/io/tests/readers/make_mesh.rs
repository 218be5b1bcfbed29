//! Files of meshes made by hand.

/// The corners of a unit square and a point above it.
pub(crate) const POINTS: [[f32; 3]; 5] =
    [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.5, 2.0]];

/// A pyramid: a square and four triangles, in every way of naming points, with all that is to be ignored.
pub(crate) const OBJ: &str = "# Caf\u{e9}\nmtllib none.mtl\no pyramid\nv 0 0 0\nv 1 0 0 1\nv 2 2 0 2\n\
    v 0 1 0 0.5 0.5 0.5\nv 0.5 0.5 \\\n 2\nvn 0 0 1\nvt 0 0\nusemtl none\ns off\nf 1/1/1 2/1/1 3/1/1 4/1/1\n\
    f -5 -4 -1\nf 2//1 3//1 5//1\ng side\nf 3/1 4/1 5/1\nf 4 1 5\nl 1 2 3\np 1 2\n";

/// A glTF file as JSON, and the bytes of its buffer: a square of floats under 32-bit indices, and a strip of
/// normalised 16-bit integers, each twice.
pub(crate) fn gltf(buffer: &str) -> (String, Vec<u8>) {
    let mut bytes: Vec<u8> = POINTS.as_flattened().iter().flat_map(|x| x.to_le_bytes()).collect();
    bytes.extend([0_u32, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    // At 84: x, y, z and two bytes of padding, four times.
    for [x, y] in [[0_u16, 0], [65535, 0], [0, 65535], [65535, 65535]] {
        bytes.extend([x, y, 0, 0].iter().flat_map(|i| i.to_le_bytes()));
    }
    let text = format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0, 3]}}],
        "extensionsUsed": ["KHR_mesh_quantization"], "extensionsRequired": ["KHR_mesh_quantization"],
        "nodes": [{{"children": [1, 2], "translation": [10, 0, 0]}},
                  {{"mesh": 0, "scale": [2, 2, 2], "rotation": [0, 0, 0.70710678118654752, 0.70710678118654752]}},
                  {{"mesh": 1, "matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,5,1]}},
                  {{"mesh": 1, "skin": 0}}],
        "skins": [{{"joints": [0]}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "indices": 1}},
                                    {{"attributes": {{"POSITION": 0}}, "mode": 0}},
                                    {{"attributes": {{"POSITION": 0}}, "mode": 3}}]}},
                   {{"primitives": [{{"attributes": {{"POSITION": 2}}, "mode": 5}}]}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}},
                      {{"bufferView": 0, "byteOffset": 60, "componentType": 5125, "count": 6, "type": "SCALAR"}},
                      {{"bufferView": 1, "componentType": 5123, "normalized": true, "count": 4, "type": "VEC3"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 84}},
                        {{"buffer": 0, "byteOffset": 84, "byteLength": 32, "byteStride": 8}}],
        "buffers": [{{{buffer}"byteLength": 116}}]}}"#
    );
    (text, bytes)
}

/// A binary file of these two parts.
pub(crate) fn glb(text: &str, bytes: &[u8]) -> Vec<u8> {
    let pad = |bytes: &[u8], with: u8| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), with);
        bytes
    };
    let mut chunks = Vec::new();
    for (kind, content) in [(b"JSON", pad(text.as_bytes(), b' ')), (b"BIN\0", pad(bytes, 0))] {
        chunks.extend((content.len() as u32).to_le_bytes());
        chunks.extend(kind);
        chunks.extend(content);
    }
    let mut file = b"glTF".to_vec();
    file.extend(2_u32.to_le_bytes());
    file.extend((chunks.len() as u32 + 12).to_le_bytes());
    file.extend(chunks);
    file
}
