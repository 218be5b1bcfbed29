//! The directories of a TIFF file: which pages there are, and what their tags say. TIFF and BigTIFF, both byte orders.
//!
//! Values stay in the file until they are asked for, and must lie in it; directories must not overlap.

use std::collections::{BTreeMap, HashSet};

use super::WHAT;
use crate::error::Problem;
use crate::layout::ByteOrder;

/// Numbers of the tags that are looked at.
pub(super) mod tag {
    pub(crate) const NEW_SUBFILE_TYPE: u16 = 254;
    pub(crate) const SUBFILE_TYPE: u16 = 255;
    pub(crate) const WIDTH: u16 = 256;
    pub(crate) const HEIGHT: u16 = 257;
    pub(crate) const BITS: u16 = 258;
    pub(crate) const COMPRESSION: u16 = 259;
    pub(crate) const PHOTOMETRIC: u16 = 262;
    pub(crate) const DESCRIPTION: u16 = 270;
    pub(crate) const STRIP_OFFSETS: u16 = 273;
    pub(crate) const ORIENTATION: u16 = 274;
    pub(crate) const SAMPLES: u16 = 277;
    pub(crate) const ROWS_PER_STRIP: u16 = 278;
    pub(crate) const STRIP_COUNTS: u16 = 279;
    pub(crate) const X_RESOLUTION: u16 = 282;
    pub(crate) const Y_RESOLUTION: u16 = 283;
    pub(crate) const PLANAR: u16 = 284;
    pub(crate) const RESOLUTION_UNIT: u16 = 296;
    pub(crate) const TILE_WIDTH: u16 = 322;
    pub(crate) const TILE_HEIGHT: u16 = 323;
    pub(crate) const TILE_OFFSETS: u16 = 324;
    pub(crate) const TILE_COUNTS: u16 = 325;
    pub(crate) const EXTRA_SAMPLES: u16 = 338;
    pub(crate) const SAMPLE_FORMAT: u16 = 339;
    pub(crate) const IMAGE_DEPTH: u16 = 32_997;
    pub(crate) const TILE_DEPTH: u16 = 32_998;
    pub(crate) const SUBSAMPLING: u16 = 530;
    /// What a decoder needs to know beside sizes and places: fill order, options of fax, predictor, tables of JPEG.
    pub(crate) const OF_CODING: [u16; 5] = [266, 292, 293, 317, 347];
}

/// A file and how its numbers are written.
#[derive(Clone, Copy)]
pub(super) struct File<'a> {
    pub(super) bytes: &'a [u8],
    pub(super) order: ByteOrder,
    is_big: bool,
}

/// One directory.
#[derive(Clone, Debug, Default)]
pub(super) struct Directory {
    entries: BTreeMap<u16, Entry>,
}

/// Where the values of a tag are.
#[derive(Clone, Copy, Debug)]
struct Entry {
    kind: u16,
    count: usize,
    start: usize,
}

/// The bytes of a tag's values, their kind and count.
type Raw<'a> = (&'a [u8], u16, usize);

/// Bytes of one value of a kind; `None` for kinds that are not known.
fn kind_bytes(kind: u16) -> Option<usize> {
    Some(match kind {
        1 | 2 | 6 | 7 => 1,
        3 | 8 => 2,
        4 | 9 | 11 | 13 => 4,
        5 | 10 | 12 | 16 | 17 | 18 => 8,
        _ => return None,
    })
}

impl<'a> File<'a> {
    pub(super) fn open(bytes: &'a [u8]) -> Result<Self, Problem> {
        let order = match bytes.get(..2) {
            Some(b"II") => ByteOrder::Little,
            Some(b"MM") => ByteOrder::Big,
            _ => return Err(Problem::damaged(WHAT, "its signature is wrong")),
        };
        let mut file = Self { bytes, order, is_big: false };
        file.is_big = match file.number(2, 2)? {
            42 => false,
            43 => true,
            _ => return Err(Problem::damaged(WHAT, "its signature is wrong")),
        };
        Ok(file)
    }

    fn number(&self, at: usize, width: usize) -> Result<u64, Problem> {
        let field = at.checked_add(width).and_then(|end| self.bytes.get(at..end));
        let outside = || Problem::damaged(WHAT, "it ends before a directory does");
        field.map(|field| self.order.unsigned(field)).ok_or_else(outside)
    }

    /// A number that is a place in the file.
    fn place(&self, at: usize, width: usize) -> Result<usize, Problem> {
        Ok(usize::try_from(self.number(at, width)?).unwrap_or(usize::MAX))
    }

