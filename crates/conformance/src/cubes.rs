//! Cubes of constant matter: alone, in fields, around the eye, of all extinctions, by both ways of their lengths.
//!
//! What is expected comes from chords in f64, of each ray through each cube, put in order by where they begin. A
//! backend may be off by a hundredth of a pixel where a picture jumps: a pixel around which the expected light changes
//! within that is not compared, and such pixels must be few.

use glam::DVec3;
use volery_scene::{Camera, Projection, Ray};

use volery_frame::{
    Backend, Content, Cube, Cubes, Frame, Image, PictureView, Revision, TexelType, Thickness, VolumeLayout,
};

use super::STOP_TRANSMITTANCE;
use super::oracle::{assert_background, assert_close, assert_shows_something, chord, each_pixel, over};
use super::world::{BACKGROUND, BACKGROUND_F64};

const SIZE: [u32; 2] = [61, 47];

/// Largest and root mean square difference: lengths in f32, a ray that stops.
const MAX: f64 = STOP_TRANSMITTANCE + 1e-3;
const RMSE: f64 = 2e-4;

fn layout(cells: [u32; 3], spacing: DVec3) -> VolumeLayout {
    VolumeLayout {
        revision: Revision::new(),
        cells,
        spacing,
        brick_cells: 8,
        texel: TexelType::U8,
        value_scale: 1.0,
        value_offset: 0.0,
        value_range: [0.0, 255.0],
    }
}

fn extent(layout: &VolumeLayout) -> DVec3 {
    DVec3::from_array(layout.cells.map(f64::from)) * layout.spacing
}

/// A cube in the world, from its definition.
fn world_bounds(cube: &Cube, layout: &VolumeLayout) -> [DVec3; 2] {
    let size = f64::from(cube.level).exp2();
    let low = DVec3::from_array(cube.index.map(f64::from)) * size - 0.5;
    let end = DVec3::from_array(layout.cells.map(f64::from));
    [low, low + size].map(|corner| corner.clamp(DVec3::ZERO, end) * layout.spacing)
}

/// Light along one ray, in whatever order the cubes come.
fn light(ray: &Ray, cubes: &[Cube], layout: &VolumeLayout) -> [f64; 3] {
    let met = cubes.iter().filter_map(|cube| {
        let [low, high] = world_bounds(cube, layout);
        chord(ray, low, high).map(|span| (span, cube))
    });
    let mut met: Vec<_> = met.collect();
    met.sort_by(|([a, _], _), ([b, _], _)| b.total_cmp(a));
    met.iter().fold(BACKGROUND_F64, |behind, ([enter, leave], cube)| {
        let depth = f64::from(cube.extinction) * (leave - enter);
        over(cube.color.map(f64::from), depth, behind)
    })
}

fn draw(
    backend: &mut dyn Backend,
    layout: &VolumeLayout,
    cubes: &[Cube],
    thickness: Thickness,
    camera: &Camera,
    [width, height]: [u32; 2],
) -> Image {
    assert!(camera.defects().is_empty(), "the suite's camera: {:?}", camera.defects());
    backend.set_volume(layout).expect("the suite's volumes are small");
    let content = Content::Cubes(Cubes { revision: None, cubes, thickness });
    let frame = Frame {
        view: PictureView { width, height, camera: *camera, background: BACKGROUND, meshes: &[] },
        content,
    };
    backend.draw(&frame).expect("cubes need no brick").image
}

/// Draws cubes and compares them with their chords.
fn assert_like_chords(
    backend: &mut dyn Backend,
    what: &str,
    layout: &VolumeLayout,
    cubes: &[Cube],
    thickness: Thickness,
    camera: &Camera,
) {
    let mut image = draw(backend, layout, cubes, thickness, camera, SIZE);
    let mut expected = each_pixel(camera, SIZE, |ray| light(ray, cubes, layout));
    let rays = camera.rays(SIZE[0], SIZE[1]);
    let mut num_unsure = 0;
    for (index, expected) in (0..).zip(&mut expected) {
        let [x, y] = [index % SIZE[0], index / SIZE[0]].map(|i| f64::from(i) + 0.5);
        let is_unsure =
            [[0.01, 0.003], [-0.003, 0.01], [-0.01, -0.003], [0.003, -0.01]].iter().any(|[dx, dy]| {
                let beside = light(&rays.ray(x + dx, y + dy), cubes, layout);
                (0..3).any(|i| (beside[i] - expected[i]).abs() > 0.02)
            });
        if is_unsure {
            num_unsure += 1;
            *expected = BACKGROUND_F64;
            image.pixels[index as usize] = BACKGROUND;
        }
    }
    println!("{what}: {num_unsure} of {} pixels not compared (threshold 3 %)", expected.len());
    assert!(num_unsure * 100 <= 3 * expected.len(), "{what}: {num_unsure} pixels change within a hundredth");
    assert_shows_something(what, &expected, BACKGROUND_F64);
    assert_close(what, &image, &expected, MAX, RMSE);
}

