//! A [`CompactMesh`] as bytes: what a `.vsl` file holds, and what a server sends.
//!
//! # Method
//! The numbers are put into streams of one kind each, and each stream is compressed by Zstandard:
//! - *head*: counts, normal, origin, quantisation, planes and sheets, as they are;
//! - *nodes*: each of the eight or twelve bytes of a node on its own, the difference from the node before;
//! - *lows*, *spans*, *planes*: of each vertex the difference of its lower node from that of the vertex before, the
//!   way to its higher node, and the difference of its plane, seven bits a byte, the last of them with the high bit
//!   clear;
//! - *triangles*: by meshoptimizer's index codec, which mostly finds two vertices of a triangle among the sides of the
//!   last sixteen, and the third as the next one never seen.
//!
//! The byte order is little endian. Eight bytes of magic and version are followed by the streams, each after its
//! length in 64 bits, each a Zstandard frame with its checksum.
//!
//! # Guarantees
//! What is decoded has the bits of what was encoded, but a triangle may start at another of its corners. Nothing that
//! is decoded is believed: a stream is stored as it comes and never beyond what the head allows, the head never beyond
//! a limit that the caller gives; every number names something that exists.
//!
//! # Limits
//! Vertices of a mesh whose makers are not known ([`CompactMesh::of_vertices`]) cost as much as nodes.

use std::io::Read;

use glam::DVec3;
use meshoptimizer_rs::codec::{IndexEncoding, decode_index_buffer_into, encode_index_buffer};

use crate::compact::{CompactMesh, Place, workspace};
use crate::mesh::MeshSheet;
use crate::quantize::Quantization;

/// Format and version.
const MAGIC: [u8; 8] = *b"VSLICES\x01";

/// Of Zstandard: beyond it bytes hardly fall, and time grows.
const LEVEL: i32 = 9;

/// Bytes of the head before planes and sheets.
const HEAD_BYTES: usize = 6 * 4 + 6 * 8 + 9 * 4;

/// Bytes of a sheet in the head.
const SHEET_BYTES: usize = 3 * 8 + 4;

/// Bytes that are no mesh.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// They start as something else.
    #[error("slices: the first bytes are {found:?}, expected {MAGIC:?}")]
    Magic {
        /// The bytes that there are, eight at most.
        found: Vec<u8>,
    },
    /// They end too soon, or go on.
    #[error("slices: the stream {stream} has {found} bytes, expected {expected}")]
    Size {
        /// Which part.
        stream: &'static str,
        /// How many there are; of one that goes on, one too many.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
    /// A stream that does not decompress.
    #[error("slices: the stream {stream} is damaged: {message}")]
    Damaged {
        /// Which part.
        stream: &'static str,
        /// What its decoder says.
        message: String,
    },
    /// A number that cannot be.
    #[error("slices: {what} is {found}, expected {expected}")]
    Number {
        /// Which.
        what: &'static str,
        /// As found.
        found: String,
        /// What would be right.
        expected: String,
    },
    /// A mesh larger than the caller allows.
    #[error("slices: the mesh needs {required} bytes, expected at most {max}")]
    TooLarge {
        /// Bytes of nodes, vertices, triangles and sheets, and of the mesh in full.
        required: u64,
        /// Bytes allowed.
        max: u64,
    },
}

fn wrong(what: &'static str, found: impl ToString, expected: impl ToString) -> Error {
    Error::Number { what, found: found.to_string(), expected: expected.to_string() }
}

