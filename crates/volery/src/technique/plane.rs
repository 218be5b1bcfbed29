//! Cutting planes of several levels, without seams.
//!
//! # Method
//! LaMar and others 2000 (section 4): select the nodes that a plane meets, balance the cut so that nodes which
//! touch differ by one level at most, give each corner that touches a coarser node over to the low samples, draw.
//! Without a dial every node is of the finest level. With a *tolerance* or a largest *error* a node is drawn where
//! it keeps within that; with a *focus*, where its centre is farther from the focus than its diagonal times the
//! quality, or it keeps within the other dials, if there are any: they then hold for what is near alone.
//!
//! # The paper's future work: its error
//! A node of the cut shows a field that is off by at most its data error `e`, known exactly from the pyramid; where
//! it blends into a coarser neighbour, by a mix of its own and its parent's. What that does to a colour is bounded by
//! [`ColorChange`]; the largest bound of the nodes drawn is the bound of the picture, and [`certified`] refines until
//! it is at most what was asked for. It is there for every picture, whichever dial chose its nodes. Where an error was
//! asked for, it is that of the [`parts`] of nodes that planes meet, each with its own share of the parent's samples;
//! else of whole nodes. The nearest samples of two levels may be anywhere in the range of a node's values, whatever
//! its field: where they are shown, the width of that range takes the place of the data error.
//!
//! # Non-goals
//! Lighting. Tiles of a power of two as textures wanted them: a high tile of 31 samples has its low tile of 16 in
//! itself (see `volery_frame::planes`).

use glam::DVec3;
use volery_frame::{BlendedBrick, Sampling};
use volery_octree::{
    Answer, Cut, CuttingPlanes, Filter, Focus, Frustum, IndexPlane, balance, certified, low_corners, section,
    select, without_unseen,
};
use volery_pyramid::{Layout, Node, NodeSource, NodeStats};
use volery_scene::{Camera, Plane, VoxelGrid};

use crate::error::{ColorChange, largest_of_colors};
use crate::fit;
use crate::session::{self, PlaneView, View};
use crate::technique::parts::{self, Parts};
use crate::technique::residency::Numbers;
use crate::texels::Encoding;

/// Cells of a brick per axis: high tiles of 31 samples, low ones of 16, as in the paper.
pub const BRICK_CELLS: usize = 30;

/// Finest cells that are looked at for the bound of a picture, about: some tens of milliseconds.
const MAX_CELLS: usize = 1 << 15;

/// What one frame draws.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The cut of the tree, balanced.
    pub cut: Cut,
    /// The cut's drawn nodes as bricks, in its order.
    pub bricks: Vec<BlendedBrick>,
    /// In how many polygons the planes cut the nodes.
    pub num_polygons: usize,
    /// No channel of any pixel differs by more from the full resolution.
    pub bound_max: f64,
}

impl Plan {
    /// The plan of a valid cut whose nodes, drawn and skipped, are balanced.
    pub(crate) fn of(source: &dyn NodeSource, parts: Option<&Parts>, view: &View, cut: Cut) -> Self {
        Self::with_bounds(&ColorBounds::new(source, parts, view), view, cut)
    }

    fn with_bounds(colors: &ColorBounds<'_>, view: &View, cut: Cut) -> Self {
        let layout = colors.source.layout();
        let low_corners = low_corners(layout, &cut);
        let bound_max = colors.of_cut(&cut.nodes, &low_corners);
        let planes: Vec<_> = view.planes.planes.iter().map(|plane| IndexPlane::new(layout, plane)).collect();
        let polygons =
            |node: &Node| planes.iter().filter(|plane| !section(layout, *node, plane).is_empty()).count();
        let num_polygons = cut.nodes.iter().map(polygons).sum();
        let numbers = Numbers::of(layout);
        let bricks = cut.nodes.iter().zip(low_corners);
        let bricks = bricks
            .map(|(&node, low_corners)| BlendedBrick { placed: numbers.place(layout, node), low_corners })
            .collect();
        Self { cut, bricks, num_polygons, bound_max }
    }
}