/// Numbers in [0, 1), the same in every run.
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Random cubes of the lower levels, back to front.
struct Field<'a> {
    layout: &'a VolumeLayout,
    camera: &'a Camera,
    random: Random,
    /// Of cubes: those that stay whole, and of these, those that are drawn.
    shares: [f64; 2],
    /// Per world length.
    max_extinction: f64,
    cubes: Vec<Cube>,
}

fn field(
    layout: &VolumeLayout,
    camera: &Camera,
    shares: [f64; 2],
    max_extinction: f64,
    seed: u64,
) -> Vec<Cube> {
    let largest = layout.cells.into_iter().max().unwrap_or(0);
    let root = (0..20).find(|&level| 1 << level > largest).unwrap_or(20);
    let mut field = Field { layout, camera, random: Random(seed), shares, max_extinction, cubes: Vec::new() };
    field.visit(root, [0; 3]);
    field.cubes
}

/// With gaps.
const SHARES: [f64; 2] = [0.3, 0.85];

impl Field<'_> {
    fn visit(&mut self, level: u16, index: [u16; 3]) {
        if level > 3 || level > 0 && self.random.next() >= self.shares[0] {
            self.children(level, index);
        } else if self.random.next() < self.shares[1] {
            let color = [self.random.next() as f32, self.random.next() as f32, self.random.next() as f32];
            let extinction = (self.max_extinction * self.random.next().powi(3)) as f32;
            self.cubes.push(Cube { index, level, color, extinction });
        }
    }

    /// Those on the far side of the planes between them first.
    fn children(&mut self, level: u16, index: [u16; 3]) {
        let half = f64::from(level - 1).exp2();
        let near = (0..3).fold(0_u16, |near, axis| {
            let plane = (f64::from(2 * index[axis] + 1) * half - 0.5) * self.layout.spacing[axis];
            let is_upper = match self.camera.projection {
                Projection::Perspective { .. } => self.camera.eye[axis] > plane,
                Projection::Orthographic { .. } => self.camera.target[axis] < self.camera.eye[axis],
            };
            near | u16::from(is_upper) << axis
        });
        for flips in [7, 6, 5, 3, 4, 2, 1, 0] {
            let child: [u16; 3] = std::array::from_fn(|axis| 2 * index[axis] + ((near ^ flips) >> axis & 1));
            let is_inside =
                |axis: usize| f64::from(child[axis]) * half - 0.5 < f64::from(self.layout.cells[axis]);
            if (0..3).all(is_inside) {
                self.visit(level - 1, child);
            }
        }
    }
}

fn perspective(eye: DVec3, target: DVec3, fov_y_deg: f64) -> Camera {
    let up = if (target - eye).normalize().z.abs() > 0.99 { DVec3::Y } else { DVec3::Z };
    Camera { eye, target, up, projection: Projection::Perspective { fov_y_deg }, is_mirrored: false }
}

const ORANGE: [f32; 3] = [1.0, 0.5, 0.1];

/// Lower corner at 3.5, upper at 7.5, in finest cells of [`ALONE`].
const CUBE: Cube = Cube { index: [1; 3], level: 2, color: ORANGE, extinction: 0.3 };
const ALONE: [u32; 3] = [12; 3];

