//! What to see, how, and how well; and what a user may leave open.

use std::sync::Arc;

use glam::DVec3;
use volery_frame::planes::MAX_PLANES;
use volery_frame::{Sampling, Thickness};
use volery_scene::{Camera, Plane, TransferFunction, TransferFunction2d, TriangleMesh};

use crate::fit;
use crate::interest::Interest;
use crate::session::RenderError;

/// One picture: what to see of data, from where, how, and how well.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Pixels from left to right.
    pub width: u32,
    /// Pixels from top to bottom.
    pub height: u32,
    /// Where the picture is taken from.
    pub camera: Camera,
    /// Linear RGB behind everything.
    pub background: [f64; 3],
    /// Opaque surfaces among the data, in world space: they hide what is behind them.
    pub meshes: Arc<[TriangleMesh]>,
    /// Values to colour and extinction; not read for samples that are colours.
    pub transfer: Transfer,
    /// What the picture may miss.
    pub dial: Dial,
    /// Regions whose errors count more, or less, where a budget of memory is shared out: with [`Dial::Memory`] alone.
    pub interest: Arc<[Interest]>,
    /// By which technique, with its options.
    pub how: How,
}

/// What gives matter its colour and extinction.
#[derive(Clone, Debug, PartialEq)]
pub enum Transfer {
    /// Its value.
    Values(TransferFunction),
    /// Its value and the magnitude of its gradient; of slices alone.
    Magnitudes(Arc<TransferFunction2d>),
}

/// What a picture may miss. A technique obeys it or refuses it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Dial {
    /// Nothing: full resolution.
    #[default]
    Full,
    /// The largest difference of a value from the full resolution, as a fraction of the data's range of values.
    Tolerance(f64),
    /// The largest difference of any colour channel from the full resolution, in [0, 1].
    Error(f64),
    /// As much as is needed for the picture to be there in time.
    Deadline(Deadline),
    /// As much as bricks in so many bytes of device memory can show, with all that is kept for them and what is on its
    /// way to the device.
    Memory(u64),
}

/// When a picture must be there, and what of it matters most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deadline {
    /// Seconds from the call to the picture.
    pub budget_secs: f64,
    /// Where somebody looks, as shares of the picture from its upper left corner: what is near is drawn better.
    pub gaze: Option<[f64; 2]>,
}

/// A technique and what it alone reads.
#[derive(Clone, Debug, PartialEq)]
pub enum How {
    /// Matter of a volume along one ray per pixel.
    Raycast,
    /// Cutting planes through a volume.
    Planes(PlaneView),
    /// Cubes of a volume's octree, back to front; how the length of a ray in a cube is found.
    Fans(Thickness),
    /// Slices through cells.
    Stack(StackView),
    /// Slices that were made before.
    Slices {
        /// Whether a light at the viewer shades matter by its gradient.
        is_lit: bool,
    },
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

/// Cutting planes, and how they are shown. Without a focus the dial holds everywhere, with one near it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlaneView {
    /// In world space; at most [`MAX_PLANES`]. For [`Session::view`](crate::Session::view), none are those in the
    /// middle.
    pub planes: Vec<Plane>,
    /// Full detail here, less elsewhere.
    pub focus: Option<Focus>,
    /// How samples become a field.
    pub sampling: Sampling,
    /// Whether the transfer function's opacity lets light through.
    pub is_transparent: bool,
    /// Whether nodes are outlined in the colour of their level.
    pub shows_nodes: bool,
}

/// How cells are sliced.
#[derive(Clone, Debug, PartialEq)]
pub struct StackView {
    /// Which planes.
    pub slicing: Slicing,
    /// Planes over the extent of the grid along their normal; of semi-adaptive slicing those of the first step.
    pub num_slices: usize,
    /// Share of the cells, in [0, 1], that planes are to meet: as long as fewer are met, planes are put between
    /// others where the cells are. `None`: even planes alone.
    pub adaptive: Option<f64>,
    /// Whether a light at the viewer shades matter by its gradient.
    pub is_lit: bool,
    /// Whether vertices are kept and sent in 8 bytes in place of 16, 12 in place of 32 with gradients.
    pub is_quantized: bool,
}

/// Which planes cut the cells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Slicing {
    /// Perpendicular to the direction of view, for each picture anew.
    #[default]
    Immediate,
    /// Perpendicular to x, y or z, made once: what a camera in motion needs.
    Axes,
}

/// Linear RGB behind the data where nobody says otherwise: nearly black, a little blue.
pub const BACKGROUND: [f64; 3] = [0.03, 0.035, 0.05];

