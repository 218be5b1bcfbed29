//! 2:1 balance against slow independent oracles: refinement to a fixpoint by pairwise touching tests, a
//! certificate of minimality for trees too large for it, and the leaf counts of p4est.

mod world;

use std::collections::HashSet;

use glam::DVec3;
use rayon::ThreadPoolBuilder;
use volery_octree::balance::{Defect, Leaf, balance_leaves, defects, leaf_defects};
use volery_octree::{Cut, balance, validate};
use volery_pyramid::{Kind, Node};
use world::{DIMS, KINDS, Noise, layout, random_cut};

/// Nodes of a level along each axis of a box of `extent` finest ones.
fn nodes<const D: usize>(extent: [u32; D], level: u32) -> [u64; D] {
    extent.map(|n| u64::from(n).div_ceil(1 << level))
}

/// The coarsest level, with one node.
fn root<const D: usize>(extent: [u32; D]) -> Leaf<D> {
    let level = (0..).find(|&level| nodes(extent, level) == [1; D]).expect("a level with one node");
    Leaf::new(level, [0; D])
}

/// The children that lie in the box, x fastest.
fn children<const D: usize>(extent: [u32; D], node: Leaf<D>) -> impl Iterator<Item = Leaf<D>> {
    (0..1_u32 << D).filter_map(move |octant| {
        let index = std::array::from_fn(|axis| 2 * node.index[axis] + (octant >> axis & 1));
        let nodes = nodes(extent, node.level - 1);
        (0..D).all(|axis| u64::from(index[axis]) < nodes[axis]).then(|| Leaf::new(node.level - 1, index))
    })
}

/// Whether the closed boxes of two nodes meet.
fn touch<const D: usize>(a: Leaf<D>, b: Leaf<D>) -> bool {
    let low = |n: Leaf<D>, axis: usize| u64::from(n.index[axis]) << n.level;
    let high = |n: Leaf<D>, axis: usize| (u64::from(n.index[axis]) + 1) << n.level;
    (0..D).all(|axis| low(a, axis) <= high(b, axis) && low(b, axis) <= high(a, axis))
}

/// The oracle: refines, until nothing changes, every leaf that touches one two or more levels finer.
/// Each such refinement is forced, so the result is the coarsest.
fn balanced_by_pairs<const D: usize>(extent: [u32; D], leaves: &[Leaf<D>]) -> Vec<Leaf<D>> {
    let mut leaves = leaves.to_vec();
    loop {
        let finest = leaves.iter().map(|leaf| leaf.level).min().unwrap_or(0);
        let is_forced = |&a: &Leaf<D>| {
            a.level >= finest + 2 && leaves.iter().any(|&b| b.level + 2 <= a.level && touch(a, b))
        };
        let forced: Vec<bool> = leaves.iter().map(is_forced).collect();
        if !forced.contains(&true) {
            return leaves;
        }
        let refined = leaves.iter().zip(forced).flat_map(|(&leaf, is_forced)| match is_forced {
            true => children(extent, leaf).collect(),
            false => vec![leaf],
        });
        leaves = refined.collect();
    }
}

/// All trees under a node, as lists of leaves in canonical order.
fn all_trees<const D: usize>(extent: [u32; D], node: Leaf<D>) -> Vec<Vec<Leaf<D>>> {
    let mut trees = vec![vec![node]];
    if node.level > 0 {
        let mut refined = vec![Vec::new()];
        for child in children(extent, node) {
            let below = all_trees(extent, child);
            let join = |head: &Vec<Leaf<D>>, tail: &Vec<Leaf<D>>| [&head[..], tail].concat();
            refined =
                refined.iter().flat_map(|head| below.iter().map(move |tail| join(head, tail))).collect();
        }
        trees.append(&mut refined);
    }
    trees
}

/// A random tree that is refined with a probability that `depth` raises, in canonical order.
fn random_tree<const D: usize>(extent: [u32; D], refine: f64, seed: u64) -> Vec<Leaf<D>> {
    fn grow<const D: usize>(
        extent: [u32; D],
        node: Leaf<D>,
        refine: f64,
        noise: &mut Noise,
        leaves: &mut Vec<Leaf<D>>,
    ) {
        if node.level == 0 || noise.unit() >= refine {
            leaves.push(node);
            return;
        }
        for child in children(extent, node) {
            grow(extent, child, refine, noise, leaves);
        }
    }
    let (mut noise, mut leaves) = (Noise(seed), Vec::new());
    let root = root(extent);
    if root.level == 0 {
        return vec![root];
    }
    // The root is always refined: else most trees would be nothing but it.
    for child in children(extent, root) {
        grow(extent, child, refine, &mut noise, &mut leaves);
    }
    leaves
}