impl CompactMesh {
    /// The mesh as bytes.
    ///
    /// # Panics
    /// When there is no memory.
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        let mut push = |stream: Vec<u8>| {
            let frame = compress(&stream);
            bytes.extend((frame.len() as u64).to_le_bytes());
            bytes.extend(frame);
        };
        push(self.head());
        push(node_planes(&self.nodes, &self.gradients));
        push(sevens(differences(self.vertices.iter().map(|place| place.nodes[0]))));
        push(sevens(self.vertices.iter().map(|place| place.nodes[1].wrapping_sub(place.nodes[0]))));
        push(sevens(differences(self.vertices.iter().map(|place| place.plane))));
        let corners = self.triangles.as_flattened();
        let coded = encode_index_buffer(corners, IndexEncoding::DEFAULT, &mut workspace());
        push(coded.expect("whole triangles, and no limit"));
        bytes
    }

    fn head(&self) -> Vec<u8> {
        let Self { normal, origin, quantization, nodes, gradients, planes, vertices, triangles, sheets } =
            self;
        let counts =
            [nodes.len(), gradients.len(), planes.len(), vertices.len(), triangles.len(), sheets.len()];
        let mut head: Vec<u8> = counts.iter().flat_map(|&count| (count as u32).to_le_bytes()).collect();
        let Quantization { low, scale, magnitude_scale } = quantization;
        head.extend(normal.to_array().iter().chain(&origin.to_array()).flat_map(|part| part.to_le_bytes()));
        let numbers = low.iter().chain(scale).chain([magnitude_scale]);
        head.extend(numbers.flat_map(|part| part.to_le_bytes()));
        head.extend(planes.iter().flat_map(|plane| plane.to_le_bytes()));
        for sheet in sheets {
            let numbers = [sheet.position, sheet.thickness[0], sheet.thickness[1]];
            head.extend(numbers.iter().flat_map(|part| part.to_le_bytes()));
            head.extend(sheet.triangles.end.to_le_bytes());
        }
        head
    }

    /// The mesh that was encoded, if it needs at most `max_bytes` of memory, [expanded](Self::expand) or not.
    ///
    /// # Errors
    /// When the bytes are no such mesh, or one that needs more.
    pub fn decode(bytes: &[u8], max_bytes: u64) -> Result<Self, Error> {
        let found = bytes.get(..MAGIC.len()).unwrap_or(bytes);
        if found != MAGIC {
            return Err(Error::Magic { found: found.to_vec() });
        }
        let mut rest = &bytes[MAGIC.len()..];
        let frames = STREAMS.map(|stream| take_frame(&mut rest, stream));
        let [head, nodes, lows, spans, planes, triangles] = frames;
        if !rest.is_empty() {
            return Err(Error::Size { stream: "after the last", found: rest.len(), expected: 0 });
        }
        let (mut mesh, counts) = Self::of_head(&head?.all(max_bytes)?, max_bytes)?;
        let Counts { nodes: num_nodes, gradients: num_gradients, vertices: num_vertices, .. } = counts;
        let (nodes, (vertices, triangles)) = rayon::join(
            || {
                let bytes = nodes?.exactly(8 * num_nodes + 4 * num_gradients)?;
                Ok((nodes_of(&bytes, num_nodes), gradients_of(&bytes[8 * num_nodes..], num_gradients)))
            },
            || {
                rayon::join(
                    || vertices_of([lows?, spans?, planes?], num_vertices, num_nodes, counts.planes),
                    || triangles_of(&triangles?, counts.triangles, num_vertices),
                )
            },
        );
        (mesh.nodes, mesh.gradients) = nodes?;
        (mesh.vertices, mesh.triangles) = (vertices?, triangles?);
        Ok(mesh)
    }

    /// What the head says, without the rest.
    fn of_head(head: &[u8], max_bytes: u64) -> Result<(Self, Counts), Error> {
        let size = |expected| Error::Size { stream: "head", found: head.len(), expected };
        let (fixed, rest) = head.split_at_checked(HEAD_BYTES).ok_or_else(|| size(HEAD_BYTES))?;
        let counts = Counts::new(fixed)?;
        let expected = HEAD_BYTES as u64 + 8 * counts.planes as u64 + (SHEET_BYTES * counts.sheets) as u64;
        if head.len() as u64 != expected {
            return Err(size(expected as usize));
        }
        let required = counts.num_bytes();
        if required > max_bytes {
            return Err(Error::TooLarge { required, max: max_bytes });
        }
        let f64_at = |bytes: &[u8], at: usize| f64::from_le_bytes(array(&bytes[8 * at..]));
        let f32_at = |at: usize| f32::from_le_bytes(array(&fixed[72 + 4 * at..]));
        let vector = |at: usize| DVec3::from_array([0, 1, 2].map(|part| f64_at(&fixed[24..], at + part)));
        let quantization = Quantization {
            low: [0, 1, 2, 3].map(f32_at),
            scale: [4, 5, 6, 7].map(f32_at),
            magnitude_scale: f32_at(8),
        };
        let (planes, sheets) = rest.split_at(8 * counts.planes);
        let planes = (0..counts.planes).map(|plane| f64_at(planes, plane)).collect();
        let mut start = 0;
        let sheet = |bytes: &[u8]| {
            let end = u32::from_le_bytes(array(&bytes[24..]));
            let triangles = std::mem::replace(&mut start, end)..end;
            MeshSheet {
                position: f64_at(bytes, 0),
                thickness: [f64_at(bytes, 1), f64_at(bytes, 2)],
                triangles,
            }
        };
        let sheets = sheets.chunks_exact(SHEET_BYTES).map(sheet).collect();
        let (normal, origin) = (vector(0), vector(3));
        let mesh = Self { normal, origin, quantization, planes, sheets, ..Self::default() };
        mesh.check_head(counts.triangles)?;
        Ok((mesh, counts))
    }

    fn check_head(&self, num_triangles: usize) -> Result<(), Error> {
        check_frame(self.normal, self.origin, &self.quantization)?;
        if let Some(plane) = self.planes.iter().find(|plane| !plane.is_finite()) {
            return Err(wrong("a plane", format_args!("{plane:?}"), "a finite number"));
        }
        check_sheets(&self.sheets, num_triangles)
    }
}

