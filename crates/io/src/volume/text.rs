//! What the text headers of NRRD and MetaImage have in common.

use std::io::{self, BufRead, Cursor, Read};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use volery_scene::Samples;

use crate::bytes::{Compression, FileBytes, has_more, load};
use crate::error::{Problem, quoted};
use crate::layout::ByteOrder;
use crate::numbers::Numbers;
use crate::raster::Raster;

/// Text headers longer than this are refused.
const MAX_HEADER_BYTES: usize = 1 << 20;

/// What is said of data that go on.
const EXCESS: &str = "the file goes on after the last sample; the rest is not used";

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

    /// The lines that are left and not blank: names of files.
    pub(super) fn names(&mut self) -> Result<Vec<&'a str>, Problem> {
        let mut names = Vec::new();
        while let Some(line) = self.next()? {
            names.extend(Some(line.trim()).filter(|line| !line.is_empty()));
        }
        Ok(names)
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

/// How numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Binary(Compression),
    /// Numbers for people.
    Text,
    /// Bytes as pairs of hexadecimal digits.
    Hex,
}

/// Where the samples of a header lie.
pub(super) struct Data {
    /// In this file from here on, or in files of their own, each with an equal part.
    pub(super) place: DataPlace,
    /// Lines to pass before anything else.
    pub(super) line_skip: u64,
    /// Bytes to pass then, after unpacking; `None`: the samples are the last bytes of the file.
    pub(super) byte_skip: Option<u64>,
    pub(super) encoding: Encoding,
}

/// Where data are.
pub(super) enum DataPlace {
    /// After the header.
    Here(u64),
    Files(Vec<PathBuf>),
}

impl DataPlace {
    /// Of the data file that a header names, relative to the header: one name; `LIST` and then names, handed in as
    /// `listed`; or a pattern with `%d` and the first number, the last and the step.
    pub(super) fn detached(
        field: &str,
        header: &Path,
        name: &str,
        listed: &[&str],
        num_parts: u64,
    ) -> Result<Self, Problem> {
        let path = |name: &str| header.parent().unwrap_or(Path::new("")).join(name);
        let files: Vec<PathBuf> = if name.starts_with("LIST") {
            listed.iter().map(|name| path(name)).collect()
        } else if name.contains('%') {
            pattern(field, name, num_parts)?.iter().map(|name| path(name)).collect()
        } else {
            return Ok(Self::Files(vec![path(name)]));
        };
        if files.len() as u64 != num_parts {
            let expected = format!("{num_parts}, one for each slice");
            return Err(Problem::field(format!("number of files of {field}"), files.len(), expected));
        }
        Ok(Self::Files(files))
    }
}

/// Bytes to pass: so many, or `None` for -1, which counts from the end of uncompressed data.
pub(super) fn byte_skip(field: &str, text: Option<&str>, encoding: Encoding) -> Result<Option<u64>, Problem> {
    let skip: i64 = text.map_or(Ok(0), |text| number(field, text, "a whole number"))?;
    match u64::try_from(skip) {
        Ok(skip) => Ok(Some(skip)),
        Err(_) if skip == -1 && encoding == Encoding::Binary(Compression::None) => Ok(None),
        Err(_) => Err(Problem::field(field, skip, "0 or more, or -1 for uncompressed data")),
    }
}

