//! Cutting planes: what they show, how bricks of several levels blend, what hides what, and what is refused.

use glam::DVec3;
use volery_scene::{Camera, Plane, Projection, TransferFunction};

use volery_frame::planes::MAX_PLANES;
use volery_frame::{Backend, DrawError, Sampling, TexelType};

use super::oracle::{assert_background, assert_close, assert_same_bits};
use super::plane_oracle::{Blended, Look, blended, check, try_draw, unblended};
use super::world::{
    BACKGROUND, BACKGROUND_F64, Storage, Volume, draw, marschner_lobb, smooth_transfer, transfer,
};

const SIZE: [u32; 2] = [45, 34];

/// Planes through the middle of a box, along no axis.
fn oblique(extent: DVec3) -> Vec<Plane> {
    let normals = [[0.3, 0.5, 0.81], [-1.0, 0.4, 0.1], [0.05, 1.0, -0.6]];
    normals.map(|n| Plane::through(extent * 0.47, DVec3::from_array(n) / extent)).into()
}

fn cameras(extent: DVec3) -> [Camera; 3] {
    let inside = Camera {
        eye: extent * DVec3::new(0.2, 0.15, 0.3),
        target: extent,
        up: DVec3::Z,
        projection: Projection::Perspective { fov_y_deg: 80.0 },
        is_mirrored: false,
    };
    [Camera::fitted(extent, 35.0, 25.0, 1.2, false), Camera::fitted(extent, 215.0, -30.0, 1.2, true), inside]
}

/// Colours that change all over the range, opaque at its end.
fn colors() -> TransferFunction {
    let points = [[0.0, 0.1, 0.2, 0.9, 0.1], [0.4, 0.9, 0.3, 0.1, 0.3], [1.0, 0.2, 1.0, 0.6, 1.0]];
    transfer(&points, 1.0)
}

fn smooth(dims: [u32; 3], texel: TexelType) -> Volume {
    let field = marschner_lobb(dims.map(|n| (n - 1).max(1)));
    // Past the end of the volume coarse levels repeat the last sample.
    let end = DVec3::from_array(dims.map(|n| f64::from(n - 1)));
    Volume::new(dims, DVec3::ONE, Storage::unit(texel), move |p| field(p.min(end)))
}

fn ramp(dims: [u32; 3]) -> Volume {
    let slope = DVec3::new(0.012, 0.009, 0.008);
    Volume::new(dims, DVec3::ONE, Storage::F32, move |p| 0.05 + p.dot(slope))
}

/// A cut of level 1 on one side and level 0 on the other, balanced.
fn two_levels(volume: &Volume, camera: &Camera) -> Vec<Blended> {
    blended(volume, volume.cut(camera, |level, first| level > 1 || first[0] >= 16))
}

/// Oblique planes through a smooth field, one after the other and together.
pub fn planes_show_the_trilinear_field(backend: &mut dyn Backend) {
    for texel in [TexelType::U8, TexelType::U16, TexelType::F32] {
        let volume = smooth([29, 25, 33], texel);
        for camera in cameras(volume.extent()) {
            let bricks = unblended(volume.bricks(&camera));
            for plane in oblique(volume.extent()) {
                let look = Look::opaque(vec![plane], colors());
                let what = format!("{texel:?}, one plane");
                check(&what, backend, (&volume, &bricks), &look, &camera, SIZE, 1e-4);
            }
            let look = Look::opaque(oblique(volume.extent()), colors());
            check("three planes", backend, (&volume, &bricks), &look, &camera, SIZE, 1e-4);
        }
    }
}

