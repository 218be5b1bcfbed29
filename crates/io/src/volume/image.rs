//! Pages: what PNG, JPEG and TIFF have in common; and JPEG.

use std::io::Cursor;

use volery_scene::SampleType;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use crate::choice::checked_channel;
use crate::error::Problem;

/// One image; row 0 comes first, as in the file.
pub(crate) struct Page {
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) sample: SampleType,
    /// The samples in the machine's byte order.
    pub(crate) bytes: Vec<u8>,
}

impl Page {
    /// One channel of a picture if that is asked for; the others have been read as the file has them.
    pub(super) fn channel(self, channel: Option<usize>) -> Result<Self, Problem> {
        let channels = self.sample.channels();
        match checked_channel(channels as u64, channel)? {
            Some(channel) if channels > 1 => {
                let bytes = self.bytes.chunks_exact(channels).map(|color| color[channel as usize]).collect();
                Ok(Self { sample: SampleType::U8, bytes, ..self })
            }
            _ => Ok(self),
        }
    }
}

/// No image compression that is read here gives more than this many bytes for one.
pub(super) const MAX_EXPANSION: u64 = 4096;

/// The bytes of an image, unless they are more than the caller allows or far more than its file could hold;
/// asked before anything is allocated for it.
pub(super) fn check_plausible(
    width: u32,
    height: u32,
    bytes_per_pixel: usize,
    file_bytes: usize,
    max_bytes: u64,
) -> Result<u64, Problem> {
    let required = u128::from(width) * u128::from(height) * bytes_per_pixel as u128;
    let max = (file_bytes as u64).saturating_mul(MAX_EXPANSION);
    if width == 0 || height == 0 || required > u128::from(max) {
        let expected = format!("at least 1 x 1 and at most {max} bytes from a file of {file_bytes}");
        return Err(Problem::field("image size", format!("{width} x {height}"), expected));
    }
    if required > u128::from(max_bytes) {
        return Err(Problem::TooLarge { required, max: max_bytes });
    }
    Ok(required as u64)
}

/// Numbers of 1 to 8 bits, whose rows start at whole bytes, as bytes.
pub(super) fn unpacked(packed: &[u8], bits: usize, width: usize) -> Vec<u8> {
    let rows = packed.chunks_exact((width * bits).div_ceil(8).max(1));
    let number =
        |row: &[u8], first: usize| row[first / 8] >> (8 - bits - first % 8) & (u8::MAX >> (8 - bits));
    rows.flat_map(|row| (0..width).map(move |x| number(row, x * bits))).collect()
}

/// Decodes a JPEG image: gray, or colour as RGB.
pub(super) fn decode_jpeg(bytes: &[u8], max_bytes: u64) -> Result<Page, Problem> {
    // The decoder forgives a scan that stops early, so look for the end of image after the last scan.
    let last = |marker: [u8; 2]| bytes.windows(2).rposition(|pair| pair == marker);
    if last([0xff, 0xd9]) < last([0xff, 0xda]) {
        return Err(Problem::damaged("the JPEG image", "it has no end of image after its last scan"));
    }
    let damaged = |error: zune_jpeg::errors::DecodeErrors| Problem::damaged("the JPEG image", error);
    let side = usize::from(u16::MAX);
    // Strict: damage is an error, not gray blocks.
    let options = DecoderOptions::default().set_strict_mode(true).set_max_width(side).set_max_height(side);
    let mut decoder = JpegDecoder::new_with_options(Cursor::new(bytes), options);
    decoder.decode_headers().map_err(damaged)?;
    let is_gray = decoder.input_colorspace() == Some(ColorSpace::Luma);
    let (width, height) = decoder.dimensions().unwrap_or_default();
    // JPEG's sides have 16 bits.
    let (width, height) = (width as u32, height as u32);
    let channels = if is_gray { 1 } else { 3 };
    let expected = check_plausible(width, height, channels, bytes.len(), max_bytes)?;
    decoder.set_options(options.jpeg_set_out_colorspace(if is_gray {
        ColorSpace::Luma
    } else {
        ColorSpace::RGB
    }));
    let pixels = decoder.decode().map_err(damaged)?;
    if pixels.len() as u64 != expected {
        return Err(Problem::Size { what: "the JPEG image", found: pixels.len() as u64, expected });
    }
    let sample = if is_gray { SampleType::U8 } else { SampleType::Rgb8 };
    Ok(Page { width, height, sample, bytes: pixels })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_few_bits_start_each_row_at_a_byte() {
        assert_eq!(unpacked(&[0b1010_0000, 0b0100_0000], 1, 3), [1, 0, 1, 0, 1, 0]);
        assert_eq!(unpacked(&[0x12, 0x30], 4, 3), [1, 2, 3]);
        assert_eq!(unpacked(&[0b1101_1000], 2, 3), [3, 1, 2]);
        assert_eq!(unpacked(&[7, 9], 8, 2), [7, 9]);
    }
}
