//! The data of one array: numbers as text, or bytes with a length or a block table before them.
//!
//! Binary data are `[length][bytes]`; compressed ones `[blocks][block size][last size][size of each packed
//! block...][packed blocks]`, the lengths being `header_type` in the file's byte order. In base64, VTK ends
//! the block table with padding of its own; a decoder of groups of four characters, each padded or not,
//! reads both without knowing where one ends.

use std::io::{self, Cursor, Read};

use flate2::bufread::ZlibDecoder;
use lzma_rust2::XzReader;

use super::base64::Base64;
use crate::bytes::read_full;
use crate::error::Problem;
use crate::layout::ByteOrder;
use crate::numbers::{DATA, Numbers};

/// How binary data are written into the XML.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Encoding {
    Raw,
    Base64,
}

/// How the blocks of binary data are packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Compressor {
    Zlib,
    Lz4,
    /// In the container `.xz`.
    Lzma,
}

/// What the file says about all its binary data.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BinaryForm {
    pub(crate) order: ByteOrder,
    /// Bytes of the lengths that stand before data.
    pub(crate) header_bytes: usize,
    pub(crate) compressor: Option<Compressor>,
}

/// The data of one array.
pub(crate) enum Payload<'a> {
    Ascii(&'a str),
    Binary { encoding: Encoding, bytes: &'a [u8], form: BinaryForm },
}

/// The most that a dictionary of LZMA may take: that of the strongest preset.
const MAX_LZMA_KIB: u32 = 65 << 10;

/// A byte of LZ4 yields at most so many.
const MAX_LZ4_RATIO: u64 = 255;

impl<'a> Payload<'a> {
    /// Makes the numbers ready to be read; `expected_bytes` is what they take in binary form.
    pub(crate) fn open(self, expected_bytes: u64) -> Result<Numbers<'a>, Problem> {
        let (encoding, bytes, form) = match self {
            Self::Ascii(text) => return Ok(Numbers::Text(text)),
            Self::Binary { encoding, bytes, form } => (encoding, bytes, form),
        };
        let source: Box<dyn Read + 'a> = match encoding {
            Encoding::Raw => Box::new(bytes),
            Encoding::Base64 => Box::new(Base64::new(bytes)),
        };
        let mut header = Header { source, word_bytes: form.header_bytes, order: form.order };
        let source = match form.compressor {
            None => {
                let found = header.word()?;
                if found != expected_bytes {
                    let what = "the array by its length";
                    return Err(Problem::Size { what, found, expected: expected_bytes });
                }
                header.source
            }
            Some(compressor) => Box::new(Blocks::open(header, compressor, expected_bytes)?),
        };
        Ok(Numbers::Bytes(source, form.order))
    }
}

/// Reads the lengths before binary data.
struct Header<'a> {
    source: Box<dyn Read + 'a>,
    word_bytes: usize,
    order: ByteOrder,
}

impl Header<'_> {
    fn word(&mut self) -> Result<u64, Problem> {
        let mut bytes = [0; 8];
        let bytes = &mut bytes[..self.word_bytes];
        let came = read_full(&mut *self.source, bytes).map_err(|error| Problem::damaged(DATA, error))?;
        if came < bytes.len() {
            let what = "a length before the data";
            return Err(Problem::Size { what, found: came as u64, expected: self.word_bytes as u64 });
        }
        Ok(self.order.unsigned(bytes))
    }
}

/// The bytes of packed blocks, one after another.
struct Blocks<'a> {
    source: Box<dyn Read + 'a>,
    compressor: Compressor,
    /// Packed sizes of the blocks to come.
    packed_sizes: std::vec::IntoIter<u64>,
    /// Sizes of a block and, if it differs, of the last one.
    block_bytes: u64,
    last_bytes: u64,
    current: Option<Box<dyn Read>>,
    /// Bytes that the current block has still to yield.
    left: u64,
}

impl<'a> Blocks<'a> {
    fn open(mut header: Header<'a>, compressor: Compressor, expected: u64) -> Result<Self, Problem> {
        let [num_blocks, block_bytes, last_bytes] = [header.word()?, header.word()?, header.word()?];
        let whole_blocks = u128::from(num_blocks).saturating_sub(u128::from(last_bytes > 0));
        let last = if num_blocks > 0 { u128::from(last_bytes) } else { 0 };
        let found = whole_blocks * u128::from(block_bytes) + last;
        if found != u128::from(expected) {
            let found = u64::try_from(found).unwrap_or(u64::MAX);
            return Err(Problem::Size { what: "the array by its block table", found, expected });
        }
        let mut packed_sizes = Vec::new();
        for _ in 0..num_blocks {
            packed_sizes.push(header.word()?);
        }
        Ok(Self {
            source: header.source,
            compressor,
            packed_sizes: packed_sizes.into_iter(),
            block_bytes,
            last_bytes,
            current: None,
            left: 0,
        })
    }

    /// Takes the next block; `false` after the last one.
    fn advance(&mut self) -> io::Result<bool> {
        let Some(packed_bytes) = self.packed_sizes.next() else { return Ok(false) };
        let mut packed = Vec::new();
        (&mut *self.source).take(packed_bytes).read_to_end(&mut packed)?;
        if packed.len() as u64 != packed_bytes {
            return Err(io::Error::other(format!("a block has {} of {packed_bytes} bytes", packed.len())));
        }
        let is_last = self.packed_sizes.len() == 0;
        self.left = if is_last && self.last_bytes > 0 { self.last_bytes } else { self.block_bytes };
        self.current = Some(match self.compressor {
            Compressor::Zlib => Box::new(ZlibDecoder::new(Cursor::new(packed))),
            Compressor::Lzma => Box::new(XzReader::new_mem_limit(Cursor::new(packed), false, MAX_LZMA_KIB)),
            Compressor::Lz4 => Box::new(Cursor::new(unpack_lz4(&packed, self.left)?)),
        });
        Ok(true)
    }
}

fn unpack_lz4(packed: &[u8], expected: u64) -> io::Result<Vec<u8>> {
    if expected > MAX_LZ4_RATIO * packed.len() as u64 {
        return Err(io::Error::other(format!("a block of {} bytes cannot hold {expected}", packed.len())));
    }
    let mut block = vec![0; expected as usize];
    let found = lz4_flex::block::decompress_into(packed, &mut block).map_err(io::Error::other)?;
    block.truncate(found);
    Ok(block)
}

impl Read for Blocks<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            if let Some(block) = &mut self.current {
                let count = block.read(buffer)?;
                if count as u64 > self.left || count == 0 && self.left > 0 && !buffer.is_empty() {
                    return Err(io::Error::other("a block does not hold as many bytes as it should"));
                }
                self.left -= count as u64;
                if count > 0 {
                    return Ok(count);
                }
            }
            if !self.advance()? {
                return Ok(0);
            }
        }
    }
}