    /// All directories of the chain, at least one; those that only others name are no pages.
    pub(super) fn directories(&self) -> Result<Vec<Directory>, Problem> {
        let (first, width) = if self.is_big { (8, 8) } else { (4, 4) };
        let mut next = self.place(first, width)?;
        let (mut directories, mut seen) = (Vec::new(), HashSet::new());
        // An entry takes at least 12 bytes.
        let mut entries_left = self.bytes.len() / 12;
        while next != 0 {
            if !seen.insert(next) {
                return Err(Problem::damaged(WHAT, "its directories form a ring"));
            }
            let directory;
            (directory, next) = self.directory(next, &mut entries_left)?;
            directories.push(directory);
        }
        if directories.is_empty() {
            Err(Problem::damaged(WHAT, "it has no directory"))
        } else {
            Ok(directories)
        }
    }

    /// One directory, and where the next one is.
    fn directory(&self, start: usize, entries_left: &mut usize) -> Result<(Directory, usize), Problem> {
        let [count_bytes, entry_bytes, field_bytes] = if self.is_big { [8, 20, 8] } else { [2, 12, 4] };
        let count = self.place(start, count_bytes)?;
        *entries_left = entries_left
            .checked_sub(count)
            .ok_or_else(|| Problem::damaged(WHAT, "its directories have more entries than fit into it"))?;
        let mut directory = Directory::default();
        // Below the length of the file: the first number lay in it, and the entries fit.
        let first = start + count_bytes;
        for index in 0..count {
            let entry = first + index * entry_bytes;
            let tag = self.number(entry, 2)? as u16;
            let kind = self.number(entry + 2, 2)? as u16;
            let Some(each) = kind_bytes(kind) else { continue };
            let count = self.place(entry + 4, field_bytes)?;
            let bytes = count.saturating_mul(each);
            if bytes > self.bytes.len() {
                let expected = format!("as many values as {} bytes can hold", self.bytes.len());
                return Err(Problem::field(format!("count of tag {tag}"), count, expected));
            }
            let own = entry + 4 + field_bytes;
            let start = if bytes <= field_bytes { own } else { self.place(own, field_bytes)? };
            directory.entries.entry(tag).or_insert(Entry { kind, count, start });
        }
        Ok((directory, self.place(first + count * entry_bytes, field_bytes)?))
    }

    /// The bytes of a tag's values, its kind and their count.
    pub(super) fn raw(&self, directory: &Directory, tag: u16) -> Result<Option<Raw<'a>>, Problem> {
        let Some(&Entry { kind, count, start }) = directory.entries.get(&tag) else { return Ok(None) };
        let bytes = count * kind_bytes(kind).unwrap_or(1);
        let values = start.checked_add(bytes).and_then(|end| self.bytes.get(start..end));
        let outside = || Problem::damaged(WHAT, format!("the values of tag {tag} lie outside it"));
        Ok(Some((values.ok_or_else(outside)?, kind, count)))
    }

    /// The first whole numbers of a tag, at most so many; none if it is not there.
    pub(super) fn numbers(&self, directory: &Directory, tag: u16, most: usize) -> Result<Vec<u64>, Problem> {
        self.part(directory, tag, 0, most)
    }

    /// At most so many whole numbers of a tag from one of them on.
    pub(super) fn part(
        &self,
        directory: &Directory,
        tag: u16,
        first: usize,
        most: usize,
    ) -> Result<Vec<u64>, Problem> {
        let Some((bytes, kind, _)) = self.raw(directory, tag)? else { return Ok(Vec::new()) };
        match kind {
            1 | 3 | 4 | 13 | 16 | 18 => {
                let values = bytes.chunks_exact(kind_bytes(kind).unwrap_or(1)).skip(first).take(most);
                Ok(values.map(|value| self.order.unsigned(value)).collect())
            }
            _ => Err(Problem::field(format!("type of tag {tag}"), kind, "one of whole numbers")),
        }
    }

    /// The first whole number of a tag.
    pub(super) fn first(&self, directory: &Directory, tag: u16) -> Result<Option<u64>, Problem> {
        Ok(self.numbers(directory, tag, 1)?.first().copied())
    }

    /// A positive ratio, as resolutions are; `None` for anything else.
    pub(super) fn ratio(&self, directory: &Directory, tag: u16) -> Option<f64> {
        let (bytes, kind, _) = self.raw(directory, tag).ok()??;
        let number = |bytes: &[u8]| self.order.unsigned(bytes);
        let value = match (kind, bytes.len()) {
            (5, 8..) => number(&bytes[..4]) as f64 / number(&bytes[4..8]) as f64,
            (11, 4..) => f64::from(f32::from_bits(number(&bytes[..4]) as u32)),
            (12, 8..) => f64::from_bits(number(&bytes[..8])),
            _ => return None,
        };
        Some(value).filter(|value| value.is_finite() && *value > 0.0)
    }

    /// Text, up to its first zero byte; bytes that are not UTF-8 become replacement characters.
    pub(super) fn text(&self, directory: &Directory, tag: u16) -> Option<String> {
        let (bytes, _, _) = self.raw(directory, tag).ok()??;
        let text = bytes.split(|&byte| byte == 0).next().unwrap_or_default();
        Some(String::from_utf8_lossy(text).into_owned())
    }
}
