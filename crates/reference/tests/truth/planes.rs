//! Planes through fields that are known in closed form.

use glam::DVec3;
use volery_data::ramp;
use volery_reference::PlaneScene;
use volery_scene::{Camera, Plane, Ray};

use crate::slow::{check, orthographic, perspective, transfer};

const BACKGROUND: [f64; 3] = [0.1, 0.6, 0.3];
const SIZE: [u32; 2] = [37, 29];

/// The value of a linear ramp where a ray meets a plane within the domain.
fn value_at(ray: &Ray, plane: &Plane, extent: DVec3, gradient: DVec3) -> Option<f64> {
    let t = -plane.signed_distance(ray.origin) / plane.normal.dot(ray.direction);
    let place = ray.origin + ray.direction * t;
    let is_inside = place.cmpge(DVec3::splat(-1e-9)).all() && place.cmple(extent + 1e-9).all();
    (t >= 0.0 && is_inside).then(|| gradient.dot(place))
}

#[test]
fn a_ramp_is_itself_on_any_plane() {
    let (spacing, gradient) = (DVec3::new(1.0, 0.5, 2.0), DVec3::new(0.03, 0.05, 0.02));
    let grid = ramp([11, 13, 7], spacing, gradient, 0.0);
    let extent = grid.extent();
    let gray = transfer(&[(0.0, [0.0; 3], 0.0), (1.0, [1.0; 3], 1.0)], 1.0);
    let center = extent / 2.0;
    let cameras = [
        perspective(center + DVec3::new(9.0, -17.0, 8.0), center, 50.0),
        orthographic(center + DVec3::new(9.0, -17.0, 8.0), center, 15.0),
        perspective(center, extent, 90.0),
    ];
    let planes = [
        Plane::through(center, DVec3::new(0.3, 0.5, 0.81)),
        Plane::through(center * 1.1, DVec3::new(-2.0, 1.0, 0.4)),
    ];
    for camera in cameras {
        for is_transparent in [false, true] {
            let scene = PlaneScene {
                grid: &grid,
                planes: &planes,
                transfer: &gray,
                nearest: false,
                is_transparent,
                meshes: &[],
            };
            let drawn = scene.render(&camera, BACKGROUND, SIZE, &|_| {}).unwrap();
            let mut worst = 0.0_f64;
            each_ray(&camera, |place, ray| {
                let mut hits: Vec<(f64, f64)> = planes
                    .iter()
                    .filter_map(|plane| {
                        let t = -plane.signed_distance(ray.origin) / plane.normal.dot(ray.direction);
                        Some((t, value_at(ray, plane, extent, gradient)?))
                    })
                    .collect();
                hits.sort_by(|a, b| a.0.total_cmp(&b.0));
                // From the back: grey and opacity are both the value.
                let expected = BACKGROUND.map(|behind| {
                    hits.iter().rev().fold(behind, |behind, &(_, value)| {
                        if is_transparent { value * value + (1.0 - value) * behind } else { value }
                    })
                });
                for (found, expected) in drawn.pixels()[place].iter().zip(expected) {
                    worst = worst.max((found - expected).abs());
                }
            });
            check(&format!("planes, transparent {is_transparent}"), worst, 1e-12);
        }
    }
}

fn each_ray(camera: &Camera, mut take: impl FnMut(usize, &Ray)) {
    let rays = camera.rays(SIZE[0], SIZE[1]);
    for row in 0..SIZE[1] {
        for column in 0..SIZE[0] {
            take((row * SIZE[0] + column) as usize, &rays.pixel(column, row));
        }
    }
}
