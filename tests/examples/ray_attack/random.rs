//! Numbers by chance, the same for the same seed on every machine.

use volery::glam::DVec3;
use volery_data::hash;

/// A sequence of numbers that look like chance: a counter, hashed.
#[derive(Clone, Debug)]
pub(crate) struct Random(u64);

impl Random {
    /// The sequence of one scene; sequences of other seeds and other scenes have nothing to do with it.
    pub(crate) fn new(seed: u64, scene: u64) -> Self {
        Self(hash(hash(seed) ^ scene))
    }

    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(1);
        hash(self.0)
    }

    /// In [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// In [low, high).
    pub(crate) fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// From 10^`low` to 10^`high`, each decade as likely.
    pub(crate) fn decades(&mut self, low: f64, high: f64) -> f64 {
        10_f64.powf(self.within(low, high))
    }

    /// A whole number from `low` to `high`, both included.
    pub(crate) fn whole(&mut self, low: usize, high: usize) -> usize {
        low + (self.bits() % (high - low + 1) as u64) as usize
    }

    /// True in `probability` of all cases.
    pub(crate) fn chance(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }

    /// One of these.
    pub(crate) fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.whole(0, of.len() - 1)]
    }

    /// Three numbers in [low, high).
    pub(crate) fn vector(&mut self, low: f64, high: f64) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|_| self.within(low, high)))
    }

    /// A linear colour.
    pub(crate) fn color(&mut self) -> [f64; 3] {
        std::array::from_fn(|_| self.unit())
    }

    /// A unit vector, all directions as likely.
    pub(crate) fn direction(&mut self) -> DVec3 {
        loop {
            let v = self.vector(-1.0, 1.0);
            if (0.01..=1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }
}
