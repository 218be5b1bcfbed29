//! A session with a backend of its own.

use std::ops::{Deref, DerefMut};
use std::sync::Arc;

use volery::{
    Backend, Data, GridData, GridError, How, Picture, PlaneView, Progressive, QuantizedMesh, Refinements,
    RenderError, Session, StackData, StackError, UnstructuredGrid, View, ViewOptions, VolumeData,
    VolumeError, VoxelGrid,
};
use volery_pyramid::NodeSource;

/// A session, a backend, and how its views are drawn where they do not say.
pub struct Drawer<D> {
    session: Session<D>,
    /// Who draws.
    pub backend: Box<dyn Backend>,
    how: Option<How>,
}

impl Drawer<VolumeData> {
    /// Of a volume.
    ///
    /// # Errors
    /// As [`VolumeData::new`].
    pub fn volume(grid: VoxelGrid, backend: Box<dyn Backend>, how: How) -> Result<Self, VolumeError> {
        Ok(Self { session: Session::new(VolumeData::new(grid)?), backend, how: Some(how) })
    }

    /// As [`Session::refinements`].
    ///
    /// # Errors
    /// As there.
    pub fn refinements(&mut self, view: &View) -> Result<Refinements<'_>, RenderError> {
        self.session.refinements(view, self.backend.as_mut())
    }

    /// As [`Session::progressive`].
    ///
    /// # Errors
    /// As there.
    pub fn progressive<'a>(
        &'a mut self,
        view: &View,
        arrivals: Option<&'a dyn NodeSource>,
        bricks_per_step: usize,
    ) -> Result<Progressive<'a>, RenderError> {
        self.session.progressive(view, arrivals, bricks_per_step, self.backend.as_mut())
    }
}

impl Drawer<GridData> {
    /// Of a grid.
    ///
    /// # Errors
    /// As [`GridData::new`].
    pub fn grid(
        grid: impl Into<Arc<UnstructuredGrid>>,
        array: Option<&str>,
        backend: Box<dyn Backend>,
    ) -> Result<Self, GridError> {
        Ok(Self { session: Session::new(GridData::new(grid, array)?), backend, how: None })
    }
}

impl Drawer<StackData> {
    /// Of slices.
    ///
    /// # Errors
    /// As [`StackData::new`].
    pub fn stack(mesh: QuantizedMesh, backend: Box<dyn Backend>) -> Result<Self, StackError> {
        Ok(Self { session: Session::new(StackData::new(mesh)?), backend, how: None })
    }
}

impl<D: Data> Drawer<D> {
    /// As [`Session::view`], drawn as was said first.
    pub fn view(&self, options: &ViewOptions) -> View {
        let how = options.how.clone().or(self.how.clone());
        self.session.view(&ViewOptions { how, ..options.clone() })
    }

    /// As [`Session::render`].
    ///
    /// # Errors
    /// As there.
    pub fn render(&mut self, view: &View) -> Result<Picture, RenderError> {
        self.session.render(view, self.backend.as_mut())
    }

    /// As [`Session::render_frames`].
    ///
    /// # Errors
    /// As there.
    pub fn render_frames(&mut self, view: &View, num_frames: usize) -> Result<Picture, RenderError> {
        self.session.render_frames(view, num_frames, self.backend.as_mut())
    }
}

impl<D> Deref for Drawer<D> {
    type Target = Session<D>;

    fn deref(&self) -> &Session<D> {
        &self.session
    }
}

impl<D> DerefMut for Drawer<D> {
    fn deref_mut(&mut self) -> &mut Session<D> {
        &mut self.session
    }
}

/// The planes of a view.
///
/// # Panics
/// When it is of something else.
pub fn planes_of(view: &mut View) -> &mut PlaneView {
    match &mut view.how {
        How::Planes(planes) => planes,
        other => panic!("{other:?}, expected planes"),
    }
}

/// How cells of a view are sliced.
///
/// # Panics
/// When it is of something else.
pub fn stack_of(view: &mut View) -> &mut volery::StackView {
    match &mut view.how {
        How::Stack(stack) => stack,
        other => panic!("{other:?}, expected a stack"),
    }
}

/// A view with another stack.
///
/// # Panics
/// When it is of something else.
#[must_use]
pub fn with_stack(view: &View, change: impl FnOnce(&mut volery::StackView)) -> View {
    let mut view = view.clone();
    change(stack_of(&mut view));
    view
}

/// The transfer function of a view over values.
///
/// # Panics
/// When it is of magnitudes too.
pub fn values_of(view: &View) -> &volery::TransferFunction {
    match &view.transfer {
        volery::Transfer::Values(transfer) => transfer,
        other => panic!("{other:?}, expected one of values"),
    }
}
