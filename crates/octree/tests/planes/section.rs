//! Sections of planes with nodes, against the section with the whole domain.

use std::collections::HashMap;

use crate::world::{DIMS, KINDS, Noise, layout};
use glam::DVec3;
use volery_octree::section::{local_position, ratio};
use volery_octree::{Answer, Cut, CuttingPlanes, IndexPlane, Section, section, select};
use volery_pyramid::{Kind, Layout, Node};
use volery_scene::Plane;

/// Of the section with the domain, and absolutely of the square of its diagonal (for sections that are but a
/// touch).
const AREA_TOLERANCE: [f64; 2] = [1e-6, 1e-12];

/// The area of a plane's section with a box, by clipping a large square in the plane at the six sides. A face in
/// which the plane lies up to rounding counts.
pub(crate) fn clipped_area(size: DVec3, plane: &Plane) -> f64 {
    let plane = plane.normalized();
    let reach = size.length() + plane.distance.abs();
    let (right, up) = plane.normal.any_orthonormal_pair();
    let center = plane.normal * plane.distance;
    let mut polygon: Vec<DVec3> = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
        .map(|[x, y]| center + (right * x + up * y) * 2.0 * reach)
        .to_vec();
    for (axis, sign, limit) in (0..3).flat_map(|axis| [(axis, -1.0, 0.0), (axis, 1.0, size[axis])]) {
        let inside = |p: &DVec3| limit + 1e-14 * size.length() - sign * p[axis];
        let mut clipped = Vec::new();
        for (i, &b) in polygon.iter().enumerate() {
            let a = polygon[(i + polygon.len() - 1) % polygon.len()];
            let (inside_a, inside_b) = (inside(&a), inside(&b));
            if inside_a * inside_b < 0.0 {
                clipped.push(a + (b - a) * (inside_a / (inside_a - inside_b)));
            }
            if inside_b >= 0.0 {
                clipped.push(b);
            }
        }
        polygon = clipped;
    }
    let origin = polygon.first().copied().unwrap_or_default();
    let fans = polygon.windows(2).map(|pair| (pair[0] - origin).cross(pair[1] - origin));
    fans.sum::<DVec3>().length() / 2.0
}

/// The same in closed form: the volume of the box below the plane, derived by the distance. For normals that are
/// not small along any axis.
fn derived_area(size: DVec3, plane: &Plane) -> f64 {
    let Plane { normal, distance } = plane.normalized();
    // Turned so that the normal points up.
    let distance = distance - (normal * size).min(DVec3::ZERO).element_sum();
    let normal = normal.abs();
    let corner = |corner: u32| {
        let at = DVec3::from_array([0, 1, 2].map(|axis| f64::from(corner >> axis & 1) * size[axis]));
        let sign = if corner.count_ones().is_multiple_of(2) { 1.0 } else { -1.0 };
        sign * (distance - normal.dot(at)).max(0.0).powi(2)
    };
    (0..8).map(corner).sum::<f64>() / (2.0 * normal.element_product())
}

pub(crate) fn random_normal(noise: &mut Noise) -> DVec3 {
    let normal = noise.point(DVec3::NEG_ONE, DVec3::ONE);
    // Some along axes, some nearly, of any length.
    let flat = match (noise.unit() * 8.0) as u32 {
        0 => DVec3::new(1.0, 1.0, 0.0),
        1 => DVec3::new(0.0, 1.0, 1e-9),
        2 => DVec3::new(1e-15, 0.0, 1.0),
        3 => DVec3::new(1.0, 0.0, 0.0),
        _ => DVec3::ONE,
    };
    normal * flat * 10_f64.powf(noise.unit() * 6.0 - 3.0)
}

/// A cut of random depth where one of the planes is.
fn random_plane_cut(layout: &Layout, planes: &[Plane], noise: &mut Noise) -> Cut {
    let depth = 0.3 + 0.7 * noise.unit();
    let random = |_: Node| if noise.unit() < depth { Answer::Descend } else { Answer::Draw };
    select(layout, (CuttingPlanes::new(layout, planes), random))
}

