//! The way of a packet through one brick.
//!
//! Each lane goes from cell to cell of its own. Blocks without matter are leapt over first, until every lane
//! that is still on its way stands in a block with matter; then all take one cell. In a cell the field along
//! the ray is the cubic of a trilinear interpolant: eight corners, fetched once, give its value anywhere.
//!
//! Where a cell may hold much optical depth, the walk is *careful*: a lane whose pair of pieces is too thick waits
//! for the next round, in which it takes only part of its cell. It also minds restarts of the integrals. Elsewhere
//! both are left out of the code.

use fearless_simd::{f32x16, i32x16, mask32x16, prelude::*, u8x64, u32x16};

use volery_frame::integral::Restart;

use crate::MIN_TRANSMITTANCE;
use crate::brick::Occupancy;
use crate::math::{axes, four, front_weight, opacity_of_depth};
use crate::packet::Span;
use crate::texel::Texel;

/// A careful walk shortens pairs of pieces of more optical depth: colour and extinction may run far
/// from straight within what is seen of it.
const MAX_PAIR_DEPTH: f32 = 1.4;

/// No pair is shortened that passes fewer bins, since its ends are rounded to bins.
pub(crate) const MIN_PAIR_BINS: f32 = 64.0;

/// Nor a pair that is shorter, in unit lengths: lanes must come on.
const MIN_PAIR_LENGTH: f32 = 0.004;

/// Light gathered so far.
pub(crate) struct Light<S: Simd> {
    pub(crate) color: [f32x16<S>; 3],
    pub(crate) transmittance: f32x16<S>,
}

/// A brick with all that a packet needs of it.
pub(crate) struct Matter<'a, T> {
    /// Samples along x, y, z, each at least 2.
    pub(crate) samples: [u32; 3],
    pub(crate) texels: &'a [T],
    pub(crate) occupancy: &'a Occupancy,
    /// Cells of a block per axis.
    pub(crate) block: u32,
}

/// Classification: texel to bin to integrals.
#[derive(Clone, Copy)]
pub(crate) struct Table<'a> {
    pub(crate) entries: &'a [[f32; 4]],
    /// `bin = scale * texel + offset`.
    pub(crate) bin_from_texel: [f32; 2],
    /// A cell in which twice the middle differs from the sum of the ends by more than this, in texels, is
    /// integrated in four pieces instead of two.
    pub(crate) max_bend: f32,
    /// [`MIN_PAIR_BINS`] in texels.
    pub(crate) min_pair: f32,
    /// Where the integrals start anew.
    pub(crate) restarts: &'a [Restart],
}

/// The integrals at one end of a piece.
#[derive(Clone, Copy)]
struct End<S: Simd> {
    bin: i32x16<S>,
    /// `[∫ r s, ∫ g s, ∫ b s, ∫ s]`.
    integrals: [f32x16<S>; 4],
}

impl Table<'_> {
    /// The bin of a texel value, which may stray from the range by rounding.
    #[inline(always)]
    fn bin<S: Simd>(&self, simd: S, texel: f32x16<S>) -> i32x16<S> {
        let [scale, offset] = self.bin_from_texel;
        let bin = texel.mul_add(f32x16::splat(simd, scale), f32x16::splat(simd, offset));
        let last = (self.entries.len() - 2) as f32;
        let bin = bin.max(f32x16::splat(simd, 0.0)).min(f32x16::splat(simd, last));
        (bin + 0.5).to_int()
    }

    /// The end of a piece at a texel value, in another bin than `from`.
    #[inline(always)]
    fn end<S: Simd>(&self, simd: S, texel: f32x16<S>, from: i32x16<S>) -> End<S> {
        let bin = self.bin(simd, texel);
        // Two ends in one bin count as one whole bin: 2k goes with 2k + 1.
        let bin = bin.simd_eq(from).select(bin ^ 1, bin);
        self.at(simd, bin)
    }

    /// What the integrals grow by between two ends, across restarts.
    #[inline(always)]
    fn change<S: Simd>(&self, simd: S, from: &End<S>, to: &End<S>) -> [f32x16<S>; 4] {
        let (mut start, mut end) = (from.integrals, to.integrals);
        for restart in self.restarts {
            let bin = i32x16::splat(simd, restart.bin as i32);
            let rises = from.bin.simd_lt(bin) & to.bin.simd_ge(bin);
            let falls = to.bin.simd_lt(bin) & from.bin.simd_ge(bin);
            for (channel, &sum) in restart.sums.iter().enumerate() {
                start[channel] = rises.select(start[channel] - sum, start[channel]);
                end[channel] = falls.select(end[channel] - sum, end[channel]);
            }
        }
        four(
            #[inline(always)]
            |i| end[i] - start[i],
        )
    }

    #[inline(always)]
    fn at<S: Simd>(&self, simd: S, bin: i32x16<S>) -> End<S> {
        let mut rows = [0.0_f32; 64];
        let bins: [i32; 16] = bin.into();
        for (lane, &bin) in bins.iter().enumerate() {
            rows[4 * lane..4 * lane + 4].copy_from_slice(&self.entries[bin as usize]);
        }
        End { bin, integrals: transpose(simd, &rows) }
    }
}

