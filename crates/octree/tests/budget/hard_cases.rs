//! Budgets and prices that are strange.

use volery_octree::{BudgetTooSmall, Held, Price, Tradeoff, Uncovered};
use volery_pyramid::{Kind, Layout, Node};

use crate::world::{DIMS, KINDS, Noise};
use crate::{Prices, arbitrary, check, every_choice, like_a_volume, tradeoff, tree};

/// A volume in which every finer resolution is better, everywhere.
fn strict(layout: &Layout) -> Prices {
    let price = |(node, resolution): (Node, u32)| {
        let texels = layout.block_shape(node, resolution).num_samples() as u64;
        let owned: usize = layout.owned(node).map(|range| range.len()).iter().product();
        Price { bytes: texels, error: owned as f64 * f64::from(1 << resolution) }
    };
    every_choice(layout).map(|choice| (choice, price(choice))).collect()
}

#[test]
fn a_budget_below_the_smallest_cut_is_refused_with_both_numbers() {
    let layout = tree([9; 3]);
    let tradeoff = tradeoff(&layout, &strict(&layout));
    let min_bytes = tradeoff.min_bytes();
    // The root at its coarsest: 2^3 cells of level 2 are 3^3 samples.
    assert_eq!(min_bytes, 27);
    for max_bytes in [0, 26] {
        assert_eq!(tradeoff.cut(max_bytes), Err(BudgetTooSmall { max_bytes, min_bytes }));
    }
    let line = tradeoff.cut(26).unwrap_err().to_string();
    assert_eq!(line, "a budget of 26 bytes, expected at least 27: the smallest cut takes that many");
    let root = Held { node: layout.root(), resolution: 2 };
    assert_eq!(tradeoff.cut(27).expect("enough").held, [root]);
}

#[test]
fn no_bytes_are_enough_for_what_takes_none() {
    let layout = tree([5; 3]);
    let tradeoff =
        Tradeoff::new(&layout, |_, _| Some(Price { bytes: 0, error: 0.0 })).expect("all is covered");
    let found = tradeoff.cut(0).expect("nothing is needed");
    assert_eq!((found.bytes, found.error, found.lower_bound), (0, 0.0, 0.0));
    assert_eq!(
        found.held,
        [Held { node: layout.root(), resolution: 1 }],
        "the fewest nodes, at the coarsest"
    );
}

#[test]
fn a_budget_above_everything_holds_the_finest() {
    for dims in DIMS {
        for kind in KINDS {
            let layout = crate::world::layout(dims, kind, 2);
            let prices = strict(&layout);
            let tradeoff = tradeoff(&layout, &prices);
            for max_bytes in [tradeoff.max_bytes(), u64::MAX] {
                let found = tradeoff.cut(max_bytes).expect("enough");
                check(&layout, &prices, &found, max_bytes);
                assert!(found.held.iter().all(|held| held.resolution == 0), "{dims:?} {kind:?}");
                assert_eq!(found.error, found.lower_bound);
            }
        }
    }
}

/// The paper's homogeneous nodes: what improves nothing is not bought.
#[test]
fn a_homogeneous_half_is_held_at_its_coarsest_whatever_the_budget() {
    let layout = tree([17, 9, 9]);
    let mut prices = strict(&layout);
    let is_homogeneous = |node: Node| node.level < 3 && node.ancestor(2).index[0] == 0;
    for (&(node, _), price) in prices.iter_mut().filter(|((node, _), _)| is_homogeneous(*node)) {
        assert!(node.level < 3);
        price.error = 0.0;
    }
    let found = tradeoff(&layout, &prices).cut(u64::MAX).expect("enough");
    let half = Node::new(2, [0; 3]);
    let inside: Vec<_> = found.held.iter().filter(|held| is_homogeneous(held.node)).collect();
    assert_eq!(inside, [&Held { node: half, resolution: 3 }]);
    assert!(found.held.iter().all(|held| is_homogeneous(held.node) || held.resolution == 0));
}

#[test]
fn all_equal_data_are_the_root_at_its_coarsest() {
    let layout = tree([9; 3]);
    let mut prices = strict(&layout);
    for choice in every_choice(&layout) {
        prices.get_mut(&choice).expect("every choice has one").error = 0.0;
    }
    let found = tradeoff(&layout, &prices).cut(u64::MAX).expect("enough");
    assert_eq!(found.held, [Held { node: layout.root(), resolution: 2 }]);
}

