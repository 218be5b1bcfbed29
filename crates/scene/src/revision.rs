//! Names for contents that somebody may keep something of.

use std::num::NonZeroU64;
use std::sync::atomic::{AtomicU64, Ordering};

/// A number that no other call in this process has returned. Whoever owns data makes one when the data are made or
/// change, and clones keep it; who made something of the data asks whether the number is another, not whether each
/// number of the data is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Revision(NonZeroU64);

impl Revision {
    /// The next one.
    pub fn new() -> Self {
        static LAST: AtomicU64 = AtomicU64::new(0);
        // 2^64 calls take centuries.
        let number = LAST.fetch_add(1, Ordering::Relaxed).wrapping_add(1);
        Self(NonZeroU64::new(number).unwrap_or(NonZeroU64::MAX))
    }
}

impl Default for Revision {
    /// The next one, as of [`Revision::new`].
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_are_the_same() {
        let made = |_| std::thread::spawn(|| (0..1000).map(|_| Revision::new().0).collect::<Vec<_>>());
        let threads: Vec<_> = (0..8).map(made).collect();
        let mut all: Vec<_> = threads.into_iter().flat_map(|thread| thread.join().unwrap()).collect();
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), 8000);
    }
}