/// Finds what no mesh has: a normal of another length than 1, numbers that are not finite, negative steps.
///
/// # Errors
/// Says the first.
pub fn check_frame(normal: DVec3, origin: DVec3, quantization: &Quantization) -> Result<(), Error> {
    if (normal.length() - 1.0).abs() > 1e-6 || !normal.is_finite() {
        return Err(wrong("the normal", format_args!("{normal:?}"), "a vector of length 1"));
    }
    if !origin.is_finite() {
        return Err(wrong("the origin", format_args!("{origin:?}"), "finite coordinates"));
    }
    let Quantization { low, scale, magnitude_scale } = quantization;
    if let Some(low) = low.iter().find(|low| !low.is_finite()) {
        return Err(wrong("the least number", format_args!("{low:?}"), "a finite number"));
    }
    let mut steps = scale.iter().chain([magnitude_scale]);
    match steps.find(|&&step| !(step >= 0.0 && step.is_finite())) {
        Some(step) => Err(wrong("a step", format_args!("{step:?}"), "a finite number of at least 0")),
        None => Ok(()),
    }
}

/// Finds sheets that are none: by descending position, without every triangle, or with numbers that are not finite.
///
/// # Errors
/// Says the first.
pub fn check_sheets(sheets: &[MeshSheet], num_triangles: usize) -> Result<(), Error> {
    let (mut end, mut position) = (0, f64::NEG_INFINITY);
    for sheet in sheets {
        if !(sheet.position >= position && sheet.position.is_finite()) {
            return Err(wrong(
                "the position of a sheet",
                format_args!("{:?}", sheet.position),
                "finite numbers that ascend",
            ));
        }
        if let Some(part) = sheet.thickness.iter().find(|part| !part.is_finite()) {
            return Err(wrong("the thickness of a sheet", format_args!("{part:?}"), "a finite number"));
        }
        let range = &sheet.triangles;
        if range.start != end || range.end < end || range.end as usize > num_triangles {
            return Err(wrong("the end of a sheet", range.end, format!("{end} to {num_triangles}")));
        }
        (end, position) = (range.end, sheet.position);
    }
    if end as usize == num_triangles {
        Ok(())
    } else {
        Err(wrong("the end of the sheets", end, num_triangles))
    }
}

/// Names of the streams, in their order.
const STREAMS: [&str; 6] = ["head", "nodes", "lows", "spans", "planes", "triangles"];

/// What the head says of the rest.
#[derive(Clone, Copy)]
struct Counts {
    nodes: usize,
    gradients: usize,
    planes: usize,
    vertices: usize,
    triangles: usize,
    sheets: usize,
}

impl Counts {
    fn new(head: &[u8]) -> Result<Self, Error> {
        let at = |at: usize| u32::from_le_bytes(array(&head[4 * at..])) as usize;
        let [nodes, gradients, planes, vertices, triangles, sheets] = [0, 1, 2, 3, 4, 5].map(at);
        if gradients != 0 && gradients != nodes {
            return Err(wrong("the number of gradients", gradients, format!("0 or {nodes}")));
        }
        Ok(Self { nodes, gradients, planes, vertices, triangles, sheets })
    }

    /// Of the compact and of the whole mesh.
    fn num_bytes(&self) -> u64 {
        let gradient = if self.gradients > 0 { 4 } else { 0 };
        let parts = [
            (self.nodes, 8 + gradient),
            (self.planes, 8),
            (self.vertices, size_of::<Place>() + 8 + gradient),
            (self.triangles, 12),
            (self.sheets, size_of::<MeshSheet>()),
        ];
        parts.iter().map(|&(count, bytes)| count as u64 * bytes as u64).sum()
    }
}

