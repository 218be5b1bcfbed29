//! Pictures by a deadline.
//!
//! # Method
//! A picture of rays is cut into windows. Each is drawn with a ray for every pixel, or for squares of 2, 4 or 8 pixels,
//! whichever [`volery_schedule`] says: it learns what windows take, shares the time out by what is lost in them, and
//! makes windows finer as long as there is time (Li and Shen 2001, whose subvolumes are windows here: levels of the octree
//! cost rays almost the same, since these step over what is empty and end where it is opaque). What was lost is foreseen
//! from the last picture ([`windows`]). Planes and stacks are drawn whole, at one of several levels of detail; where the
//! coarsest takes too long, in larger pixels.
//!
//! Bricks that are not resident are uploaded within a quarter of the budget. Where that is not enough, the picture is
//! drawn from a coarser cut, and the rest comes with the next pictures.
//!
//! # Guarantees
//! A picture is whole, whatever the budget. What the budget cannot hold is the floor: rays for squares of 8 pixels, or
//! the coarsest level in pixels of 4; the report says so.
//!
//! # Limits
//! What a device takes is learned: the first pictures of a session miss their deadline. A picture at rest is the same
//! after some pictures, not after the first.

mod windows;

use std::collections::VecDeque;
use std::time::Instant;

use volery_frame::backend::MAX_STRIDE;
use volery_frame::{Backend, Device, DeviceKind, Drawn, Image, Window};
use volery_scene::Camera;
use volery_schedule::{Controller, Item, Level, Part, Rule, Scheduler, Settings, Step, Summary, importance};

use super::{RenderError, Session};
use crate::data::Data;
use crate::report;
use crate::residency::{self, Uploaded};
use crate::technique::Plan;
use crate::view::{Deadline, Dial, How, View};
use windows::{Losses, STRIDES, Windows};

/// Parts that a device may hold at one time: it never waits, and little is in its hands when time is up.
const MAX_IN_FLIGHT: usize = 2;

/// Share of the budget that uploads may take.
const UPLOAD_SHARE: f64 = 0.25;

/// Of an upload, until one was seen.
const FIRST_SECS_PER_BYTE: f64 = 2e-9;

/// What larger pixels of whole pictures are, in pixels.
const SHRINKS: [u32; 2] = [2, 4];

/// What rays far apart take more, in rays for each pixel: neighbours walk through much in common.
const APART: f64 = 0.08;

/// Share of the picture's diagonal at which a gaze counts half.
const GAZE_RADIUS: f64 = 0.1;

/// What was learned of one technique on one device, for pictures of one size.
pub(crate) struct Pace {
    place: usize,
    device: Device,
    windows: Windows,
    scheduler: Scheduler,
    secs_per_byte: f64,
    /// Room for a picture.
    shown: Vec<[f32; 3]>,
    /// Of each window, from the last picture.
    losses: Option<Vec<Losses>>,
    /// Of the last picture.
    camera: Option<Camera>,
}

/// A picture that was drawn by a deadline.
pub(super) struct Paced {
    pub(super) plan: Plan,
    pub(super) drawn: Drawn,
    pub(super) uploaded: Uploaded,
    /// Spent on plans, and on uploads.
    pub(super) select_secs: f64,
    pub(super) upload_secs: f64,
    pub(super) frame: report::PacedFrame,
    /// Whether nothing was left out.
    pub(super) is_full: bool,
}

/// A frame under way: its clock, and what of it is decisions.
struct Watch {
    start: Instant,
    control_secs: f64,
}

