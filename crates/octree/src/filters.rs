//! The filters: data tolerance, view frustum, transparency, cutting planes, point of interest.

use glam::DVec3;
use volery_pyramid::{Layout, Node, NodeSource, NodeStats};
use volery_scene::{Camera, Plane, Projection, TransferFunction};

use crate::section::IndexPlane;
use crate::select::{Answer, Filter};

/// Draws a node whose data error is below a tolerance, else descends.
///
/// *Strictly* below: tolerance 0 gives the finest level everywhere, and an infinite error (blank samples)
/// is below no tolerance. But a node all of whose samples are equal shows the very same field, and is drawn under any
/// tolerance. Level 0 is always drawn. Of several channels the worst counts.
pub struct DataTolerance<'a> {
    /// Where the errors come from.
    pub source: &'a dyn NodeSource,
    /// In data units.
    pub tolerance: f64,
}

impl Filter for DataTolerance<'_> {
    fn answer(&mut self, node: Node) -> Answer {
        let is_constant = |s: &NodeStats| s.error == 0.0 && s.min == s.max;
        let is_good = |s: &NodeStats| s.error < self.tolerance || is_constant(s);
        let good = node.level == 0 || self.source.stats(node).iter().all(is_good);
        if good { Answer::Draw } else { Answer::Descend }
    }
}

/// Skips a node in which the finest field is perfectly transparent, by the exact range of its samples.
///
/// A wholly blank node is skipped too. A transfer function speaks of scalars: nodes of colour volumes are
/// never skipped.
pub struct Transparency<'a> {
    /// Where the ranges come from.
    pub source: &'a dyn NodeSource,
    /// What makes them transparent.
    pub transfer: &'a TransferFunction,
}

impl Filter for Transparency<'_> {
    fn answer(&mut self, node: Node) -> Answer {
        match self.source.stats(node) {
            [scalar] if self.transfer.is_transparent(scalar.min, scalar.max) => Answer::Skip,
            _ => Answer::Draw,
        }
    }
}

/// Skips a node that no ray of the picture meets.
///
/// The rays of a picture fill the intersection of five half spaces: before the eye, and inside each edge
/// of the picture. A node is skipped when one of them does not hold any of its corners, by more than
/// rounding can be wrong; so a node near an edge of that region may stay though no ray meets it.
pub struct Frustum<'a> {
    layout: &'a Layout,
    /// Points on the boundary planes, and their normals of unit length, pointing inwards.
    planes: [(DVec3, DVec3); 5],
    /// World distance below which a corner counts as inside.
    slack: f64,
}

impl<'a> Frustum<'a> {
    /// The frustum of a picture of `width` by `height` pixels. A camera with
    /// [defects](Camera::defects) skips nothing.
    pub fn new(layout: &'a Layout, camera: &Camera, width: u32, height: u32) -> Self {
        let rays = camera.rays(width, height);
        let [right, up, forward] = camera.axes();
        let (width, height) = (f64::from(width), f64::from(height));
        let sides = match camera.projection {
            Projection::Perspective { .. } => {
                let corner = |x: f64, y: f64| {
                    rays.toward + rays.toward_dx * (x * width) + rays.toward_dy * (y * height)
                };
                let (left, right) = (corner(0.0, 0.5), corner(1.0, 0.5));
                let (top, bottom) = (corner(0.5, 0.0), corner(0.5, 1.0));
                let across = rays.toward_dx;
                let down = rays.toward_dy;
                [left.cross(down), down.cross(right), across.cross(top), bottom.cross(across)]
                    .map(|normal| (camera.eye, normal.normalize()))
            }
            Projection::Orthographic { .. } => {
                let last = rays.origin + rays.origin_dx * width + rays.origin_dy * height;
                [(rays.origin, right), (last, -right), (rays.origin, -up), (last, up)]
            }
        };
        let [a, b, c, d] = sides.map(|(point, normal)| {
            // Whichever way the cross products turn, the middle of the picture is inside.
            let middle = rays.ray(width / 2.0, height / 2.0);
            // The difference first: beside a far eye a direction is nothing.
            let inside = (middle.origin - point + middle.direction).dot(normal);
            (point, normal * inside.signum())
        });
        let reach = layout.world_bounds(layout.root())[1].length() + camera.eye.length();
        // Positions, axes and dot products are each wrong by a few units of 2^-53 of the reach.
        Self { layout, planes: [(camera.eye, forward), a, b, c, d], slack: 1e-12 * reach }
    }

