//! Images as volumes: one image is one layer, the pages of a TIFF and the slices of a folder are a stack.
//!
//! Row 0 of an image is y = 0, the first slice z = 0. Slices come in natural order of their names: runs of
//! digits compare as numbers, so `slice10` follows `slice9`. All must have one size and type. Spacing is 1
//! unless a TIFF of all slices or the caller says otherwise.

use std::cmp::Ordering;
use std::path::{Path, PathBuf};

use bytemuck::Pod;
use volery_scene::{Sample, SampleType, Samples};

use super::image::{Page, decode_jpeg};
use super::tiff::{self, Scale};
use super::{Decoded, Format, foreign, lower_name, png};
use crate::bytes::load;
use crate::choice::wanted_volume;
use crate::error::Problem;
use crate::layout::{ByteOrder, Layout, checked_spacing, for_sample_type};
use crate::volume::ReadOptions;

pub(super) fn read_file(path: &Path, format: Format, options: &ReadOptions) -> Result<Decoded, Problem> {
    let mut stack = Stack::new(options);
    stack.add_file(path, format)?;
    stack.finish()
}

pub(super) fn read_folder(path: &Path, options: &ReadOptions) -> Result<Decoded, Problem> {
    let (mut slices, mut others) = (Vec::new(), Vec::new());
    for entry in std::fs::read_dir(path).map_err(Problem::Io)? {
        let file = entry.map_err(Problem::Io)?.path();
        match slice_format(&file) {
            Some(format) => slices.push((file, format)),
            None => others.push(file),
        }
    }
    if slices.is_empty() {
        others.sort();
        if let Some((format, way)) = foreign::format_of_folder(path, &others) {
            return Err(Problem::field("format", format!("{format} in a folder"), way));
        }
        let found = "a folder without slices";
        return Err(Problem::Kind { found, expected: "a volume file or a folder of PNG or TIFF slices" });
    }
    slices.sort_by(|(a, _), (b, _)| natural_order(a, b));
    let mut stack = Stack::new(options);
    if !others.is_empty() {
        let others = others.len();
        stack.notes.push(format!("{others} files of the folder are no PNG or TIFF and are not used"));
    }
    for (file, format) in slices {
        stack.add_file(&file, format).map_err(|problem| problem.of_part(&file))?;
        // Distances of one slice say nothing of the next.
        stack.scale.spacing = None;
    }
    stack.finish()
}

fn slice_format(path: &Path) -> Option<Format> {
    let name = lower_name(path);
    if name.starts_with('.') {
        None
    } else if name.ends_with(".png") {
        Some(Format::Png)
    } else if name.ends_with(".tif") || name.ends_with(".tiff") {
        Some(Format::Tiff)
    } else {
        None
    }
}

/// Names in the order a person counts: digits as numbers, everything else by its bytes.
fn natural_order(a: &PathBuf, b: &PathBuf) -> Ordering {
    let bytes = |path: &PathBuf| path.file_name().unwrap_or_default().as_encoded_bytes().to_vec();
    let (a, b) = (bytes(a), bytes(b));
    let (mut left, mut right) = (&a[..], &b[..]);
    loop {
        let [l, r] = [&mut left, &mut right].map(take_word);
        let is_number = |word: &[u8]| word.first().is_some_and(u8::is_ascii_digit);
        let order = if is_number(l) && is_number(r) {
            let [l, r] = [l, r].map(without_zeros);
            l.len().cmp(&r.len()).then_with(|| l.cmp(r))
        } else {
            l.cmp(r)
        };
        if order.is_ne() {
            return order;
        }
        if l.is_empty() {
            // `a1` and `a01` are the same number; their bytes decide.
            return a.cmp(&b);
        }
    }
}

/// Takes a run of digits or one other byte from the front.
fn take_word<'a>(rest: &mut &'a [u8]) -> &'a [u8] {
    let digits = rest.iter().take_while(|byte| byte.is_ascii_digit()).count();
    let (word, after) = rest.split_at(digits.max(1).min(rest.len()));
    *rest = after;
    word
}

fn without_zeros(digits: &[u8]) -> &[u8] {
    &digits[digits.iter().take_while(|&&digit| digit == b'0').count()..]
}

/// A volume that grows by pages of equal size and type.
struct Stack<'a> {
    options: &'a ReadOptions,
    /// Width, height and type of every page.
    shape: Option<(u32, u32, SampleType)>,
    num_pages: u64,
    values: Box<dyn Grow>,
    notes: Vec<String>,
    /// What the file says of distances and directions; nothing for a folder, whose files know no distance of slices.
    scale: Scale,
}

