//! Nodes held finer and coarser than their own level.

use glam::DVec3;
use volery_pyramid::{Kind, Layout, Node, NodeSource, Pyramid, held_error};
use volery_scene::{Samples, VoxelGrid};

use crate::oracle::{Levels, error_at};

const KINDS: [Kind; 2] = [Kind::Decimated, Kind::Averaged];
const DIMS: [[usize; 3]; 6] = [[1, 1, 1], [2, 1, 3], [1, 1, 37], [13, 11, 7], [16, 16, 16], [33, 9, 5]];

/// The paper's head: 128^3 voxels, in a tree whose nodes of level 2, 1, 0 have 64^3, 32^3, 16^3 of them.
fn head() -> Layout {
    Layout::new([128; 3], DVec3::ONE, Kind::Averaged, 16).expect("a valid layout")
}

/// Texels inside and texels of the boundary of a cut of the paper's shape: 6 nodes of 64^3, and 16 of 32^3, whose first
/// half is of interest; each held at the level given.
fn texels_of_cut(large: u32, of_interest: u32, others: u32) -> [usize; 2] {
    let layout = head();
    let (split, whole): (Vec<Node>, Vec<Node>) =
        layout.level_nodes(2).partition(|node| node.index[1..] == [0, 0]);
    let small: Vec<Node> = split.iter().flat_map(|&node| layout.children(node)).collect();
    assert_eq!((whole.len(), small.len()), (6, 16));
    let held = whole.into_iter().map(|node| (node, large)).chain(
        small.into_iter().enumerate().map(|(i, node)| (node, if i < 8 { of_interest } else { others })),
    );
    let mut texels = [0; 2];
    for (node, resolution) in held {
        let shape = layout.block_shape(node, resolution);
        let inside: usize = shape.count.map(|count| count - 2).iter().product();
        texels[0] += inside;
        texels[1] += shape.num_samples() - inside;
    }
    texels
}

/// Nodes of 64^3 at 32^3, of 32^3 at 32^3 and at 16^3.
#[test]
fn texels_of_the_papers_figure_10() {
    assert_eq!(texels_of_cut(1, 0, 1), [491_520, 105_392]);
}

/// Nodes of 64^3 at 16^3, of 32^3 at 32^3 and at 8^3.
#[test]
fn texels_of_the_papers_figure_11() {
    assert_eq!(texels_of_cut(2, 0, 2), [290_816, 66_608]);
}

#[test]
fn resolutions_end_where_samples_or_levels_do() {
    let head = head();
    assert_eq!(
        head.resolutions(Node::new(0, [0; 3])),
        0..=3,
        "16 cells fit to a single one, but 3 is the root's"
    );
    let layout = Layout::new([257; 3], DVec3::ONE, Kind::Decimated, 12).expect("a valid layout");
    assert_eq!(layout.num_levels(), 6);
    assert_eq!(layout.resolutions(Node::new(1, [0; 3])), 0..=3, "12 cells are halved twice");
    assert_eq!(layout.resolutions(layout.root()), 0..=5);
}

#[test]
#[should_panic(expected = "node (0, 0, 0) of level 0 at level 3, expected 0..=2")]
fn a_resolution_that_does_not_fit_the_node_is_refused() {
    let layout = Layout::new([257; 3], DVec3::ONE, Kind::Decimated, 12).expect("a valid layout");
    layout.block_shape(Node::new(0, [0; 3]), 3);
}

/// A block has the samples around every point of its closed node (those past the level's ends repeat the last), and
/// not a layer more.
#[test]
fn a_block_encloses_its_node_tightly() {
    let mut num_blocks = 0;
    for dims in DIMS {
        for kind in KINDS {
            for brick_cells in [2, 4, 12] {
                let layout = Layout::new(dims, DVec3::ONE, kind, brick_cells).expect("a valid layout");
                for node in (0..layout.num_levels()).flat_map(|level| layout.level_nodes(level)) {
                    for resolution in layout.resolutions(node) {
                        let shape = layout.block_shape(node, resolution);
                        let [low, high] = layout.bounds(node);
                        let step = f64::from(1 << resolution);
                        for axis in 0..3 {
                            let last = shape.first[axis] + shape.count[axis] as i64 - 1;
                            let [first, last] =
                                [shape.first[axis], last].map(|i| layout.sample_position(resolution, i));
                            assert!(first <= low[axis] && high[axis] <= last, "{dims:?} {kind:?} {node}");
                            // One past the node on each side; the domain's clip takes half a sample more.
                            assert!(low[axis] - first <= step && last - high[axis] < 2.0 * step, "{node}");
                        }
                        num_blocks += 1;
                    }
                }
            }
        }
    }
    println!("{num_blocks} blocks");
    assert!(num_blocks > 1000);
}