/// One cube from outside: all classes, and in part beside the picture.
pub fn one_cube_is_its_chords(backend: &mut dyn Backend) {
    let layout = layout(ALONE, DVec3::ONE);
    let middle = DVec3::splat(5.5);
    for (eye, fov_y_deg) in [
        (DVec3::new(5.6, 5.3, -4.0), 50.0),
        (DVec3::new(14.0, -3.0, 5.2), 35.0),
        (DVec3::new(-4.0, 16.0, 13.0), 30.0),
        (DVec3::new(5.5, 12.0, 5.5), 50.0),
        (DVec3::new(7.7, 7.9, 7.6), 100.0),
    ] {
        let camera = perspective(eye, middle, fov_y_deg);
        let what = format!("one cube from {eye}");
        assert_like_chords(backend, &what, &layout, &[CUBE], Thickness::Exact, &camera);
    }
    for orthographic in [
        Camera::fitted(DVec3::splat(11.0), 25.0, 40.0, 1.6, true),
        Camera::fitted(DVec3::splat(11.0), 0.0, 0.0, 2.0, true),
        Camera::fitted(DVec3::splat(11.0), -90.0, 35.0, 1.6, true),
    ] {
        let what = format!("one cube orthographic from {}", orthographic.eye);
        assert_like_chords(backend, &what, &layout, &[CUBE], Thickness::Exact, &orthographic);
        assert_like_chords(backend, &what, &layout, &[CUBE], Thickness::Interpolated, &orthographic);
    }
}

/// The eye in a cube, in its faces, edges and corners, and a cube across the plane of the eye.
pub fn cubes_around_the_eye(backend: &mut dyn Backend) {
    let layout = layout(ALONE, DVec3::ONE);
    let along = DVec3::new(0.3, 0.8, -0.2);
    for eye in [
        DVec3::new(5.1, 6.0, 4.4),
        DVec3::new(5.5, 5.5, 5.5),
        DVec3::new(5.1, 3.5, 4.4),
        DVec3::new(3.5, 3.5, 4.4),
        DVec3::new(3.5, 3.5, 7.5),
        DVec3::new(5.0, 5.0, 8.1),
        DVec3::new(2.9, 4.0, 5.0),
    ] {
        for thickness in [Thickness::Exact, Thickness::Interpolated] {
            // Interpolated lengths of a cube that is seen from outside are others.
            let is_outside = eye.z > 7.5 || eye.x < 3.5;
            if thickness == Thickness::Interpolated && is_outside {
                continue;
            }
            let camera = perspective(eye, eye + along, 90.0);
            let what = format!("eye at {eye}, {thickness:?}");
            assert_like_chords(backend, &what, &layout, &[CUBE], thickness, &camera);
        }
    }
    let eye = DVec3::new(5.4, 5.2, 5.3);
    let projection = Projection::Orthographic { height: 7.0 };
    let camera = Camera { eye, target: eye + along, up: DVec3::Z, projection, is_mirrored: false };
    assert_like_chords(backend, "across the orthographic plane", &layout, &[CUBE], Thickness::Exact, &camera);
}

/// What is behind the eye or beside the picture is not seen; nor is an empty list.
pub fn cubes_out_of_sight(backend: &mut dyn Backend) {
    let layout = layout(ALONE, DVec3::ONE);
    let eye = DVec3::new(5.5, -6.0, 5.5);
    let away = perspective(eye, eye - DVec3::Y, 120.0);
    let beside = perspective(eye, eye + DVec3::X, 60.0);
    let orthographic = Camera { projection: Projection::Orthographic { height: 30.0 }, ..away };
    let towards = perspective(eye, DVec3::splat(5.5), 60.0);
    for thickness in [Thickness::Exact, Thickness::Interpolated] {
        for (what, cubes, camera) in [
            ("behind", &[CUBE][..], away),
            ("beside", &[CUBE][..], beside),
            ("behind the orthographic plane", &[CUBE][..], orthographic),
            ("no cube", &[][..], towards),
            ("beyond the domain", &[Cube { index: [9, 0, 0], ..CUBE }][..], towards),
        ] {
            let image = draw(backend, &layout, cubes, thickness, &camera, SIZE);
            assert_background(&format!("{what}, {thickness:?}"), &image, BACKGROUND);
        }
    }
}

