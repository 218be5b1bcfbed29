//! Ray casting over a cut of the octree.
//!
//! # Method
//! One walk over the tree asks three filters: outside the view or perfectly transparent under the transfer
//! function, a node is skipped; within the data tolerance it is drawn at its level; else its children are
//! asked. The nodes left are put in exact visibility order and become the bricks of a frame. Skipped nodes
//! cost nothing: they are neither read nor resident nor drawn.
//!
//! # Guarantees
//! - Without a tolerance, and with a tolerance of 0, every node drawn is of the finest level.
//! - With a tolerance `T` the field drawn is nowhere farther than `T` from the full resolution (in data
//!   units; but for rounding of texels), and blank matter is where it was.
//! - Bricks are read in parallel into a fixed number of buffers: [`BATCH_BYTES`] is all that uploading needs
//!   beside what the backend keeps.
//!
//! # Non-goals
//! No blending between levels: at the boundary of two levels the field may jump by at most `2 T`.

use rayon::prelude::*;
use volery_frame::{Backend, BrickId, PlacedBrick, UploadError, VolumeLayout};
use volery_octree::{Cut, DataTolerance, Frustum, Transparency, Viewpoint, front_to_back, select};
use volery_pyramid::{Brick, Layout, Node, NodeSource, ReadError};
use volery_scene::{Camera, TransferFunction};

use crate::texels::{Buffer, Encoding};

/// Cells of a brick per axis: a brick of bytes is 36 kB then, of which shared boundaries are 9 %.
///
/// With 16, the software executor drew engine, heptane and the MRI head 4 to 18 % slower in full resolution,
/// holding 2 to 21 % fewer bytes; a tolerance of 0.05 then halved the bytes of heptane, where 32 saves a fifth.
pub const BRICK_CELLS: usize = 32;

/// Texels on their way to the backend at one time.
pub const BATCH_BYTES: usize = 16 << 20;

/// What one frame draws.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The cut of the tree.
    pub cut: Cut,
    /// The cut's drawn nodes, front to back.
    pub nodes: Vec<Node>,
    /// The same as bricks.
    pub bricks: Vec<PlacedBrick>,
}

/// Chooses and orders what to draw. `tolerance` is in data units; the camera is without defects and the
/// picture not empty.
pub fn plan(
    source: &dyn NodeSource,
    camera: &Camera,
    [width, height]: [u32; 2],
    transfer: &TransferFunction,
    tolerance: f64,
) -> Plan {
    let layout = source.layout();
    let filters = (
        Transparency { source, transfer },
        Frustum::new(layout, camera, width, height),
        DataTolerance { source, tolerance },
    );
    let cut = select(layout, filters);
    let order = front_to_back(layout, &cut.nodes, Viewpoint::of(camera, layout));
    let nodes: Vec<Node> = order.into_iter().map(|place| cut.nodes[place]).collect();
    let numbers = Numbers::of(layout);
    let bricks = nodes.iter().map(|&node| numbers.place(layout, node)).collect();
    Plan { cut, nodes, bricks }
}

/// What uploading moved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Uploaded {
    /// Bricks.
    pub bricks: usize,
    /// Bytes of texels.
    pub bytes: u64,
}

/// Why the bricks of a plan could not be made resident.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A brick could not be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The backend refused.
    #[error(transparent)]
    Upload(#[from] UploadError),
}

/// Makes the bricks of a plan resident, those that are not. Where the backend's memory is full, it forgets
/// what this frame does not need.
pub(crate) fn upload(
    source: &dyn NodeSource,
    encoding: &Encoding,
    volume: &VolumeLayout,
    plan: &Plan,
    backend: &mut dyn Backend,
) -> Result<Uploaded, Error> {
    match upload_missing(source, encoding, plan, backend) {
        Err(Error::Upload(UploadError::PoolFull { .. })) => {
            backend.set_volume(volume)?;
            upload_missing(source, encoding, plan, backend)
        }
        other => other,
    }
}

fn upload_missing(
    source: &dyn NodeSource,
    encoding: &Encoding,
    plan: &Plan,
    backend: &mut dyn Backend,
) -> Result<Uploaded, Error> {
    let placed = plan.nodes.iter().zip(&plan.bricks);
    let missing: Vec<(Node, BrickId)> = placed
        .filter(|(_, brick)| !backend.is_resident(brick.id))
        .map(|(&node, brick)| (node, brick.id))
        .collect();
    let samples = (source.layout().brick_cells() + 1).pow(3);
    let bytes_per_slot = samples * encoding.texel.bytes().max(source.sample_type().bytes());
    let num_slots = (BATCH_BYTES / bytes_per_slot).clamp(1, missing.len().max(1));
    let new_slot = || (Brick::empty(source.sample_type()), Buffer::default());
    let mut slots: Vec<_> = std::iter::repeat_with(new_slot).take(num_slots).collect();
    let mut uploaded = Uploaded::default();
    for batch in missing.chunks(num_slots) {
        let ready = batch
            .par_iter()
            .zip(&mut slots)
            .map(|(&(node, id), (brick, buffer))| {
                source.read_brick(node, brick)?;
                // At most brick_cells + 1 samples, which fits.
                let samples = brick.shape.count.map(|n| n as u32);
                Ok(volery_frame::Brick { id, samples, texels: encoding.encode(&brick.samples, buffer) })
            })
            .collect::<Result<Vec<_>, ReadError>>()?;
        backend.upload(&ready)?;
        uploaded.bricks += ready.len();
        uploaded.bytes += ready.iter().map(|b| (b.texels.len() * encoding.texel.bytes()) as u64).sum::<u64>();
    }
    Ok(uploaded)
}

/// Numbers the nodes of a tree: those of level 0 first, each level x fastest.
struct Numbers {
    first_of_level: Vec<u64>,
}

impl Numbers {
    fn of(layout: &Layout) -> Self {
        let mut next = 0;
        let first_of_level = (0..layout.num_levels())
            .map(|level| {
                let first = next;
                next += layout.num_nodes(level) as u64;
                first
            })
            .collect();
        Self { first_of_level }
    }

    fn place(&self, layout: &Layout, node: Node) -> PlacedBrick {
        let number = self.first_of_level[node.level as usize] + layout.node_index(node) as u64;
        // A layout's axes are below 2^31 samples, so a node's first cell fits.
        let size = (layout.brick_cells() as u32) << node.level;
        PlacedBrick { id: BrickId(number), first_cell: node.index.map(|i| i * size), level: node.level }
    }
}
