//! Which bricks are resident, and how the others get there.
//!
//! Bricks are read in parallel into a fixed number of buffers: [`BATCH_BYTES`] is all that uploading needs beside
//! what the backend keeps. Where the backend's memory is full, it forgets what this frame does not need.

use std::collections::HashSet;

use rayon::prelude::*;
use volery_frame::{Backend, BrickId, PlacedBrick, UploadError, VolumeLayout};
use volery_pyramid::{Brick, Layout, Node, NodeSource, ReadError};

use crate::texels::{Buffer, Encoding};

/// How a backend stores the bricks of a volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Store {
    /// What the backend is told.
    pub layout: VolumeLayout,
    pub(crate) encoding: Encoding,
}

/// Texels on their way to the backend at one time.
pub const BATCH_BYTES: usize = 16 << 20;

/// What uploading moved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Uploaded {
    /// Bricks.
    pub bricks: usize,
    /// Bytes of texels.
    pub bytes: u64,
}

impl std::ops::AddAssign for Uploaded {
    fn add_assign(&mut self, other: Self) {
        self.bricks += other.bricks;
        self.bytes += other.bytes;
    }
}

/// Why bricks could not be made resident.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A brick could not be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The backend refused.
    #[error(transparent)]
    Upload(#[from] UploadError),
}

/// Makes the bricks of these nodes resident, those that are not, in a backend that may hold another volume.
pub(crate) fn upload(
    source: &dyn NodeSource,
    store: &Store,
    nodes: &[Node],
    backend: &mut dyn Backend,
) -> Result<Uploaded, Error> {
    let encoding = &store.encoding;
    choose_volume(store, backend)?;
    match upload_missing(source, encoding, nodes, BATCH_BYTES, backend) {
        Err(Error::Upload(UploadError::PoolFull { .. })) => {
            evict_others(source.layout(), nodes, backend);
            upload_missing(source, encoding, nodes, BATCH_BYTES, backend)
        }
        other => other,
    }
}

/// As [`upload`], never above `max_bytes` of the backend's memory: what is not needed goes before anything comes, what is
/// stays, and what is on its way fits as well, at least one brick of it.
pub(crate) fn upload_within(
    source: &dyn NodeSource,
    store: &Store,
    nodes: &[Node],
    max_bytes: u64,
    backend: &mut dyn Backend,
) -> Result<Uploaded, Error> {
    choose_volume(store, backend)?;
    evict_others(source.layout(), nodes, backend);
    backend.reserve(nodes.len(), max_bytes)?;
    let all: u64 = nodes.iter().map(|&node| device_bytes(source, store, node, backend)).sum();
    let left = usize::try_from(max_bytes.saturating_sub(all)).unwrap_or(BATCH_BYTES);
    upload_missing(source, &store.encoding, nodes, left.min(BATCH_BYTES), backend)
}

/// Bytes of the backend's memory that a node's brick takes.
pub(crate) fn device_bytes(source: &dyn NodeSource, store: &Store, node: Node, backend: &dyn Backend) -> u64 {
    // At most brick_cells + 1 samples, which fits.
    let samples = source.layout().brick_shape(node).count.map(|n| n as u32);
    backend.brick_bytes(&store.layout, samples)
}

fn choose_volume(store: &Store, backend: &mut dyn Backend) -> Result<(), UploadError> {
    if backend.volume() == Some(store.layout.revision) { Ok(()) } else { backend.set_volume(&store.layout) }
}

/// Bytes of texels of the nodes whose bricks are not resident, were all bricks whole.
pub(crate) fn missing_bytes(
    source: &dyn NodeSource,
    store: &Store,
    nodes: &[Node],
    backend: &dyn Backend,
) -> u64 {
    let missing = missing(source.layout(), store, nodes, backend).count();
    missing as u64 * brick_bytes(source, store)
}

/// Makes the first of these bricks resident that are not, of so many bytes together, one at least: then all are, some time.
/// A backend that has no room for them goes without.
pub(crate) fn prefetch(
    source: &dyn NodeSource,
    store: &Store,
    nodes: &[Node],
    max_bytes: u64,
    backend: &mut dyn Backend,
) -> Result<Uploaded, Error> {
    let num = (max_bytes / brick_bytes(source, store)).max(1) as usize;
    let nodes: Vec<Node> = missing(source.layout(), store, nodes, backend).take(num).collect();
    match upload_missing(source, &store.encoding, &nodes, BATCH_BYTES, backend) {
        Err(Error::Upload(UploadError::PoolFull { .. })) => Ok(Uploaded::default()),
        other => other,
    }
}

fn missing<'a>(
    layout: &'a Layout,
    store: &Store,
    nodes: &'a [Node],
    backend: &'a dyn Backend,
) -> impl Iterator<Item = Node> + 'a {
    let numbers = Numbers::of(layout);
    let is_held = backend.volume() == Some(store.layout.revision);
    nodes.iter().copied().filter(move |&node| !is_held || !backend.is_resident(numbers.id(layout, node)))
}

fn brick_bytes(source: &dyn NodeSource, store: &Store) -> u64 {
    let samples = (source.layout().brick_cells() + 1).pow(3);
    (samples * store.encoding.texel.bytes()) as u64
}

/// Has the backend forget the bricks of all nodes but these.
fn evict_others(layout: &Layout, nodes: &[Node], backend: &mut dyn Backend) {
    let needed: HashSet<Node> = nodes.iter().copied().collect();
    let numbers = Numbers::of(layout);
    let all = (0..layout.num_levels()).flat_map(|level| layout.level_nodes(level));
    let others = all.filter(|node| !needed.contains(node)).map(|node| numbers.id(layout, node));
    let others: Vec<BrickId> = others.filter(|&id| backend.is_resident(id)).collect();
    backend.evict(&others);
}

fn upload_missing(
    source: &dyn NodeSource,
    encoding: &Encoding,
    nodes: &[Node],
    batch_bytes: usize,
    backend: &mut dyn Backend,
) -> Result<Uploaded, Error> {
    let numbers = Numbers::of(source.layout());
    let missing: Vec<(Node, BrickId)> = nodes
        .iter()
        .map(|&node| (node, numbers.id(source.layout(), node)))
        .filter(|&(_, id)| !backend.is_resident(id))
        .collect();
    let samples = (source.layout().brick_cells() + 1).pow(3);
    let bytes_per_slot = samples * encoding.texel.bytes().max(source.sample_type().bytes());
    let num_slots = (batch_bytes / bytes_per_slot).clamp(1, missing.len().max(1));
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
pub(crate) struct Numbers {
    first_of_level: Vec<u64>,
}

impl Numbers {
    pub(crate) fn of(layout: &Layout) -> Self {
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

    pub(crate) fn id(&self, layout: &Layout, node: Node) -> BrickId {
        BrickId(self.first_of_level[node.level as usize] + layout.node_index(node) as u64)
    }

    pub(crate) fn place(&self, layout: &Layout, node: Node) -> PlacedBrick {
        // A layout's axes are below 2^31 samples, so a node's first cell fits.
        let size = (layout.brick_cells() as u32) << node.level;
        PlacedBrick { id: self.id(layout, node), first_cell: node.index.map(|i| i * size), level: node.level }
    }
}