fn assert_sound(layout: &Layout, node: Node, plane: &Plane, section: &Section) {
    let [low, high] = layout.bounds(node);
    let vertices = section.vertices();
    assert!(vertices.is_empty() || (3..=6).contains(&vertices.len()), "{section:?}");
    let scale =
        (plane.normal * layout.spacing() * layout.domain()).abs().element_sum() + plane.distance.abs();
    let normal = plane.normal * layout.spacing();
    for (i, &v) in vertices.iter().enumerate() {
        assert!(v.cmpge(low).all() && v.cmple(high).all(), "{v} is outside of {node}");
        let ends = (0..3).filter(|&a| v[a] == low[a] || v[a] == high[a]).count();
        assert!(ends >= 2, "{v} is on no edge of {node}");
        let offset = (normal.dot(v) - plane.distance).abs();
        assert!(offset <= 1e-12 * scale, "{v} is {offset} from the plane");
        assert!(vertices[..i].iter().all(|&other| other != v), "{v} twice");
        let before = vertices[(i + vertices.len() - 1) % vertices.len()];
        let after = vertices[(i + 1) % vertices.len()];
        let turn = (v - before).cross(after - v).dot(normal.normalize());
        assert!(turn >= -1e-9 * (high - low).length_squared(), "clockwise by {turn} at {v}");
    }
}

/// The difference of the areas, in parts of what is allowed.
pub(crate) fn area_error(layout: &Layout, cut: &Cut, plane: &Plane, expected: f64) -> f64 {
    let index_plane = IndexPlane::new(layout, plane);
    let mut area = 0.0;
    for &node in &cut.nodes {
        let section = section(layout, node, &index_plane);
        assert_sound(layout, node, plane, &section);
        area += section.world_area(layout.spacing());
    }
    for &node in &cut.skipped {
        assert!(section(layout, node, &index_plane).is_empty(), "{node} was skipped");
    }
    let size = layout.domain() * layout.spacing();
    let allowed = AREA_TOLERANCE[0] * expected + AREA_TOLERANCE[1] * size.length_squared();
    if allowed == 0.0 { area } else { (area - expected).abs() / allowed }
}

#[test]
fn the_polygons_of_a_cut_cover_a_random_plane_once() {
    let mut noise = Noise(1);
    let (mut worst, mut planes, mut derived): (f64, usize, usize) = (0.0, 0, 0);
    for round in 0..200 {
        let layout = layout(DIMS[round % DIMS.len()], KINDS[round / DIMS.len() % 2], [2, 4, 30][round % 3]);
        let size = layout.domain() * layout.spacing();
        for _ in 0..10 {
            let plane = Plane::through(noise.point(-0.1 * size, 1.1 * size), random_normal(&mut noise));
            if !plane.defects().is_empty() {
                continue;
            }
            let cut = random_plane_cut(&layout, &[plane], &mut noise);
            let expected = clipped_area(size, &plane);
            let unit = plane.normalized().normal.abs();
            if unit.min_element() > 0.05 && size.min_element() > 0.0 {
                let other = derived_area(size, &plane);
                assert!((other - expected).abs() <= 1e-8 * size.length_squared(), "{other} {expected}");
                derived += 1;
            }
            // In a flat volume only the plane of the volume itself has an area.
            let is_flat_across = (0..3).any(|a| size[a] == 0.0 && plane.normal[a] != 0.0);
            let is_along_axis = (0..3).filter(|&a| plane.normal[a] != 0.0).count() == 1;
            let expected = if is_flat_across && !is_along_axis { 0.0 } else { expected };
            worst = worst.max(area_error(&layout, &cut, &plane, expected));
            planes += 1;
        }
    }
    println!("{planes} planes, {derived} of them by a closed form too; worst {worst:.1e} of 1 allowed");
    assert!(worst <= 1.0 && planes >= 1000 && derived >= 300);
}

