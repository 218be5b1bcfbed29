//! Layouts and bricks: where things lie, and that a brick is enough.

use glam::DVec3;
use volery_pyramid::layout::Error;
use volery_pyramid::{Brick, Kind, Layout, Node, NodeSource, NodeStats, Pyramid};
use volery_scene::{Samples, VoxelGrid};

use crate::oracle;

const KINDS: [Kind; 2] = [Kind::Decimated, Kind::Averaged];
const DIMS: [[usize; 3]; 7] =
    [[1, 1, 1], [2, 1, 3], [1, 1, 37], [13, 11, 7], [16, 16, 16], [33, 2, 5], [17, 9, 1]];

fn layout(dims: [usize; 3], kind: Kind, brick_cells: usize) -> Layout {
    Layout::new(dims, DVec3::new(1.0, 1.0, 10.0), kind, brick_cells).expect("a valid layout")
}

/// LaMar's Table 1. Its Mandrill has 18^2 nodes, which cover 253 of 256 samples; all of it takes 19^2.
#[test]
fn node_counts_of_lamar() {
    assert_eq!(layout([500, 500, 250], Kind::Decimated, 30).num_nodes(0), 2601);
    assert_eq!(layout([256, 256, 1], Kind::Decimated, 14).num_nodes(0), 361);
    assert_eq!(layout([253, 253, 1], Kind::Decimated, 14).num_nodes(0), 324);
}

#[test]
fn wrong_shapes_are_refused() {
    let new = |dims, brick_cells| Layout::new(dims, DVec3::ONE, Kind::Averaged, brick_cells);
    for found in [0, 1, 3, 31, 4098, usize::MAX] {
        assert_eq!(new([2; 3], found), Err(Error::BrickCells { found }));
    }
    assert_eq!(new([2, 0, 2], 2), Err(Error::Axis { axis: 1, found: 0 }));
    assert_eq!(new([2, 2, usize::MAX], 2), Err(Error::Axis { axis: 2, found: usize::MAX }));
    assert!(new([Layout::MAX_AXIS; 3], 2).is_ok());
}

#[test]
fn each_level_owns_every_sample_once_and_children_share_their_parent() {
    for dims in DIMS {
        for kind in KINDS {
            for brick_cells in [2, 4, 30] {
                let layout = layout(dims, kind, brick_cells);
                assert_eq!(layout.num_nodes(layout.num_levels() - 1), 1);
                for level in 0..layout.num_levels() {
                    let mut times = vec![0; dims.iter().product()];
                    for (i, node) in layout.level_nodes(level).enumerate() {
                        assert_eq!(layout.node_index(node), i);
                        let [xs, ys, zs] = layout.owned(node);
                        for z in zs {
                            for y in ys.clone() {
                                for x in xs.clone() {
                                    times[(z * dims[1] + y) * dims[0] + x] += 1;
                                }
                            }
                        }
                        let volume = |n| layout.owned(n).map(|r| r.len()).iter().product::<usize>();
                        let children: Vec<_> = layout.children(node).collect();
                        assert!(children.iter().all(|&c| c.parent() == node && layout.contains(c)));
                        let sum: usize = children.iter().map(|&c| volume(c)).sum();
                        assert_eq!(sum, if level == 0 { 0 } else { volume(node) });
                    }
                    assert!(times.iter().all(|&times| times == 1), "{dims:?} {kind:?} level {level}");
                }
            }
        }
    }
}

/// Trilinear interpolation in a brick alone.
fn sample(brick: &Brick, at: DVec3) -> f64 {
    let mut sum = 0.0;
    for octant in 0..8 {
        let (mut weight, mut index) = (1.0, [0; 3]);
        for a in 0..3 {
            let upper = octant >> a & 1 == 1;
            weight *= if upper { at[a].fract() } else { 1.0 - at[a].fract() };
            index[a] = at[a] as usize + usize::from(upper);
        }
        if weight > 0.0 {
            sum += weight * brick.samples.value(brick.shape.index(index), 0);
        }
    }
    sum
}