/// The first bytes of more.
fn array<const N: usize>(bytes: &[u8]) -> [u8; N] {
    std::array::from_fn(|at| bytes[at])
}

fn compress(stream: &[u8]) -> Vec<u8> {
    let compressed = zstd::bulk::Compressor::new(LEVEL).and_then(|mut compressor| {
        compressor.include_checksum(true)?;
        compressor.compress(stream)
    });
    compressed.expect("a level that exists, and as much room as it asks for")
}

/// A stream as it lies there.
struct Frame<'a> {
    stream: &'static str,
    bytes: &'a [u8],
}

/// Cuts a frame off.
fn take_frame<'a>(rest: &mut &'a [u8], stream: &'static str) -> Result<Frame<'a>, Error> {
    let size = |found, expected| Error::Size { stream, found, expected };
    let (length, after) = rest.split_at_checked(8).ok_or_else(|| size(rest.len(), 8))?;
    let length = usize::try_from(u64::from_le_bytes(array(length))).unwrap_or(usize::MAX);
    let (bytes, after) = after.split_at_checked(length).ok_or_else(|| size(after.len(), length))?;
    *rest = after;
    Ok(Frame { stream, bytes })
}

impl Frame<'_> {
    /// What it holds, at most so many bytes.
    fn all(&self, max_bytes: u64) -> Result<Vec<u8>, Error> {
        let Self { stream, bytes } = *self;
        let damaged = |error: std::io::Error| Error::Damaged { stream, message: error.to_string() };
        let mut content = Vec::new();
        let decoder = zstd::Decoder::with_buffer(bytes).map_err(damaged)?;
        // One more shows that there are more; the end also makes the decoder compare the checksum.
        decoder.take(max_bytes.saturating_add(1)).read_to_end(&mut content).map_err(damaged)?;
        if content.len() as u64 > max_bytes {
            let expected = usize::try_from(max_bytes).unwrap_or(usize::MAX);
            return Err(Error::Size { stream, found: content.len(), expected });
        }
        Ok(content)
    }

    fn exactly(&self, expected: usize) -> Result<Vec<u8>, Error> {
        let content = self.all(expected as u64)?;
        let found = content.len();
        if found == expected {
            Ok(content)
        } else {
            Err(Error::Size { stream: self.stream, found, expected })
        }
    }
}

/// Each byte of a node on its own, as the difference from the node before; likewise gradients.
fn node_planes(nodes: &[[u16; 4]], gradients: &[[i8; 4]]) -> Vec<u8> {
    let mut planes = Vec::with_capacity(8 * nodes.len() + 4 * gradients.len());
    for part in 0..4 {
        let parts = || std::iter::once(0).chain(nodes.iter().map(|node| node[part]));
        let differences: Vec<u16> = parts()
            .zip(parts().skip(1))
            .map(|(before, x)| {
                let difference = x.wrapping_sub(before).cast_signed();
                (difference << 1 ^ difference >> 15).cast_unsigned()
            })
            .collect();
        planes.extend(differences.iter().map(|x| *x as u8));
        planes.extend(differences.iter().map(|x| (x >> 8) as u8));
    }
    for part in 0..4 {
        let parts = || std::iter::once(0).chain(gradients.iter().map(|gradient| gradient[part]));
        planes.extend(parts().zip(parts().skip(1)).map(|(before, x)| x.wrapping_sub(before).cast_unsigned()));
    }
    planes
}

fn nodes_of(planes: &[u8], count: usize) -> Vec<[u16; 4]> {
    let mut nodes = vec![[0; 4]; count];
    for part in 0..4 {
        let (low, high) = planes[2 * part * count..][..2 * count].split_at(count);
        let mut sum = 0u16;
        for ((node, &low), &high) in nodes.iter_mut().zip(low).zip(high) {
            let difference = u16::from_le_bytes([low, high]);
            sum = sum.wrapping_add(difference >> 1 ^ (difference & 1).wrapping_neg());
            node[part] = sum;
        }
    }
    nodes
}

fn gradients_of(planes: &[u8], count: usize) -> Vec<[i8; 4]> {
    let mut gradients = vec![[0; 4]; count];
    for part in 0..4 {
        let mut sum = 0i8;
        for (gradient, difference) in gradients.iter_mut().zip(&planes[part * count..][..count]) {
            sum = sum.wrapping_add(difference.cast_signed());
            gradient[part] = sum;
        }
    }
    gradients
}

