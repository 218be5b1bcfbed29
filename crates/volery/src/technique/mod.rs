//! Techniques: from data and a view to a plan that any backend draws.
//!
//! A technique is a module here and a line in the list of the [data](crate::data) that it draws. It keeps what outlasts
//! a picture; its plans are plain data, in the words of `volery-frame`.

pub mod fans;
pub mod planes;
pub mod raycast;
pub mod stack;

use std::sync::Arc;

use volery_frame::{
    Backend, BlendedBrick, Content, Cube, Cubes, JoinedBrick, Light, Planes, PointTransfer, RayTransfer,
    Rays, Revision, Sampling, Sheet, SheetTransfer, Thickness,
};
use volery_pyramid::Node;
use volery_scene::Plane;

use crate::matter_bound::MatterBound;
use crate::residency::Store;
use crate::session::{RenderError, VerifyError};
use crate::view::{How, View, ViewOptions};

/// How data of one kind are drawn.
pub trait Technique<D>: Send {
    /// Whether it is the one that a view asks for.
    fn draws(&self, how: &How) -> bool;

    /// Fills in what a user leaves open.
    fn view(&self, data: &D, options: &ViewOptions, how: How) -> View;

    /// Whether data, options, transfer function and dial go together; what can be said of any view was said before.
    ///
    /// # Errors
    /// With what does not.
    fn check(&self, data: &D, view: &View) -> Result<(), RenderError>;

    /// Makes ready what outlasts views: the first picture waits for it.
    fn prepare(&mut self, data: &D) {
        let _ = data;
    }

    /// Lets go of what was made for the last view alone: several pictures of one are timed as if each were the first.
    fn forget_view(&mut self) {}

    /// A view in full resolution at one of its coarser levels of detail, from 1 on; `None` after the coarsest. What obeys
    /// deadlines has some.
    fn coarser(&self, view: &View, rung: usize) -> Option<View> {
        let _ = (view, rung);
        None
    }

    /// Chooses what to draw of a view that was checked.
    ///
    /// # Errors
    /// When there is nothing to choose from, or too much. `backend` says what bricks would take of its memory.
    fn plan(&mut self, data: &mut D, view: &View, backend: &dyn Backend) -> Result<Plan, RenderError>;

    /// How far each pixel of what a view draws can be from the exact picture; `None` where that is not known.
    ///
    /// # Errors
    /// As [`Technique::plan`].
    fn bound(&mut self, data: &mut D, view: &View) -> Result<Option<MatterBound>, RenderError> {
        let _ = (data, view);
        Ok(None)
    }

    /// The exact picture, in `f64`. `progress` hears a number in [0, 1] now and then.
    ///
    /// # Errors
    /// When the reference does not know what is shown, or has no memory for it.
    fn truth(
        &self,
        data: &D,
        view: &View,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<volery_reference::Image, VerifyError>;
}

/// What one picture draws.
#[derive(Clone, Debug)]
pub struct Plan {
    /// What the backend is asked for.
    pub drawing: Drawing,
    /// The volume that it belongs to, with the nodes whose bricks must be resident; of grids there is none.
    pub store: Option<(Store, Vec<Node>)>,
    /// How much there is to do.
    pub work: Work,
    /// No channel of any pixel differs by more from the full resolution; `None` where that is not known.
    pub bound_max: Option<f64>,
    /// What the picture is predicted to be off by from the full resolution; where a budget of memory asked for that.
    pub predicted_rmse: Option<f64>,
    /// Seconds of planning that were slicing.
    pub geometry_seconds: Option<f64>,
}

/// How much there is to do for a picture; `None` for what there is none of.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Nodes drawn of each level, or cubes.
    pub nodes_by_level: Option<Vec<usize>>,
    /// Polygons in which planes cut nodes or cells.
    pub polygons: Option<usize>,
    /// Planes that met cells.
    pub slices: Option<usize>,
    /// Triangles drawn.
    pub triangles: Option<usize>,
    /// Bytes of slices that the technique keeps, and of those that go to the backend now.
    pub slice_bytes: Option<[u64; 2]>,
}

/// A [`Content`] that owns what it shows.
#[derive(Clone, Debug)]
pub enum Drawing {
    /// Matter along rays.
    Rays {
        /// Colour and extinction.
        transfer: Arc<RayTransfer>,
        /// Front to back.
        bricks: Vec<JoinedBrick>,
    },
    /// Cutting planes.
    Planes {
        /// Which.
        planes: Vec<Plane>,
        /// Colour and opacity.
        transfer: Arc<PointTransfer>,
        /// In any order.
        bricks: Vec<BlendedBrick>,
        /// How samples become a field.
        sampling: Sampling,
        /// Whether opacity lets light through.
        is_transparent: bool,
        /// Whether bricks are outlined.
        shows_bricks: bool,
    },
    /// Cubes of constant matter.
    Cubes {
        /// Names the list, where it may serve again.
        revision: Option<Revision>,
        /// Back to front.
        cubes: Arc<Vec<Cube>>,
        /// How the length of a ray in them is found.
        thickness: Thickness,
    },
    /// Slices through matter.
    Sheets {
        /// Their vertices and triangles.
        stack: Arc<stack::Stack>,
        /// Back to front.
        sheets: Vec<Sheet>,
        /// Colour and extinction.
        transfer: Arc<SheetTransfer>,
        /// What shades them.
        light: Option<Light>,
    },
}

impl Drawing {
    /// For a backend.
    pub fn content(&self) -> Content<'_> {
        match self {
            Self::Rays { transfer, bricks } => Content::Rays(Rays { transfer, bricks }),
            Self::Planes { planes, transfer, bricks, sampling, is_transparent, shows_bricks } => {
                Content::Planes(Planes {
                    planes,
                    bricks,
                    transfer,
                    sampling: *sampling,
                    is_transparent: *is_transparent,
                    shows_bricks: *shows_bricks,
                })
            }
            Self::Cubes { revision, cubes, thickness } => {
                Content::Cubes(Cubes { revision: *revision, cubes, thickness: *thickness })
            }
            Self::Sheets { stack, sheets, transfer, light } => {
                Content::Sheets(stack.content(sheets, transfer, *light))
            }
        }
    }
}

/// The last thing made, and what it was made of.
#[derive(Debug)]
pub(crate) struct Kept<K, V>(Option<(K, Arc<V>)>);

impl<K, V> Default for Kept<K, V> {
    fn default() -> Self {
        Self(None)
    }
}

impl<K: Clone + PartialEq, V> Kept<K, V> {
    /// What was made of the same key.
    pub(crate) fn found(&self, key: &K) -> Option<Arc<V>> {
        self.0.as_ref().filter(|(made_of, _)| made_of == key).map(|(_, kept)| kept.clone())
    }

    /// What was made of the same key, or else is made now.
    pub(crate) fn get(&mut self, key: &K, make: impl FnOnce() -> V) -> Arc<V> {
        self.found(key).unwrap_or_else(|| {
            let made = Arc::new(make());
            self.0 = Some((key.clone(), made.clone()));
            made
        })
    }
}
