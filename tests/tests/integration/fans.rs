//! Cubes as fans: pictures against the integral of the very same cubes, and the cubes that are chosen.

use std::sync::{Arc, Mutex};

use glam::DVec3;
use rayon::ThreadPoolBuilder;
use volery::{
    BackendChoice, Camera, ControlPoint, Dial, How, Projection, Thickness, TransferFunction, View,
    ViewOptions, VolumeData,
};
use volery_frame::{Backend, Content, Cube, DrawError, Revision, VolumeLayout};
use volery_reference::Image;
use volery_scene::{Ray, VoxelGrid};
use volery_software::SoftwareBackend;
use volery_tests::{Drawer, at_most, backend, data_folder, distance, draw, exact, read_scene, view_of};

/// Keeps the cubes of the last frame.
struct Keeping {
    backend: Box<dyn Backend>,
    kept: Arc<Mutex<Vec<Cube>>>,
}

impl Backend for Keeping {
    volery_conformance::hand_on!(self, self.backend => device set_volume volume is_resident upload evict resident_bytes brick_bytes room reserve
        uploaded_bytes begin begin_windows draw_windows wait finished finish);

    fn draw_part(&mut self, content: &Content<'_>) -> Result<u32, DrawError> {
        let Content::Cubes(cubes) = content else { panic!("fans draw cubes") };
        *self.kept.lock().unwrap() = cubes.cubes.to_vec();
        self.backend.draw_part(content)
    }
}

/// A session whose cubes can be seen.
fn open(grid: VoxelGrid, backend: Box<dyn Backend>) -> (Drawer<VolumeData>, Arc<Mutex<Vec<Cube>>>) {
    let kept = Arc::default();
    let backend = Box::new(Keeping { backend, kept: Arc::clone(&kept) });
    (Drawer::volume(grid, backend, How::Fans(Thickness::Exact)).unwrap(), kept)
}

fn software(grid: VoxelGrid) -> (Drawer<VolumeData>, Arc<Mutex<Vec<Cube>>>) {
    open(grid, Box::new(SoftwareBackend::new()))
}

/// The voxels of a cube along an axis.
fn voxels(cube: &Cube, dims: [usize; 3], axis: usize) -> std::ops::Range<usize> {
    let first = usize::from(cube.index[axis]) << cube.level;
    first..(first + (1 << cube.level)).min(dims[axis])
}

/// Calls with the place of each voxel of a cube.
fn each_voxel(cube: &Cube, dims: [usize; 3], mut take: impl FnMut(usize)) {
    for z in voxels(cube, dims, 2) {
        for y in voxels(cube, dims, 1) {
            voxels(cube, dims, 0).for_each(|x| take((z * dims[1] + y) * dims[0] + x));
        }
    }
}

/// The cubes as a field: colour and extinction by voxel, stepped through from one voxel to the next in f64.
struct Steps {
    dims: [usize; 3],
    spacing: DVec3,
    matter: Vec<Option<([f64; 3], f64)>>,
}

impl Steps {
    fn new(grid: &VoxelGrid, cubes: &[Cube]) -> Self {
        let dims = grid.dims();
        let mut matter = vec![None; grid.num_samples()];
        for cube in cubes {
            let of_cube = Some((cube.color.map(f64::from), f64::from(cube.extinction)));
            each_voxel(cube, dims, |place| {
                assert!(matter[place].is_none(), "voxel {place} is in two cubes");
                matter[place] = of_cube;
            });
        }
        Self { dims, spacing: grid.spacing(), matter }
    }