/// Inside a node's closed bounds its brick gives the field of its level, without any other brick. So at
/// shared bounds neighbours agree.
#[test]
fn a_brick_is_enough_for_its_node() {
    for dims in DIMS {
        for kind in KINDS {
            for brick_cells in [2, 4, 30] {
                let values: Vec<f32> = (0..dims.iter().product()).map(|i| (i * i % 251) as f32).collect();
                let grid = VoxelGrid::new(dims, DVec3::ONE, values).unwrap();
                let pyramid = Pyramid::build(&grid, kind, brick_cells).unwrap();
                let layout = pyramid.layout();
                let levels = oracle::Levels::new(kind, dims, grid.samples(), 0, layout.num_levels());
                let mut brick = Brick::empty(pyramid.sample_type());
                for level in 0..layout.num_levels() {
                    let step = 2f64.powi(level as i32);
                    for node in layout.level_nodes(level) {
                        pyramid.read_brick(node, &mut brick).unwrap();
                        assert_eq!(brick.samples.len(), brick.shape.num_samples());
                        assert!(brick.shape.count.iter().all(|&n| n <= brick_cells + 2));
                        let [low, high] = layout.bounds(node);
                        for place in 0..125 {
                            let share = |a: u32| f64::from(place / 5i32.pow(a) % 5) / 4.0;
                            let at = low + (high - low) * DVec3::new(share(0), share(1), share(2));
                            let first = brick.shape.first.map(|i| layout.sample_position(level, i));
                            let found = sample(&brick, (at - DVec3::from_array(first)) / step);
                            let expected = levels.field_at(level, at);
                            assert!((found - expected).abs() < 1e-10, "{dims:?} {kind:?} {node} at {at}");
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn a_brick_takes_on_the_type_of_its_source() {
    let volumes: [Samples; 3] =
        [vec![[1u8, 2, 3]; 27].into(), vec![7i16; 27].into(), vec![0.5f64; 27].into()];
    let mut brick = Brick::empty(volery_scene::SampleType::U8);
    for samples in volumes {
        let sample_type = samples.sample_type();
        let grid = VoxelGrid::new([3; 3], DVec3::ONE, samples).unwrap();
        let pyramid = Pyramid::build(&grid, Kind::Averaged, 2).unwrap();
        pyramid.read_brick(pyramid.layout().root(), &mut brick).unwrap();
        assert_eq!(brick.samples.sample_type(), sample_type);
        assert_eq!(brick.samples.value(0, 0), grid.samples().value(0, 0));
        assert!(!brick.samples.is_empty() && pyramid.is_at_hand(pyramid.layout().root()));
    }
    assert!(Brick::empty(volery_scene::SampleType::F64).samples.is_empty());
}

#[test]
fn coarser_levels_take_a_seventh() {
    let grid = VoxelGrid::new([128; 3], DVec3::ONE, vec![0u8; 128 * 128 * 128]).unwrap();
    for kind in KINDS {
        let share = Pyramid::build(&grid, kind, 32).unwrap().extra_bytes() as f64 / 128f64.powi(3);
        println!("{kind:?}: {share:.4} of the samples, expected 1/7 and a few percent of it");
        assert!((0.142..0.152).contains(&share), "{share}");
    }
}

#[test]
fn extra_bytes_are_those_of_coarser_samples_and_of_statistics() {
    let volumes: [Samples; 2] = [vec![0u16; 9 * 6 * 5].into(), vec![[0u8; 3]; 9 * 6 * 5].into()];
    for samples in volumes {
        let sample_type = samples.sample_type();
        let grid = VoxelGrid::new([9, 6, 5], DVec3::ONE, samples).unwrap();
        for kind in KINDS {
            let pyramid = Pyramid::build(&grid, kind, 2).unwrap();
            let layout = pyramid.layout();
            let samples = |level| layout.level_dims(level).iter().product::<usize>() * sample_type.bytes();
            let stats = |level| layout.num_nodes(level) * sample_type.channels() * size_of::<NodeStats>();
            let levels = layout.num_levels();
            let expected = (1..levels).map(samples).sum::<usize>() + (0..levels).map(stats).sum::<usize>();
            assert_eq!(pyramid.extra_bytes(), expected, "{sample_type} {kind:?}");
        }
    }
}

/// Trilinear interpolation at a point reads the samples less than 1 away from it along each axis.
#[test]
fn the_support_of_a_node_is_every_sample_that_its_field_reads() {
    for dims in DIMS {
        for kind in KINDS {
            let layout = layout(dims, kind, 4);
            assert_eq!(layout.domain(), DVec3::from_array(dims.map(|n| n as f64 - 1.0)));
            for node in (0..layout.num_levels()).flat_map(|level| layout.level_nodes(level)) {
                let [low, high] = layout.bounds(node);
                let stretched = [low, high].map(|p| DVec3::new(p.x, p.y, 10.0 * p.z));
                assert_eq!(layout.world_bounds(node), stretched);
                let reads = |a: usize| low[a].floor() as usize..high[a].ceil() as usize + 1;
                assert_eq!(layout.support(node), [0, 1, 2].map(reads), "{dims:?} {kind:?} {node}");
            }
        }
    }
}

#[test]
fn ancestors_cover_their_descendants() {
    let node = Node::new(1, [5, 2, 9]);
    assert_eq!(node.ancestor(1), node);
    assert_eq!(node.ancestor(2), node.parent());
    assert_eq!(node.ancestor(4), node.parent().parent().parent());
    assert_eq!(node.ancestor(40), Node::new(40, [0; 3]));
    assert_eq!(node.to_string(), "node (5, 2, 9) of level 1");
}
