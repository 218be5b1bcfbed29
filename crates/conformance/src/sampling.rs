//! How values are stored and where samples lie: spacings, dims, texel types, scales, blanks.

use glam::DVec3;
use volery_scene::Camera;

use volery_frame::{Backend, Image, TexelType};

use super::oracle::{assert_background, assert_close, assert_shows_something, march_volume};
use super::world::{
    BACKGROUND, BACKGROUND_F64, Storage, Volume, draw, marschner_lobb, smooth_transfer, transfer,
};

const SIZE: [u32; 2] = [40, 32];

fn rings(dims: [u32; 3], spacing: DVec3, storage: Storage) -> Volume {
    Volume::new(dims, spacing, storage, marschner_lobb(dims.map(|n| n - 1)))
}

fn assert_like_the_march(backend: &mut dyn Backend, what: &str, volume: &Volume) -> Image {
    let tf = smooth_transfer(volume.layout.spacing.min_element());
    let camera = Camera::fitted(volume.extent(), 35.0, 25.0, 1.2, false);
    let expected = march_volume(volume, &tf, 24.0, &camera, SIZE, BACKGROUND_F64);
    assert_shows_something(what, &expected, BACKGROUND_F64);
    let image = draw(backend, volume, &tf, &camera, SIZE);
    assert_close(what, &image, &expected, 0.01, 0.002);
    image
}

/// Cells of 1e-6 world units.
pub fn tiny_spacing(backend: &mut dyn Backend) {
    let volume = rings([21, 18, 19], DVec3::splat(1e-6), Storage::F32);
    assert_like_the_march(backend, "spacing 1e-6", &volume);
}

/// Cells of 1e6 world units.
pub fn huge_spacing(backend: &mut dyn Backend) {
    let volume = rings([21, 18, 19], DVec3::splat(1e6), Storage::F32);
    assert_like_the_march(backend, "spacing 1e6", &volume);
}

/// Cells ten times as long along one axis.
pub fn anisotropic_spacing(backend: &mut dyn Backend) {
    for spacing in [DVec3::new(1.0, 1.0, 10.0), DVec3::new(0.3, 3.0, 1.0)] {
        let volume = rings([24, 22, 9], spacing, Storage::F32);
        assert_like_the_march(backend, &format!("spacing {spacing}"), &volume);
    }
}

/// Cells that are no multiple of a brick's, one more, one less, and prime.
pub fn dims_that_bricks_do_not_divide(backend: &mut dyn Backend) {
    for dims in [[18, 17, 16], [10, 9, 8], [30, 12, 24], [8, 38, 3]] {
        let volume = rings(dims, DVec3::ONE, Storage::F32);
        assert_like_the_march(backend, &format!("dims {dims:?}"), &volume);
    }
}

/// One cell thick.
pub fn axes_of_two_samples(backend: &mut dyn Backend) {
    for dims in [[2, 2, 2], [2, 17, 17], [17, 2, 2], [12, 15, 2]] {
        let field = |p: DVec3| 0.5 + 0.25 * ((p.x + 0.5).sin() + (p.y + p.z).cos());
        let storage = Storage::unit(TexelType::U8);
        let volume = Volume::new(dims, DVec3::ONE, storage, field);
        assert_like_the_march(backend, &format!("dims {dims:?}"), &volume);
    }
}

/// Without a cell there is no matter.
pub fn axes_of_one_sample_show_nothing(backend: &mut dyn Backend) {
    for dims in [[1, 1, 1], [1, 17, 17], [17, 1, 2], [12, 15, 1]] {
        let volume = Volume::new(dims, DVec3::ONE, Storage::plain(TexelType::U8), |_| 200.0);
        let tf = transfer(&[[0.0, 1.0, 1.0, 1.0, 1.0]], 1.0);
        let camera = Camera::fitted(DVec3::new(9.0, 9.0, 9.0), 35.0, 25.0, 1.0, false);
        let image = draw(backend, &volume, &tf, &camera, SIZE);
        assert_background(&format!("dims {dims:?}"), &image, BACKGROUND);
    }
}

/// The same integers as u8, u16 and f32 give the same picture.
pub fn texel_types_agree(backend: &mut dyn Backend) {
    let field = marschner_lobb([20, 18, 22]);
    let field = std::sync::Arc::new(move |p| (field(p) * 255.0).round());
    let images = [TexelType::U8, TexelType::U16, TexelType::F32].map(|texel| {
        let field = field.clone();
        let scale = Storage { value_scale: 1.0 / 255.0, ..Storage::plain(texel) };
        let volume = Volume::new([21, 19, 23], DVec3::ONE, scale, move |p| field(p) / 255.0);
        assert_like_the_march(backend, &format!("{texel:?}"), &volume)
    });
    for (texel, image) in [("U16", &images[1]), ("F32", &images[2])] {
        let expected = images[0].pixels.iter().map(|pixel| pixel.map(f64::from)).collect();
        assert_close(&format!("{texel} against U8"), image, &expected, 1e-3, 2e-4);
    }
}

/// Texels are not the values.
pub fn scale_and_offset_of_values(backend: &mut dyn Backend) {
    for (texel, value_scale, value_offset) in
        [(TexelType::U8, 0.005, -0.1), (TexelType::U16, -1e-4, 1.5), (TexelType::F32, 1e-3, 40.0)]
    {
        let storage = Storage { value_scale, value_offset, ..Storage::plain(texel) };
        let volume = rings([20, 17, 19], DVec3::ONE, storage);
        assert_like_the_march(backend, &format!("{texel:?} * {value_scale} + {value_offset}"), &volume);
    }
}

