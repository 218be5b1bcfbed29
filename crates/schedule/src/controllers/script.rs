//! A frame whose levels are all known when it begins.

use crate::item::{Item, Part, Step, Summary, secs};

#[derive(Clone, Debug, Default)]
pub(super) struct Script {
    is_open: bool,
    budget_secs: f64,
    /// Item, level and coarsest level of all that is drawn.
    parts: Vec<(usize, usize, usize)>,
    pixel_rate: f64,
    is_smallest_rate: bool,
    position: usize,
    next_id: u64,
}

impl Script {
    /// Begins a frame of the levels that `choose` gives.
    pub(super) fn begin(
        &mut self,
        budget_secs: f64,
        items: &[Item<'_>],
        choose: impl Fn(&Item<'_>) -> usize,
    ) {
        self.is_open = true;
        self.budget_secs = secs(budget_secs);
        (self.pixel_rate, self.is_smallest_rate) = (1.0, true);
        self.position = 0;
        self.parts.clear();
        self.parts.extend(items.iter().enumerate().filter_map(|(index, item)| {
            let coarsest = item.levels.len().checked_sub(1)?;
            Some((index, choose(item).min(coarsest), coarsest))
        }));
    }

    /// As `begin`, with the finest levels and larger pixels.
    pub(super) fn begin_scaled(
        &mut self,
        budget_secs: f64,
        items: &[Item<'_>],
        pixel_rate: f64,
        smallest: f64,
    ) {
        self.begin(budget_secs, items, |_| 0);
        (self.pixel_rate, self.is_smallest_rate) = (pixel_rate, pixel_rate <= smallest);
    }

    pub(super) fn next(&mut self) -> Step {
        let Some(&(item, level, _)) = self.parts.get(self.position).filter(|_| self.is_open) else {
            return Step::Done;
        };
        self.position += 1;
        self.next_id += 1;
        Step::Draw(Part {
            id: self.next_id,
            item,
            level,
            is_refinement: false,
            pixel_rate: self.pixel_rate,
            predicted_secs: 0.0,
        })
    }

    /// Ends the frame; none if none was begun.
    pub(super) fn finish(&mut self, actual_secs: f64) -> Option<Summary> {
        let is_scaled = self.pixel_rate < 1.0;
        let shown =
            |is: &dyn Fn(usize, usize) -> bool| self.parts.iter().all(|&(_, level, last)| is(level, last));
        std::mem::take(&mut self.is_open).then(|| Summary {
            budget_secs: self.budget_secs,
            actual_secs,
            num_parts: self.position,
            is_at_floor: if is_scaled { self.is_smallest_rate } else { shown(&|level, last| level == last) },
            is_at_ceiling: !is_scaled && shown(&|level, _| level == 0),
            ..Summary::default()
        })
    }
}
