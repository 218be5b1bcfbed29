//! What parts take, and what is resident.

use std::collections::BTreeMap;

use crate::item::Part;

use super::random::Random;
use super::world::World;

/// What a device is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceSettings {
    /// Seed of noise and spikes.
    pub seed: u64,
    /// Budgets that a frame of the finest levels takes, when nothing is enlarged.
    pub load: f64,
    /// Fixed cost of a part.
    pub fixed_secs: f64,
    /// What it takes to start a part when none is in flight.
    pub launch_secs: f64,
    /// Cost of an upload.
    pub secs_per_byte: f64,
    /// Bytes that can be resident.
    pub capacity_bytes: f64,
    /// Deviation of the logarithm of a part's time.
    pub noise: f64,
    /// Parts that take `spike_ratio` times as long, of all.
    pub spike_part: f64,
    /// How many times as long these take.
    pub spike_ratio: f64,
    /// Parts in flight, at most.
    pub latency: usize,
    /// What a frame takes outside of its parts, with noise of 20 %.
    pub outside_secs: f64,
}

impl Default for DeviceSettings {
    fn default() -> Self {
        DeviceSettings {
            seed: 1,
            load: 4.0,
            fixed_secs: 10e-6,
            launch_secs: 20e-6,
            secs_per_byte: 1e-10,
            capacity_bytes: 1e9,
            noise: 0.2,
            spike_part: 0.05,
            spike_ratio: 5.0,
            latency: 2,
            outside_secs: 0.5e-3,
        }
    }
}

/// A device at work.
#[derive(Clone, Debug)]
pub struct Device {
    pub(super) settings: DeviceSettings,
    /// How many times as long everything takes now.
    pub(super) speed: f64,
    secs_per_work: f64,
    bytes: Vec<Vec<f64>>,
    random: Random,
    /// When each resident level was used last, and the reverse.
    used: BTreeMap<(usize, usize), u64>,
    by_use: BTreeMap<u64, (usize, usize)>,
    resident_bytes: f64,
    num_drawn: u64,
}

impl Device {
    /// A device on which the finest levels of a world take `load` budgets.
    pub fn new(settings: DeviceSettings, world: &World, budget_secs: f64) -> Self {
        Device {
            settings,
            speed: 1.0,
            secs_per_work: settings.load * budget_secs / world.full_work(),
            bytes: world.bytes(),
            random: Random::new(settings.seed),
            used: BTreeMap::new(),
            by_use: BTreeMap::new(),
            resident_bytes: 0.0,
            num_drawn: 0,
        }
    }

    pub(super) fn is_resident(&self, item: usize, level: usize) -> bool {
        self.used.contains_key(&(item, level))
    }

    /// Draws a part of that much work in truth, and says what it took.
    pub(super) fn draw(&mut self, part: Part, work: f64) -> f64 {
        let DeviceSettings { fixed_secs, secs_per_byte, noise, spike_part, spike_ratio, .. } = self.settings;
        let bytes = self.touch(part.item, part.level);
        let mut secs = fixed_secs + self.secs_per_work * work * part.pixel_rate * part.pixel_rate;
        secs = (secs * self.random.log_normal(noise) + secs_per_byte * bytes) * self.speed;
        if self.random.uniform() < spike_part { secs * spike_ratio } else { secs }
    }

    pub(super) fn outside_secs(&mut self) -> f64 {
        self.settings.outside_secs * self.random.log_normal(0.2)
    }

    /// Makes a level resident, and says how many bytes that took.
    fn touch(&mut self, item: usize, level: usize) -> f64 {
        self.num_drawn += 1;
        let place = (item, level);
        let before = self.used.insert(place, self.num_drawn);
        self.by_use.insert(self.num_drawn, place);
        if let Some(before) = before {
            self.by_use.remove(&before);
            return 0.0;
        }
        let bytes = self.bytes[item][level];
        self.resident_bytes += bytes;
        while self.resident_bytes > self.settings.capacity_bytes && self.by_use.len() > 1 {
            let Some((_, old)) = self.by_use.pop_first() else { break };
            self.used.remove(&old);
            self.resident_bytes -= self.bytes[old.0][old.1];
        }
        bytes
    }
}
