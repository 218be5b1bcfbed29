//! The truth of grids: against closed forms, against the truth of voxels, and against integrals along rays whose
//! local coordinates are known in closed form.

use glam::DVec3;
use volery_data::{hash, noise};
use volery_reference::{Error, GridTracer, Image, Light, Tracer, render};
use volery_scene::{
    Camera, CellType, Cells, Ray, Samples, TransferFunction, TriangleMesh, UnstructuredGrid, VoxelGrid,
};

use crate::cells::{FILLINGS, Filling, lattice, shaken, shuffled};
use crate::closed_forms::cameras;
use crate::slow::{Integrand, Random, check, difference, perspective, slab, transfer};

const BOXES: [usize; 3] = [3, 2, 2];
const EXTENT: DVec3 = DVec3::new(3.0, 2.0, 2.0);
const BACKGROUND: [f64; 3] = [0.1, 0.6, 0.3];

/// Clear stretches, kinks, steps and opaque values, from 0 to 1.
fn wild(unit_distance: f64) -> TransferFunction {
    let points = [
        (0.1, [0.0, 0.1, 0.9], 0.0),
        (0.2, [0.5, 0.1, 0.9], 0.3),
        (0.3, [0.5, 0.8, 0.0], 0.0),
        (0.4, [0.5, 0.8, 0.0], 0.0),
        (0.4, [0.9, 0.2, 0.1], 0.1),
        (0.5, [0.1, 0.2, 0.8], 0.2),
        (0.5, [0.9, 0.9, 0.9], 0.01),
        (0.8, [0.6, 0.9, 0.3], 0.4),
        (0.95, [1.0, 0.1, 0.3], 0.7),
    ];
    transfer(&points, unit_distance)
}

fn values(grid: &UnstructuredGrid, value: impl Fn(DVec3) -> f64) -> Samples {
    grid.points().iter().map(|&point| value(point)).collect::<Vec<f64>>().into()
}

fn picture(tracer: &GridTracer, camera: &Camera) -> Image {
    tracer.render(camera, BACKGROUND, 37, 29, &|_| {}).expect("a camera without defects")
}

fn greatest_difference(a: &Image, b: &Image) -> f64 {
    let channels = a.pixels().iter().flatten().zip(b.pixels().iter().flatten());
    channels.map(|(a, b)| (a - b).abs()).fold(0.0, |greatest, error| {
        assert!(!error.is_nan());
        f64::max(greatest, error)
    })
}

/// Every type of cell reproduces a linear field, however its nodes lie.
#[test]
fn a_linear_field_looks_as_it_does_in_voxels_whatever_the_cells() {
    let gradient = DVec3::new(0.21, 0.11, 0.06);
    let voxels = volery_data::ramp(BOXES.map(|n| n + 1), DVec3::ONE, gradient, 0.01);
    let matter = wild(0.8);
    for filling in FILLINGS {
        for is_shaken in [false, true] {
            let grid = if is_shaken {
                lattice(BOXES, filling, shaken(BOXES))
            } else {
                lattice(BOXES, filling, |p| p)
            };
            let tracer = GridTracer::new(&grid, &values(&grid, |p| 0.01 + gradient.dot(p)), &matter).unwrap();
            for (name, camera) in cameras(EXTENT) {
                let expected = render(&voxels, &camera, &matter, BACKGROUND, 37, 29).unwrap();
                let error = greatest_difference(&picture(&tracer, &camera), &expected);
                let state = if is_shaken { "shaken" } else { "straight" };
                check(&format!("linear field, {filling:?}, {state}, {name}"), error, 1e-9);
            }
        }
    }
}

