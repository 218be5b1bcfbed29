//! Low samples, low corners, and that nothing jumps at a boundary.

use std::collections::BTreeMap;

use glam::DVec3;
use volery_octree::{Answer, Cut, balance, low_corners, select, validate};
use volery_pyramid::{Kind, Layout, Node, NodeSource, Pyramid};
use volery_scene::Samples;

use crate::field::{Field, low_samples, noise_floats, pyramid, read};
use crate::world::{DIMS, KINDS, Noise, layout, random_cut};

/// The part of the parent's brick over a node, sample by sample.
fn assert_low_samples_are_the_parents(source: &Pyramid) -> usize {
    let layout = source.layout();
    let channels = source.sample_type().channels();
    let mut compared = 0;
    for level in 0..layout.num_levels() - 1 {
        for node in layout.level_nodes(level) {
            let (brick, parent) = (read(source, node), read(source, node.parent()));
            for channel in 0..channels {
                let ([nx, ny, nz], low) = low_samples(&brick, channel);
                let first = node.index.map(|i| i as usize % 2 * layout.brick_cells() / 2);
                for (i, &value) in low.iter().enumerate() {
                    let at = [i % nx, i / nx % ny, i / nx / ny];
                    let at = std::array::from_fn(|a| first[a] + at[a]);
                    let expected = parent.samples.value(parent.shape.index(at), channel);
                    assert_eq!(value.to_bits(), expected.to_bits(), "{node} sample {i}");
                    compared += 1;
                }
                // All of the parent's brick up to the node's end, or the domain's.
                let end = |a: usize| first[a] + layout.brick_cells() / 2 + 1;
                let held = [0, 1, 2].map(|a| parent.shape.count[a].min(end(a)) - first[a]);
                assert_eq!([nx, ny, nz], held, "{node}");
            }
        }
    }
    compared
}

#[test]
fn low_samples_are_the_parents_brick_so_the_low_tile_is_dropped() {
    let mut noise = Noise(1);
    let mut compared = 0;
    for dims in DIMS.into_iter().chain([[31, 33, 100], [32, 64, 3], [97, 2, 30], [30, 61, 1]]) {
        for brick_cells in [2, 4, 6, 30] {
            let count: usize = dims.iter().product();
            let mut byte = || (noise.unit() * 256.0) as u8;
            let bytes: Vec<u8> = (0..count).map(|_| byte()).collect();
            let rgb: Vec<[u8; 3]> = (0..count).map(|_| [byte(), byte(), byte()]).collect();
            let rgba: Vec<[u8; 4]> = (0..count).map(|_| [byte(), byte(), byte(), byte()]).collect();
            let mut floats = noise_floats(dims, &mut noise);
            floats[count / 2] = f32::NAN;
            floats[count / 3] = -0.0;
            let all: [Samples; 4] = [bytes.into(), rgb.into(), rgba.into(), floats.into()];
            for samples in all {
                compared += assert_low_samples_are_the_parents(&pyramid(dims, brick_cells, samples));
            }
        }
    }
    println!("{compared} samples compared to the bit");
    assert!(compared > 100_000);
}

/// By the definition: all pairs of drawn nodes, whole ones, in integers.
fn slow_low_corners(layout: &Layout, cut: &Cut) -> Vec<u8> {
    let whole = |node: Node| {
        let span = (layout.brick_cells() as u64) << node.level;
        node.index.map(|i| [u64::from(i) * span, (u64::from(i) + 1) * span])
    };
    let is_low = |node: Node, corner: usize| {
        let at: [u64; 3] = std::array::from_fn(|a| whole(node)[a][corner >> a & 1]);
        let touches = |other: &&Node| {
            let bounds = whole(**other);
            (0..3).all(|a| (bounds[a][0]..=bounds[a][1]).contains(&at[a]))
        };
        cut.nodes.iter().filter(|other| other.level > node.level).any(|other| touches(&other))
    };
    let bits = |&node: &Node| (0..8).map(|c| u8::from(is_low(node, c)) << c).sum();
    cut.nodes.iter().map(bits).collect()
}

