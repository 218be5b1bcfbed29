//! Pictures in parts: the same picture whatever it is cut into, and what is refused.

use glam::DVec3;
use volery_scene::mesh::shade;
use volery_scene::{Camera, Plane, TriangleMesh};

use volery_frame::{
    Backend, BlendedBrick, Brick, BrickId, Content, Counted, Cube, Cubes, DrawError, Drawn, Frame, Image,
    JoinedBrick, PictureView, PlacedBrick, Planes, PointTransfer, RayTransfer, Rays, Revision, Sampling,
    Sheet, SheetTransfer, SheetVertices, Sheets, TexelType, Texels, Thickness, UploadedBytes,
};

use super::STOP_TRANSMITTANCE;
use super::oracle::{assert_same_bits, assert_shows_something, difference};
use super::world::{
    BACKGROUND, BACKGROUND_F64, OwnedBrick, Storage, Volume, draw_bricks, draw_resident, hold,
    marschner_lobb, smooth_transfer, transfer,
};

pub(super) const SIZE: [u32; 2] = [97, 61];

/// Root mean square difference between a picture and the same in parts.
pub(super) const MAX_RMSE: f64 = 1e-6;

/// What worlds are painted in, and what stands before them.
const PAINTS: [[f64; 3]; 2] = [[0.9, 0.1, 0.2], [0.1, 0.3, 0.8]];
const SCREENS: [[f64; 3]; 2] = [[0.2, 0.8, 0.1], [0.8, 0.7, 0.3]];

/// Largest difference of a channel where all is opaque: a ray that stops.
const MAX_PAINT: f64 = STOP_TRANSMITTANCE + 5e-5;

/// Pixels per axis of a picture whose parts are timed, times that each is drawn, and the least share of its device's
/// seconds that parts must have: of planes, which are fast, a fifth goes to the picture's beginning and end.
const TIMED_SIZE: u32 = 384;
const NUM_TIMED: usize = 5;
const MIN_TIMED: f64 = 0.7;

/// Everything that can be seen of one volume.
pub(super) struct World {
    camera: Camera,
    volume: Volume,
    bricks: Vec<JoinedBrick>,
    blended: Vec<BlendedBrick>,
    ray_transfer: RayTransfer,
    point_transfer: PointTransfer,
    planes: [Plane; 3],
    shows_bricks: bool,
    /// Back to front, as are the sheets.
    cubes: Vec<Cube>,
    cubes_revision: Revision,
    sheets_revision: Revision,
    points: Vec<[f32; 4]>,
    triangles: Vec<[u32; 3]>,
    sheets: Vec<Sheet>,
    slabs: Vec<Sheet>,
    sheet_transfer: SheetTransfer,
    pub(super) meshes: [TriangleMesh; 2],
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    Rays,
    Planes,
    Cubes,
    Sheets,
    /// Without strips: what they make is never taken into the range of what is emitted.
    Slabs,
}

pub(super) const KINDS: [Kind; 5] = [Kind::Rays, Kind::Planes, Kind::Cubes, Kind::Sheets, Kind::Slabs];