/// The names that a pattern such as `slice%03d.raw 1 9 2` stands for; a fourth number says of how many dimensions a
/// slice is, which the number of files says, too. More names than `max` and one are not made.
fn pattern(field: &str, text: &str, max: u64) -> Result<Vec<String>, Problem> {
    let bad =
        || Problem::field(field, quoted(text), "a name such as 'slice%03d.raw' and two or three numbers");
    let words: Vec<&str> = text.split_whitespace().collect();
    let first_number = words.len().saturating_sub(1).min(4);
    // The name may hold blanks: numbers are what parses at the end.
    let numbers: Vec<i64> =
        words[words.len() - first_number..].iter().rev().map_while(|word| word.parse().ok()).collect();
    let numbers: Vec<i64> = numbers.into_iter().rev().collect();
    let name = words[..words.len() - numbers.len()].join(" ");
    let (first, last, step) = match numbers[..] {
        [first, last] => (first, last, 1),
        [first, last, step] | [first, last, step, _] => (first, last, step),
        _ => return Err(bad()),
    };
    let (before, rest) = name.split_once('%').ok_or_else(bad)?;
    let (format, after) = rest.split_once(['d', 'i', 'u']).ok_or_else(bad)?;
    let width = if format.is_empty() { 0 } else { format.parse::<usize>().map_err(|_| bad())? };
    if step == 0 || width > 32 {
        return Err(bad());
    }
    let has_zeros = format.starts_with('0');
    let count = last
        .saturating_sub(first)
        .saturating_div(step)
        .saturating_add(1)
        .clamp(0, max.saturating_add(1).min(1 << 20) as i64);
    let name_of = |index: i64| {
        let number = first.saturating_add(index.saturating_mul(step));
        if has_zeros {
            format!("{before}{number:0width$}{after}")
        } else {
            format!("{before}{number:width$}{after}")
        }
    };
    Ok((0..count).map(name_of).collect())
}

impl Data {
    /// Reads the samples; `header` is the file with the header, as loaded.
    pub(super) fn read(
        self,
        header: FileBytes,
        raster: &Raster,
        notes: &mut Vec<String>,
    ) -> Result<Samples, Problem> {
        match &self.place {
            DataPlace::Here(start) => self.read_from(header, *start, raster, notes),
            DataPlace::Files(files) => match &files[..] {
                [path] => load(path)
                    .and_then(|bytes| self.read_from(bytes, 0, raster, notes))
                    .map_err(|problem| problem.of_part(path)),
                files => self.read_parts(files, raster, notes),
            },
        }
    }

    fn read_from(
        &self,
        bytes: FileBytes,
        start: u64,
        raster: &Raster,
        notes: &mut Vec<String>,
    ) -> Result<Samples, Problem> {
        let expected = raster.array_bytes();
        let start = after_lines(&bytes, start, self.line_skip);
        match self.encoding {
            Encoding::Binary(Compression::None) => {
                let length = bytes.len() as u64;
                let offset = match self.byte_skip {
                    Some(skip) => start.saturating_add(skip),
                    None => length.saturating_sub(expected),
                };
                if length.saturating_sub(offset) > expected {
                    notes.push(EXCESS.to_owned());
                }
                raster.in_file(bytes, offset, notes)
            }
            Encoding::Binary(compression) => {
                let what = compression.stream_name();
                let mut stream = self.unpacked(compression, tail(&bytes, start))?;
                let samples = raster.in_stream(&mut *stream, what, notes)?;
                if raster.is_read_to_its_end() && has_more(&mut *stream, what)? {
                    notes.push(EXCESS.to_owned());
                }
                Ok(samples)
            }
            Encoding::Text => {
                let text = std::str::from_utf8(tail(&bytes, start));
                let text = text.map_err(|error| Problem::damaged("the text", error))?;
                raster.in_numbers(Numbers::Text(text), notes)
            }
            Encoding::Hex => {
                let bytes = hex_bytes(tail(&bytes, start), expected)?;
                raster.in_stream(&mut &bytes[..], "the text", notes)
            }
        }
    }

    /// Unpacks data and passes what comes before the samples.
    fn unpacked<'a>(
        &self,
        compression: Compression,
        source: impl BufRead + 'a,
    ) -> Result<Box<dyn Read + 'a>, Problem> {
        let mut stream = compression.decoder(source)?;
        let skipped = io::copy(&mut (&mut stream).take(self.byte_skip.unwrap_or(0)), &mut io::sink());
        skipped.map_err(|error| Problem::damaged(compression.stream_name(), error))?;
        Ok(stream)
    }

    /// Reads samples that lie in several files, one after the other; each is open only while it is read.
    fn read_parts(
        &self,
        files: &[PathBuf],
        raster: &Raster,
        notes: &mut Vec<String>,
    ) -> Result<Samples, Problem> {
        let Encoding::Binary(compression) = self.encoding else {
            return Err(Problem::field(
                "encoding",
                "text",
                "raw or packed data where there are several files",
            ));
        };
        let mut parts = Parts {
            data: self,
            compression,
            files: files.iter(),
            part_bytes: raster.array_bytes() / files.len().max(1) as u64,
            current: None,
            problem: None,
        };
        let samples = raster.in_stream(&mut parts, "the data files", notes);
        // What went wrong in a file says more than that the stream ended.
        parts.problem.map_or(samples, Err)
    }
}