#[test]
fn low_corners_are_those_that_a_coarser_drawn_node_touches() {
    let mut low = 0;
    for dims in DIMS {
        for kind in KINDS {
            for brick_cells in [2, 4] {
                let layout = layout(dims, kind, brick_cells);
                for seed in 0..20 {
                    let cut = balance(&layout, &random_cut(&layout, seed));
                    let found = low_corners(&layout, &cut);
                    assert_eq!(found, slow_low_corners(&layout, &cut), "{dims:?} {seed}");
                    low += found.iter().filter(|&&bits| bits != 0).count();
                }
            }
        }
    }
    assert!(low > 1000, "{low} nodes with low corners");
}

#[test]
fn a_plane_in_full_resolution_shows_no_low_sample() {
    let layout = layout([65, 65, 65], Kind::Decimated, 4);
    let fine =
        |node: Node| if node.level == 3 && node.index[0] == 1 { Answer::Skip } else { Answer::Descend };
    let cut = balance(&layout, &select(&layout, fine));
    assert!(cut.skipped.iter().any(|node| node.level > 1), "the skipped surroundings are coarse");
    assert!(cut.nodes.iter().all(|node| node.level == 0));
    assert!(low_corners(&layout, &cut).iter().all(|&bits| bits == 0));
}

/// How two nodes meet: levels apart, the finer level, and along how many axes they are bounded there.
type Meeting = (u32, u32, usize);

/// Looks at random points on the boundaries of drawn nodes; returns the largest jump and how often which nodes
/// met.
fn jumps(field: &Field<'_>, points: usize, noise: &mut Noise) -> (f64, BTreeMap<Meeting, usize>) {
    let mut meetings = BTreeMap::new();
    let mut largest: f64 = 0.0;
    if field.cut.nodes.is_empty() {
        return (largest, meetings);
    }
    for _ in 0..points {
        let place = (noise.unit() * field.cut.nodes.len() as f64) as usize;
        let node = field.cut.nodes[place];
        let [low, high] = field.layout().bounds(node);
        let mut point = noise.point(low, high);
        // On a face, an edge or a corner; on faces most often, where the fewest nodes meet.
        let fixed = [1_u32, 2, 4, 1, 2, 4, 1, 2, 4, 3, 5, 6, 7][(noise.unit() * 13.0) as usize];
        for axis in (0..3).filter(|axis| fixed >> axis & 1 == 1) {
            point[axis] = if noise.unit() < 0.5 { low[axis] } else { high[axis] };
        }
        for other in field.touching(point).filter(|&other| other != place) {
            let apart = node.level.abs_diff(field.cut.nodes[other].level);
            let finer = node.level.min(field.cut.nodes[other].level);
            *meetings.entry((apart, finer, fixed.count_ones() as usize)).or_insert(0) += 1;
            for channel in 0..field.source.sample_type().channels() {
                let jump = field.value(place, point, channel) - field.value(other, point, channel);
                largest = largest.max(jump.abs());
            }
        }
    }
    (largest, meetings)
}

/// Coarse with a fine place somewhere, and some of it not seen.
fn ragged_cut(layout: &Layout, noise: &mut Noise) -> Cut {
    let focus = noise.point(DVec3::ZERO, layout.domain());
    select(layout, |node: Node| {
        let [low, high] = layout.bounds(node);
        let near = focus.clamp(low, high).distance(focus) < (high - low).length() / 8.0;
        match noise.unit() {
            x if x < 0.05 && node != layout.root() => Answer::Skip,
            x if near || x < 0.15 => Answer::Descend,
            _ => Answer::Draw,
        }
    })
}