    /// Whether rays may meet a box inside the domain, in world units.
    pub fn may_meet(&self, [low, high]: [DVec3; 2]) -> bool {
        // Nothing is outside of planes that are not numbers.
        !self.planes.iter().any(|&(point, normal)| {
            // The corner that lies deepest inside.
            let deepest = DVec3::select(normal.cmpgt(DVec3::ZERO), high, low);
            (deepest - point).dot(normal) < -self.slack
        })
    }

    /// Whether a box, in world units, is inside with all that is in it: nothing of it is skipped.
    pub fn holds(&self, [low, high]: [DVec3; 2]) -> bool {
        self.planes.iter().all(|&(point, normal)| {
            let shallowest = DVec3::select(normal.cmpgt(DVec3::ZERO), low, high);
            (shallowest - point).dot(normal) >= -self.slack
        })
    }
}

impl Filter for Frustum<'_> {
    fn answer(&mut self, node: Node) -> Answer {
        if self.may_meet(self.layout.world_bounds(node)) { Answer::Draw } else { Answer::Skip }
    }
}

/// Skips a node whose box none of the planes meets.
///
/// A plane that touches a box in a corner, an edge or a face meets it. So does one that passes within
/// [`PLANE_SLACK`] of the domain's size: who draws finds the places of a plane in `f32`, perhaps just across a
/// boundary, and there must be no hole. What each node has of the plane, without overlaps, says
/// [`section`](crate::section()). A plane with [defects](Plane::defects) is met by nothing.
pub struct CuttingPlanes<'a> {
    layout: &'a Layout,
    /// Each with the offset below which it meets a box.
    planes: Vec<(IndexPlane, f64)>,
}

/// How far from a box a plane counts as meeting it, in parts of the domain's size along the plane's normal.
pub const PLANE_SLACK: f64 = 1e-6;

impl<'a> CuttingPlanes<'a> {
    /// The filter for planes in world space.
    pub fn new(layout: &'a Layout, planes: &[Plane]) -> Self {
        let valid = planes.iter().filter(|plane| plane.defects().is_empty());
        let planes = valid.map(|plane| {
            let index_plane = IndexPlane::new(layout, plane);
            let [least, greatest] = index_plane.offsets([DVec3::ZERO, layout.domain()]);
            (index_plane, PLANE_SLACK * (greatest - least) + 1e-14 * plane.distance.abs())
        });
        Self { layout, planes: planes.collect() }
    }
}

impl CuttingPlanes<'_> {
    /// Whether a plane meets a box, in finest-sample coordinates.
    pub fn may_meet(&self, bounds: [DVec3; 2]) -> bool {
        let misses = |&(plane, slack): &(IndexPlane, f64)| {
            let [least, greatest] = plane.offsets(bounds);
            least > slack || greatest < -slack
        };
        !self.planes.iter().all(misses)
    }
}

impl Filter for CuttingPlanes<'_> {
    fn answer(&mut self, node: Node) -> Answer {
        if self.may_meet(self.layout.bounds(node)) { Answer::Draw } else { Answer::Skip }
    }
}

/// Draws a node that is far from a point of interest for its size, else descends.
///
/// Far is a distance, from the point to the centre of the node, greater than the node's diagonal times the
/// quality, both in world space. (LaMar and others 2000 say greater in section 3.2 and smaller in section 4.1;
/// smaller would be coarse where one looks.) So an octave of distance is a level, and twice the quality is twice
/// the resolution. A node that the domain cuts short counts as what is left of it.
///
/// Quality 0, or less, draws the root; an infinite one is the full resolution. What is not a number lowers no
/// resolution.
pub struct Focus<'a> {
    /// Of the tree.
    pub layout: &'a Layout,
    /// The point of interest in world space; it may lie outside the domain.
    pub point: DVec3,
    /// Diagonals of a node that it must be away to be drawn.
    pub quality: f64,
}

impl Filter for Focus<'_> {
    fn answer(&mut self, node: Node) -> Answer {
        let [low, high] = self.layout.world_bounds(node);
        let (diagonal, center) = ((high - low).length(), low + (high - low) / 2.0);
        let is_far = self.point.distance(center) > diagonal * self.quality;
        if node.level == 0 || is_far || self.quality <= 0.0 { Answer::Draw } else { Answer::Descend }
    }
}
