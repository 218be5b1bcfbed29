//! Larger pixels: everything at its finest level, on an image of fewer pixels.

use std::collections::VecDeque;

use crate::item::{Controller, Item, Step, Summary};

use super::script::Script;

/// Pixels in four sizes, as the GPU volume mapper of VTK 9 has: samples per pixel and axis of 1, 1/2, 1/5 or 1/10. After
/// each frame the wanted rate is the budget over what the frame would have taken at a rate of 1, as if time went with
/// the rate and not with its square; the mean of it and of the old rate is rounded down to a step.
#[derive(Clone, Debug)]
pub struct FourSteps {
    rate: f64,
    script: Script,
}

impl FourSteps {
    /// Begins with the smallest pixels.
    pub fn new() -> Self {
        FourSteps { rate: 1.0, script: Script::default() }
    }
}

impl Default for FourSteps {
    fn default() -> Self {
        Self::new()
    }
}

const STEPS: [f64; 4] = [1.0, 0.5, 0.2, 0.1];

impl Controller for FourSteps {
    fn begin(&mut self, budget_secs: f64, items: &[Item<'_>]) {
        self.script.begin_scaled(budget_secs, items, self.rate, STEPS[3]);
    }

    fn next(&mut self, _elapsed_secs: f64) -> Step {
        self.script.next()
    }

    fn observe(&mut self, _part_id: u64, _secs: f64) {}

    fn finish(&mut self, actual_secs: f64) -> Summary {
        let Some(summary) = self.script.finish(actual_secs) else { return Summary::default() };
        if actual_secs > 0.0 {
            let wanted = self.rate * summary.budget_secs / actual_secs;
            let mean = f64::midpoint(wanted, self.rate);
            self.rate = STEPS.into_iter().find(|step| mean >= *step).unwrap_or(STEPS[3]);
        }
        summary
    }
}

const HEAD_ROOM: f64 = 0.1;
const NUM_FRAMES: usize = 16;
const FRAME_WEIGHT: f64 = 0.9;
const LEAST_CHANGE: f64 = 0.02;
const PANIC_FRAMES: u32 = 2;
const MIN_RATE: f64 = 0.1;

/// Pixels of any size, as game engines scale resolution: aims at 10 % below the budget by the last 16 frames, each of
/// weight .9 of the one after; changes of the rate below 2 % are not made; after two frames in a row over the budget
/// the history is forgotten, and the last frame alone counts. Time is taken to go with the number of pixels.
#[derive(Clone, Debug)]
pub struct ResolutionScaling {
    rate: f64,
    /// What frames would have taken at a rate of 1, the latest first.
    full_secs: VecDeque<f64>,
    num_late: u32,
    script: Script,
}

impl ResolutionScaling {
    /// Begins with the smallest pixels.
    pub fn new() -> Self {
        ResolutionScaling { rate: 1.0, full_secs: VecDeque::new(), num_late: 0, script: Script::default() }
    }
}

impl Default for ResolutionScaling {
    fn default() -> Self {
        Self::new()
    }
}

impl Controller for ResolutionScaling {
    fn begin(&mut self, budget_secs: f64, items: &[Item<'_>]) {
        self.script.begin_scaled(budget_secs, items, self.rate, MIN_RATE);
    }

    fn next(&mut self, _elapsed_secs: f64) -> Step {
        self.script.next()
    }

    fn observe(&mut self, _part_id: u64, _secs: f64) {}

    fn finish(&mut self, actual_secs: f64) -> Summary {
        let Some(summary) = self.script.finish(actual_secs) else { return Summary::default() };
        if !(actual_secs > 0.0 && actual_secs.is_finite()) {
            return summary;
        }
        self.num_late = if actual_secs > summary.budget_secs { self.num_late + 1 } else { 0 };
        if self.num_late >= PANIC_FRAMES {
            self.full_secs.clear();
            self.num_late = 0;
        }
        self.full_secs.push_front(actual_secs / (self.rate * self.rate));
        self.full_secs.truncate(NUM_FRAMES);
        let (mut sum, mut weights, mut weight) = (0.0, 0.0, 1.0);
        for full_secs in &self.full_secs {
            sum += weight * full_secs;
            weights += weight;
            weight *= FRAME_WEIGHT;
        }
        let wanted = ((1.0 - HEAD_ROOM) * summary.budget_secs * weights / sum).sqrt().clamp(MIN_RATE, 1.0);
        if (wanted / self.rate - 1.0).abs() >= LEAST_CHANGE {
            self.rate = wanted;
        }
        summary
    }
}
