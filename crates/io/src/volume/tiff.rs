//! The pages of a TIFF file: gray of 8 to 64 bits, RGB and RGBA of 8.

use std::io::Cursor;

use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;
use volery_scene::SampleType;

use super::image::{MAX_EXPANSION, Page, check_plausible};
use crate::error::Problem;
use crate::layout::ByteOrder;

const WHAT: &str = "the TIFF file";

/// Hands the pages of a TIFF file to `take`, first to last.
pub(super) fn for_each_page(
    bytes: &[u8],
    max_bytes: u64,
    take: &mut dyn FnMut(Page) -> Result<(), Problem>,
) -> Result<(), Problem> {
    let damaged = |error: tiff::TiffError| Problem::damaged(WHAT, error);
    check_first_directory(bytes)?;
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(damaged)?;
    // Pages may share their data, so the file bounds their sum, too.
    let mut budget = (bytes.len() as u64).saturating_mul(MAX_EXPANSION);
    loop {
        let (width, height) = decoder.dimensions().map_err(damaged)?;
        let color = decoder.colortype().map_err(damaged)?;
        let channels = match color {
            ColorType::Gray(8 | 16 | 32 | 64) => 1,
            ColorType::RGB(8) => 3,
            ColorType::RGBA(8) => 4,
            found => {
                let expected = "gray of 8, 16, 32 or 64 bits, or RGB or RGBA of 8";
                return Err(Problem::field("colour type", format!("{found:?}"), expected));
            }
        };
        let pixel_bytes = channels * usize::from(color.bit_depth() / 8);
        let size = check_plausible(width, height, pixel_bytes, bytes.len(), max_bytes)?;
        budget = budget
            .checked_sub(size)
            .ok_or_else(|| Problem::damaged(WHAT, "its pages are far larger than the file"))?;
        let mut limits = Limits::default();
        // It also limits the lists of strips, of which the decoder makes 16 bytes for one in the file.
        limits.decoding_buffer_size = (size as usize).max(bytes.len().saturating_mul(16));
        limits.intermediate_buffer_size = (size as usize).max(bytes.len());
        limits.ifd_value_size = bytes.len();
        decoder = decoder.with_limits(limits);
        check_stored_bytes(&mut decoder, size)?;
        let (scalar, pixels) = scalars(decoder.read_image().map_err(damaged)?)?;
        let sample = match (channels, scalar) {
            (3, SampleType::U8) => SampleType::Rgb8,
            (4, SampleType::U8) => SampleType::Rgba8,
            (1, scalar) => scalar,
            (_, found) => return Err(Problem::field("sample format of colours", found, "u8")),
        };
        if pixels.len() as u64 != size {
            // Such as colours in separate planes, of which the decoder gives the first.
            return Err(Problem::Size { what: "a page", found: pixels.len() as u64, expected: size });
        }
        take(Page { width, height, sample, bytes: pixels })?;
        if !decoder.more_images() {
            return Ok(());
        }
        decoder.next_image().map_err(damaged)?;
    }
}

/// Refuses a first directory with more values than the file could hold: the decoder reads it before it can
/// be given limits.
fn check_first_directory(bytes: &[u8]) -> Result<(), Problem> {
    let order = if bytes.starts_with(b"MM") { ByteOrder::Big } else { ByteOrder::Little };
    // What lies outside the file is for the decoder to find.
    let number = |at: u64, width: usize| {
        let at = usize::try_from(at).ok()?;
        bytes.get(at..at.checked_add(width)?).map(|field| order.unsigned(field))
    };
    let is_big = number(2, 2) == Some(43);
    let (start, [count_bytes, entry_bytes, field_bytes]) =
        if is_big { (number(8, 8), [8, 20, 8]) } else { (number(4, 4), [2, 12, 4]) };
    let Some((start, entries)) = start.and_then(|start| Some((start, number(start, count_bytes)?))) else {
        return Ok(());
    };
    for entry in 0..entries {
        let place =
            entry.saturating_mul(entry_bytes as u64).saturating_add(start).saturating_add(count_bytes as u64);
        let Some(count) = number(place.saturating_add(4), field_bytes) else { return Ok(()) };
        let value_bytes = match number(place + 2, 2) {
            Some(3 | 8) => 2,
            Some(4 | 9 | 11 | 13) => 4,
            Some(5 | 10 | 12 | 16 | 17 | 18) => 8,
            _ => 1,
        };
        if count.saturating_mul(value_bytes) > bytes.len() as u64 {
            let tag = number(place, 2).unwrap_or_default();
            let expected = format!("as many values as {} bytes can hold", bytes.len());
            return Err(Problem::field(format!("count of tag {tag}"), count, expected));
        }
    }
    Ok(())
}

/// Refuses an uncompressed page whose strips or tiles hold fewer bytes than its size needs; the decoder
/// would read on into what follows them.
fn check_stored_bytes(decoder: &mut Decoder<Cursor<&[u8]>>, expected: u64) -> Result<(), Problem> {
    let damaged = |error: tiff::TiffError| Problem::damaged(WHAT, error);
    let compression: Option<u16> = decoder.find_tag_unsigned(Tag::Compression).map_err(damaged)?;
    if compression.unwrap_or(1) != 1 {
        return Ok(());
    }
    for tag in [Tag::StripByteCounts, Tag::TileByteCounts] {
        if let Some(counts) = decoder.find_tag_unsigned_vec::<u64>(tag).map_err(damaged)? {
            let found = counts.into_iter().fold(0, u64::saturating_add);
            if found < expected {
                return Err(Problem::Size { what: "the data of a page", found, expected });
            }
        }
    }
    Ok(())
}

fn scalars(result: DecodingResult) -> Result<(SampleType, Vec<u8>), Problem> {
    fn bytes<T: bytemuck::NoUninit>(values: &[T]) -> Vec<u8> {
        bytemuck::cast_slice(values).to_vec()
    }
    Ok(match result {
        DecodingResult::U8(values) => (SampleType::U8, values),
        DecodingResult::I8(values) => (SampleType::I8, bytes(&values)),
        DecodingResult::U16(values) => (SampleType::U16, bytes(&values)),
        DecodingResult::I16(values) => (SampleType::I16, bytes(&values)),
        DecodingResult::U32(values) => (SampleType::U32, bytes(&values)),
        DecodingResult::I32(values) => (SampleType::I32, bytes(&values)),
        DecodingResult::F32(values) => (SampleType::F32, bytes(&values)),
        DecodingResult::F64(values) => (SampleType::F64, bytes(&values)),
        DecodingResult::U64(_) | DecodingResult::I64(_) | DecodingResult::F16(_) => {
            return Err(Problem::field(
                "sample format",
                "64-bit integers or half floats",
                "another number type",
            ));
        }
    })
}
