//! TIFF: pages as slices of a volume, of any type of number that crate `tiff` unpacks, in strips or tiles.
//!
//! Pages that are smaller copies of others are passed over. Which slice, channel and time a page is say the texts of
//! ImageJ, OME-XML and tifffile, and how far samples are apart; tags say that, too. One channel of one time is read.
//! ImageJ and tifffile write large stacks as one page with the rest behind it.
//!
//! Values are as they are stored, also where small ones are white or all are numbers of colours in a palette.

use glam::{DMat3, DVec3};
use volery_scene::SampleType;

use super::image::{MAX_EXPANSION, Page, check_plausible};
use crate::choice::{Choices, channel_note, checked_channel, wanted_volume};
use crate::error::Problem;
use crate::layout::ByteOrder;
use crate::numbers::Scalar;
use crate::orientation::Placement;
use crate::volume::ReadOptions;

mod decode;
mod description;
mod directory;
mod shape;

use decode::{Chunks, decode};
use description::{Description, PageAxis};
use directory::{Directory, File, tag};
use shape::{Shape, Take};

const WHAT: &str = "the TIFF file";

/// What a file says of all its slices.
#[derive(Default)]
pub(super) struct Scale {
    /// Distances of columns, rows and slices; `None` if nothing is said.
    pub(super) spacing: Option<[f64; 3]>,
    pub(super) choices: Choices,
    /// Which way rows and columns run: 1 down and to the right, as TIFF numbers it.
    pub(super) orientation: u64,
}

/// The pages of a file at their full size.
struct Pages<'a> {
    file: File<'a>,
    directories: Vec<Directory>,
    /// Of all of them.
    shape: Shape,
}

/// Hands the slices of a file, first to last, to `take`.
pub(super) fn read_slices(
    bytes: &[u8],
    options: &ReadOptions,
    notes: &mut Vec<String>,
    take: &mut dyn FnMut(Page) -> Result<(), Problem>,
) -> Result<Scale, Problem> {
    let pages = Pages::open(bytes, notes)?;
    let description = pages.description(notes);
    let selected = pages.select(description.as_ref(), options, notes)?;
    let what = pages.shape.take(selected.sample, notes);
    // Pages may share their data, so the file bounds their sum, too.
    let mut budget = (bytes.len() as u64).saturating_mul(MAX_EXPANSION);
    for slice in 0..selected.slices {
        let page = match &description {
            Some(description) => description.page(slice, selected.channel, selected.time),
            None => Some(slice),
        };
        let expected = "slices of this file: it is one of a set of files";
        let page =
            page.ok_or_else(|| Problem::field("pages that OME-XML names", "in other files", expected))?;
        for layer in 0..pages.shape.depth {
            let decoded = pages.layer(page, layer, what, selected.is_behind, options.max_bytes)?;
            budget = budget
                .checked_sub(decoded.bytes.len() as u64)
                .ok_or_else(|| Problem::damaged(WHAT, "its pages are far larger than the file"))?;
            take(decoded)?;
        }
    }
    Ok(Scale { choices: selected.choices, ..pages.scale(description.as_ref(), notes) })
}

/// What is read of a file.
struct Selected {
    choices: Choices,
    slices: u64,
    channel: u64,
    time: u64,
    /// The number of each place that is asked for.
    sample: Option<u64>,
    /// Whether all pages but the first lie behind its data.
    is_behind: bool,
}

impl<'a> Pages<'a> {
    fn open(bytes: &'a [u8], notes: &mut Vec<String>) -> Result<Self, Problem> {
        let file = File::open(bytes)?;
        let mut directories = file.directories()?;
        let all = directories.len();
        let is_reduced = |directory: &Directory| -> Result<bool, Problem> {
            let kind = file.first(directory, tag::NEW_SUBFILE_TYPE)?.unwrap_or(0);
            // Bit 0: a smaller copy; bit 2: a mask of another page. The older tag has 2 for the first.
            Ok(kind & 5 != 0 || file.first(directory, tag::SUBFILE_TYPE)? == Some(2))
        };
        let flags = directories.iter().map(is_reduced).collect::<Result<Vec<_>, _>>()?;
        if flags.contains(&false) {
            let mut flags = flags.into_iter();
            directories.retain(|_| !flags.next().unwrap_or(false));
        }
        let shapes: Vec<Shape> =
            directories.iter().map(|directory| Shape::of(&file, directory)).collect::<Result<_, _>>()?;
        // The first of the largest; the others must be like it, or are left out.
        let largest = shapes.iter().rev().max_by_key(|shape| shape.width.saturating_mul(shape.height));
        let shape = largest.cloned().ok_or_else(|| Problem::damaged(WHAT, "it has no page"))?;
        let is_same = |own: &Shape| {
            let of = |shape: &Shape| Shape { compression: 1, photometric: 1, ..shape.clone() };
            of(own) == of(&shape)
        };
        let mut shapes = shapes.iter();
        directories.retain(|_| shapes.next().is_some_and(is_same));
        if directories.len() < all {
            let left_out = all - directories.len();
            notes.push(format!("pages left out, of other sizes, smaller copies or masks: {left_out}"));
        }
        Ok(Self { file, directories, shape })
    }

