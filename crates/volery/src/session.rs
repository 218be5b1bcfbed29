//! A volume, a backend and what is resident there, kept from picture to picture.
//!
//! Opening a session builds the pyramid once. After that a new camera, transfer function or tolerance costs
//! what it changes: bricks that are resident stay, and the transfer function is integrated again only when it
//! is another one.

use std::time::Instant;

use volery_frame::{
    Backend, DeviceKind, DrawError, Frame, Image, IntegratedTransfer, UploadError, VolumeLayout,
};
use volery_pyramid::{Kind, NodeSource, Pyramid};
use volery_scene::{Camera, SampleType, TransferFunction, VoxelGrid, camera};

use crate::fit;
use crate::histogram::Histogram;
use crate::report::{self, Report};
use crate::technique::raycast::{self, BRICK_CELLS, Plan, Uploaded};
use crate::texels::Encoding;
use crate::transfer::Preset;

/// What to see of a volume, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Pixels from left to right.
    pub width: u32,
    /// Pixels from top to bottom.
    pub height: u32,
    /// Where the picture is taken from.
    pub camera: Camera,
    /// Values to colour and extinction.
    pub transfer: TransferFunction,
    /// Linear RGB behind the volume.
    pub background: [f64; 3],
    /// Largest difference of a value from the full resolution, as a fraction of the volume's value range;
    /// `None` is the full resolution.
    pub tolerance: Option<f64>,
}

/// Linear RGB behind the volume where nobody says otherwise: nearly black, a little blue.
pub const BACKGROUND: [f64; 3] = [0.03, 0.035, 0.05];

/// What a user may say about a view; [`Session::view`] fills in the rest.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewOptions {
    /// Pixels from left to right.
    pub width: u32,
    /// Pixels from top to bottom.
    pub height: u32,
    /// From where to look.
    pub direction: fit::Direction,
    /// Whether rays are parallel.
    pub orthographic: bool,
    /// Values to colour and extinction; [`Preset::Auto`] if missing.
    pub transfer: Option<TransferFunction>,
}

impl Default for ViewOptions {
    fn default() -> Self {
        let direction = fit::Direction::default();
        Self { width: 768, height: 768, direction, orthographic: false, transfer: None }
    }
}

/// A picture and its report.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Linear RGB.
    pub image: Image,
    /// How it was made.
    pub report: Report,
}

