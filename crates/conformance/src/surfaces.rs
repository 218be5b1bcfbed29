//! Opaque surfaces among matter, planes and cubes: where they hide, where they are veiled, what they end.
//!
//! What is expected comes from every ray against every triangle in f64. A backend may be off by a hundredth of a pixel
//! where a picture jumps, as with cubes: such pixels are not compared, and must be few.

use glam::DVec3;
use volery_scene::mesh::shade;
use volery_scene::{Camera, Plane, Projection, Ray, TransferFunction, TriangleMesh};

use volery_frame::{
    Backend, BlendedBrick, Content, Counted, Cube, Cubes, Frame, Image, JoinedBrick, PictureView, Planes,
    PointTransfer, Rays, Sampling, Sheet, SheetTransfer, SheetVertices, Sheets, TexelType, Thickness,
};

use super::STOP_TRANSMITTANCE;
use super::cubes::Random;
use super::oracle::{
    Pixels, assert_close, assert_same_bits, assert_shows_something, chord, difference, each_pixel, over,
};
use super::world::{BACKGROUND, BACKGROUND_F64, OwnedBrick, Storage, Volume, hold, transfer};

const SIZE: [u32; 2] = [67, 53];

/// Largest and root mean square difference: places and shades in f32, a ray that stops.
const MAX: f64 = STOP_TRANSMITTANCE + 5e-5;
const RMSE: f64 = 6e-5;

/// Most pixels in whose neighbourhood the picture may jump, as a share of all.
const MAX_UNSURE: f64 = 0.05;

/// What a ray ends at.
struct End {
    distance: f64,
    color: [f64; 3],
}

/// Every triangle (Möller and Trumbore 1997); the first of equals.
fn end_of(ray: &Ray, meshes: &[TriangleMesh]) -> End {
    let mut end = End { distance: f64::INFINITY, color: BACKGROUND_F64 };
    for mesh in meshes {
        for triangle in mesh.triangles() {
            let [a, b, c] = triangle.map(|corner| mesh.points()[corner as usize]);
            let (along, across) = (b - a, c - a);
            let p = ray.direction.cross(across);
            let inverse = along.dot(p).recip();
            let from = ray.origin - a;
            let (u, q) = (from.dot(p) * inverse, from.cross(along));
            let (v, distance) = (ray.direction.dot(q) * inverse, across.dot(q) * inverse);
            if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance >= 0.0 && distance < end.distance {
                let cosine = along.cross(across).normalize().dot(ray.direction);
                end = End { distance, color: mesh.color().map(|channel| channel * shade(cosine)) };
            }
        }
    }
    end
}

/// A volume of one value, whose matter has this extinction per world length.
struct World {
    volume: Volume,
    bricks: Vec<OwnedBrick>,
    transfer: TransferFunction,
    color: [f64; 3],
    extinction: f64,
}

fn world(camera: &Camera, opacity: f64) -> World {
    let volume =
        Volume::new([21, 17, 13], DVec3::new(1.0, 1.25, 1.5), Storage::plain(TexelType::F32), |_| 0.5);
    let color = [0.9, 0.6, 0.3];
    let transfer = transfer(&[[0.0, color[0], color[1], color[2], opacity]], 4.0);
    let bricks = volume.cut(camera, |level, first| level > 1 || first[0] == 0);
    World { extinction: transfer.extinction_of_opacity(opacity), volume, bricks, transfer, color }
}

impl World {
    /// Light of a ray that ends.
    fn light(&self, ray: &Ray, end: &End) -> [f64; 3] {
        match chord(ray, DVec3::ZERO, self.volume.extent()) {
            Some([enter, leave]) if end.distance > enter => {
                over(self.color, self.extinction * (leave.min(end.distance) - enter), end.color)
            }
            _ => end.color,
        }
    }

    fn hold(&self, backend: &mut dyn Backend) {
        hold(backend, &self.volume, &self.bricks);
    }