/// Four columns of sixteen rows.
#[inline(always)]
fn transpose<S: Simd>(simd: S, rows: &[f32; 64]) -> [f32x16<S>; 4] {
    let [q0, q1, q2, q3] = four(
        #[inline(always)]
        |i| f32x16::from_slice(simd, &rows[16 * i..16 * i + 16]),
    );
    let (even01, odd01) = (q0.unzip_low(q1), q0.unzip_high(q1));
    let (even23, odd23) = (q2.unzip_low(q3), q2.unzip_high(q3));
    [even01.unzip_low(even23), odd01.unzip_low(odd23), even01.unzip_high(even23), odd01.unzip_high(odd23)]
}

impl<S: Simd> Light<S> {
    #[inline(always)]
    pub(crate) fn none(simd: S) -> Self {
        Self { color: [f32x16::splat(simd, 0.0); 3], transmittance: f32x16::splat(simd, 1.0) }
    }

    /// Adds two pieces of `length` each, from `from` over the value `middle` to the value `last`; returns their end.
    #[inline(always)]
    fn gather(
        &mut self,
        simd: S,
        table: Table<'_>,
        from: End<S>,
        middle: f32x16<S>,
        last: f32x16<S>,
        length: f32x16<S>,
    ) -> End<S> {
        let pair = Pair::new(simd, table, from, middle, last, length);
        self.add(simd, &pair.pieces);
        pair.end
    }

    /// Adds two neighbouring pieces of one length. What their mean colours differ by tells how the colour
    /// runs within each, so how much more of its front is seen than of its back.
    #[inline(always)]
    fn add(&mut self, simd: S, pieces: &[Piece<S>; 2]) {
        // Where one piece is much thinner than the other, its colour tells little of the other's.
        let (a, b) = (pieces[0].depth, pieces[1].depth);
        let (thin, thick) = (a.min(b), a.max(b));
        let trust = thick.simd_gt(0.0).select(thin / thick, f32x16::splat(simd, 0.0));
        let slope = axes(
            #[inline(always)]
            |i| (pieces[1].color(i) - pieces[0].color(i)) * trust,
        );
        self.add_piece(simd, &pieces[0], &slope);
        self.add_piece(simd, &pieces[1], &slope);
    }

    #[inline(always)]
    fn add_piece(&mut self, simd: S, piece: &Piece<S>, slope: &[f32x16<S>; 3]) {
        let alpha = opacity_of_depth(simd, piece.depth);
        let light = self.transmittance * alpha;
        let shift = front_weight(simd, piece.depth);
        self.color = axes(
            #[inline(always)]
            |i| light.mul_add(piece.color(i) - slope[i] * shift, self.color[i]),
        );
        self.transmittance -= light;
    }
}

/// A piece of ray along which the field is taken as linear.
struct Piece<S: Simd> {
    /// Colour times extinction times bins.
    light: [f32x16<S>; 3],
    /// `1 / extinction`, or 0.
    inverse: f32x16<S>,
    /// Optical depth.
    depth: f32x16<S>,
}

/// Two neighbouring pieces of one length.
struct Pair<S: Simd> {
    pieces: [Piece<S>; 2],
    end: End<S>,
}

impl<S: Simd> Pair<S> {
    /// Pieces of `length` each, from `from` over the value `middle` to the value `last`.
    #[inline(always)]
    fn new(
        simd: S,
        table: Table<'_>,
        from: End<S>,
        middle: f32x16<S>,
        last: f32x16<S>,
        length: f32x16<S>,
    ) -> Self {
        let middle = table.end(simd, middle, from.bin);
        let end = table.end(simd, last, middle.bin);
        let pieces =
            [Piece::new(simd, table, &from, &middle, length), Piece::new(simd, table, &middle, &end, length)];
        Self { pieces, end }
    }
}