/// Why a volume cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// Samples that are colours.
    #[error("raycast: samples are {found}, expected one channel of numbers")]
    Colors {
        /// Type of the samples.
        found: SampleType,
    },
    /// An axis along which there is nothing to integrate.
    #[error("raycast: {} x {} x {} samples, expected at least 2 along each axis", .dims[0], .dims[1], .dims[2])]
    Flat {
        /// Samples along x, y, z.
        dims: [usize; 3],
    },
    /// Every sample is NaN or infinite.
    #[error("raycast: every sample is blank, expected some finite values")]
    Blank,
    /// Values so far apart that their difference is no number.
    #[error("raycast: values from {:e} to {:e}, expected a range below 1.8e308", .range[0], .range[1])]
    TooWide {
        /// Smallest and largest value.
        range: [f64; 2],
    },
    /// The pyramid cannot be built.
    #[error("pyramid: {0}")]
    Layout(#[from] volery_pyramid::layout::Error),
    /// The backend cannot hold bricks of this volume.
    #[error(transparent)]
    Backend(#[from] UploadError),
}

/// Why a picture could not be made.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The camera cannot take a picture.
    #[error(transparent)]
    Camera(#[from] camera::Defect),
    /// A tolerance that is no fraction of the range.
    #[error("tolerance is {found}, expected a number of at least 0")]
    Tolerance {
        /// As given.
        found: f64,
    },
    /// A background that is no colour.
    #[error("background is {found:?}, expected three numbers in [0, 1]")]
    Background {
        /// As given.
        found: [f64; 3],
    },
    /// A picture without pixels.
    #[error("picture of {width}x{height} pixels, expected at least 1x1")]
    Empty {
        /// Pixels from left to right.
        width: u32,
        /// Pixels from top to bottom.
        height: u32,
    },
    /// No frame was asked for.
    #[error("0 frames, expected at least 1")]
    NoFrame,
    /// Bricks could not be made resident.
    #[error(transparent)]
    Bricks(#[from] raycast::Error),
    /// The backend could not draw.
    #[error(transparent)]
    Draw(#[from] DrawError),
}

/// Why a picture could not be compared with the truth.
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// The truth could not be computed.
    #[error("reference: {0}")]
    Reference(#[from] volery_reference::Error),
    /// The picture has not as many pixels as it says.
    #[error(transparent)]
    Pixels(#[from] volery_reference::SizeMismatch),
    /// The picture is of another size than the view.
    #[error(transparent)]
    Size(#[from] volery_reference::metrics::Error),
}

/// Draws one volume again and again.
pub struct Session {
    grid: VoxelGrid,
    source: Pyramid,
    backend: Box<dyn Backend>,
    volume: VolumeLayout,
    encoding: Encoding,
    transfer: Option<(TransferFunction, IntegratedTransfer)>,
    build_seconds: f64,
}

/// What one frame took.
struct Times {
    select: f64,
    upload: f64,
    draw: f64,
}

impl Times {
    fn frame(&self) -> f64 {
        self.select + self.upload + self.draw
    }
}

impl Session {
    /// Builds the pyramid of a volume and hands its shape to the backend.
    ///
    /// # Errors
    /// When the volume has nothing to be drawn, or the backend cannot hold it.
    pub fn open(grid: VoxelGrid, mut backend: Box<dyn Backend>) -> Result<Self, OpenError> {
        let start = Instant::now();
        let (sample_type, dims) = (grid.sample_type(), grid.dims());
        if sample_type.channels() != 1 {
            return Err(OpenError::Colors { found: sample_type });
        }
        if dims.contains(&1) {
            return Err(OpenError::Flat { dims });
        }
        let source = Pyramid::build(&grid, Kind::Decimated, BRICK_CELLS)?;
        let stats = &source.stats(source.layout().root())[0];
        if stats.is_blank() {
            return Err(OpenError::Blank);
        }
        let range = [stats.min, stats.max];
        if !(range[1] - range[0]).is_finite() {
            return Err(OpenError::TooWide { range });
        }
        let encoding = Encoding::new(sample_type, range).ok_or(OpenError::Colors { found: sample_type })?;
        let volume = VolumeLayout {
            // A layout's axes are below 2^31 samples.
            cells: dims.map(|n| (n - 1) as u32),
            spacing: grid.spacing(),
            brick_cells: BRICK_CELLS as u32,
            texel: encoding.texel,
            value_scale: encoding.scale,
            value_offset: encoding.offset,
            value_range: range,
        };
        backend.set_volume(&volume)?;
        let build_seconds = start.elapsed().as_secs_f64();
        Ok(Self { grid, source, backend, volume, encoding, transfer: None, build_seconds })
    }

    /// The volume.
    pub fn grid(&self) -> &VoxelGrid {
        &self.grid
    }

    /// Smallest and largest finite value of the volume.
    pub fn value_range(&self) -> [f64; 2] {
        self.volume.value_range
    }

    /// A view of everything that is visible, in full resolution: the camera as near as it can be, the
    /// transfer function from the histogram unless `options` have one.
    pub fn view(&self, options: &ViewOptions) -> View {
        let ViewOptions { width, height, direction, orthographic, transfer } = options.clone();
        let transfer = transfer.unwrap_or_else(|| self.preset(Preset::Auto));
        let blocks = fit::visible_blocks(&self.source, &transfer);
        let aspect = f64::from(width.max(1)) / f64::from(height.max(1));
        let camera = fit::camera(&blocks, direction, orthographic, aspect);
        View { width, height, camera, transfer, background: BACKGROUND, tolerance: None }
    }

    /// The transfer function of a preset for this volume.
    ///
    /// # Panics
    /// Never: a session's volume has a histogram.
    pub fn preset(&self, preset: Preset) -> TransferFunction {
        let histogram = Histogram::of(&self.grid, 0).expect("opening found finite values and their range");
        preset.transfer(&histogram, self.grid.extent())
    }

    /// Draws one picture.
    ///
    /// # Errors
    /// When the view is not meaningful, a brick cannot be read, or the backend fails.
    pub fn render(&mut self, view: &View) -> Result<Picture, RenderError> {
        self.render_frames(view, 1)
    }

    /// Draws the same picture `num_frames` times and reports the time of each; the first pays for what is
    /// not resident.
    ///
    /// # Errors
    /// As [`Session::render`], and when `num_frames` is 0.
    pub fn render_frames(&mut self, view: &View, num_frames: usize) -> Result<Picture, RenderError> {
        check(view)?;
        let mut times = Vec::with_capacity(num_frames);
        let mut uploaded = Uploaded::default();
        let mut last = None;
        for _ in 0..num_frames {
            let (image, plan, moved, took) = self.draw_frame(view)?;
            uploaded.bricks += moved.bricks;
            uploaded.bytes += moved.bytes;
            times.push(took);
            last = Some((image, plan));
        }
        let (image, plan) = last.ok_or(RenderError::NoFrame)?;
        let report = self.report(view, &plan, uploaded, &times);
        Ok(Picture { image, report })
    }

    fn draw_frame(&mut self, view: &View) -> Result<(Image, Plan, Uploaded, Times), RenderError> {
        let start = Instant::now();
        if self.transfer.as_ref().is_none_or(|(transfer, _)| *transfer != view.transfer) {
            let range = self.volume.value_range;
            let table = IntegratedTransfer::new(&view.transfer, range, self.volume.spacing.min_element());
            self.transfer = Some((view.transfer.clone(), table));
        }
        let [low, high] = self.volume.value_range;
        let tolerance = view.tolerance.unwrap_or(0.0) * (high - low);
        let size = [view.width, view.height];
        let plan = raycast::plan(&self.source, &view.camera, size, &view.transfer, tolerance);
        let selected = Instant::now();
        let uploaded =
            raycast::upload(&self.source, &self.encoding, &self.volume, &plan, self.backend.as_mut())?;
        let resident = Instant::now();
        let (_, transfer) = self.transfer.as_ref().expect("set above");
        let frame = Frame {
            width: view.width,
            height: view.height,
            camera: view.camera,
            transfer,
            background: view.background.map(|c| c as f32),
            bricks: &plan.bricks,
        };
        let image = self.backend.draw(&frame)?.image;
        let times = Times {
            select: (selected - start).as_secs_f64(),
            upload: (resident - selected).as_secs_f64(),
            draw: resident.elapsed().as_secs_f64(),
        };
        Ok((image, plan, uploaded, times))
    }

    fn report(&self, view: &View, plan: &Plan, uploaded: Uploaded, times: &[Times]) -> Report {
        let device = self.backend.device();
        let mut sorted: Vec<&Times> = times.iter().collect();
        sorted.sort_by(|a, b| a.frame().total_cmp(&b.frame()));
        let median = sorted[(sorted.len() - 1) / 2];
        Report {
            input: report::Input {
                path: None,
                kind: "volume",
                dims: self.grid.dims(),
                scalar: self.grid.sample_type().name(),
            },
            technique: "raycast",
            backend: report::Backend {
                kind: match device.kind {
                    DeviceKind::Software => "software",
                    DeviceKind::Gpu | DeviceKind::CpuDevice => "wgpu",
                },
                device: device.name,
            },
            image: report::ImageSize { width: view.width, height: view.height },
            seconds: report::Seconds {
                load: None,
                build: self.build_seconds,
                select: median.select,
                upload: median.upload,
                draw: median.draw,
                frame: median.frame(),
            },
            frames: times.iter().map(|times| report::Frame { seconds: times.frame() }).collect(),
            work: report::Work {
                nodes: plan.nodes.len(),
                nodes_by_level: plan.cut.nodes_by_level(),
                bricks: uploaded.bricks,
                bytes_resident: self.backend.resident_bytes(),
                bytes_uploaded: uploaded.bytes,
            },
            dial: view.tolerance.map(|tolerance| report::Dial { tolerance }),
            error: None,
        }
    }

    /// Compares a picture of this volume with the truth: the exact picture in `f64` of the full-resolution
    /// samples. Writes the error into the picture's report and returns the truth. `progress` hears a number
    /// in [0, 1] now and then.
    ///
    /// # Errors
    /// When the truth cannot be computed, or the picture is of another size than the view.
    pub fn verify(
        &self,
        view: &View,
        picture: &mut Picture,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<volery_reference::Image, VerifyError> {
        let tracer = volery_reference::Tracer::new(&self.grid, &view.transfer)?;
        let truth = tracer.render(&view.camera, view.background, view.width, view.height, progress)?;
        let image = &picture.image;
        let drawn = volery_reference::Image::from_f32(image.width, image.height, &image.pixels)?;
        let found = volery_reference::metrics::compare(&drawn, &truth)?;
        picture.report.error = Some(report::Error {
            measured_max: found.max,
            measured_rmse: found.rmse,
            measured_psnr_db: found.psnr_db.is_finite().then_some(found.psnr_db),
            against: "reference f64",
        });
        Ok(truth)
    }
}

fn check(view: &View) -> Result<(), RenderError> {
    if let Some(defect) = view.camera.defects().into_iter().next() {
        return Err(defect.into());
    }
    if let Some(found) = view.tolerance.filter(|tolerance| !(0.0..).contains(tolerance)) {
        return Err(RenderError::Tolerance { found });
    }
    let found = view.background;
    if !found.iter().all(|c| (0.0..=1.0).contains(c)) {
        return Err(RenderError::Background { found });
    }
    let (width, height) = (view.width, view.height);
    if width == 0 || height == 0 {
        return Err(RenderError::Empty { width, height });
    }
    Ok(())
}
