//! Where a node's data come from: memory here, disk elsewhere.

use std::error::Error;

use volery_scene::SampleType;

use crate::brick::Brick;
use crate::layout::Layout;
use crate::node::Node;
use crate::stats::NodeStats;

/// Why a brick could not be read.
#[derive(Debug, thiserror::Error)]
#[error("brick of {node}: {cause}")]
pub struct ReadError {
    /// Whose brick.
    pub node: Node,
    /// What went wrong.
    #[source]
    pub cause: Box<dyn Error + Send + Sync>,
}

/// A pyramid whose nodes can be read in any order, from any thread.
///
/// Layout and statistics are small and at hand; samples may have to be fetched.
pub trait NodeSource: Send + Sync {
    /// Where everything lies.
    fn layout(&self) -> &Layout;

    /// The type of a sample, the same at every level.
    fn sample_type(&self) -> SampleType;

    /// Statistics of a node, one per channel.
    ///
    /// # Panics
    /// When the layout does not [contain](Layout::contains) the node.
    fn stats(&self, node: Node) -> &[NodeStats];

    /// Whether [`read_brick`](Self::read_brick) of this node returns at once rather than waits.
    fn is_at_hand(&self, _node: Node) -> bool {
        true
    }

    /// Fills `brick` with the samples of the node's [shape](Layout::brick_shape), whatever it held before.
    ///
    /// # Errors
    /// When the samples cannot be fetched; a source in memory always can.
    ///
    /// # Panics
    /// When the layout does not [contain](Layout::contains) the node.
    fn read_brick(&self, node: Node, brick: &mut Brick) -> Result<(), ReadError>;
}
