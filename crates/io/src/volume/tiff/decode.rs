//! Decoding one plane of a page.
//!
//! # Method
//! Crate `tiff` unpacks, but has its own view of pages: it turns values over where white is zero, refuses palettes and
//! reads the first of separate planes. So each plane is handed to it as a file of its own: a new directory that calls
//! the plane gray and lists its strips or tiles, and behind it the bytes of the real file. What comes back is the
//! stored numbers.

use std::io::{self, Read, Seek, SeekFrom};

use tiff::TiffError;
use tiff::decoder::{Decoder, DecodingResult, Limits};

use super::super::image::unpacked;
use super::WHAT;
use super::directory::{Directory, File, tag};
use super::shape::Shape;
use crate::bytes::reserve;
use crate::error::Problem;
use crate::layout::ByteOrder;
use crate::numbers::Scalar;

/// The numbers of one plane, those of a place side by side, row by row, in the machine's byte order.
pub(super) struct Plane {
    pub(super) scalar: Scalar,
    pub(super) bytes: Vec<u8>,
}

/// Where the strips or tiles of a plane are, and what they look like.
pub(super) struct Chunks {
    pub(super) offsets: Vec<u64>,
    pub(super) counts: Vec<u64>,
    /// Width and height of a tile; none: strips of so many rows.
    pub(super) tile: Option<[u64; 2]>,
    pub(super) rows_per_strip: u64,
    /// Of the picture that they make.
    pub(super) width: u64,
    pub(super) height: u64,
}

/// Decodes the picture that chunks make; a plane holds `samples` numbers at each place.
pub(super) fn decode(
    file: &File,
    directory: &Directory,
    shape: &Shape,
    chunks: &Chunks,
    samples: u64,
) -> Result<Plane, Problem> {
    check_stored_bytes(shape, chunks, samples)?;
    check_jpeg(file, directory, shape, chunks)?;
    let front = front(file, directory, shape, chunks, samples)?;
    let source = Spliced { front, back: file.bytes, position: 0 };
    let size = shape.picture_bytes(chunks.width, chunks.height, samples);
    let mut decoder = Decoder::new(source).map_err(problem)?;
    let mut limits = Limits::default();
    // It also limits the lists of strips, of which the decoder makes 16 bytes for one in the file.
    limits.decoding_buffer_size = (size as usize).max(file.bytes.len().saturating_mul(16));
    limits.intermediate_buffer_size = (size as usize).max(file.bytes.len());
    limits.ifd_value_size = limits.decoding_buffer_size;
    decoder = decoder.with_limits(limits);
    let (scalar, bytes) = numbers(decoder.read_image().map_err(problem)?)?;
    let mut plane = Plane { scalar, bytes };
    if shape.bits < 8 {
        let row = chunks.width * samples;
        plane.bytes = unpacked(&plane.bytes, shape.bits as usize, row as usize);
    }
    let places = chunks.width * chunks.height;
    let expected = places * samples * plane.scalar.bytes();
    if plane.bytes.len() as u64 != expected {
        return Err(Problem::Size { what: "a page", found: plane.bytes.len() as u64, expected });
    }
    if shape.photometric == 6 && samples == 3 {
        plane.bytes.as_chunks_mut::<3>().0.iter_mut().for_each(|color| *color = rgb_of(*color));
    }
    Ok(plane)
}

/// What the decoder says, as what it is: not supported, or damaged.
fn problem(error: TiffError) -> Problem {
    match error {
        TiffError::UnsupportedError(what) => Problem::field(
            "the TIFF file's way to store samples",
            what,
            "one that can be decoded: save it uncompressed",
        ),
        error => Problem::damaged(WHAT, error),
    }
}

/// Refuses an uncompressed picture whose chunks hold fewer bytes than its size needs; the decoder would read on into
/// what follows them.
fn check_stored_bytes(shape: &Shape, chunks: &Chunks, samples: u64) -> Result<(), Problem> {
    if shape.compression != 1 {
        return Ok(());
    }
    let expected = shape.picture_bytes(chunks.width, chunks.height, samples);
    let found = chunks.counts.iter().fold(0, |sum: u64, &count| sum.saturating_add(count));
    if found < expected {
        return Err(Problem::Size { what: "the data of a page", found, expected });
    }
    Ok(())
}

