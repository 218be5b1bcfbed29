//! What the text headers of NRRD and MetaImage have in common.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use volery_scene::Samples;

use crate::bytes::{Compression, FileBytes, has_more, load, read_samples, samples_at};
use crate::error::{Problem, quoted};
use crate::layout::{ByteOrder, Layout};

/// Text headers longer than this are refused.
const MAX_HEADER_BYTES: usize = 1 << 20;

/// The lines of a text header, one at a time, without their line ends.
pub(super) struct Lines<'a> {
    bytes: &'a [u8],
    /// Where the next line starts, and after the last one the data.
    pub(super) position: usize,
}

impl<'a> Lines<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, position: 0 }
    }

    /// The next line, or `None` at the end of the file.
    pub(super) fn next(&mut self) -> Result<Option<&'a str>, Problem> {
        let rest = &self.bytes[self.position..];
        if rest.is_empty() {
            return Ok(None);
        }
        let room = MAX_HEADER_BYTES.saturating_sub(self.position);
        let window = &rest[..rest.len().min(room)];
        let length = match window.iter().position(|&byte| byte == b'\n') {
            Some(length) => length,
            None if window.len() == rest.len() => rest.len(),
            None => {
                return Err(Problem::field("header", "longer than 1 MiB", "a text header and then the data"));
            }
        };
        self.position += (length + 1).min(rest.len());
        let line = rest[..length].strip_suffix(b"\r").unwrap_or(&rest[..length]);
        let text = std::str::from_utf8(line);
        text.map(Some).map_err(|_| Problem::field("header", "not text", "lines of UTF-8"))
    }
}

/// Numbers separated by white space.
pub(super) fn numbers<T: FromStr>(field: &str, text: &str, expected: &str) -> Result<Vec<T>, Problem> {
    let parsed = text.split_whitespace().map(str::parse).collect::<Result<_, _>>();
    parsed.map_err(|_| Problem::field(field, quoted(text), expected))
}

/// One number.
pub(super) fn number<T: FromStr>(field: &str, text: &str, expected: &str) -> Result<T, Problem> {
    text.trim().parse().map_err(|_| Problem::field(field, quoted(text), expected))
}

/// Where the samples of a header lie.
pub(super) struct Data {
    /// In this file, or after the header in its own.
    pub(super) file: Option<PathBuf>,
    /// Bytes to skip; `None`: the samples are the last bytes of the file.
    pub(super) skip: Option<u64>,
    pub(super) compression: Compression,
}

impl Data {
    /// A detached file named by a header: relative to the header.
    pub(super) fn detached(header: &Path, name: &str) -> PathBuf {
        header.parent().unwrap_or(Path::new("")).join(name)
    }

    /// Where the data start: so many bytes after `start`, or for -1 at the end of the file less their size.
    pub(super) fn skip(
        field: &str,
        text: Option<&str>,
        start: u64,
        compression: Compression,
    ) -> Result<Option<u64>, Problem> {
        let skip: i64 = text.map_or(Ok(0), |text| number(field, text, "a whole number"))?;
        match u64::try_from(skip) {
            Ok(skip) => Ok(Some(start.saturating_add(skip))),
            Err(_) if skip == -1 && compression == Compression::None => Ok(None),
            Err(_) => Err(Problem::field(field, skip, "0 or more, or -1 for uncompressed data")),
        }
    }

    /// Reads the samples; `header` is the file with the header, as loaded.
    pub(super) fn read(
        self,
        header: FileBytes,
        layout: &Layout,
        notes: &mut Vec<String>,
    ) -> Result<Samples, Problem> {
        match &self.file {
            None => self.read_from(header, layout, notes),
            Some(path) => load(path)
                .and_then(|bytes| self.read_from(bytes, layout, notes))
                .map_err(|problem| problem.of_part(path)),
        }
    }

    fn read_from(
        &self,
        bytes: FileBytes,
        layout: &Layout,
        notes: &mut Vec<String>,
    ) -> Result<Samples, Problem> {
        let (length, expected) = (bytes.len() as u64, layout.num_bytes());
        let offset = match self.skip {
            Some(offset) => offset,
            None => length.saturating_sub(expected),
        };
        let mut excess =
            || notes.push("the file goes on after the last sample; the rest is not used".to_owned());
        if self.compression == Compression::None {
            if length.saturating_sub(offset) > expected {
                excess();
            }
            return samples_at(bytes, offset, layout);
        }
        let what = self.compression.stream_name();
        let start = usize::try_from(offset).ok().and_then(|offset| bytes.get(offset..)).unwrap_or_default();
        let mut stream = self.compression.decoder(start)?;
        let samples = read_samples(&mut *stream, what, layout)?;
        if has_more(&mut *stream, what)? {
            excess();
        }
        Ok(samples)
    }
}

/// The byte order by a field of the header; only types of more than one byte need one.
pub(super) fn byte_order(
    field: &str,
    stated: Option<ByteOrder>,
    layout_bytes: Option<usize>,
) -> Result<ByteOrder, Problem> {
    match (stated, layout_bytes) {
        (Some(order), _) => Ok(order),
        (None, None) => Ok(ByteOrder::NATIVE),
        (None, Some(_)) => Err(Problem::missing(field, "the byte order of samples of several bytes")),
    }
}
