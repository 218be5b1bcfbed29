//! The visibility order against oracles that know nothing of trees.

mod world;

use glam::DVec3;
use proptest::prelude::*;
use volery_octree::{Cut, Viewpoint, front_to_back};
use volery_pyramid::{Kind, Layout};
use volery_scene::Camera;
use world::{DIMS, KINDS, Noise, layout, random_cut};

/// Whether `[low, high]` is passed by a ray over some length: enters, leaves.
fn passage([low, high]: [DVec3; 2], origin: DVec3, direction: DVec3, from: f64) -> Option<[f64; 2]> {
    let (mut enter, mut leave) = (from, f64::INFINITY);
    for axis in 0..3 {
        if direction[axis] == 0.0 {
            if origin[axis] <= low[axis] || origin[axis] >= high[axis] {
                return None;
            }
            continue;
        }
        let a = (low[axis] - origin[axis]) / direction[axis];
        let b = (high[axis] - origin[axis]) / direction[axis];
        (enter, leave) = (enter.max(a.min(b)), leave.min(a.max(b)));
    }
    (leave - enter > 1e-9 * (1.0 + leave.abs())).then_some([enter, leave])
}

/// Rays meet the nodes in the order found.
fn assert_rays_agree(layout: &Layout, cut: &Cut, viewpoint: Viewpoint, noise: &mut Noise) {
    let order = front_to_back(layout, &cut.nodes, viewpoint);
    for _ in 0..40 {
        let through = noise.point(DVec3::ZERO, layout.domain());
        let (origin, direction, from) = match viewpoint {
            Viewpoint::Eye(eye) => (eye, through - eye, 0.0),
            Viewpoint::Direction(direction) => (through, direction, f64::NEG_INFINITY),
        };
        let passed =
            order.iter().filter_map(|&i| passage(layout.bounds(cut.nodes[i]), origin, direction, from));
        let passed: Vec<[f64; 2]> = passed.collect();
        for pair in passed.windows(2) {
            assert!(
                pair[0][1] <= pair[1][0] + 1e-6 * (1.0 + pair[1][0].abs()),
                "{viewpoint:?} {through}: {pair:?}"
            );
        }
    }
}

/// No node can hide an earlier one: for every pair a plane parts them with the eye on the earlier's side.
fn assert_pairs_agree(layout: &Layout, cut: &Cut, viewpoint: Viewpoint) {
    let order = front_to_back(layout, &cut.nodes, viewpoint);
    let mut places = order.clone();
    places.sort_unstable();
    assert!(places.into_iter().eq(0..cut.nodes.len()), "each node once");
    let boxes: Vec<[DVec3; 2]> = order.iter().map(|&i| layout.bounds(cut.nodes[i])).collect();
    for (i, [low, high]) in boxes.iter().enumerate() {
        for [later_low, later_high] in &boxes[i + 1..] {
            let parted = (0..3).any(|a| {
                let (below, above) = (high[a] <= later_low[a], low[a] >= later_high[a]);
                match viewpoint {
                    Viewpoint::Eye(eye) => {
                        below && eye[a] <= later_low[a] || above && eye[a] >= later_high[a]
                    }
                    Viewpoint::Direction(d) => below && d[a] >= 0.0 || above && d[a] <= 0.0,
                }
            });
            assert!(parted, "{viewpoint:?}: {low}..{high} before {later_low}..{later_high}");
        }
    }
}

fn check(layout: &Layout, cut: &Cut, viewpoint: Viewpoint) {
    assert_pairs_agree(layout, cut, viewpoint);
    assert_rays_agree(layout, cut, viewpoint, &mut Noise(9));
}

/// Eyes at every vertex, edge and face of the finest nodes, in their middles, and an ulp beside.
#[test]
fn eyes_on_vertices_edges_and_faces() {
    for kind in KINDS {
        let layout = layout([9, 6, 5], kind, 2);
        let cut = random_cut(&layout, 4);
        for node in layout.level_nodes(0) {
            let [low, high] = layout.bounds(node);
            for place in 0..27 {
                let pick =
                    |a: usize| [low[a], high[a], (low[a] + high[a]) / 2.0][place / 3usize.pow(a as u32) % 3];
                let eye = DVec3::new(pick(0), pick(1), pick(2));
                check(&layout, &cut, Viewpoint::Eye(eye));
                let beside = DVec3::new(eye.x.next_up(), eye.y.next_down(), eye.z.next_up());
                check(&layout, &cut, Viewpoint::Eye(beside));
            }
        }
    }
}

#[test]
fn all_parallel_directions() {
    for dims in DIMS {
        for kind in KINDS {
            let layout = layout(dims, kind, 2);
            let cut = random_cut(&layout, 5);
            for octant in 0..27 {
                let sign = |a: u32| f64::from(octant / 3i32.pow(a) % 3 - 1);
                let direction = DVec3::new(sign(0), 2.0 * sign(1), 0.3 * sign(2));
                check(&layout, &cut, Viewpoint::Direction(direction));
            }
        }
    }
}

#[test]
fn hard_dims_from_inside_and_outside() {
    let mut noise = Noise(6);
    for dims in DIMS {
        for kind in KINDS {
            let layout = layout(dims, kind, 4);
            for seed in 0..4 {
                let cut = random_cut(&layout, seed);
                let eye = noise.point(-layout.domain() - 1.0, layout.domain() * 2.0 + 1.0);
                check(&layout, &cut, Viewpoint::Eye(eye));
                check(&layout, &cut, Viewpoint::Eye(eye * 1e6));
            }
        }
    }
}

/// Order is found in finest-sample coordinates, where spacing has no say; the camera is in world units.
#[test]
fn spacing_one_to_ten_is_divided_out() {
    let layout = layout([9, 9, 9], Kind::Decimated, 2);
    let camera = Camera::fitted(layout.world_bounds(layout.root())[1], 30.0, 20.0, 1.0, false);
    let Viewpoint::Eye(eye) = Viewpoint::of(&camera, &layout) else { panic!("perspective has an eye") };
    assert!((eye * DVec3::new(1.0, 1.0, 10.0) - camera.eye).length() < 1e-12 * camera.eye.length());
    let camera = Camera::fitted(layout.world_bounds(layout.root())[1], 30.0, 20.0, 1.0, true);
    let Viewpoint::Direction(d) = Viewpoint::of(&camera, &layout) else { panic!("parallel has a direction") };
    let world = d * DVec3::new(1.0, 1.0, 10.0);
    assert!(world.normalize().dot(camera.axes()[2]) > 1.0 - 1e-12);
}

#[test]
fn overlapping_or_unsorted_nodes_are_left_out_without_panic() {
    let layout = layout([9, 9, 9], Kind::Decimated, 2);
    let mut cut = random_cut(&layout, 7);
    cut.nodes.reverse();
    let order = front_to_back(&layout, &cut.nodes, Viewpoint::Eye(DVec3::ZERO));
    assert!(order.len() <= cut.nodes.len());
}

proptest! {
    #[test]
    fn random_trees_and_eyes(
        dims in [1..24usize, 1..24usize, 1..24usize], averaged: bool, seed: u64,
        share in proptest::array::uniform3(-1.0..2.0f64),
    ) {
        let layout = layout(dims, KINDS[usize::from(averaged)], 2);
        let cut = random_cut(&layout, seed);
        if cut.nodes.len() < 600 {
            check(&layout, &cut, Viewpoint::Eye(layout.domain() * DVec3::from_array(share)));
            check(&layout, &cut, Viewpoint::Direction(DVec3::from_array(share) - 0.5));
        }
    }
}
