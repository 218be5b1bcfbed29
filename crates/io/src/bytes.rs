//! The bytes of a file: small ones read, large ones mapped, compressed ones streamed.
//!
//! Memory follows the data that arrive, never a number in a header: a compressed stream is read into
//! storage that at most doubles when it is full, and a file is only mapped or read up to the size it has.
#![allow(unsafe_code, reason = "a memory map is unsafe by nature: see `load`")]

use std::cell::RefCell;
use std::collections::HashSet;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::ops::Deref;
use std::path::{Path, PathBuf};

use bytemuck::Pod;
use flate2::bufread::{MultiGzDecoder, ZlibDecoder};
use volery_scene::{Array, Sample, Samples};

use crate::error::Problem;
use crate::layout::{ByteOrder, Layout, for_sample_type, swap_scalars};

/// Files from this size on are mapped instead of read.
const MAP_FROM_BYTES: u64 = 4 << 20;

/// The first piece of a stream of unknown worth.
const FIRST_PIECE_BYTES: usize = 1 << 20;

/// The content of a file.
pub(crate) enum FileBytes {
    Mapped(memmap2::Mmap),
    Read(Vec<u8>),
}

impl Deref for FileBytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Mapped(map) => map,
            Self::Read(bytes) => bytes,
        }
    }
}

thread_local! {
    /// What [`recording_files`] has seen so far, while it runs.
    static OPENED: RefCell<Option<Vec<OpenedFile>>> = const { RefCell::new(None) };
}

/// A file that a reader opened.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct OpenedFile {
    /// Where it is.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
}

/// Runs a reader of this crate, and says which files it opened, each once: the one asked for, and all that it names.
pub fn recording_files<R>(read: impl FnOnce() -> R) -> (R, Vec<OpenedFile>) {
    let before = OPENED.replace(Some(Vec::new()));
    let result = read();
    let mut opened = OPENED.replace(before).unwrap_or_default();
    let mut seen = HashSet::new();
    opened.retain(|file| seen.insert(file.clone()));
    (result, opened)
}

/// Opens a regular file that is not empty; returns its length too. Devices and pipes are refused, since
/// they may never end. Every reader opens its files here and in the thread that called it, for
/// [`recording_files`] to know.
pub(crate) fn open(path: &Path) -> Result<(File, u64), Problem> {
    let metadata = std::fs::metadata(path).map_err(Problem::Io)?;
    let kind = |found, expected| Err(Problem::Kind { found, expected });
    if metadata.is_dir() {
        return kind("a folder", "a file");
    }
    if !metadata.is_file() {
        return kind("a device or pipe", "a regular file");
    }
    if metadata.len() == 0 {
        return kind("empty", "a file with content");
    }
    let file = File::open(path).map_err(Problem::Io)?;
    OPENED.with_borrow_mut(|opened| {
        if let Some(opened) = opened {
            opened.push(OpenedFile { path: path.to_owned(), bytes: metadata.len() });
        }
    });
    Ok((file, metadata.len()))
}

/// The whole content of a file.
pub(crate) fn load(path: &Path) -> Result<FileBytes, Problem> {
    let (file, length) = open(path)?;
    if length >= MAP_FROM_BYTES {
        // SAFETY: the map is private and read only, is never handed out mutably, and is as long as the
        // file was when it was made. What remains is the contract of every map: no other process may
        // change or shorten the file while the volume lives (the crate's documentation says so). Gain: a
        // volume larger than memory opens at once, and 512^3 bytes cost no copy.
        return unsafe { memmap2::Mmap::map(&file) }.map(FileBytes::Mapped).map_err(Problem::Io);
    }
    let mut bytes = Vec::new();
    file.take(MAP_FROM_BYTES).read_to_end(&mut bytes).map_err(Problem::Io)?;
    Ok(FileBytes::Read(bytes))
}

/// Whether a file starts with these bytes.
pub(crate) fn starts_with(path: &Path, magic: &[u8]) -> Result<bool, Problem> {
    let mut head = Vec::new();
    open(path)?.0.take(magic.len() as u64).read_to_end(&mut head).map_err(Problem::Io)?;
    Ok(head == magic)
}

/// The text of a small file, such as a scene.
pub(crate) fn load_text(path: &Path, max_bytes: u64) -> Result<String, Problem> {
    let (file, length) = open(path)?;
    if length > max_bytes {
        return Err(Problem::TooLarge { required: length.into(), max: max_bytes });
    }
    let mut bytes = Vec::new();
    file.take(max_bytes).read_to_end(&mut bytes).map_err(Problem::Io)?;
    String::from_utf8(bytes).map_err(|error| Problem::damaged("the text", error.utf8_error()))
}

/// How bytes are compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Compression {
    None,
    Gzip,
    Zlib,
    Zstd,
}