/// Rays through every pair of nodes: along edges, faces, diagonals, those of the outside too, which belong to the grid.
#[test]
fn no_ray_is_lost_or_counted_twice_at_faces_edges_and_nodes() {
    let matter = transfer(&[(0.0, [0.9, 0.5, 0.2], 0.3)], 0.7);
    let mut greatest = 0.0;
    let mut counts = [0; 2];
    for filling in FILLINGS {
        for shake in [false, true] {
            let grid =
                if shake { lattice(BOXES, filling, shaken(BOXES)) } else { lattice(BOXES, filling, |p| p) };
            let tracer = GridTracer::new(&grid, &values(&grid, |_| 0.5), &matter).unwrap();
            for &from in grid.points() {
                for &to in grid.points() {
                    let Some(direction) = (to - from).try_normalize() else { continue };
                    for start in [from - 3.0 * direction, from] {
                        let ray = Ray { origin: start, direction };
                        let found = tracer.trace(&ray).transmittance;
                        // The box in which both nodes are, however the ray is rounded.
                        let slack = DVec3::splat(1e-13);
                        let chord = slab(&ray, -slack, EXTENT + slack).map_or(0.0, |[a, b]| b - a);
                        let expected = (-matter.extinction(0.5) * chord).exp();
                        let middle = from / 2.0 + to / 2.0;
                        let is_outside = middle.min(EXTENT - middle).min_element() < 1e-12;
                        counts[usize::from(is_outside)] += 1;
                        let error = (found - expected).abs();
                        assert!(error < 1e-12, "{filling:?} {from} {to}: {found}, expected {expected}");
                        greatest = f64::max(greatest, error);
                    }
                }
            }
        }
    }
    assert!(counts.iter().all(|&count| count > 1000), "{counts:?}");
    check("rays through two nodes", greatest, 1e-12);
}

/// Rays in the faces and edges of the domain, along an axis, aslant, and diagonally: in voxels and in cells.
#[test]
fn the_domain_is_closed() {
    let dims = BOXES.map(|n| n + 1);
    let ends = |axis: usize| [0.0, EXTENT[axis] * 0.4, EXTENT[axis]];
    for spacing in [DVec3::ONE, DVec3::new(0.1, 0.3, 0.7)] {
        let matter = wild(0.8 * spacing.min_element());
        for filling in FILLINGS {
            let straight = lattice(BOXES, filling, |p| p * spacing);
            let field = |p: DVec3| 0.02 + DVec3::new(0.2, 0.11, 0.06).dot(p / spacing);
            let tracer = GridTracer::new(&straight, &values(&straight, field), &matter).unwrap();
            let voxels = volery_data::ramp(dims, spacing, DVec3::new(0.2, 0.11, 0.06) / spacing, 0.02);
            let voxel_tracer = Tracer::new(&voxels, &matter).unwrap();
            let mut lit = 0;
            let mut greatest = 0.0;
            for axis in 0..3 {
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                for corner in 0..9 {
                    for slope in [0.0, 0.7, -0.3] {
                        // In the face across u where it starts in one, along the axis and v.
                        let mut origin = DVec3::ZERO;
                        (origin[u], origin[v]) = (ends(u)[corner / 3], ends(v)[corner % 3]);
                        origin[axis] = -1.0;
                        let mut direction = DVec3::AXES[axis];
                        direction[v] = slope;
                        origin[v] -= slope;
                        let ray =
                            Ray { origin: origin * spacing, direction: (direction * spacing).normalize() };
                        let [found, expected] = [tracer.trace(&ray), voxel_tracer.trace(&ray)];
                        greatest = f64::max(greatest, difference(&found, &expected));
                        lit += usize::from(expected.transmittance < 0.9);
                        let error = difference(&found, &expected);
                        assert!(error < 1e-9, "{filling:?} {ray:?}: {found:?}, expected {expected:?}");
                    }
                }
            }
            // All but those that leave through the corner that they start from.
            assert!(lit >= 50, "{lit} rays meet matter");
            check(&format!("rays in faces, {filling:?}, spacing {spacing}"), greatest, 1e-9);
        }
    }
}