/// The tree refined down to level 0 at the finest nodes `points` only.
fn tree_at<const D: usize>(extent: [u32; D], points: &[[u32; D]]) -> Vec<Leaf<D>> {
    fn grow<const D: usize>(extent: [u32; D], node: Leaf<D>, points: &[[u32; D]], leaves: &mut Vec<Leaf<D>>) {
        let here: Vec<_> =
            points.iter().copied().filter(|p| p.map(|i| i >> node.level) == node.index).collect();
        if node.level == 0 || here.is_empty() {
            leaves.push(node);
            return;
        }
        children(extent, node).for_each(|child| grow(extent, child, &here, leaves));
    }
    let mut leaves = Vec::new();
    grow(extent, root(extent), points, &mut leaves);
    leaves
}

/// The tree of the figures of p4est: the unit cube, refined near a plane down to `levels` below the root.
fn refined_near_plane(levels: u32) -> Vec<Leaf<3>> {
    fn grow(levels: u32, node: Leaf<3>, leaves: &mut Vec<Leaf<3>>) {
        let h = 0.5_f64.powi((levels - node.level) as i32);
        let [x, y, z] = node.index.map(|i| (f64::from(i) + 0.5) * h);
        let d = 0.3 * (x - 0.31) + 0.5 * (y - 0.47) + 0.81 * (z - 0.63);
        if node.level == 0 || d * d >= 0.25 * h * h {
            leaves.push(node);
            return;
        }
        children([1 << levels; 3], node).for_each(|child| grow(levels, child, leaves));
    }
    let mut leaves = Vec::new();
    grow(levels, Leaf::new(levels, [0; 3]), &mut leaves);
    leaves
}

fn shuffled<T: Clone>(list: &[T], seed: u64) -> Vec<T> {
    let (mut list, mut noise) = (list.to_vec(), Noise(seed));
    for i in (1..list.len()).rev() {
        list.swap(i, (noise.unit() * (i + 1) as f64) as usize);
    }
    list
}

/// The nodes that a tree refines.
fn internal<const D: usize>(leaves: &[Leaf<D>], root: Leaf<D>) -> HashSet<Leaf<D>> {
    let mut internal = HashSet::new();
    for leaf in leaves {
        let mut node = *leaf;
        while node.level < root.level {
            node = Leaf::new(node.level + 1, node.index.map(|i| i / 2));
            if !internal.insert(node) {
                break;
            }
        }
    }
    internal
}

/// Checks that `after` is the coarsest balanced refinement of `before`, in time linear in the leaves.
///
/// Balanced and a refinement it must be. If one that is coarser existed, take a finest node `n` that `after`
/// refines and it does not: its children are leaves of `after`, and taking it back would leave the tree
/// balanced. So it is enough that every added node has leaves for children only if one of them touches a
/// refined node of its own level, whose children are two levels finer than `n`.
fn assert_minimal<const D: usize>(extent: [u32; D], before: &[Leaf<D>], after: &[Leaf<D>]) {
    assert_eq!(leaf_defects(after), []);
    assert!(after.is_sorted_by(|&a, &b| a.canonical_order(b).is_lt()), "sorted, none twice");
    let root = root(extent);
    let (old, new) = (internal(before, root), internal(after, root));
    assert!(old.is_subset(&new), "a refinement");
    let cells = |leaves: &[Leaf<D>]| -> u128 {
        let count = |leaf: &Leaf<D>| -> u128 {
            let end =
                |axis: usize| ((u64::from(leaf.index[axis]) + 1) << leaf.level).min(extent[axis].into());
            (0..D).map(|axis| u128::from(end(axis) - (u64::from(leaf.index[axis]) << leaf.level))).product()
        };
        leaves.iter().map(count).sum()
    };
    assert_eq!(cells(after), extent.iter().map(|&n| u128::from(n)).product(), "covers the box once");
    for &node in new.difference(&old) {
        let is_forced = children(extent, node).any(|child| {
            new.contains(&child)
                || (0..3_u32.pow(D as u32)).any(|direction| {
                    let step = |axis: usize| i64::from(direction / 3_u32.pow(axis as u32) % 3) - 1;
                    let index = std::array::from_fn(|axis| {
                        u32::try_from(i64::from(child.index[axis]) + step(axis)).unwrap_or(u32::MAX)
                    });
                    new.contains(&Leaf::new(child.level, index))
                })
        });
        assert!(is_forced, "{node} is refined without need");
    }
}