    fn description(&self, notes: &mut Vec<String>) -> Option<Description> {
        let text = self.file.text(&self.directories[0], tag::DESCRIPTION)?;
        let (samples, channels) = (self.shape.numbers(), self.shape.channels());
        let mut found = Description::parse(&text, self.directories.len() as u64, samples, channels)?;
        let (promised, pages) = (found.num_pages(), self.directories.len() as u64);
        if promised == 1 && pages > 1 && found.writer != "OME-XML" {
            // The text of a single picture, to which others were added.
            return None;
        }
        if promised < pages {
            notes.push(format!(
                "{} speaks of {promised} of {pages} pages; the others are not used",
                found.writer
            ));
        }
        notes.append(&mut found.notes);
        Some(found)
    }

    /// Which slices are read: all of one channel and one time.
    fn select(
        &self,
        description: Option<&Description>,
        options: &ReadOptions,
        notes: &mut Vec<String>,
    ) -> Result<Selected, Problem> {
        let num_pages = self.directories.len() as u64;
        let size = |axis| description.map_or(1, |description| description.size(axis));
        let (channels, times) = (size(PageAxis::Channel), size(PageAxis::Time));
        let slices = description.map_or(num_pages, |description| description.size(PageAxis::Slice));
        let is_behind = match description {
            Some(description) => self.is_behind(description)?,
            None => false,
        };
        let time = wanted_volume(times, options.time_step, notes)?;
        let own_channels = if channels > 1 { channels } else { self.shape.channels() };
        let wanted = checked_channel(own_channels, options.channel)?;
        let of_pages = channels > 1;
        let is_colour = matches!(self.shape.take(None, &mut Vec::new()), Take::Color(_));
        if wanted.is_none() && own_channels > 1 && (of_pages || !is_colour) {
            notes.push(channel_note(0, own_channels));
        }
        Ok(Selected {
            choices: Choices { channels: own_channels, time_steps: times },
            slices,
            channel: wanted.filter(|_| of_pages).unwrap_or(0),
            time,
            sample: wanted.filter(|_| !of_pages),
            is_behind,
        })
    }

    /// Whether the pages that a text promises and no directory holds lie behind the first one's data.
    fn is_behind(&self, description: &Description) -> Result<bool, Problem> {
        let (promised, found) = (description.num_pages(), self.directories.len() as u64);
        if promised <= found || description.writer == "OME-XML" {
            return Ok(false);
        }
        let (chunks, _) = self.shape.chunks(&self.file, &self.directories[0], 0, 0)?;
        let Some(&start) = chunks.offsets.first().filter(|_| self.shape.compression == 1) else {
            let expected = format!("{promised} by the text of {}", description.writer);
            return Err(Problem::field("number of pages", found, expected));
        };
        let held = (self.file.bytes.len() as u64).saturating_sub(start);
        let expected = self.page_bytes().saturating_mul(promised);
        if held < expected {
            return Err(Problem::Size { what: "the data of all pages", found: held, expected });
        }
        Ok(true)
    }

    /// Bytes of an uncompressed page.
    fn page_bytes(&self) -> u64 {
        let Shape { width, height, depth, samples, .. } = self.shape;
        self.shape.picture_bytes(width, height.saturating_mul(depth), samples)
    }