/// Trees of equal nodes: every step has the same slope, and all budgets between are used but for less than one of them.
#[test]
fn equal_nodes_fill_the_budget() {
    let layout = tree([17; 3]);
    let price = |node: Node, resolution: u32| {
        let finest = 1u64 << (3 * node.level);
        let is_usual = resolution == node.level;
        is_usual.then(|| Price { bytes: 100, error: (finest * finest * 4096) as f64 })
    };
    let tradeoff = Tradeoff::new(&layout, price).expect("all is covered");
    for max_bytes in (100..=51_200).step_by(100) {
        let found = tradeoff.cut(max_bytes).expect("enough");
        assert!(max_bytes - found.bytes < 700, "{} of {max_bytes} bytes", found.bytes);
        assert!((found.error - found.lower_bound) <= 0.05 * found.error, "{found:?}");
    }
}

/// NaN and infinity are unknown, which is worse than anything that is known, and less of it is better.
#[test]
fn of_unknown_errors_the_least_part_of_the_domain_is_taken() {
    for unknown in [f64::NAN, f64::INFINITY] {
        let layout = tree([9; 3]);
        let blank = Node::new(0, [3, 0, 1]);
        let mut prices = strict(&layout);
        // As of pyramids with one blank sample: only the finest field is right around it.
        for (&(node, resolution), price) in &mut prices {
            if blank.ancestor(node.level) == node && resolution > 0 {
                price.error = unknown;
            }
        }
        let tradeoff = tradeoff(&layout, &prices);
        let mut last = f64::INFINITY;
        let mut first_known = None;
        for max_bytes in tradeoff.min_bytes()..=tradeoff.max_bytes() {
            let found = tradeoff.cut(max_bytes).expect("enough");
            assert!(found.error <= last, "{max_bytes}: {} after {last}", found.error);
            last = found.error;
            if found.error.is_finite() && first_known.is_none() {
                first_known = Some((max_bytes, found.held));
            }
        }
        // Seven siblings at each of two levels, at eight samples each, and the one node at 27.
        let (bytes, held) = first_known.expect("the finest is known");
        assert_eq!(bytes, 14 * 8 + 27);
        assert!(held.contains(&Held { node: blank, resolution: 0 }));
    }
}

/// Two nodes that no resolution makes known, in opposite corners: all else is known all the same, though one node that
/// is unknown as a whole would be fewer of them.
#[test]
fn what_stays_unknown_does_not_keep_the_rest_coarse() {
    let layout = tree([9; 3]);
    let blanks = [Node::new(0, [0; 3]), Node::new(0, [3; 3])];
    let mut prices = strict(&layout);
    for (&(node, _), price) in &mut prices {
        if blanks.iter().any(|blank| blank.ancestor(node.level) == node) {
            price.error = f64::INFINITY;
        }
    }
    let found = tradeoff(&layout, &prices).cut(u64::MAX).expect("enough");
    let unknown =
        found.held.iter().filter(|held| prices[&(held.node, held.resolution)].error == f64::INFINITY);
    let unknown: Vec<Node> = unknown.map(|held| held.node).collect();
    assert_eq!(unknown, blanks);
    assert!(found.held.iter().all(|held| held.resolution == 0 || blanks.contains(&held.node)));
    assert_eq!(found.error, f64::INFINITY);
}

#[test]
fn where_all_is_unknown_the_smallest_cut_is_as_good_as_any() {
    let layout = tree([9; 3]);
    let mut prices = strict(&layout);
    for choice in every_choice(&layout) {
        prices.get_mut(&choice).expect("every choice has one").error = f64::NAN;
    }
    let found = tradeoff(&layout, &prices).cut(u64::MAX).expect("enough");
    assert_eq!(found.held, [Held { node: layout.root(), resolution: 2 }]);
    assert_eq!((found.error, found.lower_bound), (f64::INFINITY, f64::INFINITY));
}

#[test]
fn negative_errors_are_none() {
    let layout = tree([5; 3]);
    let mut noise = Noise(5);
    let negative = |prices: &Prices, value: f64| -> Prices {
        let change =
            |price: &Price| if price.error < 300.0 { Price { error: value, ..*price } } else { *price };
        prices.iter().map(|(&choice, price)| (choice, change(price))).collect()
    };
    let prices = arbitrary(&layout, &mut noise);
    let zero = tradeoff(&layout, &negative(&prices, 0.0));
    for value in [-0.0, -1e300, f64::NEG_INFINITY] {
        let below = tradeoff(&layout, &negative(&prices, value));
        for max_bytes in zero.min_bytes()..=zero.max_bytes() {
            assert_eq!(below.cut(max_bytes), zero.cut(max_bytes));
        }
    }
}