impl World {
    /// Resident in a backend.
    pub(super) fn new(backend: &mut dyn Backend, is_orthographic: bool) -> Self {
        let storage = Storage { brick_cells: 4, ..Storage::unit(TexelType::U8) };
        let volume =
            Volume::new([23, 21, 25], DVec3::new(1.0, 1.1, 0.9), storage, marschner_lobb([22, 20, 24]));
        let camera = Camera::fitted(volume.extent(), 35.0, 25.0, 1.2, is_orthographic);
        let owned = volume.bricks(&camera);
        hold(backend, &volume, &owned);
        let bricks = owned.iter().map(|brick| brick.placed.into()).collect();
        let blended = |brick: &OwnedBrick| BlendedBrick { placed: brick.placed, low_corners: 0 };
        let blended = owned.iter().map(blended).collect();
        let function = smooth_transfer(4.0);
        let middle = volume.extent() * 0.5;
        let normals = [DVec3::new(1.0, 0.3, 0.2), DVec3::new(-0.2, 1.0, 0.1), DVec3::new(0.1, 0.4, -1.0)];
        let (points, triangles, sheets) = sheets(&volume, &camera);
        let corner = |x: f64, y: f64, z: f64| volume.extent() * DVec3::new(x, y, z);
        let mesh = |points, color| {
            TriangleMesh::new(points, vec![[0, 1, 2]], color).expect("the suite's meshes are right")
        };
        let meshes = [
            mesh(vec![corner(-0.2, 0.1, 0.6), corner(1.3, 0.2, 0.3), corner(0.4, 1.2, 0.5)], [0.9, 0.2, 0.1]),
            mesh(
                vec![corner(0.1, -0.3, 0.2), corner(0.9, 0.4, 1.4), corner(0.2, 0.9, -0.3)],
                [0.1, 0.3, 0.9],
            ),
        ];
        Self {
            ray_transfer: volume.integrated(&function),
            point_transfer: PointTransfer::new(&function, &volume.layout),
            shows_bricks: true,
            planes: normals.map(|normal| Plane::through(middle, normal)),
            cubes: cubes(&volume),
            cubes_revision: Revision::new(),
            sheets_revision: Revision::new(),
            sheet_transfer: SheetTransfer::new(
                &transfer(&[[0.0, 0.9, 0.4, 0.1, 0.05], [1.0, 0.2, 0.5, 0.9, 0.2]], 4.0),
                [0.0, 1.0],
            ),
            camera,
            volume,
            bricks,
            blended,
            points,
            triangles,
            slabs: sheets.iter().filter(|sheet| !sheet.is_strip()).copied().collect(),
            sheets,
            meshes,
        }
    }

    /// All opaque and of one colour; meshes cover the left half of the picture, nearer than all else, in another.
    fn painted(mut self, number: usize) -> Self {
        let [r, g, b] = PAINTS[number];
        let function = transfer(&[[0.0, r, g, b, 1.0], [1.0, r, g, b, 1.0]], 1.0);
        self.ray_transfer = self.volume.integrated(&function);
        self.point_transfer = PointTransfer::new(&function, &self.volume.layout);
        self.shows_bricks = false;
        for cube in &mut self.cubes {
            (cube.color, cube.extinction) = (PAINTS[number].map(|channel| channel as f32), f32::INFINITY);
        }
        // Of sheets both the values and the function matter: each with another's would be gray.
        let mut points = [[0.25, 0.5, 0.5, 0.5, 1.0], [0.75, 0.5, 0.5, 0.5, 1.0]];
        points[number][1..4].copy_from_slice(&PAINTS[number]);
        self.points.iter_mut().for_each(|point| point[3] = points[number][0] as f32);
        self.sheet_transfer = SheetTransfer::new(&transfer(&points, 1.0), [0.0, 1.0]);
        let [right, up, forward] = self.camera.axes();
        let depth = 0.05 * (self.camera.target - self.camera.eye).length();
        let corner = |x: f64, y: f64| self.camera.eye + depth * (forward + right * (x - 0.01) + up * y);
        let corners = vec![corner(0.0, -4.0), corner(0.0, 4.0), corner(-8.0, 0.0)];
        let screen = TriangleMesh::new(corners, vec![[0, 1, 2]], SCREENS[number]);
        self.meshes = [(); 2].map(|()| screen.clone().expect("the suite's meshes are right"));
        self
    }