/// A linear ramp is linear on every plane, whatever bricks and levels there are: the closed form.
pub fn a_ramp_is_linear_on_planes_of_any_cut(backend: &mut dyn Backend) {
    let volume = ramp([33, 25, 29]);
    let tf = transfer(&[[0.0, 0.0, 0.2, 1.0, 1.0], [1.0, 1.0, 0.7, 0.0, 1.0]], 1.0);
    let slope = DVec3::new(0.012, 0.009, 0.008);
    for camera in &cameras(volume.extent())[..2] {
        let plane = Plane::through(volume.extent() * 0.5, DVec3::new(0.4, 0.5, 0.7));
        let look = Look::opaque(vec![plane], tf.clone());
        let closed_form = super::oracle::each_pixel(camera, SIZE, |ray| {
            let depth = -plane.signed_distance(ray.origin) / plane.normal.dot(ray.direction);
            let place = ray.origin + ray.direction * depth;
            let is_inside = place.cmpge(DVec3::ZERO).all() && place.cmple(volume.extent()).all();
            let value = 0.05 + place.dot(slope);
            if is_inside { [value, 0.2 + 0.5 * value, 1.0 - value] } else { BACKGROUND_F64 }
        });
        for cut in [
            unblended(volume.bricks(camera)),
            two_levels(&volume, camera),
            unblended(volume.cut(camera, |level, _| level > 1)),
        ] {
            let image = try_draw(backend, &volume, &cut, &look, camera, SIZE).expect("a right frame");
            assert_close(&format!("ramp in {} bricks", cut.len()), &image, &closed_form, 2e-6, 1e-6);
        }
    }
}

/// Bricks blend into coarser neighbours as their low corners say: all 256 ways, and those of a real cut.
pub fn bricks_blend_by_their_corners(backend: &mut dyn Backend) {
    let volume = smooth([27, 22, 25], TexelType::U8);
    for camera in cameras(volume.extent()) {
        let look = Look::opaque(oblique(volume.extent()), colors());
        let bricks = volume.bricks(&camera);
        let arbitrary = bricks.into_iter().zip((0_u8..=255).map(|i| i.wrapping_mul(37).wrapping_add(90)));
        let arbitrary: Vec<_> = arbitrary.collect();
        check("any corners", backend, (&volume, &arbitrary), &look, &camera, SIZE, 1e-4);
        let cut = two_levels(&volume, &camera);
        let kinds: std::collections::BTreeSet<_> =
            cut.iter().map(|(brick, low)| (brick.placed.level, *low)).collect();
        assert!(kinds.len() >= 3, "levels and corners of the cut: {kinds:?}");
        check("two levels", backend, (&volume, &cut), &look, &camera, SIZE, 1e-4);
    }
}

/// With all corners low a brick shows what its parent shows, so low tiles need no copy.
pub fn low_samples_are_the_parents(backend: &mut dyn Backend) {
    for dims in [[33, 25, 29], [30, 23, 28], [12, 31, 18], [10, 3, 2]] {
        for texel in [TexelType::U16, TexelType::Rgba8] {
            let volume = smooth(dims, texel);
            for camera in cameras(volume.extent()) {
                for sampling in [Sampling::Linear, Sampling::Nearest] {
                    let look = Look { sampling, ..Look::opaque(oblique(volume.extent()), colors()) };
                    let low: Vec<_> = volume.bricks(&camera).into_iter().map(|brick| (brick, 255)).collect();
                    let parents = unblended(volume.cut(&camera, |level, _| level > 1));
                    let found =
                        try_draw(backend, &volume, &low, &look, &camera, SIZE).expect("a right frame");
                    let parents = check("parents", backend, (&volume, &parents), &look, &camera, SIZE, 1e-4);
                    let differ = found
                        .pixels
                        .iter()
                        .zip(&parents.pixels)
                        .filter(|(a, b)| (0..3).any(|i| (a[i] - b[i]).abs() > 2e-5));
                    let (differ, most) = (differ.count(), found.pixels.len() / 100);
                    println!("{dims:?} {texel:?} {sampling:?}: {differ} pixels differ (threshold {most})");
                    assert!(
                        differ <= if sampling == Sampling::Linear { 0 } else { most },
                        "{differ} pixels differ"
                    );
                }
            }
        }
    }
}