impl<S: Simd> Piece<S> {
    #[inline(always)]
    fn new(simd: S, table: Table<'_>, from: &End<S>, to: &End<S>, length: f32x16<S>) -> Self {
        let bins: f32x16<S> = (to.bin - from.bin).to_float();
        let [r, g, b, extinction] = table.change(simd, from, to);
        let inverse = extinction.simd_ne(0.0).select(1.0 / extinction, f32x16::splat(simd, 0.0));
        let light = [r, g, b];
        Self { light, inverse, depth: length * extinction / bins }
    }

    /// Mean colour, weighted by extinction; black if there is none.
    #[inline(always)]
    fn color(&self, channel: usize) -> f32x16<S> {
        self.light[channel] * self.inverse
    }
}

/// Where the lanes stand in the brick.
struct Walker<'a, S: Simd> {
    span: &'a Span<S>,
    forward: [mask32x16<S>; 3],
    /// Cells of the brick.
    cells: [f32; 3],
    /// Cells of a block per axis.
    block: f32,
    /// The cell of each lane: whole numbers, exact in f32.
    cell: [f32x16<S>; 3],
    /// Unit lengths from the entry.
    depth: f32x16<S>,
    active: mask32x16<S>,
    /// The longest that the next round may take of a cell, in unit lengths.
    reach: f32x16<S>,
}

impl<'a, S: Simd> Walker<'a, S> {
    #[inline(always)]
    fn new<T>(simd: S, span: &'a Span<S>, matter: &Matter<'_, T>) -> Self {
        let cells = matter.samples.map(|n| (n - 1) as f32);
        let zero = f32x16::splat(simd, 0.0);
        let cell = [0, 1, 2]
            .map(|axis| span.entry[axis].floor().max(zero).min(f32x16::splat(simd, cells[axis] - 1.0)));
        let forward = axes(
            #[inline(always)]
            |axis| span.direction[axis].simd_gt(zero),
        );
        Self {
            span,
            forward,
            cells,
            block: matter.block as f32,
            cell,
            depth: zero,
            active: span.active,
            reach: f32x16::splat(simd, f32::INFINITY),
        }
    }

    /// Depth of the plane `plane[axis]` along each axis.
    #[inline(always)]
    fn depth_of(&self, axis: usize, plane: f32x16<S>) -> f32x16<S> {
        (plane - self.span.entry[axis]) * self.span.inverse[axis]
    }

    /// Depth of the faces through which each lane may leave its cell.
    #[inline(always)]
    fn exits(&self) -> [f32x16<S>; 3] {
        axes(
            #[inline(always)]
            |axis| self.depth_of(axis, self.forward[axis].select(self.cell[axis] + 1.0, self.cell[axis])),
        )
    }

    /// Lanes that stand in a block without matter.
    #[inline(always)]
    fn in_empty_block(&self, simd: S, occupancy: u8x64<S>) -> mask32x16<S> {
        let [x, y, z] = axes(
            #[inline(always)]
            |axis| (self.cell[axis] * (1.0 / self.block)).floor(),
        );
        let byte: u32x16<S> = z.mul_add(f32x16::splat(simd, 8.0), y).to_int();
        let byte: u32x16<S> = simd.swizzle_dyn_u8x64(occupancy, byte.bitcast()).bitcast();
        let bit: u32x16<S> = x.to_int();
        ((byte >> bit) & 1).simd_eq(0) & self.active
    }

    /// Takes `lanes` to where they leave their block.
    #[inline(always)]
    fn leap(&mut self, simd: S, lanes: mask32x16<S>) {
        let size = self.block;
        let first = axes(
            #[inline(always)]
            |axis| (self.cell[axis] * (1.0 / size)).floor() * size,
        );
        let exit = axes(
            #[inline(always)]
            |axis| {
                let plane = self.forward[axis].select(first[axis] + size, first[axis]);
                self.depth_of(axis, plane.min(f32x16::splat(simd, self.cells[axis])))
            },
        );
        let depth = exit[0].min(exit[1]).min(exit[2]).max(self.depth);
        for axis in 0..3 {
            let position = self.span.direction[axis].mul_add(depth, self.span.entry[axis]);
            // Along the axis of exit the next cell is certain; along others, rounding must not leave the block.
            let inside = position.floor().max(first[axis]).min(first[axis] + (size - 1.0));
            let beyond = self.forward[axis].select(first[axis] + size, first[axis] - 1.0);
            let next = exit[axis].simd_le(depth).select(beyond, inside);
            self.cell[axis] = lanes.select(next, self.cell[axis]);
        }
        self.depth = lanes.select(depth, self.depth);
        self.stop_outside(simd);
    }

