//! Fragments to light: tables, opacity, and the sum front to back.

use fearless_simd::{f32x4, f32x16, i32x16, prelude::*};
use volery_frame::Light;
use volery_frame::sheets::MAX_STRIP_DEPTH;

use super::NUM_PIXELS;
use super::raster::{Fragments, ROOM, STRIP};
use super::table::Table;
use crate::math::opacity_of_depth;
use crate::target::Rows;

/// A direction whose square is below this has no shade.
const MIN_SQUARE: f32 = 1e-20;

/// Entries of sixteen fragments.
struct Entries {
    /// `[r, g, b, -1]`.
    colors: [[f32; 4]; 16],
    extinctions: [f32; 16],
}

/// What fragments of a tile become light by.
pub(super) struct Shading<'a> {
    pub(super) table: &'a Table,
    pub(super) light: Option<Light>,
    /// Length in a sheet over its thickness, by pixel.
    pub(super) obliquities: &'a [f32; NUM_PIXELS],
}

impl Shading<'_> {
    /// Puts the fragments behind what pixels have seen, and forgets them.
    #[inline(always)]
    pub(super) fn composite<S: Simd, const N: usize>(
        &self,
        simd: S,
        fragments: &mut Fragments<N>,
        pixels: &mut Rows,
    ) {
        let mut entries = Entries { colors: [[0.0; 4]; 16], extinctions: [0.0; 16] };
        for start in (0..fragments.len).step_by(16).take_while(|start| start + 16 <= ROOM) {
            let attribute = |i: usize| &fragments.attributes[i.min(N - 1)][start..start + 16];
            if self.table.rows == 1 {
                entries.of_values(simd, self.table, attribute(0));
            } else {
                entries.of_values_and_magnitudes(simd, self.table, attribute(0), attribute(2));
            }
            if let (Some(light), 6) = (self.light, N) {
                entries.shade(simd, &light, [attribute(3), attribute(4), attribute(5)]);
            }
            let mut places = [0; 16];
            let (mut obliquities, mut most) = ([0.0; 16], [f32::MAX; 16]);
            for lane in 0..16 {
                // Of no fragment, a number of another.
                places[lane] = fragments.pixels[start + lane] as usize % NUM_PIXELS;
                obliquities[lane] = self.obliquities[places[lane]];
                if fragments.pixels[start + lane] >= STRIP {
                    most[lane] = MAX_STRIP_DEPTH;
                }
            }
            let lengths = f32x16::from_slice(simd, attribute(1)) * f32x16::from_slice(simd, &obliquities);
            let depth = lengths * f32x16::from_slice(simd, &entries.extinctions);
            let depth = depth.min(f32x16::from_slice(simd, &most));
            let opacity = opacity_of_depth(simd, depth.max(f32x16::splat(simd, -MAX_STRIP_DEPTH)));
            let opacities: [f32; 16] = opacity.into();
            for lane in 0..(fragments.len - start).min(16) {
                let pixel = &mut pixels[places[lane]];
                let share = f32x4::splat(simd, pixel[3] * opacities[lane]);
                let color = f32x4::from_slice(simd, &entries.colors[lane]);
                *pixel = color.mul_add(share, f32x4::from_slice(simd, pixel)).into();
            }
        }
        fragments.len = 0;
    }
}

/// The entry before each number, and how far the number is behind it.
#[inline(always)]
fn places<S: Simd>(
    simd: S,
    numbers: &[f32],
    [scale, offset]: [f32; 2],
    count: usize,
) -> ([i32; 16], [f32; 16]) {
    let at =
        f32x16::from_slice(simd, numbers).mul_add(f32x16::splat(simd, scale), f32x16::splat(simd, offset));
    // What is not a number is at the first.
    let at =
        at.simd_gt(0.0).select(at, f32x16::splat(simd, 0.0)).min(f32x16::splat(simd, (count - 1) as f32));
    let low = at.floor().min(f32x16::splat(simd, (count - 2) as f32));
    let index: i32x16<S> = low.to_int();
    (index.into(), (at - low).into())
}

impl Entries {
    #[inline(always)]
    fn of_values<S: Simd>(&mut self, simd: S, table: &Table, values: &[f32]) {
        let (columns, shares) = places(simd, values, table.column_from_value, table.columns);
        for lane in 0..16 {
            let (column, share) = (columns[lane] as usize, shares[lane]);
            let a = f32x4::from_slice(simd, &table.colors[column]);
            let b = f32x4::from_slice(simd, &table.colors[column + 1]);
            self.colors[lane] = (b - a).mul_add(f32x4::splat(simd, share), a).into();
            let [a, b] = [table.extinctions[column], table.extinctions[column + 1]];
            self.extinctions[lane] = (b - a).mul_add(share, a);
        }
    }

    #[inline(always)]
    fn of_values_and_magnitudes<S: Simd>(
        &mut self,
        simd: S,
        table: &Table,
        values: &[f32],
        magnitudes: &[f32],
    ) {
        let (columns, across) = places(simd, values, table.column_from_value, table.columns);
        let (rows, down) = places(simd, magnitudes, table.row_from_magnitude, table.rows);
        for lane in 0..16 {
            let place = rows[lane] as usize * table.columns + columns[lane] as usize;
            let mut color = [f32x4::splat(simd, 0.0); 2];
            let mut extinction = [0.0; 2];
            for row in 0..2 {
                let place = place + row * table.columns;
                let a = f32x4::from_slice(simd, &table.colors[place]);
                let b = f32x4::from_slice(simd, &table.colors[place + 1]);
                color[row] = (b - a).mul_add(f32x4::splat(simd, across[lane]), a);
                let [a, b] = [table.extinctions[place], table.extinctions[place + 1]];
                extinction[row] = (b - a).mul_add(across[lane], a);
            }
            let [a, b] = color;
            self.colors[lane] = (b - a).mul_add(f32x4::splat(simd, down[lane]), a).into();
            self.extinctions[lane] = (extinction[1] - extinction[0]).mul_add(down[lane], extinction[0]);
        }
    }

    /// Lights the colours.
    #[inline(always)]
    fn shade<S: Simd>(&mut self, simd: S, light: &Light, direction: [&[f32]; 3]) {
        let mut along = f32x16::splat(simd, 0.0);
        let mut square = f32x16::splat(simd, 0.0);
        for (part, toward) in direction.into_iter().zip(light.toward) {
            let part = f32x16::from_slice(simd, part);
            along = part.mul_add(f32x16::splat(simd, toward), along);
            square = part.mul_add(part, square);
        }
        let has_direction = square.simd_gt(MIN_SQUARE);
        let cosine = along.abs() / square.max(f32x16::splat(simd, MIN_SQUARE)).sqrt();
        let lit = cosine.mul_add(f32x16::splat(simd, light.diffuse), f32x16::splat(simd, light.ambient));
        let shades: [f32; 16] = has_direction.select(lit, f32x16::splat(simd, 1.0)).into();
        for (color, shade) in self.colors.iter_mut().zip(shades) {
            let [r, g, b, minus_one] = *color;
            *color = [r * shade, g * shade, b * shade, minus_one];
        }
    }
}
