//! The trait of executors.

use crate::{Brick, BrickId, Content, Frame, PictureView, Revision, TexelType, VolumeLayout, planes, sheets};

/// A picture in linear RGB.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Pixels from left to right.
    pub width: u32,
    /// Pixels from top to bottom.
    pub height: u32,
    /// Rows from the top, pixels from the left; `width * height` of them.
    pub pixels: Vec<[f32; 3]>,
}

/// What kind of device executes frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceKind {
    /// This crate family's own CPU executor.
    Software,
    /// A GPU through wgpu.
    Gpu,
    /// A CPU that pretends to be a GPU, such as Mesa's llvmpipe, through wgpu.
    CpuDevice,
}

/// Which device executes frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Device {
    /// What kind it is.
    pub kind: DeviceKind,
    /// Its name for people.
    pub name: String,
    /// Why a better one was found and does not draw.
    pub in_place_of: Option<String>,
}

/// A part of a picture that the device has drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FinishedPart {
    /// The part, as [`Backend::draw_part`] numbered it.
    pub number: u32,
    /// Seconds that it took, where the device has a clock.
    pub device_seconds: Option<f64>,
}

/// Bytes that a backend has handed to its device since it was made, by what they are. None where there is no device
/// but this one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UploadedBytes {
    /// Texels.
    pub bricks: u64,
    /// Where bricks are.
    pub places: u64,
    /// Which of them are of a part.
    pub choices: u64,
    /// Tables of transfer functions.
    pub transfers: u64,
    /// Cubes, sheets and surfaces.
    pub geometry: u64,
    /// How a part or a tile is seen: what depends on the camera and costs some bytes each time.
    pub views: u64,
}

/// A picture that is read back.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// The picture.
    pub image: Image,
    /// Seconds that the device itself measured for the whole picture, where it can.
    pub device_seconds: Option<f64>,
    /// Of rays: what their integration may be off by, in all parts together.
    pub ray_doubt: Option<RayDoubt>,
}

/// What the rays of a picture may be off by, but for the arithmetic; each number the largest of any ray.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RayDoubt {
    /// The sum over cells of what straight pieces in place of the field, and mean colours in place of running ones, may
    /// change in a channel.
    pub cells: f32,
    /// The way through cells that were read from the table of the transfer function, in unit lengths, each stretch as a
    /// share of the light that comes through: what rounding to bins can act on.
    pub table_way: f32,
    /// What matter may change in a channel where a field comes to rest so near to a step of the transfer function that
    /// rounding says on which side it is.
    pub touching: f32,
}

impl RayDoubt {
    /// The larger of each number.
    #[must_use]
    pub fn max(self, other: Self) -> Self {
        Self {
            cells: self.cells.max(other.cells),
            table_way: self.table_way.max(other.table_way),
            touching: self.touching.max(other.touching),
        }
    }
}

/// Why bricks could not be made resident. The backend holds what it held before.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UploadError {
    /// No volume was set.
    #[error("upload of brick {id:?}: no volume layout was set")]
    NoVolume {
        /// The first brick of the upload.
        id: BrickId,
    },
    /// A brick that does not fit the layout.
    #[error("brick {id:?}: {found}, expected {expected}")]
    Mismatch {
        /// The brick.
        id: BrickId,
        /// What it has.
        found: String,
        /// What the layout asks for.
        expected: String,
    },
    /// The device's memory or its limits do not allow more bricks.
    #[error("brick pool: {required} bytes are needed, the device allows {max}")]
    PoolFull {
        /// Bytes that would be resident.
        required: u64,
        /// Bytes that can be.
        max: u64,
    },
    /// The device failed.
    #[error("device: {0}")]
    Device(String),
}

/// Why a frame could not be drawn.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DrawError {
    /// A part of a picture, or its end, without its beginning.
    #[error("draw: no picture was begun")]
    NoPicture,
    /// No volume was set.
    #[error("draw: no volume layout was set")]
    NoVolume,
    /// A placed brick is not resident.
    #[error("draw: brick {id:?} is not resident")]
    NotResident {
        /// The brick.
        id: BrickId,
    },
    /// A placed brick's corner is not where its level allows.
    #[error(
        "draw: brick {id:?} of level {level} stands at cell {found:?}, expected multiples of its size inside the volume"
    )]
    Misplaced {
        /// The brick.
        id: BrickId,
        /// Its level.
        level: u32,
        /// Its first cell.
        found: [u32; 3],
    },
    /// The picture is empty or larger than the device draws.
    #[error("draw: picture of {width}x{height} pixels, expected 1x1 to {max}x{max}")]
    Size {
        /// Pixels from left to right.
        width: u32,
        /// Pixels from top to bottom.
        height: u32,
        /// Most pixels per axis.
        max: u32,
    },
    /// Windows of a size that is none, or none of this number.
    #[error("draw: {what} of windows is {found}, expected {expected}")]
    Window {
        /// Which number.
        what: &'static str,
        /// What it is.
        found: u32,
        /// What it may be.
        expected: String,
    },
    /// Rays through texels that have no extinction.
    #[error("draw: rays through texels that are colours, expected texels of type U8, U16 or F32")]
    RaysThroughColors,
    /// More planes than a frame may have.
    #[error("draw: {found} planes, expected at most {max}")]
    TooManyPlanes {
        /// How many there are.
        found: usize,
        /// How many there may be.
        max: usize,
    },
    /// A plane that is none.
    #[error("draw: plane {index}: {defects}")]
    Plane {
        /// Which plane.
        index: usize,
        /// Everything that is wrong with it.
        defects: String,
    },
    /// Sheets that do not fit together.
    #[error("draw: {what} of sheets is {found}, expected {expected}")]
    Sheets {
        /// Which number.
        what: &'static str,
        /// What it is.
        found: String,
        /// What it may be.
        expected: String,
    },
    /// The device failed.
    #[error("device: {0}")]
    Device(String),
}

