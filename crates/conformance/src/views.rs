//! Where the eye stands: inside, on corners and faces, on sample planes, far away, looking elsewhere.

use glam::DVec3;
use volery_scene::{Camera, Projection};

use volery_frame::{Backend, TexelType};

use super::oracle::{assert_background, assert_close, assert_shows_something, march_volume};
use super::world::{BACKGROUND, BACKGROUND_F64, Storage, Volume, draw, marschner_lobb, smooth_transfer};

const SIZE: [u32; 2] = [40, 32];

fn rings() -> Volume {
    let cells = [32, 24, 28];
    let storage = Storage::unit(TexelType::U16);
    Volume::new(cells.map(|n| n + 1), DVec3::ONE, storage, marschner_lobb(cells))
}

fn perspective(eye: DVec3, target: DVec3, fov_y_deg: f64) -> Camera {
    let up = if (target - eye).normalize().z.abs() > 0.99 { DVec3::Y } else { DVec3::Z };
    Camera { eye, target, up, projection: Projection::Perspective { fov_y_deg }, is_mirrored: false }
}

fn assert_like_the_march(backend: &mut dyn Backend, what: &str, camera: &Camera) {
    let volume = rings();
    let tf = smooth_transfer(1.0);
    let expected = march_volume(&volume, &tf, 24.0, camera, SIZE, BACKGROUND_F64);
    assert_shows_something(what, &expected, BACKGROUND_F64);
    let image = draw(backend, &volume, &tf, camera, SIZE);
    assert_close(what, &image, &expected, 0.01, 0.002);
}

/// The eye inside the matter.
pub fn eye_inside(backend: &mut dyn Backend) {
    for (eye, target) in [
        (DVec3::new(11.3, 10.7, 13.1), DVec3::new(30.0, 20.0, 10.0)),
        (DVec3::new(20.5, 3.2, 5.5), DVec3::new(20.0, 20.0, 27.0)),
    ] {
        assert_like_the_march(backend, &format!("eye inside at {eye}"), &perspective(eye, target, 80.0));
    }
}

/// The eye exactly where eight bricks meet.
pub fn eye_on_the_corner_of_bricks(backend: &mut dyn Backend) {
    let eye = DVec3::new(16.0, 8.0, 16.0);
    for target in [DVec3::new(0.0, 24.0, 28.0), DVec3::new(32.0, 0.5, 3.0), DVec3::new(32.0, 8.0, 16.0)] {
        assert_like_the_march(
            backend,
            &format!("eye on a corner, to {target}"),
            &perspective(eye, target, 90.0),
        );
    }
}

/// The eye exactly on the plane between two bricks.
pub fn eye_on_the_face_of_a_brick(backend: &mut dyn Backend) {
    let eye = DVec3::new(8.0, 11.3, 13.7);
    for target in [DVec3::new(32.0, 12.0, 14.0), DVec3::new(0.0, 12.0, 14.0), DVec3::new(8.0, 24.0, 27.0)] {
        assert_like_the_march(
            backend,
            &format!("eye on a face, to {target}"),
            &perspective(eye, target, 90.0),
        );
    }
}

/// The eye exactly on a corner of the volume, looking in.
pub fn eye_on_a_corner_of_the_volume(backend: &mut dyn Backend) {
    let middle = DVec3::new(16.3, 12.2, 14.1);
    for eye in [DVec3::ZERO, DVec3::new(32.0, 24.0, 28.0), DVec3::new(32.0, 0.0, 28.0)] {
        assert_like_the_march(backend, &format!("eye on corner {eye}"), &perspective(eye, middle, 60.0));
    }
}