/// Nearest samples, blended between levels as well.
pub fn nearest_samples(backend: &mut dyn Backend) {
    let volume = smooth([27, 22, 25], TexelType::U8);
    let extent = volume.extent();
    let camera = Camera::fitted(extent, 35.0, 25.0, 2.5, false);
    let look = Look { sampling: Sampling::Nearest, ..Look::opaque(oblique(extent), colors()) };
    let bricks = unblended(volume.bricks(&camera));
    let near = check("nearest", backend, (&volume, &bricks), &look, &camera, [90, 70], 1e-4);
    check("two levels", backend, (&volume, &two_levels(&volume, &camera)), &look, &camera, [90, 70], 1e-4);
    let linear = Look::opaque(oblique(extent), colors());
    let linear = try_draw(backend, &volume, &bricks, &linear, &camera, [90, 70]).expect("a right frame");
    assert!(linear != near, "nearest and linear look alike");
}

/// Transparent planes that cross, some of them twice in the list, seen through one another in order of depth.
pub fn transparent_planes_cross(backend: &mut dyn Backend) {
    let volume = smooth([27, 22, 25], TexelType::F32);
    for camera in cameras(volume.extent()) {
        let mut planes = oblique(volume.extent());
        planes.extend([
            planes[1],
            Plane { normal: DVec3::X, distance: 9.3 },
            Plane { normal: -DVec3::Z, distance: -12.0 },
        ]);
        planes.extend(
            (0..10).map(|i| Plane { normal: DVec3::new(1.0, 1.0, 0.3), distance: 4.0 * f64::from(i) }),
        );
        assert_eq!(planes.len(), MAX_PLANES);
        let look = Look { is_transparent: true, ..Look::opaque(planes, colors()) };
        let bricks = two_levels(&volume, &camera);
        check("crossing planes", backend, (&volume, &bricks), &look, &camera, SIZE, 1e-4);
    }
}

/// Steps of the transfer function stand where they are, to the last value before them.
pub fn steps_of_the_transfer_function(backend: &mut dyn Backend) {
    let step = |value: f64, from: [f64; 4], to: [f64; 4]| [from, to].map(|[r, g, b, a]| [value, r, g, b, a]);
    let [black, red, white] = [[0.0, 0.0, 0.0, 0.0], [1.0, 0.2, 0.1, 0.5], [1.0, 1.0, 0.9, 1.0]];
    let points =
        [step(0.2, black, red), step(0.45, red, black), step(0.46, black, white), step(0.7, red, black)];
    let many: Vec<_> = (0..300)
        .map(|i| {
            let x = f64::from(i) / 299.0;
            [x, x * x, f64::from(i % 7) / 6.0, 1.0 - x, x]
        })
        .collect();
    for tf in [
        transfer(points.as_flattened(), 1.0),
        transfer(&many, 1.0),
        transfer(&[[0.3, 0.4, 0.5, 0.6, 0.7]], 1.0),
    ] {
        for (texel, value_scale, value_offset) in [
            (TexelType::U8, 1.0 / 255.0, 0.0),
            (TexelType::U8, -1.0 / 255.0, 1.0),
            (TexelType::F32, 0.01, -3.0),
        ] {
            let storage = Storage { value_scale, value_offset, ..Storage::unit(texel) };
            let volume = Volume::new([27, 22, 25], DVec3::ONE, storage, |p| {
                0.02 + p.dot(DVec3::new(0.012, 0.013, 0.014))
            });
            for camera in &cameras(volume.extent())[..2] {
                for is_transparent in [false, true] {
                    let look = Look { is_transparent, ..Look::opaque(oblique(volume.extent()), tf.clone()) };
                    let bricks = unblended(volume.bricks(camera));
                    let what = format!("{} points, scale {value_scale:.4}", tf.points().len());
                    check(&what, backend, (&volume, &bricks), &look, camera, SIZE, 5e-4);
                }
            }
        }
    }
}