/// From nothing to infinity; the limits are exact to the digits of f32.
pub fn cubes_of_all_extinctions(backend: &mut dyn Backend) {
    let layout = layout(ALONE, DVec3::ONE);
    let camera = perspective(DVec3::new(-2.0, -9.0, 9.0), DVec3::splat(5.5), 30.0);
    for thickness in [Thickness::Exact, Thickness::Interpolated] {
        for extinction in [0.0, 1e-30] {
            let cube = Cube { extinction, ..CUBE };
            let image = draw(backend, &layout, &[cube], thickness, &camera, SIZE);
            assert_background(&format!("extinction {extinction:e}, {thickness:?}"), &image, BACKGROUND);
        }
        // An infinite length is no length: expected is what no light gets through.
        for extinction in [1e30, f32::MAX, f32::INFINITY] {
            let cube = Cube { extinction: extinction.min(1e30), ..CUBE };
            let behind = Cube { index: [1, 2, 1], color: [0.0, 0.0, 1.0], ..cube };
            let what = format!("extinction {extinction:e}, {thickness:?}");
            let expected = each_pixel(&camera, SIZE, |ray| light(ray, &[behind, cube], &layout));
            let cubes = [behind, cube].map(|cube| Cube { extinction, ..cube });
            let image = draw(backend, &layout, &cubes, thickness, &camera, SIZE);
            let differs =
                |(a, b): &(&[f32; 3], &[f64; 3])| (0..3).any(|i| (f64::from(a[i]) - b[i]).abs() > 1e-5);
            let num_wrong = image.pixels.iter().zip(&expected).filter(differs).count();
            // Outlines alone may jump: those of two cubes are some 150 pixels long, of which a hundredth is unsure.
            println!("{what}: {num_wrong} pixels are neither (threshold 6)");
            assert!(num_wrong <= 6, "{what}: {num_wrong} pixels are neither cube nor background");
            assert_shows_something(&what, &expected, BACKGROUND_F64);
        }
    }
    // Light of nearly nothing keeps its digits.
    let cube = Cube { extinction: 1e-6, color: [3e4, 1e3, 2e5], ..CUBE };
    let image = draw(backend, &layout, &[cube], Thickness::Exact, &camera, SIZE);
    let expected = each_pixel(&camera, SIZE, |ray| light(ray, &[cube], &layout));
    assert_close("thin and bright", &image, &expected, 2e-3, 2e-4);
}

/// Random fields of all levels, from outside and inside, near and far.
pub fn fields_of_cubes_are_their_integrals(backend: &mut dyn Backend) {
    let layout = layout([20, 13, 17], DVec3::ONE);
    let middle = extent(&layout) / 2.0;
    let cameras = [
        ("30 degrees", perspective(middle + DVec3::new(30.0, -41.0, 23.0), middle, 30.0)),
        ("90 degrees", perspective(middle + DVec3::new(-9.0, 13.0, 8.0), middle, 90.0)),
        ("inside", perspective(DVec3::new(9.3, 6.1, 7.7), DVec3::new(20.0, 2.0, 3.0), 90.0)),
        ("on a corner of cubes", perspective(DVec3::new(7.5, 7.5, 7.5), DVec3::new(0.0, 4.0, 16.0), 75.0)),
        ("orthographic", Camera::fitted(extent(&layout), 30.0, 20.0, 1.1, true)),
        ("straight orthographic", {
            let camera = Camera::fitted(extent(&layout), 90.0, 0.0, 1.1, true);
            // No ray in a face: there either side is right.
            let aside = DVec3::new(0.0, 0.13, 0.21);
            Camera { eye: camera.eye + aside, target: camera.target + aside, ..camera }
        }),
        ("far", {
            let away = DVec3::new(0.6, -0.7, 0.4).normalize() * 1e6;
            perspective(middle + away, middle, (2.0 * f64::atan(13.0 / 1e6)).to_degrees())
        }),
    ];
    for (seed, (what, camera)) in (1..).zip(&cameras) {
        let cubes = field(&layout, camera, SHARES, 0.8, seed);
        assert!(cubes.len() > 300, "{what}: {} cubes", cubes.len());
        assert_like_chords(backend, what, &layout, &cubes, Thickness::Exact, camera);
    }
}

