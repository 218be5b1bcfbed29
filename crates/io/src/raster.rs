//! Arrays of any number of axes, out of which one volume is read.
//!
//! # Method
//! A format says what each axis of its array is: of space, of channels, or of further volumes such as times. One
//! volume and, of channels, one, all as a colour or their magnitude are read. What lies in the file as it is wanted
//! is lent or read in one piece; otherwise the numbers are walked through in the order of the file, once, and each
//! goes where it belongs. Memory follows the numbers that arrive.

use std::io::{self, Read};

use bytemuck::Pod;
use volery_scene::{Sample, SampleType, Samples, for_samples};

use crate::bytes::{FileBytes, read_samples, reserve, samples_at};
use crate::choice::{Choices, channel_note, checked_channel, wanted_volume};
use crate::error::Problem;
use crate::layout::{ByteOrder, Layout};
use crate::numbers::{DATA, Number, Numbers, Scalar, for_scalar};
use crate::volume::ReadOptions;

/// Whole numbers from here on are not all exact in `f64`.
const INEXACT_FROM: f64 = 9_007_199_254_740_992.0;

/// What an axis of an array is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// x, y or z: the first three of these.
    Space,
    /// Numbers of one place.
    Channel,
    /// Of volumes: times, directions, files.
    Volume,
}

/// What the numbers of one place are, where there are several.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Meaning {
    /// Red, green, blue, and maybe opacity.
    Color,
    /// The components of a vector or tensor.
    Components,
    /// Measurements that have nothing to do with each other.
    Channels,
}

/// An array as its header describes it.
pub(crate) struct Array<'a> {
    /// What errors call its sizes.
    pub(crate) field: &'a str,
    /// Fastest first.
    pub(crate) axes: Vec<(u64, Role)>,
    pub(crate) scalar: Scalar,
    pub(crate) order: ByteOrder,
    pub(crate) meaning: Meaning,
}

/// What is made of the numbers of one place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Take {
    One(u64),
    Magnitude,
    /// The first bytes, and how far their bits are shifted down.
    Color {
        shift: u32,
    },
}

/// An array of which it is settled what is read.
pub(crate) struct Raster {
    pub(crate) layout: Layout,
    pub(crate) choices: Choices,
    scalar: Scalar,
    take: Take,
    /// Numbers before the first that may be needed, and from there to the last.
    skip: u64,
    count: usize,
    /// For each axis of the part its size, the step in the samples, and, of channels and volumes, which index is
    /// wanted.
    axes: Vec<Walked>,
    /// Whether the part is the samples as they lie.
    is_plain: bool,
    /// Numbers of the whole array.
    total: u64,
}

/// An axis that is walked along.
#[derive(Clone, Copy)]
struct Walked {
    size: u64,
    role: Role,
    /// How far one step goes in the samples; 0 for channels and volumes.
    step: usize,
    /// The only index that is wanted.
    only: Option<u64>,
}

