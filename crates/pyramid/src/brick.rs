//! A brick: the samples that a node needs for seamless trilinear sampling inside its closed bounds.

use volery_scene::{Sample, SampleType};

/// Which samples of its level a brick holds, along x, y, z.
///
/// Sample `i` of the brick stands for sample `first + i` of the level, clamped to the level: the averaged
/// kind has one sample beyond each bound of the node, and repeats the end sample where the level ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BrickShape {
    /// The level's sample that comes first; -1 where the averaged kind begins at the domain's end.
    pub first: [i64; 3],
    /// Samples along x, y, z; of a node at its own level at most `brick_cells + 1` (decimated) or `brick_cells + 2`
    /// (averaged).
    pub count: [usize; 3],
}

impl BrickShape {
    /// Number of samples.
    pub fn num_samples(&self) -> usize {
        self.count.iter().product()
    }

    /// Place of sample `(x, y, z)` of the brick in its flat array.
    #[inline]
    pub fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.count[1] + y) * self.count[0] + x
    }
}

/// Samples of a brick, x fastest: a buffer to be filled again and again.
#[derive(Clone, Debug, PartialEq)]
pub enum BrickSamples {
    /// Unsigned, 8 bits.
    U8(Vec<u8>),
    /// Signed, 8 bits.
    I8(Vec<i8>),
    /// Unsigned, 16 bits.
    U16(Vec<u16>),
    /// Signed, 16 bits.
    I16(Vec<i16>),
    /// Unsigned, 32 bits.
    U32(Vec<u32>),
    /// Signed, 32 bits.
    I32(Vec<i32>),
    /// IEEE 754, 32 bits.
    F32(Vec<f32>),
    /// IEEE 754, 64 bits.
    F64(Vec<f64>),
    /// Red, green, blue.
    Rgb8(Vec<[u8; 3]>),
    /// Red, green, blue, opacity.
    Rgba8(Vec<[u8; 4]>),
}

/// Runs one generic expression for whatever type [`BrickSamples`] hold, as `volery_scene::for_samples` does.
///
/// ```
/// use volery_pyramid::{BrickSamples, for_brick_samples};
/// let samples = BrickSamples::U8(vec![0, 51, 255]);
/// let texels: Vec<f32> =
///     for_brick_samples!(&samples, |values| values.iter().map(|&v| v as f32).collect(); color _ => vec![]);
/// assert_eq!(texels, [0.0, 51.0, 255.0]);
/// ```
///
/// The form without a `color` arm runs the same expression for RGB and RGBA.
#[macro_export]
macro_rules! for_brick_samples {
    ($samples:expr, |$values:ident| $body:expr; color $other:pat => $color:expr) => {
        match $samples {
            $crate::BrickSamples::U8($values) => $body,
            $crate::BrickSamples::I8($values) => $body,
            $crate::BrickSamples::U16($values) => $body,
            $crate::BrickSamples::I16($values) => $body,
            $crate::BrickSamples::U32($values) => $body,
            $crate::BrickSamples::I32($values) => $body,
            $crate::BrickSamples::F32($values) => $body,
            $crate::BrickSamples::F64($values) => $body,
            $other => $color,
        }
    };
    ($samples:expr, |$values:ident| $body:expr) => {
        match $samples {
            $crate::BrickSamples::U8($values) => $body,
            $crate::BrickSamples::I8($values) => $body,
            $crate::BrickSamples::U16($values) => $body,
            $crate::BrickSamples::I16($values) => $body,
            $crate::BrickSamples::U32($values) => $body,
            $crate::BrickSamples::I32($values) => $body,
            $crate::BrickSamples::F32($values) => $body,
            $crate::BrickSamples::F64($values) => $body,
            $crate::BrickSamples::Rgb8($values) => $body,
            $crate::BrickSamples::Rgba8($values) => $body,
        }
    };
}

impl BrickSamples {
    /// No samples of this type yet.
    pub fn empty(sample_type: SampleType) -> Self {
        match sample_type {
            SampleType::U8 => Self::U8(Vec::new()),
            SampleType::I8 => Self::I8(Vec::new()),
            SampleType::U16 => Self::U16(Vec::new()),
            SampleType::I16 => Self::I16(Vec::new()),
            SampleType::U32 => Self::U32(Vec::new()),
            SampleType::I32 => Self::I32(Vec::new()),
            SampleType::F32 => Self::F32(Vec::new()),
            SampleType::F64 => Self::F64(Vec::new()),
            SampleType::Rgb8 => Self::Rgb8(Vec::new()),
            SampleType::Rgba8 => Self::Rgba8(Vec::new()),
        }
    }

    /// The type of a sample.
    pub fn sample_type(&self) -> SampleType {
        fn of<T: Sample>(_: &[T]) -> SampleType {
            T::TYPE
        }
        for_brick_samples!(self, |values| of(values))
    }

    /// How many samples there are.
    pub fn len(&self) -> usize {
        for_brick_samples!(self, |values| values.len())
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The value of one channel of one sample, exactly.
    ///
    /// # Panics
    /// When `index` or `channel` is out of range.
    pub fn value(&self, index: usize, channel: usize) -> f64 {
        for_brick_samples!(self, |values| values[index].channel(channel))
    }
}

/// A brick as [`NodeSource::read_brick`](crate::NodeSource::read_brick) fills it; keep it and read again
/// to spare the allocation.
#[derive(Clone, Debug, PartialEq)]
pub struct Brick {
    /// Which samples these are.
    pub shape: BrickShape,
    /// The samples, x fastest.
    pub samples: BrickSamples,
}

impl Brick {
    /// A brick of no samples, to be filled.
    pub fn empty(sample_type: SampleType) -> Self {
        let shape = BrickShape { first: [0; 3], count: [0; 3] };
        Self { shape, samples: BrickSamples::empty(sample_type) }
    }
}