    fn light(&self, ray: &Ray, background: [f64; 3]) -> [f64; 3] {
        let (origin, direction) = (ray.origin / self.spacing, ray.direction / self.spacing);
        let end = DVec3::from_array(self.dims.map(|n| (n - 1) as f64));
        let (low, high) = (-origin / direction, (end - origin) / direction);
        let mut here = low.min(high).max_element().max(0.0);
        let leave = low.max(high).min_element();
        let (mut light, mut transmittance) = ([0.0; 3], 1.0);
        while here < leave {
            // The next plane between voxels along each axis; the middle of the step tells which voxel it is in.
            let place = origin + direction * (here + 1e-9);
            let next = (0..3).fold(leave, |next, axis| {
                let voxel = (place[axis] + 0.5).floor();
                let plane = if direction[axis] > 0.0 { voxel + 0.5 } else { voxel - 0.5 };
                let depth = (plane - origin[axis]) / direction[axis];
                if depth > here { next.min(depth) } else { next }
            });
            let middle = origin + direction * ((here + next) / 2.0);
            let [x, y, z] = [0, 1, 2]
                .map(|axis| ((middle[axis] + 0.5).floor().max(0.0) as usize).min(self.dims[axis] - 1));
            if let Some((color, extinction)) = self.matter[(z * self.dims[1] + y) * self.dims[0] + x] {
                let opacity = -(-extinction * (next - here)).exp_m1();
                (0..3).for_each(|i| light[i] += transmittance * opacity * color[i]);
                transmittance *= 1.0 - opacity;
            }
            here = next;
        }
        std::array::from_fn(|i| light[i] + transmittance * background[i])
    }

    fn picture(&self, view: &View) -> Image {
        let rays = view.camera.rays(view.width, view.height);
        let pixels = (0..view.height).flat_map(|row| (0..view.width).map(move |column| (column, row)));
        let pixels = pixels.map(|(column, row)| self.light(&rays.pixel(column, row), view.background));
        Image::new(view.width, view.height, pixels.collect()).unwrap()
    }
}

by_both_backends! { engine_is_the_integral_of_its_cubes generated_volumes_are_the_integrals_of_their_cubes }

/// Largest root mean square difference from the integral: issue 4 asks for 1/255.
const MAX_RMSE: f64 = 1e-4;

/// Largest difference of any channel of any pixel. Software leaves a ray that lets 1/4096 through. A GPU puts vertices
/// on 1/256 of a pixel and misses what is that near to an outline: of a voxel a pixel or two wide, some thousandths of
/// its opacity; it stays below a step of the screen.
fn max_difference(choice: BackendChoice) -> f64 {
    if choice == BackendChoice::Software { 1.0 / 4096.0 + 2e-5 } else { 1.0 / 255.0 }
}

fn is_the_integral(
    (session, kept): (&mut Drawer<VolumeData>, &Mutex<Vec<Cube>>),
    view: &View,
    choice: BackendChoice,
    what: &str,
) {
    let picture = draw(session, view);
    let cubes = std::mem::take(&mut *kept.lock().unwrap());
    let expected = Steps::new(session.data().grid(), &cubes).picture(view);
    let found = distance(&format!("{what}, {} cubes", cubes.len()), &exact(&picture.image), &expected);
    at_most("rmse", found.rmse, MAX_RMSE);
    at_most("largest difference", found.max, max_difference(choice));
    let num_drawn = expected.pixels().iter().filter(|pixel| **pixel != view.background).count();
    assert!(num_drawn > 1000, "{what}: {num_drawn} pixels show something");
}

fn perspective(eye: DVec3, target: DVec3, fov_y_deg: f64) -> Camera {
    Camera {
        eye,
        target,
        up: DVec3::Z,
        projection: Projection::Perspective { fov_y_deg },
        is_mirrored: false,
    }
}

fn engine_is_the_integral_of_its_cubes(choice: BackendChoice, test: &str) {
    let Some(data) = data_folder(test) else { return };
    let Some(backend) = backend(choice, test) else { return };
    let input = read_scene(&data, "engine");
    let scene = View { width: 192, height: 160, how: How::Fans(Thickness::Exact), ..view_of(&input) };
    let (mut session, kept) = open(input.volume().unwrap().grid.clone(), backend);
    let (middle, inside) = (scene.camera.target, DVec3::new(101.3, 88.1, 40.7));
    for (place, camera) in [
        ("outside, 30 degrees", scene.camera),
        ("outside, 90 degrees", perspective(DVec3::new(260.0, -20.0, 150.0), middle, 90.0)),
        ("inside, 30 degrees", perspective(inside, middle + DVec3::new(90.0, 30.0, 0.0), 30.0)),
        ("inside, 90 degrees", perspective(inside, middle + DVec3::new(90.0, 30.0, 0.0), 90.0)),
    ] {
        for tolerance in [0.0, 0.18] {
            let view = View { camera, dial: Dial::Tolerance(tolerance), ..scene.clone() };
            is_the_integral(
                (&mut session, &kept),
                &view,
                choice,
                &format!("{test}, {place}, tolerance {tolerance}"),
            );
        }
    }
}