    pub(super) fn view<'a>(&self, meshes: &'a [TriangleMesh]) -> PictureView<'a> {
        let [width, height] = SIZE;
        PictureView { width, height, camera: self.camera, background: BACKGROUND, meshes }
    }

    /// One kind of content in so many parts, front to back; some may be empty.
    pub(super) fn cut(&self, kind: Kind, num: usize) -> Vec<Content<'_>> {
        fn part<T>(list: &[T], number: usize, num: usize) -> &[T] {
            &list[number * list.len() / num..(number + 1) * list.len() / num]
        }
        let content = |number: usize| match kind {
            Kind::Rays => {
                Content::Rays(Rays { transfer: &self.ray_transfer, bricks: part(&self.bricks, number, num) })
            }
            Kind::Planes => Content::Planes(Planes {
                planes: &self.planes,
                bricks: part(&self.blended, number, num),
                transfer: &self.point_transfer,
                sampling: Sampling::Linear,
                is_transparent: true,
                shows_bricks: self.shows_bricks,
            }),
            Kind::Cubes => Content::Cubes(Cubes {
                // A part of the list is another list.
                revision: (num == 1).then_some(self.cubes_revision),
                cubes: part(&self.cubes, num - 1 - number, num),
                thickness: Thickness::Exact,
            }),
            Kind::Sheets | Kind::Slabs => Content::Sheets(Sheets {
                revision: Some(self.sheets_revision),
                normal: DVec3::Z,
                origin: DVec3::ZERO,
                vertices: SheetVertices::Exact { points: &self.points, gradients: &[] },
                triangles: &self.triangles,
                sheets: part(
                    if kind == Kind::Slabs { &self.slabs } else { &self.sheets },
                    num - 1 - number,
                    num,
                ),
                transfer: &self.sheet_transfer,
                light: None,
            }),
        };
        (0..num).map(content).collect()
    }

    pub(super) fn whole(&self, kind: Kind) -> Content<'_> {
        self.cut(kind, 1)[0]
    }

    pub(super) fn draw(
        &self,
        backend: &mut dyn Backend,
        meshes: &[TriangleMesh],
        content: Content<'_>,
    ) -> Drawn {
        let frame = Frame { view: self.view(meshes), content };
        backend.draw(&frame).expect("the suite's frames are right")
    }
}

/// Cubes of a volume in an order that may be anything: it is the same for all.
fn cubes(volume: &Volume) -> Vec<Cube> {
    let places = (0..6 * 5 * 6_u16).map(|i| [i % 6, i / 6 % 5, i / 30]);
    let cube = |index: [u16; 3]| {
        let at = DVec3::from_array(index.map(f64::from)) * 4.0;
        let value = volume.trilinear(at) as f32;
        Cube { index, level: 2, color: [value, 0.5, 1.0 - value], extinction: 0.05 * value }
    };
    places.rev().map(cube).collect()
}

/// A stack of slabs across z and strips between them, back to front.
fn sheets(volume: &Volume, camera: &Camera) -> (Vec<[f32; 4]>, Vec<[u32; 3]>, Vec<Sheet>) {
    let extent = volume.extent();
    let (mut points, mut triangles, mut sheets) = (Vec::new(), Vec::new(), Vec::new());
    for number in 0..80 {
        let first = points.len() as u32;
        let z = extent.z * f64::from(number) / 79.0;
        for [x, y] in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]] {
            // Every fourth is a strip that leans.
            let z = if number % 4 == 3 { z + 0.2 * x } else { z };
            points.push([x * extent.x, y * extent.y, z, 0.2 + 0.5 * x * y].map(|part| part as f32));
        }
        let is_strip = number % 4 == 3;
        let thickness = if is_strip { [-0.02 - z as f32, 1.0] } else { [0.3, 0.0] };
        sheets.push(Sheet { first: triangles.len() as u32, count: 2, thickness, counted: Counted::All });
        triangles.extend([[0, 1, 2], [3, 2, 1]].map(|corners| corners.map(|corner| first + corner)));
    }
    if camera.eye.z > extent.z {
        (points, triangles, sheets)
    } else {
        sheets.reverse();
        (points, triangles, sheets)
    }
}

fn draw_parts(backend: &mut dyn Backend, view: &PictureView<'_>, parts: &[Content<'_>]) -> Drawn {
    backend.begin(view).expect("the suite's pictures are small");
    for (number, part) in (0..).zip(parts) {
        assert_eq!(backend.draw_part(part), Ok(number), "the number of a part");
    }
    backend.finish().expect("a picture was begun")
}

pub(super) fn wide(image: &Image) -> Vec<[f64; 3]> {
    image.pixels.iter().map(|pixel| pixel.map(f64::from)).collect()
}