/// Values that are all negative, as CT numbers can be.
pub fn range_of_negative_values(backend: &mut dyn Backend) {
    let field = marschner_lobb([19, 16, 18]);
    let storage = Storage { value_offset: -1024.0, ..Storage::plain(TexelType::U16) };
    let volume =
        Volume::new([20, 17, 19], DVec3::ONE, storage, move |p| (-1000.0 + 900.0 * field(p)).round());
    let points = [
        [-1000.0, 0.0, 0.0, 0.0, 0.0],
        [-700.0, 0.2, 0.4, 0.9, 0.0],
        [-400.0, 0.9, 0.5, 0.3, 0.15],
        [-100.0, 1.0, 1.0, 0.8, 0.3],
    ];
    let tf = transfer(&points, 1.0);
    let camera = Camera::fitted(volume.extent(), 35.0, 25.0, 1.2, false);
    let expected = march_volume(&volume, &tf, 24.0, &camera, SIZE, BACKGROUND_F64);
    assert_shows_something("CT numbers", &expected, BACKGROUND_F64);
    let image = draw(backend, &volume, &tf, &camera, SIZE);
    assert_close("CT numbers", &image, &expected, 0.01, 0.002);
}

/// All samples equal: a value range without width.
pub fn constant_volume(backend: &mut dyn Backend) {
    for texel in [TexelType::U8, TexelType::U16, TexelType::F32] {
        for value in [0.0, 77.0] {
            let volume = Volume::new([11, 10, 12], DVec3::ONE, Storage::plain(texel), move |_| value);
            let tf = transfer(
                &[[-1.0, 0.9, 0.4, 0.2, 0.0], [0.0, 0.9, 0.4, 0.2, 0.1], [200.0, 0.9, 0.4, 0.2, 0.1]],
                1.0,
            );
            let camera = Camera::fitted(volume.extent(), 35.0, 25.0, 1.2, false);
            let expected = march_volume(&volume, &tf, 24.0, &camera, SIZE, BACKGROUND_F64);
            assert_shows_something("constant volume", &expected, BACKGROUND_F64);
            let image = draw(backend, &volume, &tf, &camera, SIZE);
            assert_close(&format!("constant {texel:?} {value}"), &image, &expected, 1e-4, 1e-4);
        }
    }
}

/// A NaN or infinite texel blanks the eight cells that touch it, and no other.
pub fn blank_samples_clear_the_cells_that_touch_them(backend: &mut dyn Backend) {
    let blank = [DVec3::new(5.0, 6.0, 7.0), DVec3::new(8.0, 8.0, 8.0), DVec3::new(16.0, 3.0, 11.0)];
    for hole in [f64::NAN, f64::INFINITY] {
        let volume = Volume::new([18, 17, 19], DVec3::ONE, Storage::F32, move |p| {
            if blank.contains(&p) || p.z == 14.0 && p.x < 9.0 { hole } else { 0.4 + 0.03 * p.x }
        });
        let tf = smooth_transfer(1.0);
        for (azimuth, elevation) in [(35.0, 25.0), (250.0, -50.0)] {
            let camera = Camera::fitted(volume.extent(), azimuth, elevation, 1.2, false);
            let expected = march_volume(&volume, &tf, 64.0, &camera, SIZE, BACKGROUND_F64);
            assert_shows_something("blank samples", &expected, BACKGROUND_F64);
            let image = draw(backend, &volume, &tf, &camera, SIZE);
            assert_close(&format!("blanks of {hole} from {azimuth}"), &image, &expected, 0.01, 0.002);
        }
    }
}

/// Nothing but NaN.
pub fn volume_of_blanks_shows_the_background(backend: &mut dyn Backend) {
    let volume = Volume::new([18, 9, 10], DVec3::ONE, Storage::F32, |_| f64::NAN);
    let tf = transfer(&[[0.0, 1.0, 1.0, 1.0, 1.0]], 1.0);
    let camera = Camera::fitted(volume.extent(), 35.0, 25.0, 1.0, false);
    let image = draw(backend, &volume, &tf, &camera, SIZE);
    assert_background("all blank", &image, BACKGROUND);
}

/// The size of bricks is no part of the picture.
pub fn small_bricks_and_large_ones_agree(backend: &mut dyn Backend) {
    let images = [1, 2, 5, 16, 32, 64].map(|brick_cells| {
        let storage = Storage { brick_cells, ..Storage::unit(TexelType::U8) };
        let volume = rings([13, 11, 12], DVec3::ONE, storage);
        assert_like_the_march(backend, &format!("bricks of {brick_cells} cells"), &volume)
    });
    for image in &images[1..] {
        let expected = images[0].pixels.iter().map(|pixel| pixel.map(f64::from)).collect();
        assert_close("other bricks", image, &expected, 1e-3, 2e-4);
    }
}

/// Bricks so large that a texture may not hold their slices side by side.
pub fn bricks_of_many_cells(backend: &mut dyn Backend) {
    let storage = Storage { brick_cells: 160, ..Storage::unit(TexelType::U8) };
    let volume = rings([30, 12, 170], DVec3::ONE, storage);
    assert_like_the_march(backend, "bricks of 160 cells", &volume);
}