/// Where one of two cells is blank, their face belongs to the other.
#[test]
fn a_face_beside_a_blank_cell_belongs_to_the_one_that_is_not() {
    let matter = transfer(&[(0.0, [0.9, 0.5, 0.2], 0.3)], 0.7);
    for blank in 0..2 {
        let grid = lattice([1, 1, 2], Filling::Hexahedra, |p| p);
        let all = values(&grid, |_| 0.5);
        let marked = grid.with_blank((0..2).map(|cell| cell == blank).collect()).unwrap();
        let tracer = GridTracer::new(&marked, &all, &matter).unwrap();
        for direction in [DVec3::X, DVec3::Y, -DVec3::X, DVec3::new(0.6, 0.8, 0.0)] {
            let ray = Ray { origin: DVec3::new(0.5, 0.5, 1.0) - 2.0 * direction, direction };
            let chord = slab(&ray, DVec3::ZERO, DVec3::ONE).map_or(0.0, |[a, b]| b - a);
            let error = tracer.trace(&ray).transmittance - (-matter.extinction(0.5) * chord).exp();
            assert!(error.abs() < 1e-12, "{blank} {direction}: {error:e}");
        }
    }
}

/// Part of a ray in a face with a blank cell beside it, part between two that are not: in the order of the ray.
#[test]
fn a_ray_beside_blank_cells_and_between_others_meets_them_in_order() {
    let matter = wild(0.8);
    let grid = lattice([2, 2, 1], Filling::Hexahedra, |p| p);
    let field = values(&grid, |p| 0.15 + 0.3 * p.x + 0.1 * p.z);
    let whole = GridTracer::new(&grid, &field, &matter).unwrap();
    for blank in 0..4 {
        let marked = grid.clone().with_blank((0..4).map(|cell| cell == blank).collect()).unwrap();
        let tracer = GridTracer::new(&marked, &field, &matter).unwrap();
        for direction in [DVec3::X, -DVec3::X] {
            let ray = Ray { origin: DVec3::new(1.0, 1.0, 0.4) - 3.0 * direction, direction };
            let (found, expected) = (tracer.trace(&ray), whole.trace(&ray));
            assert!(expected.transmittance < 0.9);
            assert!(difference(&found, &expected) < 1e-12, "{blank} {direction}: {found:?}, {expected:?}");
        }
    }
}

/// Boxes of the voxels as cells, with the values of the voxels.
#[test]
fn hexahedra_that_are_voxels_look_as_voxels_do() {
    let matter = {
        let points =
            wild(0.9).points().iter().map(|p| (p.value * 255.0, p.color, p.opacity)).collect::<Vec<_>>();
        transfer(&points, 0.9)
    };
    let spacing = DVec3::new(1.0, 0.6, 1.7);
    let samples = noise([5, 4, 6], 5).samples().clone();
    let voxels = VoxelGrid::new([5, 4, 6], spacing, samples.clone()).unwrap();
    for filling in [Filling::Hexahedra, Filling::Voxels, Filling::InvertedHexahedra] {
        let grid = lattice([4, 3, 5], filling, |p| p * spacing);
        let of_node = |node: usize| if node < samples.len() { samples.value(node, 0) } else { f64::NAN };
        let nodes: Vec<f64> = (0..grid.points().len()).map(of_node).collect();
        let tracer = GridTracer::new(&grid, &nodes.into(), &matter).unwrap();
        for (name, camera) in cameras(voxels.extent()) {
            let expected = render(&voxels, &camera, &matter, BACKGROUND, 37, 29).unwrap();
            let error = greatest_difference(&picture(&tracer, &camera), &expected);
            check(&format!("voxels as {filling:?}, {name}"), error, 1e-9);
        }
    }
}

/// A random value per node.
fn random_values(count: usize) -> Vec<f64> {
    (0..count).map(|node| (hash(node as u64) >> 11) as f64 / (1u64 << 53) as f64).collect()
}