impl<'a> Stack<'a> {
    fn new(options: &'a ReadOptions) -> Self {
        let values = Box::new(Vec::<u8>::new());
        Self { options, shape: None, num_pages: 0, values, notes: Vec::new(), scale: Scale::default() }
    }

    fn add_file(&mut self, path: &Path, format: Format) -> Result<(), Problem> {
        let bytes = load(path)?;
        let max_bytes = self.options.max_bytes;
        let mut notes = Vec::new();
        match format {
            Format::Jpeg => self.add_picture(decode_jpeg(&bytes, max_bytes)?)?,
            Format::Png => {
                self.add_picture(png::decode(&bytes, max_bytes, png::Use::Samples, &mut notes)?)?
            }
            _ => {
                self.scale = tiff::read_slices(&bytes, self.options, &mut notes, &mut |page| self.add(page))?;
            }
        }
        // The slices of a folder often say the same.
        notes.retain(|note| !self.notes.contains(note));
        self.notes.append(&mut notes);
        Ok(())
    }

    /// Adds a picture, or the channel of it that is asked for; a file of one has one time.
    fn add_picture(&mut self, page: Page) -> Result<(), Problem> {
        wanted_volume(1, self.options.time_step, &mut self.notes)?;
        self.scale.choices.channels = page.sample.channels() as u64;
        self.add(page.channel(self.options.channel)?)
    }

    fn add(&mut self, page: Page) -> Result<(), Problem> {
        let Page { width, height, sample, bytes } = page;
        let found = (width, height, sample);
        let expected = *self.shape.get_or_insert(found);
        if found != expected {
            let show = |(width, height, sample)| format!("{width} x {height} {sample}");
            let expected = format!("{} as the first", show(expected));
            return Err(Problem::field(format!("image {}", self.num_pages), show(found), expected));
        }
        if self.num_pages == 0 {
            self.values = for_sample_type!(sample, T => Box::new(Vec::<T>::new()));
        }
        self.num_pages += 1;
        // How many pages there will be is only known at the end, so the caller's dims wait until then.
        self.layout(&ReadOptions { dims: None, ..self.options.clone() })?;
        self.values.grow(&bytes)
    }

    fn layout(&self, options: &ReadOptions) -> Result<Layout, Problem> {
        let (width, height, sample) = self.shape.unwrap_or((0, 0, SampleType::U8));
        let dims = [width.into(), height.into(), self.num_pages];
        Layout::new("image size", dims, sample, ByteOrder::NATIVE, options)
    }

    fn finish(mut self) -> Result<Decoded, Problem> {
        let layout = self.layout(self.options)?;
        let spacing = self.scale.spacing.unwrap_or([1.0; 3]);
        let spacing = checked_spacing("spacing", spacing, layout.dims, self.options, &mut self.notes)?;
        let samples = self.values.finish();
        let mut decoded = Decoded::new(layout.dims, spacing, samples, self.notes);
        decoded.choices = self.scale.choices;
        decoded.placement = self.scale.placement(layout.dims, spacing);
        Ok(decoded)
    }
}

/// Samples of a type known at run time that arrive as bytes.
trait Grow {
    fn grow(&mut self, bytes: &[u8]) -> Result<(), Problem>;
    fn finish(self: Box<Self>) -> Samples;
}

impl<T: Sample + Pod> Grow for Vec<T>
where
    Samples: From<Vec<T>>,
{
    fn grow(&mut self, bytes: &[u8]) -> Result<(), Problem> {
        let count = bytes.len() / size_of::<T>();
        self.try_reserve(count).map_err(|_| Problem::TooLarge {
            required: ((self.len() + count) * size_of::<T>()) as u128,
            max: (self.capacity() * size_of::<T>()) as u64,
        })?;
        self.extend(bytes.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned::<T>));
        Ok(())
    }

    fn finish(self: Box<Self>) -> Samples {
        Samples::from(*self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_sort_as_a_person_counts() {
        let sorted = ["", "a", "a1", "a01", "a2", "a10", "a10b", "a99999999999999999999999", "b", "b-1"];
        for (i, a) in sorted.iter().enumerate() {
            for (j, b) in sorted.iter().enumerate() {
                let order = natural_order(&PathBuf::from(a), &PathBuf::from(b));
                // Of equal numbers the bytes decide: "a01" before "a1".
                let expected = if [*a, *b] == ["a1", "a01"] || [*a, *b] == ["a01", "a1"] {
                    j.cmp(&i)
                } else {
                    i.cmp(&j)
                };
                assert_eq!(order, expected, "{a} {b}");
            }
        }
    }
}