#[test]
fn planes_along_axes_through_boundaries_and_samples_are_covered_once() {
    let mut noise = Noise(2);
    let mut worst: f64 = 0.0;
    for (round, dims) in DIMS.into_iter().chain([[7, 1, 13], [1, 1, 1], [31, 31, 1]]).enumerate() {
        for kind in KINDS {
            let layout = layout(dims, kind, [2, 4][round % 2]);
            let size = layout.domain() * layout.spacing();
            for axis in 0..3 {
                for half in -1..=2 * dims[axis] as i32 {
                    let at = f64::from(half) / 2.0 * layout.spacing()[axis];
                    let scale = if noise.unit() < 0.5 { 1.0 } else { -4.0 };
                    let plane = Plane { normal: DVec3::AXES[axis] * scale, distance: at * scale };
                    let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
                    let is_inside = (0.0..=size[axis]).contains(&at);
                    let expected = if is_inside { size[u] * size[v] } else { 0.0 };
                    let cut = random_plane_cut(&layout, &[plane], &mut noise);
                    worst = worst.max(area_error(&layout, &cut, &plane, expected));
                }
            }
        }
    }
    println!("worst {worst:.1e} of 1 allowed");
    assert!(worst <= 1.0);
}

#[test]
fn planes_along_diagonals_through_corners_and_edges_are_covered_once() {
    let mut noise = Noise(3);
    let mut worst: f64 = 0.0;
    let ways = |x: u32| f64::from(x % 3) - 1.0;
    for kind in KINDS {
        let layout = Layout::new([17, 9, 13], DVec3::ONE, kind, 4).unwrap();
        for way in 0..27 {
            let normal = DVec3::new(ways(way), ways(way / 3), ways(way / 9));
            if normal == DVec3::ZERO {
                continue;
            }
            for _ in 0..20 {
                let point = noise.point(DVec3::ZERO, layout.domain() / 2.0).round() * 2.0;
                let plane = Plane::through(point.min(layout.domain()), normal);
                let cut = random_plane_cut(&layout, &[plane], &mut noise);
                worst = worst.max(area_error(&layout, &cut, &plane, clipped_area(layout.domain(), &plane)));
            }
        }
    }
    println!("worst {worst:.1e} of 1 allowed");
    assert!(worst <= 1.0);
}

#[test]
fn a_plane_that_touches_only_a_corner_or_an_edge_meets_nodes_and_has_no_area() {
    for kind in KINDS {
        let layout = layout([17, 9, 13], kind, 4);
        let size = layout.domain() * layout.spacing();
        for corner in 0..8_u32 {
            let outward = DVec3::from_array([0, 1, 2].map(|a| f64::from(corner >> a & 1) * 2.0 - 1.0));
            let at = (outward + 1.0) / 2.0 * size;
            for keep in [DVec3::ONE, DVec3::new(1.0, 1.0, 0.0), DVec3::new(0.0, 1.0, 1.0)] {
                let plane = Plane::through(at, outward * keep);
                let cut = select(&layout, (CuttingPlanes::new(&layout, &[plane]), |_: Node| Answer::Descend));
                assert!(!cut.nodes.is_empty(), "it meets the domain");
                let along_edge = keep.min_element() == 0.0;
                assert!(along_edge || cut.nodes.len() == 1, "{:?}", cut.nodes);
                assert_eq!(area_error(&layout, &cut, &plane, 0.0), 0.0);
            }
            let beyond = Plane::through(at + outward * 1e-3, outward);
            let cut = select(&layout, CuttingPlanes::new(&layout, &[beyond]));
            assert_eq!((cut.nodes.len(), cut.skipped.len()), (0, 1));
        }
    }
}

#[test]
fn a_plane_in_a_shared_face_belongs_to_the_upper_node_and_at_the_domains_end_to_the_last() {
    let layout = layout([9, 9, 9], Kind::Decimated, 4);
    let owners = |x: f64| -> Vec<Node> {
        let plane = IndexPlane::new(&layout, &Plane { normal: DVec3::X, distance: x });
        layout.level_nodes(0).filter(|&node| !section(&layout, node, &plane).is_empty()).collect()
    };
    for (x, expected) in [(0.0, 0), (3.9, 0), (4.0, 1), (8.0, 1)] {
        let owners = owners(x);
        assert_eq!(owners.len(), 4);
        assert!(owners.iter().all(|node| node.index[0] == expected), "{x}: {owners:?}");
    }
}

