//! One block: the rows (y, z) of a level-0 node, or of a part of it, for all x.

use std::ops::Range;

use fearless_simd::Level;

use super::Partial;
use super::expand::{CoarseRows, PairSums, Reach};
use super::lane::{COLUMNS, Component, Lane, Voxel, Widen};
use super::moments::{ColumnMoments, Moments, Rows};
use super::scan::{self, Columns, Fields, RowTap};
use super::taps::{Axis, Tap};
use crate::layout::{Kind, Layout};
use crate::node::Node;

/// Most cells of a block along y and z; large bricks are cut into several blocks.
const BLOCK_CELLS: usize = 32;

/// Samples of several groups of columns are fetched together, this many bytes of each row: short pieces
/// defeat the prefetcher (measured: 128 bytes cost half as much again), long ones leave the cache.
const FETCH_BYTES: usize = 512;

/// The cells (samples for the averaged kind) along one axis that a block stands for.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    /// The level-0 node they belong to.
    pub node: usize,
    own: Range<usize>,
}

/// The parts of an axis, in order: each node in equal parts of at most [`BLOCK_CELLS`].
pub(crate) fn parts(layout: &Layout, axis: usize) -> Vec<Part> {
    let brick = layout.brick_cells();
    let cells = match layout.kind() {
        Kind::Decimated => layout.dims()[axis] - 1,
        Kind::Averaged => layout.dims()[axis],
    };
    let part = brick.div_ceil(brick.div_ceil(BLOCK_CELLS));
    let in_node = |node: usize| {
        let end = ((node + 1) * brick).min(cells);
        (node * brick..end.max(node * brick + 1))
            .step_by(part)
            .map(move |start| Part { node, own: start..(start + part).min(end) })
    };
    (0..layout.nodes(0)[axis] as usize).flat_map(in_node).collect()
}

/// A block, by its parts along y and z.
pub(crate) struct Block<'a, T> {
    pub plan: &'a Plan<'a, T>,
    pub parts: [&'a Part; 2],
}

/// What all blocks share.
pub(crate) struct Plan<'a, T> {
    layout: &'a Layout,
    finest: &'a [T],
    channel: usize,
    simd: Level,
    /// From level 1 up.
    coarser: Vec<CoarseLevel<'a, T>>,
}

struct CoarseLevel<'a, T> {
    samples: &'a [T],
    dims: [usize; 3],
    axes: [Axis; 3],
    log_steps: u32,
    /// The positions along x that are half way between finest samples: coarse samples, in order, and
    /// bounds of nodes.
    halves: [Vec<Tap>; 2],
}

impl<'a, T> Plan<'a, T> {
    pub(crate) fn new(layout: &'a Layout, levels: &[&'a [T]], channel: usize, simd: Level) -> Self {
        let coarser = (1..layout.num_levels()).zip(&levels[1..]).map(|(level, samples)| {
            let axes = std::array::from_fn(|axis| Axis::new(layout, level, axis));
            CoarseLevel {
                samples,
                dims: layout.level_dims(level),
                halves: axes[0].all_halves(),
                axes,
                log_steps: Axis::log_steps(layout.kind(), level),
            }
        });
        Self { layout, finest: levels[0], channel, simd, coarser: coarser.collect() }
    }
}

/// What a block tells about the nodes it lies in, along x.
pub(crate) struct Found<M> {
    /// Per level-0 node; errors are not in here.
    pub parts: Vec<Partial<M>>,
    /// Per level above 0, per node.
    pub errors: Vec<Vec<f64>>,
}

type FoundOf<T> = Found<<<T as Voxel>::Component as ColumnMoments>::Moments>;

/// Buffers that a thread uses for block after block.
pub(crate) struct Scratch<C: Component> {
    fine: Vec<[C; COLUMNS]>,
    narrow: Lanes<C::Narrow>,
    wide: Lanes<C::Wide>,
    float: Lanes<f64>,
}

struct Lanes<L> {
    coarse: Vec<[L; COLUMNS]>,
    halves: Vec<[L; COLUMNS]>,
}

impl<C: Component> Scratch<C> {
    pub(crate) fn new() -> Self {
        fn lanes<L>() -> Lanes<L> {
            Lanes { coarse: Vec::new(), halves: Vec::new() }
        }
        Self { fine: Vec::new(), narrow: lanes(), wide: lanes(), float: lanes() }
    }
}

/// What a block reads at one coarser level.
struct BlockLevel<'a, T> {
    plan: &'a Plan<'a, T>,
    coarse: &'a CoarseLevel<'a, T>,
    /// Positions along y and z.
    taps: [Vec<RowTap>; 2],
    /// Coarse rows along y and z.
    rows: [Range<usize>; 2],
    /// Fine rows along y and z.
    support: [Range<usize>; 2],
}

