//! What a file is, without drawing it.

use std::fmt;

use serde::Serialize;
use volery_io::{Volume, World};

use crate::histogram::Histogram;

mod choices;
mod grid;
mod stack;

pub use choices::Choices;
pub use grid::{ArrayInfo, DefectInfo, GridInfo};
pub use stack::StackInfo;

/// Bins of the histogram in [`Info`].
pub const NUM_BINS: usize = 32;

/// What a volume or image file holds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Info {
    /// `volume`, or `image` for one slice.
    pub kind: &'static str,
    /// Name of the format.
    pub format: String,
    /// Samples along x, y, z.
    pub dims: [usize; 3],
    /// Type of a sample: `u8`, `f32`, `rgb8`, ...
    pub scalar: &'static str,
    /// World distance of neighbouring samples along x, y, z.
    pub spacing: [f64; 3],
    /// World position of the last sample; the first is at the origin.
    pub extent: [f64; 3],
    /// Which way the axes of the samples run in the world of the file, as `LPS` or `+x -y +z`; missing if the file
    /// says nothing of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub orientation: Option<String>,
    /// Where the first sample lies in the world of the file; missing if that is its origin.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin: Option<[f64; 3]>,
    /// The smallest and largest value that the file asks to show.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub display_range: Option<[f64; 2]>,
    /// Name of the array that was read, where the format names arrays.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub array: Option<String>,
    /// Which of several is drawn, where there are several.
    #[serde(skip_serializing_if = "Choices::is_empty")]
    pub choices: Choices,
    /// One, or three or four for colours.
    pub channels: Vec<Channel>,
    /// What the reader decided, a sentence each.
    pub notes: Vec<String>,
}

/// The values of one channel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Channel {
    /// Smallest and largest finite value; missing if there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<[f64; 2]>,
    /// Samples that are NaN or infinite.
    pub blank: u64,
    /// Samples by value, in bins of equal width over the range; missing if there is no range.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub histogram: Option<Vec<u64>>,
}

impl Info {
    /// Looks at every sample of a volume.
    pub fn of(volume: &Volume) -> Self {
        let grid = &volume.grid;
        let channels = (0..grid.sample_type().channels()).map(|channel| {
            let histogram = Histogram::of(grid, channel);
            let range = grid.value_range(channel);
            let blank = match (&histogram, range) {
                (Some(histogram), _) => histogram.blank,
                (None, None) => grid.num_samples() as u64,
                // A range too wide for bins.
                (None, Some(_)) => {
                    let blank = |&index: &usize| !grid.samples().value(index, channel).is_finite();
                    (0..grid.num_samples()).filter(blank).count() as u64
                }
            };
            Channel { range, blank, histogram: histogram.map(|histogram| histogram.coarse_counts(NUM_BINS)) }
        });
        let orientation = volume.orientation();
        let is_oriented = volume.world == World::Anatomical || !orientation.is_identity();
        let origin = grid.world_from_index().translation.to_array();
        Self {
            kind: if grid.dims()[2] == 1 { "image" } else { "volume" },
            format: volume.format.to_string(),
            dims: grid.dims(),
            scalar: grid.sample_type().name(),
            spacing: grid.spacing().to_array(),
            extent: grid.extent().to_array(),
            orientation: is_oriented.then(|| orientation.to_string()),
            origin: (origin != [0.0; 3]).then_some(origin),
            display_range: volume.display_range,
            array: volume.array.clone(),
            choices: volume.choices.into(),
            channels: channels.collect(),
            notes: volume.notes.clone(),
        }
    }
}

/// A few lines for people, the histogram as bars on a logarithmic scale.
impl fmt::Display for Info {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let times = |values: &[f64; 3]| values.map(number).join(" x ");
        writeln!(f, "kind      {}, {}", self.kind, self.format)?;
        writeln!(f, "dims      {}", self.dims.map(|n| n.to_string()).join(" x "))?;
        writeln!(f, "type      {}", self.scalar)?;
        writeln!(f, "spacing   {}", times(&self.spacing))?;
        writeln!(f, "extent    {}", times(&self.extent))?;
        if let Some(orientation) = &self.orientation {
            writeln!(f, "axes      {orientation}")?;
        }
        if let Some(origin) = self.origin {
            writeln!(f, "origin    {}", origin.map(number).join(", "))?;
        }
        if let Some([low, high]) = self.display_range {
            writeln!(f, "window    {} to {}", number(low), number(high))?;
        }
        if let Some(array) = &self.array {
            writeln!(f, "array     {}", array.escape_debug())?;
        }
        write!(f, "{}", self.choices)?;
        for (index, channel) in self.channels.iter().enumerate() {
            if self.channels.len() > 1 {
                writeln!(f, "channel   {index}")?;
            }
            match channel.range {
                Some([low, high]) => writeln!(f, "range     {} to {}", number(low), number(high))?,
                None => writeln!(f, "range     none, every sample is blank")?,
            }
            if channel.blank > 0 {
                writeln!(f, "blank     {} samples", channel.blank)?;
            }
            if let Some(histogram) = &channel.histogram {
                writeln!(f, "histogram {}", bars(histogram))?;
            }
        }
        self.notes.iter().try_for_each(|note| writeln!(f, "note      {note}"))
    }
}

/// A number for people: without the hundreds of zeros that very large and very small ones have.
pub fn number(value: f64) -> String {
    let plain = value == 0.0 || (1e-5..1e15).contains(&value.abs());
    if plain { value.to_string() } else { format!("{value:e}") }
}

/// One character per bin: a blank for none, else one of eight heights, logarithmic.
fn bars(counts: &[u64]) -> String {
    const BARS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let top = counts.iter().copied().max().unwrap_or(0).max(1) as f64;
    let height = |count: u64| (7.0 * (count as f64).ln_1p() / top.ln_1p()).round() as usize;
    counts.iter().map(|&count| if count == 0 { ' ' } else { BARS[height(count)] }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        assert_eq!(
            [0.0, -3.0, 0.15625, 1e300, 5e-324].map(number),
            ["0", "-3", "0.15625", "1e300", "5e-324"]
        );
    }

    #[test]
    fn bars_tell_none_from_few() {
        assert_eq!(bars(&[0, 1, 1_000_000]), " ▁█");
        assert_eq!(bars(&[]), "");
    }
}
