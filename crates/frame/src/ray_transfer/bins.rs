//! A set of bins, asked by ranges.

/// Which bins of a table have some property; asked whether any of a range has.
#[derive(Clone, Debug, PartialEq)]
pub struct BinSet {
    /// For each bin the next one from it on, itself included, that is in the set.
    next: Vec<u16>,
}

impl BinSet {
    /// The set of the bins that `contains` says, one call per bin. Fewer bins than `u16` can number.
    pub(super) fn new(contains: impl DoubleEndedIterator<Item = bool> + ExactSizeIterator) -> Self {
        let mut next = vec![u16::MAX; contains.len()];
        let mut nearest = u16::MAX;
        for (bin, contains) in contains.enumerate().rev() {
            nearest = if contains { bin as u16 } else { nearest };
            next[bin] = nearest;
        }
        Self { next }
    }

    /// Whether it is without bins.
    pub fn is_empty(&self) -> bool {
        self.next.first().is_none_or(|&first| first == u16::MAX)
    }

    /// Whether a bin between two positions, both included, is in the set. Positions beyond the bins are at the
    /// nearest one. Not so for an empty range (`low` above `high`, or NaN), thus for blank matter.
    #[inline]
    pub fn meets(&self, low: f32, high: f32) -> bool {
        let last = self.next.len() - 1;
        // `as` saturates: below the range is bin 0.
        let first = (low as usize).min(last);
        low <= high && self.next[first] <= (high.max(0.0) as usize).min(last) as u16
    }
}