/// Greatest error over random rays through a convex body of planes `normal · p <= distance`; `value` is the field,
/// `breaks` the planes where it has kinks.
fn against_integral(
    tracer: &GridTracer,
    matter: &TransferFunction,
    planes: &[(DVec3, f64)],
    breaks: &[(DVec3, f64)],
    value: impl Fn(DVec3) -> f64,
) -> f64 {
    let mut random = Random::new(11);
    let (mut greatest, mut lit) = (0.0, 0);
    for _ in 0..150 {
        let target = random.point() * DVec3::new(1.5, 1.5, 1.0);
        let direction = (random.point() - 0.5).normalize();
        let ray = Ray { origin: target - direction * 5.0 * random.unit(), direction };
        let meets = |&(normal, distance): &(DVec3, f64)| {
            ((distance - normal.dot(ray.origin)) / normal.dot(direction), normal.dot(direction) > 0.0)
        };
        let (mut start, mut end) = (0.0, f64::INFINITY);
        for (t, leaves) in planes.iter().map(meets) {
            if leaves { end = f64::min(end, t) } else { start = f64::max(start, t) }
        }
        let expected = if start < end {
            let mut ends: Vec<f64> = breaks.iter().map(|plane| meets(plane).0).collect();
            ends.retain(|&t| t > start && t < end);
            ends.extend([start, end]);
            ends.sort_by(f64::total_cmp);
            let value = |t: f64| value(ray.origin + direction * t);
            Integrand { transfer: matter, value, tolerance: 1e-8 }.over(&ends)
        } else {
            Light::CLEAR
        };
        let error = difference(&tracer.trace(&ray), &expected);
        lit += usize::from(expected.transmittance < 0.99);
        assert!(error < 1e-8, "{ray:?}: error {error:e}");
        greatest = f64::max(greatest, error);
    }
    assert!(lit > 40, "{lit} rays meet matter");
    greatest
}

/// A lattice whose layers grow with height: all faces planar, no cell affine, and its inverse in closed form.
#[test]
fn frustums_of_hexahedra_and_wedges_are_as_their_shape_functions_say() {
    const GROWTH: f64 = 0.7;
    let matter = wild(0.9);
    for filling in [Filling::Hexahedra, Filling::Wedges, Filling::TurnedWedges] {
        let grid = lattice([2, 2, 1], filling, |p| {
            DVec3::new(p.x, p.y, 0.0) * (1.0 + GROWTH * p.z) + DVec3::Z * p.z
        });
        let nodes = random_values(grid.points().len());
        let tracer = GridTracer::new(&grid, &nodes.clone().into(), &matter).unwrap();
        let inverse = |p: DVec3| DVec3::new(p.x, p.y, 0.0) / (1.0 + GROWTH * p.z) + DVec3::Z * p.z;
        let value = |p: DVec3| {
            let q = inverse(p);
            let cell = q.floor().clamp(DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0));
            let local = q - cell;
            let node = |x: f64, y: f64, z: f64| nodes[(cell.x + x + 3.0 * (cell.y + y + 3.0 * z)) as usize];
            let layer = |z: f64| {
                let [a, b, c, d] =
                    [node(0.0, 0.0, z), node(1.0, 0.0, z), node(1.0, 1.0, z), node(0.0, 1.0, z)];
                match filling {
                    Filling::Hexahedra => {
                        (a * (1.0 - local.x) + b * local.x) * (1.0 - local.y)
                            + (d * (1.0 - local.x) + c * local.x) * local.y
                    }
                    _ if local.x > local.y => a + (b - a) * local.x + (c - b) * local.y,
                    _ => a + (d - a) * local.y + (c - d) * local.x,
                }
            };
            layer(0.0) * (1.0 - local.z) + layer(1.0) * local.z
        };
        // x = c (1 + g z): the plane (1, 0, -c g), at distance c.
        let at = |axis: DVec3, c: f64| (axis - DVec3::Z * (c * GROWTH), c);
        let outside = |(normal, distance): (DVec3, f64)| (-normal, -distance);
        let planes = [
            outside(at(DVec3::X, 0.0)),
            outside(at(DVec3::Y, 0.0)),
            at(DVec3::X, 2.0),
            at(DVec3::Y, 2.0),
            (-DVec3::Z, 0.0),
            (DVec3::Z, 1.0),
        ];
        let mut breaks = vec![at(DVec3::X, 1.0), at(DVec3::Y, 1.0)];
        if filling != Filling::Hexahedra {
            breaks.extend([-1.0, 0.0, 1.0].map(|c| at(DVec3::X - DVec3::Y, c)));
        }
        let error = against_integral(&tracer, &matter, &planes, &breaks, value);
        check(&format!("frustums, {filling:?}"), error, 1e-8);
    }
}