impl Watch {
    fn elapsed(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    /// Counts what takes decisions.
    fn control<R>(&mut self, decide: impl FnOnce(f64) -> R) -> R {
        let before = self.elapsed();
        let decided = decide(before);
        self.control_secs += self.elapsed() - before;
        decided
    }
}

/// Parts that a device was given, in order, and when it was done with the last.
struct InFlight {
    parts: VecDeque<(u32, u64, f64)>,
    last_done: f64,
    /// Whether parts are done when they are handed out, several at one time: then the device says what each took.
    is_at_once: bool,
}

impl InFlight {
    /// Tells the scheduler of what is done.
    fn look(&mut self, backend: &mut dyn Backend, scheduler: &mut Scheduler, watch: &mut Watch) {
        for part in backend.finished() {
            let Some(place) = self.parts.iter().position(|(number, ..)| *number == part.number) else {
                continue;
            };
            let Some((_, id, begun)) = self.parts.remove(place) else { continue };
            watch.control(|now| {
                let told = part.device_seconds.filter(|_| self.is_at_once);
                scheduler.observe(id, told.unwrap_or(now - begun.max(self.last_done)));
                self.last_done = now;
            });
        }
    }
}

impl<D: Data> Session<D> {
    /// Draws one picture by its deadline.
    pub(super) fn draw_by(
        &mut self,
        view: &View,
        deadline: Deadline,
        place: usize,
        backend: &mut dyn Backend,
    ) -> Result<Paced, RenderError> {
        let mut watch = Watch { start: Instant::now(), control_secs: 0.0 };
        let (size, device) = ([view.width, view.height], backend.device());
        let windows = Windows::new(size);
        let is_rays = matches!(view.how, How::Raycast);
        let is_same = |pace: &Pace| pace.place == place && pace.device == device && pace.windows == windows;
        let mut pace = self.pace.take().filter(is_same).unwrap_or_else(|| Pace {
            place,
            device,
            windows,
            scheduler: Scheduler::new(Settings {
                rule: Rule::LeastError,
                is_proportional: is_rays,
                ..Settings::default()
            }),
            secs_per_byte: FIRST_SECS_PER_BYTE,
            shown: Vec::new(),
            losses: None,
            camera: None,
        });
        let paced = if is_rays {
            self.draw_windows(view, deadline, (&mut pace, &mut watch), backend)
        } else {
            self.draw_whole(view, deadline, (&mut pace, &mut watch), backend)
        };
        self.pace = Some(pace);
        paced
    }

    /// The plan of a rung: 0 is the full resolution.
    fn plan_of(
        &mut self,
        view: &View,
        rung: usize,
        place: usize,
        backend: &dyn Backend,
    ) -> Result<Option<Plan>, RenderError> {
        let full = View { dial: Dial::Full, ..view.clone() };
        let technique = &mut self.techniques[place].0;
        let view = if rung == 0 { Some(full) } else { technique.coarser(&full, rung) };
        view.map(|view| technique.plan(&mut self.data, &view, backend)).transpose()
    }

    /// The best plan whose bricks can be there in time, which rung it is, what was uploaded and the seconds of that.
    fn resident_plan(
        &mut self,
        view: &View,
        budget_secs: f64,
        pace: &mut Pace,
        backend: &mut dyn Backend,
    ) -> Result<(Plan, usize, Uploaded, f64), RenderError> {
        let most_bytes = UPLOAD_SHARE * budget_secs / pace.secs_per_byte;
        let (mut rung, mut finer) = (0, None);
        let mut plan = self.plan_of(view, rung, pace.place, backend)?.ok_or(RenderError::NoFrame)?;
        while self.missing_bytes(&plan, backend) as f64 > most_bytes {
            let Some(coarser) = self.plan_of(view, rung + 1, pace.place, backend)? else { break };
            finer = Some(std::mem::replace(&mut plan, coarser));
            rung += 1;
        }
        let start = Instant::now();
        let mut uploaded = self.upload(&plan, None, backend)?;
        if let (Some(Plan { store: Some((store, nodes)), .. }), Some(source)) = (&finer, self.data.bricks()) {
            let left = (most_bytes - uploaded.bytes as f64).max(0.0) as u64;
            uploaded += residency::prefetch(source, store, nodes, left, backend)?;
        }
        let upload_secs = start.elapsed().as_secs_f64();
        if uploaded.bricks > 0 {
            let secs_per_byte = upload_secs / uploaded.bytes.max(1) as f64;
            pace.secs_per_byte += 0.5 * (secs_per_byte - pace.secs_per_byte);
        }
        Ok((plan, rung, uploaded, upload_secs))
    }

    /// Bytes of texels that a plan needs and a backend has not.
    fn missing_bytes(&self, plan: &Plan, backend: &dyn Backend) -> u64 {
        match (&plan.store, self.data.bricks()) {
            (Some((store, nodes)), Some(source)) => residency::missing_bytes(source, store, nodes, backend),
            _ => 0,
        }
    }