/// Volumes that break trees, in which everything is visible.
fn volumes() -> Vec<(&'static str, VoxelGrid)> {
    vec![
        ("prime", volery_data::noise([29, 17, 13], 1)),
        ("thin", volery_data::noise([2, 31, 15], 2)),
        ("least", volery_data::noise([2, 2, 2], 3)),
        ("anisotropic", volery_data::head([34, 30, 18], DVec3::new(1.0, 1.0, 10.0))),
        ("constant", volery_data::uniform([33, 17, 18], DVec3::ONE, 7.0)),
        ("holes", volery_data::holes([29, 19, 22], 4, 0.1)),
    ]
}

/// Red is the value's place in the range; opacity does not depend on it.
fn reddening(session: &Drawer<VolumeData>) -> TransferFunction {
    let [low, high] = session.value_range();
    let point = |value, red| ControlPoint { value, color: [red, 0.5, 1.0 - red], opacity: 0.1 };
    TransferFunction::new(vec![point(low, 0.0), point(high.max(low + 1.0), 1.0)], 1.0).unwrap()
}

fn whole_view(session: &Drawer<VolumeData>) -> View {
    let transfer = Some(reddening(session).into());
    session.view(&ViewOptions { width: 64, height: 56, transfer, ..ViewOptions::default() })
}

fn generated_volumes_are_the_integrals_of_their_cubes(choice: BackendChoice, test: &str) {
    for (name, grid) in volumes() {
        let Some(backend) = backend(choice, test) else { return };
        let (mut session, kept) = open(grid, backend);
        let view = View { width: 120, height: 90, ..whole_view(&session) };
        for tolerance in [0.0, 0.2, 2.0] {
            let view = View { dial: Dial::Tolerance(tolerance), ..view.clone() };
            is_the_integral((&mut session, &kept), &view, choice, &format!("{name}, tolerance {tolerance}"));
        }
    }
}

#[test]
fn cubes_are_within_the_tolerance_and_cover_every_voxel_once() {
    for (name, grid) in volumes() {
        let (mut session, kept) = software(grid.clone());
        let view = whole_view(&session);
        let [low, high] = session.value_range();
        let range = (high - low).max(1.0);
        for tolerance in [0.0, 0.05, 0.3, 0.7] {
            let report =
                draw(&mut session, &View { dial: Dial::Tolerance(tolerance), ..view.clone() }).report;
            let cubes = std::mem::take(&mut *kept.lock().unwrap());
            assert_eq!(report.work.nodes.unwrap(), cubes.len(), "{name}");
            assert!(tolerance > 0.0 || cubes.iter().all(|cube| cube.level == 0), "{name}: voxels alone");
            let mut times_covered = vec![0_u8; grid.num_samples()];
            let mut largest = 0.0_f64;
            for cube in &cubes {
                let (mut sum, mut count) = (0.0, 0.0);
                let mean = low + range * f64::from(cube.color[0]);
                each_voxel(cube, grid.dims(), |place| {
                    let value = grid.samples().value(place, 0);
                    times_covered[place] += 1;
                    largest = largest.max((value - mean).abs());
                    (sum, count) = (sum + value, count + 1.0);
                });
                let off = (mean - sum / count).abs() / range;
                assert!(off <= 1e-5, "{name}: a cube shows {mean}, its voxels have the mean {}", sum / count);
            }
            at_most(&format!("{name}, tolerance {tolerance}"), largest / range, tolerance + 1e-5);
            for (place, &times) in times_covered.iter().enumerate() {
                let expected = u8::from(grid.samples().value(place, 0).is_finite());
                assert_eq!(times, expected, "{name}, tolerance {tolerance}: voxel {place}");
            }
        }
    }
}