#[test]
fn a_pyramid_is_as_its_shape_functions_say() {
    let apex = DVec3::new(0.3, 0.9, 1.2);
    let points = vec![DVec3::ZERO, DVec3::X * 1.5, DVec3::new(1.5, 1.5, 0.0), DVec3::Y * 1.5, apex];
    let cells = Cells::new(vec![CellType::Pyramid], vec![0, 1, 2, 3, 4]).unwrap();
    let grid = UnstructuredGrid::new(points.clone(), cells).unwrap();
    let nodes = [0.05, 0.9, 0.15, 0.7, 0.45];
    let value = |p: DVec3| {
        let t = p.z / apex.z;
        let base = (p - apex * t) / (1.0 - t) / 1.5;
        let (r, s) = (base.x, base.y);
        let bilinear =
            (nodes[0] * (1.0 - r) + nodes[1] * r) * (1.0 - s) + (nodes[3] * (1.0 - r) + nodes[2] * r) * s;
        bilinear * (1.0 - t) + nodes[4] * t
    };
    let side = |a: usize, b: usize| {
        let normal = (points[b] - points[a]).cross(apex - points[a]);
        (normal, normal.dot(apex))
    };
    let planes = [side(0, 1), side(1, 2), side(2, 3), side(3, 0), (-DVec3::Z, 0.0)];
    let step = transfer(&[(0.4, [0.9, 0.2, 0.1], 0.1), (0.4, [0.1, 0.8, 0.3], 0.4)], 0.4);
    for (what, matter) in [("bands", wild(0.4)), ("one step", step)] {
        let tracer = GridTracer::new(&grid, &nodes.to_vec().into(), &matter).unwrap();
        let error = against_integral(&tracer, &matter, &planes, &[], value);
        check(&format!("pyramid, {what}"), error, 1e-8);
    }
}

#[test]
fn blank_cells_and_values_that_are_none_are_empty() {
    let matter = transfer(&[(0.0, [0.9, 0.5, 0.2], 0.3)], 0.7);
    let ray = Ray { origin: DVec3::new(-1.0, 0.3, 0.4), direction: DVec3::X };
    let clear = |chord: f64| (-matter.extinction(0.5) * chord).exp();
    let straight = lattice(BOXES, Filling::Hexahedra, |p| p);
    let trace = |grid: &UnstructuredGrid, values: &Samples| {
        GridTracer::new(grid, values, &matter).unwrap().trace(&ray).transmittance
    };
    let all = values(&straight, |_| 0.5);
    assert!((trace(&straight, &all) - clear(3.0)).abs() < 1e-14);
    let mut blank = vec![false; straight.cells().len()];
    blank[1] = true;
    let marked = straight.clone().with_blank(blank).unwrap();
    assert!((trace(&marked, &all) - clear(2.0)).abs() < 1e-14);
    for nothing in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let holed = values(&straight, |p| if p == DVec3::X { nothing } else { 0.5 });
        assert!((trace(&straight, &holed) - clear(1.0)).abs() < 1e-14);
        let moved =
            lattice(
                BOXES,
                Filling::Hexahedra,
                |p| if p == EXTENT.with_y(0.0) { DVec3::X * nothing } else { p },
            );
        assert!((trace(&moved, &all) - clear(3.0)).abs() < 1e-14, "a corner away from the ray");
        let moved =
            lattice(BOXES, Filling::Hexahedra, |p| if p == DVec3::ZERO { DVec3::X * nothing } else { p });
        assert!((trace(&moved, &all) - clear(2.0)).abs() < 1e-14);
    }
}

