//! A volume, a backend and what is resident there, kept from picture to picture.
//!
//! Opening a session builds the pyramid once. After that a new camera, transfer function, plane or dial costs
//! what it changes: bricks that are resident stay, and the transfer function is integrated again only when it
//! is another one.

mod error;
mod progressive;
mod refine;
mod reporting;
mod times;
mod verify;
mod view;

use std::sync::OnceLock;
use std::time::Instant;

use glam::DVec3;
use volery_frame::{
    Backend, Content, Cubes, Drawn, Frame, Image, PictureView, Planes, PointTransfer, RayTransfer, Rays,
    Thickness, VolumeLayout,
};
use volery_pyramid::{CubeTree, Kind, Node, NodeSource, Pyramid};
use volery_reference::{PlaneScene, Tracer};
use volery_scene::{TransferFunction, VoxelGrid};

use crate::fit;
use crate::histogram::Histogram;
use crate::report::Report;
use crate::technique::parts::Parts;
use crate::technique::residency::{self, Uploaded};
use crate::technique::{Technique, fans, plane, raycast};
use crate::texels::Encoding;
use crate::transfer::{self, Preset};

pub use error::{OpenError, RenderError, VerifyError};
pub use progressive::{Progressive, Step};
pub use refine::Refinements;
pub(crate) use times::Times;
pub use view::{BACKGROUND, Focus, PlaneView, View, ViewOptions};

/// A picture and its report.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Linear RGB.
    pub image: Image,
    /// How it was made.
    pub report: Report,
}

/// Draws one volume again and again, by one technique.
pub struct Session {
    technique: Technique,
    grid: VoxelGrid,
    source: Pyramid,
    /// Of the technique fans.
    cubes: Option<CubeTree>,
    backend: Box<dyn Backend>,
    volume: VolumeLayout,
    encoding: Encoding,
    transfer: Option<(TransferFunction, RayTransfer)>,
    /// Of the technique plane, once an error was asked for.
    parts: OnceLock<Parts>,
    build_seconds: f64,
}

/// What one frame draws.
enum Plan {
    Rays(raycast::Plan),
    Planes(plane::Plan),
    Cubes(fans::Plan),
}

impl Plan {
    /// How many nodes are drawn, or cubes, of each level.
    fn nodes_by_level(&self) -> Vec<usize> {
        match self {
            Self::Rays(plan) => plan.cut.nodes_by_level(),
            Self::Planes(plan) => plan.cut.nodes_by_level(),
            Self::Cubes(plan) => plan.cubes_by_level.clone(),
        }
    }

    /// Whose bricks it needs.
    fn nodes(&self) -> &[Node] {
        match self {
            Self::Rays(plan) => &plan.nodes,
            Self::Planes(plan) => &plan.cut.nodes,
            Self::Cubes(_) => &[],
        }
    }
}

impl Session {
    /// Builds the pyramid of a volume and hands its shape to the backend.
    ///
    /// # Errors
    /// When the volume has nothing to be drawn by this technique, or the backend cannot hold it.
    pub fn open(
        grid: VoxelGrid,
        mut backend: Box<dyn Backend>,
        technique: Technique,
    ) -> Result<Self, OpenError> {
        let start = Instant::now();
        let (sample_type, dims) = (grid.sample_type(), grid.dims());
        let brick_cells = match technique {
            Technique::Plane => plane::BRICK_CELLS,
            _ if sample_type.channels() != 1 => {
                return Err(OpenError::Colors { technique: technique.name(), found: sample_type });
            }
            _ if dims.contains(&1) => return Err(OpenError::Flat { technique: technique.name(), dims }),
            Technique::Fans if dims.iter().any(|&n| n > fans::MAX_DIM) => {
                return Err(OpenError::TooLong { dims, max: fans::MAX_DIM });
            }
            Technique::Raycast | Technique::Fans => raycast::BRICK_CELLS,
        };
        let source = Pyramid::build(&grid, Kind::Decimated, brick_cells)?;
        let channels = source.stats(source.layout().root());
        if channels[0].is_blank() {
            return Err(OpenError::Blank);
        }
        let range = if channels.len() == 1 { [channels[0].min, channels[0].max] } else { [0.0, 255.0] };
        if !(range[1] - range[0]).is_finite() {
            return Err(OpenError::TooWide { range });
        }
        let encoding = Encoding::new(sample_type, range);
        let cubes =
            (technique == Technique::Fans).then(|| CubeTree::build(&grid, encoding.scale, encoding.offset));
        let volume = VolumeLayout {
            // A layout's axes are below 2^31 samples.
            cells: dims.map(|n| (n - 1) as u32),
            spacing: grid.spacing(),
            brick_cells: brick_cells as u32,
            texel: encoding.texel,
            value_scale: encoding.scale,
            value_offset: encoding.offset,
            value_range: range,
        };
        backend.set_volume(&volume)?;
        let build_seconds = start.elapsed().as_secs_f64();
        Ok(Self {
            technique,
            grid,
            source,
            cubes,
            backend,
            volume,
            encoding,
            transfer: None,
            parts: OnceLock::new(),
            build_seconds,
        })
    }