    fn draw_rays(
        &self,
        backend: &mut dyn Backend,
        camera: &Camera,
        meshes: &[TriangleMesh],
        size: [u32; 2],
    ) -> Image {
        let bricks: Vec<JoinedBrick> = self.bricks.iter().map(|brick| brick.placed.into()).collect();
        let transfer = &self.volume.integrated(&self.transfer);
        draw(backend, camera, meshes, size, Content::Rays(Rays { transfer, bricks: &bricks }))
    }
}

fn draw(
    backend: &mut dyn Backend,
    camera: &Camera,
    meshes: &[TriangleMesh],
    [width, height]: [u32; 2],
    content: Content<'_>,
) -> Image {
    assert!(camera.defects().is_empty(), "the suite's camera: {:?}", camera.defects());
    let frame = Frame {
        view: PictureView { width, height, camera: *camera, background: BACKGROUND, meshes },
        content,
    };
    backend.draw(&frame).expect("the suite's frames are right").image
}

/// Meshes alone, before a volume without bricks.
fn draw_alone(backend: &mut dyn Backend, camera: &Camera, meshes: &[TriangleMesh], size: [u32; 2]) -> Image {
    let world = world(camera, 0.5);
    backend.set_volume(&world.volume.layout).expect("the suite's volumes are small");
    let transfer = &world.volume.integrated(&world.transfer);
    draw(backend, camera, meshes, size, Content::Rays(Rays { transfer, bricks: &[] }))
}

/// Compares a picture with what rays see, but where that changes within a hundredth of a pixel.
fn assert_like(what: &str, mut image: Image, camera: &Camera, light: impl Fn(&Ray) -> [f64; 3]) {
    let size = [image.width, image.height];
    let mut expected: Pixels = each_pixel(camera, size, &light);
    let rays = camera.rays(size[0], size[1]);
    let mut num_unsure = 0;
    for (index, expected) in (0..).zip(&mut expected) {
        let [x, y] = [index % size[0], index / size[0]].map(|i| f64::from(i) + 0.5);
        let is_unsure =
            [[0.01, 0.003], [-0.003, 0.01], [-0.01, -0.003], [0.003, -0.01]].iter().any(|[dx, dy]| {
                let beside = light(&rays.ray(x + dx, y + dy));
                (0..3).any(|i| (beside[i] - expected[i]).abs() > 0.003)
            });
        if is_unsure {
            num_unsure += 1;
            *expected = BACKGROUND_F64;
            image.pixels[index as usize] = BACKGROUND;
        }
    }
    let share = f64::from(num_unsure) / expected.len() as f64;
    println!("{what}: {share:.3} of the pixels not compared (threshold {MAX_UNSURE})");
    assert!(share <= MAX_UNSURE, "{what}: {share} of the pixels change within a hundredth");
    assert_shows_something(what, &expected, BACKGROUND_F64);
    assert_close(what, &image, &expected, MAX, RMSE);
}

fn perspective(eye: DVec3) -> Camera {
    let target = DVec3::new(10.0, 10.0, 9.0);
    Camera {
        eye,
        target,
        up: DVec3::Z,
        projection: Projection::Perspective { fov_y_deg: 45.0 },
        is_mirrored: false,
    }
}

fn orthographic(eye: DVec3) -> Camera {
    Camera { projection: Projection::Orthographic { height: 30.0 }, ..perspective(eye) }
}