/// Cells twice, flat cells, and cells around nothing add nothing.
#[test]
fn what_overlaps_counts_once() {
    let grid = lattice(BOXES, Filling::Mixed, shaken(BOXES));
    let mut types = grid.cells().types().to_vec();
    types.extend_from_within(..);
    let once: Vec<u32> = grid.cells().iter().flat_map(|(_, nodes)| nodes.to_vec()).collect();
    let mut nodes = once.clone();
    nodes.extend(once);
    // Without volume: one point, one line, one plane.
    types.extend([CellType::Hexahedron, CellType::Wedge, CellType::Pyramid, CellType::Tetrahedron]);
    nodes.extend([[7; 8].as_slice(), &[0, 1, 2, 0, 1, 2], &[0, 1, 5, 4, 4], &[0, 1, 2, 4]].concat());
    let twice = UnstructuredGrid::new(grid.points().to_vec(), Cells::new(types, nodes).unwrap()).unwrap();
    let matter = wild(0.8);
    let field = values(&grid, |p| (0.3 * p.x * p.y + 0.1 * p.z).min(0.99));
    let [once, twice] = [&grid, &twice].map(|grid| GridTracer::new(grid, &field, &matter).unwrap());
    for (name, camera) in cameras(EXTENT) {
        let error = greatest_difference(&picture(&once, &camera), &picture(&twice, &camera));
        check(&format!("cells twice, {name}"), error, 1e-12);
    }
}

#[test]
fn neither_threads_nor_the_order_of_cells_change_a_bit() {
    let boxes = [5, 4, 4];
    let grid = lattice(boxes, Filling::Mixed, shaken(boxes));
    let other = shuffled(&grid);
    let matter = wild(0.8);
    let field = values(&grid, |p| 0.5 + 0.5 * (p.x * 1.3 + p.y).sin() * p.z.cos());
    let camera = perspective(DVec3::new(8.0, -9.0, 7.0), DVec3::new(2.5, 2.0, 2.0), 35.0);
    let draw = |grid: &UnstructuredGrid, threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| picture(&GridTracer::new(grid, &field, &matter).unwrap(), &camera))
    };
    let first = draw(&grid, 1);
    for threads in [2, 7] {
        assert_eq!(first, draw(&grid, threads), "{threads} threads");
    }
    assert_eq!(first, draw(&other, 3), "shuffled cells");
}

/// An opaque triangle in the middle of uniform matter.
#[test]
fn a_surface_hides_the_matter_behind_it() {
    let grid = lattice(BOXES, Filling::Mixed, |p| p);
    let matter = transfer(&[(0.0, [0.9, 0.5, 0.2], 0.3)], 0.7);
    let far = 1e3;
    let corners = [[-far, -far], [far, -far], [0.0, far]].map(|[x, y]| DVec3::new(x, y, 1.25));
    let mesh = [TriangleMesh::new(corners.to_vec(), vec![[0, 1, 2]], [0.2, 0.3, 0.8]).unwrap()];
    let field = values(&grid, |_| 0.5);
    let tracer = GridTracer::new(&grid, &field, &matter).unwrap().among(&mesh);
    let camera = perspective(DVec3::new(1.3, 0.9, 7.0), DVec3::new(1.5, 1.0, 0.0), 20.0);
    let image = picture(&tracer, &camera);
    let mut greatest = 0.0;
    for row in 0..image.height() {
        for column in 0..image.width() {
            let ray = camera.rays(image.width(), image.height()).pixel(column, row);
            let stop = (1.25 - ray.origin.z) / ray.direction.z;
            let chord = slab(&ray, DVec3::ZERO, EXTENT).map_or(0.0, |[a, b]| (b.min(stop) - a).max(0.0));
            let clear = (-matter.extinction(0.5) * chord).exp();
            let behind = [0.2, 0.3, 0.8].map(|c| c * volery_scene::mesh::shade(ray.direction.z));
            for (i, behind) in behind.into_iter().enumerate() {
                let expected = [0.9, 0.5, 0.2][i] * (1.0 - clear) + clear * behind;
                greatest = f64::max(greatest, (image.pixel(column, row)[i] - expected).abs());
            }
        }
    }
    check("a surface in matter", greatest, 1e-9);
}