/// Where a step stands at a value, matter of that value is past it, however it is stored.
pub fn values_at_a_step_are_past_it(backend: &mut dyn Backend) {
    for (texel, label) in [
        (TexelType::U8, 100.0),
        (TexelType::U8, 249.0),
        (TexelType::U16, 40_001.0),
        (TexelType::F32, 0.3_f32.into()),
    ] {
        let volume = Volume::new([27, 22, 25], DVec3::ONE, Storage::plain(texel), move |_| label);
        let points = [[label, 0.1, 0.2, 0.3, 1.0], [label, 0.9, 0.8, 0.7, 1.0]];
        let look = Look::opaque(oblique(volume.extent()), transfer(&points, 1.0));
        for camera in cameras(volume.extent()) {
            let bricks = two_levels(&volume, &camera);
            let image = try_draw(backend, &volume, &bricks, &look, &camera, SIZE).expect("a right frame");
            let wrong =
                image.pixels.iter().filter(|&&pixel| pixel != BACKGROUND && pixel != [0.9, 0.8, 0.7]).count();
            let right = image.pixels.iter().filter(|&&pixel| pixel == [0.9, 0.8, 0.7]).count();
            println!("{texel:?} {label}: {right} pixels past the step, {wrong} before it (threshold 0)");
            assert!(wrong == 0 && right > 100, "{wrong} pixels before the step, {right} past it");
        }
    }
}

/// Blank cells let see what is behind; of blended bricks those of the samples that count.
pub fn blank_cells_show_what_is_behind(backend: &mut dyn Backend) {
    let hole =
        |p: DVec3| (p - DVec3::new(14.0, 10.0, 12.0)).length() < 6.5 || p == DVec3::new(3.0, 15.0, 4.0);
    let field = marschner_lobb([26, 21, 24]);
    let value = move |p: DVec3| if hole(p) { f64::NAN } else { field(p) };
    let volume = Volume::new([27, 22, 25], DVec3::ONE, Storage::F32, value);
    let all_blank = Volume::new([27, 22, 25], DVec3::ONE, Storage::F32, |_| f64::NAN);
    for camera in cameras(volume.extent()) {
        for (sampling, is_transparent) in
            [(Sampling::Linear, false), (Sampling::Linear, true), (Sampling::Nearest, false)]
        {
            let look = Look { sampling, is_transparent, ..Look::opaque(oblique(volume.extent()), colors()) };
            for bricks in [unblended(volume.bricks(&camera)), two_levels(&volume, &camera)] {
                check("a hole", backend, (&volume, &bricks), &look, &camera, SIZE, 1e-4);
            }
            let bricks = unblended(all_blank.bricks(&camera));
            let image = try_draw(backend, &all_blank, &bricks, &look, &camera, SIZE).expect("a right frame");
            assert_background("blanks", &image, BACKGROUND);
        }
    }
}

/// Texels that are colours show themselves, and no ray goes through them.
pub fn colors_show_themselves(backend: &mut dyn Backend) {
    let volume =
        Volume::new([27, 22, 25], DVec3::ONE, Storage::plain(TexelType::Rgba8), marschner_lobb([26, 21, 24]));
    for camera in cameras(volume.extent()) {
        for (sampling, is_transparent) in
            [(Sampling::Linear, false), (Sampling::Linear, true), (Sampling::Nearest, true)]
        {
            let look = Look { sampling, is_transparent, ..Look::opaque(oblique(volume.extent()), colors()) };
            check("colours", backend, (&volume, &two_levels(&volume, &camera)), &look, &camera, SIZE, 1e-4);
        }
    }
    let (camera, transfer) = (cameras(volume.extent())[0], &volume.integrated(&smooth_transfer(1.0)));
    let content = volery_frame::Content::Rays(volery_frame::Rays { transfer, bricks: &[] });
    let frame = volery_frame::Frame {
        view: volery_frame::PictureView { width: 5, height: 5, camera, background: BACKGROUND, meshes: &[] },
        content,
    };
    assert_eq!(backend.draw(&frame).err(), Some(DrawError::RaysThroughColors), "rays through colours");
}