/// Balances all trees over a box and compares each with the oracle.
fn check_all_trees<const D: usize>(extent: [u32; D], num_trees: usize) {
    let trees = all_trees(extent, root(extent));
    assert_eq!(trees.len(), num_trees, "all trees over {extent:?}");
    let mut num_changed = 0;
    for tree in &trees {
        let balanced = balance_leaves(extent, tree);
        assert_eq!(balanced, balanced_by_pairs(extent, tree), "{extent:?} {tree:?}");
        num_changed += usize::from(balanced.len() > tree.len());
    }
    println!("{extent:?}: {num_trees} trees, {num_changed} of them not balanced before");
}

#[test]
fn all_trees_in_one_dimension() {
    for (extent, num_trees) in [(1, 1), (2, 2), (3, 5), (4, 5), (5, 16), (13, 417), (16, 677)] {
        check_all_trees([extent], num_trees);
    }
}

#[test]
fn all_quadtrees() {
    check_all_trees([1, 1], 1);
    check_all_trees([4, 4], 17);
    check_all_trees([8, 8], 83_522);
    // Not powers of two, one and two nodes thick.
    check_all_trees([5, 7], 7_226);
    check_all_trees([11, 3], 5_221);
    check_all_trees([1, 16], 677);
    check_all_trees([16, 2], 677);
    check_all_trees([16, 4], 84_101);
}

#[test]
fn all_octrees() {
    check_all_trees([4, 4, 4], 257);
    check_all_trees([8, 4, 4], 66_050);
    check_all_trees([8, 8, 2], 83_522);
    // Not powers of two, one and two nodes thick.
    check_all_trees([4, 5, 3], 4_370);
    check_all_trees([8, 8, 1], 83_522);
    check_all_trees([1, 1, 16], 677);
    check_all_trees([2, 16, 2], 677);
}

/// Trees of five levels and more, still small enough for the oracle.
#[test]
fn random_trees_equal_the_oracle() {
    let mut num_changed = 0;
    for seed in 0..60 {
        let refine = 0.3 + 0.005 * seed as f64;
        let tree = random_tree([200, 1, 77], refine, seed);
        assert_eq!(balance_leaves([200, 1, 77], &tree), balanced_by_pairs([200, 1, 77], &tree));
        let tree = random_tree([61, 64], refine, seed);
        assert_eq!(balance_leaves([61, 64], &tree), balanced_by_pairs([61, 64], &tree));
        let tree = random_tree([33, 17, 29], refine * 0.6, seed);
        let balanced = balance_leaves([33, 17, 29], &tree);
        assert_eq!(balanced, balanced_by_pairs([33, 17, 29], &tree));
        num_changed += usize::from(balanced.len() > tree.len());
    }
    println!("{num_changed} of 60 octrees were not balanced");
    assert!(num_changed >= 20, "{num_changed}, expected 20 or more");
}

/// One finest node in a tree as deep as there is, at corners, in the middle and anywhere.
#[test]
fn deepest_trees_equal_the_oracle() {
    let middle = 1 << 30;
    for point in [[0; 3], [u32::MAX >> 1; 3], [middle; 3], [middle - 1, middle, 7], [middle / 3, 99, 1 << 29]]
    {
        let extent = [1 << 31; 3];
        let tree = tree_at(extent, &[point]);
        assert_eq!(tree.len(), 1 + 31 * 7);
        let balanced = balance_leaves(extent, &tree);
        assert_eq!(balanced, balanced_by_pairs(extent, &tree), "{point:?}");
        assert_minimal(extent, &tree, &balanced);
    }
    let extent = [(1 << 31) - 5, 1 << 20];
    let tree = tree_at(extent, &[[(1 << 31) - 6, 0], [middle - 1, 1 << 19], [middle, 77]]);
    assert_eq!(balance_leaves(extent, &tree), balanced_by_pairs(extent, &tree));
}

