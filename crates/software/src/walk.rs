//! The way of a packet through one brick.
//!
//! Each lane goes from cell to cell of its own. Blocks without matter are leapt over first, until every lane
//! that is still on its way stands in a block with matter; then all take one cell. In a cell the field along
//! the ray is the cubic of a trilinear interpolant: eight corners, fetched once, give its value anywhere.
//!
//! A cell is taken as two straight pieces, read from the table of the transfer function. How far the field bends away
//! from them, and how much depth and change of colour they hold, says what that may be off by at most: the *doubt* of the
//! cell. Where it is above [`MAX_DOUBT`] the packet takes four pieces; where that cannot be enough, and in blocks for
//! which the table is too coarse, the lane's cell is integrated by `exact` instead.

use fearless_simd::{f32x16, i32x16, mask32x16, prelude::*, u8x64, u32x16};

use crate::MIN_TRANSMITTANCE;
use crate::brick::Occupancy;
use crate::cell::{Cell, balanced, mean_distance};
use crate::exact::{Bands, EXACT_DOUBT, Field, PLACE_ROUNDING, add_cells};
use crate::math::{axes, four, front_weight, opacity_of_depth, transpose};
use crate::packet::Span;
use crate::seams::{Seams, join};
use crate::texel::Texel;

/// The largest doubt of a cell, as a difference of a colour channel. Four pieces have a quarter of that of two.
const MAX_DOUBT: f32 = 0.002;

/// Changes of the table's sums below this are none: their inverse might not be finite.
const INVISIBLE: f32 = 1e-30;

/// Light gathered so far.
pub(crate) struct Light<S: Simd> {
    pub(crate) color: [f32x16<S>; 3],
    pub(crate) transmittance: f32x16<S>,
    /// What a channel may be off by, but for the arithmetic: the doubts of all cells.
    pub(crate) doubt: f32x16<S>,
    /// The way through cells that were read from the table, in unit lengths, as it is seen: each stretch as a share of
    /// the light that comes through.
    pub(crate) table_way: f32x16<S>,
    /// What a channel may be off by where rounding says on which side of a step the field is.
    pub(crate) touching: f32x16<S>,
}

/// A brick with all that a packet needs of it.
pub(crate) struct Matter<'a, T> {
    /// Samples along x, y, z, each at least 2.
    pub(crate) samples: [u32; 3],
    pub(crate) texels: &'a [T],
    /// Faces and edges that join coarser bricks.
    pub(crate) seams: Seams,
    /// Cells per axis of a brick that the volume's end does not cut short.
    pub(crate) brick_cells: u32,
    /// Blocks that may hold matter.
    pub(crate) occupancy: &'a Occupancy,
    /// Blocks for which the table is too coarse, if there are any.
    pub(crate) exact: Option<&'a Occupancy>,
    /// Cells of a block per axis.
    pub(crate) block: u32,
}

impl<T: Texel> Matter<'_, T> {
    /// The corners of cells, which at seams have other values than the samples there.
    #[inline(always)]
    fn joined<S: Simd>(&self, simd: S, walker: &Walker<'_, S>, corners: [f32x16<S>; 8]) -> [f32x16<S>; 8] {
        if self.seams.are_none() {
            return corners;
        }
        // Called, and by copies: what is rare takes no registers from the rest.
        join(simd, self, (&walker.cell, walker.active), &corners)
    }
}

/// Classification: texel to bin to integrals.
#[derive(Clone, Copy)]
pub(crate) struct Table<'a> {
    pub(crate) entries: &'a [[f32; 4]],
    /// Texels are counted from here.
    pub(crate) texel_origin: f32,
    /// `bin = scale * texel + offset`.
    pub(crate) bin_from_texel: [f32; 2],
    /// The largest change of light per texel and unit length.
    pub(crate) slope: f32,
    pub(crate) bands: Bands<'a>,
}

