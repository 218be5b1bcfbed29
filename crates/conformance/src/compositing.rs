//! Accumulation along a ray: thousands of thin layers, dense matter, the background behind.

use glam::DVec3;
use volery_scene::{Camera, Projection};

use volery_frame::{Backend, TexelType};

use super::STOP_TRANSMITTANCE;
use super::oracle::{assert_close, assert_shows_something, march_volume};
use super::world::{BACKGROUND_F64, Storage, Volume, draw, transfer};

/// Four thousand layers of opacity 1e-4, alternating in colour. In 8 bits each of them rounds to nothing;
/// 32 bits accumulate to about 1e-5 of the f64 sum.
pub fn thousands_of_thin_layers(backend: &mut dyn Backend) {
    let storage = Storage { brick_cells: 32, ..Storage::plain(TexelType::U8) };
    let volume =
        Volume::new([5, 5, 4097], DVec3::ONE, storage, |p| if p.z % 4.0 < 2.0 { 40.0 } else { 200.0 });
    let tf = transfer(&[[40.0, 1.0, 0.9, 0.1, 1e-4], [200.0, 0.1, 0.6, 1.0, 1e-4]], 1.0);
    let target = DVec3::new(2.0, 2.0, 2048.0);
    let (up, projection) = (DVec3::Y, Projection::Orthographic { height: 6.0 });
    for eye in [DVec3::new(2.0, 2.0, 5000.0), DVec3::new(3.3, 1.1, -900.0)] {
        let camera = Camera { eye, target, up, projection, is_mirrored: false };
        let size = [12, 12];
        let expected = march_volume(&volume, &tf, 16.0, &camera, size, BACKGROUND_F64);
        assert_shows_something("thin layers", &expected, BACKGROUND_F64);
        let image = draw(backend, &volume, &tf, &camera, size);
        assert_close(&format!("4096 layers from {eye}"), &image, &expected, 1e-4, 5e-5);
    }
}

/// A ray that stops in dense matter may leave out no more than the light that could still come through.
pub fn dense_matter_stops_rays_unseen(backend: &mut dyn Backend) {
    let volume = Volume::new([25, 25, 65], DVec3::ONE, Storage::F32, |p| p.z / 64.0);
    // Dark in front, bright behind: what is left out would brighten.
    let tf =
        transfer(&[[0.0, 0.0, 0.0, 0.0, 0.2], [0.5, 0.0, 0.0, 0.0, 0.2], [1.0, 1.0, 1.0, 1.0, 0.9]], 1.0);
    for elevation in [-80.0, 80.0] {
        let camera = Camera::fitted(volume.extent(), 20.0, elevation, 1.5, false);
        let expected = march_volume(&volume, &tf, 64.0, &camera, [24, 24], BACKGROUND_F64);
        assert_shows_something("dense matter", &expected, BACKGROUND_F64);
        let image = draw(backend, &volume, &tf, &camera, [24, 24]);
        assert_close(&format!("dense from {elevation}"), &image, &expected, STOP_TRANSMITTANCE + 2e-3, 1e-3);
    }
}

/// Black matter: what is left of the background is its transmittance.
pub fn background_shines_through(backend: &mut dyn Backend) {
    let volume = Volume::new([17, 17, 17], DVec3::ONE, Storage::F32, |p| p.x / 16.0);
    let tf = transfer(&[[0.0, 0.0, 0.0, 0.0, 0.02], [1.0, 0.0, 0.0, 0.0, 0.06]], 1.0);
    let camera = Camera::fitted(volume.extent(), 20.0, 30.0, 1.0, false);
    let expected = march_volume(&volume, &tf, 64.0, &camera, [32, 32], BACKGROUND_F64);
    assert_shows_something("black matter", &expected, BACKGROUND_F64);
    let image = draw(backend, &volume, &tf, &camera, [32, 32]);
    assert_close("black matter", &image, &expected, 1e-4, 5e-5);
}
