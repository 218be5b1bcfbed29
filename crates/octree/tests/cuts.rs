//! Selected cuts, their validator and the filters.

mod world;

use std::cmp::Ordering;

use glam::DVec3;
use proptest::prelude::*;
use volery_octree::cut::canonical_order;
use volery_octree::validate::{Defect, defects};
use volery_octree::{Answer, Cut, DataTolerance, Filter, Frustum, Transparency, select};
use volery_pyramid::{Kind, Layout, Node, NodeSource, NodeStats, Pyramid};
use volery_scene::{Camera, ControlPoint, Projection, Samples, TransferFunction, VoxelGrid};
use world::{DIMS, KINDS, Noise, layout, random_cut};

/// Every sample belongs to exactly one node of the cut, by counting.
fn assert_covers_each_sample_once(layout: &Layout, cut: &Cut) {
    let [nx, ny, nz] = layout.dims();
    let mut times = vec![0; nx * ny * nz];
    for &node in cut.nodes.iter().chain(&cut.skipped) {
        let [xs, ys, zs] = layout.owned(node);
        for z in zs {
            for y in ys.clone() {
                for x in xs.clone() {
                    times[(z * ny + y) * nx + x] += 1;
                }
            }
        }
    }
    assert!(times.iter().all(|&times| times == 1), "{:?}", layout.dims());
}

/// The boxes of a cut have the volume of the domain (axes of one sample left out).
fn assert_boxes_fill_the_domain(layout: &Layout, cut: &Cut) {
    let volume = |[low, high]: [DVec3; 2]| -> f64 {
        (0..3).filter(|&a| layout.dims()[a] > 1).map(|a| high[a] - low[a]).product()
    };
    let sum: f64 = cut.nodes.iter().chain(&cut.skipped).map(|&node| volume(layout.bounds(node))).sum();
    assert!((sum - volume([DVec3::ZERO, layout.domain()])).abs() < 1e-9 * sum.max(1.0));
}

#[test]
fn random_cuts_cover_every_sample_once() {
    for dims in DIMS {
        for kind in KINDS {
            for brick_cells in [2, 4, 30] {
                let layout = layout(dims, kind, brick_cells);
                for seed in 0..5 {
                    let cut = random_cut(&layout, seed);
                    assert_eq!(defects(&layout, &cut), []);
                    assert_covers_each_sample_once(&layout, &cut);
                    assert_boxes_fill_the_domain(&layout, &cut);
                    assert_eq!(cut.nodes_by_level().iter().sum::<usize>(), cut.nodes.len());
                }
            }
        }
    }
}

#[test]
fn nodes_are_counted_level_by_level() {
    let nodes = [2, 0, 0, 2, 2].map(|level| Node::new(level, [0; 3])).to_vec();
    assert_eq!(Cut { nodes, skipped: Vec::new() }.nodes_by_level(), [2, 0, 3]);
}

#[test]
fn every_defect_is_found() {
    let layout = layout([9, 9, 9], Kind::Decimated, 2);
    let whole = select(&layout, |node: Node| if node.level > 1 { Answer::Descend } else { Answer::Draw });
    assert_eq!(whole.nodes.len(), 8);
    let changed = |change: &dyn Fn(&mut Cut)| {
        let mut cut = whole.clone();
        change(&mut cut);
        defects(&layout, &cut)
    };
    let node = whole.nodes[3];
    let outside = Node::new(1, [2, 0, 0]);
    let inner = Node::new(0, [3, 3, 1]);
    assert_eq!(changed(&|_| ()), []);
    assert_eq!(changed(&|cut| cut.nodes.retain(|&n| n != node)), [Defect::Gap { node }]);
    assert_eq!(changed(&|cut| cut.nodes.insert(3, node)), [Defect::Duplicate { node }]);
    assert_eq!(changed(&|cut| cut.skipped.push(node)), [Defect::Duplicate { node }]);
    assert_eq!(changed(&|cut| cut.skipped.push(inner)), [Defect::Overlap { outer: node, inner }]);
    assert_eq!(changed(&|cut| cut.skipped.push(outside)), [Defect::Outside { node: outside }]);
    assert_eq!(changed(&|cut| cut.nodes.swap(3, 4)), [Defect::Order { node }]);
    assert_eq!(changed(&|cut| cut.nodes.clear()), [Defect::Gap { node: layout.root() }]);
    assert_eq!(Defect::Gap { node }.to_string(), "node (1, 1, 0) of level 1 is not covered");
    let beyond = Node::new(u32::MAX, [u32::MAX; 3]);
    assert_eq!(changed(&|cut| cut.skipped.push(beyond)), [Defect::Outside { node: beyond }]);
    let shattered = changed(&|cut| {
        cut.nodes.remove(3);
        cut.skipped.push(inner);
    });
    assert_eq!(shattered.len(), 7, "seven of eight children are missing: {shattered:?}");
}