/// An image is a volume of one layer of samples: seen by the plane that it lies in, and by no other but as a line.
pub fn images_are_volumes_of_one_layer(backend: &mut dyn Backend) {
    for (dims, axis) in
        [([41, 30, 1], 2), ([1, 30, 41], 0), ([41, 1, 30], 1), ([1, 1, 1], 1), ([41, 1, 1], 2)]
    {
        for texel in [TexelType::U8, TexelType::Rgba8, TexelType::F32] {
            let storage = Storage { brick_cells: 8, ..Storage::unit(texel) };
            let volume = Volume::new(dims, DVec3::splat(0.3), storage, |p| {
                (p.dot(DVec3::splat(0.37))).sin() * 0.5 + 0.5
            });
            let normal = DVec3::AXES[axis];
            let toward = normal + DVec3::new(0.1, 0.13, 0.07);
            let up = DVec3::AXES[(axis + 1) % 3];
            // Beside the middle, so that no pixel's centre meets a line of samples by chance.
            let target = volume.extent() / 2.0 + DVec3::new(0.011, 0.013, 0.017);
            for projection in
                [Projection::Perspective { fov_y_deg: 30.0 }, Projection::Orthographic { height: 9.0 }]
            {
                let camera =
                    Camera { eye: target - toward * 18.0, target, up, projection, is_mirrored: false };
                for sampling in [Sampling::Linear, Sampling::Nearest] {
                    let plane = Plane { normal: normal * 3.0, distance: 0.0 };
                    let look = Look { sampling, ..Look::opaque(vec![plane], colors()) };
                    for bricks in [unblended(volume.bricks(&camera)), two_levels(&volume, &camera)] {
                        let what = format!("{dims:?} {texel:?} {sampling:?}");
                        let image = check(&what, backend, (&volume, &bricks), &look, &camera, SIZE, 1e-4);
                        let is_image = dims.iter().filter(|&&n| n == 1).count() == 1;
                        let shown = image.pixels.iter().filter(|&&pixel| pixel != BACKGROUND).count();
                        assert!(
                            !is_image || shown > 300,
                            "{what}: {shown} pixels of {} show it",
                            image.pixels.len()
                        );
                    }
                }
                let tilted = Plane::through(volume.extent() / 2.0, normal + up * 1e-3);
                let bricks = unblended(volume.bricks(&camera));
                let look = Look::opaque(vec![tilted], colors());
                let image = try_draw(backend, &volume, &bricks, &look, &camera, SIZE).expect("a right frame");
                let shown = image.pixels.iter().filter(|&&pixel| pixel != BACKGROUND).count();
                println!("a tilted plane shows {shown} pixels of {dims:?} (threshold {})", SIZE[0]);
                assert!(shown <= SIZE[0] as usize, "a tilted plane shows {shown} pixels");
            }
        }
    }
}

/// Bounds of bricks in the colour of their level, over opaque matter, transparent matter and blanks.
pub fn outlines_of_bricks(backend: &mut dyn Backend) {
    let field = marschner_lobb([26, 21, 24]);
    let value = move |p: DVec3| if p.z > 15.0 { f64::NAN } else { field(p) };
    let volume = Volume::new([27, 22, 25], DVec3::new(1.0, 1.0, 1.5), Storage::F32, value);
    for camera in cameras(volume.extent()) {
        for is_transparent in [false, true] {
            let mut planes = oblique(volume.extent());
            // In a face between bricks, which is no line then.
            planes.push(Plane { normal: DVec3::X, distance: 8.0 });
            let look = Look { is_transparent, shows_bricks: true, ..Look::opaque(planes, colors()) };
            let bricks = two_levels(&volume, &camera);
            let lines = check("outlines", backend, (&volume, &bricks), &look, &camera, [90, 68], 2e-3);
            let plain = Look { shows_bricks: false, ..look };
            let plain =
                try_draw(backend, &volume, &bricks, &plain, &camera, [90, 68]).expect("a right frame");
            let differ = lines.pixels.iter().zip(&plain.pixels).filter(|(a, b)| a != b).count();
            assert!(differ > 90, "outlines change {differ} pixels");
        }
    }
}

