//! Opaque surfaces among matter and planes: every ray against every triangle by other means, and closed forms.

use glam::DVec3;
use volery_reference::{Image, PlaneScene, Tracer};
use volery_scene::mesh::shade;
use volery_scene::{Camera, Plane, Ray, TriangleMesh};

use crate::slow::{orthographic, perspective, transfer};

const BACKGROUND: [f64; 3] = [0.1, 0.6, 0.3];
const SIZE: [u32; 2] = [61, 43];
const EXTENT: DVec3 = DVec3::new(10.0, 6.0, 12.0);

fn cameras() -> [Camera; 3] {
    let center = EXTENT / 2.0;
    [
        perspective(center + DVec3::new(9.0, -17.0, 8.0), center, 50.0),
        orthographic(center + DVec3::new(9.0, -17.0, 8.0), center, 15.0),
        perspective(center, EXTENT, 90.0),
    ]
}

/// Triangles at random, of two colours: some huge, some tiny, some around the eye.
fn meshes() -> [TriangleMesh; 2] {
    let mut state = 9_u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    [[0.9, 0.2, 0.1], [0.3, 0.4, 1.0]].map(|color| {
        let mut points = Vec::new();
        for i in 0..60 {
            let center = DVec3::new(next(), next(), next()) * 20.0 - 5.0;
            let size = if i % 10 == 0 { 9.0 } else { 1.5 };
            points.extend((0..3).map(|_| center + (DVec3::new(next(), next(), next()) - 0.5) * size));
        }
        let triangles = (0..60).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        TriangleMesh::new(points, triangles, color).expect("corners are numbers of points")
    })
}

/// What a ray ends at (Möller and Trumbore 1997).
fn end_of(ray: &Ray, meshes: &[TriangleMesh]) -> (f64, [f64; 3]) {
    let mut end = (f64::INFINITY, BACKGROUND);
    for mesh in meshes {
        for triangle in mesh.triangles() {
            let [a, b, c] = triangle.map(|corner| mesh.points()[corner as usize]);
            let (p, from) = (ray.direction.cross(c - a), ray.origin - a);
            let (q, inverse) = (from.cross(b - a), (b - a).dot(p).recip());
            let (u, v, t) = (from.dot(p) * inverse, ray.direction.dot(q) * inverse, (c - a).dot(q) * inverse);
            if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0 && t < end.0 {
                let cosine = (b - a).cross(c - a).normalize().dot(ray.direction);
                end = (t, mesh.color().map(|channel| channel * shade(cosine)));
            }
        }
    }
    end
}

fn check(what: &str, camera: &Camera, drawn: &Image, light: impl Fn(&Ray) -> [f64; 3]) {
    let rays = camera.rays(SIZE[0], SIZE[1]);
    let mut worst = 0.0_f64;
    for (place, found) in (0..).zip(drawn.pixels()) {
        let expected = light(&rays.pixel(place % SIZE[0], place / SIZE[0]));
        (0..3).for_each(|i| worst = worst.max((found[i] - expected[i]).abs()));
    }
    println!("{what}: largest difference {worst:.1e} (threshold 1e-9)");
    assert!(worst <= 1e-9, "{what}: {worst}");
}

#[test]
fn rays_end_at_the_nearest_triangle() {
    let grid = volery_data::uniform([6, 4, 7], DVec3::new(2.0, 2.0, 2.0), 0.5);
    let color = [0.9, 0.8, 0.2];
    let fog = transfer(&[(0.0, color, 0.2)], 1.0);
    let extinction = fog.extinction_of_opacity(0.2);
    for (camera, meshes) in cameras().iter().flat_map(|camera| [(camera, meshes())]) {
        let tracer = Tracer::new(&grid, &fog).unwrap().among(&meshes);
        let drawn = tracer.render(camera, BACKGROUND, SIZE[0], SIZE[1], &|_| {}).unwrap();
        check(&format!("{:?}", camera.projection), camera, &drawn, |ray| {
            let (end, behind) = end_of(ray, &meshes);
            let (a, b) = (-ray.origin / ray.direction, (EXTENT - ray.origin) / ray.direction);
            let (enter, leave) = (a.min(b).max_element().max(0.0), a.max(b).min_element().min(end));
            let clear = (-extinction * (leave - enter).max(0.0)).exp();
            std::array::from_fn(|i| (1.0 - clear) * color[i] + clear * behind[i])
        });
    }
}

#[test]
fn planes_before_surfaces_veil_them() {
    let grid = volery_data::uniform([6, 4, 7], DVec3::new(2.0, 2.0, 2.0), 0.5);
    let color = [0.9, 0.8, 0.2];
    let half = transfer(&[(0.0, color, 0.5)], 1.0);
    let planes = [Plane { normal: DVec3::X, distance: 4.1 }, Plane { normal: DVec3::Z, distance: 7.3 }];
    let meshes = meshes();
    for camera in cameras() {
        let scene = PlaneScene {
            grid: &grid,
            planes: &planes,
            transfer: &half,
            nearest: false,
            is_transparent: true,
            meshes: &meshes,
        };
        let drawn = scene.render(&camera, BACKGROUND, SIZE, &|_| {}).unwrap();
        check(&format!("planes, {:?}", camera.projection), &camera, &drawn, |ray| {
            let (end, behind) = end_of(ray, &meshes);
            let is_before = |plane: &&Plane| {
                let t = -plane.signed_distance(ray.origin) / plane.normal.dot(ray.direction);
                let place = ray.origin + ray.direction * t;
                t >= 0.0 && t < end && place.clamp(DVec3::splat(-1e-9), EXTENT + 1e-9) == place
            };
            // All planes look alike.
            let clear = 0.5_f64.powi(planes.iter().filter(is_before).count() as i32);
            std::array::from_fn(|i| (1.0 - clear) * color[i] + clear * behind[i])
        });
    }
}

/// A triangle and the same again behind its corners by nothing: the first listed shows.
#[test]
fn of_equal_distances_the_first_shows() {
    let grid = volery_data::uniform([2, 2, 2], DVec3::ONE, 0.5);
    let clear = transfer(&[(0.0, [0.0; 3], 0.0)], 1.0);
    let points =
        vec![DVec3::new(-90.0, 5.0, -80.0), DVec3::new(95.0, 6.0, -70.0), DVec3::new(3.0, 4.0, 90.0)];
    let mesh = |color| TriangleMesh::new(points.clone(), vec![[0, 1, 2]], color).unwrap();
    let meshes = [mesh([1.0, 0.0, 0.0]), mesh([0.0, 1.0, 0.0])];
    let camera = perspective(DVec3::new(0.0, -9.0, 0.0), DVec3::ZERO, 40.0);
    let tracer = Tracer::new(&grid, &clear).unwrap().among(&meshes);
    let drawn = tracer.render(&camera, BACKGROUND, SIZE[0], SIZE[1], &|_| {}).unwrap();
    assert!(drawn.pixels().iter().all(|pixel| pixel[0] > 0.2 && pixel[1] == 0.0));
}