/// The integrals at one end of a piece.
#[derive(Clone, Copy)]
struct End<S: Simd> {
    /// A whole number, however far beyond the table.
    bin: f32x16<S>,
    /// `[∫ r s, ∫ g s, ∫ b s, ∫ s]`.
    integrals: [f32x16<S>; 4],
}

impl Table<'_> {
    /// The bin of a texel: a whole number, however far beyond the table.
    #[inline(always)]
    fn bin<S: Simd>(&self, simd: S, texel: f32x16<S>) -> f32x16<S> {
        let [scale, offset] = self.bin_from_texel;
        texel.mul_add(f32x16::splat(simd, scale), f32x16::splat(simd, offset)).round_ties_even()
    }

    /// The end of a piece at a texel, in another bin than `from`.
    #[inline(always)]
    fn end<S: Simd>(&self, simd: S, texel: f32x16<S>, from: f32x16<S>) -> End<S> {
        let bin = self.bin(simd, texel);
        let entry = self.entry(simd, bin);
        // Two ends at one edge count as the whole bin above it: values are on the upper side of a step.
        let is_flat = bin.simd_eq(from);
        let other = is_flat.select(entry + 1, entry);
        let aside: f32x16<S> = (other - entry).to_float();
        End { bin: bin + aside, integrals: self.integrals(simd, other) }
    }

    #[inline(always)]
    fn at<S: Simd>(&self, simd: S, texel: f32x16<S>) -> End<S> {
        let bin = self.bin(simd, texel);
        End { bin, integrals: self.integrals(simd, self.entry(simd, bin)) }
    }

    #[inline(always)]
    fn entry<S: Simd>(&self, simd: S, bin: f32x16<S>) -> i32x16<S> {
        let last = (self.entries.len() - 2) as f32;
        bin.max(f32x16::splat(simd, 0.0)).min(f32x16::splat(simd, last)).to_int()
    }

    #[inline(always)]
    fn integrals<S: Simd>(&self, simd: S, entry: i32x16<S>) -> [f32x16<S>; 4] {
        let mut rows = [0.0_f32; 64];
        let entries: [i32; 16] = entry.into();
        for (lane, &entry) in entries.iter().enumerate() {
            rows[4 * lane..4 * lane + 4].copy_from_slice(&self.entries[entry as usize]);
        }
        transpose(simd, &rows)
    }
}

impl<S: Simd> Light<S> {
    #[cfg(test)]
    pub(crate) fn none(simd: S) -> Self {
        let zero = f32x16::splat(simd, 0.0);
        let transmittance = f32x16::splat(simd, 1.0);
        Self { color: [zero; 3], transmittance, doubt: zero, table_way: zero, touching: zero }
    }

    /// Adds two neighbouring pieces of one length in `lanes`. What their mean colours differ by tells how the colour
    /// runs within each, so how much more of its front is seen than of its back.
    #[inline(always)]
    fn add(&mut self, simd: S, pieces: &[Piece<S>; 2], lanes: mask32x16<S>) {
        let [a, b] = [0, 1].map(
            #[inline(always)]
            |i| lanes.select(pieces[i].depth, f32x16::splat(simd, 0.0)),
        );
        let (thin, thick) = (a.min(b), a.max(b).max(f32x16::splat(simd, INVISIBLE)));
        let ([weight_a, divisor_a], [weight_b, divisor_b]) = (front_weight(simd, a), front_weight(simd, b));
        // One division for three.
        let inverse = 1.0 / (divisor_a * divisor_b * thick);
        // Where one piece is much thinner than the other, its colour tells little of the other's.
        let trust = thin * (divisor_a * divisor_b) * inverse;
        let slope = axes(
            #[inline(always)]
            |i| (pieces[1].color(i) - pieces[0].color(i)) * trust,
        );
        let thick = inverse * thick;
        self.add_piece(simd, (&pieces[0], a), &slope, weight_a * divisor_b * thick);
        self.add_piece(simd, (&pieces[1], b), &slope, weight_b * divisor_a * thick);
    }

