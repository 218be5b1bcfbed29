//! Cuts of several levels without seams.
//!
//! The oracle knows no directions and no means of neighbours: *every sample shows the coarsest field that touches it*.
//! In a balanced cut that is what seams amount to.

use std::cell::RefCell;
use std::collections::HashMap;

use glam::{DVec3, UVec3};
use volery_frame::{Backend, JoinedBrick, PlacedBrick, TexelType};
use volery_scene::{Camera, Projection};

use super::oracle::{Medium, assert_close, assert_shows_something, march};
use super::world::{
    BACKGROUND_F64, OwnedBrick, Storage, Volume, draw_joined, hold, smooth_transfer, transfer,
};

/// Cells of a brick.
const BRICK: u32 = 4;

/// Values between which the field of a cut lies.
fn noise(at: DVec3) -> f64 {
    let mixed = at.to_array().iter().fold(0x9e37_79b9_7f4a_7c15_u64, |hash, &x| {
        (hash ^ (x as i64 as u64)).wrapping_mul(0xbf58_476d_1ce4_e5b9).rotate_left(29)
    });
    (mixed >> 40) as f64 / (1_u64 << 24) as f64
}

/// A smooth field with a share of noise. Where a coarse level reaches beyond the domain the last sample counts, as in a
/// pyramid.
fn volume(dims: [u32; 3], storage: Storage, noisy: f64) -> Volume {
    let last = UVec3::from_array(dims).as_dvec3() - 1.0;
    Volume::new(dims, DVec3::ONE, storage, move |at| {
        let at = at.min(last);
        let smooth = 0.5 + 0.45 * ((0.35 * at.x).sin() * (0.3 * at.y + 1.0).cos() * (0.27 * at.z).sin());
        smooth + noisy * (noise(at) - smooth)
    })
}

/// A balanced cut: fine around some places.
fn bricks(volume: &Volume, camera: &Camera, finest: &[DVec3]) -> Vec<OwnedBrick> {
    volume.cut(camera, |level, first| {
        let size = f64::from(BRICK << level);
        let middle = UVec3::from_array(first).as_dvec3() + 0.5 * size;
        // Farther than its own size from the box: then no neighbour is finer by two.
        finest.iter().any(|&place| ((place - middle).abs().max_element() - 0.5 * size) < 1.01 * size)
    })
}

/// Closed bounds of a whole node.
fn bounds(placed: &PlacedBrick) -> [DVec3; 2] {
    let first = UVec3::from_array(placed.first_cell).as_dvec3();
    [first, first + f64::from(BRICK << placed.level)]
}

/// The seams of bricks: faces and edges that lie in a coarser brick.
fn joined(bricks: &[OwnedBrick]) -> Vec<JoinedBrick> {
    let seam = |brick: &PlacedBrick, direction: u32| {
        let [low, high] = bounds(brick);
        let side = DVec3::from_array([1, 3, 9].map(|scale| f64::from(direction / scale % 3) - 1.0));
        let from = DVec3::select(side.cmpgt(DVec3::ZERO), high, low);
        let to = DVec3::select(side.cmplt(DVec3::ZERO), low, high);
        let holds = |other: &OwnedBrick| {
            let [a, b] = bounds(&other.placed);
            other.placed.level > brick.level && a.cmple(from).all() && b.cmpge(to).all()
        };
        direction != 13 && bricks.iter().any(holds)
    };
    let joined = bricks.iter().map(|brick| {
        let seams = (0..27).filter(|&direction| seam(&brick.placed, direction));
        JoinedBrick { placed: brick.placed, seams: seams.fold(0, |bits, direction| bits | 1 << direction) }
    });
    joined.collect()
}

/// The field of a cut.
struct Field<'a> {
    volume: &'a Volume,
    bricks: Vec<PlacedBrick>,
    samples: RefCell<HashMap<[u32; 3], f64>>,
}

impl<'a> Field<'a> {
    fn new(volume: &'a Volume, bricks: &[OwnedBrick]) -> Self {
        let bricks = bricks.iter().map(|brick| brick.placed).collect();
        Self { volume, bricks, samples: RefCell::default() }
    }