/// Planes exactly in faces of bricks and of the volume, at spacings that rounding does not spare, are seen once.
pub fn planes_in_faces_are_seen_once(backend: &mut dyn Backend) {
    for spacing in [1.0, 0.1, 1.0 / 3.0] {
        let field = marschner_lobb([32, 20, 24]);
        let volume = Volume::new([33, 21, 25], DVec3::splat(spacing), Storage::F32, field);
        for camera in &cameras(volume.extent())[..2] {
            let bricks = two_levels(&volume, camera);
            for axis in 0..3 {
                for cells in [0.0, 8.0, 16.0, f64::from(volume.layout.cells[axis])] {
                    for normal in [DVec3::AXES[axis], DVec3::AXES[axis] * -2.5] {
                        let plane = Plane { normal, distance: cells * spacing * normal[axis] };
                        let look = Look { is_transparent: true, ..Look::opaque(vec![plane], colors()) };
                        let what = format!("axis {axis}, {cells} cells of {spacing:.3}");
                        let image = check(&what, backend, (&volume, &bricks), &look, camera, SIZE, 1e-4);
                        let shown = image.pixels.iter().filter(|&&pixel| pixel != BACKGROUND).count();
                        assert!(shown > 100, "{what}: {shown} pixels show it");
                    }
                }
            }
        }
    }
}

/// Planes that the eye lies in, that are behind it, beside the volume, or seen edge on: nothing, and no noise.
pub fn planes_that_are_not_seen(backend: &mut dyn Backend) {
    let volume = smooth([27, 22, 25], TexelType::U8);
    let [outside, parallel, inside] = cameras(volume.extent());
    for camera in [outside, parallel, inside] {
        let [right, up, forward] = camera.axes();
        let mut planes = vec![
            Plane::through(camera.eye - forward * 3.0, forward + 0.1 * up),
            Plane::through(volume.extent() * 1.5, DVec3::ONE),
            Plane { normal: DVec3::Y, distance: -1e-9 },
        ];
        if camera == parallel {
            planes.pop();
            planes.truncate(2);
            planes[0] = Plane::through(camera.eye - forward * 30.0, forward + 0.1 * up);
        } else {
            planes.push(Plane { normal: DVec3::Z, distance: camera.eye.z });
        }
        let look = Look::opaque(planes, colors());
        let bricks = unblended(volume.bricks(&camera));
        let image = try_draw(backend, &volume, &bricks, &look, &camera, SIZE).expect("a right frame");
        let is_flat = camera == inside || camera == outside;
        println!("unseen planes, perspective: {is_flat}");
        assert_background("unseen planes", &image, BACKGROUND);
        // Nearly edge on, so near that the horizon lies in the picture.
        let grazing = Plane::through(camera.eye - up * 0.4, up + 0.01 * right);
        let look = Look::opaque(vec![grazing, Plane::through(camera.eye + up * 0.7, up)], colors());
        check("grazing planes", backend, (&volume, &bricks), &look, &camera, SIZE, 2e-4);
    }
    let camera =
        Camera { eye: DVec3::new(13.0, -40.0, 12.0), target: DVec3::new(13.0, 0.0, 12.0), ..parallel };
    let look = Look::opaque(vec![Plane { normal: DVec3::Z, distance: 12.0 }], colors());
    let bricks = unblended(volume.bricks(&camera));
    let image = try_draw(backend, &volume, &bricks, &look, &camera, SIZE).expect("a right frame");
    assert_background("edge on", &image, BACKGROUND);
}