#[test]
fn filters_combine_by_the_stronger_answer() {
    let answers = [Answer::Draw, Answer::Descend, Answer::Skip];
    let node = Node::new(1, [0; 3]);
    for a in answers {
        for b in answers {
            let says = |answer: Answer| move |_: Node| answer;
            assert_eq!((says(a), says(b)).answer(node), a.max(b));
            assert_eq!((says(Answer::Draw), says(a), says(b)).answer(node), a.max(b));
        }
    }
    assert!(Answer::Skip > Answer::Descend && Answer::Descend > Answer::Draw);
}

fn pyramid(dims: [usize; 3], kind: Kind, samples: impl Into<Samples>) -> Pyramid {
    let grid = VoxelGrid::new(dims, DVec3::new(1.0, 1.0, 10.0), samples).expect("a valid grid");
    Pyramid::build(&grid, kind, 2).expect("a valid layout")
}

fn ramp(dims: [usize; 3]) -> Vec<f32> {
    (0..dims.iter().product()).map(|i| (i % dims[0]) as f32).collect()
}

#[test]
fn tolerance_zero_is_the_finest_level_and_infinity_spares_only_blank_nodes() {
    for dims in DIMS {
        for kind in KINDS {
            let mut values = ramp(dims);
            values[0] = f32::NAN;
            let source = pyramid(dims, kind, values);
            let layout = source.layout();
            let finest = select(layout, DataTolerance { source: &source, tolerance: 0.0 });
            assert_eq!(defects(layout, &finest), []);
            // Nodes of one value are what they are at any level.
            let is_one_value = |stats: &NodeStats| stats.error == 0.0 && stats.min == stats.max;
            assert!(finest.nodes.iter().all(|&node| node.level == 0 || is_one_value(&source.stats(node)[0])));
            let coarsest = select(layout, DataTolerance { source: &source, tolerance: f64::INFINITY });
            assert_eq!(defects(layout, &coarsest), []);
            for node in coarsest.nodes {
                assert!(node.level == 0 || source.stats(node)[0].error < f64::INFINITY);
            }
        }
    }
}

#[test]
fn all_equal_data_are_one_node_at_any_tolerance() {
    let source = pyramid([17, 9, 5], Kind::Averaged, vec![3u8; 17 * 9 * 5]);
    let cut = select(source.layout(), DataTolerance { source: &source, tolerance: 1e-300 });
    assert_eq!(cut.nodes, [source.layout().root()]);
}

#[test]
fn a_cut_by_tolerance_keeps_it_and_is_as_coarse_as_it_can_be() {
    let dims = [29, 17, 11];
    let mut noise = Noise(1);
    let values: Vec<u8> =
        (0..29 * 17 * 11).map(|i| (i % 29 * 8) as u8 | (noise.unit() * 8.0) as u8).collect();
    for kind in KINDS {
        let source = pyramid(dims, kind, values.clone());
        for tolerance in [1.0, 5.0, 20.0, 100.0] {
            let error = |node: Node| source.stats(node)[0].error;
            let cut = select(source.layout(), DataTolerance { source: &source, tolerance });
            assert!(cut.nodes.iter().all(|&node| error(node) < tolerance || node.level == 0));
            let above = cut.nodes.iter().filter(|&&node| node != source.layout().root());
            assert!(above.into_iter().all(|node| error(node.parent()) >= tolerance));
        }
    }
}

