//! What matter loses where it is shown at coarser levels.
//!
//! # Method
//! The paper calls the error of a node how far its samples are from those that interpolate them (Boada, Navazo,
//! Scopigno, section 3); a picture shows what a transfer function makes of it. Of each finest node some samples are
//! looked at, at places of a low-discrepancy sequence (Roberts 2018: multiples of powers of one over the root of
//! `g^4 = g + 1`). For each level, the trilinear value of that level's samples stands beside the sample itself. Both are
//! classified over the length of a cell of the level, and what the difference may do to a pixel is squared: half of it
//! before black, half before white, the mean of the channels. The mean over the samples is what *one* cell of that
//! level loses.
//!
//! # Limits
//! A mean over [`SAMPLES`] samples is no bound: a detail smaller than what lies between them may be missed. The
//! certified bounds of planes are exact; these here are to choose by.

use rayon::prelude::*;
use volery_octree::{Answer, Filter, Transparency};
use volery_pyramid::{Layout, Node, NodeSource};
use volery_scene::{TransferFunction, VoxelGrid};

/// Samples of a finest node that are looked at.
pub(crate) const SAMPLES: usize = 160;

/// Steps of the sequence along x, y, z.
const STEPS: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_3, 0.549_700_477_901_970_9];

/// Of every finest node.
#[derive(Clone, Debug)]
pub(crate) struct Losses {
    num_levels: usize,
    /// Mean square of what a cell loses: node by node, level by level from 0 on, where nothing is lost. Not falling.
    squares: Vec<f64>,
    /// Mean opacity of a cell of level 0.
    opacities: Vec<f64>,
}

impl Losses {
    /// Under a transfer function, of a decimated pyramid over these samples.
    pub(crate) fn measure(grid: &VoxelGrid, source: &dyn NodeSource, transfer: &TransferFunction) -> Self {
        let layout = source.layout();
        let num_levels = layout.num_levels() as usize;
        let nodes: Vec<Node> = layout.level_nodes(0).collect();
        let seen = Seen { grid, transfer, cell: cell_length(layout) };
        let of_node = |&node: &Node| {
            let is_clear = Transparency { source, transfer }.answer(node) == Answer::Skip;
            if is_clear { (vec![0.0; num_levels], 0.0) } else { seen.losses(layout, node) }
        };
        let measured: Vec<(Vec<f64>, f64)> = nodes.par_iter().map(of_node).collect();
        let opacities = measured.iter().map(|(_, opacity)| *opacity).collect();
        let squares = measured.into_iter().flat_map(|(squares, _)| squares).collect();
        Self { num_levels, squares, opacities }
    }

    /// Mean square of what a cell of each level loses in a finest node, by its place among them.
    pub(crate) fn of(&self, place: usize) -> &[f64] {
        &self.squares[place * self.num_levels..][..self.num_levels]
    }

    /// Mean opacity of a cell of level 0 in a finest node.
    pub(crate) fn opacity(&self, place: usize) -> f64 {
        self.opacities[place]
    }
}

/// World length of a way through a finest cell, in the middle of all directions.
pub(crate) fn cell_length(layout: &Layout) -> f64 {
    layout.spacing().element_product().cbrt()
}

struct Seen<'a> {
    grid: &'a VoxelGrid,
    transfer: &'a TransferFunction,
    /// World length.
    cell: f64,
}

impl Seen<'_> {
    fn losses(&self, layout: &Layout, node: Node) -> (Vec<f64>, f64) {
        let num_levels = layout.num_levels();
        let owned = layout.owned(node);
        let mut squares = vec![0.0; num_levels as usize];
        let mut opacity = 0.0;
        for sample in 1..=SAMPLES {
            let place: [usize; 3] = std::array::from_fn(|axis| {
                let share = (sample as f64 * STEPS[axis]).fract();
                let range = &owned[axis];
                (range.start + (share * range.len() as f64) as usize).min(range.end - 1)
            });
            let fine = self.value(place);
            opacity += self.matter(fine, self.cell)[3];
            for level in 1..num_levels {
                let coarse = self.interpolated(place, level);
                if coarse != fine {
                    let length = self.cell * f64::from(level).exp2();
                    let lost = change(self.matter(fine, length), self.matter(coarse, length));
                    squares[level as usize] += lost / SAMPLES as f64;
                }
            }
        }
        // Finer is never worse.
        for level in 1..squares.len() {
            squares[level] = f64::max(squares[level], squares[level - 1]);
        }
        (squares, opacity / SAMPLES as f64)
    }

    fn value(&self, place: [usize; 3]) -> f64 {
        self.grid.samples().value(self.grid.index(place), 0)
    }

    /// The trilinear value of samples that are `2^level` apart; the last stands for the end of an axis.
    fn interpolated(&self, place: [usize; 3], level: u32) -> f64 {
        let dims = self.grid.dims();
        let first = place.map(|x| x >> level << level);
        let share: [f64; 3] =
            std::array::from_fn(|axis| (place[axis] - first[axis]) as f64 / f64::from(level).exp2());
        let mut sum = 0.0;
        for corner in 0..8_usize {
            let upper = [corner & 1, corner >> 1 & 1, corner >> 2];
            let weight: f64 =
                (0..3).map(|axis| if upper[axis] == 1 { share[axis] } else { 1.0 - share[axis] }).product();
            if weight > 0.0 {
                let at =
                    std::array::from_fn(|axis| (first[axis] + (upper[axis] << level)).min(dims[axis] - 1));
                sum += weight * self.value(at);
            }
        }
        sum
    }

    /// Colour times opacity, and opacity, of a stretch; blank matter is clear.
    fn matter(&self, value: f64, length: f64) -> [f64; 4] {
        if !value.is_finite() {
            return [0.0; 4];
        }
        let ([r, g, b], opacity) = self.transfer.classify(value);
        let units = length / self.transfer.unit_distance();
        let opacity = -(units * (-opacity).ln_1p()).exp_m1();
        [r * opacity, g * opacity, b * opacity, opacity]
    }
}

/// The mean square of what a pixel's channels may change by.
fn change(from: [f64; 4], to: [f64; 4]) -> f64 {
    let opacity = to[3] - from[3];
    let of_channel = |channel: usize| {
        let color = to[channel] - from[channel];
        (color * color + (color - opacity) * (color - opacity)) / 2.0
    };
    (of_channel(0) + of_channel(1) + of_channel(2)) / 3.0
}
