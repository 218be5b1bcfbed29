//! Cameras in a mirror image of the world: left and right of the picture change sides, and nothing else.

use volery_frame::{Backend, Frame, PictureView};
use volery_scene::Camera;

use super::oracle::{assert_shows_something, difference};
use super::parts::{KINDS, World, wide};
use super::world::BACKGROUND_F64;

/// Largest difference of a channel: places in f32 that start from the other side.
const MAX: f64 = 5e-5;

/// With meshes among the content, and without.
pub fn mirrored_cameras_exchange_left_and_right(backend: &mut dyn Backend) {
    for is_orthographic in [false, true] {
        let world = World::new(backend, is_orthographic);
        for (kind, meshes) in KINDS.into_iter().flat_map(|kind| [(kind, &[][..]), (kind, &world.meshes)]) {
            let view = world.view(meshes);
            let mut draw = |is_mirrored| {
                let camera = Camera { is_mirrored, ..view.camera };
                let frame = Frame { view: PictureView { camera, ..view }, content: world.whole(kind) };
                backend.draw(&frame).expect("the suite's frames are right").image
            };
            let (straight, mirrored) = (draw(false), draw(true));
            let what = format!("{kind:?} with {} meshes", meshes.len());
            assert_shows_something(&what, &wide(&straight), BACKGROUND_F64);
            let width = straight.width as usize;
            let rows = wide(&straight);
            let expected: Vec<_> = rows.chunks(width).flat_map(|row| row.iter().rev().copied()).collect();
            let [max, rmse] = difference(&mirrored, &expected);
            println!("{what}: max {max:.2e} (threshold {MAX:e}), rmse {rmse:.2e}");
            assert!(max <= MAX, "{what}: {max:e}, expected at most {MAX:e}");
            let unturned = difference(&mirrored, &rows)[0];
            assert!(unturned > 100.0 * MAX, "{what}: the picture is its own mirror image");
        }
    }
}
