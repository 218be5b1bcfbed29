//! Ray casting over a cut of the octree.
//!
//! # Method
//! One walk over the tree asks two filters: perfectly transparent under the transfer function, a node is skipped; within
//! the data tolerance it is drawn at its level; else its children are asked. That cut is kept: of it, a camera sees the
//! nodes that are not outside its view, which are put in exact visibility order and become the bricks of a frame. Skipped nodes
//! cost nothing: they are neither read nor resident nor drawn. With a tolerance the cut is balanced and joined
//! ([`seams`](mod@volery_octree::seams)): rays meet one continuous field. With a budget of memory the cut is the view's
//! own (`raycast/memory.rs`).
//!
//! # Guarantees
//! - Without a tolerance, and with a tolerance of 0, every node drawn is of the finest level.
//! - With a tolerance `T` the field drawn is nowhere farther than `T` from the full resolution (in data
//!   units; but for rounding of texels), and blank matter is where it was.
//!
//! - Where levels meet, the field is continuous.
//!
//! # With a largest error of the picture
//! From the coarsest cut on, the pixels of a [bound](crate::matter_bound) say which nodes change them most; those are
//! split, until no pixel can be off by more than was asked for. A round brings the largest bound down to a share, whatever
//! was asked for, and asks one pixel of sixteen as long as these are not good enough: so a smaller error has the cut
//! of a larger one, refined. What is hidden, outside or of the colour of what is behind it stays coarse.

mod losses;
mod memory;

use std::collections::HashSet;
use std::sync::Arc;

use glam::DVec3;
use volery_frame::{Backend, JoinedBrick, RayTransfer, Revision};
use volery_octree::{
    Answer, Cut, DataTolerance, Filter, Frustum, Joined, Transparency, Viewpoint, front_to_back, joined,
    select,
};
use volery_pyramid::{Layout, Node, NodeSource};
use volery_reference::Tracer;
use volery_scene::TransferFunction;

use self::losses::Losses;
use self::memory::Choice;
use crate::data::{Data, VolumeData};
use crate::fit;
use crate::matter_bound::{MatterBound, Search};
use crate::residency::{self, Numbers, Store};
use crate::session::{RenderError, VerifyError};
use crate::technique::{Drawing, Kept, Plan, Technique, Work};
use crate::transfer::Preset;
use crate::view::{Dial, How, View, ViewOptions};

/// The technique, with the table of its last transfer function.
#[derive(Debug, Default)]
pub(crate) struct Raycast {
    table: Kept<(TransferFunction, Revision), RayTransfer>,
    cuts: Cuts,
    /// Of the last view with an error.
    certified: Kept<(View, Revision), (Arc<Joined>, f64)>,
    losses: Kept<(TransferFunction, Revision), Losses>,
    /// The last view with a budget of memory.
    last_within: Option<(View, Plan)>,
}

/// Pixels along an axis of which one says what is too coarse.
const PIXEL_STEP: u32 = 4;

/// What a round leaves of the largest bound.
const ROUND: f64 = 0.6;

/// The last cuts of some tolerances, whatever is in view.
#[derive(Debug, Default)]
struct Cuts(Vec<(f64, KeptCut)>);

/// Of a transfer function, in a store of the volume.
type KeptCut = Kept<(TransferFunction, Revision), Joined>;

impl Cuts {
    /// A tolerance that was never asked for drives out the one that was asked for longest ago.
    fn of(&mut self, tolerance: f64) -> &mut KeptCut {
        let found = self.0.iter().position(|(of, _)| *of == tolerance);
        let kept = found.map(|place| self.0.remove(place)).unwrap_or_else(|| (tolerance, Kept::default()));
        self.0.truncate(TOLERANCES.len());
        self.0.insert(0, kept);
        &mut self.0[0].1
    }
}

impl Technique<VolumeData> for Raycast {
    fn draws(&self, how: &How) -> bool {
        matches!(how, How::Raycast)
    }

    fn view(&self, volume: &VolumeData, options: &ViewOptions, how: How) -> View {
        matter_view(volume, options, how)
    }

    fn check(&self, volume: &VolumeData, view: &View) -> Result<(), RenderError> {
        view.obeyed(|_| true)?;
        view.of_values()?;
        volume.check_matter(&view.how)
    }

    fn forget_view(&mut self) {
        self.certified = Kept::default();
    }

    fn coarser(&self, view: &View, rung: usize) -> Option<View> {
        coarser_by_tolerance(view, rung)
    }

