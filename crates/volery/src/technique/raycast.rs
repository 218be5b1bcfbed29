//! Ray casting over a cut of the octree.
//!
//! # Method
//! One walk over the tree asks two filters: perfectly transparent under the transfer function, a node is skipped; within
//! the data tolerance it is drawn at its level; else its children are asked. That cut is kept: of it, a camera sees the
//! nodes that are not outside its view, which are put in exact visibility order and become the bricks of a frame. Skipped nodes
//! cost nothing: they are neither read nor resident nor drawn. With a tolerance the cut is balanced and joined
//! ([`seams`](mod@volery_octree::seams)): rays meet one continuous field.
//!
//! # Guarantees
//! - Without a tolerance, and with a tolerance of 0, every node drawn is of the finest level.
//! - With a tolerance `T` the field drawn is nowhere farther than `T` from the full resolution (in data
//!   units; but for rounding of texels), and blank matter is where it was.
//!
//! - Where levels meet, the field is continuous.

use glam::DVec3;
use volery_frame::{JoinedBrick, RayTransfer, Revision};
use volery_octree::{
    Answer, Cut, DataTolerance, Filter, Frustum, Joined, Transparency, Viewpoint, front_to_back, joined,
    select,
};
use volery_pyramid::Node;
use volery_reference::Tracer;
use volery_scene::TransferFunction;

use crate::data::{Data, VolumeData};
use crate::fit;
use crate::residency::Numbers;
use crate::session::{RenderError, VerifyError};
use crate::technique::{Drawing, Kept, Plan, Technique, Work};
use crate::transfer::Preset;
use crate::view::{Dial, How, View, ViewOptions};

/// The technique, with the table of its last transfer function.
#[derive(Debug, Default)]
pub(crate) struct Raycast {
    table: Kept<(TransferFunction, Revision), RayTransfer>,
    cuts: Cuts,
}

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
        view.obeyed(|dial| matches!(dial, Dial::Full | Dial::Tolerance(_) | Dial::Deadline(_)))?;
        view.of_values()?;
        volume.check_matter(&view.how)
    }

    fn coarser(&self, view: &View, rung: usize) -> Option<View> {
        coarser_by_tolerance(view, rung)
    }

    fn plan(&mut self, volume: &mut VolumeData, view: &View) -> Result<Plan, RenderError> {
        let transfer = view.of_values()?;
        let store = volume.store_for(transfer);
        let layout = &store.layout;
        let source = volume.source();
        let table = self.table.get(&(transfer.clone(), layout.revision), || {
            let table = RayTransfer::new(transfer, layout);
            let is_rounded = store.encoding.blurs(transfer, source.sample_type());
            if is_rounded { table.of_rounded_texels() } else { table }
        });
        let nodes = source.layout();
        let tolerance = volume.tolerance(view.dial).unwrap_or(0.0);
        let seen = self.cuts.of(tolerance).get(&(transfer.clone(), layout.revision), || {
            let transparency = Transparency { source, transfer };
            if tolerance > 0.0 {
                let error =
                    |node: Node| source.stats(node).iter().map(|stats| stats.error).fold(0.0, f64::max);
                joined(nodes, transparency, error, tolerance)
            } else {
                // Coarse nodes, if there are any, show the finest field: nothing jumps.
                let cut = select(nodes, (transparency, DataTolerance { source, tolerance }));
                Joined { seams: vec![0; cut.nodes.len()], cut }
            }
        });
        let mut frustum = Frustum::new(nodes, &view.camera, view.width, view.height);
        let mut is_seen = |node: Node| frustum.answer(node) != Answer::Skip;
        let places: Vec<usize> =
            (0..seen.cut.nodes.len()).filter(|&place| is_seen(seen.cut.nodes[place])).collect();
        let in_view: Vec<Node> = places.iter().map(|&place| seen.cut.nodes[place]).collect();
        let order = front_to_back(nodes, &in_view, Viewpoint::of(&view.camera, nodes));
        let numbers = Numbers::of(nodes);
        let brick = |&place: &usize| JoinedBrick {
            placed: numbers.place(nodes, in_view[place]),
            seams: seen.seams[places[place]],
        };
        let bricks = order.iter().map(brick).collect();
        let ordered = order.iter().map(|&place| in_view[place]).collect();
        let in_view = Cut { nodes: in_view, skipped: Vec::new() };
        Ok(Plan {
            drawing: Drawing::Rays { transfer: table, bricks },
            work: Work { nodes_by_level: Some(in_view.nodes_by_level()), ..Work::default() },
            store: Some((store, ordered)),
            bound_max: None,
            geometry_seconds: None,
        })
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
