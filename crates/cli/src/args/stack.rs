//! What the technique stack reads.

use std::path::PathBuf;

use clap::Args;

use super::whole;

/// What the technique stack alone reads.
#[derive(Debug, Args)]
#[command(next_help_heading = "Technique stack")]
pub(crate) struct StackArgs {
    /// Planes over the extent of the grid; with --adaptive those of the first step [default: 128]
    #[arg(long, value_name = "N", value_parser = whole(1 << 24))]
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
    #[arg(
        long,
        value_name = "FILE.pvd|FILE,FILE,...",
        value_delimiter = ',',
        num_args = 1,
        conflicts_with = "time_step"
    )]
    pub(crate) time_steps: Vec<PathBuf>,
}

fn parse_share(text: &str) -> Result<f64, String> {
    let found: Option<f64> = text.parse().ok();
    let good = found.filter(|share| (0.0..=1.0).contains(share));
    good.ok_or_else(|| "expected a share of the cells, from 0 to 1".to_owned())
}
