//! Data, and what techniques keep of them from picture to picture.
//!
//! A session belongs to no backend and no technique: a view says how it is drawn, the caller by whom. A pyramid is built
//! once. After that a new camera, transfer function, technique or dial costs what it changes: bricks that a backend
//! holds stay, tables are made again only of another transfer function.

mod deadline;
mod error;
mod refine;
mod space;
mod times;

use std::borrow::Cow;
use std::time::Instant;

use glam::DVec3;
use volery_frame::{Backend, Drawn, Frame, Image, PictureView};
use volery_reference::metrics;
use volery_scene::TransferFunction;

use crate::data::Data;
use crate::matter_bound::MatterBound;
use crate::ray_budget::RayBudget;
use crate::report::{self, Report};
use crate::residency::{self, Uploaded};
use crate::technique::{Drawing, Plan, Technique, Work};
use crate::transfer::Preset;
use crate::view::{Dial, How, View, ViewOptions};
use space::Space;

pub use error::{RenderError, VerifyError};
pub use refine::Refinements;
pub(crate) use times::Times;

/// A picture and its report.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Linear RGB.
    pub image: Image,
    /// How it was made.
    pub report: Report,
}

/// Draws data again and again, by any technique and any backend.
pub struct Session<D> {
    data: D,
    /// Each with the seconds that it took to make ready.
    techniques: Vec<(Box<dyn Technique<D>>, Option<f64>)>,
    /// What was learned by pictures with deadlines.
    pace: Option<deadline::Pace>,
    space: Space,
}

impl<D: Data> Session<D> {
    /// Of data that are ready.
    pub fn new(data: D) -> Self {
        let techniques = D::techniques().into_iter().map(|technique| (technique, None)).collect();
        Self { data, techniques, pace: None, space: Space::default() }
    }

    /// What is drawn.
    pub fn data(&self) -> &D {
        &self.data
    }

    /// What is drawn, to be changed as it allows: the next picture follows.
    pub fn data_mut(&mut self) -> &mut D {
        &mut self.data
    }

    /// Smallest and largest finite value; of colours, 0 and 255.
    pub fn value_range(&self) -> [f64; 2] {
        self.data.value_range()
    }

    /// Size of the box around the data.
    pub fn extent(&self) -> DVec3 {
        self.data.extent()
    }

    /// The transfer function of a preset for these data.
    pub fn preset(&self, preset: Preset) -> TransferFunction {
        self.data.preset_over(preset, None)
    }

    /// A view of everything that is visible, in full resolution: the camera as near as it can be, planes and
    /// transfer function as [`ViewOptions`] says where it has none.
    pub fn view(&self, options: &ViewOptions) -> View {
        let how = options.how.clone().unwrap_or_else(|| self.data.suiting());
        let suiting = |technique: &&(Box<dyn Technique<D>>, _)| technique.0.draws(&how);
        // A technique that draws other data is refused when it shall draw.
        let (technique, _) = self.techniques.iter().find(suiting).unwrap_or(&self.techniques[0]);
        technique.view(&self.data, options, how)
    }

    /// Draws one picture.
    ///
    /// # Errors
    /// When the view is not meaningful or not of these data, a brick cannot be read, or the backend fails.
    pub fn render(&mut self, view: &View, backend: &mut dyn Backend) -> Result<Picture, RenderError> {
        self.render_frames(view, 1, backend)
    }

