//! Levels that do not depend on time.

use crate::item::{Controller, Item, Step, Summary};

use super::script::Script;

/// For each item the coarsest level whose error is within a tolerance, or else the finest: Laur and Hanrahan (1991).
#[derive(Clone, Debug, Default)]
pub struct FixedLevels {
    tolerance: Option<f64>,
    script: Script,
}

impl FixedLevels {
    /// The finest level of everything.
    pub fn finest() -> Self {
        Self::default()
    }

    /// The coarsest levels within a tolerance.
    pub fn within(tolerance: f64) -> Self {
        FixedLevels { tolerance: Some(tolerance), ..Self::default() }
    }
}

/// The coarsest level of an item within a tolerance, or else the finest.
pub(super) fn level_within(item: &Item<'_>, tolerance: f64) -> usize {
    item.levels.iter().rposition(|level| level.error <= tolerance).unwrap_or(0)
}

impl Controller for FixedLevels {
    fn begin(&mut self, budget_secs: f64, items: &[Item<'_>]) {
        let tolerance = self.tolerance;
        self.script
            .begin(budget_secs, items, |item| tolerance.map_or(0, |tolerance| level_within(item, tolerance)));
    }

    fn next(&mut self, _elapsed_secs: f64) -> Step {
        self.script.next()
    }

    fn observe(&mut self, _part_id: u64, _secs: f64) {}

    fn finish(&mut self, actual_secs: f64) -> Summary {
        self.script.finish(actual_secs).unwrap_or_default()
    }
}
