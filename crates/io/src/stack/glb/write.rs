//! Writes a stack as glTF.

use std::io::{self, Write};
use std::path::Path;

use meshoptimizer_rs::codec::{IndexEncoding, VertexEncoding, encode_index_buffer, encode_vertex_buffer};
use meshoptimizer_rs::{Limits, Workspace};
use serde_json::{Value, json};
use volery_slicing::{MeshSheet, Quantization, QuantizedMesh};

use super::{BYTE, GRADIENT, MESHOPT, UNSIGNED_BYTE, UNSIGNED_INT, UNSIGNED_SHORT, VALUE};
use crate::out::{WriteError, write_atomically};

/// How to write a `.glb`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GlbOptions {
    /// Compresses vertices and triangles by meshoptimizer's codecs: fewer bytes, fewer viewers.
    pub is_coded: bool,
}

/// Offsets of attributes in a vertex.
const VALUE_AT: usize = 8;
const COLOR_AT: usize = 12;
const GRADIENT_AT: usize = 16;

/// Writes a stack as binary glTF, where `color` makes straight linear RGB and opacity of a value; returns the number
/// of bytes.
///
/// # Errors
/// When the file cannot be written, or there is no triangle: glTF has no empty meshes.
pub fn write_glb(
    path: &Path,
    mesh: &QuantizedMesh,
    color: impl Fn(f64) -> [f64; 4],
    options: GlbOptions,
) -> Result<u64, WriteError> {
    let mut num_bytes = 0;
    write_atomically(path, |file| {
        if mesh.triangles.is_empty() {
            return Err(io::Error::other("no slice has a triangle, expected at least one"));
        }
        let views = [vertices(mesh, color), triangles(mesh)];
        let (blob, buffers, buffer_views) = if options.is_coded { coded(&views)? } else { plain(&views) };
        let text = document(mesh, options, buffers, buffer_views).to_string();
        num_bytes = write_chunks(file, text.into_bytes(), blob)?;
        Ok(())
    })?;
    Ok(num_bytes)
}

/// Things of one size, one after the other.
struct View {
    bytes: Vec<u8>,
    stride: usize,
    /// What a buffer of a device it is for.
    target: u32,
}

impl View {
    fn count(&self) -> usize {
        self.bytes.len() / self.stride
    }

    fn is_vertices(&self) -> bool {
        self.target == VERTICES
    }

    fn description(&self, buffer: usize, offset: usize) -> Value {
        let mut description = json!({
            "buffer": buffer, "byteOffset": offset, "byteLength": self.bytes.len(), "target": self.target,
        });
        if self.is_vertices() {
            description["byteStride"] = self.stride.into();
        }
        description
    }
}

const VERTICES: u32 = 34962;
const TRIANGLES: u32 = 34963;

fn vertices(mesh: &QuantizedMesh, color: impl Fn(f64) -> [f64; 4]) -> View {
    let stride = if mesh.gradients.is_empty() { GRADIENT_AT } else { GRADIENT_AT + 4 };
    // One colour for each value that there can be.
    let of_value = |value: u16| {
        let color = color(mesh.quantization.value([0, 0, 0, value]));
        // A cast keeps to the range, and makes 0 of what is no number.
        color.map(|part| (part * 255.0).round() as u8)
    };
    let colors: Vec<[u8; 4]> = (0..=u16::MAX).map(of_value).collect();
    let mut bytes = vec![0; stride * mesh.points.len()];
    for (at, (vertex, point)) in bytes.chunks_exact_mut(stride).zip(&mesh.points).enumerate() {
        for (number, bytes) in point[..3].iter().zip(vertex.chunks_exact_mut(2)) {
            bytes.copy_from_slice(&number.to_le_bytes());
        }
        vertex[VALUE_AT..VALUE_AT + 2].copy_from_slice(&point[3].to_le_bytes());
        vertex[COLOR_AT..COLOR_AT + 4].copy_from_slice(&colors[usize::from(point[3])]);
        if let Some(gradient) = mesh.gradients.get(at) {
            vertex[GRADIENT_AT..].copy_from_slice(&gradient.map(i8::cast_unsigned));
        }
    }
    View { bytes, stride, target: VERTICES }
}

fn triangles(mesh: &QuantizedMesh) -> View {
    let bytes = mesh.triangles.as_flattened().iter().flat_map(|vertex| vertex.to_le_bytes()).collect();
    View { bytes, stride: 4, target: TRIANGLES }
}

/// The views one after the other.
fn plain(views: &[View; 2]) -> (Vec<u8>, Value, Value) {
    let [vertices, triangles] = views;
    let blob = [&vertices.bytes[..], &triangles.bytes].concat();
    let buffers = json!([{ "byteLength": blob.len() }]);
    let descriptions = json!([vertices.description(0, 0), triangles.description(0, vertices.bytes.len())]);
    (blob, buffers, descriptions)
}