pub(super) fn assert_like(what: &str, found: &Image, expected: &Image, max_rmse: f64) {
    let [max, rmse] = difference(found, &wide(expected));
    println!("{what}: max {max:.2e}, rmse {rmse:.2e} (threshold {max_rmse:e})");
    assert!(rmse <= max_rmse, "{what}: rmse {rmse:e}, expected at most {max_rmse:e}");
}

/// In 1, 7 and 50 parts, with meshes and without; the doubt of rays adds up.
pub fn pictures_in_parts_are_the_same(backend: &mut dyn Backend) {
    for is_orthographic in [false, true] {
        let world = World::new(backend, is_orthographic);
        for (kind, meshes) in KINDS.into_iter().flat_map(|kind| [(kind, &[][..]), (kind, &world.meshes)]) {
            let whole = world.draw(backend, meshes, world.whole(kind));
            assert_shows_something(&format!("{kind:?}"), &wide(&whole.image), BACKGROUND_F64);
            for num in [1, 7, 50] {
                let what = format!("{kind:?} with {} meshes in {num} parts", meshes.len());
                let drawn = draw_parts(backend, &world.view(meshes), &world.cut(kind, num));
                assert_like(&what, &drawn.image, &whole.image, MAX_RMSE);
                assert_eq!(drawn.ray_doubt.is_some(), whole.ray_doubt.is_some(), "{what}: a doubt");
                let doubts = drawn.ray_doubt.zip(whole.ray_doubt);
                let least = |doubt: f32| doubt * (1.0 - 1e-4);
                assert!(
                    doubts.is_none_or(|(found, whole)| found.cells >= least(whole.cells)
                        && found.table_way >= least(whole.table_way)
                        && found.touching >= least(whole.touching)),
                    "{what}: {doubts:?}, expected no less than of the whole"
                );
            }
        }
    }
}

/// What is in front hides what is behind as a filter of its own would, whatever kinds the two are.
pub fn parts_of_several_kinds_make_one_picture(backend: &mut dyn Backend) {
    let world = World::new(backend, false);
    let alone = |backend: &mut dyn Backend, kind, gray: f32| {
        let frame = Frame {
            view: PictureView { background: [gray; 3], ..world.view(&[]) },
            content: world.whole(kind),
        };
        wide(&backend.draw(&frame).expect("the suite's frames are right").image)
    };
    let kinds = KINDS.into_iter().filter(|&kind| kind != Kind::Sheets);
    for front in kinds.clone() {
        // Before black it shows its own light, and before white what it lets through besides.
        let [black, white] = [0.0, 1.0].map(|gray| alone(backend, front, gray));
        for back in kinds.clone() {
            let behind = world.draw(backend, &[], world.whole(back)).image;
            let parts = [world.whole(front), world.whole(back)];
            let drawn = draw_parts(backend, &world.view(&[]), &parts);
            let expected = (0..behind.pixels.len()).map(|pixel| {
                let through = |i: usize| white[pixel][i] - black[pixel][i];
                [0, 1, 2].map(|i| black[pixel][i] + through(i) * f64::from(behind.pixels[pixel][i]))
            });
            let [max, rmse] = difference(&drawn.image, &expected.collect());
            // A ray is integrated as finely as the light asks that is left.
            let most = if back == Kind::Rays { 1e-3 } else { 1e-5 };
            println!("{front:?} before {back:?}: max {max:.2e} (threshold {most:e}), rmse {rmse:.2e}");
            assert!(max <= most, "{front:?} before {back:?}: {max:e}, expected at most {most:e}");
        }
    }
}

