//! The cut that shows a view best within bytes of device memory.
//!
//! # Method
//! Boada, Navazo and Scopigno choose by the error of nodes and by interest (section 4.1) which cut a texture memory
//! shall hold. Here a node costs what the backend says that its brick takes, and loses what the picture is predicted to
//! lose by it: the mean square over all pixels, which adds up over nodes as far as they are independent
//! ([`volery_octree::budget`]). A finest node that is shown at level `l` adds
//!
//! `share * T^2 * (chord / cell_l) * square_l`,
//!
//! its share of the pixels, the squared transmittance of what is before it, the cells of that level that a ray through
//! it meets, each of which errs on its own, and what one of them loses ([`losses`](super::losses)). `T` is from the
//! mean opacities of finest nodes between its centre and the eye, and never below [`LEAST_TRANSMITTANCE`], since
//! between hiding matter there are gaps that a mean does not know. What cannot be seen costs nothing. In a region of
//! [interest](crate::Interest) the sum counts as many times as the square of its weight says, and so in what is predicted.
//!
//! The cut is [`Balanced`]: rays are free of seams.
//!
//! # Guarantees
//! - Bricks, what is kept for them, and texels on their way never take more than the budget, at any moment of loading.
//! - More bytes never have a larger predicted error, in one view on one backend.
//! - Where the full resolution fits it is what is drawn, bit for bit.
//!
//! # Limits
//! A prediction, no bound; errors of seams (one layer of cells) are no part of it.

use glam::DVec3;
use volery_frame::Backend;
use volery_octree::{
    Answer, Balanced, BudgetTooSmall, Cut, Filter, Frustum, Joined, Price, Transparency, without_unseen,
};
use volery_pyramid::{Layout, Node, NodeSource};
use volery_scene::{Camera, Projection, TransferFunction};

use super::losses::{Losses, cell_length};
use crate::interest::weight_of;
use crate::residency::{self, Store};
use crate::session::RenderError;
use crate::view::View;

/// The least transmittance before a node.
pub(crate) const LEAST_TRANSMITTANCE: f64 = 1.0 / 32.0;

/// What a view is chosen by.
pub(crate) struct Choice<'a> {
    pub(crate) source: &'a dyn NodeSource,
    pub(crate) store: &'a Store,
    pub(crate) transfer: &'a TransferFunction,
    pub(crate) view: &'a View,
    pub(crate) backend: &'a dyn Backend,
}

impl Choice<'_> {
    fn brick_bytes(&self, node: Node) -> u64 {
        residency::device_bytes(self.source, self.store, node, self.backend)
    }

    /// Whether nodes fit a budget.
    pub(crate) fn fits(&self, nodes: &[Node], max_bytes: u64) -> bool {
        let bytes: u64 = nodes.iter().map(|&node| self.brick_bytes(node)).sum();
        nodes.is_empty() || bytes <= self.backend.room(&self.store.layout, max_bytes)
    }

    /// The best cut within a budget, joined, and the mean square error that is predicted of it.
    pub(crate) fn cut(&self, losses: &Losses, max_bytes: u64) -> Result<(Joined, f64), RenderError> {
        let (layout, view) = (self.source.layout(), self.view);
        let frustum = Frustum::new(layout, &view.camera, view.width, view.height);
        let mut filter = (Transparency { source: self.source, transfer: self.transfer }, frustum);
        let errors = errors(layout, view, losses);
        let balanced = Balanced::new(layout, |node| {
            if filter.answer(node) == Answer::Skip {
                return Price { bytes: 0, error: 0.0 };
            }
            let error = errors[node.level as usize][layout.node_index(node)];
            Price { bytes: self.brick_bytes(node), error }
        });
        let room = self.backend.room(&self.store.layout, max_bytes);
        let found = balanced.cut(room).map_err(|BudgetTooSmall { min_bytes, .. }| RenderError::Memory {
            found: max_bytes,
            least: self.least(min_bytes),
        })?;
        let nodes = found.held.iter().map(|held| held.node).collect();
        let cut = without_unseen(&Cut { nodes, skipped: Vec::new() }, &mut filter);
        Ok((Joined::of(layout, &cut, &mut filter), found.error))
    }

    /// A budget in which so many bytes have room.
    fn least(&self, bytes: u64) -> u64 {
        let mut least = bytes;
        loop {
            let room = self.backend.room(&self.store.layout, least);
            if room >= bytes || least == u64::MAX {
                return least;
            }
            least = least.saturating_add(bytes - room);
        }
    }
}