    /// Draws the same picture `num_frames` times and reports the time of each; the first pays for what is
    /// not resident. Several are drawn as if a camera moved from one to the next: what was made for a view alone is
    /// made anew.
    ///
    /// # Errors
    /// As [`Session::render`], and when `num_frames` is 0.
    pub fn render_frames(
        &mut self,
        view: &View,
        num_frames: usize,
        backend: &mut dyn Backend,
    ) -> Result<Picture, RenderError> {
        let place = self.check(view)?;
        let local = &*self.local(view);
        if self.techniques[place].1.is_none() {
            let start = Instant::now();
            self.techniques[place].0.prepare(&self.data);
            self.techniques[place].1 = Some(start.elapsed().as_secs_f64());
        }
        let mut times = Vec::with_capacity(num_frames);
        let mut uploaded = Uploaded::default();
        let mut last: Option<(Plan, Drawn)> = None;
        let mut is_full = true;
        for _ in 0..num_frames {
            // A plan shares what the technique may change for the next.
            drop(last.take());
            if let Dial::Deadline(deadline) = view.dial {
                let start = Instant::now();
                let paced = self.draw_by(local, deadline, place, backend)?;
                uploaded += paced.uploaded;
                let (select, upload) = (paced.select_secs, paced.upload_secs);
                times.push(Times {
                    select,
                    geometry: None,
                    upload: paced.plan.store.is_some().then_some(upload),
                    draw: start.elapsed().as_secs_f64() - select - upload,
                    paced: Some(paced.frame),
                });
                is_full = paced.is_full;
                last = Some((paced.plan, paced.drawn));
                continue;
            }
            let technique = &mut self.techniques[place].0;
            if num_frames > 1 {
                technique.forget_view();
            }
            let start = Instant::now();
            let plan = technique.plan(&mut self.data, local, backend)?;
            let geometry = plan.geometry_seconds;
            let select = start.elapsed().as_secs_f64() - geometry.unwrap_or(0.0);
            let start = Instant::now();
            uploaded += self.upload(&plan, memory_of(view), backend)?;
            let upload = plan.store.is_some().then(|| start.elapsed().as_secs_f64());
            let start = Instant::now();
            let drawn = self.draw(local, &plan, backend)?;
            times.push(Times { select, geometry, upload, draw: start.elapsed().as_secs_f64(), paced: None });
            last = Some((plan, drawn));
        }
        let (mut plan, mut drawn) = last.ok_or(RenderError::NoFrame)?;
        if !is_full {
            // What is known of drawings in full says nothing of this picture.
            (plan.bound_max, drawn.ray_doubt) = (None, None);
        }
        Ok(self.picture(view, plan, drawn, (uploaded, &times), backend))
    }

    /// Compares a picture of these data with the truth: the exact picture in `f64`, of samples in full resolution or by
    /// VTK's interpolation in cells. Writes the error into the picture's report and returns the truth. `progress` hears
    /// a number in [0, 1] now and then.
    ///
    /// # Errors
    /// When the truth cannot be computed, or the picture is of another size than the view.
    pub fn verify(
        &self,
        view: &View,
        picture: &mut Picture,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<volery_reference::Image, VerifyError> {
        let (technique, _) = &self.techniques[self.check(view).map_err(Box::new)?];
        let local = Space::default().view(&self.data.placement(), view);
        let truth = technique.truth(&self.data, &local, progress)?;
        picture.measure(&truth)?;
        Ok(truth)
    }

    /// Finds how far each pixel of a picture of these data can be from the exact picture, and writes the largest and the
    /// root mean square into the picture's report. Needs no truth.
    ///
    /// # Errors
    /// When the technique has no such bounds, or bricks cannot be read.
    pub fn certify(&mut self, view: &View, picture: &mut Picture) -> Result<MatterBound, RenderError> {
        let place = self.check(view)?;
        let local = self.local(view);
        let bound = self.techniques[place].0.bound(&mut self.data, &local)?.ok_or(RenderError::NoBound {
            technique: view.how.name(),
            has_deadline: matches!(view.dial, Dial::Deadline(_)),
        })?;
        let error = picture.report.error.get_or_insert_default();
        error.bound_max = Some(bound.max());
        error.bound_rms = Some(bound.rms());
        error.bound_against = Some(report::AGAINST_EXACT);
        Ok(bound)
    }

    /// A view in the space of the data, which techniques and backends know alone.
    pub(crate) fn local<'v>(&mut self, view: &'v View) -> Cow<'v, View> {
        self.space.view(&self.data.placement(), view)
    }

    /// The place of the technique of a view that can be drawn.
    pub(crate) fn check(&self, view: &View) -> Result<usize, RenderError> {
        let place = self.techniques.iter().position(|(technique, _)| technique.draws(&view.how));
        let place = place.ok_or_else(|| RenderError::OtherData {
            technique: view.how.name(),
            found: self.data.input().kind,
        })?;
        // First: what cannot be drawn at all has no camera either.
        self.techniques[place].0.check(&self.data, view)?;
        view.check()?;
        Ok(place)
    }

    /// Makes resident what a plan needs.
    ///
    /// With a largest number of bytes it is they that the backend never takes more than.
    pub(crate) fn upload(
        &self,
        plan: &Plan,
        max_bytes: Option<u64>,
        backend: &mut dyn Backend,
    ) -> Result<Uploaded, RenderError> {
        let (Some((store, nodes)), Some(source)) = (&plan.store, self.data.bricks()) else {
            return Ok(Uploaded { bytes: plan.work.slice_bytes.map_or(0, |[_, sent]| sent), bricks: 0 });
        };
        Ok(match max_bytes {
            Some(max_bytes) => residency::upload_within(source, store, nodes, max_bytes, backend)?,
            None => residency::upload(source, store, nodes, backend)?,
        })
    }

    pub(crate) fn draw(
        &self,
        view: &View,
        plan: &Plan,
        backend: &mut dyn Backend,
    ) -> Result<Drawn, RenderError> {
        Ok(backend.draw(&Frame { view: picture_view(view), content: plan.drawing.content() })?)
    }

    /// What was drawn, and the report of it.
    pub(crate) fn picture(
        &self,
        view: &View,
        plan: Plan,
        drawn: Drawn,
        (uploaded, times): (Uploaded, &[Times]),
        backend: &dyn Backend,
    ) -> Picture {
        let built = self.techniques.iter().find(|(technique, _)| technique.draws(&view.how));
        let built = built.and_then(|(_, seconds)| *seconds).unwrap_or(0.0);
        let focus = if let How::Planes(planes) = &view.how { planes.focus } else { None };
        let deadline = if let Dial::Deadline(deadline) = view.dial { Some(deadline) } else { None };
        let dial = report::Dial {
            tolerance: if let Dial::Tolerance(tolerance) = view.dial { Some(tolerance) } else { None },
            error: if let Dial::Error(error) = view.dial { Some(error) } else { None },
            budget_ms: deadline.map(|deadline| 1e3 * deadline.budget_secs),
            memory: memory_of(view),
            gaze: deadline.and_then(|deadline| deadline.gaze),
            quality: focus.map(|focus| focus.quality),
        };
        let error = error_of(&plan, &drawn);
        let Work { nodes_by_level, polygons, slices, triangles, slice_bytes } = plan.work;
        let report = Report {
            version: report::VERSION,
            input: self.data.input(),
            inputs: Vec::new(),
            technique: view.how.name(),
            thickness: if let How::Fans(thickness) = view.how { Some(thickness.name()) } else { None },
            backend: report::Backend::of(backend.device()),
            image: report::ImageSize { width: view.width, height: view.height },
            camera: view.camera,
            transfer_function: (!self.data.has_colors()).then(|| report::transfer_of(view)),
            seconds: Times::median(times, self.data.build_seconds() + built),
            frames: Times::frames(times),
            work: report::Work {
                nodes: nodes_by_level.as_ref().map(|nodes| nodes.iter().sum()),
                bricks: nodes_by_level.is_some().then_some(uploaded.bricks),
                nodes_by_level,
                bytes_resident: slice_bytes.map_or_else(|| backend.resident_bytes(), |[kept, _]| kept),
                bytes_uploaded: uploaded.bytes,
                polygons,
                slices,
                triangles,
            },
            dial: (dial != report::Dial::default()).then_some(dial),
            error,
        };
        Picture { image: drawn.image, report }
    }
}

