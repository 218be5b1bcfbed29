//! The filters of cutting planes.

use glam::DVec3;
use volery_octree::filters::PLANE_SLACK;
use volery_octree::validate::defects;
use volery_octree::{Answer, Cut, CuttingPlanes, Filter, Focus, select};
use volery_pyramid::{Kind, Layout, Node};
use volery_scene::Plane;

use crate::world::{DIMS, KINDS, Noise, layout};

fn all_nodes(layout: &Layout) -> impl Iterator<Item = Node> {
    (0..layout.num_levels()).flat_map(|level| layout.level_nodes(level))
}

#[test]
fn exactly_the_nodes_that_a_plane_meets_or_nearly_meets_are_drawn() {
    let mut noise = Noise(1);
    let (mut met, mut missed, mut touched) = (0, 0, 0);
    for round in 0..400 {
        let layout = Layout::new(DIMS[round % DIMS.len()], DVec3::ONE, KINDS[round / 2 % 2], 4).unwrap();
        // Small integers and coordinates that are halves of integers: exact.
        let normal = noise.point(DVec3::splat(-3.0), DVec3::splat(3.0)).round();
        let distance = normal.dot(noise.point(-DVec3::ONE, layout.domain() + 1.0).round());
        let plane = Plane { normal, distance };
        if !plane.defects().is_empty() {
            continue;
        }
        let mut filter = CuttingPlanes::new(&layout, &[plane]);
        for node in all_nodes(&layout) {
            let [low, high] = layout.bounds(node);
            let corner =
                |c: u32| DVec3::from_array([0, 1, 2].map(|a| if c >> a & 1 == 1 { high[a] } else { low[a] }));
            let offsets: Vec<f64> = (0..8).map(|c| plane.signed_distance(corner(c))).collect();
            let least = offsets.iter().copied().fold(f64::INFINITY, f64::min);
            let greatest = offsets.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let meets = least <= 0.0 && greatest >= 0.0;
            let expected = if meets { Answer::Draw } else { Answer::Skip };
            assert_eq!(filter.answer(node), expected, "{node} {plane:?}: {least} to {greatest}");
            met += usize::from(meets);
            missed += usize::from(!meets);
            touched += usize::from(meets && (least == 0.0 || greatest == 0.0));
        }
    }
    println!("{met} nodes met, {touched} of them only touched, {missed} missed");
    assert!(met > 1000 && missed > 1000 && touched > 300);
}

#[test]
fn a_plane_just_beside_a_boundary_keeps_both_sides() {
    let layout = Layout::new([65, 65, 65], DVec3::ONE, Kind::Decimated, 4).unwrap();
    let drawn = |distance: f64| {
        let plane = Plane { normal: DVec3::X * 1e-9, distance: distance * 1e-9 };
        select(&layout, (CuttingPlanes::new(&layout, &[plane]), |_: Node| Answer::Descend)).nodes.len()
    };
    let slack = PLANE_SLACK * 64.0;
    assert_eq!(drawn(32.0), 512);
    assert_eq!([drawn(32.0 + 0.9 * slack), drawn(32.0 - 0.9 * slack)], [512; 2]);
    assert_eq!([drawn(32.0 + 1.1 * slack), drawn(32.0 - 1.1 * slack)], [256; 2]);
    assert_eq!([drawn(-0.9 * slack), drawn(64.0 + 0.9 * slack)], [256; 2], "at the domain's ends too");
    assert_eq!([drawn(-1.1 * slack), drawn(64.0 + 1.1 * slack)], [0; 2]);
}

#[test]
fn several_planes_keep_what_any_of_them_meets_and_none_keeps_nothing() {
    let layout = layout([33, 20, 9], Kind::Decimated, 4);
    let planes = [
        Plane { normal: DVec3::X, distance: 5.5 },
        Plane { normal: DVec3::new(1.0, -2.0, 0.3), distance: 3.0 },
        Plane { normal: DVec3::splat(f64::NAN), distance: 0.0 },
    ];
    for node in all_nodes(&layout) {
        let each = planes.map(|plane| CuttingPlanes::new(&layout, &[plane]).answer(node));
        let any = CuttingPlanes::new(&layout, &planes).answer(node);
        assert_eq!(any == Answer::Draw, each.contains(&Answer::Draw), "{node}");
        assert_eq!(each[2], Answer::Skip);
    }
    let cut = select(&layout, CuttingPlanes::new(&layout, &[]));
    assert_eq!((cut.nodes.len(), cut.skipped.as_slice()), (0, [layout.root()].as_slice()));
}

