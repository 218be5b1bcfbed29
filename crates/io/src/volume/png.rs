//! One PNG image: gray of 8 and 16 bits, RGB and RGBA of 8 bits; others are converted, with a note. As samples of a
//! volume, numbers of colours in a palette are the values, and opacities beside gray are not used; as a picture, both
//! are colours.
//!
//! Only the chunks that make the picture are handed to the decoder, so that nothing else in a file (text,
//! profiles, animation) can do harm.

use std::io::Cursor;
use std::path::Path;

use png::{BitDepth, ColorType, Limits, Transformations};
use volery_scene::SampleType;

use super::image::{Page, check_plausible, unpacked};
use crate::bytes::{load, reserve};
use crate::error::Problem;
use crate::layout::ByteOrder;

const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";
const WHAT: &str = "the PNG image";

/// Reads the picture of a PNG file.
pub(crate) fn read_png(path: &Path) -> Result<Page, Problem> {
    decode(&load(path)?, u64::MAX, Use::Picture, &mut Vec::new())
}

/// What an image is read for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Use {
    Picture,
    Samples,
}

pub(super) fn decode(
    bytes: &[u8],
    max_bytes: u64,
    use_as: Use,
    notes: &mut Vec<String>,
) -> Result<Page, Problem> {
    let chunks = picture_chunks(bytes)?;
    let limits = Limits { bytes: chunks.len().saturating_mul(64).max(1 << 20) };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(chunks), limits);
    let damaged = |error: png::DecodingError| Problem::damaged(WHAT, error);
    let header = decoder.read_header_info().map_err(damaged)?;
    let (width, height) = (header.width, header.height);
    let (color, depth) = (header.color_type, header.bit_depth);
    let has_alpha = color == ColorType::GrayscaleAlpha && use_as == Use::Samples;
    let gray16 = depth == BitDepth::Sixteen && (color == ColorType::Grayscale || has_alpha);
    let has_labels = use_as == Use::Samples && color == ColorType::Indexed;
    let mut transformations = if has_labels { Transformations::IDENTITY } else { Transformations::EXPAND };
    if has_labels {
        notes.push("the values are numbers of colours in a palette, which is not used".to_owned());
    }
    if depth == BitDepth::Sixteen && !gray16 {
        transformations |= Transformations::STRIP_16;
        notes.push("the colours have 16 bits a channel; their upper 8 are used".to_owned());
    }
    let pixel_bytes = match color {
        ColorType::Grayscale => 1 + usize::from(gray16),
        ColorType::Indexed if has_labels => 1,
        ColorType::Rgb | ColorType::Indexed => 3,
        ColorType::Rgba | ColorType::GrayscaleAlpha => 4,
    };
    check_plausible(width, height, pixel_bytes, bytes.len(), max_bytes)?;
    decoder.set_transformations(transformations);
    let mut reader = decoder.read_info().map_err(damaged)?;
    let size = reader.output_buffer_size().unwrap_or(usize::MAX);
    let mut pixels = Vec::new();
    reserve(&mut pixels, size)?;
    pixels.resize(size, 0);
    let info = reader.next_frame(&mut pixels).map_err(damaged)?;
    let sample = match info.color_type {
        ColorType::Grayscale if gray16 => SampleType::U16,
        ColorType::Grayscale => SampleType::U8,
        ColorType::Rgb => SampleType::Rgb8,
        ColorType::Rgba => SampleType::Rgba8,
        ColorType::GrayscaleAlpha if use_as == Use::Samples => {
            notes.push("the opacities beside the gray values are not used".to_owned());
            let each = 1 + usize::from(gray16);
            pixels = pixels.chunks_exact(2 * each).flat_map(|pixel| &pixel[..each]).copied().collect();
            if gray16 { SampleType::U16 } else { SampleType::U8 }
        }
        ColorType::GrayscaleAlpha => {
            pixels = pixels
                .as_chunks::<2>()
                .0
                .iter()
                .flat_map(|&[gray, alpha]| [gray, gray, gray, alpha])
                .collect();
            SampleType::Rgba8
        }
        ColorType::Indexed if has_labels => {
            pixels = unpacked(&pixels, depth as usize, width as usize);
            SampleType::U8
        }
        ColorType::Indexed => return Err(Problem::damaged(WHAT, "its palette was not applied")),
    };
    ByteOrder::Big.to_native(&mut pixels, sample);
    Ok(Page { width, height, sample, bytes: pixels })
}

/// The file without its ancillary chunks; palette and transparency are kept only where colours are indexed.
/// The decoder panics where a palette is not of whole colours, so that is checked here.
fn picture_chunks(bytes: &[u8]) -> Result<Vec<u8>, Problem> {
    let mut rest =
        bytes.strip_prefix(SIGNATURE).ok_or_else(|| Problem::damaged(WHAT, "its signature is wrong"))?;
    let is_indexed = bytes.get(25) == Some(&3);
    let mut kept = SIGNATURE.to_vec();
    while let Some((head, _)) = rest.split_first_chunk::<8>() {
        // Length, name, data, checksum.
        let length = ByteOrder::Big.unsigned(&head[..4]) as usize + 12;
        let Some((chunk, after)) = rest.split_at_checked(length) else {
            return Err(Problem::damaged(WHAT, "it ends inside a chunk"));
        };
        let name = &head[4..];
        let is_palette = is_indexed && matches!(name, b"PLTE" | b"tRNS");
        if name == b"PLTE" && !matches!((length - 12) / 3, 1..=256 if length.is_multiple_of(3)) {
            let expected = "1 to 256 colours of 3 bytes";
            return Err(Problem::field("PLTE", format!("{} bytes", length - 12), expected));
        }
        if is_palette || matches!(name, b"IHDR" | b"IDAT" | b"IEND") {
            kept.extend_from_slice(chunk);
        }
        rest = after;
        if name == b"IEND" {
            return Ok(kept);
        }
    }
    Err(Problem::damaged(WHAT, "it ends without an IEND chunk"))
}
