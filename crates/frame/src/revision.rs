//! Which contents something has, by a number.

use std::sync::atomic::{AtomicU64, Ordering};

/// Names contents that may be kept elsewhere: whoever owns them takes a new number when they change, so equal numbers
/// promise equal contents, and nobody has to compare these.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Revision(u64);

impl Revision {
    /// A number that no other call in this process has returned.
    #[allow(clippy::new_without_default, reason = "a default is the same each time")]
    pub fn new() -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(1);
        Self(NEXT.fetch_add(1, Ordering::Relaxed))
    }
}