    /// The volume.
    pub fn grid(&self) -> &VoxelGrid {
        &self.grid
    }

    /// How it is drawn.
    pub fn technique(&self) -> Technique {
        self.technique
    }

    /// Smallest and largest finite value of the volume; of colours, 0 and 255.
    pub fn value_range(&self) -> [f64; 2] {
        self.volume.value_range
    }

    /// World position of the last sample; the first is at the origin.
    pub fn extent(&self) -> DVec3 {
        self.grid.extent()
    }

    /// A view of everything that is visible, in full resolution: the camera as near as it can be, planes and
    /// transfer function as [`ViewOptions`] says where it has none.
    pub fn view(&self, options: &ViewOptions) -> View {
        let ViewOptions { width, height, direction, orthographic, transfer, range, mut planes, stack } =
            options.clone();
        let aspect = f64::from(width.max(1)) / f64::from(height.max(1));
        let (camera, transfer) = match self.technique {
            Technique::Raycast | Technique::Fans => {
                let transfer = transfer.unwrap_or_else(|| self.preset_over(Preset::Auto, range));
                let blocks = fit::visible_blocks(&self.source, &transfer);
                (fit::camera(&blocks, direction.unwrap_or_default(), orthographic, aspect), transfer)
            }
            Technique::Plane => {
                if planes.planes.is_empty() {
                    planes.planes = plane::middle_planes(&self.grid);
                }
                let shown = || {
                    let is_color = self.grid.sample_type().channels() > 1;
                    let matter = (!is_color).then(|| Histogram::of_matter(self.grid.samples(), 0)).flatten();
                    range.unwrap_or(matter.map_or(self.value_range(), |histogram| histogram.range))
                };
                let transfer = transfer.unwrap_or_else(|| transfer::gray(shown(), self.grid.extent()));
                let camera =
                    plane::camera(self.source.layout(), &planes.planes, direction, orthographic, aspect);
                (camera, transfer)
            }
        };
        View {
            width,
            height,
            camera,
            transfer,
            background: BACKGROUND,
            tolerance: None,
            planes,
            thickness: Thickness::default(),
            stack,
            meshes: [].into(),
        }
    }

    /// The transfer function of a preset for this volume; of colours, for their first channel.
    pub fn preset(&self, preset: Preset) -> TransferFunction {
        self.preset_over(preset, None)
    }

    /// The same over a range of values, in place of those that are worth colours.
    ///
    /// # Panics
    /// Never: opening found finite values and their range.
    pub fn preset_over(&self, preset: Preset, range: Option<[f64; 2]>) -> TransferFunction {
        let transfer = preset.over(self.grid.samples(), range, self.grid.extent());
        transfer.expect("opening found finite values and their range")
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
        self.check(view)?;
        let mut times = Vec::with_capacity(num_frames);
        let mut uploaded = Uploaded::default();
        let mut last = None;
        for _ in 0..num_frames {
            let start = Instant::now();
            self.suit(&view.transfer)?;
            let plan = self.plan(view);
            let select = start.elapsed().as_secs_f64();
            let start = Instant::now();
            uploaded += self.upload(plan.nodes())?;
            let upload = start.elapsed().as_secs_f64();
            let start = Instant::now();
            let drawn = self.draw(view, &plan)?;
            let draw = start.elapsed().as_secs_f64();
            times.push(Times { select, geometry: None, upload: Some(upload), draw });
            last = Some((drawn, plan));
        }
        let (drawn, plan) = last.ok_or(RenderError::NoFrame)?;
        let report = self.report(view, (&plan, drawn.ray_doubt), uploaded, &times);
        Ok(Picture { image: drawn.image, report })
    }

    fn check(&self, view: &View) -> Result<(), RenderError> {
        view.check()?;
        if self.technique == Technique::Plane { view.planes.check() } else { Ok(()) }
    }

