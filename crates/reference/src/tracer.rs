//! Rays through the cells of a grid, exactly: which cells, from where to where.
//!
//! The walk is that of Amanatides and Woo ("A fast voxel traversal algorithm for ray tracing", Eurographics
//! 1987), with one change: the distance to a face is computed from the face's own index each time, never
//! summed up, so rounding does not grow with the number of cells, and both cells at a face have it at the
//! same distance. Distances count from where the ray enters the domain, so a far eye costs no digits. Blocks of cells whose samples are all transparent are crossed in one step.

use glam::DVec3;
use rayon::prelude::*;
use volery_scene::{Ray, Sample, Samples, TransferFunction, TriangleMesh, VoxelGrid, for_samples};

use crate::cell::{self, Corners};
use crate::integral::{Integrator, Light, OPAQUE, PIECE_TOLERANCE, add_constant};
use crate::render::Error;
use crate::transfer::{Band, Bands};

/// Cells per axis of a block that is skipped as one.
const BLOCK: usize = 8;

/// Ways through a cell, in units of samples, that may be no more than the rounding of the places where they end.
const SLIVER: f64 = 1e-12;

/// Rounding of distances to the domain, relative to them.
const FAR_ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Everything that is the same for all rays: the grid, the transfer function, and where there is matter.
#[derive(Debug)]
pub struct Tracer<'a> {
    grid: &'a VoxelGrid,
    bands: Bands,
    num_cells: [usize; 3],
    num_blocks: [usize; 3],
    /// Per block, x fastest: whether some value between its least and greatest sample is not transparent.
    holds_matter: Vec<bool>,
    tolerance: f64,
    meshes: &'a [TriangleMesh],
}

/// The way of a ray through the domain: `origin + t * direction`, in units of samples, for `t` from `start`
/// to `end`. `t` is in world units and about 0 where the ray enters.
struct Way {
    origin: DVec3,
    direction: DVec3,
    start: f64,
    end: f64,
}

impl Way {
    /// The distance of plane `index` across an axis that the ray is not parallel to.
    fn to_plane(&self, axis: usize, index: usize) -> f64 {
        (index as f64 - self.origin[axis]) / self.direction[axis]
    }

    /// The distance at which the ray leaves the range of cells `[first, end)` across an axis.
    fn to_leave(&self, axis: usize, first: usize, end: usize) -> f64 {
        if self.direction[axis] > 0.0 {
            self.to_plane(axis, end)
        } else if self.direction[axis] < 0.0 {
            self.to_plane(axis, first)
        } else {
            f64::INFINITY
        }
    }

    fn at(&self, t: f64) -> DVec3 {
        self.origin + self.direction * t
    }
}

/// From where to where `origin + t * direction` is in the box `[0, last]`, for `t` from `start` on: where it is not,
/// the second number is below the first. `None` beside the box, which is closed.
fn inside(origin: DVec3, direction: DVec3, last: DVec3, mut start: f64) -> Option<[f64; 2]> {
    let mut end = f64::INFINITY;
    for axis in 0..3 {
        let (from, along) = (origin[axis], direction[axis]);
        if along == 0.0 {
            if !(0.0..=last[axis]).contains(&from) {
                return None;
            }
        } else {
            let (near, far) = if along > 0.0 { (0.0, last[axis]) } else { (last[axis], 0.0) };
            start = start.max((near - from) / along);
            end = end.min((far - from) / along);
        }
    }
    (start.is_finite() && end.is_finite()).then_some([start, end])
}

/// The axis of the least of three numbers, the first of equals.
fn least_axis(t: [f64; 3]) -> usize {
    if t[0] <= t[1] && t[0] <= t[2] {
        0
    } else if t[1] <= t[2] {
        1
    } else {
        2
    }
}

impl<'a> Tracer<'a> {
    /// Prepares to trace rays through `grid` as `transfer` shows it.
    ///
    /// # Errors
    /// When the samples are colours.
    pub fn new(grid: &'a VoxelGrid, transfer: &TransferFunction) -> Result<Self, Error> {
        if grid.sample_type().channels() > 1 {
            return Err(Error::ColorSamples { found: grid.sample_type() });
        }
        let bands = Bands::new(transfer);
        let num_cells = grid.dims().map(|n| n - 1);
        let num_blocks = num_cells.map(|n| n.div_ceil(BLOCK));
        let holds_matter = for_samples!(
            grid.samples(),
            |values| blocks_with_matter(values, grid, num_blocks, &bands);
            color _ => Vec::new()
        );
        let tolerance = PIECE_TOLERANCE;
        Ok(Self { grid, bands, num_cells, num_blocks, holds_matter, tolerance, meshes: &[] })
    }

