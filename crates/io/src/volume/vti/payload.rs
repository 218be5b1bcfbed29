//! The data of one array: numbers as text, or bytes with a length or a block table before them.
//!
//! Binary data are `[length][bytes]`; compressed ones `[blocks][block size][last size][size of each packed
//! block...][packed blocks]`, the lengths being `header_type` in the file's byte order. In base64, VTK ends
//! the block table with padding of its own; a decoder of groups of four characters, each padded or not,
//! reads both without knowing where one ends.

use std::io::{self, Cursor, Read};
use std::str::FromStr;

use flate2::bufread::ZlibDecoder;
use volery_scene::{SampleType, Samples};

use crate::bytes::{read_full, read_samples, reserve};
use crate::error::{Problem, quoted};
use crate::layout::{ByteOrder, Layout};

/// How binary data are written into the XML.
#[derive(Clone, Copy, Debug)]
pub(super) enum Encoding {
    Raw,
    Base64,
}

/// The data of one array.
pub(super) enum Payload<'a> {
    Ascii(&'a str),
    Binary { encoding: Encoding, bytes: &'a [u8], header_bytes: usize, compressed: bool },
}

const DATA: &str = "the data of the array";

impl Payload<'_> {
    pub(super) fn read(self, layout: &Layout) -> Result<Samples, Problem> {
        match self {
            Self::Ascii(text) => read_ascii(text, layout),
            Self::Binary { encoding, bytes, header_bytes, compressed } => {
                let mut base64;
                let mut raw = bytes;
                let source: &mut dyn Read = match encoding {
                    Encoding::Raw => &mut raw,
                    Encoding::Base64 => {
                        base64 = Base64::new(bytes);
                        &mut base64
                    }
                };
                let mut header = Header { source, word_bytes: header_bytes, order: layout.order };
                if compressed { read_blocks(header, layout) } else { read_plain(&mut header, layout) }
            }
        }
    }
}

/// Reads the lengths before binary data.
struct Header<'a> {
    source: &'a mut dyn Read,
    word_bytes: usize,
    order: ByteOrder,
}

impl Header<'_> {
    fn word(&mut self) -> Result<u64, Problem> {
        let mut bytes = [0; 8];
        let bytes = &mut bytes[..self.word_bytes];
        let came = read_full(self.source, bytes).map_err(|error| Problem::damaged(DATA, error))?;
        if came < bytes.len() {
            let (found, expected) = (came as u64, self.word_bytes as u64);
            return Err(Problem::Size { what: "a length before the data", found, expected });
        }
        Ok(self.order.unsigned(bytes))
    }
}

fn read_plain(header: &mut Header, layout: &Layout) -> Result<Samples, Problem> {
    let found = header.word()?;
    if found != layout.num_bytes() {
        return Err(Problem::Size { what: "the array by its length", found, expected: layout.num_bytes() });
    }
    read_samples(header.source, DATA, layout)
}

fn read_blocks(mut header: Header, layout: &Layout) -> Result<Samples, Problem> {
    let [num_blocks, block, last] = [header.word()?, header.word()?, header.word()?];
    let whole_blocks = u128::from(num_blocks).saturating_sub(u128::from(last > 0));
    let found = whole_blocks * u128::from(block) + if num_blocks > 0 { u128::from(last) } else { 0 };
    if found != u128::from(layout.num_bytes()) {
        let found = u64::try_from(found).unwrap_or(u64::MAX);
        return Err(Problem::Size {
            what: "the array by its block table",
            found,
            expected: layout.num_bytes(),
        });
    }
    let mut sizes = Vec::new();
    for _ in 0..num_blocks {
        sizes.push(header.word()?);
    }
    let mut blocks = Blocks { source: header.source, sizes: sizes.into_iter(), current: None };
    read_samples(&mut blocks, DATA, layout)
}

/// The bytes of zlib blocks, one after another.
struct Blocks<'a> {
    source: &'a mut dyn Read,
    /// Packed sizes of the blocks to come.
    sizes: std::vec::IntoIter<u64>,
    current: Option<ZlibDecoder<Cursor<Vec<u8>>>>,
}

impl Read for Blocks<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            if let Some(block) = &mut self.current {
                let count = block.read(buffer)?;
                if count > 0 {
                    return Ok(count);
                }
            }
            let Some(size) = self.sizes.next() else { return Ok(0) };
            let mut packed = Vec::new();
            (&mut *self.source).take(size).read_to_end(&mut packed)?;
            if packed.len() as u64 != size {
                return Err(io::Error::other(format!("a block has {} of {size} bytes", packed.len())));
            }
            self.current = Some(ZlibDecoder::new(Cursor::new(packed)));
        }
    }
}

/// Decodes base64 in groups of four characters, each of which may be padded; white space is skipped; the
/// data end with the text or before a `<`.
pub(super) struct Base64<'a> {
    text: &'a [u8],
    group: [u8; 3],
    /// The part of `group` not handed out yet.
    left: std::ops::Range<usize>,
}