/// Runs a method for the narrowest lane that holds the differences of a level.
macro_rules! with_lane {
    ($level:expr, $scratch:expr, |$lanes:ident| $body:expr) => {{
        let bits = T::Component::BITS + 3 * $level.coarse.log_steps;
        if bits <= <<T::Component as Component>::Narrow as Lane>::BITS {
            let $lanes = &mut $scratch.narrow;
            $body
        } else if bits <= <<T::Component as Component>::Wide as Lane>::BITS {
            let $lanes = &mut $scratch.wide;
            $body
        } else {
            let $lanes = &mut $scratch.float;
            $body
        }
    }};
}

impl<T> Block<'_, T> {
    /// The place of the first node of `level` that the block lies in, among the nodes of that level.
    pub(crate) fn first_node(&self, level: u32) -> usize {
        let [j, k] = self.parts.map(|part| (part.node >> level) as u32);
        self.plan.layout.node_index(Node::new(level, [0, j, k]))
    }
}

impl<T: Voxel> Block<'_, T> {
    /// The rows that are read along y and z.
    fn support(&self) -> [Range<usize>; 2] {
        let layout = self.plan.layout;
        let before = usize::from(layout.kind() == Kind::Averaged);
        std::array::from_fn(|i| {
            let Part { node: _, own } = self.parts[i];
            own.start.saturating_sub(before)..(own.end + 1).min(layout.dims()[i + 1])
        })
    }

    /// The rows whose samples the block owns, counted from the first of the support.
    fn owned(&self, support: &[Range<usize>; 2]) -> [Range<usize>; 2] {
        let layout = self.plan.layout;
        std::array::from_fn(|i| {
            let Part { node: _, own } = self.parts[i];
            // The last sample of the decimated kind has no cell of its own.
            let is_last = layout.kind() == Kind::Decimated && own.end + 1 == layout.dims()[i + 1];
            own.start - support[i].start..own.end + usize::from(is_last) - support[i].start
        })
    }

    fn level<'a>(&'a self, coarse: &'a CoarseLevel<'a, T>, support: &[Range<usize>; 2]) -> BlockLevel<'a, T> {
        let taps = [0, 1].map(|i| coarse.axes[i + 1].block(&self.parts[i].own));
        let rows = taps.each_ref().map(|taps| taps[0].cell..taps[taps.len() - 1].cell + 2);
        let row_taps = |i: usize| {
            let row_tap = |tap: &Tap| RowTap {
                cell: tap.cell - rows[i].start,
                steps: tap.steps,
                row: tap.fine() - support[i].start,
                half: tap.half(),
            };
            taps[i].iter().map(row_tap).collect()
        };
        let taps = [row_taps(0), row_taps(1)];
        BlockLevel { plan: self.plan, coarse, taps, rows, support: support.clone() }
    }

    /// Everything about the nodes that the block lies in.
    pub(crate) fn analyse(&self, scratch: &mut Scratch<T::Component>) -> FoundOf<T> {
        let plan = self.plan;
        let support = self.support();
        let owned = self.owned(&support);
        let levels: Vec<_> = plan.coarser.iter().map(|coarse| self.level(coarse, &support)).collect();
        let mut found = Found {
            parts: vec![Partial::EMPTY; plan.layout.nodes(0)[0] as usize],
            errors: (1..plan.layout.num_levels())
                .map(|l| vec![0.0; plan.layout.nodes(l)[0] as usize])
                .collect(),
        };
        let nx = plan.layout.dims()[0];
        let (along_y, num_rows) = (support[0].len(), support[0].len() * support[1].len());
        let fetch = (FETCH_BYTES / size_of::<T>()).next_multiple_of(COLUMNS);
        for start in (0..nx).step_by(fetch) {
            let fetched = start..(start + fetch).min(nx);
            self.fetch(&support, &fetched, &mut scratch.fine);
            for (group, start) in fetched.clone().step_by(COLUMNS).enumerate() {
                let x = start..(start + COLUMNS).min(nx);
                let fine = Rows { rows: &scratch.fine[group * num_rows..][..num_rows], along_y };
                found.take_columns(plan.layout, &x, &scan::columns(plan.simd, fine, &owned));
                for (level, errors) in levels.iter().zip(&mut found.errors) {
                    with_lane!(level, scratch, |lanes| level.whole_columns(fine, x.clone(), lanes, errors));
                }
            }
        }
        for (level, errors) in levels.iter().zip(&mut found.errors) {
            let [samples, bounds] = &level.coarse.halves;
            for (i, taps) in samples.chunks(COLUMNS).enumerate() {
                with_lane!(level, scratch, |lanes| {
                    level.half_columns(taps, Reach::Samples { first: i * COLUMNS }, lanes, errors)
                });
            }
            for taps in bounds.chunks(COLUMNS) {
                let log_steps = level.coarse.log_steps;
                with_lane!(level, scratch, |lanes| {
                    level.half_columns(taps, Reach::of_taps(taps, log_steps), lanes, errors)
                });
            }
        }
        found
    }

    /// Copies columns of the block's rows to groups of [`COLUMNS`], each dense; the last is padded.
    fn fetch(&self, support: &[Range<usize>; 2], x: &Range<usize>, out: &mut Vec<[T::Component; COLUMNS]>) {
        let [nx, ny, _] = self.plan.layout.dims();
        let num_rows = support[0].len() * support[1].len();
        out.resize(num_rows * x.len().div_ceil(COLUMNS), [T::Component::default(); COLUMNS]);
        let rows = support[1].clone().flat_map(|z| support[0].clone().map(move |y| z * ny + y));
        for (row, at) in rows.enumerate() {
            let samples = &self.plan.finest[at * nx..][x.clone()];
            for (group, samples) in samples.chunks(COLUMNS).enumerate() {
                let out = &mut out[group * num_rows + row];
                if let Some(samples) = samples.first_chunk::<COLUMNS>() {
                    for column in 0..COLUMNS {
                        out[column] = samples[column].component(self.plan.channel);
                    }
                } else {
                    for (out, sample) in out.iter_mut().zip(samples) {
                        *out = sample.component(self.plan.channel);
                    }
                }
            }
        }
    }
}