/// Outside, inside, parallel.
fn cameras() -> [(&'static str, Camera); 3] {
    let outside = DVec3::new(38.0, -19.0, 22.0);
    [
        ("perspective", perspective(outside)),
        ("eye inside", perspective(DVec3::new(17.0, 3.0, 12.0))),
        ("orthographic", orthographic(outside)),
    ]
}

fn mesh(points: &[[f64; 3]], triangles: &[[u32; 3]], color: [f64; 3]) -> TriangleMesh {
    let points = points.iter().map(|&point| DVec3::from_array(point)).collect();
    TriangleMesh::new(points, triangles.to_vec(), color).expect("the suite's meshes are right")
}

/// Before, within and behind the volume, and through one another.
fn triangles() -> Vec<TriangleMesh> {
    let one = &[[0, 1, 2]];
    vec![
        mesh(&[[24.0, -8.0, 4.0], [29.0, -3.0, 22.0], [21.0, -9.0, 21.0]], one, [0.9, 0.1, 0.1]),
        mesh(&[[2.0, 18.0, 1.0], [19.0, 4.0, 3.0], [9.0, 9.0, 30.0]], one, [0.1, 0.9, 0.2]),
        mesh(&[[-9.0, 8.0, -6.0], [-3.0, 30.0, 24.0], [14.0, 36.0, 2.0]], one, [0.2, 0.3, 1.0]),
        mesh(&[[4.0, -4.0, 10.0], [30.0, 12.0, 9.0], [-4.0, 26.0, 12.0]], one, [0.9, 0.9, 0.1]),
    ]
}

/// A ball of `2 * rows * columns` triangles or a little less, that touch at its poles.
fn ball(center: DVec3, radius: f64, rows: u32, columns: u32, color: [f64; 3]) -> TriangleMesh {
    let mut points = Vec::new();
    for row in 0..=rows {
        for column in 0..columns {
            let latitude = std::f64::consts::PI * f64::from(row) / f64::from(rows);
            let longitude = std::f64::consts::TAU * f64::from(column) / f64::from(columns);
            let (sine, height) = latitude.sin_cos();
            points.push(center + radius * DVec3::new(sine * longitude.cos(), sine * longitude.sin(), height));
        }
    }
    let mut triangles = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let [a, b] = [column, (column + 1) % columns].map(|column| row * columns + column);
            let [c, d] = [a + columns, b + columns];
            triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    TriangleMesh::new(points, triangles, color).expect("the suite's meshes are right")
}

/// Every ray of uniform matter has a closed form up to where it ends.
pub fn surfaces_end_rays(backend: &mut dyn Backend) {
    for (name, camera) in cameras() {
        for opacity in [0.3, 0.9] {
            let (world, meshes) = (world(&camera, opacity), triangles());
            world.hold(backend);
            let image = world.draw_rays(backend, &camera, &meshes, SIZE);
            let what = format!("triangles in matter of opacity {opacity}, {name}");
            assert_like(&what, image, &camera, |ray| world.light(ray, &end_of(ray, &meshes)));
        }
    }
}

/// Planes before a surface veil it, those behind it are hidden, and where it goes through one it hides a part.
pub fn surfaces_among_planes(backend: &mut dyn Backend) {
    let planes = [
        Plane { normal: DVec3::X, distance: 9.0 },
        Plane { normal: DVec3::new(0.3, -0.5, 0.8), distance: 4.0 },
        Plane { normal: DVec3::Z, distance: 15.0 },
    ];
    for (name, camera) in cameras() {
        for is_transparent in [false, true] {
            let (world, meshes) = (world(&camera, 0.6), triangles());
            world.hold(backend);
            let bricks: Vec<_> = world
                .bricks
                .iter()
                .map(|brick| BlendedBrick { placed: brick.placed, low_corners: 0 })
                .collect();
            let content = Content::Planes(Planes {
                planes: &planes,
                bricks: &bricks,
                transfer: &PointTransfer::new(&world.transfer, &world.volume.layout),
                sampling: Sampling::Linear,
                is_transparent,
                shows_bricks: false,
            });
            let image = draw(backend, &camera, &meshes, SIZE, content);
            let (extent, opacity) = (world.volume.extent(), if is_transparent { 0.6 } else { 1.0 });
            let light = |ray: &Ray| {
                let end = end_of(ray, &meshes);
                let depth = |plane: &Plane| {
                    (plane.distance - plane.normal.dot(ray.origin)) / plane.normal.dot(ray.direction)
                };
                let is_seen = |depth: &f64| {
                    let place = ray.origin + ray.direction * *depth;
                    *depth >= 0.0 && *depth < end.distance && place.clamp(DVec3::ZERO, extent) == place
                };
                // All places look alike: their number counts.
                let num_seen = planes.iter().map(depth).filter(is_seen).count();
                (0..num_seen).fold(end.color, |behind, _| {
                    std::array::from_fn(|i| opacity * world.color[i] + (1.0 - opacity) * behind[i])
                })
            };
            assert_like(&format!("triangles among planes, {name}, {is_transparent}"), image, &camera, light);
        }
    }
}

/// Chords of cubes are cut where rays end.
pub fn surfaces_cut_cubes(backend: &mut dyn Backend) {
    for (name, camera) in cameras() {
        let world = world(&camera, 0.5);
        let meshes = triangles();
        let layout = &world.volume.layout;
        backend.set_volume(layout).expect("the suite's volumes are small");
        let mut random = Random(7);
        // One cube of level 3 in each of a few places that no other covers.
        let mut cubes: Vec<Cube> = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 1], [2, 1, 1], [1, 0, 1]]
            .map(|index| Cube {
                index,
                level: 3,
                color: std::array::from_fn(|_| random.next() as f32),
                extinction: (0.02 + 0.3 * random.next()) as f32,
            })
            .to_vec();
        let bounds = |cube: &Cube| {
            let size = 8.0;
            let low = DVec3::from_array(cube.index.map(f64::from)) * size - 0.5;
            let cells = DVec3::from_array(layout.cells.map(f64::from));
            [low, low + size].map(|corner| corner.clamp(DVec3::ZERO, cells) * layout.spacing)
        };
        // Cubes of one size on a lattice: the nearer middle is in front.
        let depth = |cube: &Cube| {
            let [low, high] = bounds(cube);
            let nearest = camera.eye.clamp(low, high);
            match camera.projection {
                Projection::Perspective { .. } => nearest.distance(camera.eye),
                Projection::Orthographic { .. } => (0.5 * (low + high) - camera.eye).dot(camera.axes()[2]),
            }
        };
        cubes.sort_by(|a, b| depth(b).total_cmp(&depth(a)));
        for thickness in [Thickness::Exact, Thickness::Interpolated] {
            // In perspective lengths that are interpolated are off.
            if thickness == Thickness::Interpolated && name != "orthographic" {
                continue;
            }
            let image = draw(
                backend,
                &camera,
                &meshes,
                SIZE,
                Content::Cubes(Cubes { revision: None, cubes: &cubes, thickness }),
            );
            let light = |ray: &Ray| {
                let end = end_of(ray, &meshes);
                let chord_of = |cube: &Cube| {
                    let [low, high] = bounds(cube);
                    let [enter, leave] = chord(ray, low, high)?;
                    (enter < end.distance).then(|| (enter, leave.min(end.distance) - enter, *cube))
                };
                let mut met: Vec<_> = cubes.iter().filter_map(chord_of).collect();
                met.sort_by(|(a, ..), (b, ..)| b.total_cmp(a));
                met.iter().fold(end.color, |behind, (_, length, cube)| {
                    over(cube.color.map(f64::from), f64::from(cube.extinction) * length, behind)
                })
            };
            assert_like(&format!("triangles among cubes, {name}, {thickness:?}"), image, &camera, light);
        }
    }
}

