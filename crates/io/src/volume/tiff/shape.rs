//! What a page is: its size, the type and meaning of its samples, and where its planes lie.

use super::WHAT;
use super::decode::Chunks;
use super::directory::{Directory, File, tag};
use crate::error::Problem;

/// Size and samples of a page.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Shape {
    pub(super) width: u64,
    pub(super) height: u64,
    /// Layers, for volumes in one page.
    pub(super) depth: u64,
    /// Numbers at each place.
    pub(super) samples: u64,
    pub(super) bits: u64,
    /// 1 unsigned, 2 signed, 3 real.
    pub(super) format: u64,
    pub(super) compression: u64,
    pub(super) photometric: u64,
    /// Whether the numbers of a place lie in planes of their own.
    pub(super) is_planar: bool,
    /// Whether the sample after gray or colour is an opacity.
    pub(super) has_alpha: bool,
}

/// What is made of the numbers of a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Take {
    Sample(u64),
    /// The first three or four as a colour.
    Color(u64),
}

impl Shape {
    pub(super) fn of(file: &File, directory: &Directory) -> Result<Self, Problem> {
        let first = |tag: u16| file.first(directory, tag);
        let needed = |tag: u16, name: &str| {
            first(tag)?.filter(|&n| n > 0).ok_or_else(|| Problem::field(name, "missing or 0", "at least 1"))
        };
        let samples = first(tag::SAMPLES)?.unwrap_or(1);
        if !(1..=u64::from(u16::MAX)).contains(&samples) {
            return Err(Problem::field("SamplesPerPixel", samples, "1 to 65535"));
        }
        let same = |tag: u16, name: &str| {
            let values = file.numbers(directory, tag, samples as usize)?;
            match values.first() {
                Some(first) if values.iter().any(|value| value != first) => {
                    let found = values.iter().take(8).map(u64::to_string).collect::<Vec<_>>().join(", ");
                    Err(Problem::field(name, found, "the same for all samples of a page"))
                }
                first => Ok(first.copied().unwrap_or(1)),
            }
        };
        let photometric = first(tag::PHOTOMETRIC)?.unwrap_or(if samples >= 3 { 2 } else { 1 });
        let extra = file.numbers(directory, tag::EXTRA_SAMPLES, 1)?;
        // Opacity is 1 or 2; a fourth sample of colours that nothing is said of is taken for one.
        let is_unsaid = extra.is_empty() && matches!((photometric, samples), (2, 4));
        let shape = Self {
            width: needed(tag::WIDTH, "ImageWidth")?,
            height: needed(tag::HEIGHT, "ImageLength")?,
            depth: first(tag::IMAGE_DEPTH)?.unwrap_or(1).max(1),
            samples,
            bits: same(tag::BITS, "BitsPerSample")?,
            format: same(tag::SAMPLE_FORMAT, "SampleFormat")?,
            compression: first(tag::COMPRESSION)?.unwrap_or(1),
            photometric,
            is_planar: first(tag::PLANAR)? == Some(2) && samples > 1,
            has_alpha: is_unsaid || matches!(extra.first(), Some(1 | 2)),
        };
        shape.check(file, directory)?;
        Ok(shape)
    }

    /// Refuses what cannot be read, by its name.
    fn check(&self, file: &File, directory: &Directory) -> Result<(), Problem> {
        let colors = match self.photometric {
            0..=4 | 6 | 32_803 | 34_892 => None,
            5 => Some("CMYK".to_owned()),
            8..=10 => Some("L*a*b*".to_owned()),
            other => Some(format!("of PhotometricInterpretation {other}")),
        };
        if let Some(colors) = colors {
            return Err(Problem::field("colour", colors, "gray, RGB, YCbCr or a palette"));
        }
        let expected = match self.format {
            1 | 2 | 4 => "1, 2, 4, 8, 16, 32 or 64",
            3 => "16, 32 or 64 for real numbers",
            found => {
                let expected = "1, 2 or 3: whole or real numbers";
                return Err(Problem::field("SampleFormat", found, expected));
            }
        };
        let is_known = match self.format {
            3 => matches!(self.bits, 16 | 32 | 64),
            _ => matches!(self.bits, 1 | 2 | 4 | 8 | 16 | 32 | 64),
        };
        if !is_known {
            return Err(Problem::field("BitsPerSample", self.bits, expected));
        }
        let subsampling = file.numbers(directory, tag::SUBSAMPLING, 2)?;
        if self.photometric == 6 && self.compression != 7 && subsampling != [1, 1] {
            let expected = "1 x 1 where colours are YCbCr and no JPEG";
            return Err(Problem::field("YCbCrSubSampling", "more than 1", expected));
        }
        Ok(())
    }

    /// Numbers of the whole page.
    pub(super) fn numbers(&self) -> u64 {
        [self.width, self.height, self.depth, self.samples].into_iter().fold(1, u64::saturating_mul)
    }