    /// Takes every lane to the next cell, at `depth`, which the planes at `exit` lead to.
    #[inline(always)]
    fn step(&mut self, simd: S, exit: &[f32x16<S>; 3], depth: f32x16<S>) {
        for (axis, exit) in exit.iter().enumerate() {
            let next = self.cell[axis]
                + self.forward[axis].select(f32x16::splat(simd, 1.0), f32x16::splat(simd, -1.0));
            self.cell[axis] = exit.simd_le(depth).select(next, self.cell[axis]);
        }
        self.depth = depth;
        self.stop_outside(simd);
    }

    /// Ends lanes that have left the brick, and keeps their cells inside for the sake of addresses.
    #[inline(always)]
    fn stop_outside(&mut self, simd: S) {
        let zero = f32x16::splat(simd, 0.0);
        let mut active = self.active & self.depth.simd_lt(self.span.length);
        for axis in 0..3 {
            let last = f32x16::splat(simd, self.cells[axis] - 1.0);
            let cell = self.cell[axis];
            active = active & cell.simd_ge(zero) & cell.simd_le(last);
            self.cell[axis] = cell.max(zero).min(last);
        }
        self.active = active;
    }

    /// Lanes whose pair of pieces, over `values` and each `half` long, is too thick: their reach becomes shorter,
    /// that of others longer.
    #[inline(always)]
    fn shorten(
        &mut self,
        simd: S,
        table: Table<'_>,
        from: End<S>,
        [first, middle, last]: [f32x16<S>; 3],
        half: f32x16<S>,
    ) -> mask32x16<S> {
        let pair = Pair::new(simd, table, from, balanced(first, middle, last), last, half);
        let depth = pair.pieces[0].depth + pair.pieces[1].depth;
        let passed = (middle - first).abs() + (last - middle).abs();
        let thick = depth.simd_gt(MAX_PAIR_DEPTH)
            & passed.simd_gt(table.min_pair)
            & half.simd_gt(0.5 * MIN_PAIR_LENGTH);
        let share = (1.5 * MAX_PAIR_DEPTH / depth).max(table.min_pair / passed);
        self.reach = thick.select(half * share, self.reach + self.reach);
        thick
    }

    /// Position in the cell at `depth`, in [0, 1] along each axis.
    #[inline(always)]
    fn fraction(&self, simd: S, depth: f32x16<S>) -> [f32x16<S>; 3] {
        let (zero, one) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 1.0));
        axes(
            #[inline(always)]
            |axis| {
                let position = self.span.direction[axis].mul_add(depth, self.span.entry[axis]);
                (position - self.cell[axis]).max(zero).min(one)
            },
        )
    }
}

/// A cell's field.
struct Cell<S: Simd> {
    /// At x = 0: the corners (y, z) = (0, 0), (1, 0), (0, 1), (1, 1).
    low: [f32x16<S>; 4],
    /// What x = 1 adds.
    slope: [f32x16<S>; 4],
}

impl<S: Simd> Cell<S> {
    #[inline(always)]
    fn new(corners: [f32x16<S>; 8]) -> Self {
        let low = four(
            #[inline(always)]
            |i| corners[2 * i],
        );
        let slope = four(
            #[inline(always)]
            |i| corners[2 * i + 1] - corners[2 * i],
        );
        Self { low, slope }
    }

    #[inline(always)]
    fn value(&self, [x, y, z]: [f32x16<S>; 3]) -> f32x16<S> {
        let [a, b, c, d] = four(
            #[inline(always)]
            |i| self.slope[i].mul_add(x, self.low[i]),
        );
        let near = (b - a).mul_add(y, a);
        let far = (d - c).mul_add(y, c);
        (far - near).mul_add(z, near)
    }
}