/// Sides of windows are multiples of so many pixels.
pub const WINDOW_STEP: u32 = 32;

/// The longest side of a window, in pixels.
pub const MAX_WINDOW_SIDE: u32 = 1024;

/// How many windows a picture has, of a side; a check that every backend makes before it begins them.
///
/// # Errors
/// [`DrawError::Window`].
pub fn check_windows(view: &PictureView<'_>, side: u32) -> Result<u32, DrawError> {
    if !(WINDOW_STEP..=MAX_WINDOW_SIDE).contains(&side) || !side.is_multiple_of(WINDOW_STEP) {
        let expected = format!("a multiple of {WINDOW_STEP} up to {MAX_WINDOW_SIDE}");
        return Err(DrawError::Window { what: "the side", found: side, expected });
    }
    Ok(view.width.div_ceil(side) * view.height.div_ceil(side))
}

/// The most pixels per axis that may share a ray in a window.
pub const MAX_STRIDE: u32 = 8;

/// A window to draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Which: they count row by row.
    pub number: u32,
    /// Pixels per axis that share a ray.
    pub stride: u32,
}

/// A check that every backend makes before it draws in a window, of which a picture has so many.
///
/// # Errors
/// [`DrawError::Window`].
pub fn check_window(content: &Content<'_>, window: Window, num_windows: u32) -> Result<(), DrawError> {
    let Window { number, stride } = window;
    if number >= num_windows {
        let expected = match num_windows {
            0 => "a picture in windows".to_owned(),
            _ => format!("0 to {}", num_windows - 1),
        };
        return Err(DrawError::Window { what: "the number", found: number, expected });
    }
    let max = if matches!(content, Content::Rays(_)) { MAX_STRIDE } else { 1 };
    if stride.is_power_of_two() && stride <= max {
        return Ok(());
    }
    let expected = if max == 1 { "1 for what is no rays".to_owned() } else { "1, 2, 4 or 8".to_owned() };
    Err(DrawError::Window { what: "the stride", found: stride, expected })
}

/// Executes frames. Holds the bricks of one volume at a time.
pub trait Backend: Send {
    /// The device that executes.
    fn device(&self) -> Device;

    /// Makes `layout` the volume that bricks belong to, and forgets all bricks.
    ///
    /// # Errors
    /// When the device cannot hold bricks of this layout at all.
    fn set_volume(&mut self, layout: &VolumeLayout) -> Result<(), UploadError>;

    /// The revision of the volume whose bricks it holds; `None` before [`Backend::set_volume`].
    fn volume(&self) -> Option<Revision>;

    /// Whether a brick is resident.
    fn is_resident(&self, id: BrickId) -> bool;

