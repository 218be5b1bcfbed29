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
//! [`ColorChange`](crate::color_change::ColorChange); the largest bound of the nodes drawn is the bound of the picture, and [`certified`] refines until
//! it is at most what was asked for. It is there for every picture, whichever dial chose its nodes. Where an error was
//! asked for, it is that of the parts of nodes that planes meet, each with its own share of the parent's samples;
//! else of whole nodes. The nearest samples of two levels may be anywhere in the range of a node's values, whatever
//! its field: where they are shown, the width of that range takes the place of the data error.
//!
//! # Non-goals
//! Lighting. Tiles of a power of two as textures wanted them: a high tile of 31 samples has its low tile of 16 in
//! itself (see `volery_frame::planes`).

use glam::DVec3;
use volery_frame::{Backend, BlendedBrick, PointTransfer, Revision, Sampling};
use volery_io::World;
use volery_octree::{
    Answer, Cut, CuttingPlanes, Filter, Focus, Frustum, IndexPlane, balance, certified, low_corners, section,
    select, without_unseen,
};
use volery_pyramid::Node;
use volery_reference::PlaneScene;
use volery_scene::{Camera, Plane, TransferFunction};

mod bounds;
mod cells;
mod parts;
mod progressive;

pub use progressive::{Progressive, Step};

use crate::data::{Data, VolumeData};
use crate::fit;
use crate::histogram::Histogram;
use crate::residency::Numbers;
use crate::session::{RenderError, VerifyError};
use crate::technique::raycast::coarser_by_tolerance;
use crate::technique::{Drawing, Kept, Technique, Work};
use crate::transfer;
use crate::view::{self, Dial, How, PlaneView, Transfer, View, ViewOptions};

use bounds::ColorBounds;
pub(crate) use parts::Parts;

/// What one picture draws.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Chosen {
    /// The cut of the tree, balanced.
    cut: Cut,
    /// The cut's drawn nodes as bricks, in its order.
    bricks: Vec<BlendedBrick>,
    /// In how many polygons the planes cut the nodes.
    num_polygons: usize,
    /// No channel of any pixel differs by more from the full resolution.
    bound_max: f64,
}

impl Chosen {
    /// That of a valid cut whose nodes, drawn and skipped, are balanced.
    fn of(volume: &VolumeData, (view, planes): (&View, &PlaneView), cut: Cut) -> Self {
        Self::with_bounds(&ColorBounds::new(volume, view, planes), &planes.planes, cut)
    }