#[test]
fn exactly_the_transparent_nodes_are_skipped() {
    let dims = [21, 10, 7];
    let point = |value: f64, opacity: f64| ControlPoint { value, color: [1.0; 3], opacity };
    let points = vec![point(60.0, 0.0), point(70.0, 0.5), point(80.0, 0.0), point(80.0, 0.0)];
    let transfer = TransferFunction::new(points, 1.0).unwrap();
    for kind in KINDS {
        let values: Vec<f32> =
            (0..21 * 10 * 7).map(|i| if i % 97 == 5 { f32::NAN } else { (i % 21 * 5) as f32 }).collect();
        let source = pyramid(dims, kind, values.clone());
        let layout = source.layout();
        let mut filter = Transparency { source: &source, transfer: &transfer };
        let mut answers = [0; 2];
        for level in 0..layout.num_levels() {
            for node in layout.level_nodes(level) {
                let [xs, ys, zs] = layout.support(node);
                let rows = zs.flat_map(|z| ys.clone().map(move |y| (z * 10 + y) * 21));
                let finite = |x: &f64| x.is_finite();
                let inside = rows.flat_map(|row| xs.clone().map(move |x| row + x));
                let inside: Vec<f64> = inside.map(|i| f64::from(values[i])).filter(finite).collect();
                let low = inside.iter().copied().fold(f64::INFINITY, f64::min);
                let high = inside.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                // The field takes every value between; it is visible inside (60, 80) only.
                let visible = !inside.is_empty() && high > 60.0 && low < 80.0;
                let expected = if visible { Answer::Draw } else { Answer::Skip };
                assert_eq!(filter.answer(node), expected, "{kind:?} {node}: {low} to {high}");
                answers[usize::from(visible)] += 1;
            }
        }
        assert!(answers[0] > 10 && answers[1] > 10, "{answers:?}");
    }
    let color = pyramid([3, 3, 3], Kind::Averaged, vec![[0u8; 4]; 27]);
    let root = color.layout().root();
    let never = Transparency { source: &color, transfer: &transfer }.answer(root);
    assert_eq!(never, Answer::Draw, "a transfer function says nothing about colours");
}

/// Where a world point appears, in pixels; `None` behind the eye.
fn project(camera: &Camera, [width, height]: [f64; 2], point: DVec3) -> Option<[f64; 2]> {
    let [right, up, forward] = camera.axes();
    let p = point - camera.eye;
    let depth = p.dot(forward);
    let half_height = match camera.projection {
        Projection::Perspective { fov_y_deg } => depth * (fov_y_deg / 2.0).to_radians().tan(),
        Projection::Orthographic { height } => height / 2.0,
    };
    let scale = height / 2.0 / half_height;
    let pixel = [width / 2.0 + p.dot(right) * scale, height / 2.0 - p.dot(up) * scale];
    (depth >= 0.0).then_some(pixel)
}

fn random_camera(noise: &mut Noise, extent: DVec3) -> Camera {
    let mut at = |scale: f64| noise.point(-extent * scale, extent * (1.0 + scale));
    // Inside the domain or around it.
    let (eye, target, up) = (at(1.0), at(0.0), at(1.0));
    let projection = if noise.unit() < 0.5 {
        Projection::Perspective { fov_y_deg: 5.0 + 150.0 * noise.unit() }
    } else {
        Projection::Orthographic { height: extent.length() * (0.05 + noise.unit()) }
    };
    Camera { eye, target, up, projection, is_mirrored: false }
}