/// The views compressed, and a second buffer that is not there: it has room for what they are made into.
fn coded(views: &[View; 2]) -> io::Result<(Vec<u8>, Value, Value)> {
    let mut workspace = Workspace::new(Limits { max_bytes: usize::MAX, max_work: u64::MAX });
    let (mut blob, mut descriptions, mut offset) = (Vec::new(), Vec::new(), 0);
    for view in views {
        let count = view.count();
        let (coded, mode) = if view.is_vertices() {
            let encoding = VertexEncoding::new(0, 2).map_err(io::Error::other)?;
            let coded = encode_vertex_buffer(&view.bytes, count, view.stride, encoding, &mut workspace);
            (coded, "ATTRIBUTES")
        } else {
            let words: Vec<u32> =
                view.bytes.as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect();
            (encode_index_buffer(&words, IndexEncoding::DEFAULT, &mut workspace), "TRIANGLES")
        };
        let coded = coded.map_err(io::Error::other)?;
        let mut description = view.description(1, offset);
        description["extensions"][MESHOPT] = json!({
            "buffer": 0, "byteOffset": blob.len(), "byteLength": coded.len(), "byteStride": view.stride,
            "count": count, "mode": mode,
        });
        descriptions.push(description);
        offset += view.bytes.len();
        blob.extend(coded);
        blob.resize(blob.len().next_multiple_of(4), 0);
    }
    let fallback = json!({ "byteLength": offset, "extensions": { MESHOPT: { "fallback": true } } });
    Ok((blob.clone(), json!([{ "byteLength": blob.len() }, fallback]), descriptions.into()))
}

fn document(mesh: &QuantizedMesh, options: GlbOptions, buffers: Value, buffer_views: Value) -> Value {
    let Quantization { low, scale, magnitude_scale } = mesh.quantization;
    let num_vertices = mesh.points.len();
    let attribute = |offset: usize, number: u32, kind: &str| json!({ "bufferView": 0, "byteOffset": offset, "componentType": number, "count": num_vertices, "type": kind });
    let mut position = attribute(0, UNSIGNED_SHORT, "VEC3");
    let bound = |pick: fn(u16, u16) -> u16, from: u16| -> Vec<u16> {
        (0..3).map(|part| mesh.points.iter().map(|point| point[part]).fold(from, pick)).collect()
    };
    (position["min"], position["max"]) = (json!(bound(u16::min, u16::MAX)), json!(bound(u16::max, 0)));
    let mut color = attribute(COLOR_AT, UNSIGNED_BYTE, "VEC4");
    color["normalized"] = true.into();
    let mut accessors = vec![position, attribute(VALUE_AT, UNSIGNED_SHORT, "SCALAR"), color];
    let mut attributes = json!({ "POSITION": 0, VALUE: 1, "COLOR_0": 2 });
    if !mesh.gradients.is_empty() {
        attributes[GRADIENT] = accessors.len().into();
        accessors.push(attribute(GRADIENT_AT, BYTE, "VEC4"));
    }
    let mut meshes = [("slices", Vec::new()), ("outline", Vec::new())];
    for MeshSheet { position, thickness, triangles } in &mesh.sheets {
        if triangles.is_empty() {
            continue;
        }
        let [(_, slices), (_, outline)] = &mut meshes;
        (if thickness[1] == 0.0 { slices } else { outline }).push(json!({
            "attributes": attributes, "indices": accessors.len(), "material": 0,
            "extras": { "position": position, "thickness": thickness },
        }));
        accessors.push(json!({
            "bufferView": 1, "byteOffset": 12 * u64::from(triangles.start), "componentType": UNSIGNED_INT,
            "count": 3 * triangles.len(), "type": "SCALAR",
        }));
    }
    let meshes: Vec<Value> = meshes
        .into_iter()
        .filter(|(_, primitives)| !primitives.is_empty())
        .map(|(name, primitives)| json!({ "name": name, "primitives": primitives }))
        .collect();
    let mut used = vec!["KHR_mesh_quantization"];
    used.extend(options.is_coded.then_some(MESHOPT));
    let required = used.clone();
    used.push("KHR_materials_unlit");
    let low_in_world = mesh.origin + glam::DVec3::new(low[0].into(), low[1].into(), low[2].into());
    // A node of no size would be shown nowhere; where all numbers are 0, any size does.
    let size = [0, 1, 2].map(|part| if scale[part] > 0.0 { scale[part] } else { 1.0 });
    json!({
        "asset": { "version": "2.0", "generator": "Volery" },
        "extensionsUsed": used, "extensionsRequired": required,
        "scene": 0, "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0, "translation": low_in_world.to_array(), "scale": size }],
        "meshes": meshes,
        "materials": [{
            "alphaMode": "BLEND", "doubleSided": true, "extensions": { "KHR_materials_unlit": {} },
            "pbrMetallicRoughness": { "metallicFactor": 0, "roughnessFactor": 1 },
        }],
        "accessors": accessors, "buffers": buffers, "bufferViews": buffer_views,
        "extras": { "volery": {
            "normal": mesh.normal.to_array(), "origin": mesh.origin.to_array(), "low": low, "scale": scale,
            "magnitude_scale": magnitude_scale,
        } },
    })
}

/// Writes the text and the binary part; returns the number of bytes.
fn write_chunks(file: &mut impl Write, mut text: Vec<u8>, mut blob: Vec<u8>) -> io::Result<u64> {
    text.resize(text.len().next_multiple_of(4), b' ');
    blob.resize(blob.len().next_multiple_of(4), 0);
    let length = 12 + 8 + text.len() as u64 + 8 + blob.len() as u64;
    let too_large = || io::Error::other(format!("{length} bytes, expected at most {}", u32::MAX));
    let word = u32::try_from(length).map_err(|_| too_large())?;
    file.write_all(super::super::GLB_MAGIC)?;
    file.write_all(&2u32.to_le_bytes())?;
    file.write_all(&word.to_le_bytes())?;
    for (kind, content) in [(b"JSON", text), (b"BIN\0", blob)] {
        file.write_all(&(content.len() as u32).to_le_bytes())?;
        file.write_all(kind)?;
        file.write_all(&content)?;
    }
    Ok(length)
}