/// A sheet as the oracle has it: a square at a height, tilted, of a thickness with a slope along the vertical.
struct Slab {
    height: f64,
    tilt: f64,
    thickness: [f32; 2],
}

/// How far squares reach.
const REACH: f64 = 40.0;

impl Slab {
    fn corners(&self) -> [DVec3; 4] {
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|[x, y]| DVec3::new(10.0 + REACH * x, 10.0 + REACH * y, self.height + self.tilt * x))
    }

    /// Depth along a ray and length in the slab, with its sign.
    fn meet(&self, ray: &Ray) -> Option<(f64, f64)> {
        let [a, b, c, _] = self.corners();
        let normal = (b - a).cross(c - a);
        let depth = normal.dot(a - ray.origin) / normal.dot(ray.direction);
        let place = ray.origin + ray.direction * depth;
        let is_met = depth >= 0.0 && (place - DVec3::new(10.0, 10.0, place.z)).abs().max_element() <= REACH;
        let thickness = f64::from(self.thickness[0]) + f64::from(self.thickness[1]) * place.z;
        is_met.then(|| (depth, thickness / ray.direction.z.abs()))
    }

    /// What is before the end of a ray.
    fn length_before(&self, depth: f64, length: f64, end: f64) -> f64 {
        if self.thickness[1] == 0.0 {
            length * ((end - depth) / length + 0.5).clamp(0.0, 1.0)
        } else {
            length * f64::from(u8::from(depth < end))
        }
    }
}