    /// The same with another tolerance than [`PIECE_TOLERANCE`] for each interval of a ray. Below 1e-15, where
    /// the rounding of `f64` begins, it counts as 1e-15.
    #[must_use]
    pub fn with_tolerance(self, tolerance: f64) -> Self {
        Self { tolerance: tolerance.max(1e-15), ..self }
    }

    /// The same with opaque surfaces among the matter: a ray ends at the nearest. Pictures show them, single rays do
    /// not.
    #[must_use]
    pub fn among(self, meshes: &'a [TriangleMesh]) -> Self {
        Self { meshes, ..self }
    }

    pub(crate) fn meshes(&self) -> &'a [TriangleMesh] {
        self.meshes
    }

    /// The light that comes along a ray to its origin.
    pub fn trace(&self, ray: &Ray) -> Light {
        self.trace_to(ray, f64::INFINITY)
    }

    /// The light that comes from the first part of a ray, up to a distance from its origin: that in front of
    /// something opaque there.
    pub fn trace_to(&self, ray: &Ray, distance: f64) -> Light {
        let Some(way) = self.clip(ray, distance) else { return Light::CLEAR };
        match self.grid.samples() {
            Samples::Rgb8(_) | Samples::Rgba8(_) => Light::CLEAR,
            samples => for_samples!(samples, |values| self.walk(values, &way); color _ => Light::CLEAR),
        }
    }

    /// The part of a ray inside the domain and before a distance, if it has a length.
    fn clip(&self, ray: &Ray, distance: f64) -> Option<Way> {
        if self.num_cells.contains(&0) {
            return None;
        }
        let spacing = self.grid.spacing();
        let [entry, exit] = inside(ray.origin, ray.direction, self.grid.extent(), 0.0)?;
        // From afar both are coarse: whether there is something in between is decided below.
        if entry - exit > FAR_ROUNDING * entry {
            return None;
        }
        // One rounding, of a point in the domain: a far eye costs no digits across the ray; those it costs in
        // `entry` only shift the zero of `t`.
        let near = |axis: usize| ray.direction[axis].mul_add(entry, ray.origin[axis]) / spacing[axis];
        let last = self.num_cells.map(|n| n as f64);
        let origin = [0, 1, 2].map(|axis| match ray.direction[axis] {
            // In the domain to the last bit, hence in its cells.
            0.0 => near(axis).clamp(0.0, last[axis]),
            _ => near(axis),
        });
        let (origin, last) = (DVec3::from_array(origin), DVec3::from_array(last));
        let direction = ray.direction / spacing;
        let [start, end] = inside(origin, direction, last, -entry)?;
        let end = end.min(distance - entry);
        (start < end).then_some(Way { origin, direction, start, end })
    }

    fn walk<T: Sample>(&self, values: &[T], way: &Way) -> Light {
        let mut light = Light::CLEAR;
        let mut t = way.start;
        let point = way.at(t);
        let mut cell = [0, 1, 2].map(|axis| (point[axis].max(0.0) as usize).min(self.num_cells[axis] - 1));
        loop {
            let block = cell.map(|c| c / BLOCK);
            let skip = !self.holds_matter[self.block_index(block)];
            // The box of cells to cross in one step: the block, or this cell.
            let first = if skip { block.map(|b| b * BLOCK) } else { cell };
            let end: [usize; 3] = std::array::from_fn(|axis| {
                if skip { (first[axis] + BLOCK).min(self.num_cells[axis]) } else { cell[axis] + 1 }
            });
            let leave = [0, 1, 2].map(|axis| way.to_leave(axis, first[axis], end[axis]));
            let axis = least_axis(leave);
            let next = leave[axis].min(way.end).max(t);
            if skip {
                let point = way.at(next);
                for other in (0..3).filter(|&other| other != axis) {
                    cell[other] = (point[other].max(0.0) as usize).clamp(first[other], end[other] - 1);
                }
            } else if next > t {
                self.cross(values, way, cell, [t, next], &mut light);
                if light.transmittance <= OPAQUE {
                    return light;
                }
            }
            if next >= way.end {
                return light;
            }
            if way.direction[axis] > 0.0 {
                cell[axis] = end[axis];
                if end[axis] == self.num_cells[axis] {
                    return light;
                }
            } else {
                if first[axis] == 0 {
                    return light;
                }
                cell[axis] = first[axis] - 1;
            }
            t = next;
        }
    }

    fn block_index(&self, block: [usize; 3]) -> usize {
        (block[2] * self.num_blocks[1] + block[1]) * self.num_blocks[0] + block[0]
    }

    /// Adds the light of one cell, which the ray crosses from `t[0]` to `t[1]`.
    fn cross<T: Sample>(&self, values: &[T], way: &Way, cell: [usize; 3], t: [f64; 2], light: &mut Light) {
        let corners = corners(values, self.grid, cell);
        // A blank cell holds no matter.
        let Some([low, high]) = cell::range(&corners) else { return };
        let bands = self.bands.of_range(low, high);
        if bands.iter().all(Band::is_clear) {
            return;
        }
        let base = DVec3::from_array(cell.map(|c| c as f64));
        // Places are known to a hair, and beside an outlier the field a hair from a face is nothing like that on it.
        let on_faces = |place: DVec3| {
            DVec3::select((place - place.round()).abs().cmple(DVec3::splat(SLIVER)), place.round(), place)
        };
        let local = |t: f64| on_faces((way.at(t) - base).clamp(DVec3::ZERO, DVec3::ONE));
        let length = (t[1] - t[0]) / self.bands.unit_distance();
        if low == high {
            return add_constant(light, &self.bands.at(0.0, low), length);
        }
        let [enter, exit] = t.map(local);
        let base = cell::base_near(&corners, enter, exit, |value| self.bands.beyond_edges(value));
        let field = cell::along(&corners, base, enter, exit);
        let is_sliver = (exit - enter).abs().max_element() <= SLIVER;
        let integrator = Integrator { bands: &self.bands, tolerance: self.tolerance, is_sliver };
        integrator.add(light, &field, base, length);
    }
}