    /// The field of a brick at a place in it, each of whose samples has a value.
    fn interpolated(brick: &PlacedBrick, place: DVec3, value: impl Fn([u32; 3]) -> f64) -> f64 {
        let step = 1_u32 << brick.level;
        let local = (place - bounds(brick)[0]) / f64::from(step);
        let cell = local.floor().clamp(DVec3::ZERO, DVec3::splat(f64::from(BRICK - 1)));
        let w = local - cell;
        let mut sum = 0.0;
        for corner in 0..8_u32 {
            let upper = UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2 & 1);
            let weight: DVec3 = DVec3::select(upper.cmpeq(UVec3::ONE), w, 1.0 - w);
            let at = UVec3::from_array(brick.first_cell) + (cell.as_uvec3() + upper) * step;
            let weight = weight.element_product();
            sum += if weight == 0.0 { 0.0 } else { weight * value(at.to_array()) };
        }
        sum
    }

    /// A sample: the coarsest field that touches it.
    fn sample(&self, at: [u32; 3]) -> f64 {
        if let Some(&value) = self.samples.borrow().get(&at) {
            return value;
        }
        let place = UVec3::from_array(at).as_dvec3();
        let touches = |brick: &&PlacedBrick| {
            let [low, high] = bounds(brick);
            low.cmple(place).all() && high.cmpge(place).all()
        };
        let coarsest = self.bricks.iter().filter(touches).max_by_key(|brick| brick.level);
        let brick = coarsest.expect("samples are asked for where a brick is");
        let value = Self::interpolated(brick, place, |at| self.volume.sample(at));
        self.samples.borrow_mut().insert(at, value);
        value
    }

    /// The field at a place, as every brick that touches it has it.
    fn values(&self, place: DVec3) -> impl Iterator<Item = f64> {
        self.bricks.iter().filter_map(move |brick| {
            let [low, high] = bounds(brick);
            let holds = low.cmple(place).all() && high.cmpge(place).all();
            holds.then(|| Self::interpolated(brick, place, |at| self.sample(at)))
        })
    }
}

/// Cuts of up to five levels whose bricks meet in faces, edges and corners: the picture is that of one continuous field.
pub fn levels_join_without_seams(backend: &mut dyn Backend) {
    let tf = smooth_transfer(1.0);
    for (dims, texel) in [([128, 57, 50], TexelType::F32), ([131, 46, 47], TexelType::U8)] {
        let storage = Storage { brick_cells: BRICK, ..Storage::unit(texel) };
        let volume = volume(dims, storage, 0.2);
        let extent = volume.extent();
        let finest = [extent * DVec3::new(0.05, 0.35, 0.4), extent * DVec3::new(0.2, 0.8, 1.0)];
        for is_orthographic in [false, true] {
            let camera = Camera::fitted(extent, 35.0, 25.0, 1.2, is_orthographic);
            let bricks = bricks(&volume, &camera, &finest);
            let levels: Vec<_> =
                (0..5).map(|l| bricks.iter().filter(|b| b.placed.level == l).count()).collect();
            println!("{dims:?} {texel:?}: bricks by level {levels:?}");
            assert!(levels[..4].iter().all(|&num| num > 0), "bricks by level {levels:?}");
            let field = Field::new(&volume, &bricks);
            assert_continuous(&field, extent);
            let value = |place: DVec3| field.values(place).next().unwrap_or(f64::NAN);
            let medium = Medium { extent, step: 1.0 / 8.0, transfer: &tf, value: &value };
            let expected = march(&medium, &camera, [40, 32], BACKGROUND_F64);
            assert_shows_something("levels", &expected, BACKGROUND_F64);
            hold(backend, &volume, &bricks);
            let found = draw_joined(backend, &volume, &tf, &camera, [40, 32], &joined(&bricks));
            assert_close(&format!("levels of {dims:?} {texel:?}"), &found, &expected, 0.01, 0.002);
        }
    }
}