/// An eye a million cells away, cells ten times as long as wide, and worlds of atoms and of galaxies.
pub fn planes_of_far_eyes_and_odd_cells(backend: &mut dyn Backend) {
    for spacing in [DVec3::ONE, DVec3::new(1.0, 1.0, 10.0), DVec3::splat(1e-9), DVec3::splat(1e9)] {
        let field = marschner_lobb([26, 21, 24]);
        let volume = Volume::new([27, 22, 25], spacing, Storage::F32, field);
        let near = cameras(volume.extent())[0];
        let toward = (near.target - near.eye).normalize();
        let far = Camera {
            eye: near.target - toward * spacing.min_element() * 1e6,
            projection: Projection::Perspective {
                fov_y_deg: 2.0
                    * (0.4 * volume.extent().length() / (1e6 * spacing.min_element())).atan().to_degrees(),
            },
            ..near
        };
        for camera in [near, far] {
            let look = Look { is_transparent: true, ..Look::opaque(oblique(volume.extent()), colors()) };
            let bricks = two_levels(&volume, &camera);
            check(&format!("spacing {spacing}"), backend, (&volume, &bricks), &look, &camera, SIZE, 2e-4);
        }
    }
}

/// Where no brick is, or one with fewer samples than its place, nothing hides what is behind.
pub fn absent_and_short_bricks_show_what_is_behind(backend: &mut dyn Backend) {
    let volume = smooth([33, 25, 25], TexelType::U8);
    let short = smooth([14, 20, 25], TexelType::U8);
    for camera in cameras(volume.extent()) {
        let look = Look { shows_bricks: true, ..Look::opaque(oblique(volume.extent()), colors()) };
        let mut kept = two_levels(&volume, &camera);
        kept.retain(|(brick, _)| brick.placed.first_cell.iter().sum::<u32>() % 32 != 8);
        check("absent bricks", backend, (&volume, &kept), &look, &camera, SIZE, 2e-3);
        let bricks = unblended(short.bricks(&camera));
        check("short bricks", backend, (&volume, &bricks), &look, &camera, SIZE, 2e-3);
    }
}

/// More places for bricks than any grid has entries; few bricks, of many levels.
pub fn few_bricks_in_a_large_volume(backend: &mut dyn Backend) {
    let storage = Storage { brick_cells: 2, ..Storage::unit(TexelType::U8) };
    let volume = Volume::new([2001, 1501, 3], DVec3::ONE, storage, |p| {
        (p.x * 0.3).sin() * (p.y * 0.2).cos() * 0.5 + 0.5
    });
    let target = DVec3::new(1000.0, 700.0, 1.0);
    let camera = Camera {
        eye: target + DVec3::new(3.0, -8.0, 60.0),
        target,
        up: DVec3::Y,
        projection: Projection::Perspective { fov_y_deg: 40.0 },
        is_mirrored: false,
    };
    let distance = |level: u32, first: [u32; 3]| {
        let middle = [0, 1].map(|axis| f64::from(first[axis] + (1 << level)) - target[axis]);
        middle[0].abs().max(middle[1].abs())
    };
    let cut = volume.cut(&camera, |level, first| distance(level, first) < 2.5 * f64::from(2 << level));
    let levels: std::collections::BTreeSet<_> = cut.iter().map(|brick| brick.placed.level).collect();
    println!("{} bricks of levels {levels:?}", cut.len());
    assert!(levels.len() > 5 && cut.len() < 5000, "{} bricks of {levels:?}", cut.len());
    let planes =
        vec![Plane { normal: DVec3::Z, distance: 1.0 }, Plane::through(target, DVec3::new(0.2, 0.1, 1.0))];
    let look = Look { shows_bricks: true, ..Look::opaque(planes, colors()) };
    check("few bricks", backend, (&volume, &blended(&volume, cut)), &look, &camera, [128, 96], 2e-3);
}

