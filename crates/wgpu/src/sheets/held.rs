//! Vertices and triangles on the device, under the name of their revision.

use volery_frame::{Revision, SheetVertices, Sheets};

use super::chunks::{Most, chunks};
use crate::gpu::{Failure, Gpu, Upload};

/// Most vertices and triangles of a part: 32 MiB of floats, and 48 MiB.
const MOST: Most = Most { vertices: 1 << 21, triangles: 1 << 22 };

/// Revisions that are kept: the stacks along three axes, and one across.
const NUM_KEPT: usize = 4;

/// What is on the device, the last used last.
#[derive(Default)]
pub(crate) struct Store(Vec<Held>);

/// What was made of a revision.
pub(crate) struct Held {
    revision: Option<Revision>,
    pub(crate) parts: Vec<Part>,
}

/// Consecutive triangles on the device.
pub(crate) struct Part {
    pub(crate) triangles: std::ops::Range<u32>,
    pub(crate) points: wgpu::Buffer,
    /// `None` where vertices have none.
    pub(crate) gradients: Option<wgpu::Buffer>,
    pub(crate) indices: wgpu::Buffer,
}

impl Store {
    /// What the content's revision is on the device: what is there already, else what is uploaded now.
    pub(crate) fn hold(&mut self, gpu: &Gpu, content: &Sheets<'_>) -> Result<&Held, Failure> {
        let is_held = |held: &Held| held.revision == content.revision && content.revision.is_some();
        let held = match self.0.iter().position(is_held) {
            Some(place) => self.0.remove(place),
            None => {
                self.forget_nameless();
                if content.revision.is_some() {
                    self.0.drain(..(self.0.len() + 1).saturating_sub(NUM_KEPT));
                }
                match gpu.checked(|| Held::new(gpu, content)) {
                    // What is kept is a convenience.
                    Err(Failure::OutOfMemory) if !self.0.is_empty() => {
                        self.0.clear();
                        gpu.checked(|| Held::new(gpu, content))?
                    }
                    held => held?,
                }
            }
        };
        self.0.push(held);
        Ok(&self.0[self.0.len() - 1])
    }

    /// Lets go of what will not be asked for again.
    pub(crate) fn forget_nameless(&mut self) {
        self.0.retain(|held| held.revision.is_some());
    }
}

impl Held {
    fn new(gpu: &Gpu, content: &Sheets<'_>) -> Self {
        let parts = match content.vertices {
            SheetVertices::Exact { points, gradients } => parts(gpu, points, gradients, content.triangles),
            SheetVertices::Quantized { points, gradients, quantization: _ } => {
                parts(gpu, points, gradients, content.triangles)
            }
        };
        Self { revision: content.revision, parts }
    }
}

/// Uploads vertices of any form.
fn parts<P: bytemuck::Pod, G: bytemuck::Pod>(
    gpu: &Gpu,
    points: &[P],
    gradients: &[G],
    triangles: &[[u32; 3]],
) -> Vec<Part> {
    let limits = gpu.device.limits();
    let most_bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size) as usize;
    let most = Most {
        vertices: MOST.vertices.min(most_bytes / size_of::<P>().max(size_of::<G>())),
        triangles: MOST.triangles.min(limits.max_buffer_size as usize / size_of::<[u32; 3]>()),
    };
    let part = |range, points: &[P], gradients: &[G], corners: &[[u32; 3]]| {
        let storage = wgpu::BufferUsages::STORAGE;
        Part {
            triangles: range,
            points: uploaded(gpu, Upload::Geometry, "volery sheet points", points, storage),
            gradients: (!gradients.is_empty())
                .then(|| uploaded(gpu, Upload::Geometry, "volery sheet gradients", gradients, storage)),
            indices: uploaded(
                gpu,
                Upload::Geometry,
                "volery sheet triangles",
                corners,
                wgpu::BufferUsages::INDEX,
            ),
        }
    };
    if points.len() <= most.vertices && triangles.len() <= most.triangles {
        return vec![part(0..triangles.len() as u32, points, gradients, triangles)];
    }
    let parts = chunks(triangles, points.len(), most).map(|chunk| {
        let points: Vec<P> = chunk.vertices.iter().map(|&vertex| points[vertex as usize]).collect();
        // There may be none.
        let gradient = |&vertex: &u32| gradients.get(vertex as usize).copied();
        let gradients: Vec<G> = chunk.vertices.iter().filter_map(gradient).collect();
        part(chunk.triangles, &points, &gradients, &chunk.corners)
    });
    parts.collect()
}

/// A buffer with contents; a device without memory for it reports that, and nobody panics.
pub(crate) fn uploaded<T: bytemuck::Pod>(
    gpu: &Gpu,
    kind: Upload,
    label: &str,
    contents: &[T],
    usage: wgpu::BufferUsages,
) -> wgpu::Buffer {
    let contents: &[u8] = bytemuck::cast_slice(contents);
    let uploaded = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: contents.len() as u64,
        usage: usage | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    gpu.count(kind, contents.len());
    gpu.queue.write_buffer(&uploaded, 0, contents);
    uploaded
}
