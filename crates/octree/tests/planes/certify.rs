//! Certified cuts: the bound asked for is kept, by the blends too.

use glam::DVec3;
use volery_octree::certify::{Certified, without_unseen};
use volery_octree::validate::defects;
use volery_octree::{Answer, CuttingPlanes, Filter, balance, certified, low_corners, select};
use volery_pyramid::{Node, NodeSource, Pyramid};
use volery_scene::Plane;

use crate::field::{Field, pyramid};
use crate::world::Noise;

/// Smooth, with fine detail in places.
fn waves([nx, ny, nz]: [usize; 3], noise: &mut Noise) -> Vec<f32> {
    let phase = noise.unit() * 6.0;
    (0..nx * ny * nz)
        .map(|i| {
            let p = [i % nx, i / nx % ny, i / nx / ny].map(|x| x as f64);
            let smooth = (p[0] * 0.1 + phase).sin() + (p[1] * 0.07 - p[2] * 0.13).cos();
            let rough = f64::from(u8::from((p[0] * 0.05 + p[1] * 0.06 + phase).sin() > 0.8));
            (smooth + rough * noise.unit()) as f32
        })
        .collect()
}

fn worst_error(source: &Pyramid, node: Node) -> f64 {
    source.stats(node).iter().map(|stats| stats.error).fold(0.0, f64::max)
}

/// Of a node that may blend into its parent.
fn worst_shown(source: &Pyramid, node: Node, low_corners: u8) -> f64 {
    let own = worst_error(source, node);
    if low_corners == 0 { own } else { own.max(worst_error(source, node.parent())) }
}

fn certify(source: &Pyramid, filter: impl Filter, max: f64) -> Certified {
    let found = certified(source.layout(), filter, |node, low| worst_shown(source, node, low), max);
    assert_eq!(defects(source.layout(), &found.cut), []);
    assert_eq!(volery_octree::balance::defects(&found.cut), []);
    assert_eq!(found.low_corners, low_corners(source.layout(), &found.cut));
    found
}

/// The largest difference from the full resolution at random points and vertices of what is drawn.
fn measured(source: &Pyramid, field: &Field<'_>, noise: &mut Noise) -> f64 {
    let full = Field::balanced(source, &select(source.layout(), |_: Node| Answer::Descend));
    let mut largest: f64 = 0.0;
    for (place, &node) in field.cut.nodes.iter().enumerate() {
        let [low, high] = field.layout().bounds(node);
        for round in 0..40 {
            let point = noise.point(low, high);
            let point = if round % 2 == 0 { point } else { point.round().clamp(low, high) };
            let truth = full.touching(point).next().expect("the full resolution covers all");
            let difference = field.value(place, point, 0) - full.value(truth, point, 0);
            largest = largest.max(difference.abs());
        }
    }
    largest
}

#[test]
fn no_point_of_a_certified_cut_is_farther_from_the_truth_than_its_bound() {
    let mut noise = Noise(1);
    let (mut coarse, mut blends) = (0, 0);
    for (round, dims) in
        [[33, 33, 17], [40, 23, 29], [97, 61, 1], [1, 1, 200]].into_iter().cycle().take(12).enumerate()
    {
        let source = pyramid(dims, [2, 4][round % 2], waves(dims, &mut noise));
        for max in [0.02, 0.1, 0.3, 1.0] {
            let found = certify(&source, |_: Node| Answer::Draw, max);
            assert!(found.bound <= max);
            coarse += found.cut.nodes.iter().filter(|node| node.level > 0).count();
            blends += found.low_corners.iter().filter(|&&bits| bits != 0).count();
            let field = Field::new(&source, found.cut, found.low_corners);
            let measured = measured(&source, &field, &mut noise);
            // Rounding of this test.
            assert!(
                measured <= found.bound + 1e-12,
                "measured {measured}, bound {}, asked {max}",
                found.bound
            );
        }
    }
    println!("{coarse} coarse nodes, {blends} blends");
    assert!(coarse > 1000 && blends > 300);
}

#[test]
fn bounds_of_the_nodes_alone_would_not_bound_their_blends() {
    let mut noise = Noise(2);
    let dims = [40, 33, 29];
    let source = pyramid(dims, 2, waves(dims, &mut noise));
    let keeps = |node: Node| {
        if node.level == 0 || worst_error(&source, node) <= 0.1 { Answer::Draw } else { Answer::Descend }
    };
    let naive = Field::balanced(&source, &select(source.layout(), keeps));
    let measured = measured(&source, &naive, &mut noise);
    assert!(measured > 0.11, "{measured}: this test shows nothing");
}