/// Bricks that were forgotten are missed, their memory is used again, and what comes in their place is what is shown.
pub fn evicted_bricks_leave_room_for_others(backend: &mut dyn Backend) {
    let storage = Storage { brick_cells: 4, ..Storage::unit(TexelType::U8) };
    let field = marschner_lobb([22, 20, 24]);
    let volume = Volume::new([23, 21, 25], DVec3::ONE, storage, field);
    let camera = Camera::fitted(volume.extent(), 35.0, 25.0, 1.2, false);
    let function = smooth_transfer(4.0);
    let bricks = volume.bricks(&camera);
    let whole = draw_bricks(backend, &volume, &function, &camera, SIZE, &bricks);
    let bytes = backend.resident_bytes();
    for round in 0..3 {
        let (gone, stay) = bricks.split_at(bricks.len() / 3 + round);
        let ids: Vec<_> = gone.iter().map(|brick| brick.placed.id).collect();
        backend.evict(&[&ids[..], &[BrickId(1 << 50)]].concat());
        assert!(ids.iter().all(|&id| !backend.is_resident(id)), "evicted bricks are resident");
        assert!(stay.iter().all(|brick| backend.is_resident(brick.placed.id)), "others are not");
        assert!(backend.resident_bytes() <= bytes, "resident bytes after an eviction");
        let ray_transfer = volume.integrated(&function);
        let placed: Vec<_> = bricks.iter().map(|brick| brick.placed.into()).collect();
        let [width, height] = SIZE;
        let view = PictureView { width, height, camera, background: BACKGROUND, meshes: &[] };
        let content = Content::Rays(Rays { transfer: &ray_transfer, bricks: &placed });
        let found = backend.draw(&Frame { view, content });
        assert_eq!(found.err(), Some(DrawError::NotResident { id: ids[0] }), "a frame with evicted bricks");
        // Others in their place, and then those that were there, in another order.
        let blank = [0_u8; 125];
        let other = |(number, [x, y, z]): (u64, [u32; 3])| {
            let texels = Texels::U8(&blank[..(x * y * z) as usize]);
            Brick { id: BrickId(1 << 40 | number), samples: [x, y, z], texels }
        };
        let others: Vec<_> = (0..).zip(gone.iter().map(|brick| brick.samples)).map(other).collect();
        backend.upload(&others).expect("the suite's bricks fit");
        assert!(backend.resident_bytes() <= bytes, "resident bytes after as many came as went");
        backend.evict(&others.iter().map(|brick| brick.id).collect::<Vec<_>>());
        let lent: Vec<_> = gone.iter().rev().map(|brick| brick.lend()).collect();
        backend.upload(&lent).expect("the suite's bricks fit");
        assert!(backend.resident_bytes() <= bytes, "resident bytes after all came back");
        let image = draw_resident(backend, &volume, &function, &camera, SIZE, &bricks);
        assert_same_bits(&format!("after eviction {round}"), &image, &whole);
    }
}

/// Tables, cubes, sheets and surfaces that change under revisions of their own, and back: nothing that was kept shows in
/// place of another. All is opaque, so what each pixel shows is known.
pub fn nothing_that_was_kept_is_stale(backend: &mut dyn Backend) {
    let worlds = [0, 1].map(|number| World::new(backend, false).painted(number));
    let [width, height] = SIZE;
    let [left, middle] = [width / 4, width / 2].map(|column| [column, height / 2]);
    let ray = worlds[0].camera.rays(width, height).pixel(left[0], left[1]);
    let lit = shade(worlds[0].camera.axes()[2].dot(ray.direction));
    for kind in KINDS.into_iter().filter(|&kind| kind != Kind::Sheets) {
        for (content, screen) in [(0, 0), (0, 0), (1, 0), (1, 1), (0, 1), (0, 0), (1, 1), (1, 0), (0, 1)] {
            let image =
                worlds[screen].draw(backend, &worlds[screen].meshes, worlds[content].whole(kind)).image;
            for ([column, row], expected) in
                [(left, SCREENS[screen].map(|channel| channel * lit)), (middle, PAINTS[content])]
            {
                let found = image.pixels[(row * width + column) as usize];
                let what = format!("{kind:?} of world {content} behind meshes of world {screen}");
                let error = (0..3).map(|i| (f64::from(found[i]) - expected[i]).abs()).fold(0.0, f64::max);
                println!("{what}: pixel {column}, {row} off by {error:.1e} (threshold {MAX_PAINT:e})");
                assert!(error <= MAX_PAINT, "{what}: {column}, {row} is {found:?}, expected {expected:?}");
            }
        }
    }
}

