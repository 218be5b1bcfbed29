//! Samples of any type as the texels that backends hold.
//!
//! | samples | texels | rounding |
//! |---|---|---|
//! | u8, i8 | U8 | none |
//! | u16, i16 | U16 | none |
//! | RGB, RGBA | Rgba8, opaque where there is no fourth channel | none |
//! | u32, i32, f32, f64 | F32, from 0 to at most 1.25 over a window of values | at most 2^-24 of the window in it, 2^-24 of the distance from its start beyond |
//!
//! Relative to a window, since `f32` texels near 1e6 would leave nothing of a range of 1. The window is the range of
//! finite values, or that part of it in which the transfer function changes where this is much smaller: one outlier, or
//! a fill value of 1e20, would else take the digits of all other samples. Beyond [`FARTHEST`] windows samples count as
//! that far: in the cell of such a sample the window is passed within a millionth of a millionth of its length. A sample
//! that is blank (NaN or infinite) becomes NaN.

use volery_frame::{TexelType, Texels};
use volery_pyramid::{BrickSamples, for_brick_samples};
use volery_scene::{ControlPoint, Sample, SampleType, TransferFunction};

/// The farthest that a finite sample is from the window, in windows.
const FARTHEST: f64 = 1e12;

/// A window of values is good enough for another that is smaller by no more than this factor.
const MAX_WINDOW: f64 = 8.0;

/// How samples of one volume become texels: `value = offset + scale * texel`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Encoding {
    pub(crate) texel: TexelType,
    pub(crate) scale: f64,
    pub(crate) offset: f64,
}

impl Encoding {
    /// For samples of a type whose finite values span `range`, `range[1] - range[0]` finite.
    pub(crate) fn new(sample_type: SampleType, range: [f64; 2]) -> Self {
        let integers = |texel, offset| Self { texel, scale: 1.0, offset };
        match sample_type {
            SampleType::U8 => integers(TexelType::U8, 0.0),
            SampleType::I8 => integers(TexelType::U8, f64::from(i8::MIN)),
            SampleType::U16 => integers(TexelType::U16, 0.0),
            SampleType::I16 => integers(TexelType::U16, f64::from(i16::MIN)),
            SampleType::U32 | SampleType::I32 | SampleType::F32 | SampleType::F64 => {
                Self { texel: TexelType::F32, scale: 1.0, offset: 0.0 }.over(range)
            }
            SampleType::Rgb8 | SampleType::Rgba8 => integers(TexelType::Rgba8, 0.0),
        }
    }

    /// The encoding that suits a transfer function: this one where its digits are enough, else one for the values at
    /// which colour or opacity change, the same for most that differ little. `range` is that of the volume.
    pub(crate) fn suiting(&self, transfer: &TransferFunction, range: [f64; 2]) -> Self {
        let points = transfer.points();
        let [low, high] =
            [points[0].value, points[points.len() - 1].value].map(|x| x.clamp(range[0], range[1]));
        let width = high - low;
        let reach = (low - self.offset).abs().max((high - self.offset).abs());
        if self.texel != TexelType::F32 || width <= 0.0 || reach.max(self.scale) <= MAX_WINDOW * width {
            return *self;
        }
        let window = self.over([low, high]);
        let step = window.scale / 4.0;
        Self { offset: (low / step).floor() * step, ..window }
    }

    /// Whether samples of a type on either side of a step of a transfer function may have one texel.
    pub(crate) fn blurs(&self, transfer: &TransferFunction, sample_type: SampleType) -> bool {
        let is_step = |pair: &&[ControlPoint]| {
            pair[0].value == pair[1].value
                && (pair[0].opacity, pair[0].color) != (pair[1].opacity, pair[1].color)
        };
        let blurs = |value: f64| {
            let texel = ((value - self.offset) / self.scale) as f32;
            let rounding = f64::from(texel.abs().next_up() - texel.abs()) * self.scale;
            // From the step to the nearest sample beside it.
            let held = match sample_type {
                SampleType::F64 => return true,
                SampleType::F32 => f64::from(value as f32),
                _ => value.round(),
            };
            let step = if sample_type == SampleType::F32 {
                f64::from((value as f32).abs().next_up() - (value as f32).abs())
            } else {
                1.0
            };
            let gap = if held == value { step } else { (held - value).abs() };
            gap < rounding
        };
        let mut steps = transfer.points().windows(2).filter(is_step).map(|pair| pair[0].value);
        self.texel == TexelType::F32 && steps.any(blurs)
    }

    /// Texels from 0 to at most 1 over a window. In units of a power of two, and from a whole number where the window is
    /// wide enough: whole numbers stay exact, and many others.
    fn over(self, [low, high]: [f64; 2]) -> Self {
        let width = high - low;
        let scale = if width > 0.0 { width.log2().ceil().exp2() } else { 1.0 };
        let scale = if scale.is_normal() { scale } else { width };
        let offset = if width >= 2.0 { low.floor() } else { low };
        Self { scale, offset, ..self }
    }

    /// From the smallest to the largest value that texels can stand for.
    pub(crate) fn texel_span(&self) -> f64 {
        match self.texel {
            TexelType::U8 | TexelType::Rgba8 => self.scale * f64::from(u8::MAX),
            TexelType::U16 => self.scale * f64::from(u16::MAX),
            TexelType::F32 => self.scale,
        }
    }

