//! What a user knows of a file, or wants of it.

use clap::Args;
use volery::io::Element;
use volery::io::scene_file::SceneInput;

use super::numbers;

/// Which of several things in a file.
#[derive(Clone, Debug, Args)]
pub(crate) struct ChoiceArgs {
    /// The array to draw, of files that have several [default: the scene's, else the file's own]
    #[arg(long, value_name = "NAME")]
    pub(crate) array: Option<String>,
    /// The number of each place to draw, from 0, where a place has several: a channel of colours, a component of
    /// vectors [default: colours as they are, vectors by their magnitude, of other channels the first]
    #[arg(long, visible_alias = "component", value_name = "N", value_parser = index, allow_negative_numbers = true)]
    pub(crate) channel: Option<usize>,
    /// The volume or grid to draw, from 0, of files that have several: time steps of an Exodus file or a .pvd, volumes
    /// of a 4D NIfTI, times of a TIFF [default: the first]
    #[arg(long, visible_alias = "volume", value_name = "N", value_parser = index, allow_negative_numbers = true)]
    pub(crate) time_step: Option<usize>,
}

/// How to read a file.
#[derive(Debug, Args)]
#[command(next_help_heading = "Reading")]
pub(crate) struct FileArgs {
    #[command(flatten)]
    pub(crate) choice: ChoiceArgs,
    /// Samples along x, y and z, for a raw file whose name does not tell
    #[arg(long, value_name = "NX,NY,NZ", value_parser = parse_dims, allow_hyphen_values = true)]
    pub(crate) dims: Option<[usize; 3]>,
    /// Type of the samples by its numpy name (uint8, >u2, float32, ...), for a raw file whose name does not tell
    #[arg(long, value_name = "TYPE", value_parser = clap::builder::ValueParser::new(parse_dtype))]
    pub(crate) dtype: Option<Element>,
    /// World distance of neighbouring samples, in place of the file's
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_spacing, allow_hyphen_values = true)]
    pub(crate) spacing: Option<[f64; 3]>,
}

impl FileArgs {
    /// As a scene has them.
    pub(crate) fn of_scene(&self) -> SceneInput {
        let Self { choice: ChoiceArgs { array, channel, time_step }, dims, dtype, spacing } = self;
        SceneInput {
            array: array.clone(),
            channel: *channel,
            time_step: *time_step,
            dims: *dims,
            dtype: *dtype,
            spacing: *spacing,
            ..SceneInput::default()
        }
    }
}

/// Reads a whole number from 0.
fn index(text: &str) -> Result<usize, String> {
    text.parse().map_err(|_| "expected a whole number from 0".to_owned())
}

fn parse_dims(text: &str) -> Result<[usize; 3], String> {
    let dims: Option<Vec<usize>> =
        text.split([',', 'x']).map(|part| part.trim().parse().ok().filter(|&n| n > 0)).collect();
    let dims = dims.and_then(|dims| dims.try_into().ok());
    dims.ok_or_else(|| "expected NX,NY,NZ: three counts of at least 1".to_owned())
}

fn parse_dtype(text: &str) -> Result<Element, String> {
    text.parse().map_err(|error: volery::io::ParseElementError| error.to_string())
}

fn parse_spacing(text: &str) -> Result<[f64; 3], String> {
    let spacing = numbers(text).and_then(|numbers| <[f64; 3]>::try_from(numbers).ok());
    let spacing = spacing.filter(|spacing| spacing.iter().all(|&length| length > 0.0 && length.is_finite()));
    spacing.ok_or_else(|| "expected X,Y,Z: three finite lengths above 0".to_owned())
}
