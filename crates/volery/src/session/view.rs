//! What to see, and what a user may leave open.

use std::sync::Arc;

use glam::DVec3;
use volery_frame::planes::MAX_PLANES;
use volery_frame::{Sampling, Thickness};
use volery_scene::{Camera, Plane, TransferFunction, TriangleMesh};

use crate::fit;
use crate::session::RenderError;
use crate::technique::stack::StackView;

/// What to see of a volume or a grid, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Pixels from left to right.
    pub width: u32,
    /// Pixels from top to bottom.
    pub height: u32,
    /// Where the picture is taken from.
    pub camera: Camera,
    /// Values to colour and extinction; not read for samples that are colours.
    pub transfer: TransferFunction,
    /// Linear RGB behind everything.
    pub background: [f64; 3],
    /// Largest difference of a value from the full resolution, as a fraction of the volume's value range;
    /// `None` does not ask for any.
    pub tolerance: Option<f64>,
    /// Which planes; the technique plane alone reads it.
    pub planes: PlaneView,
    /// How the length of a ray in a cube is found; the technique fans alone reads it.
    pub thickness: Thickness,
    /// How cells are sliced; the technique stack alone reads it.
    pub stack: StackView,
    /// Opaque surfaces among the data, in world space: they hide what is behind them.
    pub meshes: Arc<[TriangleMesh]>,
}

/// Where a plane is in full detail: a node is coarser the farther it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Focus {
    /// World position, on a plane or not.
    pub point: DVec3,
    /// A node may be drawn where its centre is farther than so many of its diagonals; 0 draws the coarsest node,
    /// infinity full resolution.
    pub quality: f64,
}

/// Cutting planes, and how they are shown. Without any of `focus`, `max_error` and the view's tolerance they are
/// in full resolution. Error and tolerance hold everywhere, or with a focus, near it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlaneView {
    /// In world space; at most [`MAX_PLANES`].
    pub planes: Vec<Plane>,
    /// Full detail here, less elsewhere.
    pub focus: Option<Focus>,
    /// Largest difference of any colour channel from the full resolution, in [0, 1].
    pub max_error: Option<f64>,
    /// How samples become a field.
    pub sampling: Sampling,
    /// Whether the transfer function's opacity lets light through.
    pub is_transparent: bool,
    /// Whether nodes are outlined in the colour of their level.
    pub shows_nodes: bool,
}

/// Linear RGB behind the volume where nobody says otherwise: nearly black, a little blue.
pub const BACKGROUND: [f64; 3] = [0.03, 0.035, 0.05];

/// What a user may say about a view; [`Session::view`](crate::Session::view) fills in the rest.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewOptions {
    /// Pixels from left to right.
    pub width: u32,
    /// Pixels from top to bottom.
    pub height: u32,
    /// From where to look; if missing, straight at a single plane, else the default direction.
    pub direction: Option<fit::Direction>,
    /// Whether rays are parallel.
    pub orthographic: bool,
    /// Values to colour and extinction; if missing [`Preset::Auto`](crate::Preset::Auto) for matter, grey from
    /// black to white over the range of values for planes.
    pub transfer: Option<TransferFunction>,
    /// The values that automatic colours run over; if missing, those that are worth colours.
    pub range: Option<[f64; 2]>,
    /// Which planes; if there is none, the image itself, or the three in the middle of a volume.
    pub planes: PlaneView,
    /// How cells are sliced.
    pub stack: StackView,
}

impl Default for ViewOptions {
    fn default() -> Self {
        Self {
            width: 768,
            height: 768,
            direction: None,
            orthographic: false,
            transfer: None,
            range: None,
            planes: PlaneView::default(),
            stack: StackView::default(),
        }
    }
}

impl View {
    /// Whether a picture can be made of this, but for its planes.
    pub(crate) fn check(&self) -> Result<(), RenderError> {
        if let Some(defect) = self.camera.defects().into_iter().next() {
            return Err(defect.into());
        }
        if let Some(found) = self.tolerance.filter(|tolerance| !(0.0..).contains(tolerance)) {
            return Err(RenderError::Tolerance { found });
        }
        let found = self.background;
        if !found.iter().all(|c| (0.0..=1.0).contains(c)) {
            return Err(RenderError::Background { found });
        }
        let (width, height) = (self.width, self.height);
        if width == 0 || height == 0 {
            return Err(RenderError::Empty { width, height });
        }
        Ok(())
    }
}

impl PlaneView {
    /// Whether planes can be drawn so.
    pub(crate) fn check(&self) -> Result<(), RenderError> {
        let found = self.planes.len();
        if !(1..=MAX_PLANES).contains(&found) {
            return Err(RenderError::NumPlanes { found });
        }
        let defect = |(index, plane): (usize, &Plane)| {
            plane.defects().into_iter().next().map(|defect| RenderError::Plane { index, defect })
        };
        if let Some(error) = self.planes.iter().enumerate().find_map(defect) {
            return Err(error);
        }
        let is_place = |focus: &Focus| focus.point.is_finite() && focus.quality >= 0.0;
        if let Some(found) = self.focus.filter(|focus| !is_place(focus)) {
            return Err(RenderError::Focus { found });
        }
        if let Some(found) = self.max_error.filter(|error| !(0.0..=1.0).contains(error)) {
            return Err(RenderError::MaxError { found });
        }
        Ok(())
    }
}