/// Refuses JPEG pictures that are larger than their tile or strip: the decoder makes room for what they say.
fn check_jpeg(file: &File, directory: &Directory, shape: &Shape, chunks: &Chunks) -> Result<(), Problem> {
    if shape.compression != 7 {
        return Ok(());
    }
    let tables = file.raw(directory, 347)?.map(|(bytes, ..)| bytes);
    if tables.is_some_and(|tables| tables.len() < 4) {
        return Err(Problem::damaged(WHAT, "its tables of JPEG are too short"));
    }
    let [width, height] = chunks.tile.unwrap_or([chunks.width, chunks.rows_per_strip]);
    for (&start, &count) in chunks.offsets.iter().zip(&chunks.counts) {
        let start = usize::try_from(start).unwrap_or(usize::MAX);
        let end = start.saturating_add(usize::try_from(count).unwrap_or(usize::MAX)).min(file.bytes.len());
        let picture = file.bytes.get(start..end).unwrap_or_default();
        let is_large = |[own_width, own_height]: [u64; 2]| own_width > width || own_height > height;
        if [Some(picture), tables].into_iter().flatten().any(|part| jpeg_sizes(part).any(is_large)) {
            return Err(Problem::damaged(WHAT, "a JPEG picture in it is larger than its tile"));
        }
    }
    Ok(())
}

/// Width and height after every marker that could start a frame.
fn jpeg_sizes(bytes: &[u8]) -> impl Iterator<Item = [u64; 2]> {
    let number = |bytes: &[u8]| ByteOrder::Big.unsigned(bytes);
    bytes.windows(9).filter_map(move |window| {
        let is_frame = window[0] == 0xff && matches!(window[1], 0xc0..=0xc2) && window[4] == 8;
        is_frame.then(|| [number(&window[7..9]), number(&window[5..7])])
    })
}

/// A tag of the new directory: its number, kind, count and bytes.
type NewTag = (u16, u16, u64, Vec<u8>);

/// The head of the file that is made: a BigTIFF header and a directory. Places count from after it.
fn front(
    file: &File,
    directory: &Directory,
    shape: &Shape,
    chunks: &Chunks,
    samples: u64,
) -> Result<Vec<u8>, Problem> {
    let order = file.order;
    let bytes_of = |value: u64, width: usize| match order {
        ByteOrder::Little => value.to_le_bytes()[..width].to_vec(),
        ByteOrder::Big => value.to_be_bytes()[8 - width..].to_vec(),
    };
    let longs = |tag: u16, values: &[u64]| -> NewTag {
        (tag, 16, values.len() as u64, values.iter().flat_map(|&value| bytes_of(value, 8)).collect())
    };
    let shorts = |tag: u16, value: u64, count: u64| -> NewTag {
        (tag, 3, count, bytes_of(value, 2).repeat(count as usize))
    };
    let mut tags = vec![
        longs(tag::WIDTH, &[chunks.width]),
        longs(tag::HEIGHT, &[chunks.height]),
        shorts(tag::BITS, shape.bits, samples),
        shorts(tag::COMPRESSION, shape.compression, 1),
        // Gray that rises, whatever the page says: numbers come back as they are stored.
        shorts(tag::PHOTOMETRIC, 1, 1),
        shorts(tag::SAMPLES, samples, 1),
        shorts(tag::PLANAR, 1, 1),
        shorts(tag::SAMPLE_FORMAT, shape.format, samples),
    ];
    let (offsets_tag, counts_tag) = match chunks.tile {
        Some([width, height]) => {
            tags.extend([longs(tag::TILE_WIDTH, &[width]), longs(tag::TILE_HEIGHT, &[height])]);
            (tag::TILE_OFFSETS, tag::TILE_COUNTS)
        }
        None => {
            tags.push(longs(tag::ROWS_PER_STRIP, &[chunks.rows_per_strip]));
            (tag::STRIP_OFFSETS, tag::STRIP_COUNTS)
        }
    };
    tags.push(longs(counts_tag, &chunks.counts));
    for tag in tag::OF_CODING {
        if let Some((bytes, kind, count)) = file.raw(directory, tag)? {
            tags.push((tag, kind, count as u64, bytes.to_vec()));
        }
    }
    let held = |tags: &[NewTag]| tags.iter().map(|tag| tag.3.len().next_multiple_of(8)).sum::<usize>();
    let front_bytes = 16 + 8 + 20 * (tags.len() + 1) + 8 + held(&tags) + 8 * chunks.offsets.len();
    let places: Vec<u64> =
        chunks.offsets.iter().map(|place| place.saturating_add(front_bytes as u64)).collect();
    tags.push(longs(offsets_tag, &places));
    tags.sort_by_key(|tag| tag.0);
    let mut front = Vec::new();
    reserve(&mut front, front_bytes)?;
    front.extend(if order == ByteOrder::Little { b"II" } else { b"MM" });
    front.extend([bytes_of(43, 2), bytes_of(8, 2), bytes_of(0, 2), bytes_of(16, 8)].concat());
    front.extend(bytes_of(tags.len() as u64, 8));
    let mut values = Vec::new();
    let first_value = 16 + 8 + 20 * tags.len() + 8;
    for (tag, kind, count, bytes) in &tags {
        front.extend([bytes_of((*tag).into(), 2), bytes_of((*kind).into(), 2), bytes_of(*count, 8)].concat());
        if bytes.len() <= 8 {
            front.extend(bytes);
            front.resize(front.len() + 8 - bytes.len(), 0);
        } else {
            front.extend(bytes_of((first_value + values.len()) as u64, 8));
            values.extend(bytes);
            values.resize(values.len().next_multiple_of(8), 0);
        }
    }
    front.extend([0; 8]);
    front.extend(values);
    // Short lists stand in the directory: what was reckoned for them is left.
    front.resize(front_bytes, 0);
    Ok(front)
}