/// Cameras that go around, and see more of the bricks and less: after the first picture nothing is sent that does not
/// depend on the camera, and pictures are those of a backend that has seen no other.
pub fn cameras_that_move_upload_nothing(backend: &mut dyn Backend) {
    let mut world = World::new(backend, false);
    let (bricks, blended) = (world.bricks.clone(), world.blended.clone());
    for kind in KINDS {
        let mut before = None;
        for step in 0..20 {
            let turn = f64::from(step) * 18.0;
            world.camera = Camera::fitted(world.volume.extent(), turn, 25.0, 1.2, step % 2 == 1);
            // In another order, and now and then without those that might be out of sight.
            let place = |brick: &PlacedBrick| brick.id.0.rotate_left(step) & 0xffff_ffff;
            let is_seen = |brick: &PlacedBrick| step == 0 || step % 3 > 0 || brick.first_cell[0] < 12;
            world.bricks = bricks.iter().copied().filter(|brick| is_seen(&brick.placed)).collect();
            world.bricks.sort_by_key(|brick| place(&brick.placed));
            world.blended = blended.iter().copied().filter(|brick| is_seen(&brick.placed)).collect();
            world.blended.sort_by_key(|brick| place(&brick.placed));
            world.sheets.reverse();
            world.draw(backend, &world.meshes, world.whole(kind));
            let uploaded = UploadedBytes { views: 0, choices: 0, ..backend.uploaded_bytes() };
            let before = *before.get_or_insert(uploaded);
            assert_eq!(uploaded, before, "{kind:?}: bytes sent by picture {step}");
        }
        println!("{kind:?}: {:?}", backend.uploaded_bytes());
    }
}

/// Every part is told once, and after the end all are.
pub fn finished_parts_are_told_once(backend: &mut dyn Backend) {
    let world = World::new(backend, false);
    let parts = world.cut(Kind::Rays, 7);
    for _ in 0..2 {
        let mut told = Vec::new();
        backend.begin(&world.view(&[])).expect("the suite's pictures are small");
        assert_eq!(backend.finished(), [], "parts before there are any");
        for part in &parts {
            backend.draw_part(part).expect("the suite's parts are right");
            told.extend(backend.finished());
        }
        println!("{} of {} parts are told before the end", told.len(), parts.len());
        backend.finish().expect("a picture was begun");
        told.extend(backend.finished());
        let mut numbers: Vec<_> = told.iter().map(|part| part.number).collect();
        numbers.sort_unstable();
        assert_eq!(numbers, [0, 1, 2, 3, 4, 5, 6], "parts that were told");
        let is_time = |seconds: f64| seconds >= 0.0 && seconds.is_finite();
        assert!(told.iter().all(|part| part.device_seconds.is_none_or(is_time)), "{told:?}");
        assert_eq!(backend.finished(), [], "parts told twice");
    }
}

/// Whoever waits hears of all parts before the end, and does not wait where there is nothing to wait for.
pub fn parts_can_be_waited_for(backend: &mut dyn Backend) {
    let world = World::new(backend, false);
    assert_eq!(backend.wait(), Ok(()), "a wait without a picture");
    backend.begin(&world.view(&[])).expect("the suite's pictures are small");
    for part in &world.cut(Kind::Rays, 7) {
        backend.draw_part(part).expect("the suite's parts are right");
    }
    let mut told = Vec::new();
    // Each wait is for one at least; a device may be done with one a moment before it tells.
    for _ in 0..1000 {
        assert_eq!(backend.wait(), Ok(()));
        told.extend(backend.finished());
        if told.len() == 7 {
            break;
        }
    }
    assert_eq!(told.len(), 7, "parts told after waiting");
    backend.finish().expect("a picture was begun");
    assert_eq!(backend.finished(), [], "parts told twice");
}

