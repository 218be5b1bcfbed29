//! Sections one above another.

use glam::DVec3;

use crate::section::Section;

/// One plane of a stack.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Distance of the plane from the origin along the stack's normal.
    pub position: f64,
    /// Thickness of the slab that the plane stands for: the distance between the planes it was cut with.
    pub thickness: f64,
    /// The polygons; `None` where the plane meets no cell.
    pub section: Option<Section>,
}

/// Layers by ascending position. Layers know nothing of each other, so that some can be put between others.
#[derive(Clone, Debug, PartialEq)]
pub struct Stack {
    normal: DVec3,
    layers: Vec<Layer>,
}

/// Two stacks that cannot be one.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("slice stack: layers of normal {found}, expected {expected}")]
pub struct NormalError {
    /// The normal of what was to be merged in.
    pub found: DVec3,
    /// The normal of the stack.
    pub expected: DVec3,
}

impl Stack {
    /// Sorts the layers.
    pub(crate) fn new(normal: DVec3, mut layers: Vec<Layer>) -> Self {
        layers.sort_by(|a, b| a.position.total_cmp(&b.position));
        Self { normal, layers }
    }

    /// The unit normal of all its planes.
    pub fn normal(&self) -> DVec3 {
        self.normal
    }

    /// The layers by ascending position.
    pub fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// The layers that meet cells, with their polygons.
    pub fn sections(&self) -> impl DoubleEndedIterator<Item = (&Layer, &Section)> {
        self.layers.iter().filter_map(|layer| Some((layer, layer.section.as_ref()?)))
    }

    /// Polygons of all layers.
    pub fn num_polygons(&self) -> usize {
        self.sections().map(|(_, section)| section.num_polygons()).sum()
    }

    /// Vertices of all layers.
    pub fn num_vertices(&self) -> usize {
        self.sections().map(|(_, section)| section.num_vertices()).sum()
    }

    /// Puts the layers of another stack between its own, which move but do not change. Of layers at the same
    /// position its own come first.
    ///
    /// # Errors
    /// When the normals differ; then nothing has changed.
    pub fn merge(&mut self, other: Self) -> Result<(), NormalError> {
        if other.normal != self.normal {
            return Err(NormalError { found: other.normal, expected: self.normal });
        }
        self.append(other);
        Ok(())
    }

    pub(crate) fn append(&mut self, other: Self) {
        self.layers.extend(other.layers);
        // Stable, and linear on two ascending runs.
        self.layers.sort_by(|a, b| a.position.total_cmp(&b.position));
    }

    /// Takes out the layers for which `keep` says no.
    pub fn retain(&mut self, keep: impl FnMut(&Layer) -> bool) {
        self.layers.retain(keep);
    }
}