/// A made front and the bytes of the real file.
struct Spliced<'a> {
    front: Vec<u8>,
    back: &'a [u8],
    position: u64,
}

impl Read for Spliced<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let front = self.front.len() as u64;
        let part = if self.position < front {
            &self.front[self.position as usize..]
        } else {
            let start = usize::try_from(self.position - front).unwrap_or(usize::MAX).min(self.back.len());
            &self.back[start..]
        };
        let count = part.len().min(buffer.len());
        buffer[..count].copy_from_slice(&part[..count]);
        self.position += count as u64;
        Ok(count)
    }
}

impl Seek for Spliced<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let place = match to {
            SeekFrom::Start(place) => Some(place),
            SeekFrom::Current(step) => self.position.checked_add_signed(step),
            SeekFrom::End(step) => {
                (self.front.len() as u64 + self.back.len() as u64).checked_add_signed(step)
            }
        };
        self.position = place.ok_or_else(|| io::Error::other("a place before the start of the file"))?;
        Ok(self.position)
    }
}

/// Red, green and blue of a colour in full-range BT.601.
fn rgb_of([y, blue, red]: [u8; 3]) -> [u8; 3] {
    let [y, blue, red] = [f64::from(y), f64::from(blue) - 128.0, f64::from(red) - 128.0];
    [y + 1.402 * red, y - 0.344_136 * blue - 0.714_136 * red, y + 1.772 * blue]
        .map(|value| value.round() as u8)
}

fn numbers(result: DecodingResult) -> Result<(Scalar, Vec<u8>), Problem> {
    fn bytes<T: bytemuck::NoUninit>(values: &[T]) -> Vec<u8> {
        bytemuck::cast_slice(values).to_vec()
    }
    Ok(match result {
        DecodingResult::U8(values) => (Scalar::U8, values),
        DecodingResult::I8(values) => (Scalar::I8, bytes(&values)),
        DecodingResult::U16(values) => (Scalar::U16, bytes(&values)),
        DecodingResult::I16(values) => (Scalar::I16, bytes(&values)),
        DecodingResult::U32(values) => (Scalar::U32, bytes(&values)),
        DecodingResult::I32(values) => (Scalar::I32, bytes(&values)),
        DecodingResult::U64(values) => (Scalar::U64, bytes(&values)),
        DecodingResult::I64(values) => (Scalar::I64, bytes(&values)),
        DecodingResult::F32(values) => (Scalar::F32, bytes(&values)),
        DecodingResult::F64(values) => (Scalar::F64, bytes(&values)),
        // All of them are numbers of f32.
        DecodingResult::F16(values) => {
            let mut singles: Vec<f32> = Vec::new();
            reserve(&mut singles, values.len())?;
            singles.extend(values.iter().map(|half| half.to_f32()));
            (Scalar::F32, bytes(&singles))
        }
    })
}