/// The bytes of device memory that a view allows.
fn memory_of(view: &View) -> Option<u64> {
    if let Dial::Memory(bytes) = view.dial { Some(bytes) } else { None }
}

/// What a backend is told of a view.
fn picture_view(view: &View) -> PictureView<'_> {
    PictureView {
        width: view.width,
        height: view.height,
        camera: view.camera,
        background: view.background.map(|c| c as f32),
        meshes: &view.meshes,
    }
}

/// What is known of the error without the truth.
fn error_of(plan: &Plan, drawn: &Drawn) -> Option<report::Error> {
    let budget = match (&plan.drawing, &plan.store, drawn.ray_doubt) {
        (Drawing::Rays { transfer, .. }, Some((store, _)), Some(doubt)) => {
            Some(RayBudget::new(transfer, &store.layout, doubt))
        }
        _ => None,
    };
    let against = if budget.is_some() { report::AGAINST_EXACT } else { "full resolution" };
    let (bound_max, predicted_rmse) = (plan.bound_max, plan.predicted_rmse);
    let bound_against = bound_max.map(|_| against);
    let error =
        report::Error { bound_max, bound_against, predicted_rmse, budget, ..report::Error::default() };
    (error != report::Error::default()).then_some(error)
}

impl Picture {
    /// Compares with the truth and writes the error into the report.
    fn measure(&mut self, truth: &volery_reference::Image) -> Result<(), VerifyError> {
        let image = &self.image;
        let drawn = volery_reference::Image::from_f32(image.width, image.height, &image.pixels)?;
        let found = metrics::compare(&drawn, truth)?;
        self.report.error.get_or_insert_default().measured = Some(report::Measured {
            measured_max: found.max,
            measured_rmse: found.rmse,
            measured_psnr_db: found.psnr_db.is_finite().then_some(found.psnr_db),
            against: "reference f64",
        });
        Ok(())
    }
}