    /// Draws a picture of rays window by window.
    fn draw_windows(
        &mut self,
        view: &View,
        deadline: Deadline,
        (pace, watch): (&mut Pace, &mut Watch),
        backend: &mut dyn Backend,
    ) -> Result<Paced, RenderError> {
        let (plan, rung, uploaded, upload_secs) =
            self.resident_plan(view, deadline.budget_secs, pace, backend)?;
        let select_secs = watch.elapsed() - upload_secs;
        let windows = pace.windows;
        let order = windows.scattered();
        let levels = pace.levels(&order);
        watch.control(|_| {
            if pace.camera != Some(view.camera) {
                pace.scheduler.disturb();
            }
            pace.scheduler.begin(deadline.budget_secs, &pace.items(&order, &levels, deadline));
        });
        backend.begin_windows(&super::picture_view(view), windows.side)?;
        let content = plan.drawing.content();
        let mut strides = vec![MAX_STRIDE; windows.num() as usize];
        let mut in_flight =
            InFlight { parts: VecDeque::new(), last_done: 0.0, is_at_once: pace.is_at_once() };
        let (mut step, mut held) = (Step::Wait, None);
        let mut num_left = order.len();
        while step != Step::Done || held.is_some() {
            in_flight.look(backend, &mut pace.scheduler, watch);
            if in_flight.parts.len() >= MAX_IN_FLIGHT {
                backend.wait()?;
                continue;
            }
            let mut parts: Vec<Part> = held.take().into_iter().collect();
            let batch = pace.batch(num_left);
            watch.control(|now| {
                while parts.len() < batch && step != Step::Done {
                    step = pace.scheduler.next(now);
                    let Step::Draw(part) = step else { break };
                    // A window that comes again is drawn when it was.
                    if parts.iter().any(|other| other.item == part.item) {
                        held = Some(part);
                        break;
                    }
                    parts.push(part);
                }
            });
            if parts.is_empty() {
                // With nothing in flight this ends after one question for each part that was never told.
                backend.wait()?;
                continue;
            }
            num_left = num_left.saturating_sub(parts.len());
            let begun = watch.elapsed();
            let window = |part: &Part| Window { number: order[part.item], stride: STRIDES[part.level] };
            let list: Vec<Window> = parts.iter().map(window).collect();
            list.iter().for_each(|window| strides[window.number as usize] = window.stride);
            let first = backend.draw_windows(&content, &list)?;
            in_flight.parts.extend((first..).zip(&parts).map(|(number, part)| (number, part.id, begun)));
        }
        while !in_flight.parts.is_empty() {
            backend.wait()?;
            in_flight.look(backend, &mut pace.scheduler, watch);
        }
        let mut drawn = backend.finish()?;
        watch.control(|_| pace.learn(&drawn.image, &strides, view));
        windows.interpolate(&mut drawn.image, &strides, &mut pace.shown);
        let summary = pace.scheduler.finish(watch.elapsed());
        let num_rays: f64 =
            (0..).zip(&strides).map(|(window, &stride)| windows.num_rays(window, stride)).sum();
        let pixels = f64::from(view.width) * f64::from(view.height);
        let is_full = rung == 0 && strides.iter().all(|&stride| stride == 1);
        let frame = paced_frame(&summary, watch, (num_rays / pixels).min(1.0), rung);
        Ok(Paced { plan, drawn, uploaded, select_secs, upload_secs, frame, is_full })
    }

    /// Draws planes or a stack at one of several levels, whole.
    fn draw_whole(
        &mut self,
        view: &View,
        deadline: Deadline,
        (pace, watch): (&mut Pace, &mut Watch),
        backend: &mut dyn Backend,
    ) -> Result<Paced, RenderError> {
        let full = View { dial: Dial::Full, ..view.clone() };
        let technique = &self.techniques[pace.place].0;
        let num_rungs = 1 + (1..).take_while(|&rung| technique.coarser(&full, rung).is_some()).count();
        let choices: Vec<(usize, u32)> = (0..num_rungs)
            .map(|rung| (rung, 1))
            .chain(SHRINKS.map(|shrink| (num_rungs - 1, shrink)))
            .collect();
        let pixels = f64::from(view.width) * f64::from(view.height);
        let level = |(error, &(rung, shrink)): (usize, &(usize, u32))| Level {
            // Half for what is drawn, half for its pixels.
            work: pixels * 0.5_f64.powi(rung as i32) * (0.5 + 0.5 / f64::from(shrink * shrink)),
            bytes: 0.0,
            error: error as f64,
        };
        let levels: Vec<_> = choices.iter().enumerate().map(level).collect();
        let item = Item { key: 0, importance: 1.0, levels: &levels };
        watch.control(|_| pace.scheduler.begin(deadline.budget_secs, &[item]));
        let (mut select_secs, mut upload_secs) = (0.0, 0.0);
        let mut last = None;
        let mut uploaded = Uploaded::default();
        while let Step::Draw(part) = watch.control(|now| pace.scheduler.next(now)) {
            let begun = watch.elapsed();
            let (rung, shrink) = choices[part.level];
            let plan = self.plan_of(view, rung, pace.place, backend)?.ok_or(RenderError::NoFrame)?;
            let planned = watch.elapsed();
            uploaded += self.upload(&plan, None, backend)?;
            select_secs += planned - begun;
            upload_secs += watch.elapsed() - planned;
            let small = View {
                width: view.width.div_ceil(shrink),
                height: view.height.div_ceil(shrink),
                ..view.clone()
            };
            let drawn = self.draw(&small, &plan, backend)?;
            last = Some((plan, drawn, rung, shrink));
            watch.control(|now| pace.scheduler.observe(part.id, now - begun));
        }
        let (plan, mut drawn, rung, shrink) = last.ok_or(RenderError::NoFrame)?;
        if shrink > 1 {
            drawn.image = windows::enlarge(&drawn.image, [view.width, view.height]);
        }
        let summary = pace.scheduler.finish(watch.elapsed());
        let frame = paced_frame(&summary, watch, f64::from(shrink * shrink).recip(), rung);
        let is_full = rung == 0 && shrink == 1;
        Ok(Paced { plan, drawn, uploaded, select_secs, upload_secs, frame, is_full })
    }
}

impl Pace {
    /// Whether the device is this one, whose parts are done when a call returns.
    fn is_at_once(&self) -> bool {
        self.device.kind == DeviceKind::Software
    }

