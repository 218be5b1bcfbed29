//! The polygon in which a plane cuts a node, and how much of each level it shows.
//!
//! # Method
//! All happens in finest-sample coordinates, where the corners of nodes are integers (or integers and a half)
//! and so exact; [`IndexPlane`] takes a world plane there once. The plane's *offset* at a corner is a function of
//! that corner alone, computed in one order of operations. Rounding keeps order, so the offset never falls along
//! an axis on which the normal points up, whatever the rounding: the signs at the eight corners of a box are
//! those of some plane, always. (The sets of corners above and not below it are unate, and every unate function
//! of three variables is a threshold.) No case can arise that a plane cannot make, and two nodes agree on what
//! they share.
//!
//! With the box turned so that the normal points up on all axes, the plane crosses each of the three paths
//! `000-100-110-111`, `000-010-011-111`, `000-001-101-111` exactly once, and between the crossings of two paths
//! perhaps the edge that joins them: at most six vertices, in order around the normal, without sorting angles.
//! The crossing of an edge is computed from the edge's *line*, so that nodes which share an edge or, at another
//! level, a part of it get the same bits.
//!
//! # Guarantees
//! - The polygons of a cut's nodes cover the section of plane and domain once: areas add up to its area. A plane
//!   in which a face lies belongs to the node whose *low* face that is, as if boxes were half open, and at the
//!   domain's upper end to the node that ends there.
//! - A polygon has no vertex twice, and is convex but for rounding.
//! - A plane that only touches a box in a corner or an edge has no polygon there.
//! - A box that is flat, because the volume is one sample thick, has a polygon (all of itself) only for the plane
//!   that it lies in; one that is flat along two axes has none.
//!
//! A plane with [defects](Plane::defects), and numbers that overflow, have no polygon. Normals as short or
//! coordinates as large as would underflow or overflow when multiplied are not scaled for.

use glam::DVec3;
use volery_pyramid::{Kind, Layout, Node};
use volery_scene::Plane;

/// The points `x` with `normal · x = distance`, in finest-sample coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IndexPlane {
    normal: DVec3,
    distance: f64,
}

impl IndexPlane {
    /// Takes a plane from world space into the finest-sample coordinates of `layout`.
    pub fn new(layout: &Layout, plane: &Plane) -> Self {
        Self { normal: plane.normal * layout.spacing(), distance: plane.distance }
    }

    /// `normal · point - distance`: never falls, for any rounding, when a coordinate rises along which the normal
    /// points up.
    #[inline]
    pub fn offset(&self, point: DVec3) -> f64 {
        let n = self.normal;
        (n.x * point.x + n.y * point.y) + n.z * point.z - self.distance
    }

    /// The least and the greatest offset in a box.
    #[inline]
    pub fn offsets(&self, [low, high]: [DVec3; 2]) -> [f64; 2] {
        let up = self.normal.cmpge(DVec3::ZERO);
        [self.offset(DVec3::select(up, low, high)), self.offset(DVec3::select(up, high, low))]
    }

    /// Where the plane crosses the line along `axis` through `point`.
    fn crossing(&self, axis: usize, point: DVec3) -> f64 {
        let n = self.normal;
        let [u, v] = [[1, 2], [0, 2], [0, 1]][axis];
        (self.distance - (n[u] * point[u] + n[v] * point[v])) / n[axis]
    }
}

/// A convex polygon in finest-sample coordinates, counter-clockwise as seen from where the normal points to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Section {
    vertices: [DVec3; 6],
    count: usize,
}

impl Section {
    /// The vertices: none, or three to six. Each lies on an edge of the node's box.
    pub fn vertices(&self) -> &[DVec3] {
        &self.vertices[..self.count]
    }

    /// Whether there is nothing.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The area in world units.
    pub fn world_area(&self, spacing: DVec3) -> f64 {
        let Some((&first, rest)) = self.vertices().split_first() else { return 0.0 };
        let spoke = |v: DVec3| (v - first) * spacing;
        rest.windows(2).map(|pair| spoke(pair[0]).cross(spoke(pair[1]))).sum::<DVec3>().length() / 2.0
    }

    /// Adds a vertex, unless it is the one before.
    fn push(&mut self, vertex: DVec3) {
        if self.vertices().last() != Some(&vertex) {
            self.vertices[self.count] = vertex;
            self.count += 1;
        }
    }

    /// Drops what has no area, and turns the polygon around when asked.
    fn finish(mut self, is_clockwise: bool) -> Self {
        if self.count > 1 && self.vertices[0] == self.vertices[self.count - 1] {
            self.count -= 1;
        }
        if self.count < 3 {
            return Self::default();
        }
        if is_clockwise {
            self.vertices[..self.count].reverse();
        }
        self
    }
}