/// The oracle itself, at places where bricks meet.
fn assert_continuous(field: &Field<'_>, extent: DVec3) {
    let (mut worst, mut num) = (0.0_f64, 0);
    for i in 0..40_000_u32 {
        let random = |salt: u32| noise(DVec3::new(f64::from(i), f64::from(salt), 7.0));
        let place = DVec3::new(random(1), random(2), random(3)) * extent;
        // On one, two or three planes between bricks.
        let on_plane = |axis: u32| i >> axis & 1 == 1 || axis == i % 3;
        let plane = (place / f64::from(BRICK)).round() * f64::from(BRICK);
        let place = DVec3::from_array(std::array::from_fn(|axis| {
            if on_plane(axis as u32) { plane[axis].min(extent[axis]) } else { place[axis] }
        }));
        let values: Vec<f64> = field.values(place).collect();
        if values.len() > 1 {
            num += 1;
            worst = values.iter().fold(worst, |worst, value| worst.max((value - values[0]).abs()));
        }
    }
    println!("oracle: largest jump {worst:.1e} at {num} places (threshold 1e-12)");
    assert!(worst < 1e-12 && num > 10_000, "jump {worst:e} at {num} places");
}

/// Rays a hair to either side of planes and lines where levels meet, all the way along them: no jump of the field above
/// 1e-5 of its range.
pub fn levels_do_not_jump(backend: &mut dyn Backend) {
    // What matter emits is its value; it takes little from what is behind.
    let tf = transfer(&[[0.0, 0.0, 0.0, 0.0, 0.02], [1.0, 1.0, 1.0, 1.0, 0.02]], 1.0);
    let light = 1.0 - 0.98_f64.powi(49);
    for texel in [TexelType::F32, TexelType::U16] {
        let storage = Storage { brick_cells: BRICK, ..Storage::unit(texel) };
        let volume = volume([128, 57, 50], storage, 0.2);
        let extent = volume.extent();
        let finest = [extent * DVec3::new(0.05, 0.35, 0.4), extent * DVec3::new(0.2, 0.8, 1.0)];
        let [mut worst, mut without, mut fine] = [0.0_f64; 3];
        let mut all = volume.bricks(&Camera::fitted(extent, 35.0, 25.0, 1.2, false));
        all.extend(bricks(&volume, &Camera::fitted(extent, 35.0, 25.0, 1.2, false), &finest));
        all.sort_by_key(|brick| brick.placed.id);
        all.dedup_by_key(|brick| brick.placed.id);
        hold(backend, &volume, &all);
        for line in 0..60_u32 {
            let (along, across) = (line % 3, (line + 1) % 3);
            let random = |salt: u32| noise(DVec3::new(f64::from(line), f64::from(salt), 3.0));
            let mut place = DVec3::new(random(1), random(2), random(3)) * extent;
            let plane =
                (place / f64::from(BRICK)).round().clamp(DVec3::ONE, DVec3::splat(11.0)) * f64::from(BRICK);
            place[across as usize] = plane[across as usize];
            let other = 3 - along as usize - across as usize;
            if line % 2 == 0 {
                place[other] = plane[other];
            }
            let axis = |axis: usize| DVec3::AXES[axis];
            // A ray that stands still along an axis is taken into the plane that it is nearest to; these do not.
            let forward = axis(along as usize) + 1e-8 * axis(across as usize) + 1e-8 * axis(other);
            let camera = Camera {
                eye: place - forward * (place[along as usize] + 1.0),
                target: place,
                up: axis(across as usize),
                projection: Projection::Orthographic { height: 1.2e-5 },
                is_mirrored: false,
            };
            let bricks = bricks(&volume, &camera, &finest);
            let jump = |joined: &[JoinedBrick], backend: &mut dyn Backend| {
                let picture = draw_joined(backend, &volume, &tf, &camera, [2, 2], joined);
                let values = picture.pixels.iter().map(|pixel| f64::from(pixel[0]));
                values.clone().fold(0.0, f64::max) - values.fold(f64::INFINITY, f64::min)
            };
            let joined = joined(&bricks);
            worst = worst.max(jump(&joined, backend) / light);
            let apart: Vec<_> = joined.iter().map(|brick| brick.placed.into()).collect();
            without = without.max(jump(&apart, backend) / light);
            let full: Vec<_> = volume.bricks(&camera).iter().map(|brick| brick.placed.into()).collect();
            fine = fine.max(jump(&full, backend) / light);
        }
        println!(
            "{texel:?}: largest jump {worst:.1e} (threshold 1e-5), without seams {without:.1e}, of one level {fine:.1e}"
        );
        assert!(worst <= 1e-5, "jump {worst:e}");
        assert!(without > 1e-3, "nothing jumps without seams: {without:e}");
    }
}
