//! Sheets of triangles: closed forms of slabs, coverage, signed thickness, views, tables, light, and what is kept.
//!
//! What no closed form tells comes from every ray against every triangle in f64 (`sheet_oracle`). Devices may put
//! vertices on a grid of 1/256 pixel: where a picture changes within a hundredth of a pixel, anything between is right.
//! That triangles of shared vertices leave no gap and overlap nowhere is asked of every pixel.

use glam::DVec3;
use volery_scene::{Camera, Projection, Ray, TransferFunction};

use volery_frame::{
    Backend, Content, DrawError, Frame, Image, Light, PictureView, Revision, Sheet, SheetTransfer,
    SheetVertices, Sheets, TexelType,
};

use super::STOP_TRANSMITTANCE;
use super::cubes::Random;
use super::oracle::{
    assert_background, assert_close, assert_same_bits, assert_shows_something, each_pixel, over,
};
use super::sheet_oracle::{Scene, Table};
use super::world::{
    BACKGROUND, BACKGROUND_F64, Storage, Volume, draw, marschner_lobb, smooth_transfer, transfer,
};

pub(super) const SIZE: [u32; 2] = [61, 47];

/// Largest difference: a ray that stops, places in f32 and on a grid.
const MAX: f64 = STOP_TRANSMITTANCE + 1e-3;

const ORANGE: [f32; 3] = [1.0, 0.5, 0.1];

fn perspective(eye: DVec3, target: DVec3, fov_y_deg: f64) -> Camera {
    let up = if (target - eye).normalize().z.abs() > 0.99 { DVec3::Y } else { DVec3::Z };
    Camera { eye, target, up, projection: Projection::Perspective { fov_y_deg }, is_mirrored: false }
}

/// A stack of squares around the origin, from -1 to 1 on all sides, of smooth values from 0 to 1.
fn stack(normal: DVec3, num: u32, cells: u32, table: Table, seed: u64) -> Scene {
    let mut scene = Scene::new(normal, table);
    let (mut random, normal) = (Random(seed), scene.normal);
    let thickness = 2.0 / num as f32;
    for i in 0..num {
        let position = (2.0 * f64::from(i) + 1.0) / f64::from(num) - 1.0;
        scene.add_square(normal * position, 1.0, cells, thickness, &mut random, field);
    }
    scene
}

fn field(place: DVec3) -> f64 {
    0.5 + 0.25 * ((1.7 * place.x + 0.4).sin() + (1.3 * place.y - place.z).cos())
}