/// What each node of each level loses.
fn errors(layout: &Layout, view: &View, losses: &Losses) -> Vec<Vec<f64>> {
    let eye = Eye::of(layout, view);
    let levels = 0..layout.num_levels();
    let mut errors: Vec<Vec<f64>> = levels.clone().map(|level| vec![0.0; layout.num_nodes(level)]).collect();
    for (place, node) in layout.level_nodes(0).enumerate() {
        let interest = weight_of(&view.interest, layout.world_bounds(node));
        let weight = eye.weight(layout, losses, node) * interest * interest;
        for (level, square) in levels.clone().zip(losses.of(place)) {
            let index = layout.node_index(node.ancestor(level));
            errors[level as usize][index] += weight * square / f64::from(level).exp2();
        }
    }
    errors
}

/// From where nodes are seen.
struct Eye<'a> {
    camera: &'a Camera,
    forward: DVec3,
    /// World area of a pixel; at depth 1 where rays spread.
    pixel_area: f64,
    num_pixels: f64,
    /// World length of a finest cell.
    cell: f64,
}

impl<'a> Eye<'a> {
    fn of(layout: &Layout, view: &'a View) -> Self {
        let rays = view.camera.rays(view.width, view.height);
        let [_, _, forward] = view.camera.axes();
        let spread = rays.toward_dx.length() * rays.toward_dy.length();
        let apart = rays.origin_dx.length() * rays.origin_dy.length();
        Self {
            camera: &view.camera,
            forward,
            pixel_area: spread.max(apart),
            num_pixels: f64::from(view.width) * f64::from(view.height),
            cell: cell_length(layout),
        }
    }

    /// How much of the picture a finest node is: the ways of all rays through it in finest cells, weighted by what is
    /// before it, per pixel of the picture.
    fn weight(&self, layout: &Layout, losses: &Losses, node: Node) -> f64 {
        let [low, high] = layout.world_bounds(node);
        let (size, center) = (high - low, (low + high) / 2.0);
        let to_node = center - self.camera.eye;
        let (way, depth) = match self.camera.projection {
            Projection::Orthographic { .. } => (self.forward, 1.0),
            // From inside a node as from beside it.
            Projection::Perspective { .. } => {
                (to_node.normalize_or(self.forward), to_node.dot(self.forward).max(size.length() / 2.0))
            }
        };
        // All rays through a node together are as long as its volume over what one of them stands for.
        let cells = size.element_product() / (self.pixel_area * depth * depth * self.cell);
        let most = self.num_pixels * size.length() / self.cell;
        let transmittance = self.transmittance(layout, losses, (node, center), way);
        transmittance.max(LEAST_TRANSMITTANCE).powi(2) * cells.min(most) / self.num_pixels
    }

    /// Of what lies between a node and the eye.
    fn transmittance(
        &self,
        layout: &Layout,
        losses: &Losses,
        (node, center): (Node, DVec3),
        way: DVec3,
    ) -> f64 {
        let node_size = layout.spacing() * layout.brick_cells() as f64;
        let step = node_size.min_element() / 2.0;
        let extent = layout.domain() * layout.spacing();
        let to_node = center - self.camera.eye;
        let end = match self.camera.projection {
            Projection::Orthographic { .. } => to_node.dot(self.forward),
            Projection::Perspective { .. } => to_node.length(),
        };
        let nodes = layout.nodes(0);
        let mut depth = 0.0;
        for number in 1..=(end.min(extent.length()) / step) as usize {
            let at = center - way * (step * number as f64);
            if at.cmplt(DVec3::ZERO).any() || at.cmpgt(extent).any() {
                break;
            }
            let places = (at / node_size).to_array();
            let index = std::array::from_fn(|axis| (places[axis] as u32).min(nodes[axis] - 1));
            if index != node.index {
                let opacity = losses.opacity(layout.node_index(Node::new(0, index)));
                depth -= (-opacity).ln_1p() * step / self.cell;
            }
        }
        (-depth).exp()
    }
}
