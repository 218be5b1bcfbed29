//! Bounds on how far the colours of a cut through planes are from those of the full resolution.

use volery_frame::Sampling;
use volery_pyramid::{Layout, Node, NodeSource, NodeStats};
use volery_scene::{Plane, TransferFunction};

use super::mix;
use super::parts::{self, Parts};
use crate::color_change::{ColorChange, largest_of_colors};
use crate::data::{Data, VolumeData};
use crate::texels::Encoding;
use crate::view::{Dial, PlaneView, Transfer, View};

/// Finest cells that are looked at for the bound of a picture, about: some tens of milliseconds.
const MAX_CELLS: usize = 1 << 15;

/// How far a channel is from the finest one, shown with this sampling.
fn channel_error(channel: &NodeStats, sampling: Sampling) -> f64 {
    match sampling {
        Sampling::Linear => channel.error,
        // Infinite where blanks differ; not below the error by rounding.
        Sampling::Nearest => channel.error.max(channel.max - channel.min),
    }
}

/// Bounds on how far nodes are from the right colour.
pub(super) struct ColorBounds<'a> {
    source: &'a dyn NodeSource,
    parts: Option<&'a Parts>,
    planes: &'a [Plane],
    /// Of scalars.
    change: Option<ColorChange>,
    /// Transparent planes behind one another add up.
    num_layers: f64,
    is_transparent: bool,
    sampling: Sampling,
}

impl<'a> ColorBounds<'a> {
    /// Tight ones where an error was asked for.
    pub(super) fn new(volume: &'a VolumeData, view: &'a View, planes: &'a PlaneView) -> Self {
        let PlaneView { planes, is_transparent, sampling, .. } = planes;
        let source = volume.source();
        let parts = matches!(view.dial, Dial::Error(_)).then(|| volume.parts());
        let root = source.stats(source.layout().root());
        let change = |transfer: &TransferFunction| {
            let range = [root[0].min, root[0].max];
            let texel_span = Encoding::new(source.sample_type(), range).texel_span();
            ColorChange::new(transfer, range, texel_span, *is_transparent)
        };
        let change = match &view.transfer {
            Transfer::Values(transfer) if !volume.has_colors() => Some(change(transfer)),
            _ => None,
        };
        let num_layers = if *is_transparent { planes.len() as f64 } else { 1.0 };
        Self {
            source,
            parts,
            planes,
            change,
            num_layers,
            is_transparent: *is_transparent,
            sampling: *sampling,
        }
    }

    /// Of the tree whose nodes they bound.
    pub(super) fn layout(&self) -> &'a Layout {
        self.source.layout()
    }

    /// The largest of any channel, in data units.
    pub(super) fn data_error(&self, node: Node) -> f64 {
        let errors = self.source.stats(node).iter().map(|channel| channel_error(channel, self.sampling));
        if node.level == 0 { 0.0 } else { errors.fold(0.0, f64::max) }
    }

    /// Of a picture.
    ///
    /// With parts, the worst of them are looked at in their finest cells, until the worst that is left is no worse
    /// than those were, or too much was read.
    pub(super) fn of_cut(&self, nodes: &[Node], low_corners: &[u8]) -> f64 {
        let drawn = nodes.iter().copied().zip(low_corners.iter().copied());
        let parts = match self.parts {
            Some(parts) if self.sampling == Sampling::Linear => parts,
            _ => return drawn.map(|(node, low)| self.of_node(node, low)).fold(0.0, f64::max),
        };
        let met = drawn.flat_map(|(node, low)| {
            parts.met(node, self.planes).map(move |part| (self.of_part(parts, part, low), part, node, low))
        });
        let mut met: Vec<_> = met.collect();
        met.sort_by(|a, b| b.0.total_cmp(&a.0));
        let cells = parts.cells(self.planes);
        let (mut largest, mut num_read) = (0.0_f64, 0);
        for (bound, part, node, low) in met {
            if bound <= largest {
                break;
            }
            if num_read > MAX_CELLS {
                largest = bound;
                break;
            }
            let mut of_cells = 0.0_f64;
            num_read += cells.visit(node, low, parts.cell_box(part), |stats| {
                of_cells = of_cells.max(self.of_channels(stats));
            });
            largest = largest.max(of_cells.min(bound));
        }
        (self.num_layers * largest).min(1.0)
    }

    /// Of a node that shows its own samples, and its parent's at some corners.
    pub(super) fn of_node(&self, node: Node, low_corners: u8) -> f64 {
        let largest = match self.parts {
            Some(parts) => {
                let bounds = parts.met(node, self.planes).map(|part| self.of_part(parts, part, low_corners));
                bounds.fold(0.0, f64::max)
            }
            None if low_corners == 0 => self.of_level(node),
            None => self.of_level(node).max(self.of_level(node.parent())),
        };
        (self.num_layers * largest).min(1.0)
    }

    /// Of one plane in a node that shows its own samples.
    fn of_level(&self, node: Node) -> f64 {
        let stats =
            || self.source.stats(node).iter().map(|channel| self.with_error(channel, self.error(channel)));
        if node.level == 0 { 0.0 } else { self.of_channels(&stats().collect::<Vec<_>>()) }
    }

    /// Of one plane in a part of a node.
    fn of_part(&self, parts: &Parts, part: Node, low_corners: u8) -> f64 {
        let own = parts.stats(part);
        let own_error = |channel: usize| own.map_or(0.0, |own| self.error(&own[channel]));
        let [least, most] = parts::ratios(part, low_corners);
        let (low, [least, most]) = match parts.stats(part.parent()) {
            Some(low) if most > 0.0 => (low, [least, most]),
            _ => match own {
                Some(own) => (own, [0.0; 2]),
                None => return 0.0,
            },
        };
        let mixed = |(channel, low): (usize, &NodeStats)| {
            let (own, of_low) = (own_error(channel), self.error(low));
            self.with_error(low, mix(own, of_low, least).max(mix(own, of_low, most)))
        };
        self.of_channels(&low.iter().enumerate().map(mixed).collect::<Vec<_>>())
    }

    fn error(&self, channel: &NodeStats) -> f64 {
        channel_error(channel, self.sampling)
    }

    fn with_error(&self, channel: &NodeStats, error: f64) -> NodeStats {
        NodeStats { error, ..*channel }
    }

    /// Of one plane where channels have these ranges and errors.
    fn of_channels(&self, stats: &[NodeStats]) -> f64 {
        match &self.change {
            Some(change) => change.largest([stats[0].min, stats[0].max], stats[0].error),
            None => largest_of_colors(stats, self.is_transparent),
        }
    }
}