#[test]
fn no_cube_is_hidden_by_an_earlier_one() {
    let (mut session, kept) = software(volery_data::holes([11, 9, 7], 4, 0.1));
    let view = View { dial: Dial::Tolerance(0.25), ..whole_view(&session) };
    let layout = layout(session.data().grid());
    let eyes = [
        DVec3::new(-20.0, 14.0, 30.0),
        DVec3::new(4.2, -9.0, 3.1),
        DVec3::new(4.2, 3.7, 3.1),
        DVec3::new(3.5, 3.5, 3.5),
        DVec3::new(7.5, 2.0, 6.0),
        DVec3::new(3.5, 40.0, 3.5),
    ];
    let mut num_pairs = 0;
    for (eye, orthographic) in eyes.iter().flat_map(|&eye| [(eye, false), (eye, true)]) {
        let target = DVec3::new(5.0, 4.0, 3.01);
        let mut camera = perspective(eye, target, 120.0);
        if orthographic {
            camera.projection = Projection::Orthographic { height: 20.0 };
        }
        draw(&mut session, &View { camera, ..view.clone() });
        let cubes = std::mem::take(&mut *kept.lock().unwrap());
        assert!(cubes.iter().any(|cube| cube.level > 0) && cubes.iter().any(|cube| cube.level == 0));
        let rays = camera.rays(48, 48);
        for pixel in 0..48 * 48 {
            let ray = rays.pixel(pixel % 48, pixel / 48);
            let mut nearest_so_far = f64::INFINITY;
            for cube in &cubes {
                let Some([enter, _]) = span(&ray, cube, &layout) else { continue };
                assert!(enter < nearest_so_far + 1e-9, "from {eye} a cube at {enter} hides one drawn later");
                num_pairs += u32::from(nearest_so_far.is_finite());
                nearest_so_far = enter;
            }
        }
    }
    println!("{num_pairs} pairs along rays are in order");
    assert!(num_pairs > 50_000, "{num_pairs} pairs");
}

fn layout(grid: &VoxelGrid) -> VolumeLayout {
    VolumeLayout {
        revision: Revision::new(),
        cells: grid.dims().map(|n| n as u32 - 1),
        spacing: grid.spacing(),
        brick_cells: 1,
        texel: volery_frame::TexelType::F32,
        value_scale: 1.0,
        value_offset: 0.0,
        value_range: [0.0, 1.0],
    }
}

/// Where a ray enters and leaves a cube, if it is in it for more than rounding.
fn span(ray: &Ray, cube: &Cube, layout: &VolumeLayout) -> Option<[f64; 2]> {
    let [low, high] = cube
        .lattice_bounds(layout)
        .map(|corner| DVec3::from_array(corner.map(|i| f64::from(i) / 2.0)) * layout.spacing);
    let (a, b) = ((low - ray.origin) / ray.direction, (high - ray.origin) / ray.direction);
    let (enter, leave) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
    (leave > enter + 1e-6).then_some([enter, leave])
}

#[test]
fn transparent_cubes_are_skipped() {
    let grid = volery_data::noise([19, 14, 11], 9);
    let (mut session, kept) = software(grid.clone());
    let [low, high] = session.value_range();
    let middle = (low + high) / 2.0;
    let points = [(low, 0.0), (middle, 0.0), (middle, 0.4), (high, 0.4)];
    let points = points.map(|(value, opacity)| ControlPoint { value, color: [1.0; 3], opacity });
    let transfer = TransferFunction::new(points.to_vec(), 1.0).unwrap();
    let view = View { transfer: transfer.into(), ..whole_view(&session) };
    draw(&mut session, &view);
    let num_visible =
        (0..grid.num_samples()).filter(|&place| grid.samples().value(place, 0) > middle).count();
    let num_drawn = kept.lock().unwrap().len();
    println!("{num_drawn} of {} voxels are drawn, {num_visible} are above the step", grid.num_samples());
    assert!(num_visible > 100 && num_visible < grid.num_samples());
    let on_step = (0..grid.num_samples()).filter(|&place| grid.samples().value(place, 0) == middle).count();
    assert!((num_visible..=num_visible + on_step).contains(&num_drawn));
}