#[test]
fn large_random_trees_are_minimal() {
    for (seed, refine) in [(1, 0.35), (2, 0.4), (3, 0.45), (4, 0.5)] {
        let extent = [1 << 9, 300, 411];
        let tree = random_tree(extent, refine, seed);
        let balanced = balance_leaves(extent, &tree);
        println!("octree: {} leaves to {}", tree.len(), balanced.len());
        assert_minimal(extent, &tree, &balanced);
        let extent = [5000, 1 << 13];
        let tree = random_tree(extent, refine + 0.2, seed);
        let balanced = balance_leaves(extent, &tree);
        println!("quadtree: {} leaves to {}", tree.len(), balanced.len());
        assert_minimal(extent, &tree, &balanced);
    }
}

/// Fine nodes far apart, so that almost every block of the sets holds one node alone.
#[test]
fn scattered_deep_points_are_minimal() {
    let mut noise = Noise(5);
    let extent = [1 << 26, 1 << 26, 1_000_000];
    let end = DVec3::from(extent.map(f64::from));
    let points: Vec<_> =
        (0..60).map(|_| noise.point(DVec3::ZERO, end).to_array().map(|x| x as u32)).collect();
    let tree = tree_at(extent, &points);
    let balanced = balance_leaves(extent, &tree);
    println!("{} leaves to {}", tree.len(), balanced.len());
    assert_minimal(extent, &tree, &balanced);
}

#[test]
fn leaf_counts_of_p4est() {
    for (levels, before, after) in
        [(6, 9_752, 15_618), (7, 36_464, 61_216), (8, 137_110, 236_265), (9, 514_998, 900_313)]
    {
        let tree = refined_near_plane(levels);
        let balanced = balance_leaves([1 << levels; 3], &tree);
        println!("L = {levels}: {} to {}, expected {before} to {after}", tree.len(), balanced.len());
        assert_eq!((tree.len(), balanced.len()), (before, after));
        if levels < 9 {
            assert_minimal([1 << levels; 3], &tree, &balanced);
        }
    }
}

#[test]
fn balance_is_idempotent_and_ignores_order_and_threads() {
    let near_plane = ([1 << 8; 3], refined_near_plane(8));
    let random = ([300, 257, 100], random_tree([300, 257, 100], 0.4, 9));
    for (extent, tree) in [near_plane, random] {
        let balanced = balance_leaves(extent, &tree);
        assert!(balanced.len() > tree.len());
        assert_eq!(balance_leaves(extent, &balanced), balanced, "idempotent");
        for threads in [1, 2, 7] {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            let shuffled = shuffled(&tree, threads as u64);
            assert!(pool.install(|| balance_leaves(extent, &tree)) == balanced, "{threads} threads");
            assert!(pool.install(|| balance_leaves(extent, &shuffled)) == balanced, "{threads}, shuffled");
        }
    }
}

/// Several trees side by side need no root above them, and the ripple goes from one into the next.
#[test]
fn forests_are_balanced_across_their_trees() {
    let extent = [24, 8];
    let mut forest = tree_at([8, 8], &[[7, 0]]);
    forest.extend([Leaf::new(3, [1, 0]), Leaf::new(3, [2, 0])]);
    let balanced = balance_leaves(extent, &forest);
    assert_eq!(balanced, balanced_by_pairs(extent, &forest));
    assert!(balanced.contains(&Leaf::new(1, [4, 0])) && balanced.contains(&Leaf::new(3, [2, 0])));
}

/// What is no tree at all is refined leaf by leaf all the same, and what lies outside stays as it is.
#[test]
fn leaves_that_are_no_tree() {
    let extent = [8, 8];
    assert_eq!(balance_leaves::<2>(extent, &[]), []);
    assert_eq!(balance_leaves([0, 0], &[Leaf::new(0, [0, 0])]), [Leaf::new(0, [0, 0])]);
    let strange = [
        Leaf::new(0, [8, 0]),
        Leaf::new(3, [1, 0]),
        Leaf::new(3, [u32::MAX, 0]),
        Leaf::new(31, [1, 1]),
        Leaf::new(32, [0, 0]),
        Leaf::new(u32::MAX, [u32::MAX; 2]),
    ];
    let mut kept = balance_leaves(extent, &strange);
    assert!(kept.iter().all(|leaf| strange.contains(leaf)));
    kept.dedup();
    assert_eq!(kept.len(), strange.len());
    // With a gap: the node in the corner, and only one far from it.
    let lone = Leaf::new(2, [1, 0]);
    let expected: Vec<_> = [[2, 0], [3, 0], [2, 1], [3, 1]].map(|index| Leaf::new(1, index)).into();
    assert_eq!(balance_leaves(extent, &[Leaf::new(0, [3, 0]), lone])[1..], expected);
    // One inside the other: both are refined, each for itself.
    let twice = balance_leaves(extent, &[Leaf::new(1, [0, 0]), Leaf::new(0, [0, 0])]);
    assert_eq!(twice.len(), 5);
}

