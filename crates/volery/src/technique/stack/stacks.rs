//! The stacks of a grid that are made, and which one a view shows.

use std::sync::Arc;

use glam::DVec3;
use volery_frame::Revision;
use volery_scene::{Camera, Samples};
use volery_slicing::{Planes, QuantizedMesh, Refinement, Slicer};

use super::{Error, Stack, needs_gradients};
use crate::data::GridData;
use crate::view::{Slicing, StackView, View};

/// What a stack was made by: it serves every view that asks for the same.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Recipe {
    normal: DVec3,
    num_slices: usize,
    adaptive: Option<f64>,
    has_gradients: bool,
    is_quantized: bool,
}

impl Recipe {
    /// What a view asks for, by planes perpendicular to a unit vector.
    fn new(view: &StackView, has_gradients: bool, normal: DVec3) -> Self {
        let &StackView { num_slices, adaptive, is_quantized, .. } = view;
        Self { normal, num_slices, adaptive, has_gradients, is_quantized }
    }

    /// Slices; `gradients` at the nodes are used where they are needed.
    fn stack(self, slicer: &Slicer, values: &Samples, gradients: Option<&[DVec3]>) -> Result<Stack, Error> {
        let Self { normal, num_slices, adaptive, has_gradients, is_quantized } = self;
        let gradients = gradients.filter(|_| has_gradients);
        let mesh = match adaptive {
            None => slicer.mesh(&Planes::over(slicer.grid(), normal, num_slices)?, values, gradients)?,
            Some(share) => {
                let refinement = Refinement { first_planes: num_slices, share };
                slicer.mesh_adaptively(normal, refinement, values, gradients)?.0
            }
        };
        let quantized = is_quantized.then(|| QuantizedMesh::new(&mesh)).transpose()?;
        Ok(Stack::new(mesh, quantized))
    }
}

/// What is kept from picture to picture.
#[derive(Default)]
pub(super) struct Stacks {
    immediate: Option<(Recipe, Arc<Stack>)>,
    /// Along x, y and z, or none at all.
    axes: Vec<(Recipe, Arc<Stack>)>,
    /// The grid's shape and values that they are of.
    of: Option<[Revision; 2]>,
}

impl Stacks {
    /// Gives all of them the values that the grid has now; where that cannot be, or cells are others, there are none.
    pub(super) fn follow(&mut self, grid: &mut GridData) {
        let now = [grid.shape_revision(), grid.values_revision()];
        let before = self.of.replace(now);
        if before == Some(now) {
            return;
        }
        let is_same_shape = before.is_some_and(|[shape, _]| shape == now[0]);
        if is_same_shape && self.all().any(|stack| stack.has_gradients()) {
            grid.make_gradients();
        }
        let (values, gradients) = (grid.values(), grid.gradients());
        if !is_same_shape || self.set_values(values, gradients).is_err() {
            (self.immediate, self.axes) = (None, Vec::new());
        }
    }

    /// Makes what a view needs and what is not there.
    pub(super) fn make(&mut self, of_view: &StackView, view: &View, grid: &GridData) -> Result<(), Error> {
        let (slicer, has_gradients) = (grid.slicer(), needs_gradients(view));
        let stack =
            |recipe: Recipe| Ok((recipe, Arc::new(recipe.stack(slicer, grid.values(), grid.gradients())?)));
        match of_view.slicing {
            Slicing::Immediate => {
                let recipe = Recipe::new(of_view, has_gradients, view.camera.axes()[2]);
                if self.immediate.as_ref().is_none_or(|(made, _)| *made != recipe) {
                    // Not both at a time in memory.
                    self.immediate = None;
                    self.immediate = Some(stack(recipe)?);
                }
            }
            Slicing::Axes => {
                let recipes = DVec3::AXES.map(|axis| Recipe::new(of_view, has_gradients, axis));
                if !self.axes.iter().map(|(made, _)| *made).eq(recipes) {
                    self.axes.clear();
                    self.axes = recipes.into_iter().map(stack).collect::<Result<_, Error>>()?;
                }
            }
        }
        Ok(())
    }

    /// The one that a view shows, once it is made.
    pub(super) fn shown(&self, slicing: Slicing, camera: &Camera) -> Option<&Arc<Stack>> {
        let shown = match slicing {
            Slicing::Immediate => self.immediate.as_ref(),
            Slicing::Axes => {
                let along = camera.axes()[2].abs();
                let nearest = (0..3).rev().max_by(|&a, &b| along[a].total_cmp(&along[b]));
                nearest.and_then(|axis| self.axes.get(axis))
            }
        };
        shown.map(|(_, stack)| stack)
    }

    pub(super) fn forget_immediate(&mut self) {
        self.immediate = None;
    }

    fn all(&self) -> impl Iterator<Item = &Arc<Stack>> {
        self.immediate.iter().chain(&self.axes).map(|(_, stack)| stack)
    }

    /// Gives all of them other values at the nodes, and gradients to those that have some.
    fn set_values(&mut self, values: &Samples, gradients: Option<&[DVec3]>) -> Result<(), Error> {
        let mut stacks = self.immediate.iter_mut().chain(&mut self.axes);
        stacks.try_for_each(|(_, stack)| Arc::make_mut(stack).set_values(values, gradients))
    }

    /// Bytes of vertices and triangles.
    pub(super) fn num_bytes(&self) -> u64 {
        self.all().map(|stack| stack.num_bytes()).sum()
    }
}