/// The samples around a cell.
fn corners<T: Sample>(values: &[T], grid: &VoxelGrid, cell: [usize; 3]) -> Corners {
    let [nx, ny, _] = grid.dims();
    let first = grid.index(cell);
    let offsets = [0, 1, nx, nx + 1, nx * ny, nx * ny + 1, nx * ny + nx, nx * ny + nx + 1];
    offsets.map(|offset| values[first + offset].channel(0))
}

fn blocks_with_matter<T: Sample>(
    values: &[T],
    grid: &VoxelGrid,
    num_blocks: [usize; 3],
    bands: &Bands,
) -> Vec<bool> {
    let dims = grid.dims();
    let holds_matter = |index: usize| {
        let block = [
            index % num_blocks[0],
            index / num_blocks[0] % num_blocks[1],
            index / num_blocks[0] / num_blocks[1],
        ];
        // Samples on the faces belong to the blocks on both sides.
        let [xs, ys, zs] = [0, 1, 2].map(|axis| {
            let first = block[axis] * BLOCK;
            first..(first + BLOCK + 1).min(dims[axis])
        });
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        for z in zs {
            for y in ys.clone() {
                let row = grid.index([xs.start, y, z]);
                for value in &values[row..row + xs.len()] {
                    let value = value.channel(0);
                    if value.is_finite() {
                        range = [range[0].min(value), range[1].max(value)];
                    }
                }
            }
        }
        range[0] <= range[1] && !bands.of_range(range[0], range[1]).iter().all(Band::is_clear)
    };
    (0..num_blocks.iter().product()).into_par_iter().map(holds_matter).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integral::NUM_INTERVALS;
    use volery_scene::ControlPoint;

    /// Intervals for rays all over noise between `offset` and `offset + span`.
    fn work(offset: f64, span: f64) -> u64 {
        let values: Vec<f64> = (0..512)
            .map(|i| offset + span * ((volery_data::hash(i) >> 11) as f64 / (1u64 << 53) as f64))
            .collect();
        let grid = VoxelGrid::new([8; 3], DVec3::ONE, values).unwrap();
        let points = [(0.1, 0.0), (0.5, 0.1), (0.5, 0.3), (0.7, 1.0), (0.995, 0.4)]
            .map(|(w, opacity)| ControlPoint { value: offset + span * w, color: [w, 1.0 - w, 0.5], opacity });
        let transfer = TransferFunction::new(points.to_vec(), 40.0).unwrap();
        let tracer = Tracer::new(&grid, &transfer).unwrap();
        NUM_INTERVALS.set(0);
        for i in 0..256 {
            let origin = DVec3::new(f64::from(i % 16) * 0.45, f64::from(i / 16) * 0.45, -9.0);
            tracer.trace(&Ray { origin, direction: DVec3::new(0.1, 0.03, 1.0).normalize() });
        }
        NUM_INTERVALS.get()
    }

    #[test]
    fn an_offset_costs_no_more_intervals_however_large() {
        let twin = work(0.0, 1.0);
        assert!(twin > 10_000, "{twin} intervals");
        for (offset, span) in
            [(1e6, 1e-2), (1e6, 1e-3), (1e9, 1.0), (4e9, 200.0), (-1e9, 1.0), (1e12, 1.0), (1e15, 100.0)]
        {
            let shifted = work(offset, span);
            println!("{offset:e} + [0, {span:e}]: {shifted} intervals, {twin} without offset");
            assert!(
                shifted * 2 <= twin * 3,
                "{offset:e} + [0, {span:e}]: {shifted} intervals, {twin} without"
            );
        }
    }
}