#[test]
fn the_number_of_threads_changes_neither_cubes_nor_pixels() {
    type Bits = Vec<[u32; 3]>;
    let mut expected: Option<(Vec<Cube>, [Bits; 2])> = None;
    for num_threads in [1, 2, 5] {
        let pool = ThreadPoolBuilder::new().num_threads(num_threads).build().unwrap();
        let found = pool.install(|| {
            let (mut session, kept) = software(volery_data::noise([67, 37, 41], 5));
            let view = View { dial: Dial::Tolerance(0.3), ..whole_view(&session) };
            let mut bits = |thickness| {
                let image = draw(&mut session, &View { how: How::Fans(thickness), ..view.clone() }).image;
                image.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect::<Bits>()
            };
            let pictures = [bits(Thickness::Exact), bits(Thickness::Interpolated)];
            (std::mem::take(&mut *kept.lock().unwrap()), pictures)
        });
        match &expected {
            None => expected = Some(found),
            Some(expected) => assert!(*expected == found, "{num_threads} threads make another picture"),
        }
    }
}

#[test]
fn triangles_are_those_of_the_fans() {
    let (mut session, kept) = software(volery_data::noise([13, 11, 9], 6));
    let layout = layout(session.data().grid());
    for (eye, orthographic) in [
        (DVec3::new(-20.0, 14.0, 30.0), false),
        (DVec3::new(5.0, 4.0, 40.0), false),
        (DVec3::new(5.2, 4.1, 3.0), false),
        (DVec3::new(5.0, 4.0, 40.0), true),
    ] {
        let target = DVec3::new(5.0, 4.0, if orthographic { 0.0 } else { 3.01 });
        let mut camera = Camera { up: DVec3::Y, ..perspective(eye, target, 120.0) };
        if orthographic {
            camera.projection = Projection::Orthographic { height: 20.0 };
        }
        let view = View { camera, ..whole_view(&session) };
        let report = draw(&mut session, &view).report;
        let viewpoint = if orthographic {
            volery_cubefan::Viewpoint::Direction((target - eye).to_array())
        } else {
            volery_cubefan::Viewpoint::Eye(eye.to_array())
        };
        let triangles = |cube: &Cube| {
            let [low, high] = cube.lattice_bounds(&layout).map(|corner| {
                std::array::from_fn(|axis| f64::from(corner[axis]) * layout.spacing[axis] / 2.0)
            });
            let cuboid = volery_cubefan::Cuboid { low, high };
            volery_cubefan::Fans::new(viewpoint, &cuboid).unwrap().triangles().len()
        };
        let expected: usize = kept.lock().unwrap().iter().map(triangles).sum();
        println!("from {eye}: {expected} triangles of {} cubes", report.work.nodes.unwrap());
        assert_eq!(report.work.triangles, Some(expected), "from {eye}, orthographic {orthographic}");
    }
}

#[test]
fn a_list_of_cubes_that_serves_again_is_the_one_of_a_new_session() {
    let grid = volery_data::marschner_lobb_u8(21);
    let (mut session, kept) = software(grid.clone());
    let middle = grid.extent() / 2.0;
    let mut num_cubes = 0;
    // Eyes that go through planes between voxels one by one, in and out of the volume and of its slabs; now and then the
    // rays are parallel, the view is narrow, the tolerance another.
    for step in 0..90_i32 {
        let along = f64::from(step / 2) / 15.0 - 1.5;
        let eye = middle + grid.extent() * DVec3::new(along, 0.3 - 0.7 * along, 1.6 - along.abs());
        let mut camera = Camera { up: DVec3::Y, ..perspective(eye, middle + 0.01, 60.0) };
        match step % 5 {
            3 => camera.projection = Projection::Orthographic { height: 60.0 },
            4 => camera.projection = Projection::Perspective { fov_y_deg: 12.0 },
            _ => {}
        }
        let dial = Dial::Tolerance(if step % 8 < 6 { 0.1 } else { 0.02 });
        let view = View { camera, dial, ..whole_view(&session) };
        draw(&mut session, &view);
        let (mut fresh, expected) = software(grid.clone());
        draw(&mut fresh, &view);
        let (found, expected) = (kept.lock().unwrap(), expected.lock().unwrap());
        assert!(
            *found == *expected,
            "step {step}: {} cubes, {} of a new session",
            found.len(),
            expected.len()
        );
        num_cubes += found.len();
    }
    println!("{num_cubes} cubes");
    assert!(num_cubes > 90_000, "{num_cubes} cubes");
}
