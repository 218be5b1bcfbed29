//! Which of many things each slice meets.

use std::ops::Range;

use rayon::prelude::*;

/// Things by slice, each in every slice of its range.
///
/// Made in runs of things that do not know each other, so in parallel; the runs are read one after another, so
/// that each slice has its things in ascending order whatever the number of threads.
pub(crate) struct Buckets {
    runs: Vec<Run>,
}

struct Run {
    first_slice: u32,
    /// Where the things of each slice start, from the first slice of the run to one beyond its last.
    starts: Vec<u32>,
    things: Vec<u32>,
}

impl Buckets {
    pub(crate) fn new(num_things: usize, slices_of: impl Fn(usize) -> Range<u32> + Sync) -> Self {
        /// More would cost memory where slices are many, fewer would keep threads waiting.
        const RUNS: usize = 64;
        let size = num_things.div_ceil(RUNS).max(2048);
        let run = |run: usize| Run::new(run * size..num_things.min((run + 1) * size), &slices_of);
        Self { runs: (0..num_things.div_ceil(size)).into_par_iter().map(run).collect() }
    }

    /// The things that a slice meets, ascending.
    pub(crate) fn of(&self, slice: u32) -> impl Iterator<Item = u32> {
        self.runs.iter().flat_map(move |run| run.of(slice)).copied()
    }

    /// How many there are.
    pub(crate) fn num_of(&self, slice: u32) -> usize {
        self.runs.iter().map(|run| run.of(slice).len()).sum()
    }
}

impl Run {
    fn new(things: Range<usize>, slices_of: impl Fn(usize) -> Range<u32>) -> Self {
        let ranges: Vec<Range<u32>> = things.clone().map(slices_of).collect();
        let met = || ranges.iter().filter(|range| !range.is_empty());
        let first_slice = met().map(|range| range.start).min().unwrap_or(0);
        let end = met().map(|range| range.end).max().unwrap_or(0);
        let mut starts = vec![0; (end - first_slice) as usize + 2];
        // Differences first (MAX is -1), then how many, then where they start.
        for range in met() {
            for (slice, change) in [(range.start, 1), (range.end, u32::MAX)] {
                let start: &mut u32 = &mut starts[(slice - first_slice) as usize + 1];
                *start = start.wrapping_add(change);
            }
        }
        for _ in 0..2 {
            let mut sum = 0u32;
            for start in &mut starts {
                sum = sum.wrapping_add(*start);
                *start = sum;
            }
        }
        starts.pop();
        let mut next = starts.clone();
        let mut found = vec![0; starts.last().map_or(0, |&end| end as usize)];
        for (thing, range) in things.zip(&ranges) {
            for slice in range.clone() {
                let place = &mut next[(slice - first_slice) as usize];
                found[*place as usize] = thing as u32;
                *place += 1;
            }
        }
        Self { first_slice, starts, things: found }
    }

    fn of(&self, slice: u32) -> &[u32] {
        let Some(at) = slice.checked_sub(self.first_slice) else { return &[] };
        match self.starts.get(at as usize..=at as usize + 1) {
            Some(&[start, end]) => &self.things[start as usize..end as usize],
            _ => &[],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_thing_is_in_its_slices() {
        // Ranges of all lengths, empty ones among them, over more than one run.
        let range = |thing: usize| {
            let start = (thing * 7919 % 50) as u32;
            start..start + (thing * 31 % 9) as u32
        };
        for num_things in [0, 1, 5000] {
            let buckets = Buckets::new(num_things, range);
            for slice in 0..60 {
                let expected: Vec<u32> = (0..num_things)
                    .filter(|&thing| range(thing).contains(&slice))
                    .map(|t| t as u32)
                    .collect();
                assert_eq!(buckets.of(slice).collect::<Vec<_>>(), expected, "slice {slice}");
                assert_eq!(buckets.num_of(slice), expected.len());
            }
        }
    }
}