    /// One layer of a page.
    fn layer(
        &self,
        page: u64,
        layer: u64,
        take: Take,
        is_behind: bool,
        max_bytes: u64,
    ) -> Result<Page, Problem> {
        let directory =
            if is_behind { Some(&self.directories[0]) } else { self.directories.get(page as usize) };
        let directory = directory.ok_or_else(|| {
            let expected = format!("page {page} of its text");
            Problem::field("number of pages", self.directories.len(), expected)
        })?;
        let shape = if is_behind { self.shape.clone() } else { Shape::of(&self.file, directory)? };
        let [width, height] = [shape.width, shape.height].map(u32::try_from);
        let (Ok(width), Ok(height)) = (width, height) else {
            return Err(Problem::field(
                "image size",
                format!("{} x {}", shape.width, shape.height),
                "sides below 2^32",
            ));
        };
        let bytes_each = shape.samples.saturating_mul(shape.bits.div_ceil(8)) as usize;
        check_plausible(width, height, bytes_each, self.file.bytes.len(), u64::MAX)?;
        let planes = match take {
            Take::Sample(sample) => sample..sample + 1,
            Take::Color(count) => 0..count,
        };
        let mut numbers: Vec<Numbers> = Vec::new();
        if shape.is_planar {
            for plane in planes {
                numbers.push(self.plane(directory, &shape, [page, layer, plane], is_behind, max_bytes)?);
            }
        } else {
            let all = self.plane(directory, &shape, [page, layer, 0], is_behind, max_bytes)?;
            numbers.extend(planes.map(|sample| all.sample(sample as usize)));
        }
        let (sample, bytes) = joined(&numbers, take)?;
        check_plausible(width, height, sample.bytes(), self.file.bytes.len(), max_bytes)?;
        Ok(Page { width, height, sample, bytes })
    }

    /// The numbers of a layer of a plane, all of a place together.
    fn plane(
        &self,
        directory: &Directory,
        shape: &Shape,
        [page, layer, plane]: [u64; 3],
        is_behind: bool,
        max_bytes: u64,
    ) -> Result<Numbers, Problem> {
        let samples = if shape.is_planar { 1 } else { shape.samples };
        let (mut chunks, rows) = shape.chunks(&self.file, directory, plane, layer)?;
        if is_behind {
            let layer_bytes = shape.picture_bytes(shape.width, shape.height, samples);
            let before = page.saturating_mul(self.page_bytes());
            let first = self.shape.chunks(&self.file, directory, 0, 0)?.0.offsets[0];
            let layers = plane * shape.depth + layer;
            let start = first.saturating_add(before).saturating_add(layers.saturating_mul(layer_bytes));
            let (width, height) = (shape.width, shape.height);
            chunks = Chunks {
                offsets: vec![start],
                counts: vec![layer_bytes],
                tile: None,
                rows_per_strip: height,
                width,
                height,
            };
        }
        let size = |side: u64| u32::try_from(side).unwrap_or(u32::MAX);
        let bytes_each = samples.saturating_mul(shape.bits.div_ceil(8)) as usize;
        let limit = max_bytes.saturating_mul(samples);
        check_plausible(size(chunks.width), size(chunks.height), bytes_each, self.file.bytes.len(), limit)?;
        let decoded = decode(&self.file, directory, shape, &chunks, samples)?;
        let mut numbers = Numbers { scalar: decoded.scalar, samples: samples as usize, bytes: decoded.bytes };
        if (chunks.width, chunks.height) != (shape.width, shape.height) {
            let each = numbers.samples * numbers.scalar.bytes() as usize;
            let (own, whole) = (shape.width as usize * each, chunks.width as usize * each);
            let row = |row: u64| {
                let start = rows.place(row) as usize * whole;
                &numbers.bytes[start..start + own]
            };
            numbers.bytes = (0..shape.height).flat_map(row).copied().collect();
        }
        Ok(numbers)
    }