/// From outside, near and far, steep and flat.
fn cameras() -> [(&'static str, Camera); 4] {
    [
        ("30 degrees", perspective(DVec3::new(3.1, -4.2, 2.9), DVec3::ZERO, 30.0)),
        ("90 degrees", perspective(DVec3::new(-0.6, 0.9, 1.7), DVec3::ZERO, 90.0)),
        ("flat", perspective(DVec3::new(4.0, 1.2, 0.31), DVec3::new(0.0, 0.1, 0.0), 35.0)),
        ("orthographic", {
            let camera = perspective(DVec3::new(-3.0, -2.0, 4.0), DVec3::new(0.1, 0.0, 0.0), 30.0);
            Camera { projection: Projection::Orthographic { height: 3.1 }, ..camera }
        }),
    ]
}

/// Those that see nothing but a plane around the origin, of a normal near z.
fn above() -> [(&'static str, Camera); 3] {
    let [near, _, _, orthographic] = cameras();
    [near, ("80 degrees", perspective(DVec3::new(-0.6, 0.9, 2.7), DVec3::ZERO, 80.0)), orthographic]
}

/// A scene that covers the whole of every picture.
fn wide(normal: DVec3, table: Table) -> Scene {
    let mut scene = Scene::new(normal, table);
    scene.add_square(DVec3::ZERO, 100.0, 1, 0.05, &mut Random(1), |_| 0.5);
    scene
}

/// A slab as wide as the world: `1 - exp(-s t / c)` at every pixel, in perspective too.
pub fn a_constant_sheet_is_a_slab(backend: &mut dyn Backend) {
    let scene = wide(DVec3::new(0.1, -0.2, 1.0), Table::constant(ORANGE, 20.0));
    for (what, camera) in above() {
        let light = |ray: &Ray| {
            let depth = 20.0 * 0.05 / ray.direction.dot(scene.normal).abs();
            over(ORANGE.map(f64::from), depth, BACKGROUND_F64)
        };
        let expected = each_pixel(&camera, SIZE, light);
        let image = scene.draw(backend, &camera, SIZE);
        assert_shows_something(what, &expected, BACKGROUND_F64);
        assert_close(what, &image, &expected, 1e-4, 2e-5);
    }
    let small = stack(DVec3::Z, 1, 1, Table::constant(ORANGE, 0.5), 1);
    above().iter().for_each(|(what, camera)| small.check(what, backend, camera, MAX));
}

/// Values that are linear in space are linear on the plane of a sheet, not on the screen.
pub fn linear_values_are_linear_in_space(backend: &mut dyn Backend) {
    let slope = DVec3::new(0.012, -0.023, 0.1);
    let points = [[-3.0, 1.0, 0.9, 0.1, 0.0], [3.0, 0.0, 0.2, 1.0, 0.0]];
    let clear = transfer(&points, 1.0);
    let dense = TransferFunction::new(
        clear.points().iter().map(|&point| volery_scene::ControlPoint { opacity: 0.9, ..point }).collect(),
        0.05,
    )
    .expect("right points");
    let normal = DVec3::new(0.1, -0.2, 1.0);
    let mut scene = Scene::new(normal, Table::constant(ORANGE, 1.0));
    scene.add_square(DVec3::ZERO, 100.0, 3, 0.05, &mut Random(3), |place| slope.dot(place));
    for (what, camera) in above() {
        for transfer in [&clear, &dense] {
            let light = |ray: &Ray| {
                let cosine = ray.direction.dot(scene.normal);
                let hit = ray.origin - ray.direction * (ray.origin.dot(scene.normal) / cosine);
                let (color, opacity) = transfer.classify(slope.dot(hit));
                let depth = transfer.extinction_of_opacity(opacity) * 0.05 / cosine.abs();
                over(color, depth, BACKGROUND_F64)
            };
            let expected = each_pixel(&camera, SIZE, light);
            let sheet_transfer = SheetTransfer::new(transfer, [-3.0, 3.0]);
            let (vertices, sheets) = (scene.exact(), scene.back_to_front(&camera));
            let image = draw_sheets(backend, &scene, vertices, &sheets, &sheet_transfer, &camera);
            assert_close(what, &image, &expected, 1e-3, 2e-4);
        }
    }
}

/// Draws a scene's triangles with other sheets and another transfer function.
fn draw_sheets(
    backend: &mut dyn Backend,
    scene: &Scene,
    vertices: SheetVertices<'_>,
    sheets: &[Sheet],
    transfer: &SheetTransfer,
    camera: &Camera,
) -> Image {
    let Scene { normal, origin, light, .. } = *scene;
    let triangles = &scene.triangles;
    let sheets = Sheets { revision: None, normal, origin, vertices, triangles, sheets, transfer, light };
    let content = Content::Sheets(sheets);
    let [width, height] = SIZE;
    let frame = Frame {
        view: PictureView { width, height, camera: *camera, background: BACKGROUND, meshes: &[] },
        content,
    };
    backend.draw(&frame).expect("right sheets").image
}

/// Every pixel of a picture full of crooked triangles belongs to one of them, also where its centre lies on a side.
pub fn triangles_share_sides_without_gap_or_overlap(backend: &mut dyn Backend) {
    let expected_at = |depth: f64| over(ORANGE.map(f64::from), depth, BACKGROUND_F64);
    for (cells, eye) in [(40, DVec3::new(0.3, 0.2, 3.0)), (150, DVec3::new(-1.1, 0.4, 2.0))] {
        let mut scene = Scene::new(DVec3::Z, Table::constant(ORANGE, 1.0));
        scene.add_square(DVec3::ZERO, 9.0, cells, 0.7, &mut Random(7), |_| 0.5);
        for projection in
            [Projection::Perspective { fov_y_deg: 60.0 }, Projection::Orthographic { height: 4.0 }]
        {
            let camera = Camera { projection, ..perspective(eye, DVec3::new(0.1, 0.0, 0.0), 60.0) };
            let light = |ray: &Ray| expected_at(0.7 / ray.direction.z.abs());
            let image = scene.draw(backend, &camera, SIZE);
            let expected = each_pixel(&camera, SIZE, light);
            assert_close(&format!("{cells} cells, {projection:?}"), &image, &expected, 1e-4, 2e-5);
        }
    }
    // All vertices, sides and diagonals on centres of pixels: squares of two pixels, and of a half.
    for (cells, half) in [(32, 32.0), (128, 32.0)] {
        let mut scene = Scene::new(DVec3::Z, Table::constant(ORANGE, 1.0));
        let step = 2.0 * half / f64::from(cells);
        let corner = |i: u32| (f64::from(i) * step - half) as f32;
        for row in 0..=cells {
            scene.points.extend((0..=cells).map(|column| [corner(column), corner(row), 0.0, 0.5]));
        }
        let mut triangles = Vec::new();
        for [x, y] in (0..cells * cells).map(|i| [i % cells, i / cells]) {
            let a = x + y * (cells + 1);
            let [b, c, d] = [a + 1, a + cells + 1, a + cells + 2];
            triangles.extend(match (x + y) % 3 {
                0 => [[a, b, d], [a, d, c]],
                1 => [[a, b, c], [c, b, d]],
                _ => [[d, c, a], [b, a, d]],
            });
        }
        scene.add(0.0, [0.7, 0.0], &triangles);
        for middle in [DVec3::ZERO, DVec3::new(0.5, 0.5, 0.0), DVec3::new(0.25, 0.0, 0.0)] {
            let eye = middle + DVec3::Z * 5.0;
            let projection = Projection::Orthographic { height: 40.0 };
            let camera = Camera { eye, target: middle, up: DVec3::Y, projection, is_mirrored: false };
            let expected = each_pixel(&camera, [40, 40], |_| expected_at(0.7));
            let image = scene.draw(backend, &camera, [40, 40]);
            assert_close(&format!("sides on centres, {cells} cells"), &image, &expected, 1e-4, 2e-5);
        }
    }
}

/// Stacks of smooth values from all sides.
pub fn stacks_are_their_sums(backend: &mut dyn Backend) {
    for (seed, normal) in [(1, DVec3::Z), (2, DVec3::new(0.5, 0.7, -0.3)), (3, DVec3::NEG_X)] {
        let scene = stack(normal, 24, 6, Table::ramp(1.2), seed);
        for (what, camera) in cameras() {
            scene.check(&format!("{what}, normal {normal}"), backend, &camera, MAX);
        }
    }
    let dense = stack(DVec3::Z, 24, 6, Table::ramp(40.0), 4);
    dense.check("dense", backend, &cameras()[0].1, 3.0 * MAX);
}

/// Thousands of sheets of opacity 1e-4.
pub fn thousands_of_thin_sheets(backend: &mut dyn Backend) {
    let mut scene = stack(DVec3::Z, 4096, 1, Table::ramp(0.25), 5);
    scene.sheets.iter_mut().for_each(|(_, sheet)| sheet.thickness = [1e-3, 0.0]);
    // Sheets that end beside the picture, so that no outline hides an error.
    scene.points.iter_mut().for_each(|[x, y, ..]| (*x, *y) = (*x * 5.0, *y * 5.0));
    for eye in [DVec3::new(0.3, 0.1, 4.0), DVec3::new(0.2, -0.3, -3.0)] {
        let camera = perspective(eye, DVec3::ZERO, 25.0);
        let image = scene.draw(backend, &camera, [12, 9]);
        scene.compare(&format!("4096 sheets from {eye}"), &image, &camera, 2e-4);
    }
}

/// Strips between planes add matter and take it away; what is taken away in front of others comes back behind.
pub fn strips_add_and_take_away(backend: &mut dyn Backend) {
    let mut scene = stack(DVec3::Z, 10, 4, Table::ramp(1.5), 6);
    // Slanted walls around the stack, between each two planes.
    for i in 0..9 {
        let [low, high] = [i, i + 1].map(|i| (2.0 * f64::from(i) + 1.0) / 10.0 - 1.0);
        let middle = 0.5 * (low + high);
        for (side, slope) in [(1.0, 1.0), (-1.0, -1.0)] {
            let first = scene.points.len() as u32;
            for (z, x) in [(low, 0.8), (middle, 0.9), (high, 1.0)] {
                for y in [-0.9, 0.9] {
                    let place = DVec3::new(side * x, y, z);
                    let [x, y, z] = place.to_array().map(|x| x as f32);
                    scene.points.push([x, y, z, field(place) as f32]);
                }
            }
            for half in 0..2 {
                let [a, b, c, d] = [0, 1, 2, 3].map(|i| first + 2 * half + i);
                let from = if half == 0 { low } else { high };
                let thickness = [(-slope * from) as f32, slope as f32];
                scene.add(middle, thickness, &[[a, b, c], [c, b, d]]);
            }
        }
    }
    cameras().iter().for_each(|(what, camera)| scene.check(what, backend, camera, MAX));
    scene.table = Table::ramp(12.0);
    cameras().iter().for_each(|(what, camera)| scene.check(what, backend, camera, 3.0 * MAX));
    // What strips add or take away is bounded.
    scene.table = Table::ramp(120.0);
    cameras().iter().for_each(|(what, camera)| scene.check(what, backend, camera, 3.0 * MAX));
}

/// Of nothing no more is taken away than [`volery_frame::sheets::MAX_STRIP_DEPTH`], and light that all but ended may rise again.
pub fn negative_thickness_is_bounded(backend: &mut dyn Backend) {
    let camera = perspective(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, 30.0);
    let mut scene = Scene::new(DVec3::Z, Table::ramp(1.0));
    let mut random = Random(8);
    let mut layer = |position: f64, thickness: f32, value: f64| {
        scene.add_square(DVec3::Z * position, 50.0, 2, thickness, &mut random, |_| value);
    };
    layer(-1.0, 6.0, 1.0);
    let thickness = |i: i32| match i % 2 {
        _ if i == 0 => -7.0,
        0 => -0.7,
        _ => -0.3,
    };
    (0..16).for_each(|i| layer(0.01 * f64::from(i), thickness(i), 1.0));
    layer(0.9, 9.0, 1.0);
    let sheets = scene.back_to_front(&camera);
    let expected = each_pixel(&camera, SIZE, |ray| scene.seen(ray, &sheets, BACKGROUND_F64));
    let image = scene.draw(backend, &camera, SIZE);
    assert_shows_something("signed", &expected, BACKGROUND_F64);
    assert_close("light that rises again", &image, &expected, 2e-3, 1e-3);
    scene.sheets.truncate(3);
    let sheets = scene.back_to_front(&camera);
    let expected = each_pixel(&camera, SIZE, |ray| scene.seen(ray, &sheets, BACKGROUND_F64));
    let image = scene.draw(backend, &camera, SIZE);
    assert_close("matter taken away", &image, &expected, 1e-4, 5e-5);
}

/// However signed sheets of different colours follow one another, no colour is beyond those of matter and background.
pub fn colours_stay_within_what_is_emitted(backend: &mut dyn Backend) {
    let camera = perspective(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, 30.0);
    let entries = vec![[0.9, 0.2, 0.3, 0.5], [0.3, 0.25, 0.8, 6.0], [0.4, 0.6, 0.2, 2.0]];
    let mut num_beyond = 0;
    for seed in 0..12 {
        let mut random = Random(seed);
        let mut scene = Scene::new(DVec3::Z, Table::of_values(entries.clone(), [0.0, 1.0]));
        if seed % 3 == 2 {
            scene.light = Some(Light { toward: [0.6, 0.0, 0.8], ambient: 0.4, diffuse: 0.7 });
        }
        for i in 0..7 {
            let [thickness, tilt] = [0.4 * (random.next() - 0.5), random.next() - 0.5];
            let value = |place: DVec3| 0.5 + tilt * place.x;
            scene.add_square(DVec3::Z * (0.1 * f64::from(i)), 50.0, 3, thickness as f32, &mut random, value);
        }
        scene.gradients = scene.points.iter().map(|_| [0.6, 0.0, 0.8, 1.0]).collect();
        let image = scene.draw(backend, &camera, SIZE);
        let ranges = [0, 1, 2].map(|i| {
            let [low, high] = [scene.emitted(i, f64::min), scene.emitted(i, f64::max)];
            [low.min(BACKGROUND_F64[i]) - 1e-6, high.max(BACKGROUND_F64[i]) + 1e-6]
        });
        for (index, pixel) in image.pixels.iter().enumerate() {
            let is_within = |i: usize| (ranges[i][0]..=ranges[i][1]).contains(&f64::from(pixel[i]));
            assert!((0..3).all(is_within), "seed {seed}, pixel {index}: {pixel:?}, expected in {ranges:?}");
            let is_at_end = |i: usize| ranges[i].iter().any(|end| (f64::from(pixel[i]) - end).abs() < 3e-6);
            num_beyond += usize::from((0..3).any(is_at_end));
        }
        let sheets = scene.back_to_front(&camera);
        let expected = each_pixel(&camera, SIZE, |ray| scene.seen(ray, &sheets, BACKGROUND_F64));
        assert_close(&format!("signed, seed {seed}"), &image, &expected, 3.0 * MAX, MAX);
    }
    println!("{num_beyond} pixels at the end of their range (at least 1000)");
    assert!(num_beyond >= 1000, "{num_beyond}: the sheets hardly take colours beyond their range");
}

/// Extinction and thickness of all sizes, and sheets seen from their side.
pub fn sheets_of_all_extinctions(backend: &mut dyn Backend) {
    let (camera, normal) = (cameras()[0].1, DVec3::new(0.1, -0.2, 1.0));
    for (extinction, thickness) in [
        (0.0, 1.0),
        (1e-30, 1.0),
        (1e-3, 1.0),
        (1e30, 1e-30),
        (1e30, 1.0),
        (1e30, 1e8),
        (1.0, 0.0),
        (0.0, 1e30),
    ] {
        let mut scene = wide(normal, Table::constant(ORANGE, extinction));
        scene.sheets[0].1.thickness = [thickness, 0.0];
        let sheets = scene.back_to_front(&camera);
        let expected = each_pixel(&camera, SIZE, |ray| scene.seen(ray, &sheets, BACKGROUND_F64));
        let image = scene.draw(backend, &camera, SIZE);
        assert_close(&format!("extinction {extinction:e} by {thickness:e}"), &image, &expected, 1e-5, 1e-5);
    }
    // The plane of the sheet through the eye: no pixel may be anything but a mixture.
    let scene = stack(DVec3::Z, 1, 5, Table::constant(ORANGE, 1.0), 1);
    for height in [0.0, 1e-9, 1e-4] {
        let camera = perspective(DVec3::new(3.0, 0.2, height), DVec3::new(0.0, 0.0, height), 40.0);
        let image = scene.draw(backend, &camera, SIZE);
        let is_mixture = |pixel: &[f32; 3]| {
            (0..3).all(|i| {
                let ends = [BACKGROUND[i], ORANGE[i]];
                (ends[0].min(ends[1]) - 1e-5..=ends[0].max(ends[1]) + 1e-5).contains(&pixel[i])
            })
        };
        let num_wrong = image.pixels.iter().filter(|pixel| !is_mixture(pixel)).count();
        println!("seen from its side, {height:e} above: {num_wrong} pixels are no mixture (threshold 0)");
        assert!(num_wrong == 0, "{height:e}: {num_wrong} pixels");
    }
}

/// The eye between sheets, in the plane of one, and triangles across the plane of the eye.
pub fn eyes_inside_stacks(backend: &mut dyn Backend) {
    for (seed, normal) in [(1, DVec3::Z), (2, DVec3::new(0.5, 0.7, -0.3))] {
        let scene = stack(normal, 16, 3, Table::ramp(0.9), seed);
        let along = scene.normal * 0.4;
        for (eye, target, fov_y_deg) in [
            (DVec3::new(0.13, 0.21, 0.07), DVec3::new(1.0, 0.3, 0.2), 60.0),
            (DVec3::new(-0.4, 0.11, 0.3) + along, DVec3::new(0.4, 0.7, -3.0), 100.0),
            (DVec3::new(0.2, -0.3, 0.01), DVec3::new(0.2, -0.3, 0.01) + scene.normal, 75.0),
        ] {
            let camera = perspective(eye, target, fov_y_deg);
            scene.check(&format!("inside at {eye}, normal {normal}"), backend, &camera, MAX);
        }
        let camera = Camera {
            eye: DVec3::new(0.05, 0.02, 0.03),
            target: DVec3::new(1.0, 0.7, -0.6),
            up: DVec3::Z,
            projection: Projection::Orthographic { height: 2.5 },
            is_mirrored: false,
        };
        scene.check(&format!("orthographic inside, normal {normal}"), backend, &camera, MAX);
    }
    // One triangle from far behind the eye to far before it.
    let mut scene = Scene::new(DVec3::Z, Table::ramp(2.0));
    scene.points = vec![[-50.0, -40.0, 0.0, 0.0], [60.0, -30.0, 0.0, 0.3], [1.0, 90.0, 0.0, 1.0]];
    scene.add(0.0, [0.3, 0.0], &[[0, 1, 2]]);
    let camera = perspective(DVec3::new(0.3, 0.4, 0.7), DVec3::new(7.0, 9.0, -0.5), 70.0);
    scene.check("across the eye", backend, &camera, MAX);
}

/// An eye at 1e6 sizes, an origin at 1e6 sizes, and units from 1e-9 to 1e9.
pub fn far_eyes_and_far_origins(backend: &mut dyn Backend) {
    let normal = DVec3::new(0.5, 0.7, -0.3);
    let scene = stack(normal, 12, 5, Table::ramp(1.2), 9);
    let away = DVec3::new(0.6, -0.7, 0.4).normalize() * 1e6;
    let far = perspective(away, DVec3::ZERO, (2.0 * f64::atan(1.3 / 1e6)).to_degrees());
    scene.check("far eye", backend, &far, MAX);
    let origin = DVec3::new(1e6, -2e6, 3e6);
    let moved = Scene { origin, ..scene.clone() };
    for (what, camera) in cameras() {
        let camera = Camera { eye: camera.eye + origin, target: camera.target + origin, ..camera };
        moved.check(&format!("far origin, {what}"), backend, &camera, MAX);
    }
    for unit in [1e-9, 1e9] {
        let mut scaled = scene.clone();
        scaled.points.iter_mut().for_each(|[x, y, z, _]| {
            [x, y, z].into_iter().for_each(|x| *x *= unit as f32);
        });
        scaled.table.entries.iter_mut().for_each(|entry| entry[3] /= unit as f32);
        for (position, sheet) in &mut scaled.sheets {
            *position *= unit;
            sheet.thickness = sheet.thickness.map(|t| t * unit as f32);
        }
        for (what, camera) in [cameras()[0], cameras()[1]] {
            let camera = Camera { eye: camera.eye * unit, target: camera.target * unit, ..camera };
            scaled.check(&format!("units of {unit:e}, {what}"), backend, &camera, MAX);
        }
    }
}

/// A stack with the gradients of [`field`], and directions of zero where it rises least.
fn with_gradients(mut scene: Scene) -> Scene {
    let gradient = |place: DVec3| {
        let (a, b) = (1.7 * place.x + 0.4, 1.3 * place.y - place.z);
        0.25 * DVec3::new(1.7 * a.cos(), -1.3 * b.sin(), b.sin())
    };
    let gradients = scene.points.iter().map(|&[x, y, z, _]| {
        let gradient = gradient(DVec3::new(x.into(), y.into(), z.into()));
        let [x, y, z] = gradient.normalize_or_zero().to_array().map(|x| x as f32);
        [x, y, z, gradient.length() as f32]
    });
    scene.gradients = gradients.collect();
    scene
}

/// Rows by magnitude, bilinear; also without gradients, where only the first counts.
pub fn magnitudes_choose_rows(backend: &mut dyn Backend) {
    let mut random = Random(10);
    let mut entry = || {
        let mut next = || random.next() as f32;
        [next(), next(), next(), 2.0 * next()]
    };
    let entries = (0..5 * 4).map(|_| entry()).collect();
    let table = Table { entries, columns: 5, values: [0.1, 0.9], magnitudes: [0.1, 0.5] };
    let scene = with_gradients(stack(DVec3::Z, 8, 12, table, 11));
    above().iter().for_each(|(what, camera)| scene.check(what, backend, camera, 3.0 * MAX));
    let without = Scene { gradients: Vec::new(), ..scene };
    without.check("without gradients", backend, &cameras()[0].1, 3.0 * MAX);
}

/// Both sides are lit alike; a zero direction, and no gradients at all, show colours as they are.
pub fn light_falls_on_both_sides(backend: &mut dyn Backend) {
    let toward = DVec3::new(0.3, -0.5, 0.8).normalize().to_array().map(|x| x as f32);
    let light = Some(Light { toward, ambient: 0.2, diffuse: 0.8 });
    let mut scene = with_gradients(stack(DVec3::Z, 8, 10, Table::ramp(1.2), 12));
    scene.light = light;
    cameras().iter().for_each(|(what, camera)| scene.check(what, backend, camera, 2.0 * MAX));
    let camera = &cameras()[0].1;
    let lit = scene.draw(backend, camera, SIZE);
    let mut turned = scene.clone();
    turned.gradients.iter_mut().for_each(|[x, y, z, _]| (*x, *y, *z) = (-*x, -*y, -*z));
    assert_same_bits("light from behind", &lit, &turned.draw(backend, camera, SIZE));
    let unlit = Scene { light: None, ..scene.clone() }.draw(backend, camera, SIZE);
    assert_ne!(lit, unlit, "light changes nothing");
    let mut zero = scene.clone();
    zero.gradients.iter_mut().for_each(|[x, y, z, _]| (*x, *y, *z) = (0.0, 0.0, 0.0));
    assert_same_bits("zero directions", &unlit, &zero.draw(backend, camera, SIZE));
    let without = Scene { gradients: Vec::new(), ..scene };
    assert_same_bits("no gradients", &unlit, &without.draw(backend, camera, SIZE));
}

/// Vertices of few bits show what their numbers say, gradients included.
pub fn quantized_vertices_are_what_their_numbers_say(backend: &mut dyn Backend) {
    let mut random = Random(13);
    let mut entry = || {
        let mut next = || random.next() as f32;
        [next(), next(), next(), 2.0 * next()]
    };
    let entries = (0..4 * 3).map(|_| entry()).collect();
    let table = Table { entries, columns: 4, values: [0.0, 1.0], magnitudes: [0.0, 0.6] };
    let mut scene = with_gradients(stack(DVec3::new(0.5, 0.7, -0.3), 8, 10, table, 14));
    scene.light = Some(Light { toward: [0.0, 0.6, 0.8], ambient: 0.3, diffuse: 0.7 });
    for has_gradients in [true, false] {
        if !has_gradients {
            scene.gradients.clear();
        }
        let (rounded, (points, gradients, quantization)) = scene.quantized();
        let vertices = SheetVertices::Quantized { points: &points, gradients: &gradients, quantization };
        for (what, camera) in cameras() {
            let image = rounded.try_draw(backend, None, vertices, &camera, SIZE).expect("right sheets");
            rounded.compare(&format!("quantized, {what}"), &image, &camera, 3.0 * MAX);
        }
    }
}

/// Nothing to see is the background, bit for bit, and needs no volume.
pub fn sheets_that_show_nothing(backend: &mut dyn Backend) {
    let camera = cameras()[0].1;
    let full = stack(DVec3::Z, 4, 3, Table::ramp(1.0), 15);
    let mut is_background = |what: &str, scene: &Scene, camera: &Camera| {
        let image = scene.draw(backend, camera, SIZE);
        assert_background(what, &image, BACKGROUND);
    };
    is_background("no vertices", &Scene::new(DVec3::Z, Table::ramp(1.0)), &camera);
    is_background("no sheets", &Scene { sheets: Vec::new(), ..full.clone() }, &camera);
    let mut empty = full.clone();
    empty.sheets.iter_mut().for_each(|(_, sheet)| sheet.count = 0);
    is_background("sheets of no triangles", &empty, &camera);
    let mut flat = full.clone();
    flat.triangles.iter_mut().for_each(|[_, b, c]| *c = *b);
    is_background("triangles of no area", &flat, &camera);
    let clear = Scene { table: Table::constant(ORANGE, 0.0), ..full.clone() };
    is_background("no extinction", &clear, &camera);
    let away = Camera { target: camera.eye * 2.0, ..camera };
    is_background("behind the eye", &full, &away);
    let projection = Projection::Orthographic { height: 3.0 };
    is_background("behind the orthographic plane", &full, &Camera { projection, ..away });
    let beside = Camera { target: camera.eye + DVec3::new(1.0, 1.0, 0.0), ..camera };
    is_background("beside the picture", &full, &beside);
}

/// Numbers of vertices and triangles that do not exist, counts that do not agree, and normals that are none.
pub fn wrong_sheets_are_named(backend: &mut dyn Backend) {
    let camera = cameras()[0].1;
    let full = with_gradients(stack(DVec3::Z, 4, 3, Table::ramp(1.0), 15));
    let mut refused = |scene: &Scene| match scene.try_draw(backend, None, scene.exact(), &camera, SIZE) {
        Err(DrawError::Sheets { what, found, expected }) => {
            println!("{what} of sheets is {found}, expected {expected}");
            Some(what)
        }
        Err(other) => panic!("{other:?}"),
        Ok(_) => None,
    };
    assert_eq!(refused(&full), None, "right sheets");
    let mut wrong = full.clone();
    wrong.triangles[5][1] = wrong.points.len() as u32;
    assert_eq!(refused(&wrong), Some("a vertex number"));
    let mut wrong = full.clone();
    wrong.sheets[2].1.count += 1000;
    assert_eq!(refused(&wrong), Some("the end of a sheet"));
    wrong.sheets[2].1.first = u32::MAX;
    assert_eq!(refused(&wrong), Some("the end of a sheet"));
    let mut wrong = full.clone();
    wrong.gradients.pop();
    assert_eq!(refused(&wrong), Some("the number of gradients"));
    for normal in [DVec3::ZERO, DVec3::NAN, DVec3::Z * 2.0] {
        assert_eq!(refused(&Scene { normal, ..full.clone() }), Some("the length of the normal"));
    }
}

/// The same revision shows the same bits whatever else changes between; another one shows other contents, and what has
/// none is never kept.
pub fn revisions_name_contents(backend: &mut dyn Backend) {
    let camera = cameras()[0].1;
    let one = with_gradients(stack(DVec3::Z, 6, 5, Table::ramp(1.0), 16));
    let other = with_gradients(stack(DVec3::X, 9, 3, Table::ramp(2.0), 17));
    let mut show = |scene: &Scene, revision: Option<Revision>, camera: &Camera| {
        scene.try_draw(backend, revision, scene.exact(), camera, SIZE).expect("right sheets")
    };
    let plain = [&one, &other].map(|scene| show(scene, None, &camera));
    assert_ne!(plain[0], plain[1], "two scenes");
    let [first, second] = [Some(Revision::new()), Some(Revision::new())];
    for round in 0..2 {
        assert_same_bits(&format!("first, {round}"), &show(&one, first, &camera), &plain[0]);
        assert_same_bits(&format!("first again, {round}"), &show(&one, first, &camera), &plain[0]);
        assert_same_bits(&format!("second, {round}"), &show(&other, second, &camera), &plain[1]);
        assert_same_bits(&format!("none, {round}"), &show(&one, None, &camera), &plain[0]);
        assert_same_bits(&format!("none, other, {round}"), &show(&other, None, &camera), &plain[1]);
    }
    // Only vertices and triangles belong to a revision.
    let mut changed = Scene { table: Table::ramp(0.3), ..one.clone() };
    changed.light = Some(Light { toward: [0.0, 0.0, 1.0], ambient: 0.5, diffuse: 0.5 });
    changed.sheets.truncate(4);
    changed.sheets.iter_mut().for_each(|(_, sheet)| sheet.thickness = [0.7, 0.01]);
    for (what, camera) in cameras() {
        let expected = show(&changed, None, &camera);
        show(&one, first, &camera);
        assert_same_bits(&format!("other sheets, {what}"), &show(&changed, first, &camera), &expected);
    }
    assert_same_bits("as before", &show(&one, first, &camera), &plain[0]);
}

/// Sheets before there is a volume, and in turn with rays through one; pictures of every size.
pub fn sheets_and_rays_in_turn(backend: &mut dyn Backend) {
    let scene = stack(DVec3::Z, 6, 5, Table::ramp(1.0), 18);
    let camera = cameras()[0].1;
    let first = scene.draw(backend, &camera, SIZE);
    scene.compare("without a volume", &first, &camera, MAX);
    let volume =
        Volume::new([20, 18, 22], DVec3::ONE, Storage::unit(TexelType::U8), marschner_lobb([19, 17, 21]));
    let fitted = Camera::fitted(volume.extent(), 35.0, 25.0, 1.2, false);
    let tf = smooth_transfer(1.0);
    let rays = draw(backend, &volume, &tf, &fitted, SIZE);
    assert_same_bits("sheets after rays", &first, &scene.draw(backend, &camera, SIZE));
    for size in [[1, 1], [17, 5], [1, 33], [65, 1], [16, 16], [131, 67]] {
        let image = scene.draw(backend, &camera, size);
        assert_eq!([image.width, image.height], size);
        let sheets = scene.back_to_front(&camera);
        let expected = each_pixel(&camera, size, |ray| scene.seen(ray, &sheets, BACKGROUND_F64));
        let differs = |(a, b): &(&[f32; 3], &[f64; 3])| (0..3).any(|i| (f64::from(a[i]) - b[i]).abs() > 0.01);
        let num_wrong = image.pixels.iter().zip(&expected).filter(differs).count();
        println!("{size:?}: {num_wrong} of {} pixels differ (threshold 1 %)", expected.len());
        assert!(num_wrong * 100 <= expected.len(), "{size:?}: {num_wrong} pixels differ");
    }
    let again = draw(backend, &volume, &tf, &fitted, SIZE);
    assert_same_bits("rays after sheets", &rays, &again);
    assert_same_bits("sheets again", &first, &scene.draw(backend, &camera, SIZE));
}