/// Rays along each axis, most of them exactly on sample planes: an odd picture whose middle column and row
/// look along planes between bricks, and orthographic views with a pixel per cell.
pub fn axis_aligned_views_on_sample_planes(backend: &mut dyn Backend) {
    let volume = rings();
    let tf = smooth_transfer(1.0);
    let (middle, size) = (DVec3::new(16.0, 8.0, 16.0), [41, 33]);
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        for side in [-1.0, 1.0] {
            let eye = middle + axis * side * 60.0;
            let up = if axis == DVec3::Z { DVec3::Y } else { DVec3::Z };
            for projection in [
                Projection::Perspective { fov_y_deg: 35.0 },
                // One pixel per cell, centres on the sample planes.
                Projection::Orthographic { height: 33.0 },
            ] {
                let camera = Camera { eye, target: middle, up, projection, is_mirrored: false };
                let mut expected = march_volume(&volume, &tf, 24.0, &camera, size, BACKGROUND_F64);
                assert_shows_something("axis-aligned", &expected, BACKGROUND_F64);
                let mut image = draw(backend, &volume, &tf, &camera, size);
                // A ray in a face of the volume is as much outside as inside: it is not compared.
                let rays = camera.rays(size[0], size[1]);
                for index in 0..expected.len() as u32 {
                    let ray = rays.pixel(index % size[0], index / size[0]);
                    let in_a_face = (0..3).any(|i| {
                        let from_face = ray.origin[i].abs().min((ray.origin[i] - volume.extent()[i]).abs());
                        ray.direction[i].abs() < 1e-12 && from_face < 1e-9
                    });
                    if in_a_face {
                        expected[index as usize] = BACKGROUND_F64;
                        image.pixels[index as usize] = BACKGROUND;
                    }
                }
                assert_close(
                    &format!("along {axis}, side {side}, {projection:?}"),
                    &image,
                    &expected,
                    0.01,
                    0.002,
                );
            }
        }
    }
}

/// The eye a million cells away, the picture filled by the volume: rays keep their precision.
pub fn eye_a_million_cells_away(backend: &mut dyn Backend) {
    let target = DVec3::new(16.0, 12.0, 14.0);
    for toward in [DVec3::new(0.6, -0.7, 0.4), DVec3::X, DVec3::new(-0.1, 0.9, -0.7)] {
        let eye = target + toward.normalize() * 1e6;
        let fov_y_deg = (2.0 * f64::atan(20.0 / 1e6)).to_degrees();
        let what = format!("eye at {toward} * 1e6");
        assert_like_the_march(backend, &what, &perspective(eye, target, fov_y_deg));
    }
}

/// A camera that looks away shows the background, bit for bit; so does one that looks past the volume.
pub fn camera_looking_away_sees_the_background(backend: &mut dyn Backend) {
    let volume = rings();
    let eye = DVec3::new(16.0, -40.0, 14.0);
    for target in [DVec3::new(16.0, -80.0, 14.0), DVec3::new(-4000.0, 300.0, 14.0)] {
        let camera = perspective(eye, target, 40.0);
        let image = draw(backend, &volume, &smooth_transfer(1.0), &camera, SIZE);
        assert_background(&format!("from {eye} to {target}"), &image, BACKGROUND);
    }
}

/// Orthographic rays start on the plane through the eye: what is behind it is not drawn.
pub fn volume_behind_the_orthographic_plane(backend: &mut dyn Backend) {
    let volume = rings();
    let (away, up) = (DVec3::new(0.3, 1.0, 0.2), DVec3::Z);
    let projection = Projection::Orthographic { height: 40.0 };
    let eye = DVec3::new(16.0, 40.0, 14.0);
    let behind = Camera { eye, target: eye + away, up, projection, is_mirrored: false };
    let image = draw(backend, &volume, &smooth_transfer(1.0), &behind, SIZE);
    assert_background("all behind the plane", &image, BACKGROUND);
    let eye = DVec3::new(15.7, 11.6, 14.2);
    assert_like_the_march(backend, "plane through the middle", &Camera { eye, target: eye + away, ..behind });
}

/// A smooth field from outside, in perspective and orthographic.
pub fn smooth_field_in_perspective(backend: &mut dyn Backend) {
    let extent = rings().extent();
    for (azimuth, elevation) in [(30.0, 20.0), (160.0, -40.0), (270.0, 85.0)] {
        for orthographic in [false, true] {
            let camera = Camera::fitted(extent, azimuth, elevation, 1.3, orthographic);
            let what = format!("smooth field from {azimuth}, {elevation}, orthographic {orthographic}");
            assert_like_the_march(backend, &what, &camera);
        }
    }
}