    fn plan(
        &mut self,
        volume: &mut VolumeData,
        view: &View,
        backend: &dyn Backend,
    ) -> Result<Plan, RenderError> {
        let Dial::Memory(max_bytes) = view.dial else { return self.plan_without_backend(volume, view) };
        let transfer = view.of_values()?;
        let store = volume.store_for(transfer);
        let choice = Choice { source: volume.source(), store: &store, transfer, view, backend };
        let (seen, predicted) = self.within(volume, &choice, max_bytes)?;
        let plan =
            Plan { predicted_rmse: Some(predicted), ..self.plan_of(volume, (view, transfer), &store, &seen) };
        self.last_within = Some((view.clone(), plan.clone()));
        Ok(plan)
    }

    fn bound(&mut self, volume: &mut VolumeData, view: &View) -> Result<Option<MatterBound>, RenderError> {
        let plan = match view.dial {
            // What rays far apart leave out is not known.
            Dial::Deadline(_) => None,
            // What a backend would hold is known once it was asked.
            Dial::Memory(_) => self.last_within.clone().filter(|(of, _)| of == view).map(|(_, plan)| plan),
            Dial::Full | Dial::Tolerance(_) | Dial::Error(_) => {
                Some(self.plan_without_backend(volume, view)?)
            }
        };
        let Some(Plan { drawing: Drawing::Rays { bricks, .. }, store: Some((store, nodes)), .. }) = plan
        else {
            return Ok(None);
        };
        let transfer = view.of_values()?;
        let mut search = Search::new((view, transfer), (volume.source(), &store));
        Ok(Some(search.bound(&nodes, &bricks).map_err(residency::Error::from)?))
    }

    fn truth(
        &self,
        volume: &VolumeData,
        view: &View,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<volery_reference::Image, VerifyError> {
        matter_truth(volume, view, progress)
    }
}

impl Raycast {
    /// The plan of a view whose dial asks no backend.
    fn plan_without_backend(&mut self, volume: &mut VolumeData, view: &View) -> Result<Plan, RenderError> {
        let transfer = view.of_values()?;
        let store = volume.store_for(transfer);
        let (seen, bound_max) = match view.dial {
            Dial::Error(error) if error > 0.0 => {
                let (seen, bound) = self.certified(volume, (view, transfer), &store, error)?;
                (seen, Some(bound))
            }
            dial => {
                let tolerance = volume.tolerance(dial).unwrap_or(0.0);
                (self.tolerant(volume.source(), transfer, store.layout.revision, tolerance), None)
            }
        };
        Ok(Plan { bound_max, ..self.plan_of(volume, (view, transfer), &store, &seen) })
    }

    /// The plan of a cut.
    fn plan_of(
        &mut self,
        volume: &VolumeData,
        (view, transfer): (&View, &TransferFunction),
        store: &Store,
        seen: &Joined,
    ) -> Plan {
        let source = volume.source();
        let table = self.table.get(&(transfer.clone(), store.layout.revision), || {
            let table = RayTransfer::new(transfer, &store.layout);
            let is_rounded = store.encoding.blurs(transfer, source.sample_type());
            if is_rounded { table.of_rounded_texels() } else { table }
        });
        let nodes = source.layout();
        let (in_view, bricks) = in_view(nodes, view, seen);
        let order = front_to_back(nodes, &in_view, Viewpoint::of(&view.camera, nodes));
        let bricks = order.iter().map(|&place| bricks[place]).collect();
        let ordered = order.iter().map(|&place| in_view[place]).collect();
        let in_view = Cut { nodes: in_view, skipped: Vec::new() };
        Plan {
            drawing: Drawing::Rays { transfer: table, bricks },
            work: Work { nodes_by_level: Some(in_view.nodes_by_level()), ..Work::default() },
            store: Some((*store, ordered)),
            bound_max: None,
            predicted_rmse: None,
            geometry_seconds: None,
        }
    }

    /// The kept cut of a tolerance, in data units.
    fn tolerant(
        &mut self,
        source: &dyn NodeSource,
        transfer: &TransferFunction,
        revision: Revision,
        tolerance: f64,
    ) -> Arc<Joined> {
        let kept = self.cuts.of(tolerance);
        kept.get(&(transfer.clone(), revision), || tolerant(source, transfer, tolerance))
    }

    /// The best cut within a budget of memory, the full resolution if that fits, and the rmse that is predicted of it.
    fn within(
        &mut self,
        volume: &VolumeData,
        choice: &Choice<'_>,
        max_bytes: u64,
    ) -> Result<(Arc<Joined>, f64), RenderError> {
        let Choice { source, transfer, view, .. } = *choice;
        let revision = choice.store.layout.revision;
        let full = self.tolerant(source, transfer, revision, 0.0);
        if choice.fits(&in_view(source.layout(), view, &full).0, max_bytes) {
            return Ok((full, 0.0));
        }
        let key = (transfer.clone(), revision);
        let losses = self.losses.get(&key, || Losses::measure(volume.grid(), source, transfer));
        let (joined, mean_square) = choice.cut(&losses, max_bytes)?;
        Ok((Arc::new(joined), mean_square.sqrt()))
    }