    /// Makes bricks resident, beside those that are; a brick of the same name is replaced.
    ///
    /// # Errors
    /// When a brick does not fit the layout or the device. No brick of this call is resident then.
    fn upload(&mut self, bricks: &[Brick<'_>]) -> Result<(), UploadError>;

    /// Forgets bricks; those that are not resident are passed over. What they took of the device's memory is used by
    /// later uploads.
    fn evict(&mut self, bricks: &[BrickId]);

    /// Bytes of device memory that the bricks take, with all that the backend keeps per brick.
    fn resident_bytes(&self) -> u64;

    /// The most bytes of device memory that a brick of so many samples along x, y, z takes while it is resident in a
    /// volume of this layout, with all that the backend keeps of it. [`Backend::resident_bytes`] after
    /// [`Backend::reserve`] is never above the sum, and what [`Backend::room`] takes off.
    fn brick_bytes(&self, layout: &VolumeLayout, samples: [u32; 3]) -> u64;

    /// The part of `max_bytes` of device memory that bricks of this layout may take, by [`Backend::brick_bytes`], so that
    /// all that is kept for them together, and texels on their way, fit as well.
    fn room(&self, layout: &VolumeLayout, max_bytes: u64) -> u64;

    /// Makes room for so many bricks in all, those that are resident included, without ever taking more than `max_bytes`:
    /// where that is not possible beside what is held, all bricks are forgotten. Until other numbers are asked
    /// for, uploads up to so many bricks that have room take no more either, copies on their way included.
    ///
    /// # Errors
    /// [`UploadError::PoolFull`] when the device cannot hold so many; [`UploadError::Device`] when it fails.
    fn reserve(&mut self, num_bricks: usize, max_bytes: u64) -> Result<(), UploadError>;

    /// What was handed to the device so far.
    fn uploaded_bytes(&self) -> UploadedBytes;

    /// Begins a picture. One that is under way is dropped.
    ///
    /// # Errors
    /// When the picture's size is none or the device fails. Then no picture is under way.
    fn begin(&mut self, view: &PictureView<'_>) -> Result<(), DrawError>;

    /// Begins a picture that is drawn window by window: squares of so many pixels a side, a multiple of
    /// [`WINDOW_STEP`] up to [`MAX_WINDOW_SIDE`], cut short where the picture ends; they count from 0, row by row. One that is under way is dropped.
    ///
    /// # Errors
    /// As [`Backend::begin`], and [`DrawError::Window`] when `side` is no such number.
    fn begin_windows(&mut self, view: &PictureView<'_>, side: u32) -> Result<(), DrawError>;

    /// Shows content alone in some windows, each once, in place of what was there; each is a part, and returned is the
    /// number of the first. A window can so be drawn better when there is time left. Need not wait until the device has
    /// drawn them.
    ///
    /// With a stride of 2, 4 or 8 ([`MAX_STRIDE`]) squares of so many pixels a side share the ray of their pixel
    /// `(stride / 2, stride / 2)`: of rays alone. Surfaces are behind in every pixel.
    ///
    /// # Errors
    /// As [`Backend::draw_part`], and [`DrawError::Window`] when there is no such window or stride.
    fn draw_windows(&mut self, content: &Content<'_>, windows: &[Window]) -> Result<u32, DrawError>;

    /// Adds what comes next to the picture, behind all that it shows, and returns the number of the part: parts count
    /// from 0. Need not wait until the device has drawn it.
    ///
    /// # Errors
    /// When no picture was begun, a brick is missing or misplaced, or the device fails. The picture is then as it was,
    /// unless the device failed, which ends it.
    fn draw_part(&mut self, content: &Content<'_>) -> Result<u32, DrawError>;

    /// The parts of the last picture that was begun of which is known, without waiting, that they are drawn. Each is
    /// told once, in any order; after [`Backend::finish`] all are.
    fn finished(&mut self) -> Vec<FinishedPart>;

    /// Waits until one of the parts that were not told is drawn, if there are any. That it is drawn at once is enough for a
    /// backend that hands nothing out.
    ///
    /// # Errors
    /// When the device fails.
    fn wait(&mut self) -> Result<(), DrawError>;

    /// Ends the picture: puts surfaces and background behind it and reads it back.
    ///
    /// # Errors
    /// When no picture was begun or the device fails. No picture is under way afterwards.
    fn finish(&mut self) -> Result<Drawn, DrawError>;

    /// Draws a picture of one part and reads it back.
    ///
    /// # Errors
    /// As [`Backend::begin`], [`Backend::draw_part`] and [`Backend::finish`].
    fn draw(&mut self, frame: &Frame<'_>) -> Result<Drawn, DrawError> {
        self.begin(&frame.view)?;
        self.draw_part(&frame.content)?;
        self.finish()
    }
}

/// Checks that every backend makes before it begins a picture.
///
/// # Errors
/// [`DrawError::Size`].
pub fn check_view(view: &PictureView<'_>, max_size: u32) -> Result<(), DrawError> {
    let (width, height) = (view.width, view.height);
    if !(1..=max_size).contains(&width) || !(1..=max_size).contains(&height) {
        return Err(DrawError::Size { width, height, max: max_size });
    }
    Ok(())
}

/// Checks that every backend makes before it draws a part: placement of bricks, planes, sheets, and whether there is a
/// volume with the texels that the content needs.
///
/// # Errors
/// [`DrawError::NoVolume`], [`DrawError::Misplaced`], [`DrawError::RaysThroughColors`], [`DrawError::TooManyPlanes`],
/// [`DrawError::Plane`] or [`DrawError::Sheets`].
pub fn check_content(content: &Content<'_>, layout: Option<&VolumeLayout>) -> Result<(), DrawError> {
    if let Content::Sheets(content) = content {
        return sheets::check(content);
    }
    let layout = layout.ok_or(DrawError::NoVolume)?;
    match content {
        Content::Rays(_) if layout.texel == TexelType::Rgba8 => return Err(DrawError::RaysThroughColors),
        Content::Rays(_) | Content::Cubes(_) | Content::Sheets(_) => {}
        Content::Planes(content) => planes::check(content.planes)?,
    }
    for brick in content.bricks() {
        let size = layout
            .brick_cells
            .checked_shl(brick.level)
            .filter(|&size| size >> brick.level == layout.brick_cells);
        let placed = size.is_some_and(|size| {
            (0..3).all(|axis| {
                let first = brick.first_cell[axis];
                first % size == 0 && first < layout.cells[axis].max(1) && first.checked_add(size).is_some()
            })
        });
        if !placed {
            return Err(DrawError::Misplaced { id: brick.id, level: brick.level, found: brick.first_cell });
        }
    }
    Ok(())
}
