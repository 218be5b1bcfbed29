//! Cuts of several levels, and cuts that leave space empty.

use glam::DVec3;
use volery_scene::{Camera, Projection};

use volery_frame::Backend;

use super::oracle::{
    Medium, assert_close, assert_shows_something, chord, each_pixel, march, march_volume, over,
};
use super::world::{
    BACKGROUND_F64, OwnedBrick, Storage, Volume, draw, draw_bricks, marschner_lobb, smooth_transfer, transfer,
};

const SIZE: [u32; 2] = [40, 32];

fn ramp(dims: [u32; 3]) -> Volume {
    let slope = DVec3::new(0.012, 0.009, 0.011);
    Volume::new(dims, DVec3::ONE, Storage::F32, move |p| 0.3 + p.dot(slope))
}

fn cameras(extent: DVec3) -> [Camera; 3] {
    let inside = Camera {
        eye: extent * DVec3::new(0.4, 0.45, 0.5),
        target: extent,
        up: DVec3::Z,
        projection: Projection::Perspective { fov_y_deg: 80.0 },
        is_mirrored: false,
    };
    [Camera::fitted(extent, 35.0, 25.0, 1.2, false), Camera::fitted(extent, 215.0, -30.0, 1.2, true), inside]
}

/// Samples of a linear ramp are exact at every level, so that every cut shows the same picture.
pub fn ramp_is_the_same_in_mixed_levels(backend: &mut dyn Backend) {
    let volume = ramp([33, 33, 33]);
    let tf = smooth_transfer(1.0);
    for camera in cameras(volume.extent()) {
        let expected = march_volume(&volume, &tf, 24.0, &camera, SIZE, BACKGROUND_F64);
        assert_shows_something("ramp", &expected, BACKGROUND_F64);
        let mixed = volume.cut(&camera, |level, first| level == 2 || first[0] + first[1] == first[2]);
        assert!(mixed.iter().any(|b| b.placed.level == 0) && mixed.iter().any(|b| b.placed.level == 1));
        let image = draw_bricks(backend, &volume, &tf, &camera, SIZE, &mixed);
        assert_close("ramp in levels 0 and 1", &image, &expected, 2e-3, 5e-4);
        let root = volume.cut(&camera, |_, _| false);
        assert!(root.len() == 1 && root[0].placed.level == 2);
        let image = draw_bricks(backend, &volume, &tf, &camera, SIZE, &root);
        assert_close("ramp in level 2", &image, &expected, 8e-3, 2e-3);
    }
}

/// The last sample of a coarse brick may lie past the domain; the brick is drawn up to the domain's end.
pub fn coarse_bricks_end_with_the_domain(backend: &mut dyn Backend) {
    let tf = smooth_transfer(1.0);
    for dims in [[30, 23, 28], [12, 31, 18], [10, 3, 2]] {
        let volume = ramp(dims);
        for camera in cameras(volume.extent()) {
            let expected = march_volume(&volume, &tf, 24.0, &camera, SIZE, BACKGROUND_F64);
            assert_shows_something("ramp", &expected, BACKGROUND_F64);
            for top in 0..=2 {
                let cut = volume.cut(&camera, |level, _| level > top);
                let image = draw_bricks(backend, &volume, &tf, &camera, SIZE, &cut);
                let what = format!("ramp {dims:?} in levels up to {top}");
                assert_close(&what, &image, &expected, 2e-3, 5e-4);
            }
        }
    }
}

/// A coarse brick shows the trilinear field of its own samples.
pub fn coarse_levels_draw_what_they_hold(backend: &mut dyn Backend) {
    let field = marschner_lobb([32, 24, 28]);
    let volume = Volume::new([33, 25, 29], DVec3::ONE, Storage::F32, field);
    // The same samples as a volume of its own, twice as far apart.
    let field = marschner_lobb([32, 24, 28]);
    let coarse = Volume::new([17, 13, 15], DVec3::splat(2.0), Storage::F32, move |p| field(p * 2.0));
    let tf = smooth_transfer(1.0);
    for camera in cameras(volume.extent()) {
        let medium = Medium {
            extent: volume.extent(),
            step: 1.0 / 24.0,
            transfer: &tf,
            value: &|position| coarse.trilinear(position / 2.0),
        };
        let expected = march(&medium, &camera, SIZE, BACKGROUND_F64);
        assert_shows_something("level 1", &expected, BACKGROUND_F64);
        let cut = volume.cut(&camera, |level, _| level > 1);
        let image = draw_bricks(backend, &volume, &tf, &camera, SIZE, &cut);
        assert_close("level 1 of a smooth field", &image, &expected, 0.01, 0.002);
        let image = draw(backend, &coarse, &tf, &camera, SIZE);
        assert_close("the same as a volume of its own", &image, &expected, 0.01, 0.002);
    }
}

/// Space that no brick covers holds no matter.
pub fn absent_bricks_are_empty(backend: &mut dyn Backend) {
    let volume = Volume::new([33, 25, 25], DVec3::ONE, Storage::F32, |_| 0.5);
    let tf = transfer(&[[0.0, 0.9, 0.4, 0.2, 0.05]], 1.0);
    let depth = -(-0.05_f64).ln_1p();
    for camera in cameras(volume.extent()) {
        let is_kept = |b: &OwnedBrick| b.placed.first_cell.iter().sum::<u32>() % 16 == 8;
        let kept: Vec<_> = volume.bricks(&camera).into_iter().filter(is_kept).collect();
        let expected = each_pixel(&camera, SIZE, |ray| {
            let lengths = kept.iter().filter_map(|brick| {
                let low = DVec3::from_array(brick.placed.first_cell.map(f64::from));
                chord(ray, low, (low + 8.0).min(volume.extent())).map(|[from, to]| to - from)
            });
            over([0.9, 0.4, 0.2], depth * lengths.sum::<f64>(), BACKGROUND_F64)
        });
        assert_shows_something("every second brick", &expected, BACKGROUND_F64);
        let image = draw_bricks(backend, &volume, &tf, &camera, SIZE, &kept);
        assert_close("every second brick", &image, &expected, 5e-5, 2e-5);
    }
}

/// A brick with fewer samples than its place could hold draws the cells that it has.
pub fn short_bricks_leave_their_rest_empty(backend: &mut dyn Backend) {
    let volume = Volume::new([17, 9, 9], DVec3::ONE, Storage::F32, |_| 0.5);
    let short = Volume::new([6, 4, 9], DVec3::ONE, Storage::F32, |_| 0.5);
    let tf = transfer(&[[0.0, 0.9, 0.4, 0.2, 0.05]], 1.0);
    let depth = -(-0.05_f64).ln_1p();
    for camera in cameras(volume.extent()) {
        let expected = each_pixel(&camera, SIZE, |ray| {
            let length = chord(ray, DVec3::ZERO, short.extent()).map_or(0.0, |[from, to]| to - from);
            over([0.9, 0.4, 0.2], depth * length, BACKGROUND_F64)
        });
        let image = draw_bricks(backend, &volume, &tf, &camera, SIZE, &short.bricks(&camera));
        assert_close("short brick", &image, &expected, 5e-5, 2e-5);
    }
}