    /// Bytes of a picture of such samples, whose rows start at whole bytes.
    pub(super) fn picture_bytes(&self, width: u64, height: u64, samples: u64) -> u64 {
        width.saturating_mul(samples).saturating_mul(self.bits).div_ceil(8).saturating_mul(height)
    }

    /// Whether the first samples are red, green and blue.
    fn is_color(&self) -> bool {
        matches!(self.photometric, 2 | 6) && self.samples >= 3
    }

    /// Channels that can be asked for: all samples but the opacity beside gray.
    pub(super) fn channels(&self) -> u64 {
        if self.samples == 2 && self.has_alpha { 1 } else { self.samples }
    }

    /// What is made of a page: colours of 8 or 16 bits, else one channel.
    pub(super) fn take(&self, channel: Option<u64>, notes: &mut Vec<String>) -> Take {
        let is_whole = self.format == 1 && matches!(self.bits, 8 | 16);
        if channel.is_none() && self.is_color() && is_whole {
            let count = if self.has_alpha && self.samples >= 4 { 4 } else { 3 };
            if self.bits == 16 {
                notes.push("the colours have 16 bits a channel; their upper 8 are used".to_owned());
            }
            if self.samples > count {
                notes.push(format!("{} samples beside the colour are not used", self.samples - count));
            }
            return Take::Color(count);
        }
        if self.samples == 2 && self.has_alpha {
            notes.push("the opacities beside the gray values are not used".to_owned());
        }
        match self.photometric {
            0 => notes.push("small values are white in the file; values are as they are stored".to_owned()),
            3 => notes.push("the values are numbers of colours in a palette, which is not used".to_owned()),
            _ => {}
        }
        Take::Sample(channel.unwrap_or(0))
    }

    /// Where one layer of a plane is stored, and at which row of the picture there it starts, in pieces of so many
    /// rows with others between.
    pub(super) fn chunks(
        &self,
        file: &File,
        directory: &Directory,
        plane: u64,
        layer: u64,
    ) -> Result<(Chunks, Rows), Problem> {
        let tile_width = file.first(directory, tag::TILE_WIDTH)?;
        let (offsets, counts, tile) = match tile_width {
            Some(width) => {
                let height = file.first(directory, tag::TILE_HEIGHT)?;
                (tag::TILE_OFFSETS, tag::TILE_COUNTS, height.map(|height| [width, height]))
            }
            None => (tag::STRIP_OFFSETS, tag::STRIP_COUNTS, None),
        };
        let rows_per_strip = file.first(directory, tag::ROWS_PER_STRIP)?.unwrap_or(self.height);
        let rows_per_strip = rows_per_strip.clamp(1, self.height);
        let part = |first: u64, count: u64| -> Result<[Vec<u64>; 2], Problem> {
            let [first, most] = [first, count].map(|n| usize::try_from(n).unwrap_or(usize::MAX));
            let list = |tag: u16| file.part(directory, tag, first, most);
            let (offsets, counts) = (list(offsets)?, list(counts)?);
            if (offsets.len().min(counts.len()) as u64) < count {
                return Err(Problem::damaged(WHAT, "a page has fewer strips or tiles than its size needs"));
            }
            Ok([offsets, counts])
        };
        let Some([width, height]) = tile else {
            let each = self.height.div_ceil(rows_per_strip);
            let [offsets, counts] = part((plane * self.depth + layer).saturating_mul(each), each)?;
            let (width, height) = (self.width, self.height);
            let chunks = Chunks { offsets, counts, tile: None, rows_per_strip, width, height };
            return Ok((chunks, Rows { skip: 0, run: height, period: height }));
        };
        if width == 0 || height == 0 || width > u64::from(u32::MAX) || height > u64::from(u32::MAX) {
            return Err(Problem::field("tile", format!("{width} x {height}"), "at least 1 x 1"));
        }
        let depth = file.first(directory, tag::TILE_DEPTH)?.unwrap_or(1).clamp(1, u64::from(u16::MAX));
        let [across, down] = [self.width.div_ceil(width), self.height.div_ceil(height)];
        let each = across.saturating_mul(down);
        let [offsets, counts] =
            part((plane * self.depth.div_ceil(depth) + layer / depth).saturating_mul(each), each)?;
        // A tile of several layers is a picture of these, one below the other.
        let (is_flat, tall) = (depth == 1, height * depth);
        let chunks = Chunks {
            offsets,
            counts,
            tile: Some([width, tall]),
            rows_per_strip,
            width: if is_flat { self.width } else { across * width },
            height: if is_flat { self.height } else { down * tall },
        };
        Ok((chunks, Rows { skip: layer % depth * height, run: height, period: tall }))
    }
}

/// Which rows of a decoded picture belong to a layer: after `skip` rows, `run` of every `period`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Rows {
    skip: u64,
    run: u64,
    period: u64,
}

impl Rows {
    /// The row of the picture that holds a row of the layer.
    pub(super) fn place(&self, row: u64) -> u64 {
        row / self.run * self.period + self.skip + row % self.run
    }
}