#[test]
fn errors_at_the_ends_of_numbers_neither_overflow_nor_vanish() {
    let layout = tree([9; 3]);
    let mut noise = Noise(6);
    let mut prices = like_a_volume(&layout, &mut noise);
    for (at, price) in prices.values_mut().enumerate() {
        price.error = [f64::MAX, f64::MIN_POSITIVE, 5e-324, 1.0][at % 4];
    }
    let tradeoff = tradeoff(&layout, &prices);
    let mut last = f64::INFINITY;
    for max_bytes in (tradeoff.min_bytes()..=tradeoff.max_bytes()).step_by(13) {
        let found = tradeoff.cut(max_bytes).expect("enough");
        assert!(found.error <= last && !found.error.is_nan());
        last = found.error;
    }
    let tiny = Tradeoff::new(&layout, |node, resolution| {
        Some(Price { bytes: prices[&(node, resolution)].bytes, error: f64::from(1 + resolution) * 5e-324 })
    });
    let tiny = tiny.expect("all is covered");
    let finest = tiny.cut(u64::MAX).expect("enough");
    assert!(finest.held.iter().all(|held| held.resolution == 0) && finest.error > 0.0);
}

/// Beside the largest of errors the smallest is not none.
#[test]
fn a_vanishing_error_is_an_error() {
    let layout = tree([5, 3, 3]);
    let price = |node: Node, resolution: u32| {
        let error = if node == Node::new(0, [0; 3]) { 5e-324 } else { 1e308 };
        let is_leaf = node.level == 0;
        is_leaf.then(|| Price { bytes: 2 - u64::from(resolution), error: error * f64::from(resolution) })
    };
    let found = Tradeoff::new(&layout, price).expect("all is covered").cut(u64::MAX).expect("enough");
    assert!(found.held.iter().all(|held| held.resolution == 0), "{found:?}");
    assert_eq!(found.error, 0.0);
}

#[test]
fn a_part_that_nothing_holds_is_named() {
    let layout = tree([9; 3]);
    let missing = Node::new(0, [2, 3, 1]);
    let prices = strict(&layout);
    let covers = |node: Node| missing.ancestor(node.level) == node;
    let without = |node: Node, resolution: u32| (!covers(node)).then(|| prices[&(node, resolution)]);
    let error = Tradeoff::new(&layout, without).expect_err("a part is missing");
    assert_eq!(error, Uncovered { node: missing });
    let line = "node (2, 3, 1) of level 0 has a price at no resolution, nor has a node around it; expected one at least";
    assert_eq!(error.to_string(), line);
    // Where a coarser node has a price, it stands in, whatever the budget.
    let parent = missing.parent();
    let coarse =
        |node: Node, resolution: u32| (!covers(node) || node == parent).then(|| prices[&(node, resolution)]);
    let found = Tradeoff::new(&layout, coarse).expect("all is covered").cut(u64::MAX).expect("enough");
    assert!(found.held.contains(&Held { node: parent, resolution: 0 }));
}

#[test]
fn bytes_beyond_all_memory_are_as_good_as_no_price() {
    let layout = tree([9; 3]);
    let prices = strict(&layout);
    let huge = |node: Node, resolution: u32| {
        let price = prices[&(node, resolution)];
        Some(if resolution == 0 { Price { bytes: u64::MAX, ..price } } else { price })
    };
    let found = Tradeoff::new(&layout, huge).expect("all is covered").cut(u64::MAX).expect("enough");
    assert!(found.held.iter().all(|held| held.resolution == 1));
    let root = layout.root();
    let none =
        Tradeoff::new(&layout, |node, _| (node == root).then_some(Price { bytes: u64::MAX, error: 0.0 }));
    assert_eq!(none.expect_err("nothing fits"), Uncovered { node: Node::new(0, [0; 3]) });
}

#[test]
fn a_tree_of_one_node_has_its_resolutions_only() {
    let layout = Layout::new([2, 1, 1], glam::DVec3::ONE, Kind::Averaged, 8).expect("a valid layout");
    let tradeoff = tradeoff(&layout, &strict(&layout));
    assert_eq!(tradeoff.cut(u64::MAX).expect("enough").held, [Held { node: layout.root(), resolution: 0 }]);
    assert_eq!(tradeoff.min_bytes(), tradeoff.max_bytes());
}