    /// Has samples encoded as a transfer function asks. Where that changes, no brick stays resident.
    fn suit(&mut self, transfer: &TransferFunction) -> Result<(), RenderError> {
        // Cubes are no texels of a backend's.
        if self.technique == Technique::Fans {
            return Ok(());
        }
        let encoding = self.encoding.suiting(transfer, self.volume.value_range);
        if encoding != self.encoding {
            self.encoding = encoding;
            self.volume =
                VolumeLayout { value_scale: encoding.scale, value_offset: encoding.offset, ..self.volume };
            self.transfer = None;
            self.backend.set_volume(&self.volume).map_err(residency::Error::from)?;
        }
        Ok(())
    }

    /// Chooses what to draw; integrates the transfer function where that is needed and it is another one.
    fn plan(&mut self, view: &View) -> Plan {
        let [low, high] = self.volume.value_range;
        let tolerance = view.tolerance.map(|tolerance| tolerance * (high - low));
        let size = [view.width, view.height];
        match self.technique {
            Technique::Raycast => {
                if self.transfer.as_ref().is_none_or(|(transfer, _)| *transfer != view.transfer) {
                    let table = RayTransfer::new(&view.transfer, &self.volume);
                    self.transfer = Some((view.transfer.clone(), table));
                }
                let tolerance = tolerance.unwrap_or(0.0);
                Plan::Rays(raycast::plan(&self.source, &view.camera, size, &view.transfer, tolerance))
            }
            Technique::Plane => Plan::Planes(plane::plan(&self.source, self.parts(view), view, tolerance)),
            Technique::Fans => {
                let tree = self.cubes.as_ref().expect("opening built it");
                let value = [self.encoding.scale, self.encoding.offset];
                let volume = (&self.grid, tree, self.source.layout());
                Plan::Cubes(fans::plan(volume, value, view, tolerance.unwrap_or(0.0)))
            }
        }
    }

    /// What makes bounds tight, where an error is asked for.
    fn parts(&self, view: &View) -> Option<&Parts> {
        view.planes.max_error.map(|_| self.parts.get_or_init(|| Parts::new(&self.grid)))
    }

    fn upload(&mut self, nodes: &[Node]) -> Result<Uploaded, RenderError> {
        let backend = self.backend.as_mut();
        Ok(residency::upload(&self.source, &self.encoding, &self.volume, nodes, backend)?)
    }

    fn draw(&mut self, view: &View, plan: &Plan) -> Result<Drawn, RenderError> {
        let point_transfer;
        let content = match plan {
            Plan::Rays(plan) => {
                let (_, transfer) = self.transfer.as_ref().expect("planning integrated it");
                Content::Rays(Rays { transfer, bricks: &plan.bricks })
            }
            Plan::Planes(plan) => {
                point_transfer = PointTransfer::new(&view.transfer, &self.volume);
                Content::Planes(Planes {
                    planes: &view.planes.planes,
                    bricks: &plan.bricks,
                    transfer: &point_transfer,
                    sampling: view.planes.sampling,
                    is_transparent: view.planes.is_transparent,
                    shows_bricks: view.planes.shows_nodes,
                })
            }
            Plan::Cubes(plan) => {
                Content::Cubes(Cubes { revision: None, cubes: &plan.cubes, thickness: view.thickness })
            }
        };
        let picture = PictureView {
            width: view.width,
            height: view.height,
            camera: view.camera,
            background: view.background.map(|c| c as f32),
            meshes: &view.meshes,
        };
        Ok(self.backend.draw(&Frame { view: picture, content })?)
    }

    /// Compares a picture of this volume with the truth: the exact picture in `f64` of the full-resolution
    /// samples. Writes the error into the picture's report and returns the truth. `progress` hears a number
    /// in [0, 1] now and then. Outlines of nodes are no part of the truth.
    ///
    /// # Errors
    /// When the truth cannot be computed, or the picture is of another size than the view.
    pub fn verify(
        &self,
        view: &View,
        picture: &mut Picture,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<volery_reference::Image, VerifyError> {
        let View { width, height, .. } = *view;
        let truth = match self.technique {
            Technique::Raycast | Technique::Fans => Tracer::new(&self.grid, &view.transfer)?
                .among(&view.meshes)
                .render(&view.camera, view.background, width, height, progress)?,
            Technique::Plane => {
                let scene = PlaneScene {
                    grid: &self.grid,
                    planes: &view.planes.planes,
                    transfer: &view.transfer,
                    nearest: view.planes.sampling == volery_frame::Sampling::Nearest,
                    is_transparent: view.planes.is_transparent,
                    meshes: &view.meshes,
                };
                scene.render(&view.camera, view.background, [width, height], progress)?
            }
        };
        picture.measure(&truth)?;
        Ok(truth)
    }
}