/// What a user may say about a view; [`Session::view`](crate::Session::view) fills in the rest.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewOptions {
    /// Pixels from left to right.
    pub width: u32,
    /// Pixels from top to bottom.
    pub height: u32,
    /// From where to look; if missing, straight at a single plane, else from the front of what is anatomical, or the
    /// default direction.
    pub direction: Option<fit::Direction>,
    /// A direction of the world that is up in the picture; if missing, z.
    pub up: Option<DVec3>,
    /// Whether rays are parallel.
    pub orthographic: bool,
    /// If missing [`Preset::Auto`](crate::Preset::Auto) for matter, grey from black to white over the range of values
    /// for planes.
    pub transfer: Option<Transfer>,
    /// The values that automatic colours run over; if missing, those that are worth colours.
    pub range: Option<[f64; 2]>,
    /// By which technique; if missing, the one that suits the data.
    pub how: Option<How>,
}

impl Default for ViewOptions {
    fn default() -> Self {
        Self {
            width: 768,
            height: 768,
            direction: None,
            up: None,
            orthographic: false,
            transfer: None,
            range: None,
            how: None,
        }
    }
}

impl ViewOptions {
    /// Width over height.
    pub(crate) fn aspect(&self) -> f64 {
        f64::from(self.width.max(1)) / f64::from(self.height.max(1))
    }

    /// How to look, from a direction unless the options have another.
    pub(crate) fn look(&self, direction: fit::Direction) -> fit::Look {
        fit::Look {
            direction: self.direction.unwrap_or(direction),
            up: self.up.unwrap_or(DVec3::Z),
            orthographic: self.orthographic,
            aspect: self.aspect(),
        }
    }

    /// Transfer function of the options, else another.
    pub(crate) fn transfer_or(&self, other: impl FnOnce() -> TransferFunction) -> Transfer {
        self.transfer.clone().unwrap_or_else(|| Transfer::Values(other()))
    }

    /// A view in full resolution, with the rest filled in.
    pub(crate) fn view(&self, camera: Camera, transfer: Transfer, how: How) -> View {
        View {
            width: self.width,
            height: self.height,
            camera,
            background: BACKGROUND,
            meshes: [].into(),
            transfer,
            dial: Dial::Full,
            interest: [].into(),
            how,
        }
    }
}

impl View {
    /// Whether a picture can be made of this, whatever the technique.
    pub(crate) fn check(&self) -> Result<(), RenderError> {
        if let Some(defect) = self.camera.defects().into_iter().next() {
            return Err(defect.into());
        }
        match self.dial {
            Dial::Tolerance(found) if !(0.0..).contains(&found) => {
                return Err(RenderError::Tolerance { found });
            }
            Dial::Error(found) if !(0.0..=1.0).contains(&found) => {
                return Err(RenderError::MaxError { found });
            }
            Dial::Deadline(found) if !found.is_meaningful() => return Err(RenderError::Deadline { found }),
            Dial::Full | Dial::Tolerance(_) | Dial::Error(_) | Dial::Deadline(_) | Dial::Memory(_) => {}
        }
        let is_read = matches!(self.dial, Dial::Memory(_));
        if let Some(&found) = self.interest.iter().find(|interest| !is_read || !interest.is_meaningful()) {
            return Err(RenderError::Interest { found, dial: self.dial });
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

    /// The transfer function, for what has values alone.
    pub(crate) fn of_values(&self) -> Result<&TransferFunction, RenderError> {
        match &self.transfer {
            Transfer::Values(transfer) => Ok(transfer),
            Transfer::Magnitudes(_) => Err(RenderError::Magnitudes { technique: self.how.name() }),
        }
    }

    /// Refuses a dial that the technique does not obey.
    pub(crate) fn obeyed(&self, obeyed: fn(Dial) -> bool) -> Result<(), RenderError> {
        let dial = self.dial;
        if obeyed(dial) { Ok(()) } else { Err(RenderError::Dial { technique: self.how.name(), dial }) }
    }
}

impl Deadline {
    fn is_meaningful(&self) -> bool {
        let is_place = |gaze: [f64; 2]| gaze.iter().all(|share| (0.0..=1.0).contains(share));
        self.budget_secs >= 0.0 && self.budget_secs.is_finite() && self.gaze.is_none_or(is_place)
    }
}

impl From<TransferFunction> for Transfer {
    fn from(transfer: TransferFunction) -> Self {
        Self::Values(transfer)
    }
}

impl How {
    /// Name of the technique on the command line and in reports.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Raycast => "raycast",
            Self::Planes(_) => "plane",
            Self::Fans(_) => "fans",
            Self::Stack(_) | Self::Slices { .. } => "stack",
        }
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
        match self.focus.filter(|focus| !is_place(focus)) {
            Some(found) => Err(RenderError::Focus { found }),
            None => Ok(()),
        }
    }
}

impl Default for StackView {
    fn default() -> Self {
        Self {
            slicing: Slicing::default(),
            num_slices: 128,
            adaptive: None,
            is_lit: false,
            is_quantized: false,
        }
    }
}
