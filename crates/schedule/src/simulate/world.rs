//! What is drawn, and how it moves.

use std::f64::consts::TAU;

use crate::item::Level;

use super::View;
use super::random::Random;

/// What a world is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorldSettings {
    /// Seed of works, factors and places.
    pub seed: u64,
    /// Items.
    pub num_items: usize,
    /// Levels of each.
    pub num_levels: usize,
    /// How many times cheaper each level is than the finer one: 2 for slices, 4 for pixels, 8 for cells.
    pub ratio: f64,
    /// Deviation of the logarithm of work between items.
    pub work_sigma: f64,
    /// Deviation of the logarithm of cost per work between items, which the controller is not told.
    pub factor_sigma: f64,
    /// The importance of an item is the mean of its class, the first for the least important third, times noise of 10 %.
    pub class_importance: [f64; 3],
    /// How much of an item's importance turns with the view, from 0 to 1.
    pub turning: f64,
}

impl Default for WorldSettings {
    fn default() -> Self {
        WorldSettings {
            seed: 1,
            num_items: 128,
            num_levels: 5,
            ratio: 4.0,
            work_sigma: 0.5,
            factor_sigma: 0.3,
            class_importance: [1.0; 3],
            turning: 0.3,
        }
    }
}

/// How the view moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// 50 frames of zoom in to twice the size, 100 of a full turn, 50 of zoom out; then again.
    Paper,
    /// A turn of so many degrees a frame.
    Orbit {
        /// Degrees in each frame.
        degrees_per_frame: f64,
    },
    /// As `Paper` for so many frames, then none.
    RestFrom {
        /// The first frame in which nothing moves.
        frame: usize,
    },
}

/// Items that can be seen from all sides.
#[derive(Clone, Debug)]
pub struct World {
    settings: WorldSettings,
    works: Vec<f64>,
    factors: Vec<f64>,
    importance: Vec<f64>,
    /// Angle at which each item is nearest to the eye.
    angles: Vec<f64>,
}

impl World {
    /// The world of a seed.
    pub fn new(settings: WorldSettings) -> Self {
        let mut random = Random::new(settings.seed ^ 0xC0FF_EE00);
        let mut list = |make: &mut dyn FnMut(&mut Random, usize) -> f64| {
            (0..settings.num_items).map(|item| make(&mut random, item)).collect::<Vec<f64>>()
        };
        World {
            works: list(&mut |random, _| 1e6 * random.log_normal(settings.work_sigma)),
            factors: list(&mut |random, _| random.log_normal(settings.factor_sigma)),
            importance: list(&mut |random, item| {
                settings.class_importance[item % 3] * (0.9 + 0.2 * random.uniform())
            }),
            angles: list(&mut |random, _| TAU * random.uniform()),
            settings,
        }
    }

    /// Work of all finest levels, as it truly costs.
    pub(super) fn full_work(&self) -> f64 {
        self.works.iter().zip(&self.factors).map(|(work, factor)| work * factor).sum::<f64>().max(1.0)
    }

    fn level_bytes(&self, item: usize, level: usize) -> f64 {
        0.25 * self.works[item] / 8_f64.powi(level as i32)
    }

    /// Bytes of each level of each item.
    pub(super) fn bytes(&self) -> Vec<Vec<f64>> {
        let of = |item| (0..self.settings.num_levels).map(|level| self.level_bytes(item, level)).collect();
        (0..self.settings.num_items).map(of).collect()
    }

    /// Items in one frame.
    pub(super) fn view(&self, motion: Motion, frame: usize) -> View {
        let (zoom, angle) = match motion {
            Motion::Paper => paper(frame),
            Motion::Orbit { degrees_per_frame } => (1.5, (frame as f64 * degrees_per_frame).to_radians()),
            Motion::RestFrom { frame: first } => paper(frame.min(first)),
        };
        let WorldSettings { num_items, num_levels, ratio, turning, .. } = self.settings;
        let turn = |item: usize| (angle - self.angles[item]).cos();
        let levels = |item: usize| {
            let finest = self.works[item] * zoom * zoom * (1.0 + 0.3 * turn(item));
            let level = |level: usize| Level {
                work: finest / ratio.powi(level as i32),
                bytes: self.level_bytes(item, level),
                error: ((1_u64 << level) - 1) as f64 * self.works[item].sqrt(),
            };
            (0..num_levels).map(level).collect()
        };
        View {
            importance: (0..num_items)
                .map(|item| self.importance[item] * (1.0 + turning * turn(item)))
                .collect(),
            factors: (0..num_items)
                .map(|item| self.factors[item] * (1.0 + 0.2 * (2.0 * angle + self.angles[item]).sin()))
                .collect(),
            levels: (0..num_items).map(levels).collect(),
        }
    }
}

/// Zoom and angle of a frame of the paper's 200.
fn paper(frame: usize) -> (f64, f64) {
    let frame = (frame % 200) as f64;
    let zoom = 1.0 + (frame.min(50.0) - (frame - 150.0).max(0.0)) / 50.0;
    (zoom, TAU * ((frame - 50.0) / 100.0).clamp(0.0, 1.0))
}
