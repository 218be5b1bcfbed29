//! Cubes beyond the limits of one buffer and of one texture: the suite's own pictures are small.

use volery_conformance::Property;
use volery_frame::{
    Backend, Content, Cube, Cubes, Frame, Image, PictureView, Revision, TexelType, Thickness, VolumeLayout,
};
use volery_scene::{Camera, Projection};

use super::difference;

/// What this file checks.
pub(crate) const ALL: &[Property] = &[
    ("cubes_of_several_buffers_are_drawn_in_order", cubes_of_several_buffers_are_drawn_in_order),
    ("pictures_of_several_tiles_have_no_seam", pictures_of_several_tiles_have_no_seam),
];

const MAX: f64 = 2e-5;

fn draw(
    backend: &mut dyn Backend,
    cells: [u32; 3],
    cubes: &[Cube],
    camera: Camera,
    [width, height]: [u32; 2],
) -> Image {
    let layout = VolumeLayout {
        revision: Revision::new(),
        cells,
        spacing: glam::DVec3::ONE,
        brick_cells: 8,
        texel: TexelType::U8,
        value_scale: 1.0,
        value_offset: 0.0,
        value_range: [0.0, 255.0],
    };
    backend.set_volume(&layout).expect("no brick is needed");
    let content = Content::Cubes(Cubes { revision: None, cubes, thickness: Thickness::Exact });
    let frame =
        Frame { view: PictureView { width, height, camera, background: [0.25; 3], meshes: &[] }, content };
    backend.draw(&frame).expect("cubes need no brick").image
}

/// 1.1 million cubes, of which each ray meets 103 of other colours.
fn cubes_of_several_buffers_are_drawn_in_order(backend: &mut dyn Backend) {
    const LAST: u16 = 102;
    const EXTINCTION: f32 = 0.05;
    let gray = |y: u16| f32::from(y * 37 % 103) / 103.0;
    let row = |y, z| (0..=LAST).map(move |x| [x, y, z]);
    let layer = |y| (0..=LAST).flat_map(move |z| row(y, z));
    let indices = (0..=LAST).rev().flat_map(layer);
    let cubes: Vec<_> = indices
        .map(|index| Cube { index, level: 0, color: [gray(index[1]); 3], extinction: EXTINCTION })
        .collect();
    assert!(cubes.len() > 1 << 20, "{} cubes", cubes.len());
    let middle = glam::DVec3::splat(f64::from(LAST) / 2.0);
    let camera = Camera {
        eye: middle - 60.0 * glam::DVec3::Y,
        target: middle,
        up: glam::DVec3::Z,
        projection: Projection::Orthographic { height: 100.3 },
        is_mirrored: false,
    };
    let image = draw(backend, [u32::from(LAST); 3], &cubes, camera, [9, 9]);
    let expected = (0..=LAST).rev().fold(0.25, |behind, y| {
        let length = if y == 0 || y == LAST { 0.5 } else { 1.0 };
        let transmittance = (-f64::from(EXTINCTION) * length).exp();
        f64::from(gray(y)) * (1.0 - transmittance) + behind * transmittance
    });
    let max = difference(&image, |_| expected);
    println!("several buffers: max {max:.2e} (threshold {MAX:e}) from {expected:.4}");
    assert!(max <= MAX, "several buffers: {max:e} from {expected}, expected at most {MAX:e}");
}

/// Strips that are wider or higher than a texture, of one cube in perspective from within and from before it.
fn pictures_of_several_tiles_have_no_seam(backend: &mut dyn Backend) {
    let cube = Cube { index: [0; 3], level: 5, color: [1.0; 3], extinction: 0.1 };
    let middle = glam::DVec3::splat(8.0);
    for (size, fov_y_deg) in [([5000, 3], 0.04), ([3, 5000], 60.0)] {
        for distance in [0.0, 20.0] {
            let eye = middle - glam::DVec3::Y * distance;
            let projection = Projection::Perspective { fov_y_deg };
            let camera = Camera {
                eye,
                target: eye + glam::DVec3::Y,
                up: glam::DVec3::Z,
                projection,
                is_mirrored: false,
            };
            let image = draw(backend, [16; 3], &[cube], camera, size);
            let rays = camera.rays(size[0], size[1]);
            let expected = |place: usize| {
                let ray = rays.pixel(place as u32 % size[0], place as u32 / size[0]);
                let faces = [0.0, 16.0].map(|face| (glam::DVec3::splat(face) - ray.origin) / ray.direction);
                let enter = faces[0].min(faces[1]).max_element().max(0.0);
                let leave = faces[0].max(faces[1]).min_element();
                let transmittance = (-0.1 * (leave - enter).max(0.0)).exp();
                1.0 - transmittance + 0.25 * transmittance
            };
            let max = difference(&image, expected);
            println!("{size:?} from {distance}: max {max:.2e} (threshold {MAX:e})");
            assert!(max <= MAX, "{size:?} from {distance}: {max:e}, expected at most {MAX:e}");
        }
    }
}
