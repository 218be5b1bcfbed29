//! What is known about a node, exactly.

/// Statistics of one channel of the finest samples of a node.
///
/// Only finite samples count; the others are *blank*. See the [crate] for what is exact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeStats {
    /// Smallest finest sample in the node's [support](crate::Layout::support); `+∞` if all are blank.
    pub min: f64,
    /// Largest finest sample in the node's [support](crate::Layout::support); `-∞` if all are blank.
    pub max: f64,
    /// Mean of the samples that the node [owns](crate::Layout::owned); NaN if all are blank.
    pub mean: f64,
    /// Standard deviation of the samples that the node owns, as a whole population; NaN if all are blank.
    pub std_dev: f64,
    /// The largest `|f~ - f|` anywhere in the closed node, where `f` is the finest field and `f~` that of
    /// the node's own level. `+∞` where one of the two is blank and the other is not; 0 at level 0.
    pub error: f64,
    /// Finite samples that the node owns.
    pub count: u64,
    /// Blank samples that the node owns.
    pub blank: u64,
}

impl NodeStats {
    /// Schussman and Max's error: the largest distance of a leaf from the mean,
    /// `max(max - mean, mean - min)`. Zero for a node without finite samples.
    pub fn schussman_max_error(&self) -> f64 {
        // NaN, from a mean of nothing, loses against 0.
        (self.max - self.mean).max(self.mean - self.min).max(0.0)
    }

    /// Whether no finest sample in the node's support is finite: nothing is to be seen there.
    pub fn is_blank(&self) -> bool {
        self.min > self.max
    }
}
