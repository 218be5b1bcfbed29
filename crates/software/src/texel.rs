//! Texel types, and how a packet fetches the eight corners of a cell.

use fearless_simd::{f32x16, i32x16, prelude::*, u32x16};
use volery_frame::Texels;

use crate::math::four;

/// A texel type that the executor stores and samples.
pub(crate) trait Texel: Copy + Default + PartialOrd + Send + Sync + std::fmt::Debug + 'static {
    /// Whether a texel can be blank (NaN).
    const CAN_BE_BLANK: bool;

    fn to_f32(self) -> f32;

    /// The texels of a brick, if they are of this type.
    fn of(texels: Texels<'_>) -> Option<&[Self]>;

    /// The range of no texel at all: the largest first.
    const EMPTY_RANGE: [Self; 2];

    /// The range that a texel also is in; a blank one changes nothing.
    fn include(range: [Self; 2], texel: Self) -> [Self; 2];

    /// The corners of one cell per lane. `rows` are four views of one brick, of the same length: the row of
    /// the cell's lower corner, the row above it, and the same two one slice further; `at` is the offset of
    /// the lower corner in a row. Corner `x + 2 y + 4 z` is at that index.
    fn corners<S: Simd>(simd: S, rows: [&[Self]; 4], at: i32x16<S>) -> [f32x16<S>; 8];
}

/// The four bytes of each lane as floats.
#[inline(always)]
fn bytes<S: Simd>(simd: S, packed: u32x16<S>) -> [f32x16<S>; 4] {
    let mask = u32x16::splat(simd, 0xff);
    [
        (packed & mask).to_float(),
        ((packed >> 8) & mask).to_float(),
        ((packed >> 16) & mask).to_float(),
        (packed >> 24).to_float(),
    ]
}

/// The two halves of each lane as floats.
#[inline(always)]
fn halves<S: Simd>(simd: S, packed: u32x16<S>) -> [f32x16<S>; 2] {
    let mask = u32x16::splat(simd, 0xffff);
    [(packed & mask).to_float(), (packed >> 16).to_float()]
}

impl Texel for u8 {
    const CAN_BE_BLANK: bool = false;
    const EMPTY_RANGE: [Self; 2] = [u8::MAX, u8::MIN];

    #[inline(always)]
    fn to_f32(self) -> f32 {
        f32::from(self)
    }

    fn of(texels: Texels<'_>) -> Option<&[Self]> {
        if let Texels::U8(texels) = texels { Some(texels) } else { None }
    }

    #[inline(always)]
    fn include([low, high]: [Self; 2], texel: Self) -> [Self; 2] {
        [low.min(texel), high.max(texel)]
    }

    #[inline(always)]
    fn corners<S: Simd>(simd: S, rows: [&[u8]; 4], at: i32x16<S>) -> [f32x16<S>; 8] {
        // One length for all rows, so that one check of bounds serves all.
        let [r0, r1, r2, r3] = rows;
        let n = r0.len();
        let (r1, r2, r3) = (&r1[..n], &r2[..n], &r3[..n]);
        let at: [i32; 16] = at.into();
        let (mut near, mut far) = ([0_u32; 16], [0_u32; 16]);
        for lane in 0..16 {
            let i = at[lane] as usize;
            let pair = |row: &[u8]| u32::from(u16::from_le_bytes([row[i], row[i + 1]]));
            near[lane] = pair(r0) | pair(r1) << 16;
            far[lane] = pair(r2) | pair(r3) << 16;
        }
        let [a, b, c, d] = bytes(simd, u32x16::from_slice(simd, &near));
        let [e, f, g, h] = bytes(simd, u32x16::from_slice(simd, &far));
        [a, b, c, d, e, f, g, h]
    }
}

impl Texel for u16 {
    const CAN_BE_BLANK: bool = false;
    const EMPTY_RANGE: [Self; 2] = [u16::MAX, u16::MIN];

    #[inline(always)]
    fn to_f32(self) -> f32 {
        f32::from(self)
    }

    fn of(texels: Texels<'_>) -> Option<&[Self]> {
        if let Texels::U16(texels) = texels { Some(texels) } else { None }
    }

    #[inline(always)]
    fn include([low, high]: [Self; 2], texel: Self) -> [Self; 2] {
        [low.min(texel), high.max(texel)]
    }

    #[inline(always)]
    fn corners<S: Simd>(simd: S, rows: [&[u16]; 4], at: i32x16<S>) -> [f32x16<S>; 8] {
        let [r0, r1, r2, r3] = rows;
        let n = r0.len();
        let (r1, r2, r3) = (&r1[..n], &r2[..n], &r3[..n]);
        let at: [i32; 16] = at.into();
        let mut pairs = [[0_u32; 16]; 4];
        for lane in 0..16 {
            let i = at[lane] as usize;
            let pair = |row: &[u16]| u32::from(row[i]) | u32::from(row[i + 1]) << 16;
            pairs[0][lane] = pair(r0);
            pairs[1][lane] = pair(r1);
            pairs[2][lane] = pair(r2);
            pairs[3][lane] = pair(r3);
        }
        let [[a, b], [c, d], [e, f], [g, h]] = four(
            #[inline(always)]
            |i| halves(simd, u32x16::from_slice(simd, &pairs[i])),
        );
        [a, b, c, d, e, f, g, h]
    }
}

impl Texel for f32 {
    const CAN_BE_BLANK: bool = true;
    const EMPTY_RANGE: [Self; 2] = [f32::INFINITY, f32::NEG_INFINITY];

    #[inline(always)]
    fn to_f32(self) -> f32 {
        self
    }

    fn of(texels: Texels<'_>) -> Option<&[Self]> {
        if let Texels::F32(texels) = texels { Some(texels) } else { None }
    }

    #[inline(always)]
    fn include([low, high]: [Self; 2], texel: Self) -> [Self; 2] {
        if texel.is_finite() { [low.min(texel), high.max(texel)] } else { [low, high] }
    }

    #[inline(always)]
    fn corners<S: Simd>(simd: S, rows: [&[f32]; 4], at: i32x16<S>) -> [f32x16<S>; 8] {
        let [r0, r1, r2, r3] = rows;
        let n = r0.len();
        let (r1, r2, r3) = (&r1[..n], &r2[..n], &r3[..n]);
        let at: [i32; 16] = at.into();
        let mut corners = [[0.0_f32; 16]; 8];
        for lane in 0..16 {
            let i = at[lane] as usize;
            for (pair, row) in [r0, r1, r2, r3].into_iter().enumerate() {
                corners[2 * pair][lane] = row[i];
                corners[2 * pair + 1][lane] = row[i + 1];
            }
        }
        let [[a, b], [c, d], [e, f], [g, h]] = four(
            #[inline(always)]
            |i| {
                let [even, odd] = [&corners[2 * i], &corners[2 * i + 1]];
                [f32x16::from_slice(simd, even), f32x16::from_slice(simd, odd)]
            },
        );
        [a, b, c, d, e, f, g, h]
    }
}