fn tail(bytes: &[u8], start: u64) -> &[u8] {
    usize::try_from(start).ok().and_then(|start| bytes.get(start..)).unwrap_or_default()
}

/// The place after so many lines.
fn after_lines(bytes: &[u8], start: u64, lines: u64) -> u64 {
    (0..lines)
        .try_fold(start, |start, _| {
            let end = tail(bytes, start).iter().position(|&byte| byte == b'\n');
            end.map(|end| start + end as u64 + 1)
        })
        .unwrap_or(bytes.len() as u64)
}

/// The bytes that pairs of hexadecimal digits stand for, at most so many.
fn hex_bytes(text: &[u8], max: u64) -> Result<Vec<u8>, Problem> {
    let mut digits = text.iter().filter(|byte| !byte.is_ascii_whitespace()).map(|&byte| {
        let digit = char::from(byte).to_digit(16);
        digit.ok_or_else(|| Problem::field("the data", quoted(char::from(byte)), "hexadecimal digits"))
    });
    let mut bytes = Vec::new();
    while let (true, Some(high)) = ((bytes.len() as u64) < max, digits.next()) {
        // An odd digit at the end is half a byte: none.
        let Some(low) = digits.next() else { break };
        bytes.push((high? << 4 | low?) as u8);
    }
    Ok(bytes)
}

/// The data of several files as one stream.
struct Parts<'a> {
    data: &'a Data,
    compression: Compression,
    files: std::slice::Iter<'a, PathBuf>,
    part_bytes: u64,
    current: Option<io::Take<Box<dyn Read>>>,
    problem: Option<Problem>,
}

impl Parts<'_> {
    fn open(&self, path: &Path) -> Result<io::Take<Box<dyn Read>>, Problem> {
        let bytes = load(path)?;
        let start = after_lines(&bytes, 0, self.data.line_skip);
        let start = match self.data.byte_skip {
            Some(_) => start,
            None => (bytes.len() as u64).saturating_sub(self.part_bytes),
        };
        let mut source = Cursor::new(Owned(bytes));
        source.set_position(start);
        Ok(self.data.unpacked(self.compression, source)?.take(self.part_bytes))
    }
}

/// Bytes of a file that a cursor can own.
struct Owned(FileBytes);

impl AsRef<[u8]> for Owned {
    fn as_ref(&self) -> &[u8] {
        &self.0
    }
}

impl Read for Parts<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            if let Some(part) = &mut self.current {
                let count = part.read(buffer)?;
                if count > 0 || buffer.is_empty() {
                    return Ok(count);
                }
                if part.limit() > 0 {
                    return Err(io::Error::other(format!("a file is {} bytes short", part.limit())));
                }
            }
            let Some(path) = self.files.next() else { return Ok(0) };
            match self.open(path) {
                Ok(part) => self.current = Some(part),
                Err(problem) => {
                    self.problem = Some(problem.of_part(path));
                    return Ok(0);
                }
            }
        }
    }
}

/// The byte order by a field of the header; only types of more than one byte need one.
pub(super) fn byte_order(
    field: &str,
    stated: Option<ByteOrder>,
    scalar_bytes: u64,
) -> Result<ByteOrder, Problem> {
    match stated {
        Some(order) => Ok(order),
        None if scalar_bytes == 1 => Ok(ByteOrder::NATIVE),
        None => Err(Problem::missing(field, "the byte order of samples of several bytes")),
    }
}