/// Seven slabs and what has a slope, far ones first.
fn slabs(camera: &Camera) -> Vec<Slab> {
    let mut slabs: Vec<Slab> =
        (0..7).map(|i| Slab { height: 1.0 + 2.3 * f64::from(i), tilt: 0.0, thickness: [2.3, 0.0] }).collect();
    slabs.push(Slab { height: 8.5, tilt: 0.3, thickness: [-8.0, 1.0] });
    // Parallel rays go down.
    let is_parallel = matches!(camera.projection, Projection::Orthographic { .. });
    let far = |slab: &Slab| if is_parallel { -slab.height } else { (slab.height - camera.eye.z).abs() };
    slabs.sort_by(|a, b| far(b).total_cmp(&far(a)));
    slabs
}

/// Of slabs the part that is before a surface counts; what has a slope counts where it is before it.
pub fn surfaces_cut_sheets(backend: &mut dyn Backend) {
    for (name, camera) in cameras() {
        let (slabs, meshes) = (slabs(&camera), triangles());
        let (color, extinction) = ([0.9_f32, 0.6, 0.3], 0.07_f32);
        let entries = vec![[color[0], color[1], color[2], extinction]; 2];
        let transfer = SheetTransfer::of_entries(entries, 2, [0.0, 1.0], [0.0, 1.0]);
        let point = |corner: DVec3| [corner.x as f32, corner.y as f32, corner.z as f32, 0.5];
        let points: Vec<[f32; 4]> = slabs.iter().flat_map(Slab::corners).map(point).collect();
        let numbers: Vec<[u32; 3]> = (0..slabs.len() as u32)
            .flat_map(|i| [[0, 1, 2], [0, 2, 3]].map(|triangle| triangle.map(|corner| 4 * i + corner)))
            .collect();
        let sheet = |(place, slab): (u32, &Slab)| Sheet {
            first: 2 * place,
            count: 2,
            thickness: slab.thickness,
            counted: Counted::All,
        };
        let sheets: Vec<Sheet> = (0..).zip(&slabs).map(sheet).collect();
        let content = Content::Sheets(Sheets {
            revision: None,
            normal: DVec3::Z,
            origin: DVec3::ZERO,
            vertices: SheetVertices::Exact { points: &points, gradients: &[] },
            triangles: &numbers,
            sheets: &sheets,
            transfer: &transfer,
            light: None,
        });
        let image = draw(backend, &camera, &meshes, SIZE, content);
        let light = |ray: &Ray| {
            let end = end_of(ray, &meshes);
            slabs.iter().fold(end.color, |behind, slab| {
                let Some((depth, length)) = slab.meet(ray) else { return behind };
                let length = slab.length_before(depth, length, end.distance);
                over(color.map(f64::from), (f64::from(extinction) * length).max(-0.5), behind)
            })
        };
        assert_like(&format!("triangles among sheets, {name}"), image, &camera, light);
    }
}

