//! The stacks of a grid that are made, and which one a view shows.

use glam::DVec3;
use volery_scene::{Camera, Samples};
use volery_slicing::Slicer;

use crate::technique::stack::{Error, Recipe, Slicing, Stack, StackView};

/// What is kept from picture to picture.
#[derive(Default)]
pub(super) struct Stacks {
    immediate: Option<(Recipe, Stack)>,
    /// Along x, y and z, or none at all.
    axes: Vec<(Recipe, Stack)>,
}

impl Stacks {
    /// Makes what a view needs and what is not there, from values and gradients at the nodes.
    pub(super) fn make(
        &mut self,
        view: &StackView,
        camera: &Camera,
        slicer: &Slicer,
        (values, gradients): (&Samples, Option<&[DVec3]>),
    ) -> Result<(), Error> {
        let stack = |recipe: Recipe| Ok((recipe, recipe.stack(slicer, values, gradients)?));
        match view.slicing {
            Slicing::Immediate => {
                let recipe = Recipe::new(view, camera.axes()[2]);
                if self.immediate.as_ref().is_none_or(|(made, _)| *made != recipe) {
                    // Not both at a time in memory.
                    self.immediate = None;
                    self.immediate = Some(stack(recipe)?);
                }
            }
            Slicing::Axes => {
                let recipes = DVec3::AXES.map(|axis| Recipe::new(view, axis));
                if !self.axes.iter().map(|(made, _)| *made).eq(recipes) {
                    self.axes.clear();
                    self.axes = recipes.into_iter().map(stack).collect::<Result<_, Error>>()?;
                }
            }
        }
        Ok(())
    }

    /// The one that a view shows, once it is made.
    pub(super) fn shown(&mut self, slicing: Slicing, camera: &Camera) -> Option<&mut Stack> {
        let shown = match slicing {
            Slicing::Immediate => self.immediate.as_mut(),
            Slicing::Axes => {
                let along = camera.axes()[2].abs();
                let nearest = (0..3).rev().max_by(|&a, &b| along[a].total_cmp(&along[b]));
                nearest.and_then(|axis| self.axes.get_mut(axis))
            }
        };
        shown.map(|(_, stack)| stack)
    }

    pub(super) fn forget_immediate(&mut self) {
        self.immediate = None;
    }

    /// Gives all of them other values at the nodes, and gradients to those that have some.
    pub(super) fn set_values(&mut self, values: &Samples, gradients: Option<&[DVec3]>) -> Result<(), Error> {
        let stacks = self.immediate.iter_mut().chain(&mut self.axes);
        stacks.map(|(_, stack)| stack).try_for_each(|stack| stack.set_values(values, gradients))
    }

    /// Bytes of vertices and triangles.
    pub(super) fn num_bytes(&self) -> u64 {
        self.immediate.iter().chain(&self.axes).map(|(_, stack)| stack.num_bytes()).sum()
    }
}
