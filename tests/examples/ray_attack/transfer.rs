//! Transfer functions: ramps, steps, combs and spikes over the values that matter.

use volery::glam::DVec3;
use volery::{ControlPoint, TransferFunction, VoxelGrid};

use crate::random::Random;
use crate::volume::{Volume, is_whole};

/// A transfer function, and what makes it hard.
pub(crate) struct Transfer {
    pub(crate) function: TransferFunction,
    pub(crate) form: &'static str,
    pub(crate) density: &'static str,
}

/// Most control points.
const MAX_POINTS: usize = 200;

impl Transfer {
    pub(crate) fn random(random: &mut Random, volume: &Volume) -> Self {
        let form = random.pick(&["ramps", "ramps", "steps", "comb", "spikes"]);
        let mut points = Points::new(random, volume);
        match form {
            "ramps" => points.ramps(),
            "steps" => points.steps(),
            "comb" => points.comb(),
            _ => points.spikes(),
        }
        let mut points = points.points;
        points.sort_by(|a, b| a.value.total_cmp(&b.value));
        let (density, unit) = match random.unit() {
            u if u < 0.5 => ("usual", random.decades(-1.0, 1.0)),
            u if u < 0.8 => ("dense", random.decades(-4.0, -1.0)),
            _ => ("thin", random.decades(1.0, 2.0)),
        };
        let unit_distance = unit * volume.grid.spacing().min_element();
        let function =
            TransferFunction::new(points, unit_distance).expect("points in order, opacities in [0, 1]");
        Self { function, form, density }
    }
}

/// Control points in the making.
struct Points<'a> {
    random: &'a mut Random,
    volume: &'a Volume,
    /// Opacities are 0 to this.
    max_opacity: f64,
    points: Vec<ControlPoint>,
}

impl<'a> Points<'a> {
    fn new(random: &'a mut Random, volume: &'a Volume) -> Self {
        let max_opacity = match random.unit() {
            u if u < 0.3 => 1.0,
            u if u < 0.6 => random.within(0.1, 1.0),
            _ => random.decades(-3.0, -0.5),
        };
        Self { random, volume, max_opacity, points: Vec::new() }
    }

    fn push(&mut self, value: f64, opacity: f64) {
        let color = self.random.color();
        self.points.push(ControlPoint { value, color, opacity });
    }

    /// None, some or all there may be.
    fn opacity(&mut self) -> f64 {
        match self.random.unit() {
            u if u < 0.3 => 0.0,
            u if u < 0.8 => self.max_opacity * self.random.unit(),
            _ => self.max_opacity,
        }
    }

    /// A value that matters; of whole numbers often one of them, or the middle of two.
    fn value(&mut self) -> f64 {
        let [low, high] = self.volume.core;
        let value = self.random.within(low, high);
        match self.random.whole(0, 3) {
            0 if is_whole(self.volume.grid.sample_type()) => value.round(),
            1 if is_whole(self.volume.grid.sample_type()) => value.floor() + 0.5,
            _ => value,
        }
    }

    fn ramps(&mut self) {
        for _ in 0..self.random.whole(2, 8) {
            let (value, opacity) = (self.value(), self.opacity());
            self.push(value, opacity);
        }
        if self.random.chance(0.5) {
            let [low, high] = self.volume.core;
            let opacity = self.opacity();
            self.push(low, 0.0);
            self.push(high, opacity);
        }
    }

    fn steps(&mut self) {
        for _ in 0..self.random.whole(1, 6) {
            let (value, below, above) = (self.value(), self.opacity(), self.opacity());
            self.push(value, below);
            self.push(value, above);
        }
    }

    fn comb(&mut self) {
        let [low, high] = self.volume.core;
        let teeth = self.random.whole(5, MAX_POINTS / 4);
        let width = (high - low) / teeth as f64;
        let share = self.random.within(0.05, 0.9);
        for tooth in 0..teeth {
            let start = low + tooth as f64 * width;
            let opacity = self.opacity();
            for (at, opacity) in [(0.0, 0.0), (0.0, opacity), (share, opacity), (share, 0.0)] {
                self.push(start + at * width, opacity);
            }
        }
    }

    fn spikes(&mut self) {
        for _ in 0..self.random.whole(1, 4) {
            let (middle, step) =
                if self.random.chance(0.5) { self.step_of_values() } else { self.step_in_a_cell() };
            let half = step * self.random.decades(-2.0, 0.0) / 2.0;
            let (opacity, is_box) = (self.max_opacity, self.random.chance(0.5));
            self.push(middle - half, 0.0);
            if is_box {
                self.push(middle - half, opacity);
                self.push(middle + half, opacity);
            } else {
                self.push(middle, opacity);
            }
            self.push(middle + half, 0.0);
        }
    }

    /// A value that matters and the step of the data: 1 of whole numbers, else 1/256 of what matters.
    fn step_of_values(&mut self) -> (f64, f64) {
        let [low, high] = self.volume.core;
        let step = if is_whole(self.volume.grid.sample_type()) { 1.0 } else { (high - low) / 256.0 };
        (self.value(), step)
    }

    /// A value in some cell and how far the samples around it are apart, as far as they matter.
    fn step_in_a_cell(&mut self) -> (f64, f64) {
        let grid = &self.volume.grid;
        let cell = grid.dims().map(|n| self.random.whole(0, n - 2));
        let [low, high] = cell_range(grid, cell, self.volume.core);
        if low < high { (self.random.within(low, high), high - low) } else { self.step_of_values() }
    }
}

/// Smallest and largest of the eight samples around a cell, cut to what matters; empty where one is blank.
fn cell_range(grid: &VoxelGrid, cell: [usize; 3], core: [f64; 2]) -> [f64; 2] {
    let corner = |bits: usize| {
        let at = std::array::from_fn(|axis| cell[axis] + (bits >> axis & 1));
        grid.samples().value(grid.index(at), 0)
    };
    (0..8).map(corner).fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
        let value = value.clamp(core[0], core[1]);
        [low.min(value), high.max(value)]
    })
}

/// Spacings from 1e-6 to 1e6, up to ten times as wide along one axis as along another; powers of two where
/// positions shall be exact.
pub(crate) fn spacing(random: &mut Random, exact: bool) -> (&'static str, DVec3) {
    if random.chance(0.45) {
        return ("1", DVec3::ONE);
    }
    let scale = random.decades(-6.0, 6.0);
    let spacing = DVec3::from_array(std::array::from_fn(|_| scale * random.decades(0.0, 1.0)));
    ("1e-6 to 1e6", if exact { spacing.map(|d| d.log2().floor().exp2()) } else { spacing })
}
