//! What the technique stack reads.

use std::path::{Path, PathBuf};

use clap::Args;
use volery::{Slicing, StackView};

/// What the technique stack alone reads.
#[derive(Debug, Args)]
#[command(next_help_heading = "Technique stack")]
pub(crate) struct StackArgs {
    /// Planes over the extent of the grid; with --adaptive those of the first step [default: 128]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    pub(crate) slices: Option<u32>,
    /// Put more planes between others where cells are, until this share of the cells is met
    #[arg(long, value_name = "SHARE", value_parser = parse_share, allow_negative_numbers = true)]
    pub(crate) adaptive: Option<f64>,
    /// Slice along x, y and z ahead, and draw the stack that is nearest the direction of view: what a camera in
    /// motion needs, in place of slicing along the direction of view for each picture
    #[arg(long)]
    pub(crate) axes: bool,
    /// Shade matter by its gradient; always so with a transfer function over value and gradient magnitude
    #[arg(long)]
    pub(crate) shade: bool,
    /// Draw from vertices in 8 bytes in place of 16, 12 in place of 32 with gradients
    #[arg(long)]
    pub(crate) quantized: bool,
    /// Draw each time step of a collection, or each of these grids; OUT, the report and the error map then need a
    /// place for the number, such as OUT-%03d.png
    #[arg(long, value_name = "FILE.pvd|FILE,FILE,...", value_delimiter = ',', num_args = 1)]
    pub(crate) time_steps: Vec<PathBuf>,
}

impl StackArgs {
    /// The first option that is given.
    pub(crate) fn given(&self) -> Option<&'static str> {
        let Self { slices, adaptive, axes, shade, quantized, time_steps } = self;
        let given = [
            ("--slices", slices.is_some()),
            ("--adaptive", adaptive.is_some()),
            ("--axes", *axes),
            ("--quantized", *quantized),
            ("--shade", *shade),
            ("--time-steps", !time_steps.is_empty()),
        ];
        given.into_iter().find(|(_, is_given)| *is_given).map(|(name, _)| name)
    }

    /// The first option that is given and needs cells, not slices.
    pub(crate) fn needs_cells(&self) -> Option<&'static str> {
        self.given().filter(|&option| option != "--shade")
    }

    /// What they say of a view.
    pub(crate) fn view(&self) -> StackView {
        let defaults = StackView::default();
        StackView {
            slicing: if self.axes { Slicing::Axes } else { Slicing::Immediate },
            num_slices: self.slices.map_or(defaults.num_slices, |slices| slices as usize),
            adaptive: self.adaptive,
            is_lit: self.shade,
            is_quantized: self.quantized,
            ..defaults
        }
    }
}

fn parse_share(text: &str) -> Result<f64, String> {
    let found: Option<f64> = text.parse().ok();
    let good = found.filter(|share| (0.0..=1.0).contains(share));
    good.ok_or_else(|| "expected a share of the cells, from 0 to 1".to_owned())
}

/// A path with the number of a time step in place of its `%d` or `%03d`; `None` where it has not exactly one.
pub(crate) fn numbered(path: &Path, number: usize) -> Option<PathBuf> {
    let (before, after) = path.to_str()?.split_once('%')?;
    let (digits, after) = after.split_once('d')?;
    let is_width = digits.is_empty() || digits.len() == 2 && digits.starts_with('0');
    let width: usize = if digits.is_empty() { 0 } else { digits.parse().ok()? };
    let is_good = is_width && !after.contains('%');
    is_good.then(|| PathBuf::from(format!("{before}{number:0width$}{after}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_take_their_place() {
        let of = |path: &str| numbered(Path::new(path), 7).map(|path| path.to_string_lossy().into_owned());
        assert_eq!(of("a/b-%03d.png").as_deref(), Some("a/b-007.png"));
        assert_eq!(of("%d.exr").as_deref(), Some("7.exr"));
        for wrong in ["a.png", "%.png", "%3d.png", "%0xd.png", "%03d-%03d.png", "%s%d.png", "%099d.png"] {
            assert_eq!(of(wrong), None, "{wrong}");
        }
    }
}
