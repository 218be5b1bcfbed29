//! `volery slice`

use std::path::PathBuf;

use clap::Args;
use clap::builder::{PathBufValueParser, TypedValueParser};
use volery::glam::DVec3;

use super::{ChoiceArgs, has_ending, numbers, whole, with_ending};

/// `volery slice`
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  volery slice wing.vtu -o wing.vsl --count 256 --axis z
  volery slice wing.vtu -o wing.glb --count 100 --axis 0.3,0.5,0.81 --array Density

A .glb file opens in viewers of glTF 2.0 that know KHR_mesh_quantization; with --meshopt it is about a quarter of
the size, for those that know EXT_meshopt_compression too. A .vsl file is smaller still.")]
pub(crate) struct SliceArgs {
    /// A grid: .vtu, .pvtu, .pvd, .vtk, .ex2
    #[arg(value_name = "GRID")]
    pub(crate) input: PathBuf,
    /// The slices
    #[arg(short, long, value_name = "OUT.glb|OUT.vsl",
        value_parser = PathBufValueParser::new().try_map(|path| with_ending(path, &["glb", "vsl"])))]
    pub(crate) output: PathBuf,
    /// Planes, evenly over the extent of the grid
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = whole(1 << 24))]
    pub(crate) count: u32,
    /// The normal of the planes, of any length
    #[arg(long, value_name = "x|y|z|NX,NY,NZ", default_value = "z", value_parser = parse_axis,
        allow_hyphen_values = true)]
    pub(crate) axis: DVec3,
    #[command(flatten)]
    pub(crate) choice: ChoiceArgs,
    /// Compress the .glb by EXT_meshopt_compression
    #[arg(long)]
    pub(crate) meshopt: bool,
}

impl SliceArgs {
    /// An option that the output would not read.
    pub(super) fn conflict(&self) -> Option<String> {
        let unread = self.meshopt && !has_ending(&self.output, &["glb"]);
        let output = self.output.display();
        unread.then(|| format!("--meshopt compresses .glb files, expected -o OUT.glb in place of {output}"))
    }
}

fn parse_axis(text: &str) -> Result<DVec3, String> {
    let normal = match (text, numbers(text).as_deref()) {
        ("x", _) => DVec3::X,
        ("y", _) => DVec3::Y,
        ("z", _) => DVec3::Z,
        (_, Some(&[x, y, z])) => DVec3::new(x, y, z),
        _ => DVec3::ZERO,
    };
    let good = normal.is_finite() && normal != DVec3::ZERO;
    good.then_some(normal).ok_or_else(|| "expected x, y, z or NX,NY,NZ of length above 0".to_owned())
}
