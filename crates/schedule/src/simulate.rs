//! A device of numbers: frames played in microseconds, the same for the same seed.
//!
//! # Model
//! A device draws parts one after another. A part takes `speed * (fixed + per_work * work * hidden factor of the item)`,
//! times log-normal noise of mean 1, times `spike_ratio` for one part in `1 / spike_part`, plus the upload of what is not
//! resident; the least recently used is thrown out at `capacity_bytes`. At most `latency` parts are in flight: the
//! controller is asked for the next while the one before is still running, and is told a cost when it is known.
//! [`Outcome`] says how frames ended.
//!
//! A world has items of log-normal work in some levels, each `ratio` times cheaper than the one before, and costs per
//! work that nobody is told. Its motions are those of Li and Shen (2001, section 5.1), 50 frames of zoom in, 100 of
//! rotation, 50 of zoom out, over and over; a slow orbit; rest.
//!
//! # Limits
//! Parts do not run at once, noise is independent from part to part, and pixels have no error: nothing here says how a
//! picture looks.

mod device;
mod outcome;
mod random;
mod world;

use std::collections::VecDeque;

use crate::item::{Controller, Item, Level, Part, Step};

pub use device::{Device, DeviceSettings};
pub use outcome::{Distribution, FrameRecord, Outcome};
pub use random::Random;
pub use world::{Motion, World, WorldSettings};

/// What is played.
#[derive(Clone, Debug)]
pub struct Scene {
    /// What is drawn.
    pub world: WorldSettings,
    /// On what.
    pub device: DeviceSettings,
    /// How it moves.
    pub motion: Motion,
    /// The budget of each frame.
    pub budget_secs: f64,
    /// Frames.
    pub num_frames: usize,
    /// From which frame on parts take how many times as long, in order.
    pub speeds: Vec<(usize, f64)>,
}

impl Default for Scene {
    fn default() -> Self {
        Scene {
            world: WorldSettings::default(),
            device: DeviceSettings::default(),
            motion: Motion::Paper,
            budget_secs: 0.033,
            num_frames: 1000,
            speeds: Vec::new(),
        }
    }
}

/// Plays a scene with a controller.
pub fn play(scene: &Scene, controller: &mut dyn Controller) -> Outcome {
    let world = World::new(scene.world);
    let mut device = Device::new(scene.device, &world, scene.budget_secs);
    let mut outcome = Outcome::default();
    let mut frame = Frame::default();
    for number in 0..scene.num_frames {
        device.speed = scene.speeds.iter().rev().find(|(from, _)| *from <= number).map_or(1.0, |at| at.1);
        let mut view = world.view(scene.motion, number);
        view.levels.iter_mut().enumerate().for_each(|(item, levels)| {
            for (level, said) in levels.iter_mut().enumerate() {
                if device.is_resident(item, level) {
                    said.bytes = 0.0;
                }
            }
        });
        frame.play(&view, &mut device, scene.budget_secs, controller);
        outcome.frames.push(frame.record);
    }
    outcome
}

/// Items as they are seen in one frame.
#[derive(Clone, Debug)]
pub(crate) struct View {
    pub(crate) importance: Vec<f64>,
    /// What each item's work costs, relative to the mean: the controller is not told.
    pub(crate) factors: Vec<f64>,
    pub(crate) levels: Vec<Vec<Level>>,
}

#[derive(Default)]
struct Frame {
    shown: Vec<Option<usize>>,
    shown_before: Vec<Option<usize>>,
    in_flight: VecDeque<(u64, f64, f64)>,
    free_at_secs: f64,
    record: FrameRecord,
}

impl Frame {
    fn play(&mut self, view: &View, device: &mut Device, budget_secs: f64, controller: &mut dyn Controller) {
        let items: Vec<Item<'_>> = view
            .levels
            .iter()
            .zip(&view.importance)
            .enumerate()
            .map(|(key, (levels, &importance))| Item { key: key as u64, importance, levels })
            .collect();
        let classes = classes(&view.importance);
        self.record = FrameRecord::default();
        self.free_at_secs = 0.0;
        self.shown.clear();
        self.shown.resize(items.len(), None);
        let mut now_secs = 0.0;
        controller.begin(budget_secs, &items);
        loop {
            while self.in_flight.len() >= device.settings.latency.max(1) {
                self.land(&mut now_secs, controller);
            }
            match controller.next(now_secs) {
                Step::Draw(part) => {
                    let secs = self.launch(part, view, device, now_secs);
                    self.record.class_secs[classes[part.item]] += secs;
                }
                Step::Wait => self.land(&mut now_secs, controller),
                Step::Done => break,
            }
        }
        while !self.in_flight.is_empty() {
            self.land(&mut now_secs, controller);
        }
        let actual_secs = now_secs + device.outside_secs();
        let summary = controller.finish(actual_secs);
        self.record.summary = summary;
        self.record.signed_error = actual_secs / budget_secs - 1.0;
        let changed = self.shown.iter().zip(&self.shown_before).filter(|(now, before)| now != before);
        self.record.num_changed = changed.count();
        for &level in self.shown.iter().flatten() {
            self.record.levels[level.min(7)] += 1;
        }
        std::mem::swap(&mut self.shown, &mut self.shown_before);
    }

    /// Starts a part as soon as the device is free.
    fn launch(&mut self, part: Part, view: &View, device: &mut Device, now_secs: f64) -> f64 {
        let level = view.levels[part.item][part.level];
        let secs = device.draw(part, level.work * view.factors[part.item]);
        if self.in_flight.is_empty() {
            self.free_at_secs = now_secs + device.settings.launch_secs;
        }
        self.free_at_secs += secs;
        self.in_flight.push_back((part.id, self.free_at_secs, secs));
        let shown = &mut self.shown[part.item];
        *shown = Some(shown.map_or(part.level, |before| before.min(part.level)));
        secs
    }

    /// Waits for the oldest part in flight.
    fn land(&mut self, now_secs: &mut f64, controller: &mut dyn Controller) {
        if let Some((id, end_secs, secs)) = self.in_flight.pop_front() {
            *now_secs = now_secs.max(end_secs);
            controller.observe(id, secs);
        }
    }
}

/// Thirds by importance, 0 the least important; equal ones by index.
fn classes(importance: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..importance.len()).collect();
    order.sort_by(|&a, &b| importance[a].total_cmp(&importance[b]));
    let mut classes = vec![0; importance.len()];
    for (rank, &item) in order.iter().enumerate() {
        classes[item] = rank * 3 / importance.len().max(1);
    }
    classes
}