/// The value for the middle of a cell, so that each of the straight lines to it from the cell's ends has the mean
/// of the field over its half, to second order: a parabola bulges from its chord by a third of what the middle
/// must give. Only where the field runs one way, and never past the ends: no value appears that is not there.
#[inline(always)]
fn balanced<S: Simd>(first: f32x16<S>, middle: f32x16<S>, last: f32x16<S>) -> f32x16<S> {
    let (low, high) = (first.min(last), first.max(last));
    let moved = (middle * 8.0 - first - last) * (1.0 / 6.0);
    let one_way = middle.simd_ge(low) & middle.simd_le(high);
    one_way.select(moved.max(low).min(high), middle)
}

/// Adds the light of one brick to a packet. Unless the walk is `CAREFUL`, cells should not be dense,
/// and the table must be without restarts.
#[inline(always)]
pub(crate) fn walk<S: Simd, T: Texel, const CAREFUL: bool>(
    simd: S,
    span: &Span<S>,
    matter: &Matter<'_, T>,
    table: Table<'_>,
    light: &mut Light<S>,
) {
    let [nx, ny, nz] = matter.samples.map(|n| n as usize);
    let (row, slice) = (nx, nx * ny);
    let reach = nz * slice - slice - row;
    let rows = [0, row, slice, slice + row].map(|offset| &matter.texels[offset..offset + reach]);
    let (row, slice) = (f32x16::splat(simd, row as f32), f32x16::splat(simd, slice as f32));
    let zero = f32x16::splat(simd, 0.0);
    let table = if CAREFUL { table } else { Table { restarts: &[], ..table } };

    let occupancy = u8x64::from_slice(simd, matter.occupancy);
    let mut walker = Walker::new(simd, span, matter);
    // Lanes whose last piece ended elsewhere than where the next begins.
    let mut fresh = walker.active;
    let mut from = table.at(simd, i32x16::splat(simd, 0));
    let mut first = zero;
    loop {
        loop {
            let empty = walker.in_empty_block(simd, occupancy);
            if empty.all_false() {
                break;
            }
            walker.leap(simd, empty);
            fresh |= empty;
        }
        if walker.active.all_false() {
            return;
        }
        let [x, y, z] = walker.cell;
        let address: i32x16<S> = z.mul_add(slice, y.mul_add(row, x)).to_int();
        let cell = Cell::new(T::corners(simd, rows, address));

        let exit = walker.exits();
        let mut end = exit[0].min(exit[1]).min(exit[2]).min(span.length);
        if CAREFUL {
            end = end.min(walker.depth + walker.reach);
        }
        let end = end.max(walker.depth);
        let half = (end - walker.depth) * 0.5;
        if fresh.any_true() {
            let value = cell.value(walker.fraction(simd, walker.depth));
            first = fresh.select(value, first);
            from = table.at(simd, fresh.select(table.bin(simd, value), from.bin));
        }
        let middle = cell.value(walker.fraction(simd, walker.depth + half));
        let last = cell.value(walker.fraction(simd, end));
        // A blank corner makes every value of its cell NaN or infinite.
        let blank = if T::CAN_BE_BLANK { !middle.is_finite() } else { mask32x16::splat(simd, false) };
        let mut lanes = walker.active & !blank;
        let mut waits = mask32x16::splat(simd, false);
        if CAREFUL {
            waits = walker.shorten(simd, table, from, [first, middle, last], half) & lanes;
            lanes &= !waits;
        }
        let length = lanes.select(half, zero);
        let bend = (middle + middle - first - last).abs();
        if (bend.simd_gt(table.max_bend) & lanes).any_true() {
            let quarter = half * 0.5;
            let early = cell.value(walker.fraction(simd, walker.depth + quarter));
            let late = cell.value(walker.fraction(simd, end - quarter));
            let length = length * 0.5;
            from = light.gather(simd, table, from, balanced(first, early, middle), middle, length);
            from = light.gather(simd, table, from, balanced(middle, late, last), last, length);
        } else {
            from = light.gather(simd, table, from, balanced(first, middle, last), last, length);
        }
        first = last;
        // Who waits finds its value again.
        fresh = blank | waits;
        walker.step(simd, &exit, if CAREFUL { waits.select(walker.depth, end) } else { end });
        walker.active &= light.transmittance.simd_gt(MIN_TRANSMITTANCE);
    }
}