fn vertices_of(
    frames: [Frame<'_>; 3],
    count: usize,
    num_nodes: usize,
    num_planes: usize,
) -> Result<Vec<Place>, Error> {
    let streams = frames.map(|frame| Ok((frame.all(5 * count as u64)?, frame.stream)));
    let [lows, spans, planes] = streams;
    let (lows, spans, planes) = (lows?, spans?, planes?);
    let mut readers = [&lows, &spans, &planes].map(|(bytes, stream)| Sevens { bytes, stream });
    let mut place = Place::default();
    let mut vertices = Vec::with_capacity(count);
    for _ in 0..count {
        let [lows, spans, planes] = &mut readers;
        let low = place.nodes[0].wrapping_add(unzigzag(lows.next()?).cast_unsigned());
        let high = u64::from(low) + u64::from(spans.next()?);
        if high >= num_nodes as u64 {
            return Err(wrong("a node of a vertex", high, format!("below {num_nodes}")));
        }
        let plane = place.plane.wrapping_add(unzigzag(planes.next()?).cast_unsigned());
        place = Place { nodes: [low, high as u32], plane };
        if low < high as u32 && plane as usize >= num_planes {
            return Err(wrong("a plane of a vertex", plane, format!("below {num_planes}")));
        }
        vertices.push(place);
    }
    match readers.into_iter().find(|reader| !reader.bytes.is_empty()) {
        Some(Sevens { bytes, stream }) => Err(Error::Size { stream, found: bytes.len(), expected: 0 }),
        None => Ok(vertices),
    }
}

fn triangles_of(frame: &Frame<'_>, count: usize, num_vertices: usize) -> Result<Vec<[u32; 3]>, Error> {
    // A code and three numbers of five bytes are the most that a triangle takes.
    let coded = frame.all(16 * count as u64 + 32)?;
    let mut bytes = vec![0; 12 * count];
    decode_index_buffer_into(&mut bytes, 3 * count, 4, &coded, &mut workspace())
        .map_err(|error| Error::Damaged { stream: frame.stream, message: error.to_string() })?;
    let corner = |bytes: &[u8; 12], at: usize| u32::from_le_bytes(array(&bytes[4 * at..]));
    let triangles: Vec<[u32; 3]> =
        bytes.as_chunks::<12>().0.iter().map(|bytes| [0, 1, 2].map(|at| corner(bytes, at))).collect();
    match triangles.as_flattened().iter().max() {
        Some(&found) if found as usize >= num_vertices => {
            Err(wrong("a vertex of a triangle", found, format!("below {num_vertices}")))
        }
        _ => Ok(triangles),
    }
}

/// Of each number from the one before.
fn differences(numbers: impl Iterator<Item = u32>) -> impl Iterator<Item = u32> {
    let mut before = 0;
    numbers.map(move |x| zigzag(x.wrapping_sub(std::mem::replace(&mut before, x)).cast_signed()))
}

fn zigzag(x: i32) -> u32 {
    (x << 1 ^ x >> 31).cast_unsigned()
}

fn unzigzag(x: u32) -> i32 {
    (x >> 1).cast_signed() ^ -(x & 1).cast_signed()
}

/// Seven bits a byte, the lowest first, the high bit set in all but the last.
fn sevens(numbers: impl Iterator<Item = u32>) -> Vec<u8> {
    let mut bytes = Vec::new();
    for mut x in numbers {
        while x >= 128 {
            bytes.push(x as u8 | 128);
            x >>= 7;
        }
        bytes.push(x as u8);
    }
    bytes
}

/// Reads what [`sevens`] wrote.
struct Sevens<'a> {
    bytes: &'a [u8],
    stream: &'static str,
}

impl Sevens<'_> {
    #[inline]
    fn next(&mut self) -> Result<u32, Error> {
        if let [x @ 0..128, rest @ ..] = self.bytes {
            self.bytes = rest;
            return Ok((*x).into());
        }
        self.next_long()
    }

    fn next_long(&mut self) -> Result<u32, Error> {
        let mut x = 0;
        for (at, &byte) in self.bytes.iter().take(5).enumerate() {
            x |= u64::from(byte & 127) << (7 * at);
            if byte < 128 {
                self.bytes = &self.bytes[at + 1..];
                return u32::try_from(x).map_err(|_| wrong("a number of a vertex", x, "32 bits"));
            }
        }
        match self.bytes.len() {
            found @ 0..5 => Err(Error::Size { stream: self.stream, found, expected: found + 1 }),
            _ => Err(wrong("a number of a vertex", "longer", "32 bits")),
        }
    }
}