/// What the eye is within, and a floor that reaches past it.
pub fn surfaces_around_the_eye(backend: &mut dyn Backend) {
    let room = ball(DVec3::new(16.0, 4.0, 11.0), 30.0, 5, 7, [0.7, 0.8, 0.4]);
    let floor = mesh(
        &[[-900.0, -700.0, -3.0], [800.0, -900.0, -2.0], [0.0, 1500.0, -4.0]],
        &[[0, 1, 2]],
        [0.3, 0.5, 0.9],
    );
    let behind =
        mesh(&[[60.0, -30.0, 20.0], [70.0, -40.0, 40.0], [50.0, -60.0, 10.0]], &[[2, 1, 0]], [1.0; 3]);
    for (name, camera) in cameras() {
        for meshes in [vec![room.clone()], vec![behind.clone(), floor.clone()]] {
            let world = world(&camera, 0.3);
            world.hold(backend);
            let image = world.draw_rays(backend, &camera, &meshes, SIZE);
            let what = format!("surfaces around the eye, {name}");
            assert_like(&what, image, &camera, |ray| world.light(ray, &end_of(ray, &meshes)));
        }
    }
}

/// A ball's outline and shades, with no matter at all.
pub fn balls_have_their_outline(backend: &mut dyn Backend) {
    for (name, camera) in cameras() {
        let meshes = [ball(DVec3::new(9.0, 11.0, 8.0), 7.0, 12, 20, [1.0, 0.7, 0.5])];
        let image = draw_alone(backend, &camera, &meshes, SIZE);
        assert_like(&format!("a ball, {name}"), image, &camera, |ray| end_of(ray, &meshes).color);
    }
}

/// Two triangles that share a side leave no gap: nothing of the background shows within their outline.
pub fn surfaces_have_no_gaps(backend: &mut dyn Backend) {
    let size = [160, 120];
    for (name, camera) in cameras() {
        // Slivers around points that are no pixel's.
        for (center, num) in [(DVec3::new(9.3, 10.1, 8.7), 700), (DVec3::new(30.0, 40.0, -20.0), 311)] {
            let [right, up, forward] = camera.axes();
            let mut points = vec![center];
            points.extend((0..num).map(|i| {
                let angle = std::f64::consts::TAU * f64::from(i) / f64::from(num);
                center
                    + 400.0 * (right * angle.cos() + up * angle.sin())
                    + forward * (40.0 * (3.0 * angle).cos() + 60.0)
            }));
            let triangles = (1..=num).map(|i| [0, i, i % num + 1]).collect();
            let meshes =
                [TriangleMesh::new(points, triangles, [1.0, 0.0, 0.0])
                    .expect("the suite's meshes are right")];
            let image = draw_alone(backend, &camera, &meshes, size);
            let num_gaps = image.pixels.iter().filter(|pixel| pixel[1] != 0.0 || pixel[0] < 0.25).count();
            println!("{num} slivers, {name}: {num_gaps} pixels show the background (threshold 0)");
            assert_eq!(num_gaps, 0, "{num} slivers, {name}");
        }
    }
}

/// Of surfaces in the same place the first shows, of one mesh or of two.
pub fn the_first_of_equal_surfaces_shows(backend: &mut dyn Backend) {
    for (name, camera) in cameras() {
        let [first, second] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
            .map(|color| ball(DVec3::new(9.0, 11.0, 8.0), 7.0, 9, 14, color));
        let alone = draw_alone(backend, &camera, std::slice::from_ref(&first), SIZE);
        let both = draw_alone(backend, &camera, &[first, second], SIZE);
        assert_same_bits(&format!("a surface and another in its place, {name}"), &alone, &both);
    }
}