/// Chooses what to draw. `tolerance` is in data units; the view is without defects. With `parts` bounds are tighter.
pub(crate) fn plan(
    source: &dyn NodeSource,
    parts: Option<&Parts>,
    view: &View,
    tolerance: Option<f64>,
) -> Plan {
    let layout = source.layout();
    let PlaneView { planes, focus, max_error, .. } = &view.planes;
    let colors = ColorBounds::new(source, parts, view);
    // What a node misses, as a share of what it may.
    let excess = |node: Node, low_corners: u8| {
        let data_error = || {
            let own = colors.data_error(node);
            if low_corners == 0 { own } else { own.max(colors.data_error(node.parent())) }
        };
        let data = tolerance.map_or(0.0, |tolerance| share(data_error(), tolerance));
        let color = max_error.map_or(0.0, |max_error| share(colors.of_node(node, low_corners), max_error));
        data.max(color)
    };
    let has_dial = tolerance.is_some() || max_error.is_some();
    let mut seen =
        (CuttingPlanes::new(layout, planes), Frustum::new(layout, &view.camera, view.width, view.height));
    let cut = if let &Some(session::Focus { point, quality }) = focus {
        let mut focus = Focus { layout, point, quality };
        let mut detail = |node: Node| match focus.answer(node) {
            Answer::Descend if has_dial && excess(node, 0) <= 1.0 => Answer::Draw,
            answer => answer,
        };
        let cut = select(layout, |node: Node| seen.answer(node).max(detail(node)));
        without_unseen(&balance(layout, &cut), &mut seen)
    } else if has_dial {
        certified(layout, seen, excess, 1.0).cut
    } else {
        // All of one level: balanced as it is.
        select(layout, (seen, |_: Node| Answer::Descend))
    };
    Plan::with_bounds(&colors, view, cut)
}

/// How much of what is allowed an error uses up; none is ever small enough for an allowance of 0.
fn share(error: f64, allowed: f64) -> f64 {
    if allowed > 0.0 { error / allowed } else { f64::INFINITY }
}

/// How far a channel is from the finest one, shown with this sampling.
fn channel_error(channel: &NodeStats, sampling: Sampling) -> f64 {
    match sampling {
        Sampling::Linear => channel.error,
        // Infinite where blanks differ; not below the error by rounding.
        Sampling::Nearest => channel.error.max(channel.max - channel.min),
    }
}

/// Bounds on how far nodes are from the right colour.
struct ColorBounds<'a> {
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
    fn new(source: &'a dyn NodeSource, parts: Option<&'a Parts>, view: &'a View) -> Self {
        let PlaneView { planes, is_transparent, sampling, .. } = &view.planes;
        let root = source.stats(source.layout().root());
        let is_scalar = source.sample_type().channels() == 1;
        let change = || {
            let range = [root[0].min, root[0].max];
            let texel_span = Encoding::new(source.sample_type(), range).texel_span();
            ColorChange::new(&view.transfer, range, texel_span, *is_transparent)
        };
        let num_layers = if *is_transparent { planes.len() as f64 } else { 1.0 };
        Self {
            source,
            parts,
            planes,
            change: is_scalar.then(change),
            num_layers,
            is_transparent: *is_transparent,
            sampling: *sampling,
        }
    }

    /// The largest of any channel, in data units.
    fn data_error(&self, node: Node) -> f64 {
        let errors = self.source.stats(node).iter().map(|channel| channel_error(channel, self.sampling));
        if node.level == 0 { 0.0 } else { errors.fold(0.0, f64::max) }
    }

    /// Of a picture.
    ///
    /// With parts, the worst of them are looked at in their finest cells, until the worst that is left is no worse
    /// than those were, or too much was read.
    fn of_cut(&self, nodes: &[Node], low_corners: &[u8]) -> f64 {
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
    fn of_node(&self, node: Node, low_corners: u8) -> f64 {
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

/// What is `own` and, as `ratio` rises to 1, `low`; either may be infinite.
pub(super) fn mix(own: f64, low: f64, ratio: f64) -> f64 {
    if ratio <= 0.0 {
        own
    } else if ratio >= 1.0 {
        low
    } else {
        own * (1.0 - ratio) + low * ratio
    }
}

/// The plane that a flat grid is, or the three through the middle of a volume.
pub fn middle_planes(grid: &VoxelGrid) -> Vec<Plane> {
    let middle = grid.extent() / 2.0;
    let dims = grid.dims();
    let all = [DVec3::X, DVec3::Y, DVec3::Z];
    match (0..3).find(|&axis| dims[axis] == 1) {
        Some(axis) => vec![Plane::through(DVec3::ZERO, all[axis])],
        None => all.map(|normal| Plane::through(middle, normal)).to_vec(),
    }
}

/// A camera that shows planes: from a direction if there is one or if there are several planes, else straight at
/// the only one. An image stands upright then, its first row at the top.
pub fn camera(
    layout: &Layout,
    planes: &[Plane],
    direction: Option<fit::Direction>,
    orthographic: bool,
    aspect: f64,
) -> Camera {
    let root = layout.root();
    if let ([plane], None) = (planes, direction) {
        let section = section(layout, root, &IndexPlane::new(layout, plane));
        let points: Vec<_> = section.vertices().iter().map(|&vertex| vertex * layout.spacing()).collect();
        if !points.is_empty() {
            let normal = plane.normalized().normal;
            let (forward, up) = match (layout.dims()[2] == 1, normal.z.abs() > 0.9) {
                (true, _) => (DVec3::Z, -DVec3::Y),
                (false, true) => (-normal, DVec3::Y),
                (false, false) => (-normal, DVec3::Z),
            };
            return fit::facing(&points, forward, up, aspect);
        }
    }
    fit::camera(&[layout.world_bounds(root)], direction.unwrap_or_default(), orthographic, aspect)
}
