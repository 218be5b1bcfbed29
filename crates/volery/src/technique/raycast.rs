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
//!
//! # Non-goals
//! No blending between levels: at the boundary of two levels the field may jump by at most `2 T`.

use volery_frame::PlacedBrick;
use volery_octree::{Cut, DataTolerance, Frustum, Transparency, Viewpoint, front_to_back, select};
use volery_pyramid::{Node, NodeSource};
use volery_scene::{Camera, TransferFunction};

use crate::technique::residency::Numbers;

/// Cells of a brick per axis: a brick of bytes is 36 kB then, of which shared boundaries are 9 %.
///
/// With 16, the software executor drew engine, heptane and the MRI head 4 to 18 % slower in full resolution,
/// holding 2 to 21 % fewer bytes; a tolerance of 0.05 then halved the bytes of heptane, where 32 saves a fifth.
pub const BRICK_CELLS: usize = 32;

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
