//! Visibility order: nodes sorted so that none is hidden by a later one.
//!
//! # Method
//! The three planes that split a node into its children each have the eye on one side. A ray from the eye
//! crosses such a plane at most once, from the eye's side to the other. So number the children by how they
//! differ from the eye's octant, one bit per axis: along any ray bits are only ever set, and every order in
//! which a set of bits comes after its subsets, counting for instance, is a visibility order. Recursion
//! does the rest.
//!
//! An eye *on* a splitting plane may count for either side: a ray from there leaves the plane to one side
//! and stays, or lies in the plane and meets the nodes beside it in their boundaries only, where no length
//! is passed. For parallel rays the direction takes the place of the eye; an axis along which they do not
//! move is crossed by none of them.
//!
//! World positions are divided by the spacing once, in `f64`; the order is exact for the eye so rounded.
//! A box may be stretched: order along rays is the same in world and in finest-sample coordinates.

use glam::DVec3;
use volery_pyramid::{Kind, Layout, Node};
use volery_scene::{Camera, Projection};

/// From where a cut is seen, in finest-sample coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Viewpoint {
    /// All rays start at this point, which may lie inside the domain.
    Eye(DVec3),
    /// All rays go this way.
    Direction(DVec3),
}

impl Viewpoint {
    /// Where a camera stands or looks.
    pub fn of(camera: &Camera, layout: &Layout) -> Self {
        match camera.projection {
            Projection::Perspective { .. } => Self::Eye(camera.eye / layout.spacing()),
            Projection::Orthographic { .. } => {
                Self::Direction((camera.target - camera.eye) / layout.spacing())
            }
        }
    }
}

/// The nodes of a cut in visibility order, nearest first, as places in `nodes`. Backwards it is an order
/// from back to front.
///
/// `nodes` must be in canonical order, without duplicates or overlaps, as in a valid [`Cut`](crate::Cut);
/// gaps do not matter. Nodes out of that order are left out.
pub fn front_to_back(layout: &Layout, nodes: &[Node], viewpoint: Viewpoint) -> Vec<usize> {
    let mut order = Vec::with_capacity(nodes.len());
    visit(layout, layout.root(), (nodes, 0), viewpoint, &mut order);
    order
}

/// `place` is where `nodes`, the part of the cut inside `node`, begins in the whole of it.
fn visit(
    layout: &Layout,
    node: Node,
    (nodes, place): (&[Node], usize),
    viewpoint: Viewpoint,
    order: &mut Vec<usize>,
) {
    if nodes.is_empty() {
        return;
    }
    if nodes[0] == node {
        order.push(place);
        return;
    }
    if node.level == 0 {
        return;
    }
    let near = near_octant(layout, node, viewpoint);
    let mut parts = [(0, 0); 8];
    let mut start = 0;
    for (octant, part) in (0..8).zip(&mut parts) {
        let index = std::array::from_fn(|axis| 2 * node.index[axis] + (octant >> axis & 1));
        let child = Node::new(node.level - 1, index);
        let inside = |other: &Node| other.level <= child.level && other.ancestor(child.level) == child;
        let end = start + nodes[start..].partition_point(inside);
        *part = (start, end);
        start = end;
    }
    for flipped in 0..8 {
        let octant = near ^ flipped;
        let (start, end) = parts[octant as usize];
        let index = std::array::from_fn(|axis| 2 * node.index[axis] + (octant >> axis & 1));
        visit(
            layout,
            Node::new(node.level - 1, index),
            (&nodes[start..end], place + start),
            viewpoint,
            order,
        );
    }
}

/// The octant of a node that holds the eye or is nearest to it: bit `axis` set for the upper half.
fn near_octant(layout: &Layout, node: Node, viewpoint: Viewpoint) -> u32 {
    let offset = match layout.kind() {
        Kind::Decimated => 0.0,
        Kind::Averaged => 0.5,
    };
    let span = (layout.brick_cells() as u64) << (node.level - 1);
    (0..3)
        .filter(|&axis| match viewpoint {
            Viewpoint::Eye(eye) => {
                let plane = ((2 * u64::from(node.index[axis]) + 1) * span) as f64 - offset;
                eye[axis] > plane
            }
            Viewpoint::Direction(direction) => direction[axis] < 0.0,
        })
        .map(|axis| 1 << axis)
        .sum()
}