fn samples(dims: [usize; 3], value: impl Fn([usize; 3]) -> u8) -> Vec<u8> {
    (0..dims.iter().product())
        .map(|i: usize| value([i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]]))
        .collect()
}

/// Checks the errors of all nodes at all resolutions, and says in how many of the coarser cases the bound is exact.
fn check(dims: [usize; 3], kind: Kind, values: impl Into<Samples>) -> [usize; 2] {
    let grid = VoxelGrid::new(dims, DVec3::ONE, values).expect("a valid grid");
    let pyramid = Pyramid::build(&grid, kind, 4).expect("a valid layout");
    let layout = pyramid.layout();
    let levels = Levels::new(kind, dims, grid.samples(), 0, layout.num_levels());
    let mut counts = [0; 2];
    for node in (0..layout.num_levels()).flat_map(|level| layout.level_nodes(level)) {
        for resolution in layout.resolutions(node) {
            let found = held_error(&pyramid, node, resolution, 0);
            let expected = error_at(&levels, layout, node, resolution);
            if resolution <= node.level {
                assert_eq!(found, expected, "{dims:?} {kind:?} {node} at {resolution}");
            } else {
                assert!(found >= expected, "{dims:?} {kind:?} {node} at {resolution}: {found} < {expected}");
                counts[usize::from(found == expected)] += 1;
            }
        }
    }
    counts
}

#[test]
fn errors_are_exact_to_the_nodes_level_and_bounds_beyond() {
    for dims in [[13, 11, 7], [17, 17, 17], [1, 1, 37], [33, 9, 5]] {
        for kind in KINDS {
            let noise = samples(dims, |[x, y, z]| (x * 67 + y * 31 + z * 101 + x * y * z * 13) as u8);
            let [above, exact] = check(dims, kind, noise);
            println!("{dims:?} {kind:?}: of the coarser ones {above} bounds above the error, {exact} equal");
        }
    }
}

/// Criterion (i): a node of equal samples is exact at the coarsest resolution, whatever is beside it; and criterion
/// (ii): so is one whose inner samples interpolate from its corners.
#[test]
fn homogeneous_nodes_are_exact_at_every_resolution() {
    let dims = [33, 17, 17];
    let equal_then_noise = samples(dims, |[x, y, z]| if x <= 16 { 7 } else { (x * y * z * 31) as u8 });
    let ramp = samples(dims, |[x, y, z]| (2 * x + 3 * y + z) as u8);
    let cases = [(equal_then_noise, Node::new(2, [0; 3])), (ramp, Node::new(3, [0; 3]))];
    for (values, node) in cases {
        // The averaged kind's blocks look beyond their nodes, and are no such thing.
        for kind in KINDS {
            check(dims, kind, values.clone());
        }
        let grid = VoxelGrid::new(dims, DVec3::ONE, values).expect("a valid grid");
        let pyramid = Pyramid::build(&grid, Kind::Decimated, 4).expect("a valid layout");
        let resolutions = pyramid.layout().resolutions(node);
        assert_eq!(resolutions, 0..=3);
        for resolution in resolutions {
            assert_eq!(held_error(&pyramid, node, resolution, 0), 0.0, "{node} at {resolution}");
        }
    }
}

/// What is blank makes every coarse resolution of the nodes around it infinitely wrong, and no finest one.
#[test]
fn blank_samples_are_infinitely_wrong_when_held_coarser() {
    let dims = [17, 9, 9];
    let mut values: Vec<f32> = vec![1.0; 17 * 9 * 9];
    values[(4 * 9 + 4) * 17 + 4] = f32::NAN;
    let grid = VoxelGrid::new(dims, DVec3::ONE, values).expect("a valid grid");
    let pyramid = Pyramid::build(&grid, Kind::Decimated, 4).expect("a valid layout");
    let near = Node::new(0, [0; 3]);
    assert_eq!([0, 1, 2].map(|q| held_error(&pyramid, near, q, 0)), [0.0, f64::INFINITY, f64::INFINITY]);
    let root = pyramid.layout().root();
    assert_eq!([0, 1, 2].map(|q| held_error(&pyramid, root, q, 0)), [0.0, f64::INFINITY, f64::INFINITY]);
    let far = Node::new(1, [1, 0, 0]);
    assert_eq!([0, 1].map(|q| held_error(&pyramid, far, q, 0)), [0.0, 0.0]);
}
