//! Reads a stack from glTF that Volery wrote.

use std::borrow::Cow;
use std::collections::BTreeMap;

use meshoptimizer_rs::codec::{Filter, Mode, decode_buffer_view};
use meshoptimizer_rs::{Limits, Workspace};
use serde::Deserialize;
use volery_slicing::{MeshSheet, Quantization, QuantizedMesh, check_frame, check_sheets};

use super::{BYTE, GRADIENT, MESHOPT, UNSIGNED_INT, UNSIGNED_SHORT, VALUE};
use crate::bytes::reserve;
use crate::error::{Problem, quoted};
use crate::mesh::gltf::chunks;

/// Bytes of JSON; a primitive has about two hundred.
const MAX_TEXT_BYTES: usize = 64 << 20;

/// What is read of the JSON.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Document {
    #[serde(default)]
    meshes: Vec<Mesh>,
    #[serde(default)]
    accessors: Vec<Accessor>,
    #[serde(default)]
    buffer_views: Vec<BufferView>,
    #[serde(default)]
    extras: FileExtras,
}

#[derive(Default, Deserialize)]
struct FileExtras {
    volery: Option<Frame>,
}

/// Beside what glTF knows.
#[derive(Deserialize)]
struct Frame {
    normal: [f64; 3],
    origin: [f64; 3],
    low: [f32; 4],
    scale: [f32; 4],
    magnitude_scale: f32,
}

#[derive(Deserialize)]
struct Mesh {
    primitives: Vec<Primitive>,
}

#[derive(Deserialize)]
struct Primitive {
    attributes: BTreeMap<String, usize>,
    indices: Option<usize>,
    mode: Option<u32>,
    extras: SheetExtras,
}

#[derive(Deserialize)]
struct SheetExtras {
    position: f64,
    thickness: [f64; 2],
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Accessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: u64,
    component_type: u32,
    count: u64,
    #[serde(rename = "type")]
    kind: String,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct BufferView {
    buffer: usize,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    byte_stride: Option<u64>,
    #[serde(default)]
    extensions: ViewExtensions,
}

#[derive(Default, Deserialize)]
struct ViewExtensions {
    #[serde(rename = "EXT_meshopt_compression")]
    coded: Option<Coded>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Coded {
    buffer: usize,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    byte_stride: u64,
    count: u64,
    mode: String,
    filter: Option<String>,
}

/// Numbers of one type, evenly spaced.
struct Numbers<'a> {
    bytes: &'a [u8],
    stride: usize,
    count: usize,
}

impl Numbers<'_> {
    /// The numbers of one element after another.
    fn each<const BYTES: usize>(&self) -> impl Iterator<Item = [u8; BYTES]> {
        // In range: `Views::numbers` has compared the last with the length.
        (0..self.count).map(|at| std::array::from_fn(|byte| self.bytes[at * self.stride + byte]))
    }
}

pub(in super::super) fn read(bytes: &[u8], max_bytes: u64) -> Result<QuantizedMesh, Problem> {
    let (text, blob) = chunks(bytes)?;
    if text.len() > MAX_TEXT_BYTES {
        return Err(Problem::field("bytes of JSON", text.len(), format!("at most {MAX_TEXT_BYTES}")));
    }
    let document: Document =
        serde_json::from_slice(text).map_err(|error| Problem::damaged("the JSON", error))?;
    let Some(frame) = &document.extras.volery else {
        return Err(Problem::missing("extras.volery", "a stack of slices that Volery wrote"));
    };
    let mut mesh = QuantizedMesh {
        normal: frame.normal.into(),
        origin: frame.origin.into(),
        quantization: Quantization {
            low: frame.low,
            scale: frame.scale,
            magnitude_scale: frame.magnitude_scale,
        },
        ..QuantizedMesh::default()
    };
    check_frame(mesh.normal, mesh.origin, &mesh.quantization).map_err(Problem::Slices)?;
    let mut primitives: Vec<&Primitive> = document.meshes.iter().flat_map(|mesh| &mesh.primitives).collect();
    // Sheets at one position in the order in which their triangles lie in the file.
    let offset = |primitive: &Primitive| Some(document.accessors.get(primitive.indices?)?.byte_offset);
    let position = |primitive: &Primitive| primitive.extras.position;
    primitives.sort_by(|a, b| position(a).total_cmp(&position(b)).then_with(|| offset(a).cmp(&offset(b))));
    let Some(&first) = primitives.first() else {
        return Err(Problem::missing("a primitive", "at least one slice"));
    };
    let mut reader = Reader {
        document: &document,
        blob: blob.unwrap_or_default(),
        views: BTreeMap::new(),
        left: max_bytes,
        max_bytes,
    };
    reader.vertices(&first.attributes, &mut mesh)?;
    for primitive in primitives {
        if primitive.attributes != first.attributes {
            return Err(Problem::field("the attributes of a primitive", "others", "those of the first"));
        }
        reader.sheet(primitive, &mut mesh)?;
    }
    check_sheets(&mesh.sheets, mesh.triangles.len()).map_err(Problem::Slices)?;
    Ok(mesh)
}