    /// Lends `samples` as texels, or writes them into `buffer` and lends that.
    pub(crate) fn encode<'a>(&self, samples: &'a BrickSamples, buffer: &'a mut Buffer) -> Texels<'a> {
        match samples {
            BrickSamples::U8(values) => Texels::U8(values),
            BrickSamples::U16(values) => Texels::U16(values),
            BrickSamples::I8(values) => {
                Texels::U8(refill(&mut buffer.bytes, values, |v| v.cast_unsigned() ^ 0x80))
            }
            BrickSamples::I16(values) => {
                Texels::U16(refill(&mut buffer.words, values, |v| v.cast_unsigned() ^ 0x8000))
            }
            BrickSamples::Rgba8(colors) => Texels::Rgba8(colors),
            BrickSamples::Rgb8(colors) => {
                Texels::Rgba8(refill(&mut buffer.colors, colors, |[r, g, b]| [r, g, b, 255]))
            }
            other => for_brick_samples!(other, |values| {
                Texels::F32(refill(&mut buffer.floats, values, |v| self.relative(v.channel(0))))
            }; color _ => Texels::U8(&[])),
        }
    }

    /// Where a value stands in the window, 0 to 1 in it; NaN if it is blank.
    fn relative(&self, value: f64) -> f32 {
        let texel = (value - self.offset) / self.scale;
        if value.is_finite() { texel.clamp(-FARTHEST, FARTHEST) as f32 } else { f32::NAN }
    }
}

/// Room for the texels of a brick whose samples cannot be lent.
#[derive(Default)]
pub(crate) struct Buffer {
    bytes: Vec<u8>,
    words: Vec<u16>,
    floats: Vec<f32>,
    colors: Vec<[u8; 4]>,
}

fn refill<'a, T: Copy, U>(buffer: &'a mut Vec<U>, values: &[T], texel: impl Fn(T) -> U) -> &'a [U] {
    buffer.clear();
    buffer.extend(values.iter().map(|&value| texel(value)));
    buffer
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The values that texels stand for.
    fn decoded(samples: &BrickSamples, range: [f64; 2]) -> Vec<f64> {
        let encoding = Encoding::new(samples.sample_type(), range);
        let mut buffer = Buffer::default();
        let texels: Vec<f64> = match encoding.encode(samples, &mut buffer) {
            Texels::U8(texels) => texels.iter().map(|&t| f64::from(t)).collect(),
            Texels::U16(texels) => texels.iter().map(|&t| f64::from(t)).collect(),
            Texels::F32(texels) => texels.iter().map(|&t| f64::from(t)).collect(),
            Texels::Rgba8(_) => panic!("colours"),
        };
        texels.iter().map(|texel| encoding.offset + encoding.scale * texel).collect()
    }

    #[test]
    fn narrow_integers_are_exact() {
        let bytes = BrickSamples::I8(vec![i8::MIN, -1, 0, 1, i8::MAX]);
        assert_eq!(decoded(&bytes, [-128.0, 127.0]), [-128.0, -1.0, 0.0, 1.0, 127.0]);
        let words = BrickSamples::I16(vec![i16::MIN, -1, 0, 1, i16::MAX]);
        assert_eq!(decoded(&words, [-32768.0, 32767.0]), [-32768.0, -1.0, 0.0, 1.0, 32767.0]);
        assert_eq!(decoded(&BrickSamples::U8(vec![0, 255]), [0.0, 255.0]), [0.0, 255.0]);
        assert_eq!(decoded(&BrickSamples::U16(vec![0, 65535]), [0.0, 65535.0]), [0.0, 65535.0]);
    }

    #[test]
    fn wide_values_are_rounded_by_at_most_two_to_the_minus_25_of_the_range() {
        let check = |samples: BrickSamples, range: [f64; 2]| {
            for (index, found) in decoded(&samples, range).into_iter().enumerate() {
                let off = (found - samples.value(index, 0)).abs() / (range[1] - range[0]);
                // The sum of offset and product rounds once more, in f64.
                let rounding = range[1].abs().max(range[0].abs()) / (range[1] - range[0]) * f64::EPSILON;
                assert!(off <= 2f64.powi(-25) + rounding, "{samples:?} at {index}: {off}");
            }
        };
        let thirds =
            |from: f64, step: f64| (0..4).map(|i| from + step * f64::from(i) / 3.0).collect::<Vec<_>>();
        check(BrickSamples::F64(thirds(1e6, 1.0)), [1e6, 1e6 + 1.0]);
        check(BrickSamples::F64(thirds(-1e300, 1e290)), [-1e300, -1e300 + 1e290]);
        check(
            BrickSamples::F32(vec![16_777_215.0, 16_777_216.0, 16_777_218.0]),
            [16_777_215.0, 16_777_218.0],
        );
        check(BrickSamples::I32(vec![i32::MIN, -1, 12_345, i32::MAX]), [-2_147_483_648.0, 2_147_483_647.0]);
        check(BrickSamples::U32(vec![4_000_000_000, 4_000_000_001]), [4e9, 4_000_000_001.0]);
    }

    #[test]
    fn blanks_are_nan() {
        let found =
            decoded(&BrickSamples::F32(vec![f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 2.0]), [2.0, 2.0]);
        assert!(found[..3].iter().all(|value| value.is_nan()) && found[3] == 2.0, "{found:?}");
    }

    #[test]
    fn colours_are_kept_and_opaque_where_nothing_is_said() {
        let mut buffer = Buffer::default();
        let rgb = Encoding::new(SampleType::Rgb8, [0.0, 255.0]);
        let samples = BrickSamples::Rgb8(vec![[1, 2, 3]]);
        let Texels::Rgba8(found) = rgb.encode(&samples, &mut buffer) else { panic!("other texels") };
        assert_eq!(found, [[1, 2, 3, 255]]);
        let rgba = BrickSamples::Rgba8(vec![[1, 2, 3, 4]]);
        let Texels::Rgba8(found) = rgb.encode(&rgba, &mut buffer) else { panic!("other texels") };
        assert_eq!(found, [[1, 2, 3, 4]]);
    }
}