impl Array<'_> {
    /// Settles what is read, by what the caller wants.
    pub(crate) fn plan(self, options: &ReadOptions, notes: &mut Vec<String>) -> Result<Raster, Problem> {
        let sizes: Vec<u64> = self.axes.iter().map(|(size, _)| *size).collect();
        if sizes.contains(&0) {
            return Err(Problem::field(self.field, format!("{sizes:?}"), "at least 1 along each axis"));
        }
        let axes = with_roles(&self.axes);
        let product =
            |role| axes.iter().filter(|axis| axis.1 == role).fold(1, |n: u64, axis| n.saturating_mul(axis.0));
        let (channels, volumes) = (product(Role::Channel), product(Role::Volume));
        let take = self.take(channels, options, notes)?;
        let volume = wanted_volume(volumes, options.time_step, notes)?;
        let mut spaces = axes.iter().filter(|axis| axis.1 == Role::Space).map(|axis| axis.0);
        let dims: [u64; 3] = std::array::from_fn(|_| spaces.next().unwrap_or(1));
        let sample = sample_type(self.scalar, take, channels);
        let layout = Layout::new(self.field, dims, sample, self.order, options)?;
        let total = sizes.iter().try_fold(1_u64, |total, &size| total.checked_mul(size));
        let total = total.filter(|total| total.checked_mul(8).is_some());
        let total = total
            .ok_or_else(|| Problem::field(self.field, format!("{sizes:?}"), "fewer than 2^61 numbers"))?;
        let choices = Choices { channels, time_steps: volumes };
        Ok(Raster { choices, ..self.raster(axes, layout, take, volume, total) })
    }

    fn take(&self, channels: u64, options: &ReadOptions, notes: &mut Vec<String>) -> Result<Take, Problem> {
        if let Some(channel) = checked_channel(channels, options.channel)? {
            return Ok(Take::One(channel));
        }
        let is_color = matches!(channels, 3 | 4) && self.meaning != Meaning::Channels;
        match (self.scalar, self.meaning) {
            _ if channels == 1 => Ok(Take::One(0)),
            (Scalar::U8, _) if is_color => Ok(Take::Color { shift: 0 }),
            (Scalar::U16, Meaning::Color) if is_color => {
                notes.push("the colours have 16 bits a channel; their upper 8 are used".to_owned());
                Ok(Take::Color { shift: 8 })
            }
            (_, Meaning::Components) => {
                notes.push(format!(
                    "the samples have {channels} components; their magnitude is used (a channel, 0 to {}, can be \
                     chosen)",
                    channels - 1
                ));
                Ok(Take::Magnitude)
            }
            _ => {
                notes.push(channel_note(0, channels));
                Ok(Take::One(0))
            }
        }
    }

    fn raster(
        &self,
        axes: Vec<(u64, Role)>,
        layout: Layout,
        take: Take,
        mut volume: u64,
        total: u64,
    ) -> Raster {
        let mut step = 1;
        let mut walked: Vec<Walked> = Vec::new();
        for (size, role) in axes {
            let (mut own_step, mut only) = (0, None);
            match role {
                // The product of the sizes of space fits: it is that of the layout.
                Role::Space => (own_step, step) = (step, step * size as usize),
                Role::Channel => only = if let Take::One(channel) = take { Some(channel) } else { None },
                Role::Volume => (only, volume) = (Some(volume % size), volume / size),
            }
            walked.push(Walked { size, role, step: own_step, only });
        }
        // Of axes of volumes that are the slowest, only the part that is wanted is walked through.
        let mut skip = 0;
        let mut count = total;
        while let Some(&Walked { size, only: Some(index), .. }) = walked.last() {
            count /= size;
            skip += index * count;
            walked.pop();
        }
        let is_one = |axis: &Walked| axis.role == Role::Space || axis.size == 1;
        let first_is_color = walked.first().is_some_and(|axis| axis.role == Role::Channel);
        let is_plain = layout_scalar(layout.sample) == Some(self.scalar)
            && match take {
                Take::One(_) => walked.iter().all(is_one),
                Take::Color { shift } => shift == 0 && first_is_color && walked[1..].iter().all(is_one),
                Take::Magnitude => false,
            };
        // A count that memory cannot address is no file's: reading ends where the file does.
        let count = usize::try_from(count).unwrap_or(usize::MAX);
        Raster {
            layout,
            choices: Choices::default(),
            scalar: self.scalar,
            take,
            skip,
            count,
            axes: walked,
            is_plain,
            total,
        }
    }
}

/// The fourth axis of space and the second one of channels count as axes of volumes.
fn with_roles(axes: &[(u64, Role)]) -> Vec<(u64, Role)> {
    let mut left = [3, 1];
    let mut role = |role| {
        let left = match role {
            Role::Space => &mut left[0],
            Role::Channel => &mut left[1],
            Role::Volume => return role,
        };
        if *left == 0 {
            return Role::Volume;
        }
        *left -= 1;
        role
    };
    axes.iter().map(|&(size, given)| (size, role(given))).collect()
}

/// The type of a sample that holds what is taken.
fn sample_type(scalar: Scalar, take: Take, channels: u64) -> SampleType {
    match take {
        Take::Color { .. } if channels == 3 => SampleType::Rgb8,
        Take::Color { .. } => SampleType::Rgba8,
        Take::Magnitude if scalar.bytes() <= 2 || scalar == Scalar::F32 => SampleType::F32,
        Take::Magnitude => SampleType::F64,
        Take::One(_) => scalar.sample_type(),
    }
}

