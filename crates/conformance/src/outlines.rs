//! Outlines of stacks: triangles whose sign is a matter of the ray.

use glam::DVec3;
use volery_scene::{Camera, Projection};

use volery_frame::{Backend, Counted, Sheet};

use super::STOP_TRANSMITTANCE;
use super::oracle::assert_same_bits;
use super::sheet_oracle::{Scene, Table};
use super::sheets::SIZE;

/// Largest difference: a ray that stops, places in f32 and on a grid.
const MAX: f64 = STOP_TRANSMITTANCE + 1e-3;

const NUM_SIDES: u32 = 9;

/// A tower whose sides lean out, then in: rings at heights of -1, 0 and 1, and slabs half-way.
fn tower() -> Scene {
    let mut scene = Scene::new(DVec3::Z, Table::ramp(0.6));
    let ring = |scene: &mut Scene, height: f64, radius: f64| {
        let first = scene.points.len() as u32;
        for side in 0..NUM_SIDES {
            let (y, x) = (std::f64::consts::TAU * f64::from(side) / f64::from(NUM_SIDES)).sin_cos();
            let place = [radius * x, radius * y, height, 0.5 + 0.3 * x];
            scene.points.push(place.map(|part| part as f32));
        }
        first
    };
    let rings =
        [(-1.0, 0.6), (0.0, 1.1), (1.0, 0.4)].map(|(height, radius)| ring(&mut scene, height, radius));
    for (gap, middle) in [(0, -0.5), (1, 0.5)] {
        let [low, high] = [rings[gap], rings[gap + 1]];
        let outline = (0..NUM_SIDES).flat_map(|side| {
            let next = (side + 1) % NUM_SIDES;
            [[low + side, low + next, high + next], [low + side, high + next, high + side]]
        });
        scene.add(middle, [-middle as f32, 1.0], &outline.collect::<Vec<_>>());
        let (position, rising) = scene.sheets[scene.sheets.len() - 1];
        scene.sheets.pop();
        let falling =
            Sheet { thickness: rising.thickness.map(|part| -part), counted: Counted::Falling, ..rising };
        scene.sheets.extend([(position, Sheet { counted: Counted::Rising, ..rising }), (position, falling)]);
        let slab = ring(&mut scene, middle, 0.8);
        let fan = (1..NUM_SIDES - 1).map(|side| [slab, slab + side, slab + side + 1]);
        scene.add(middle, [1.0, 0.0], &fan.collect::<Vec<_>>());
    }
    scene
}

fn cameras() -> [(&'static str, Camera); 5] {
    let camera = |eye: [f64; 3], projection| Camera {
        eye: DVec3::from_array(eye),
        target: DVec3::ZERO,
        up: DVec3::new(0.1, 1.0, 0.2),
        projection,
        is_mirrored: false,
    };
    let perspective = Projection::Perspective { fov_y_deg: 45.0 };
    let parallel = Projection::Orthographic { height: 3.0 };
    [
        ("from above", camera([1.5, -1.0, 3.0], perspective)),
        ("from below", camera([-1.2, 0.4, -3.0], perspective)),
        ("from the side above", camera([3.5, 0.5, 1.2], perspective)),
        ("parallel", camera([2.0, -1.0, 1.5], parallel)),
        ("parallel from below", camera([-2.0, 1.0, -2.5], parallel)),
    ]
}

/// Every ray finds the triangles of an outline that rise and fall for it, from the same triangles for all eyes, and that
/// is another picture than if all of them did either.
pub fn outlines_serve_any_eye(backend: &mut dyn Backend) {
    let scene = tower();
    let mut all = scene.clone();
    all.sheets.retain(|(_, sheet)| sheet.counted != Counted::Falling);
    all.sheets.iter_mut().for_each(|(_, sheet)| sheet.counted = Counted::All);
    for (what, camera) in cameras() {
        let image = scene.draw(backend, &camera, SIZE);
        scene.compare(what, &image, &camera, MAX);
        assert_ne!(all.draw(backend, &camera, SIZE), image, "{what}: which triangles count says nothing");
        assert_same_bits(what, &scene.draw(backend, &camera, SIZE), &image);
    }
}