    fn with_bounds(colors: &ColorBounds<'_>, planes: &[Plane], cut: Cut) -> Self {
        let layout = colors.layout();
        let low_corners = low_corners(layout, &cut);
        let bound_max = colors.of_cut(&cut.nodes, &low_corners);
        let planes: Vec<_> = planes.iter().map(|plane| IndexPlane::new(layout, plane)).collect();
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

/// The technique, with the points of its last transfer function.
#[derive(Debug, Default)]
pub(crate) struct Planes {
    points: Kept<(TransferFunction, Revision), PointTransfer>,
}

impl Planes {
    /// The plan of what was chosen.
    fn plan_of(
        &mut self,
        volume: &mut VolumeData,
        (view, planes): (&View, &PlaneView),
        chosen: Chosen,
    ) -> Result<super::Plan, RenderError> {
        let transfer = view.of_values()?;
        let store = volume.store_for(transfer);
        let layout = &store.layout;
        let points =
            self.points.get(&(transfer.clone(), layout.revision), || PointTransfer::new(transfer, layout));
        let Chosen { cut, bricks, num_polygons, bound_max } = chosen;
        Ok(super::Plan {
            drawing: Drawing::Planes {
                planes: planes.planes.clone(),
                transfer: points,
                bricks,
                sampling: planes.sampling,
                is_transparent: planes.is_transparent,
                shows_bricks: planes.shows_nodes,
            },
            work: Work {
                nodes_by_level: Some(cut.nodes_by_level()),
                polygons: Some(num_polygons),
                ..Work::default()
            },
            store: Some((store, cut.nodes)),
            bound_max: Some(bound_max),
            predicted_rmse: None,
            geometry_seconds: None,
        })
    }
}

/// The planes of a view; a technique is given no other.
fn planes_of(view: &View) -> Option<&PlaneView> {
    match &view.how {
        How::Planes(planes) => Some(planes),
        _ => None,
    }
}

impl Technique<VolumeData> for Planes {
    fn draws(&self, how: &How) -> bool {
        matches!(how, How::Planes(_))
    }

    fn view(&self, volume: &VolumeData, options: &ViewOptions, how: How) -> View {
        let How::Planes(mut planes) = how else { return super::raycast::matter_view(volume, options, how) };
        if planes.planes.is_empty() {
            planes.planes = middle_planes(volume);
        }
        let shown = || {
            let matter =
                (!volume.has_colors()).then(|| Histogram::of_matter(volume.grid().samples(), 0)).flatten();
            options.range.unwrap_or(matter.map_or(volume.value_range(), |histogram| histogram.range))
        };
        let transfer = options.transfer_or(|| transfer::gray(shown(), volume.extent()));
        options.view(camera(volume, &planes.planes, options), transfer, How::Planes(planes))
    }

    fn check(&self, _: &VolumeData, view: &View) -> Result<(), RenderError> {
        view.obeyed(|dial| !matches!(dial, Dial::Memory(_)))?;
        view.of_values()?;
        planes_of(view).map_or(Ok(()), PlaneView::check)
    }

    fn coarser(&self, view: &View, rung: usize) -> Option<View> {
        coarser_by_tolerance(view, rung)
    }

    fn plan(
        &mut self,
        volume: &mut VolumeData,
        view: &View,
        _: &dyn Backend,
    ) -> Result<super::Plan, RenderError> {
        let default = PlaneView::default();
        let planes = planes_of(view).unwrap_or(&default);
        let chosen = choose(volume, view, planes);
        self.plan_of(volume, (view, planes), chosen)
    }

    /// Outlines of nodes are no part of it.
    fn truth(
        &self,
        volume: &VolumeData,
        view: &View,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<volery_reference::Image, VerifyError> {
        let (Some(planes), Transfer::Values(transfer)) = (planes_of(view), &view.transfer) else {
            return Err(VerifyError::Unknown { what: "gradient magnitudes" });
        };
        let scene = PlaneScene {
            grid: volume.grid(),
            planes: &planes.planes,
            transfer,
            nearest: planes.sampling == Sampling::Nearest,
            is_transparent: planes.is_transparent,
            meshes: &view.meshes,
        };
        Ok(scene.render(&view.camera, view.background, [view.width, view.height], progress)?)
    }
}

/// Chooses what to draw of a view without defects.
fn choose(volume: &VolumeData, view: &View, planes: &PlaneView) -> Chosen {
    let source = volume.source();
    let layout = source.layout();
    let colors = ColorBounds::new(volume, view, planes);
    let tolerance = volume.tolerance(view.dial);
    // What a node misses, as a share of what it may.
    let excess = |node: Node, low_corners: u8| {
        let data_error = || {
            let own = colors.data_error(node);
            if low_corners == 0 { own } else { own.max(colors.data_error(node.parent())) }
        };
        match (view.dial, tolerance) {
            (Dial::Error(most), _) => share(colors.of_node(node, low_corners), most),
            (_, Some(tolerance)) => share(data_error(), tolerance),
            (_, None) => 0.0,
        }
    };
    let has_dial = view.dial != Dial::Full;
    let mut seen = (
        CuttingPlanes::new(layout, &planes.planes),
        Frustum::new(layout, &view.camera, view.width, view.height),
    );
    let cut = if let Some(view::Focus { point, quality }) = planes.focus {
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
    Chosen::with_bounds(&colors, &planes.planes, cut)
}

/// How much of what is allowed an error uses up; none is ever small enough for an allowance of 0.
fn share(error: f64, allowed: f64) -> f64 {
    if allowed > 0.0 { error / allowed } else { f64::INFINITY }
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

/// The plane that a flat grid is, or the three through the middle of a volume, along the axes of the world.
fn middle_planes(volume: &VolumeData) -> Vec<Plane> {
    let (placement, dims) = (volume.placement(), volume.grid().dims());
    match (0..3).find(|&axis| dims[axis] == 1) {
        Some(axis) => {
            let normal = placement.direction_to_world(DVec3::AXES[axis]);
            let is_against = volume.world() == World::Anatomical && normal.dot(RADIOLOGICAL) < 0.0;
            vec![Plane::through(placement.to_world(DVec3::ZERO), if is_against { -normal } else { normal })]
        }
        None => DVec3::AXES.map(|normal| Plane::through(volume.middle(), normal)).to_vec(),
    }
}

/// The sides that radiologists see slices from: the left, the front, the feet.
const RADIOLOGICAL: DVec3 = DVec3::new(-1.0, 1.0, -1.0);

/// From where several planes of anatomical data are seen: from the front, so that each shows.
const ANATOMICAL_PLANES: fit::Direction =
    fit::Direction { azimuth_deg: 145.0, elevation_deg: 22.0, zoom: 1.0 };

/// A camera that shows planes of the world: from a direction if there is one or if there are several planes, else straight
/// at the only one, from the side that its normal points to. An image has x to the right and y downwards then, as its file
/// has them.
fn camera(volume: &VolumeData, planes: &[Plane], options: &ViewOptions) -> Camera {
    let (layout, placement) = (volume.source().layout(), volume.placement());
    let is_anatomical = volume.world() == World::Anatomical;
    let root = layout.root();
    if let ([plane], None) = (planes, options.direction) {
        let in_grid = IndexPlane::new(layout, &placement.plane_to_grid(plane));
        let section = section(layout, root, &in_grid);
        let world = |&vertex: &DVec3| placement.to_world(vertex * layout.spacing());
        let points: Vec<_> = section.vertices().iter().map(world).collect();
        if !points.is_empty() {
            let normal = plane.normalized().normal;
            let [right, down] = [DVec3::X, DVec3::Y].map(|axis| placement.direction_to_world(axis));
            let (forward, up) = if layout.dims()[2] == 1 && !is_anatomical {
                // In a plane of its own an image is seen as it is stored.
                if normal.z.abs() > 0.9 { (DVec3::Z, DVec3::NEG_Y) } else { (right.cross(down), -down) }
            } else if normal.z.abs() > 0.9 {
                (-normal, DVec3::Y)
            } else {
                (-normal, DVec3::Z)
            };
            return fit::facing(&points, forward, options.up.unwrap_or(up), options.aspect());
        }
    }
    let usual = if is_anatomical { ANATOMICAL_PLANES } else { fit::Direction::default() };
    fit::camera(&[layout.world_bounds(root)], &placement, options.look(usual))
}