/// In 1, 7 and 50 parts: the device's seconds of parts are those of the picture, but for what comes before the first part
/// and after the last. A backend without a clock has none to compare.
pub fn times_of_parts_add_up(backend: &mut dyn Backend) {
    let world = World::new(backend, false);
    let view = PictureView { width: TIMED_SIZE, height: TIMED_SIZE, ..world.view(&[]) };
    for kind in KINDS {
        let mut of_one_part = None;
        for num in [1, 7, 50] {
            let parts = world.cut(kind, num);
            let mut timed = || {
                let whole = draw_parts(backend, &view, &parts).device_seconds;
                let told = backend.finished();
                assert_eq!(told.len(), num, "{kind:?}: parts that were told");
                let each = told.iter().map(|part| part.device_seconds);
                Some((each.sum::<Option<f64>>()?, whole?))
            };
            timed();
            let Some(mut times) = (0..NUM_TIMED).map(|_| timed()).collect::<Option<Vec<_>>>() else {
                println!("{kind:?}: no clock");
                return;
            };
            times.sort_by(|a, b| (a.0 / a.1).total_cmp(&(b.0 / b.1)));
            let (sum, whole) = times[NUM_TIMED / 2];
            let share = sum / whole;
            println!(
                "{kind:?} in {num} parts: {:.2} ms of {:.2} ms, {share:.3} (threshold {MIN_TIMED} to 1), {:.2} times one part",
                1e3 * sum,
                1e3 * whole,
                sum / *of_one_part.get_or_insert(sum)
            );
            assert!(
                (MIN_TIMED..=1.0 + 1e-9).contains(&share),
                "{kind:?} in {num} parts: parts took {share} of the picture, expected {MIN_TIMED} to 1"
            );
        }
    }
}

/// Parts and ends without a beginning are refused. A part that is wrong adds nothing, and a picture that was left does
/// not show in the next.
pub fn pictures_are_begun_and_ended(backend: &mut dyn Backend) {
    let world = World::new(backend, false);
    let (part, view) = (world.whole(Kind::Rays), world.view(&world.meshes));
    let is_refused = |backend: &mut dyn Backend, when: &str| {
        assert_eq!(backend.draw_part(&part), Err(DrawError::NoPicture), "a part {when}");
        assert_eq!(backend.finish().err(), Some(DrawError::NoPicture), "an end {when}");
    };
    is_refused(backend, "without a beginning");
    let expected = world.draw(backend, &world.meshes, part).image;
    is_refused(backend, "after the end");
    backend.begin(&view).expect("the suite's pictures are small");
    let found = backend.begin(&PictureView { width: 0, ..view });
    assert!(matches!(found, Err(DrawError::Size { width: 0, .. })), "{found:?}, expected DrawError::Size");
    is_refused(backend, "after a beginning that failed");

    backend.begin(&world.view(&[])).expect("the suite's pictures are small");
    backend.draw_part(&world.whole(Kind::Cubes)).expect("the suite's parts are right");
    backend.begin(&view).expect("the suite's pictures are small");
    let missing = [PlacedBrick { id: BrickId(1 << 50), first_cell: [0; 3], level: 0 }.into()];
    let missing = Content::Rays(Rays { transfer: &world.ray_transfer, bricks: &missing });
    let not_resident = Err(DrawError::NotResident { id: BrickId(1 << 50) });
    assert_eq!(backend.draw_part(&missing), not_resident, "a part with a missing brick");
    assert_eq!(backend.draw_part(&part), Ok(0), "a part after one that was refused");
    let drawn = backend.finish().expect("a picture was begun");
    assert_same_bits(
        "a picture after one that was left, without the part that was refused",
        &drawn.image,
        &expected,
    );
    let told: Vec<_> = backend.finished().iter().map(|part| part.number).collect();
    assert_eq!(told, [0], "parts that were told");

    let bare = draw_parts(backend, &view, &[]).image;
    let no_bricks = Content::Rays(Rays { transfer: &world.ray_transfer, bricks: &[] });
    let expected = world.draw(backend, &world.meshes, no_bricks).image;
    assert_same_bits("a picture without parts", &bare, &expected);
}