    /// Adds a piece of some depth, from the mean of whose colour what is seen is off by `shift` of its `slope`.
    #[inline(always)]
    fn add_piece(
        &mut self,
        simd: S,
        (piece, depth): (&Piece<S>, f32x16<S>),
        slope: &[f32x16<S>; 3],
        shift: f32x16<S>,
    ) {
        let light = self.transmittance * opacity_of_depth(simd, depth);
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
        let pieces = [Piece::new(simd, &from, &middle, length), Piece::new(simd, &middle, &end, length)];
        Self { pieces, end }
    }

    /// What the change of colour hides: within a piece the light of its front and its back are told apart by the
    /// neighbouring piece only.
    #[inline(always)]
    fn doubt(&self) -> f32x16<S> {
        let [a, b] = &self.pieces;
        let [red, green, blue] = axes(
            #[inline(always)]
            |i| (b.color(i) - a.color(i)).abs(),
        );
        let depth = a.depth.max(b.depth);
        depth * depth * red.max(green).max(blue) * (1.0 / 32.0)
    }
}

impl<S: Simd> Piece<S> {
    #[inline(always)]
    fn new(simd: S, from: &End<S>, to: &End<S>, length: f32x16<S>) -> Self {
        let bins = to.bin - from.bin;
        let [r, g, b, extinction] = four(
            #[inline(always)]
            |i| to.integrals[i] - from.integrals[i],
        );
        let (zero, one) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, 1.0));
        // So far beyond the table that two ends are one there is nothing; nor is there in a blank, which is no number.
        let is_seen = extinction.abs().simd_gt(INVISIBLE) & bins.abs().simd_gt(0.0);
        // One division for two.
        let quotient = 1.0 / is_seen.select(bins * extinction, one);
        let inverse = is_seen.select(bins * quotient, zero);
        let depth = is_seen.select(length * extinction * (extinction * quotient), zero);
        Self { light: [r, g, b], inverse, depth }
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
        Self { span, forward, cells, block: matter.block as f32, cell, depth: zero, active: span.active }
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

    /// Lanes that stand in a marked block.
    #[inline(always)]
    fn in_block(&self, simd: S, marks: &Occupancy) -> mask32x16<S> {
        let [x, y, z] = axes(
            #[inline(always)]
            |axis| (self.cell[axis] * (1.0 / self.block)).floor(),
        );
        let byte: u32x16<S> = z.mul_add(f32x16::splat(simd, 8.0), y).to_int();
        let byte: u32x16<S> =
            simd.swizzle_dyn_u8x64(u8x64::from_slice(simd, marks), byte.bitcast()).bitcast();
        let bit: u32x16<S> = x.to_int();
        ((byte >> bit) & 1).simd_ne(0) & self.active
    }

    /// Takes lanes to where they stand in blocks with matter, and returns those that moved.
    #[inline(always)]
    fn leap_empty(&mut self, simd: S, occupancy: &Occupancy) -> mask32x16<S> {
        let mut moved = mask32x16::splat(simd, false);
        loop {
            let empty = self.active & !self.in_block(simd, occupancy);
            if empty.all_false() {
                return moved;
            }
            self.leap(simd, empty);
            moved |= empty;
        }
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
            // Along the axis of exit the next cell is certain; along others, rounding must not leave the block, nor a ray
            // in the last face the brick.
            let last = (first[axis] + (size - 1.0)).min(f32x16::splat(simd, self.cells[axis] - 1.0));
            let inside = position.floor().max(first[axis]).min(last);
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

    /// Half of the product of what a lane moves along the axes, in cells, on a way of twice `half` unit lengths.
    #[inline(always)]
    fn volume(&self, half: f32x16<S>) -> f32x16<S> {
        let [x, y, z] = self.span.direction;
        (x * half) * (y * half) * (z * half) * 8.0
    }

    /// The texels at both ends of cells with these corners, anew where they lie beside an outlier.
    #[inline(always)]
    fn beside_outliers(
        &self,
        simd: S,
        (corners, texel_origin): (impl FnOnce() -> [f32x16<S>; 8], f32),
        [lanes, fresh]: [mask32x16<S>; 2],
        [first, last]: [f32x16<S>; 2],
        end: f32x16<S>,
    ) -> [f32x16<S>; 2] {
        if lanes.all_false() {
            return [first, last];
        }
        let corners = corners();
        let field = (&corners, texel_origin);
        let first = (lanes & fresh).select(self.on_faces(simd, field, self.depth), first);
        [first, lanes.select(self.on_faces(simd, field, end), last)]
    }

    /// The texel of a cell with these corners at `depth`. Beside an outlier the field a hair from a face is nothing like
    /// that on it, and places are known to a hair: those near a face count as on it, as they do for the cell on its
    /// other side, and corners without weight count for nothing.
    #[inline(always)]
    fn on_faces(
        &self,
        simd: S,
        (corners, texel_origin): (&[f32x16<S>; 8], f32),
        depth: f32x16<S>,
    ) -> f32x16<S> {
        let place = self.fraction(simd, depth);
        let [x, y, z] = axes(
            #[inline(always)]
            |axis| {
                let nearest = place[axis].round_ties_even();
                (place[axis] - nearest).abs().simd_le(PLACE_ROUNDING).select(nearest, place[axis])
            },
        );
        let mix = |a: f32x16<S>, b: f32x16<S>, w: f32x16<S>| a * (1.0 - w) + b * w;
        let lines = four(
            #[inline(always)]
            |i| mix(corners[2 * i] - texel_origin, corners[2 * i + 1] - texel_origin, x),
        );
        mix(mix(lines[0], lines[1], y), mix(lines[2], lines[3], y), z)
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

/// The way of the lanes through their cells: from where they stand to `end`, in unit lengths, `half` of it, and the texel
/// at its start, in its middle and at its end.
struct Stretch<S: Simd> {
    end: f32x16<S>,
    half: f32x16<S>,
    values: [f32x16<S>; 3],
}

/// Adds the light of one cell per lane in `lanes`, exactly in `exact` and where it must be; returns what the next cell
/// begins with.
#[inline(always)]
fn add_cell<S: Simd>(
    simd: S,
    table: Table<'_>,
    (walker, cell, stretch): (&Walker<'_, S>, &Cell<S>, &Stretch<S>),
    mut from: End<S>,
    [lanes, exact]: [mask32x16<S>; 2],
    light: &mut Light<S>,
) -> End<S> {
    let zero = f32x16::splat(simd, 0.0);
    let Stretch { end, half, values: [first, middle, last] } = *stretch;
    let over = balanced(first, middle, last);
    let distance = mean_distance(simd, first, middle, last, over);
    let twist = (cell.twist() * walker.volume(half)).abs();
    let doubt = twist.mul_add(f32x16::splat(simd, 1.0 / 32.0), distance)
        * (half * (2.0 * table.slope))
        * light.transmittance;
    let mut exact = exact | (lanes & doubt.simd_gt(4.0 * MAX_DOUBT));
    let near;
    let mut far = None;
    let (mut doubt, mut color_doubt) = (doubt, zero);
    if (lanes & !exact & doubt.simd_gt(MAX_DOUBT)).any_true() {
        let quarter = half * 0.5;
        let early = cell.value(walker.fraction(simd, walker.depth + quarter));
        let late = cell.value(walker.fraction(simd, end - quarter));
        near = Pair::new(simd, table, from, balanced(first, early, middle), middle, quarter);
        let pair = Pair::new(simd, table, near.end, balanced(middle, late, last), last, quarter);
        color_doubt = pair.doubt();
        doubt *= 0.25;
        from = pair.end;
        far = Some(pair.pieces);
    } else {
        near = Pair::new(simd, table, from, over, last, half);
        from = near.end;
    }
    let behind = light.transmittance;
    color_doubt = (color_doubt + near.doubt()) * behind;
    exact |= lanes & color_doubt.simd_gt(MAX_DOUBT);
    let read = lanes & !exact;
    light.doubt += read.select(doubt + color_doubt, zero);
    light.table_way += read.select(behind * (half + half), zero);
    if exact.any_true() {
        let [from, to] = [walker.depth, end].map(
            #[inline(always)]
            |depth| walker.fraction(simd, depth),
        );
        let (cubic, range, length) = (cell.along(from, to), cell.range(), half + half);
        let field = Field { cubic, ends: [first, last], range, length };
        add_cells(simd, table.bands, &field, exact, light);
        light.doubt += (behind - light.transmittance) * EXACT_DOUBT;
    }
    light.add(simd, &near.pieces, read);
    if let Some(pieces) = far {
        light.add(simd, &pieces, read);
    }
    from
}

/// Adds the light of one brick to a packet.
#[inline(always)]
pub(crate) fn walk<S: Simd, T: Texel>(
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
    let none = mask32x16::splat(simd, false);

    let mut walker = Walker::new(simd, span, matter);
    // Lanes whose last piece ended elsewhere than where the next begins.
    let mut fresh = walker.active;
    let mut from = table.at(simd, zero);
    let mut first = zero;
    loop {
        fresh |= walker.leap_empty(simd, matter.occupancy);
        if walker.active.all_false() {
            return;
        }
        let [x, y, z] = walker.cell;
        let address: i32x16<S> = z.mul_add(slice, y.mul_add(row, x)).to_int();
        let corners = matter.joined(simd, &walker, T::corners(simd, rows, address));
        let cell = Cell::new(corners, table.texel_origin);

        let exit = walker.exits();
        let end = exit[0].min(exit[1]).min(exit[2]).min(span.length).max(walker.depth);
        let half = (end - walker.depth) * 0.5;
        if fresh.any_true() {
            let value = cell.value(walker.fraction(simd, walker.depth));
            first = fresh.select(value, first);
            let start = table.at(simd, first);
            from.bin = fresh.select(start.bin, from.bin);
            from.integrals = four(
                #[inline(always)]
                |i| fresh.select(start.integrals[i], from.integrals[i]),
            );
        }
        let mut middle = cell.value(walker.fraction(simd, walker.depth + half));
        let mut last = cell.value(walker.fraction(simd, end));
        let mut blank = none;
        if T::CAN_BE_BLANK {
            // A blank corner makes every value of its cell NaN or infinite.
            blank = !middle.is_finite();
            middle = blank.select(zero, middle);
            last = blank.select(zero, last);
            first = blank.select(zero, first);
            from.bin = blank.select(zero, from.bin);
        }
        let lanes = walker.active & !blank;
        let mut exact = mask32x16::splat(simd, false);
        if let Some(blocks) = matter.exact {
            exact = lanes & walker.in_block(simd, blocks);
        }
        if exact.any_true() {
            // Once more: what the cell keeps of them has no digits of those beside an outlier.
            let corners = || matter.joined(simd, &walker, T::corners(simd, rows, address));
            let lanes = [exact & cell.is_wider_than(table.bands.huge), fresh];
            [first, last] =
                walker.beside_outliers(simd, (corners, table.texel_origin), lanes, [first, last], end);
        }
        let stretch = Stretch { end, half, values: [first, middle, last] };
        from = add_cell(simd, table, (&walker, &cell, &stretch), from, [lanes, exact], light);
        first = last;
        // Who was blank finds its value again.
        fresh = blank;
        walker.step(simd, &exit, end);
        walker.active &= light.transmittance.simd_gt(MIN_TRANSMITTANCE);
    }
}