struct Reader<'a> {
    document: &'a Document,
    blob: &'a [u8],
    /// What has been decompressed, by number.
    views: BTreeMap<usize, Cow<'a, [u8]>>,
    /// Bytes that may still be allocated.
    left: u64,
    max_bytes: u64,
}

impl<'a> Reader<'a> {
    fn vertices(
        &mut self,
        attributes: &BTreeMap<String, usize>,
        mesh: &mut QuantizedMesh,
    ) -> Result<(), Problem> {
        let of = |name: &str| {
            attributes
                .get(name)
                .copied()
                .ok_or_else(|| Problem::missing(format!("attribute {name}"), "an accessor"))
        };
        let (position, value) = (of("POSITION")?, of(VALUE)?);
        let count = self.accessor(position)?.count;
        self.charge(count, 8)?;
        let positions = self.numbers(position, UNSIGNED_SHORT, "VEC3", count)?;
        let place = |bytes: [u8; 6]| [0, 2, 4].map(|at| u16::from_le_bytes([bytes[at], bytes[at + 1]]));
        reserve(&mut mesh.points, positions.count)?;
        mesh.points.extend(positions.each::<6>().map(place).map(|[x, y, z]| [x, y, z, 0]));
        let values = self.numbers(value, UNSIGNED_SHORT, "SCALAR", count)?;
        for (point, value) in mesh.points.iter_mut().zip(values.each::<2>()) {
            point[3] = u16::from_le_bytes(value);
        }
        if let Some(&gradient) = attributes.get(GRADIENT) {
            self.charge(count, 4)?;
            let gradients = self.numbers(gradient, BYTE, "VEC4", count)?;
            reserve(&mut mesh.gradients, gradients.count)?;
            mesh.gradients.extend(gradients.each::<4>().map(|bytes| bytes.map(u8::cast_signed)));
        }
        Ok(())
    }

    fn sheet(&mut self, primitive: &Primitive, mesh: &mut QuantizedMesh) -> Result<(), Problem> {
        if primitive.mode.is_some_and(|mode| mode != 4) {
            return Err(Problem::field("mode of a primitive", primitive.mode.unwrap_or(4), "4, triangles"));
        }
        let indices =
            primitive.indices.ok_or_else(|| Problem::missing("indices of a primitive", "an accessor"))?;
        let count = self.accessor(indices)?.count;
        if !count.is_multiple_of(3) {
            return Err(Problem::field("the number of indices", count, "a multiple of 3"));
        }
        self.charge(count, 4)?;
        let start = mesh.triangles.len();
        let numbers = self.numbers(indices, UNSIGNED_INT, "SCALAR", count)?;
        reserve_amortised(&mut mesh.triangles, numbers.count / 3)?;
        let mut corners = numbers.each::<4>().map(u32::from_le_bytes);
        while let (Some(a), Some(b), Some(c)) = (corners.next(), corners.next(), corners.next()) {
            mesh.triangles.push([a, b, c]);
        }
        let largest = mesh.triangles[start..].as_flattened().iter().copied().max();
        if let Some(found) = largest.filter(|&vertex| vertex as usize >= mesh.points.len()) {
            return Err(Problem::field("a vertex number", found, format!("below {}", mesh.points.len())));
        }
        let number = |count: usize| {
            u32::try_from(count).map_err(|_| Problem::field("the number of triangles", count, "32 bits"))
        };
        let triangles = number(start)?..number(mesh.triangles.len())?;
        let SheetExtras { position, thickness } = primitive.extras;
        mesh.sheets.push(MeshSheet { position, thickness, triangles });
        Ok(())
    }

    /// Counts what is going to be allocated.
    fn charge(&mut self, count: u64, bytes: u64) -> Result<(), Problem> {
        let required = u128::from(count) * u128::from(bytes);
        match u64::try_from(required).ok().and_then(|required| self.left.checked_sub(required)) {
            Some(left) => self.left = left,
            None => {
                let required = u128::from(self.max_bytes - self.left) + required;
                return Err(Problem::TooLarge { required, max: self.max_bytes });
            }
        }
        Ok(())
    }