    /// How far samples are apart, by the text or the tags; and which way rows and columns run.
    fn scale(&self, description: Option<&Description>, notes: &mut Vec<String>) -> Scale {
        let directory = &self.directories[0];
        let orientation = self.file.first(directory, tag::ORIENTATION).ok().flatten().unwrap_or(1);
        let ratio = |tag: u16| self.file.ratio(directory, tag).map(|per_unit| 1.0 / per_unit);
        let of_tags = [ratio(tag::X_RESOLUTION), ratio(tag::Y_RESOLUTION)];
        let unit = self.file.first(directory, tag::RESOLUTION_UNIT).ok().flatten().unwrap_or(2);
        let text = description.map_or([None; 3], |description| description.spacing);
        let unit_of_text = description.and_then(|description| description.unit.as_deref());
        // ImageJ counts the resolution in the unit of its text.
        let is_in_text = unit_of_text.is_some() || text[2].is_some();
        let millimeters = match unit {
            2 if !is_in_text => 25.4,
            3 if !is_in_text => 10.0,
            _ => 1.0,
        };
        let [x, y] = [0, 1].map(|axis| text[axis].or(of_tags[axis].map(|length| length * millimeters)));
        let spacing = match (x.or(y), text[2]) {
            (None, None) => None,
            (Some(any), z) => {
                let (x, y) = (x.unwrap_or(any), y.unwrap_or(any));
                if z.is_none() && self.directories.len() > 1 && (x, y) != (1.0, 1.0) {
                    notes.push(
                        "the file does not say how far slices are apart; as far as columns is taken"
                            .to_owned(),
                    );
                }
                Some([x, y, z.unwrap_or(x)])
            }
            (None, Some(z)) => Some([1.0, 1.0, z]),
        };
        let unit = unit_of_text.or((millimeters != 1.0 && spacing.is_some()).then_some("mm"));
        if let (Some(unit), Some(_)) = (unit, spacing) {
            notes.push(format!("the spacing is in {unit}"));
        }
        Scale { spacing, orientation, choices: Choices::default() }
    }
}

impl Scale {
    /// The way of rows and columns that is not down and to the right; `None` for the usual one.
    pub(super) fn placement(&self, dims: [usize; 3], spacing: DVec3) -> Option<Placement> {
        // Of 1 to 8 where the row 0 and the column 0 are: whether rows and columns are exchanged, and which run back.
        let (is_exchanged, x_back, y_back) = match self.orientation {
            2 => (false, true, false),
            3 => (false, true, true),
            4 => (false, false, true),
            5 => (true, false, false),
            6 => (true, false, true),
            7 => (true, true, true),
            8 => (true, true, false),
            _ => return None,
        };
        let sign = |is_back: bool| if is_back { -1.0 } else { 1.0 };
        let extent = |axis: usize| (dims[axis] - 1) as f64 * spacing[axis];
        let column_axis = if is_exchanged { DVec3::Y } else { DVec3::X };
        let row_axis = if is_exchanged { DVec3::X } else { DVec3::Y };
        let axes = DMat3::from_cols(column_axis * sign(x_back), row_axis * sign(y_back), DVec3::Z);
        let back = |axis: usize, is_back: bool| axes.col(axis) * if is_back { -extent(axis) } else { 0.0 };
        let origin = back(0, x_back) + back(1, y_back);
        Some(Placement::plain(axes * DMat3::from_diagonal(spacing), origin))
    }
}

/// Numbers of a picture.
struct Numbers {
    scalar: Scalar,
    /// Of each place.
    samples: usize,
    bytes: Vec<u8>,
}

impl Numbers {
    /// One number of each place.
    fn sample(&self, sample: usize) -> Self {
        let each = self.scalar.bytes() as usize;
        let bytes = if self.samples == 1 {
            self.bytes.clone()
        } else {
            let places = self.bytes.chunks_exact(each * self.samples);
            places.flat_map(|place| &place[sample * each..(sample + 1) * each]).copied().collect()
        };
        Self { scalar: self.scalar, samples: 1, bytes }
    }
}

/// The samples out of the numbers of their channels.
fn joined(channels: &[Numbers], take: Take) -> Result<(SampleType, Vec<u8>), Problem> {
    if let Take::Color(count) = take {
        // The upper byte of 16 bits.
        let each = channels[0].scalar.bytes() as usize;
        let upper = if ByteOrder::NATIVE == ByteOrder::Little { each - 1 } else { 0 };
        let places = channels[0].bytes.len() / each;
        let color = |place: usize| channels.iter().map(move |channel| channel.bytes[place * each + upper]);
        let sample = if count == 4 { SampleType::Rgba8 } else { SampleType::Rgb8 };
        return Ok((sample, (0..places).flat_map(color).collect()));
    }
    let Numbers { scalar, bytes, .. } = &channels[0];
    let doubles = |convert: fn([u8; 8]) -> f64| {
        bytes.as_chunks::<8>().0.iter().flat_map(|&number| convert(number).to_ne_bytes()).collect()
    };
    let bytes = match scalar {
        Scalar::U64 => doubles(|number| u64::from_ne_bytes(number) as f64),
        Scalar::I64 => doubles(|number| i64::from_ne_bytes(number) as f64),
        _ => bytes.clone(),
    };
    Ok((scalar.sample_type(), bytes))
}