/// No mesh, and a mesh without triangles, change no bit.
pub fn no_surface_changes_nothing(backend: &mut dyn Backend) {
    let empty = [mesh(&[[1.0; 3]], &[], [1.0; 3]), mesh(&[], &[], [0.0; 3])];
    let behind_the_eye =
        mesh(&[[60.0, -30.0, 20.0], [70.0, -40.0, 40.0], [50.0, -60.0, 10.0]], &[[0, 1, 2]], [1.0; 3]);
    for (name, camera) in cameras() {
        let world = world(&camera, 0.4);
        world.hold(backend);
        let without = world.draw_rays(backend, &camera, &[], SIZE);
        let with = world.draw_rays(backend, &camera, &empty, SIZE);
        assert_same_bits(&format!("meshes without triangles, {name}"), &without, &with);
        let unseen = world.draw_rays(backend, &camera, std::slice::from_ref(&behind_the_eye), SIZE);
        let expected: Pixels = without.pixels.iter().map(|pixel| pixel.map(f64::from)).collect();
        let [max, _] = difference(&unseen, &expected);
        println!("a triangle behind the eye, {name}: largest difference {max:.1e} (threshold 1e-6)");
        assert!(max <= 1e-6, "a triangle behind the eye, {name}: {max}");
        let again = world.draw_rays(backend, &camera, &[], SIZE);
        assert_same_bits(&format!("after a frame with a mesh, {name}"), &without, &again);
    }
}

/// An eye so far away that 32 bits cannot tell neighbours from there.
pub fn surfaces_seen_from_afar(backend: &mut dyn Backend) {
    let toward_eye = DVec3::new(0.7, -0.6, 0.4).normalize();
    let target = DVec3::new(10.0, 10.0, 9.0);
    let eye = target + toward_eye * 1e6;
    let fov_y_deg = 2.0 * (15.0_f64 / 1e6).atan().to_degrees();
    let camera = Camera { projection: Projection::Perspective { fov_y_deg }, ..perspective(eye) };
    for (name, camera) in [("perspective", camera), ("orthographic", orthographic(eye))] {
        let (world, meshes) = (world(&camera, 0.5), triangles());
        world.hold(backend);
        let image = world.draw_rays(backend, &camera, &meshes, SIZE);
        let what = format!("surfaces a million lengths away, {name}");
        assert_like(&what, image, &camera, |ray| world.light(ray, &end_of(ray, &meshes)));
    }
}

/// As many triangles as a scanned part has.
pub fn a_hundred_thousand_triangles(backend: &mut dyn Backend) {
    let camera = perspective(DVec3::new(38.0, -19.0, 22.0));
    let (center, radius, color) = (DVec3::new(9.0, 11.0, 8.0), 7.0, [0.4, 0.9, 1.0]);
    let fine = ball(center, radius, 200, 250, color);
    assert_eq!(fine.triangles().len(), 100_000);
    let image = draw_alone(backend, &camera, &[fine], SIZE);
    // A ball of as many triangles is round.
    let light = |ray: &Ray| {
        let from = ray.origin - center;
        let (b, c) = (from.dot(ray.direction), from.length_squared() - radius * radius);
        let root = b * b - c;
        if root < 0.0 {
            return BACKGROUND_F64;
        }
        let normal = (from + ray.direction * (-b - root.sqrt())) / radius;
        // Facets near the outline turn much from one to the next.
        color.map(|channel| channel * shade(normal.dot(ray.direction)))
    };
    let expected = each_pixel(&camera, SIZE, light);
    let [_, rmse] = difference(&image, &expected);
    let num_off = image
        .pixels
        .iter()
        .zip(&expected)
        .filter(|(found, expected)| (0..3).any(|i| (f64::from(found[i]) - expected[i]).abs() > 0.03));
    let share = num_off.count() as f64 / expected.len() as f64;
    println!(
        "100000 triangles: rmse {rmse:.1e} (threshold 2e-2), {share:.4} of the pixels off (threshold 0.01)"
    );
    assert!(rmse <= 2e-2 && share <= 0.01, "100000 triangles: rmse {rmse}, {share} of the pixels off");
}