#[test]
fn defects_are_the_touching_pairs() {
    for seed in 0..40 {
        let tree = random_tree([33, 40], 0.45, seed);
        let mut expected: Vec<_> = tree
            .iter()
            .flat_map(|&fine| tree.iter().map(move |&coarse| Defect { coarse, fine }))
            .filter(|pair| pair.fine.level + 2 <= pair.coarse.level && touch(pair.fine, pair.coarse))
            .collect();
        expected.sort_by(|a, b| a.fine.canonical_order(b.fine).then(a.coarse.canonical_order(b.coarse)));
        assert_eq!(leaf_defects(&shuffled(&tree, seed)), expected, "seed {seed}");
    }
    let pair = Defect { coarse: Node::new(2, [1, 0, 0]), fine: Node::new(0, [3, 0, 0]) };
    let cut = Cut { nodes: vec![pair.fine], skipped: vec![pair.coarse] };
    assert_eq!(defects(&cut), [pair]);
    assert_eq!(
        pair.to_string(),
        "node (1, 0, 0) of level 2 touches node (3, 0, 0) of level 0, expected at most one level between them"
    );
}

/// Cuts of pyramids of every shape: drawn and skipped nodes are balanced together, and stay what they are.
#[test]
fn cuts_keep_what_is_drawn_and_what_is_skipped() {
    let mut num_changed = 0;
    for dims in DIMS.into_iter().chain([[129, 65, 2], [100, 1, 300]]) {
        for kind in KINDS {
            for seed in 0..5 {
                let layout = layout(dims, kind, 2);
                let cut = random_cut(&layout, seed);
                let balanced = balance(&layout, &cut);
                assert_eq!(validate::defects(&layout, &balanced), [], "{dims:?}");
                assert_eq!(defects(&balanced), [], "{dims:?}");
                let leaves = |cut: &Cut| -> Vec<Leaf<3>> {
                    let mut leaves: Vec<_> =
                        cut.nodes.iter().chain(&cut.skipped).map(|&node| Leaf::from(node)).collect();
                    leaves.sort_by(|&a, &b| a.canonical_order(b));
                    leaves
                };
                assert_minimal(layout.nodes(0), &leaves(&cut), &leaves(&balanced));
                let is_inside = |node: Node, list: &[Node]| {
                    list.iter().any(|o| o.level >= node.level && node.ancestor(o.level) == *o)
                };
                assert!(balanced.nodes.iter().all(|&node| is_inside(node, &cut.nodes)));
                assert!(balanced.skipped.iter().all(|&node| is_inside(node, &cut.skipped)));
                let other_order =
                    Cut { nodes: shuffled(&cut.nodes, seed), skipped: shuffled(&cut.skipped, seed) };
                assert_eq!(balance(&layout, &other_order), balanced);
                num_changed += usize::from(balanced != cut);
            }
        }
    }
    println!("{num_changed} cuts were not balanced");
    assert!(num_changed > 20);
}

/// The tallest pyramid there is: a plane of nodes of two cells each.
#[test]
fn the_largest_layout_is_balanced() {
    let layout = layout([1 << 31, 1 << 31, 1], Kind::Averaged, 2);
    let tree = tree_at([1 << 30, 1 << 30, 1], &[[(1 << 29) - 1, (1 << 29) - 1, 0]]);
    let (skipped, drawn) = tree.iter().partition::<Vec<_>, _>(|leaf| leaf.level > 20);
    let as_nodes = |list: Vec<&Leaf<3>>| list.into_iter().map(|&leaf| Node::from(leaf)).collect();
    let balanced = balance(&layout, &Cut { nodes: as_nodes(drawn), skipped: as_nodes(skipped) });
    assert_eq!(validate::defects(&layout, &balanced), []);
    assert_eq!(
        balanced.nodes.len() + balanced.skipped.len(),
        balanced_by_pairs([1 << 30, 1 << 30, 1], &tree).len()
    );
}