/// The edges of a box whose normal points up on all axes, in order around the normal: three paths of three
/// edges, and after each path the edge that joins it to the next. Corner `x + 2 y + 4 z`.
const EDGES: [[usize; 2]; 12] =
    [[0, 1], [1, 3], [3, 7], [2, 3], [0, 2], [2, 6], [6, 7], [4, 6], [0, 4], [4, 5], [5, 7], [1, 5]];

/// The polygon in which `plane` cuts the box of `node`; see the [module](self).
pub fn section(layout: &Layout, node: Node, plane: &IndexPlane) -> Section {
    let bounds = layout.bounds(node);
    let [least, greatest] = plane.offsets(bounds);
    // A NaN meets nothing.
    if !(least <= 0.0 && greatest >= 0.0) || plane.normal == DVec3::ZERO {
        return Section::default();
    }
    // Corner `x + 2 y + 4 z` of the box turned so that the normal points up on all axes.
    let down = [0, 1, 2].map(|axis| usize::from(plane.normal[axis] < 0.0));
    let turn = down[0] | down[1] << 1 | down[2] << 2;
    let corners: [DVec3; 8] = std::array::from_fn(|corner| {
        DVec3::from_array([0, 1, 2].map(|axis| bounds[(corner ^ turn) >> axis & 1][axis]))
    });
    let offsets = corners.map(|corner| plane.offset(corner));
    let is_clockwise = turn.count_ones() % 2 == 1;
    if let Some(face) = coplanar_face(plane.normal, &offsets) {
        return whole_face(layout, bounds, turn, face, &corners, is_clockwise);
    }
    let is_flat = bounds[0].cmpeq(bounds[1]).any();
    if least == 0.0 || greatest == 0.0 || is_flat {
        return Section::default();
    }
    let mut polygon = Section::default();
    for [below, above] in EDGES {
        if !(offsets[below] < 0.0 && offsets[above] >= 0.0) {
            continue;
        }
        let mut vertex = corners[above];
        if offsets[above] > 0.0 {
            let axis = (below ^ above).trailing_zeros() as usize;
            let [a, b] = [bounds[0][axis], bounds[1][axis]];
            vertex[axis] = plane.crossing(axis, corners[below]).clamp(a, b);
        }
        polygon.push(vertex);
    }
    polygon.finish(is_clockwise)
}

/// A face (`[axis, end]`) in all of whose corners the plane lies: across the axis that its normal is nearest to.
fn coplanar_face(normal: DVec3, offsets: &[f64; 8]) -> Option<[usize; 2]> {
    let axis = normal.abs().max_position();
    let lies_in = |end: usize| (0..8).filter(|c| c >> axis & 1 == end).all(|c| offsets[c] == 0.0);
    (0..2).find(|&end| lies_in(end)).map(|end| [axis, end])
}

/// The face of a box in which the plane lies, if it belongs to this box.
fn whole_face(
    layout: &Layout,
    bounds: [DVec3; 2],
    turn: usize,
    [axis, end]: [usize; 2],
    corners: &[DVec3; 8],
    is_clockwise: bool,
) -> Section {
    let [low, high] = [bounds[0][axis], bounds[1][axis]];
    let is_low = end ^ (turn >> axis & 1) == 0;
    let is_own = is_low || high == low || high == layout.domain()[axis];
    let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
    if !is_own || [u, v].into_iter().any(|axis| bounds[0][axis] == bounds[1][axis]) {
        return Section::default();
    }
    let mut polygon = Section::default();
    for [at_u, at_v] in [[0, 0], [1, 0], [1, 1], [0, 1]] {
        polygon.push(corners[end << axis | at_u << u | at_v << v]);
    }
    polygon.finish(is_clockwise)
}

/// Where a position (in finest-sample coordinates) stands in a node, each axis from 0 at its low corner to 1 where
/// it ends, or would end had the domain not cut it short.
pub fn local_position(layout: &Layout, node: Node, position: DVec3) -> DVec3 {
    let span = layout.brick_cells() as f64 * f64::from(node.level).exp2();
    let offset = match layout.kind() {
        Kind::Decimated => 0.0,
        Kind::Averaged => 0.5,
    };
    let low = node.index.map(|i| f64::from(i) * span - offset);
    (position - DVec3::from_array(low)) / span
}

/// How much of the low samples a node shows at a [local position](local_position): 0 none, 1 nothing else.
///
/// Trilinear from its corners: bit `x + 2 y + 4 z` of `low_corners`. On an edge of the node it is linear between
/// the edge's ends (LaMar and others 2000, section 4.3), on a face it depends on the face's corners alone.
pub fn ratio(low_corners: u8, local: DVec3) -> f64 {
    if low_corners == 0 {
        return 0.0;
    }
    let at = |corner: u32| f64::from(low_corners >> corner & 1);
    let mix = |a: f64, b: f64, w: f64| a + (b - a) * w;
    let along_x = |first: u32| mix(at(first), at(first + 1), local.x);
    let on_face = |first: u32| mix(along_x(first), along_x(first + 2), local.y);
    mix(on_face(0), on_face(4), local.z)
}