#[test]
fn what_is_no_value_of_a_node_is_an_error() {
    let grid = lattice([1, 1, 1], Filling::Hexahedra, |p| p);
    let matter = wild(1.0);
    let error = GridTracer::new(&grid, &vec![0.5; 3].into(), &matter).unwrap_err();
    assert_eq!(error, Error::NodeValues { found: 3, expected: 9 });
    assert_eq!(error.to_string(), "reference: 3 values at the nodes of a grid, expected 9");
    let error = GridTracer::new(&grid, &vec![[0u8; 3]; 9].into(), &matter).unwrap_err();
    assert!(matches!(error, Error::ColorSamples { .. }));
}

#[test]
fn an_empty_grid_is_background() {
    let grid = UnstructuredGrid::new(vec![], Cells::new(vec![], vec![]).unwrap()).unwrap();
    let tracer = GridTracer::new(&grid, &Vec::<f64>::new().into(), &wild(1.0)).unwrap();
    let camera = perspective(DVec3::ZERO, DVec3::X, 30.0);
    assert!(picture(&tracer, &camera).pixels().iter().all(|&pixel| pixel == BACKGROUND));
}

/// Rays and numbers that are none, and cells that are folded: something comes back.
#[test]
fn nothing_panics_or_hangs() {
    let numbers = [0.0, -0.0, 1.0, -1.0, 2.0, 1e-310, 1e300, -1e300, f64::INFINITY, f64::NAN];
    let mut random = Random::new(5);
    for scale in [1.0, 1e-300, 1e150, 1e308] {
        let folded = |p: DVec3| DVec3::new(p.x * (1.0 - p.y), p.y * (0.5 - p.z), p.z * (0.7 - p.x)) * scale;
        for filling in FILLINGS {
            let grid = lattice([2, 1, 1], filling, folded);
            for magnitude in [1.0, 1e300] {
                let field: Vec<f64> =
                    random_values(grid.points().len()).iter().map(|v| v * magnitude).collect();
                let tracer = GridTracer::new(&grid, &field.into(), &wild(1.0)).unwrap();
                for _ in 0..400 {
                    let mut any = || numbers[random.below(numbers.len())];
                    let origin = DVec3::new(any(), any(), any());
                    let light = tracer.trace(&Ray { origin, direction: DVec3::new(any(), any(), any()) });
                    assert!((0.0..=1.0).contains(&light.transmittance), "{filling:?} {scale:e}: {light:?}");
                }
                for _ in 0..100 {
                    let aim = folded(random.point());
                    let direction = random.point() - 0.5;
                    let ray = Ray { origin: aim - direction * scale, direction };
                    let light = tracer.trace(&ray);
                    assert!((0.0..=1.0).contains(&light.transmittance), "{filling:?} {scale:e}: {light:?}");
                }
            }
        }
    }
}

#[test]
fn single_rays_agree_with_voxels() {
    let voxels = volery_data::marschner_lobb(5);
    let grid = lattice([4; 3], Filling::Hexahedra, |p| p);
    let of_node = |node: usize| if node < 125 { voxels.samples().value(node, 0) } else { 0.0 };
    let nodes: Vec<f64> = (0..grid.points().len()).map(of_node).collect();
    let matter = wild(0.5);
    let (truth, tracer) =
        (Tracer::new(&voxels, &matter).unwrap(), GridTracer::new(&grid, &nodes.into(), &matter).unwrap());
    let mut random = Random::new(3);
    let mut greatest = 0.0;
    for _ in 0..2000 {
        let ray = Ray { origin: random.point() * 4.0, direction: (random.point() - 0.5).normalize() };
        greatest = f64::max(greatest, difference(&truth.trace(&ray), &tracer.trace(&ray)));
    }
    check("single rays from inside", greatest, 1e-9);
}