#[test]
fn nothing_jumps_at_a_boundary_of_any_two_levels() {
    let mut noise = Noise(2);
    let mut worst: f64 = 0.0;
    let mut met: BTreeMap<Meeting, usize> = BTreeMap::new();
    // Even and odd ends, the domain cut short on every level.
    let shapes =
        [[33, 33, 33], [31, 33, 17], [100, 13, 30], [47, 53, 1], [1, 97, 89], [29, 2, 37], [1, 1, 300]];
    for (round, dims) in shapes.into_iter().cycle().take(140).enumerate() {
        let source = pyramid(dims, [2, 4][round % 2], noise_floats(dims, &mut noise));
        let field = Field::balanced(&source, &ragged_cut(source.layout(), &mut noise));
        assert_eq!(validate::defects(source.layout(), &field.cut), []);
        let (jump, meetings) = jumps(&field, 16_000, &mut noise);
        worst = worst.max(jump);
        meetings.into_iter().for_each(|(meeting, times)| *met.entry(meeting).or_insert(0) += times);
    }
    println!("largest jump {worst:.1e}, allowed 1e-6 of the range");
    for ((apart, finer, axes), times) in &met {
        println!("{times} points of levels {finer} and {}, bounded along {axes} axes", finer + apart);
    }
    assert!(worst <= 1e-6);
    for apart in [0, 1] {
        for axes in 1..=3 {
            let of = |&(&(a, _, b), _): &(&Meeting, &usize)| (a, b) == (apart, axes);
            let times: usize = met.iter().filter(of).map(|(_, times)| times).sum();
            let levels = met.iter().filter(of).count();
            assert!(times >= 100_000, "{apart} apart, {axes} axes: {times} points");
            assert!(levels >= 4, "{apart} apart, {axes} axes: {levels} pairs of levels");
        }
    }
    assert!(met.keys().all(|&(apart, ..)| apart <= 1));
}

#[test]
fn colours_do_not_jump_either() {
    let mut noise = Noise(3);
    for dims in [[33, 31, 17], [41, 67, 1]] {
        let mut color = || std::array::from_fn(|_| (noise.unit() * 256.0) as u8);
        let count: usize = dims.iter().product();
        let rgb: Vec<[u8; 3]> = (0..count).map(|_| color()).collect();
        let rgba: Vec<[u8; 4]> = rgb.iter().map(|&[r, g, b]| [r, g, b, r ^ b]).collect();
        for samples in [Samples::from(rgb), rgba.into()] {
            let source = pyramid(dims, 2, samples);
            let field = Field::balanced(&source, &ragged_cut(source.layout(), &mut Noise(4)));
            let (jump, meetings) = jumps(&field, 20_000, &mut Noise(5));
            println!("{dims:?}: largest jump {jump:.1e} of 255, allowed 2.55e-4");
            assert!(jump <= 1e-6 * 255.0);
            assert!(meetings.iter().any(|((apart, ..), &times)| *apart == 1 && times > 1000));
        }
    }
}

#[test]
fn without_blending_it_jumps() {
    let mut noise = Noise(6);
    let dims = [33, 33, 33];
    let source = pyramid(dims, 2, noise_floats(dims, &mut noise));
    let mut field = Field::balanced(&source, &random_cut(source.layout(), 7));
    field.low_corners.fill(0);
    let (jump, _) = jumps(&field, 10_000, &mut noise);
    assert!(jump > 0.1, "{jump}");
}

#[test]
fn the_one_pass_is_the_sum_of_the_papers_two_weighted_ones() {
    // Section 4.3: low weighted by the ratios, then high by one minus the ratios, each interpolated.
    let mut noise = Noise(8);
    let dims = [33, 31, 18];
    let source = pyramid(dims, 4, noise_floats(dims, &mut noise));
    let field = Field::balanced(&source, &random_cut(source.layout(), 9));
    let low = Field::new(&source, field.cut.clone(), vec![u8::MAX; field.cut.nodes.len()]);
    let high = Field::new(&source, field.cut.clone(), vec![0; field.cut.nodes.len()]);
    let mut largest: f64 = 0.0;
    for _ in 0..20_000 {
        let place = (noise.unit() * field.cut.nodes.len() as f64) as usize;
        let [from, to] = field.layout().bounds(field.cut.nodes[place]);
        let point = noise.point(from, to);
        let local = volery_octree::section::local_position(field.layout(), field.cut.nodes[place], point);
        let weight = |bits: u8| volery_octree::section::ratio(bits, local);
        let low_pass = weight(field.low_corners[place]) * low.value(place, point, 0);
        let high_pass = weight(!field.low_corners[place]) * high.value(place, point, 0);
        largest = largest.max((field.value(place, point, 0) - (low_pass + high_pass)).abs());
    }
    println!("largest difference {largest:.1e}, allowed 1e-14");
    assert!(largest <= 1e-14);
}
