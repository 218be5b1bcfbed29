//! Along one axis: the positions at which a difference of two fields is looked at, and where the coarser
//! field is read there.
//!
//! Positions are counted in *half samples*, `p = 2 x`: finest samples are even, the odd ones are half way
//! between two. Both fields are linear between neighbouring positions of the list, which has
//! - every finest sample;
//! - for the averaged kind, every coarse sample and every bound of a node, all of them odd.

use std::ops::Range;

use crate::layout::{Kind, Layout};

/// The coarser level along one axis.
#[derive(Clone, Copy)]
pub(crate) struct Axis {
    pub kind: Kind,
    pub level: u32,
    /// Finest samples.
    pub len: usize,
    /// Samples of the level.
    pub coarse_len: usize,
    /// Finest samples that a node of this level spans.
    pub span: usize,
}

/// One position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Tap {
    /// In half samples.
    pub position: usize,
    /// The coarse sample at or before it.
    pub cell: usize,
    /// How far on the way to the next coarse sample, in steps.
    pub steps: u32,
}

impl Tap {
    /// The finest sample at or before the position.
    pub(crate) fn fine(&self) -> usize {
        self.position / 2
    }

    /// 1 where the position is half way to the next finest sample, else 0.
    pub(crate) fn half(&self) -> usize {
        self.position % 2
    }
}

impl Axis {
    pub(crate) fn new(layout: &Layout, level: u32, axis: usize) -> Self {
        Self {
            kind: layout.kind(),
            level,
            len: layout.dims()[axis],
            coarse_len: layout.level_dims(level)[axis],
            span: layout.brick_cells() << level,
        }
    }

    /// Steps per coarse cell, as a power of two.
    pub(crate) fn log_steps(kind: Kind, level: u32) -> u32 {
        match kind {
            Kind::Decimated => level,
            Kind::Averaged => level + 1,
        }
    }

    /// Where the coarser field is read at `position`. Beyond the first and the last coarse sample it is
    /// constant.
    pub(crate) fn tap(&self, position: usize) -> Tap {
        let last = self.coarse_len - 1;
        let log_steps = Self::log_steps(self.kind, self.level);
        let at = match self.kind {
            Kind::Decimated => position / 2,
            Kind::Averaged => (position + 1).saturating_sub(1 << self.level).min(last << log_steps),
        };
        let cell = (at >> log_steps).min(last.saturating_sub(1));
        Tap { position, cell, steps: (at - (cell << log_steps)) as u32 }
    }

    /// The odd positions from `first` to `last`, in order, the bounds of nodes at this level included.
    fn halves(&self, first: usize, last: usize) -> impl Iterator<Item = usize> + use<> {
        // Coarse sample c is at (2 c + 1) 2^l - 1, the lower bound of node k at 2 k s - 1, and 2 s is a
        // multiple of 2^(l + 1): in units of 2^l the former are odd, the latter even.
        let (unit, nodes) = (1_usize << self.level, (2 * self.span) >> self.level);
        let wanted = move |m: &usize| m % 2 == 1 || m.is_multiple_of(nodes);
        let range = match self.kind {
            Kind::Decimated => 0..0,
            Kind::Averaged => (first + 1).div_ceil(unit).max(1)..(last + 1) / unit + 1,
        };
        range.filter(wanted).map(move |m| m * unit - 1)
    }

    /// Every odd position of the axis: coarse samples, evenly spaced, and bounds of nodes.
    pub(crate) fn all_halves(&self) -> [Vec<Tap>; 2] {
        let bounds = 2 * self.span;
        let taps = self.halves(0, 2 * (self.len - 1)).map(|p| self.tap(p));
        taps.partition::<Vec<_>, _>(|tap| (tap.position + 1) % bounds != 0).into()
    }

    /// Every position in the closed part of the axis that a block stands for, whose own finest samples are
    /// `own`; for the averaged kind it ends half way to the samples beside them.
    pub(crate) fn block(&self, own: &Range<usize>) -> Vec<Tap> {
        let end = 2 * (self.len - 1);
        let (first, last) = match self.kind {
            Kind::Decimated => (2 * own.start, (2 * own.end).min(end)),
            Kind::Averaged => ((2 * own.start).saturating_sub(1), (2 * own.end - 1).min(end)),
        };
        let whole = (first.div_ceil(2)..=last / 2).map(|x| 2 * x);
        let mut positions: Vec<usize> = whole.chain(self.halves(first, last)).collect();
        positions.sort_unstable();
        positions.into_iter().map(|p| self.tap(p)).collect()
    }

    /// The nodes of this level that hold `position`: one, or two where it is a bound.
    pub(crate) fn nodes_at(&self, position: usize) -> impl Iterator<Item = usize> + use<> {
        let (at, end, cells) = match self.kind {
            Kind::Decimated => (position, 2 * self.span, self.len - 1),
            Kind::Averaged => (position + 1, 2 * self.span, self.len),
        };
        let last = cells.div_ceil(self.span).max(1) - 1;
        let (upper, lower) = (at / end, at.saturating_sub(1) / end);
        [upper, lower].into_iter().take(1 + usize::from(lower != upper)).filter(move |&node| node <= last)
    }
}