    fn accessor(&self, index: usize) -> Result<&'a Accessor, Problem> {
        let accessors = &self.document.accessors;
        accessors
            .get(index)
            .ok_or_else(|| Problem::field("an accessor", index, format!("below {}", accessors.len())))
    }

    /// What an accessor names, if it is that.
    fn numbers(
        &mut self,
        index: usize,
        component_type: u32,
        kind: &'static str,
        count: u64,
    ) -> Result<Numbers<'_>, Problem> {
        let accessor = self.accessor(index)?;
        let of = |what: &str| format!("{what} of accessor {index}");
        if accessor.component_type != component_type {
            return Err(Problem::field(of("componentType"), accessor.component_type, component_type));
        }
        if accessor.kind != kind {
            return Err(Problem::field(of("type"), quoted(&accessor.kind), kind));
        }
        if accessor.count != count {
            return Err(Problem::field(of("count"), accessor.count, count));
        }
        let view = accessor.buffer_view.ok_or_else(|| Problem::missing(of("bufferView"), "a number"))?;
        let components = match kind {
            "SCALAR" => 1,
            "VEC3" => 3,
            _ => 4,
        };
        let size = components
            * if component_type == UNSIGNED_INT {
                4
            } else {
                u64::from(component_type == UNSIGNED_SHORT) + 1
            };
        let stride = self.view(view)?.byte_stride.unwrap_or(size);
        let content = self.content(view)?;
        let end = count.checked_sub(1).map_or(Some(0), |last| {
            last.checked_mul(stride)?.checked_add(size)?.checked_add(accessor.byte_offset)
        });
        let end = end.unwrap_or(u64::MAX);
        if end > content.len() as u64 || stride < size {
            return Err(Problem::Size { what: "a buffer view", found: content.len() as u64, expected: end });
        }
        // In range: at most the length of what is there.
        let bytes = &content[(accessor.byte_offset as usize).min(content.len())..];
        Ok(Numbers { bytes, stride: stride as usize, count: count as usize })
    }

    fn view(&self, index: usize) -> Result<&'a BufferView, Problem> {
        let views = &self.document.buffer_views;
        views.get(index).ok_or_else(|| Problem::field("bufferView", index, format!("below {}", views.len())))
    }

    /// The bytes of a view, decompressed if they are not.
    fn content(&mut self, index: usize) -> Result<&[u8], Problem> {
        if !self.views.contains_key(&index) {
            let view = self.view(index)?;
            let content = match &view.extensions.coded {
                None => self.part(view.buffer, view.byte_offset, view.byte_length)?.into(),
                Some(coded) => self.decoded(coded, view.byte_length)?.into(),
            };
            self.views.insert(index, content);
        }
        Ok(&self.views[&index])
    }

    fn part(&self, buffer: usize, offset: u64, length: u64) -> Result<&'a [u8], Problem> {
        if buffer != 0 {
            return Err(Problem::field("buffer", buffer, "0, the binary part of the file"));
        }
        let size = self.blob.len() as u64;
        let end = offset.checked_add(length).filter(|&end| end <= size);
        let end = end.ok_or(Problem::Size {
            what: "the binary part",
            found: size,
            expected: offset.saturating_add(length),
        })?;
        Ok(&self.blob[offset as usize..end as usize])
    }

    fn decoded(&mut self, coded: &Coded, length: u64) -> Result<Vec<u8>, Problem> {
        let of = |what: &str| format!("{what} of {MESHOPT}");
        let mode = match coded.mode.as_str() {
            "ATTRIBUTES" => Mode::Attributes,
            "TRIANGLES" => Mode::Triangles,
            other => return Err(Problem::field(of("mode"), quoted(other), "ATTRIBUTES or TRIANGLES")),
        };
        if let Some(filter) = coded.filter.as_ref().filter(|filter| *filter != "NONE") {
            return Err(Problem::field(of("filter"), quoted(filter), "NONE"));
        }
        if coded.count.checked_mul(coded.byte_stride) != Some(length) {
            return Err(Problem::field(of("count"), coded.count, format!("as many as make {length} bytes")));
        }
        self.charge(coded.count, coded.byte_stride)?;
        let source = self.part(coded.buffer, coded.byte_offset, coded.byte_length)?;
        let mut workspace = Workspace::new(Limits { max_bytes: length as usize, max_work: u64::MAX });
        let (count, stride) = (coded.count as usize, coded.byte_stride as usize);
        decode_buffer_view(mode, Filter::None, count, stride, source, &mut workspace)
            .map_err(|error| Problem::damaged("a compressed buffer view", error))
    }
}

/// Room for more, and for as many again.
fn reserve_amortised<T>(values: &mut Vec<T>, more: usize) -> Result<(), Problem> {
    if values.capacity() - values.len() < more { reserve(values, more.max(values.len())) } else { Ok(()) }
}
