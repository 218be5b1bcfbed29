//! Cameras in a mirror image of the world: left and right of the picture change sides, and nothing else.

use volery_frame::{Backend, Frame, PictureView};
use volery_scene::Camera;

use super::oracle::{assert_shows_something, difference};
use super::parts::{KINDS, Kind, World, wide};
use super::world::BACKGROUND_F64;

/// Largest difference of a channel: places in f32 that start from the other side. Of rays, where cells are cut by what
/// is left of the light; of planes, what outlines one pixel wide gain or lose by half a rounding is not counted.
const MAX: f64 = 2e-4;

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
            let differs =
                |found: &[f64; 3], expected: &[f64; 3]| (0..3).any(|i| (found[i] - expected[i]).abs() > MAX);
            let others = wide(&mirrored).iter().zip(&expected).filter(|(a, b)| differs(a, b)).count();
            let [max, rmse] = difference(&mirrored, &expected);
            // Where an edge runs through the middle of a pixel, either side of it is right.
            let allowed = if kind == Kind::Planes || !meshes.is_empty() { expected.len() / 500 } else { 0 };
            println!(
                "{what}: max {max:.2e} (threshold {MAX:e}), rmse {rmse:.2e}, {others} pixels above (at most {allowed})"
            );
            assert!(others <= allowed, "{what}: {others} pixels differ by more than {MAX:e}");
            let unturned = difference(&mirrored, &rows)[0];
            assert!(unturned > 100.0 * MAX, "{what}: the picture is its own mirror image");
        }
    }
}
