//! More memory never gives a larger error, and equal questions get equal answers.

use proptest::prelude::*;
use volery_octree::{Held, Tradeoff};

use crate::world::Noise;
use crate::{Prices, arbitrary, check, like_a_volume, tradeoff, tree};

fn prices(layout: &volery_pyramid::Layout, seed: u64) -> Prices {
    let mut noise = Noise(seed);
    if seed.is_multiple_of(2) { arbitrary(layout, &mut noise) } else { like_a_volume(layout, &mut noise) }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    /// Every budget from none to more than enough, byte by byte.
    #[test]
    fn every_byte_more_is_no_worse(seed: u64, dims in [2usize..10, 2usize..10, 2usize..6]) {
        let layout = tree(dims);
        let prices = prices(&layout, seed);
        let tradeoff = tradeoff(&layout, &prices);
        let mut last = f64::INFINITY;
        for max_bytes in tradeoff.min_bytes()..=tradeoff.max_bytes() + 1 {
            let found = tradeoff.cut(max_bytes).expect("large enough");
            check(&layout, &prices, &found, max_bytes);
            prop_assert!(found.error <= last, "{max_bytes} bytes: {} after {last}", found.error);
            last = found.error;
        }
    }

    /// Errors of any size side by side, where sums of `f64` would be rounded.
    #[test]
    fn errors_of_very_different_sizes_are_no_exception(seed: u64) {
        let layout = tree([9, 9, 5]);
        let mut noise = Noise(seed);
        let mut prices = arbitrary(&layout, &mut noise);
        for choice in crate::every_choice(&layout) {
            let price = prices.get_mut(&choice).expect("every choice has one");
            price.error = (noise.unit() * 80.0 - 40.0).exp();
        }
        let tradeoff = tradeoff(&layout, &prices);
        let mut last = f64::INFINITY;
        for max_bytes in tradeoff.min_bytes()..=tradeoff.max_bytes() {
            let found = tradeoff.cut(max_bytes).expect("large enough");
            prop_assert!(found.error <= last && found.lower_bound <= found.error);
            last = found.error;
        }
    }

    /// Two questions at once, in the other order, and of a trade-off made anew.
    #[test]
    fn equal_questions_get_equal_answers(seed: u64) {
        let layout = tree([9, 7, 5]);
        let prices = prices(&layout, seed);
        let first = tradeoff(&layout, &prices);
        let range = first.min_bytes()..=first.max_bytes();
        let answers: Vec<_> = range.clone().map(|bytes| first.cut(bytes)).collect();
        let second = Tradeoff::new(&layout, |node, resolution| prices.get(&(node, resolution)).copied());
        let second = second.expect("all is covered");
        let backwards: Vec<_> = range.rev().map(|bytes| second.cut(bytes)).collect();
        prop_assert!(answers.iter().eq(backwards.iter().rev()));
    }

    /// Scaling all errors by a power of two scales the answer, and changes nothing else.
    #[test]
    fn units_of_errors_do_not_matter(seed: u64, exponent in -200i32..200) {
        let layout = tree([9, 5, 5]);
        let prices = prices(&layout, seed);
        let factor = f64::from(exponent).exp2();
        let mut scaled = prices.clone();
        for choice in crate::every_choice(&layout) {
            scaled.get_mut(&choice).expect("every choice has one").error *= factor;
        }
        let (plain, scaled) = (tradeoff(&layout, &prices), tradeoff(&layout, &scaled));
        for max_bytes in (plain.min_bytes()..plain.max_bytes()).step_by(7) {
            let [plain, scaled] = [&plain, &scaled].map(|tradeoff| tradeoff.cut(max_bytes).expect("large enough"));
            prop_assert_eq!(plain.error * factor, scaled.error);
            let held: [Vec<Held>; 2] = [plain.held, scaled.held];
            prop_assert_eq!(&held[0], &held[1]);
        }
    }
}