#[test]
fn a_bound_of_0_is_the_finest_level_and_an_infinite_one_the_root() {
    let mut noise = Noise(3);
    let dims = [21, 30, 11];
    let source = pyramid(dims, 2, waves(dims, &mut noise));
    let layout = source.layout();
    let one = |_: Node, _: u8| 1.0;
    let fine = certified(
        layout,
        |_: Node| Answer::Draw,
        |node: Node, low: u8| f64::from(node.level) + f64::from(low),
        0.0,
    );
    assert_eq!((fine.cut.nodes.len(), fine.bound), (layout.num_nodes(0), 0.0));
    let coarse = certified(layout, |_: Node| Answer::Draw, one, f64::INFINITY);
    assert_eq!((coarse.cut.nodes, coarse.bound), (vec![layout.root()], 1.0));
    for (max, bound) in [(f64::INFINITY, f64::INFINITY), (1.0, f64::NAN), (f64::NAN, 1.0)] {
        let found = certified(
            layout,
            |_: Node| Answer::Draw,
            |node: Node, low: u8| if node.level == 0 && low == 0 { 0.0 } else { bound },
            max,
        );
        assert_eq!(found.cut.nodes.len(), layout.num_nodes(0), "{bound} <= {max} is not so");
    }
    let unseen = certified(layout, |_: Node| Answer::Skip, one, 0.5);
    assert_eq!((unseen.cut.nodes.len(), unseen.bound), (0, 0.0));
}

#[test]
fn blank_samples_are_drawn_at_the_finest_level() {
    let mut noise = Noise(4);
    let dims = [33, 33, 33];
    let mut values = waves(dims, &mut noise);
    for i in [0, 5000, 20_000] {
        values[i] = f32::NAN;
    }
    let source = pyramid(dims, 4, values);
    let found = certify(&source, |_: Node| Answer::Draw, 10.0);
    assert!(found.bound <= 10.0);
    assert!(found.cut.nodes.iter().any(|node| node.level > 0));
    for (node, low) in found.cut.nodes.iter().zip(&found.low_corners) {
        assert!(node.level == 0 || worst_error(&source, *node).is_finite());
        assert!(*low == 0 || worst_error(&source, node.parent()).is_finite());
    }
}

#[test]
fn only_what_the_planes_meet_is_refined() {
    let mut noise = Noise(5);
    let dims = [65, 65, 65];
    let source = pyramid(dims, 4, waves(dims, &mut noise));
    let layout = source.layout();
    for _ in 0..20 {
        let size = layout.domain() * layout.spacing();
        let plane = Plane::through(noise.point(DVec3::ZERO, size), noise.point(DVec3::NEG_ONE, DVec3::ONE));
        let found = certify(&source, CuttingPlanes::new(layout, &[plane]), 0.2);
        let mut filter = CuttingPlanes::new(layout, &[plane]);
        assert!(found.cut.nodes.iter().all(|&node| filter.answer(node) == Answer::Draw));
        assert!(found.cut.skipped.iter().all(|&node| filter.answer(node) == Answer::Skip));
        assert!(found.bound <= 0.2);
        let finest = select(layout, (CuttingPlanes::new(layout, &[plane]), |_: Node| Answer::Descend));
        assert!(found.cut.nodes.len() <= finest.nodes.len());
    }
}

#[test]
fn leaving_out_the_unseen_keeps_cover_and_balance() {
    let layout = crate::world::layout([65, 33, 47], volery_pyramid::Kind::Decimated, 2);
    let mut noise = Noise(6);
    for seed in 0..30 {
        let cut = balance(&layout, &crate::world::random_cut(&layout, seed));
        let mut unseen = |node: Node| {
            if node.index[0].is_multiple_of(3) || noise.unit() < 0.2 { Answer::Skip } else { Answer::Descend }
        };
        let seen = without_unseen(&cut, &mut unseen);
        assert_eq!(defects(&layout, &seen), []);
        assert_eq!(volery_octree::balance::defects(&seen), []);
        assert!(seen.nodes.len() < cut.nodes.len() || cut.nodes.is_empty());
        assert!(seen.nodes.iter().all(|node| cut.nodes.contains(node)));
        let all = |cut: &volery_octree::Cut| cut.nodes.len() + cut.skipped.len();
        assert_eq!(all(&seen), all(&cut));
    }
}