/// The scalar that a type of sample has in memory.
fn layout_scalar(sample: SampleType) -> Option<Scalar> {
    let scalars = [
        Scalar::U8,
        Scalar::I8,
        Scalar::U16,
        Scalar::I16,
        Scalar::U32,
        Scalar::I32,
        Scalar::F32,
        Scalar::F64,
    ];
    match sample {
        SampleType::Rgb8 | SampleType::Rgba8 => Some(Scalar::U8),
        _ => scalars.into_iter().find(|scalar| scalar.sample_type() == sample),
    }
}

impl Raster {
    /// Bytes of the whole array in binary form.
    pub(crate) fn array_bytes(&self) -> u64 {
        self.total * self.scalar.bytes()
    }

    /// Whether nothing of the array lies behind what is read.
    pub(crate) fn is_read_to_its_end(&self) -> bool {
        self.skip + self.count as u64 == self.total
    }

    /// Whether the samples are lengths of vectors.
    pub(crate) fn is_magnitude(&self) -> bool {
        self.take == Take::Magnitude
    }

    /// The samples that lie at `offset` in a file: without a copy where they are as they are wanted.
    pub(crate) fn in_file(
        &self,
        bytes: FileBytes,
        offset: u64,
        notes: &mut Vec<String>,
    ) -> Result<Samples, Problem> {
        let offset = offset.saturating_add(self.skip * self.scalar.bytes());
        if self.is_plain {
            return samples_at(bytes, offset, &self.layout);
        }
        let start = usize::try_from(offset).ok().and_then(|offset| bytes.get(offset..)).unwrap_or_default();
        self.walk(Numbers::Bytes(Box::new(start), self.layout.order), notes)
    }

    /// The samples from a stream of the array, of which nothing is believed.
    pub(crate) fn in_stream(
        &self,
        source: &mut dyn Read,
        what: &'static str,
        notes: &mut Vec<String>,
    ) -> Result<Samples, Problem> {
        let gap = self.skip * self.scalar.bytes();
        io::copy(&mut (&mut *source).take(gap), &mut io::sink())
            .map_err(|error| Problem::damaged(what, error))?;
        if self.is_plain {
            return read_samples(source, what, &self.layout);
        }
        self.walk(Numbers::Bytes(Box::new(source), self.layout.order), notes)
    }

    /// The samples from the numbers of the array, which may be text.
    pub(crate) fn in_numbers(&self, numbers: Numbers, notes: &mut Vec<String>) -> Result<Samples, Problem> {
        match numbers {
            Numbers::Bytes(mut source, _) => self.in_stream(&mut *source, DATA, notes),
            // All of them, so that one too many is seen.
            text => self.walk_all(text, notes),
        }
    }

    /// The samples from the numbers that may be needed.
    fn walk(&self, numbers: Numbers, notes: &mut Vec<String>) -> Result<Samples, Problem> {
        for_scalar!(self.scalar, T => self.gather::<T>(numbers, 0, self.count, notes))
    }

    fn walk_all(&self, numbers: Numbers, notes: &mut Vec<String>) -> Result<Samples, Problem> {
        let total = usize::try_from(self.total).unwrap_or(usize::MAX);
        for_scalar!(self.scalar, T => self.gather::<T>(numbers, self.skip, total, notes))
    }