#[test]
fn nodes_that_share_an_edge_have_the_same_vertex_on_it_to_the_bit() {
    let mut noise = Noise(4);
    let mut shared = 0;
    for round in 0..120 {
        let layout = layout([23, 17, 19], KINDS[round % 2], 4);
        let size = layout.domain() * layout.spacing();
        let plane = Plane::through(noise.point(DVec3::ZERO, size), random_normal(&mut noise));
        let plane = IndexPlane::new(&layout, &plane);
        // By axis and the two other coordinates, over all levels.
        let mut crossings: HashMap<(usize, [u64; 2]), f64> = HashMap::new();
        for node in (0..layout.num_levels()).flat_map(|level| layout.level_nodes(level)) {
            let [low, high] = layout.bounds(node);
            for &v in section(&layout, node, &plane).vertices() {
                let Some(axis) = (0..3).find(|&a| low[a] < v[a] && v[a] < high[a]) else { continue };
                let line = [(axis + 1) % 3, (axis + 2) % 3].map(|a| v[a].to_bits());
                if let Some(before) = crossings.insert((axis, line), v[axis]) {
                    assert_eq!(before.to_bits(), v[axis].to_bits(), "{node}");
                    shared += 1;
                }
            }
        }
    }
    println!("{shared} shared vertices");
    assert!(shared > 10_000);
}

#[test]
fn planes_that_cannot_be_and_numbers_that_overflow_have_no_polygon() {
    let layout = layout([17, 9, 13], Kind::Decimated, 4);
    for bad in [0.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e308] {
        for plane in [
            Plane { normal: DVec3::splat(bad), distance: 0.0 },
            Plane { normal: DVec3::new(bad, bad, 0.0), distance: bad },
        ] {
            let is_valid = plane.defects().is_empty();
            let cut = select(&layout, CuttingPlanes::new(&layout, &[plane]));
            assert!(!is_valid && cut.nodes.is_empty(), "{plane:?}");
            let index_plane = IndexPlane::new(&layout, &plane);
            for node in layout.level_nodes(0) {
                let vertices = section(&layout, node, &index_plane).vertices().len();
                // Near the origin the last of them overflows nowhere.
                assert!(if bad == 1e308 { vertices <= 6 } else { vertices == 0 }, "{plane:?} {node}");
            }
        }
    }
    let far = Plane { normal: DVec3::X, distance: 1e300 };
    assert!(section(&layout, layout.root(), &IndexPlane::new(&layout, &far)).is_empty());
}

#[test]
fn ratios_are_those_of_corners_linear_along_edges_and_trilinear_inside() {
    let mut noise = Noise(5);
    for low_corners in 0..=u8::MAX {
        let bit = |corner: u32| f64::from(low_corners >> corner & 1);
        let place = |corner: u32| DVec3::from_array([0, 1, 2].map(|a| f64::from(corner >> a & 1)));
        for corner in 0..8 {
            assert_eq!(ratio(low_corners, place(corner)), bit(corner));
            for axis in 0..3 {
                let (other, w) = (corner ^ 1 << axis, noise.unit());
                let found = ratio(low_corners, place(corner).lerp(place(other), w));
                assert!((found - (bit(corner) * (1.0 - w) + bit(other) * w)).abs() < 1e-15);
            }
        }
        let p = noise.point(DVec3::ZERO, DVec3::ONE);
        let weight = |corner: u32| {
            (0..3).map(|a| if corner >> a & 1 == 1 { p[a] } else { 1.0 - p[a] }).product::<f64>()
        };
        let expected: f64 = (0..8).map(|corner| weight(corner) * bit(corner)).sum();
        assert!((ratio(low_corners, p) - expected).abs() < 1e-15);
    }
}

#[test]
fn local_positions_run_from_0_to_1_over_whole_nodes() {
    for kind in KINDS {
        let layout = layout([33, 20, 9], kind, 4);
        for level in 0..layout.num_levels() {
            for node in layout.level_nodes(level) {
                let [low, high] = layout.bounds(node).map(|p| local_position(&layout, node, p));
                assert!(low.cmpge(DVec3::ZERO).all() && high.cmple(DVec3::ONE).all());
                let next = Node::new(level, node.index.map(|i| i + 1));
                if layout.contains(next) {
                    assert_eq!(high, DVec3::ONE);
                }
            }
        }
    }
}