    /// The cut of which no pixel is off by more than an error, and the largest that any is.
    fn certified(
        &mut self,
        volume: &VolumeData,
        (view, transfer): (&View, &TransferFunction),
        store: &Store,
        error: f64,
    ) -> Result<(Arc<Joined>, f64), RenderError> {
        let key = (view.clone(), store.layout.revision);
        if let Some(kept) = self.certified.found(&key) {
            return Ok((*kept).clone());
        }
        let source = volume.source();
        let layout = source.layout();
        let mut search = Search::new((view, transfer), (source, store));
        let mut joined = tolerant(source, transfer, f64::INFINITY);
        let found = loop {
            let (nodes, bricks) = in_view(layout, view, &joined);
            let mut too_coarse = |step| search.too_coarse((&nodes, &bricks), (step, ROUND));
            let (mut marked, most) = too_coarse(PIXEL_STEP).map_err(residency::Error::from)?;
            if !marked.contains(&true) {
                (marked, _) = too_coarse(1).map_err(residency::Error::from)?;
            }
            if most <= error || !marked.contains(&true) {
                let bound = search.bound(&nodes, &bricks).map_err(residency::Error::from)?.max();
                if bound <= error || !marked.contains(&true) {
                    break (Arc::new(joined), bound);
                }
            }
            let marked: HashSet<Node> =
                nodes.iter().zip(&marked).filter(|(_, marked)| **marked).map(|(&node, _)| node).collect();
            let marked: Vec<bool> = joined.cut.nodes.iter().map(|node| marked.contains(node)).collect();
            joined = joined.split(layout, &marked, &mut Transparency { source, transfer });
        };
        Ok((*self.certified.get(&key, || found)).clone())
    }
}

/// The cut that keeps a tolerance, in data units.
fn tolerant(source: &dyn NodeSource, transfer: &TransferFunction, tolerance: f64) -> Joined {
    let (layout, transparency) = (source.layout(), Transparency { source, transfer });
    if tolerance > 0.0 {
        let error = |node: Node| source.stats(node).iter().map(|stats| stats.error).fold(0.0, f64::max);
        return joined(layout, transparency, error, tolerance);
    }
    // Coarse nodes, if there are any, show the finest field: nothing jumps.
    let cut = select(layout, (transparency, DataTolerance { source, tolerance }));
    Joined { seams: vec![0; cut.nodes.len()], cut }
}

/// The nodes of a cut that are not outside a view, and their bricks.
fn in_view(layout: &Layout, view: &View, joined: &Joined) -> (Vec<Node>, Vec<JoinedBrick>) {
    let mut frustum = Frustum::new(layout, &view.camera, view.width, view.height);
    let numbers = Numbers::of(layout);
    let drawn = joined.cut.nodes.iter().zip(&joined.seams);
    let seen = drawn.filter(|&(&node, _)| frustum.answer(node) != Answer::Skip);
    seen.map(|(&node, &seams)| (node, JoinedBrick { placed: numbers.place(layout, node), seams })).unzip()
}

/// Tolerances of coarser levels of detail, the last of which is the root.
const TOLERANCES: [f64; 3] = [1.0 / 16.0, 0.25, 2.0];

/// A view of a volume at a coarser level of detail.
pub(crate) fn coarser_by_tolerance(view: &View, rung: usize) -> Option<View> {
    let tolerance = *TOLERANCES.get(rung.checked_sub(1)?)?;
    Some(View { dial: Dial::Tolerance(tolerance), ..view.clone() })
}

/// A view of all visible matter of a volume, the camera as near as it can be.
pub(crate) fn matter_view(volume: &VolumeData, options: &ViewOptions, how: How) -> View {
    let transfer = options.transfer_or(|| volume.preset_over(Preset::Auto, options.range));
    let (grid, layout, placement) = (volume.grid(), volume.source().layout(), volume.placement());
    let blocks = match &transfer {
        crate::Transfer::Values(function) => fit::visible_blocks(grid, layout, &placement, function),
        crate::Transfer::Magnitudes(_) => vec![[DVec3::ZERO, grid.extent()]],
    };
    let look = options.look(volume.usual_direction());
    options.view(fit::camera(&blocks, &placement, look), transfer, how)
}

/// The exact picture of a volume's matter.
pub(crate) fn matter_truth(
    volume: &VolumeData,
    view: &View,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<volery_reference::Image, VerifyError> {
    let View { width, height, ref meshes, ref camera, background, .. } = *view;
    let transfer = view.of_values().map_err(|_| VerifyError::Unknown { what: "gradient magnitudes" })?;
    let tracer = Tracer::new(volume.grid(), transfer)?;
    Ok(tracer.among(meshes).render(camera, background, width, height, progress)?)
}