    fn gather<T: Number>(
        &self,
        numbers: Numbers,
        skip: u64,
        count: usize,
        notes: &mut Vec<String>,
    ) -> Result<Samples, Problem> {
        let run = Run { raster: self, skip, count };
        let samples: Samples = match (self.take, self.layout.sample) {
            (Take::Color { shift }, SampleType::Rgb8) => run
                .place(numbers, |slot: &mut [u8; 3], channel, value: T| slot[channel] = value.byte(shift))?
                .into(),
            (Take::Color { shift }, _) => run
                .place(numbers, |slot: &mut [u8; 4], channel, value: T| slot[channel] = value.byte(shift))?
                .into(),
            (Take::Magnitude, SampleType::F32) => {
                // Where components lie side by side, only their sum is rounded.
                let is_side_by_side = self.axes.first().is_some_and(|axis| axis.role == Role::Channel);
                let mut length = 0.0;
                let add = |slot: &mut f32, channel, value: T| {
                    let before = match channel {
                        0 => 0.0,
                        _ if is_side_by_side => length,
                        _ => f64::from(*slot),
                    };
                    length = before.hypot(value.real());
                    *slot = length as f32;
                };
                run.place(numbers, add)?.into()
            }
            (Take::Magnitude, _) => {
                run.place(numbers, |slot: &mut f64, _, value: T| *slot = slot.hypot(value.real()))?.into()
            }
            (Take::One(_), _) => self.one(&run, numbers)?,
        };
        let is_whole = matches!(self.scalar, Scalar::U64 | Scalar::I64);
        if is_whole
            && for_samples!(&samples, |values| values
                .iter()
                .any(|value| value.channel(0).abs() >= INEXACT_FROM))
        {
            notes.push(
                "whole numbers of 64 bits from 2^53 on are rounded to the nearest that f64 holds".to_owned(),
            );
        }
        Ok(samples)
    }

    /// One number for each sample, in its own type.
    fn one(&self, run: &Run, numbers: Numbers) -> Result<Samples, Problem> {
        macro_rules! same {
            ($type:ty) => {
                run.place(numbers, |slot: &mut $type, _, value: $type| *slot = value)?.into()
            };
        }
        Ok(match self.scalar {
            Scalar::U8 => same!(u8),
            Scalar::I8 => same!(i8),
            Scalar::U16 => same!(u16),
            Scalar::I16 => same!(i16),
            Scalar::U32 => same!(u32),
            Scalar::I32 => same!(i32),
            Scalar::F32 => same!(f32),
            Scalar::F64 => same!(f64),
            Scalar::U64 => run.place(numbers, |slot: &mut f64, _, value: u64| *slot = value as f64)?.into(),
            Scalar::I64 => run.place(numbers, |slot: &mut f64, _, value: i64| *slot = value as f64)?.into(),
        })
    }
}

/// One walk through numbers.
struct Run<'a> {
    raster: &'a Raster,
    /// Numbers before those of the walked axes.
    skip: u64,
    count: usize,
}

impl Run<'_> {
    /// Hands each number that is wanted, and which channel it is of, to the sample where it belongs.
    fn place<T: Number, O: Sample + Pod>(
        &self,
        numbers: Numbers,
        mut put: impl FnMut(&mut O, usize, T),
    ) -> Result<Vec<O>, Problem> {
        let axes = &self.raster.axes;
        let (num_samples, walked) = (self.raster.layout.num_samples(), self.raster.count as u64);
        let mut indices = vec![0_u64; axes.len()];
        let mut samples: Vec<O> = Vec::new();
        let mut position = 0_u64;
        numbers.visit(self.count, |value: T| {
            let is_inside = position.checked_sub(self.skip).is_some_and(|place| place < walked);
            position += 1;
            if !is_inside {
                return Ok(());
            }
            let (mut sample, mut channel, mut is_wanted) = (0, 0, true);
            for (axis, &index) in axes.iter().zip(&indices) {
                sample += axis.step * index as usize;
                is_wanted &= axis.only.is_none_or(|only| only == index);
                if axis.role == Role::Channel {
                    channel = index as usize;
                }
            }
            if is_wanted {
                if sample >= samples.len() {
                    let room = (sample + 1).max(2 * samples.len()).min(num_samples);
                    let more = room - samples.len();
                    reserve(&mut samples, more)?;
                    samples.resize(room, O::zeroed());
                }
                put(&mut samples[sample], channel, value);
            }
            for (axis, index) in axes.iter().zip(&mut indices) {
                *index += 1;
                if *index < axis.size {
                    break;
                }
                *index = 0;
            }
            Ok(())
        })?;
        debug_assert_eq!(samples.len(), num_samples);
        Ok(samples)
    }
}