/// The volume of the paper's table 1: "the other 2158 are never considered".
#[test]
fn the_visible_female_has_2601_finest_nodes_of_which_a_plane_meets_few() {
    let layout = Layout::new([500, 500, 250], DVec3::ONE, Kind::Decimated, 30).unwrap();
    assert_eq!(layout.num_nodes(0), 2601);
    let full = |plane: Plane| {
        let filters = (CuttingPlanes::new(&layout, &[plane]), |_: Node| Answer::Descend);
        select(&layout, filters).nodes.len()
    };
    assert_eq!(full(Plane { normal: DVec3::Z, distance: 124.0 }), 17 * 17);
    assert_eq!(full(Plane { normal: DVec3::X, distance: 200.0 }), 17 * 9);
    let oblique = full(Plane::through(DVec3::new(250.0, 250.0, 125.0), DVec3::new(0.5, 0.3, 1.0)));
    assert!((300..600).contains(&oblique), "{oblique}");
    // The mandrill's 18 * 18 of the paper cover 253 of 256 samples.
    let mandrill = Layout::new([256, 256, 1], DVec3::ONE, Kind::Decimated, 14).unwrap();
    assert_eq!(mandrill.num_nodes(0), 19 * 19);
}

fn focused(layout: &Layout, point: DVec3, quality: f64) -> Cut {
    let cut = select(layout, Focus { layout, point, quality });
    assert_eq!(defects(layout, &cut), []);
    cut
}

#[test]
fn a_node_is_drawn_when_it_is_farther_than_its_diagonal_times_the_quality() {
    let mut noise = Noise(2);
    for dims in DIMS {
        for kind in KINDS {
            let layout = layout(dims, kind, 2);
            let size = layout.domain() * layout.spacing();
            // The point may lie outside.
            let point = noise.point(-size, size * 2.0);
            let quality = 3.0 * noise.unit();
            let is_far = |node: Node| {
                let [low, high] = layout.bounds(node).map(|p| p * layout.spacing());
                (point - (low + high) / 2.0).length() > quality * (high - low).length()
            };
            let cut = focused(&layout, point, quality);
            for node in cut.nodes {
                assert!(node.level == 0 || is_far(node), "{node}");
                let mut above = node;
                while above != layout.root() {
                    above = above.parent();
                    assert!(!is_far(above), "{above} could have been drawn");
                }
            }
        }
    }
}

#[test]
fn a_node_just_as_far_as_its_diagonal_times_the_quality_is_not_far() {
    let layout = Layout::new([9, 1, 1], DVec3::ONE, Kind::Decimated, 4).unwrap();
    let nodes = |x: f64, quality: f64| focused(&layout, DVec3::X * x, quality).nodes.len();
    assert_eq!([nodes(12.0, 1.0), nodes(12.001, 1.0)], [2, 1]);
    assert_eq!([nodes(20.0, 2.0), nodes(20.001, 2.0)], [2, 1]);
}

#[test]
fn quality_0_is_the_root_infinity_the_full_resolution_and_nan_lowers_none() {
    for dims in DIMS {
        let layout = layout(dims, Kind::Decimated, 2);
        let center = layout.domain() * layout.spacing() / 2.0;
        for point in [center, DVec3::ZERO, DVec3::splat(1e9), DVec3::splat(f64::NAN)] {
            for quality in [0.0, -0.0, -1.0, f64::NEG_INFINITY] {
                assert_eq!(focused(&layout, point, quality).nodes, [layout.root()]);
            }
            for quality in [f64::INFINITY, f64::NAN] {
                assert_eq!(focused(&layout, point, quality).nodes.len(), layout.num_nodes(0));
            }
        }
        let nowhere = focused(&layout, DVec3::splat(f64::NAN), 1.0);
        assert_eq!(nowhere.nodes.len(), layout.num_nodes(0));
        let beyond = focused(&layout, DVec3::splat(1e300), 1e3);
        assert_eq!(beyond.nodes, [layout.root()]);
    }
}

#[test]
fn more_quality_never_takes_resolution_away() {
    let layout = layout([65, 65, 17], Kind::Decimated, 2);
    let point = DVec3::new(10.0, 40.0, 80.0);
    let mut before = focused(&layout, point, 0.0).nodes;
    for quality in [0.25, 0.5, 1.0, 2.0, 4.0, 8.0] {
        let nodes = focused(&layout, point, quality).nodes;
        assert!(nodes.len() > before.len() || nodes.len() == layout.num_nodes(0), "{quality}");
        for node in &nodes {
            let covers = |&&other: &&Node| other.level >= node.level && node.ancestor(other.level) == other;
            assert_eq!(before.iter().filter(covers).count(), 1, "{node} at {quality}");
        }
        before = nodes;
    }
}