    /// Parts that are handed out at one time where so many are left: a third, since threads wait for each other at the
    /// end of each time, and at least so many that none has nothing to do; or one.
    fn batch(&self, num_left: usize) -> usize {
        if self.is_at_once() { (num_left / 3).max(2 * rayon::current_num_threads()) } else { 1 }
    }

    /// The levels of all windows, one after the other in this order.
    fn levels(&self, order: &[u32]) -> Vec<Level> {
        let level = |window: u32, place: usize| {
            let [pixels, rays] = [1, STRIDES[place]].map(|stride| self.windows.num_rays(window, stride));
            let loss = self.losses.as_ref().map(|losses| losses[window as usize][place]);
            let loss = if place == 0 { 0.0 } else { loss.unwrap_or(place as f64) };
            // What counts is the sum of squares over pixels.
            Level { work: rays + APART * pixels, bytes: 0.0, error: pixels * loss.powi(2) }
        };
        let places = 0..STRIDES.len();
        order.iter().flat_map(|&window| places.clone().map(move |place| level(window, place))).collect()
    }

    fn items<'a>(&self, order: &[u32], levels: &'a [Level], deadline: Deadline) -> Vec<Item<'a>> {
        let size = self.windows.size.map(f64::from);
        let radius = GAZE_RADIUS * size[0].hypot(size[1]);
        let item = |(&window, levels): (&u32, &'a [Level])| {
            let [first, last] = self.windows.bounds(window);
            let centre = [0, 1].map(|axis| 0.5 * f64::from(first[axis] + last[axis]));
            let near = deadline
                .gaze
                .map_or(1.0, |gaze| importance::gaze([gaze[0] * size[0], gaze[1] * size[1]], centre, radius));
            Item { key: u64::from(window), importance: near, levels }
        };
        order.iter().zip(levels.chunks(STRIDES.len())).map(item).collect()
    }

    /// Foresees what the next picture would lose from what this one shows.
    fn learn(&mut self, image: &Image, strides: &[u32], view: &View) {
        let is_still = self.camera.replace(view.camera) == Some(view.camera);
        let found = self.windows.losses(image, strides);
        let Some(known) = &mut self.losses else {
            self.losses = Some(found);
            return;
        };
        for ((known, found), &drawn) in known.iter_mut().zip(found).zip(strides) {
            for ((known, found), &stride) in known.iter_mut().zip(found).zip(&STRIDES) {
                // Of details that were not drawn the last word counts, as long as nothing moves.
                if stride > drawn {
                    *known = found;
                } else if !is_still {
                    *known = 0.5 * (*known + found);
                }
            }
        }
    }
}

fn paced_frame(summary: &Summary, watch: &Watch, rays_per_pixel: f64, rung: usize) -> report::PacedFrame {
    report::PacedFrame {
        budget_seconds: summary.budget_secs,
        predicted_seconds: summary.predicted_secs,
        control_seconds: watch.control_secs,
        parts: summary.num_parts,
        refinements: summary.num_refinements,
        rays_per_pixel,
        rung,
        is_at_floor: summary.is_at_floor,
    }
}