impl Compression {
    /// How errors call such data.
    pub(crate) fn stream_name(self) -> &'static str {
        match self {
            Self::None => "the file",
            Self::Gzip => "the gzip stream",
            Self::Zlib => "the zlib stream",
            Self::Zstd => "the zstd stream",
        }
    }

    /// A decoder over `source`. The Zstandard window is limited to 128 MiB, the format's own default.
    pub(crate) fn decoder<'a>(self, source: impl BufRead + 'a) -> Result<Box<dyn Read + 'a>, Problem> {
        Ok(match self {
            Self::None => Box::new(source),
            Self::Gzip => Box::new(MultiGzDecoder::new(source)),
            Self::Zlib => Box::new(ZlibDecoder::new(source)),
            Self::Zstd => Box::new(zstd::Decoder::with_buffer(source).map_err(Problem::Io)?),
        })
    }
}

/// A reader of a file's decompressed content.
pub(crate) fn open_stream(path: &Path, compression: Compression) -> Result<Box<dyn Read>, Problem> {
    let (file, _) = open(path)?;
    compression.decoder(BufReader::with_capacity(1 << 17, file))
}

/// Reads until `buffer` is full or the source ends; returns how many bytes came.
pub(crate) fn read_full(source: &mut dyn Read, buffer: &mut [u8]) -> io::Result<usize> {
    let mut filled = 0;
    while filled < buffer.len() {
        match source.read(&mut buffer[filled..]) {
            Ok(0) => break,
            Ok(count) => filled += count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(filled)
}

/// Whether the source goes on. Reading on to the end also makes a decoder verify its checksum.
pub(crate) fn has_more(source: &mut dyn Read, what: &'static str) -> Result<bool, Problem> {
    let more = read_full(source, &mut [0]).map_err(|error| Problem::damaged(what, error))?;
    Ok(more > 0)
}

/// Reads the samples of a layout from a stream, of which nothing is believed.
pub(crate) fn read_samples(
    source: &mut dyn Read,
    what: &'static str,
    layout: &Layout,
) -> Result<Samples, Problem> {
    for_sample_type!(layout.sample, T => read_values::<T>(source, what, layout).map(Samples::from))
}

fn read_values<T: Sample + Pod>(
    source: &mut dyn Read,
    what: &'static str,
    layout: &Layout,
) -> Result<Vec<T>, Problem> {
    let count = layout.num_samples();
    let mut values = Vec::new();
    while values.len() < count {
        let start: usize = values.len();
        let piece = (count - start).min(start.max(FIRST_PIECE_BYTES / size_of::<T>()));
        reserve(&mut values, piece)?;
        values.resize(start + piece, T::zeroed());
        let bytes = bytemuck::cast_slice_mut(&mut values[start..]);
        let came = read_full(source, bytes).map_err(|error| Problem::damaged(what, error))?;
        if came < bytes.len() {
            let found = (start * size_of::<T>() + came) as u64;
            return Err(Problem::Size { what, found, expected: layout.num_bytes() });
        }
        layout.order.to_native(bytes, layout.sample);
    }
    Ok(values)
}

/// Room for `more` values, or an error instead of an abort.
pub(crate) fn reserve<T>(values: &mut Vec<T>, more: usize) -> Result<(), Problem> {
    values.try_reserve_exact(more).map_err(|_| {
        let required = (values.len() as u128 + more as u128) * size_of::<T>() as u128;
        Problem::TooLarge { required, max: (values.capacity() * size_of::<T>()) as u64 }
    })
}

/// The samples that lie at `offset` in a file's bytes: without a copy where alignment and byte order allow.
pub(crate) fn samples_at(bytes: FileBytes, offset: u64, layout: &Layout) -> Result<Samples, Problem> {
    let available = (bytes.len() as u64).saturating_sub(offset);
    if available < layout.num_bytes() {
        return Err(Problem::Size { what: "the data part", found: available, expected: layout.num_bytes() });
    }
    // In range: `offset` plus the size of the samples is at most the length of the file.
    let start = offset as usize;
    for_sample_type!(layout.sample, T => view_or_copy::<T>(bytes, start, layout).map(Samples::from))
}

fn view_or_copy<T: Sample + Pod>(
    bytes: FileBytes,
    start: usize,
    layout: &Layout,
) -> Result<Array<T>, Problem> {
    let range = start..start + layout.num_samples() * size_of::<T>();
    let native = layout.order == ByteOrder::NATIVE || swap_scalars(layout.sample).is_none();
    if native && bytemuck::try_cast_slice::<u8, T>(&bytes[range.clone()]).is_ok() {
        return Ok(Array::new(View { bytes, range, sample: std::marker::PhantomData::<T> }));
    }
    Ok(read_values::<T>(&mut &bytes[range], "the data part", layout)?.into())
}

/// Part of a file's bytes as samples; aligned, since [`view_or_copy`] tried.
struct View<T> {
    bytes: FileBytes,
    range: std::ops::Range<usize>,
    sample: std::marker::PhantomData<T>,
}

impl<T: Pod> AsRef<[T]> for View<T> {
    fn as_ref(&self) -> &[T] {
        bytemuck::cast_slice(&self.bytes[self.range.clone()])
    }
}