#[test]
fn no_node_with_a_visible_point_is_outside_the_frustum() {
    let mut noise = Noise(2);
    let (mut skipped, mut hidden) = (0, 0);
    for round in 0..200 {
        let kind = KINDS[round % 2];
        let layout = layout([33, 20, 9], kind, 4);
        let camera = random_camera(&mut noise, layout.world_bounds(layout.root())[1]);
        assert!(camera.defects().is_empty());
        let (width, height) = ([640, 100][round % 2], [480, 300][round / 2 % 2]);
        let size = [f64::from(width), f64::from(height)];
        let mut frustum = Frustum::new(&layout, &camera, width, height);
        for level in 0..layout.num_levels() {
            for node in layout.level_nodes(level) {
                let [low, high] = layout.world_bounds(node);
                let visible = (0..200).any(|_| {
                    let pixel = project(&camera, size, noise.point(low, high));
                    pixel.is_some_and(|p| (0..2).all(|a| (0.0..=size[a]).contains(&p[a])))
                });
                let answer = frustum.answer(node);
                assert!(!(visible && answer == Answer::Skip), "{node} of {camera:?}");
                skipped += usize::from(answer == Answer::Skip);
                hidden += usize::from(!visible);
            }
        }
    }
    let share = skipped as f64 / hidden as f64;
    println!("skipped {skipped} of {hidden} nodes without a visible point: {share:.3}, expected above 0.8");
    assert!(share > 0.8);
}

#[test]
fn a_frustum_around_everything_and_a_defective_camera_skip_nothing() {
    let layout = layout([33, 20, 9], Kind::Decimated, 4);
    let extent = layout.world_bounds(layout.root())[1];
    for orthographic in [false, true] {
        let all = Camera::fitted(extent, 30.0, 20.0, 1.0, orthographic);
        let nowhere = Camera { target: all.eye, ..all };
        for camera in [all, nowhere] {
            let cut = select(&layout, (Frustum::new(&layout, &camera, 64, 64), |_: Node| Answer::Descend));
            assert_eq!(cut.skipped, []);
            assert_eq!(cut.nodes.len(), layout.num_nodes(0));
        }
    }
}

/// A corner exactly in the left edge of the picture, but for the rounding of an eye that may be far away.
#[test]
fn a_node_that_the_view_only_touches_stays() {
    let layout = layout([33, 20, 9], Kind::Decimated, 4);
    let node = Node::new(0, [3, 2, 1]);
    let [low, high] = layout.world_bounds(node);
    let mut noise = Noise(4);
    for distance in [1e2, 1e4, 1e6, 1e9] {
        for _ in 0..100 {
            let camera = random_camera(&mut noise, high);
            let [right, _, forward] = camera.axes();
            let touched = DVec3::select(right.cmpgt(DVec3::ZERO), high, low);
            let seen_from = |beside: f64| {
                let target = touched + right * (3.0 + beside);
                let (eye, projection) =
                    (target - forward * distance, Projection::Orthographic { height: 6.0 });
                Frustum::new(&layout, &Camera { eye, target, projection, ..camera }, 32, 32).answer(node)
            };
            assert_eq!(seen_from(0.0), Answer::Draw, "{distance:e} {camera:?}");
            assert_eq!(seen_from(0.01), Answer::Skip, "{distance:e} {camera:?}");
        }
    }
}

#[test]
fn the_eye_inside_a_node_keeps_it() {
    let layout = layout([33, 20, 9], Kind::Averaged, 4);
    let mut noise = Noise(3);
    for _ in 0..300 {
        let camera = random_camera(&mut noise, layout.world_bounds(layout.root())[1]);
        let mut frustum = Frustum::new(&layout, &camera, 32, 32);
        if let Projection::Perspective { .. } = camera.projection {
            for node in layout.level_nodes(0) {
                let [low, high] = layout.world_bounds(node);
                if camera.eye.cmpge(low).all() && camera.eye.cmple(high).all() {
                    assert_eq!(frustum.answer(node), Answer::Draw, "{node} {camera:?}");
                }
            }
        }
    }
}

proptest! {
    #[test]
    fn the_canonical_order_is_that_of_the_walk(
        dims in [1..40usize, 1..40usize, 1..40usize], averaged: bool, seed: u64,
    ) {
        let layout = layout(dims, KINDS[usize::from(averaged)], 2);
        let mut walk = Vec::new();
        let cut = select(&layout, |node: Node| {
            walk.push(node);
            Answer::Descend
        });
        prop_assert!(walk.windows(2).all(|pair| canonical_order(pair[0], pair[1]) == Ordering::Less));
        prop_assert_eq!(cut.nodes.len(), layout.num_nodes(0));
        let cut = random_cut(&layout, seed);
        prop_assert_eq!(defects(&layout, &cut), []);
    }
}