impl<T: Voxel> BlockLevel<'_, T> {
    /// The errors in the columns of the finest samples `x`.
    fn whole_columns<L: Lane>(
        &self,
        fine: Rows<'_, T::Component>,
        x: Range<usize>,
        lanes: &mut Lanes<L>,
        errors: &mut [f64],
    ) where
        T::Component: Widen<L>,
    {
        let axis = &self.coarse.axes[0];
        let first = x.start;
        let taps: Vec<Tap> = x.map(|x| axis.tap(2 * x)).collect();
        let reach = Reach::of_samples(first, &taps, axis, self.coarse.log_steps);
        self.columns((fine, 0), &taps, &reach, &mut lanes.coarse, errors);
    }

    /// The errors in columns that are half way between finest samples.
    fn half_columns<L: Lane>(&self, taps: &[Tap], reach: Reach<L>, lanes: &mut Lanes<L>, errors: &mut [f64])
    where
        T::Component: Widen<L>,
    {
        let [nx, ny, _] = self.plan.layout.dims();
        let [ys, zs] = &self.support;
        let rows = zs.clone().flat_map(|z| ys.clone().map(move |y| z * ny + y));
        let pair_sums = PairSums { samples: self.plan.finest, channel: self.plan.channel, taps };
        pair_sums.along(self.plan.simd, rows, nx, &mut lanes.halves);
        let fine = Rows { rows: &lanes.halves, along_y: ys.len() };
        self.columns((fine, 1), taps, &reach, &mut lanes.coarse, errors);
    }

    /// The errors in the columns at `taps`, whose finest values are sums of `2^log_terms` samples.
    fn columns<S: Widen<L>, L: Lane>(
        &self,
        (fine, log_terms): (Rows<'_, S>, u32),
        taps: &[Tap],
        reach: &Reach<L>,
        buffer: &mut Vec<[L; COLUMNS]>,
        errors: &mut [f64],
    ) where
        T::Component: Widen<L>,
    {
        let Self { plan, coarse, taps: [y, z], rows, support: _ } = self;
        let log_steps = coarse.log_steps;
        let coarse_rows = CoarseRows {
            samples: coarse.samples,
            dims: coarse.dims,
            channel: plan.channel,
            rows: rows.clone(),
        };
        coarse_rows.expand(plan.simd, reach, log_steps, buffer);
        let coarse_rows = Rows { rows: buffer, along_y: rows[0].len() };
        let fields = Fields { fine, coarse: coarse_rows, log_terms, log_steps };
        let worst = scan::worst(plan.simd, &fields, y, z);
        for (tap, worst) in taps.iter().zip(worst) {
            let error = worst.unscaled(3 * log_steps);
            for node in coarse.axes[0].nodes_at(tap.position) {
                errors[node] = errors[node].max(error);
            }
        }
    }
}

impl<M: Moments> Found<M> {
    /// Takes in the columns of the finest samples `x`.
    fn take_columns<C: Component<Moments = M>>(
        &mut self,
        layout: &Layout,
        x: &Range<usize>,
        columns: &Columns<C>,
    ) {
        let last = self.parts.len() - 1;
        let brick = layout.brick_cells();
        let before = usize::from(layout.kind() == Kind::Averaged);
        for (column, x) in x.clone().enumerate() {
            let [min, max] = columns.range(column);
            let any_blank = columns.any_blank[column];
            let touched = Partial { min, max, any_blank, ..Partial::EMPTY };
            // The nodes whose support holds x: `node * brick - before <= x <= (node + 1) * brick`.
            let first = x.saturating_sub(brick).div_ceil(brick);
            for node in first..=((x + before) / brick).min(last) {
                self.parts[node].merge(&touched);
            }
            let owner = &mut self.parts[(x / brick).min(last)];
            owner.moments = owner.moments.merge(columns.moments[column]);
        }
    }
}