/// Cells of unequal edges, of tiny ones and of huge ones.
pub fn cubes_of_all_spacings(backend: &mut dyn Backend) {
    for spacing in
        [DVec3::new(1.0, 1.0, 10.0), DVec3::new(0.3, 2.0, 0.7), DVec3::splat(1e-9), DVec3::splat(1e9)]
    {
        let layout = layout([11, 14, 9], spacing);
        let extent = extent(&layout);
        for orthographic in [false, true] {
            let camera = Camera::fitted(extent, 35.0, 25.0, 1.2, orthographic);
            let cubes = field(&layout, &camera, SHARES, 0.7 / spacing.min_element(), 77);
            let what = format!("spacing {spacing}, orthographic {orthographic}");
            assert_like_chords(backend, &what, &layout, &cubes, Thickness::Exact, &camera);
            if orthographic {
                assert_like_chords(backend, &what, &layout, &cubes, Thickness::Interpolated, &camera);
            }
        }
    }
}

/// Between parallel rays the length is linear, so interpolation is exact, many small cubes on a pixel or one large.
pub fn interpolated_lengths_of_parallel_rays_are_exact(backend: &mut dyn Backend) {
    let layout = layout([20, 13, 17], DVec3::ONE);
    for (azimuth, elevation, zoom) in [(30.0, 20.0, 1.2), (-140.0, 65.0, 4.0), (200.0, -35.0, 0.5)] {
        let camera = Camera::fitted(extent(&layout), azimuth, elevation, zoom, true);
        let cubes = field(&layout, &camera, SHARES, 0.8, 5);
        let what = format!("parallel from {azimuth}, {elevation}, zoom {zoom}");
        assert_like_chords(backend, &what, &layout, &cubes, Thickness::Interpolated, &camera);
    }
}

/// Straight before a cube in perspective: over the far face the length is that at its corners, and from there to the
/// outline it falls in proportion. The exact length differs by up to a sixth of it here.
pub fn interpolated_lengths_are_linear_on_the_screen(backend: &mut dyn Backend) {
    let layout = layout(ALONE, DVec3::ONE);
    let (side, distance) = (4.0, 4.0);
    let camera = perspective(DVec3::new(5.5, 3.5 - distance, 5.5), DVec3::splat(5.5), 60.0);
    let [near, far] = [side / 2.0 / distance, side / 2.0 / (distance + side)];
    let length = side * (1.0 + 2.0 * far * far).sqrt();
    let expected = each_pixel(&camera, SIZE, |ray| {
        let slope = (ray.direction.x.abs()).max(ray.direction.z.abs()) / ray.direction.y;
        let share = ((near - slope) / (near - far)).clamp(0.0, 1.0);
        over(ORANGE.map(f64::from), f64::from(CUBE.extinction) * length * share, BACKGROUND_F64)
    });
    let image = draw(backend, &layout, &[CUBE], Thickness::Interpolated, &camera, SIZE);
    assert_shows_something("interpolated", &expected, BACKGROUND_F64);
    assert_close("interpolated", &image, &expected, 2e-3, 3e-4);
    let exact = draw(backend, &layout, &[CUBE], Thickness::Exact, &camera, SIZE);
    let [max, _] = super::oracle::difference(&exact, &expected);
    println!("exact from interpolated: {max:.4} (at least 0.02)");
    assert!(max >= 0.02, "interpolated and exact lengths differ by {max} only");
}

/// Rays that run in the faces between cubes meet matter once, not twice and not never.
pub fn rays_in_shared_faces_count_once(backend: &mut dyn Backend) {
    let layout = layout([16, 16, 16], DVec3::ONE);
    for (axis, up) in [(DVec3::X, DVec3::Z), (DVec3::Y, DVec3::Z), (DVec3::Z, DVec3::Y)] {
        for side in [-1.0, 1.0] {
            // A pixel per half cell, all centres on lattice planes.
            let eye = DVec3::splat(7.75) + axis * side * 20.0;
            let projection = Projection::Orthographic { height: 15.0 };
            let camera = Camera { eye, target: eye - axis * side, up, projection, is_mirrored: false };
            let mut whole = field(&layout, &camera, [0.3, 1.0], 1.0, 3);
            whole.iter_mut().for_each(|cube| (cube.color, cube.extinction) = (ORANGE, 0.05));
            let size = [30, 30];
            let expected =
                each_pixel(&camera, size, |_| over(ORANGE.map(f64::from), 0.05 * 16.0, BACKGROUND_F64));
            let image = draw(backend, &layout, &whole, Thickness::Exact, &camera, size);
            assert_close(&format!("along {axis} from {side}"), &image, &expected, 1e-4, 1e-5);
        }
    }
}