/// Frames of planes and of rays in turn, pictures of every size, planes that change: always the same picture.
pub fn planes_and_rays_in_turn(backend: &mut dyn Backend) {
    let volume = smooth([27, 22, 25], TexelType::U8);
    let camera = cameras(volume.extent())[0];
    let bricks = two_levels(&volume, &camera);
    let look = Look::opaque(oblique(volume.extent()), colors());
    let first = check("first", backend, (&volume, &bricks), &look, &camera, SIZE, 1e-4);
    let rays = draw(backend, &volume, &smooth_transfer(1.0), &camera, SIZE);
    for size in [[1, 1], [17, 5], [1, 33], [65, 1], [16, 16], [131, 67]] {
        let two = Look::opaque(look.planes[1..].to_vec(), smooth_transfer(1.0));
        check(&format!("{size:?} pixels"), backend, (&volume, &bricks), &two, &camera, size, 1e-4);
    }
    let again = try_draw(backend, &volume, &bricks, &look, &camera, SIZE).expect("a right frame");
    assert_same_bits("planes after rays", &first, &again);
    let again = draw(backend, &volume, &smooth_transfer(1.0), &camera, SIZE);
    assert_same_bits("rays after planes", &rays, &again);
    let nothing = Look::opaque(Vec::new(), colors());
    let image = try_draw(backend, &volume, &bricks, &nothing, &camera, SIZE).expect("a right frame");
    assert_background("no planes", &image, BACKGROUND);
    let image = try_draw(backend, &volume, &[], &look, &camera, SIZE).expect("a right frame");
    assert_background("no bricks", &image, BACKGROUND);
}

/// Too many planes, planes that are none, and bricks that are not there are named.
pub fn wrong_frames_of_planes_are_named(backend: &mut dyn Backend) {
    let volume = smooth([17, 9, 9], TexelType::U8);
    let camera = cameras(volume.extent())[0];
    let good = Plane { normal: DVec3::X, distance: 5.0 };
    let mut refused = |planes: Vec<Plane>| {
        let bricks = unblended(volume.bricks(&camera));
        try_draw(backend, &volume, &bricks, &Look::opaque(planes, colors()), &camera, SIZE).err()
    };
    assert_eq!(refused(vec![good; MAX_PLANES]), None, "as many planes as there may be");
    let expected = DrawError::TooManyPlanes { found: MAX_PLANES + 1, max: MAX_PLANES };
    assert_eq!(refused(vec![good; MAX_PLANES + 1]), Some(expected));
    for (normal, distance) in [
        (DVec3::ZERO, 1.0),
        (DVec3::NAN, 1.0),
        (DVec3::X, f64::NAN),
        (DVec3::X, f64::INFINITY),
        (DVec3::splat(1e200), 1.0),
    ] {
        let error = refused(vec![good, Plane { normal, distance }]);
        println!("{normal}, {distance}: {error:?}");
        assert!(matches!(error, Some(DrawError::Plane { index: 1, .. })), "{normal}, {distance}: {error:?}");
    }
    let mut bricks = unblended(volume.bricks(&camera));
    let id = bricks[1].0.placed.id;
    let look = Look::opaque(vec![good], colors());
    bricks.remove(1);
    try_draw(backend, &volume, &bricks, &look, &camera, SIZE).expect("a right frame");
    let missing = volery_frame::BlendedBrick { placed: volume.bricks(&camera)[1].placed, low_corners: 0 };
    let transfer = &volery_frame::PointTransfer::new(&look.transfer, &volume.layout);
    let content = volery_frame::Content::Planes(volery_frame::Planes {
        planes: &look.planes,
        bricks: &[missing],
        transfer,
        sampling: Sampling::Linear,
        is_transparent: false,
        shows_bricks: false,
    });
    let frame = volery_frame::Frame {
        view: volery_frame::PictureView { width: 9, height: 9, camera, background: BACKGROUND, meshes: &[] },
        content,
    };
    assert_eq!(backend.draw(&frame).err(), Some(DrawError::NotResident { id }), "a missing brick");
}