impl<'a> Base64<'a> {
    pub(super) fn new(text: &'a [u8]) -> Self {
        Self { text, group: [0; 3], left: 0..0 }
    }

    /// Decodes the next group; `false` at the end.
    fn next_group(&mut self) -> io::Result<bool> {
        let invalid = |what: &str| io::Error::new(io::ErrorKind::InvalidData, what.to_owned());
        let (mut bits, mut characters, mut padding) = (0u32, 0, 0);
        while characters < 4 {
            let Some((&byte, rest)) = self.text.split_first().filter(|(byte, _)| **byte != b'<') else {
                let error = invalid("the base64 text ends inside a group of four");
                return if characters == 0 { Ok(false) } else { Err(error) };
            };
            self.text = rest;
            let value = SIX_BITS[usize::from(byte)];
            if value == SPACE {
                continue;
            }
            if byte == b'=' && characters >= 2 {
                padding += 1;
            } else if value == INVALID || padding > 0 {
                return Err(invalid(&format!("byte {byte:#04x} in base64 text")));
            }
            bits = bits << 6 | u32::from(value & 63);
            characters += 1;
        }
        self.group = [(bits >> 16) as u8, (bits >> 8) as u8, bits as u8];
        self.left = 0..3 - padding;
        Ok(true)
    }
}

impl Read for Base64<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut filled = 0;
        while filled < buffer.len() {
            if self.left.is_empty() && !self.next_group()? {
                break;
            }
            let count = self.left.len().min(buffer.len() - filled);
            buffer[filled..filled + count].copy_from_slice(&self.group[self.left.start..][..count]);
            self.left.start += count;
            filled += count;
        }
        Ok(filled)
    }
}

const INVALID: u8 = 0x80;
const SPACE: u8 = 0x81;

/// The six bits of each character.
const SIX_BITS: [u8; 256] = {
    let mut table = [INVALID; 256];
    let alphabet = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut value = 0;
    while value < 64 {
        table[alphabet[value as usize] as usize] = value;
        value += 1;
    }
    table[b' ' as usize] = SPACE;
    table[b'\t' as usize] = SPACE;
    table[b'\r' as usize] = SPACE;
    table[b'\n' as usize] = SPACE;
    table
};

fn read_ascii(text: &str, layout: &Layout) -> Result<Samples, Problem> {
    let count = layout.num_samples();
    Ok(match layout.sample {
        SampleType::U8 => parse_all::<u8>(text, count)?.into(),
        SampleType::I8 => parse_all::<i8>(text, count)?.into(),
        SampleType::U16 => parse_all::<u16>(text, count)?.into(),
        SampleType::I16 => parse_all::<i16>(text, count)?.into(),
        SampleType::U32 => parse_all::<u32>(text, count)?.into(),
        SampleType::I32 => parse_all::<i32>(text, count)?.into(),
        SampleType::F32 => parse_all::<f32>(text, count)?.into(),
        SampleType::F64 => parse_all::<f64>(text, count)?.into(),
        SampleType::Rgb8 => parse_all::<u8>(text, 3 * count)?.as_chunks::<3>().0.to_vec().into(),
        SampleType::Rgba8 => parse_all::<u8>(text, 4 * count)?.as_chunks::<4>().0.to_vec().into(),
    })
}

/// Exactly `count` numbers.
fn parse_all<T: FromStr>(text: &str, count: usize) -> Result<Vec<T>, Problem> {
    let mut values = Vec::new();
    // Each number takes a character and a space: the text bounds what is allocated.
    reserve(&mut values, count.min(text.len() / 2 + 1))?;
    let words = text.split_ascii_whitespace();
    for word in words.take(count.saturating_add(1)) {
        let value = word.parse().map_err(|_| Problem::field(DATA, quoted(word), "a number of its type"))?;
        values.push(value);
    }
    if values.len() != count {
        let found = if values.len() > count { "more".to_owned() } else { values.len().to_string() };
        return Err(Problem::field("count of numbers in the array", found, count));
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decode(text: &str) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        Base64::new(text.as_bytes()).read_to_end(&mut bytes)?;
        Ok(bytes)
    }

    #[test]
    fn base64_matches_the_vectors_of_rfc_4648() {
        let vectors = [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYg==", "foob")];
        for (text, bytes) in vectors {
            assert_eq!(decode(text).unwrap(), bytes.as_bytes());
        }
    }

    #[test]
    fn padding_may_stand_inside_and_space_anywhere() {
        assert_eq!(decode("Zg==\n Zm 9v</AppendedData>").unwrap(), b"ffoo");
        for bad in ["Zg", "Z===", "Zg=v", "Zm9*", "====", "Zm9v\u{e9}"] {
            assert!(decode(bad).is_err(), "{bad}");
        }
    }
}
