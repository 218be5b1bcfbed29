//! Cubes of constant matter: every tile composites its own, front to back, sixteen pixels at a time.
//!
//! # Method
//! `bins` finds the packets of four by four pixels that each cube can show in, and lists cubes by tile. A tile walks
//! its list from the front. The length of a ray in a cube comes by one of two ways:
//!
//! - [`Thickness::Exact`]: slabs. The fans of a cube cover its silhouette exactly once and know the chord in every
//!   fragment (proven in `volery-cubefan`); the rays with a chord above 0 are the silhouette, so six planes per packet
//!   are the very same, and cheaper than ten vertices where a cube is a few pixels large.
//! - [`Thickness::Interpolated`]: the fans' triangles, rasterised by `fan_raster`. A cube with a vertex behind the
//!   plane of the eye, or more than 2^17 pixels away, is drawn by slabs, and so is one that the eye is in.
//!
//! # Arithmetic
//! A lattice plane `i` is crossed at `t(i) = i / d - p / d`, `p` the place where the ray enters the domain, found in
//! f64: one fused operation in f32, whose error is some 1e-7 of the domain however far the eye is. It is a function of
//! plane and ray alone, so a ray leaves one cube at the bits at which it enters the next: no gap, no overlap. A ray in
//! a plane passes on one side of it, the same one for all cubes.
//!
//! # Error
//! Sums are in f32, opacity by `expm1`. A packet ends when all of its rays let less than [`MIN_TRANSMITTANCE`]
//! through.
//!
//! # Cost
//! 8 bytes per cube and tile beside the cubes. See `docs/fans.md` for times.

mod bins;
mod fan_raster;
mod view;

use fearless_simd::{Level, dispatch, f32x16, prelude::*};
use volery_frame::{Cube, Cubes, Thickness, VolumeLayout};

use crate::MIN_TRANSMITTANCE;
use crate::math::{axes, opacity_of_depth};
use crate::surfaces::Surfaces;
use crate::target::{Light, NUM_PACKETS, PACKET, TILE_PACKETS, Target, Tile};
use bins::Bins;
use fan_raster::Raster;
use view::{PacketRays, View};

/// Draws a checked part.
pub(crate) fn draw(level: Level, target: &mut Target, content: &Cubes<'_>, layout: &VolumeLayout) {
    let view = View::new(&target.view, layout);
    let bins = Bins::new(level, content.cubes, layout, &view);
    let (view, bins) = (&view, &bins);
    target.draw_tiles(|surfaces, number, first, tile| {
        let shared = Shared { surfaces, content, layout, view, bins };
        dispatch!(level, simd => draw_tile(simd, &shared, number, first, tile));
    });
}

/// All that tiles share.
struct Shared<'a> {
    surfaces: &'a Surfaces,
    content: &'a Cubes<'a>,
    layout: &'a VolumeLayout,
    view: &'a View,
    bins: &'a Bins,
}

/// Draws one tile, whole even where it reaches over the edge of the picture.
#[inline(always)]
fn draw_tile<S: Simd>(simd: S, shared: &Shared<'_>, number: u32, first: [u32; 2], tile: &mut Tile) {
    if shared.bins.is_empty(number) {
        return;
    }
    let mut rays = Vec::with_capacity(NUM_PACKETS);
    for packet in 0..NUM_PACKETS as u32 {
        let [x, y] = [packet % TILE_PACKETS, packet / TILE_PACKETS];
        rays.push(shared.view.packet(first[0] + x * PACKET, first[1] + y * PACKET, shared.surfaces));
    }
    let light = tile.light();
    let mut raster = match shared.content.thickness {
        Thickness::Exact => None,
        Thickness::Interpolated => Some(Raster::new(shared.view, first)),
    };
    // A packet is open while one of its rays wants more.
    let is_open =
        |packet: usize| light[packet][3].iter().any(|&transmittance| transmittance > MIN_TRANSMITTANCE);
    let mut open = (0..NUM_PACKETS).fold(0_u64, |open, packet| open | u64::from(is_open(packet)) << packet);
    for (cubes, entries) in shared.bins.front_to_back(shared.content.cubes, number) {
        for entry in entries.iter().rev() {
            let cube = &cubes[entry.cube as usize];
            let bounds = cube.lattice_bounds(shared.layout);
            let lengths = raster.as_mut().and_then(|raster| raster.lengths(bounds, entry));
            let matter = Matter::new(simd, cube, bounds, shared.view.unit_length());
            let mut wanted = entry.packets() & open;
            while wanted != 0 {
                let packet = wanted.trailing_zeros() as usize;
                wanted &= wanted - 1;
                let length = match lengths {
                    None => matter.length(simd, &rays[packet]),
                    Some(lengths) => {
                        let length = f32x16::from_slice(simd, &lengths[packet]);
                        // What is left of it before a surface.
                        length.min(matter.length_to_end(simd, &rays[packet]))
                    }
                };
                if matter.add(simd, length, &mut light[packet]) {
                    open &= !(1 << packet);
                }
            }
            if open == 0 {
                return;
            }
        }
    }
}

/// A cube as packets meet it.
struct Matter<S: Simd> {
    low: [f32x16<S>; 3],
    high: [f32x16<S>; 3],
    color: [f32; 3],
    depth_per_length: f32,
}

impl<S: Simd> Matter<S> {
    #[inline(always)]
    fn new(simd: S, cube: &Cube, [low, high]: [[i32; 3]; 2], unit_length: f32) -> Self {
        Self {
            low: axes(
                #[inline(always)]
                |axis| f32x16::splat(simd, low[axis] as f32),
            ),
            high: axes(
                #[inline(always)]
                |axis| f32x16::splat(simd, high[axis] as f32),
            ),
            color: cube.color,
            // Finite, so that no length of 0 makes a NaN.
            depth_per_length: (cube.extinction * unit_length).min(f32::MAX),
        }
    }

    /// Where the rays enter and leave the cube, in unit lengths; they miss it if they enter behind where they leave.
    #[inline(always)]
    fn depths(&self, simd: S, rays: &PacketRays) -> [f32x16<S>; 2] {
        let [x, y, z] = axes(
            #[inline(always)]
            |axis| {
                let per_step = f32x16::from_slice(simd, &rays.length_per_step[axis]);
                let at_origin = f32x16::from_slice(simd, &rays.at_origin[axis]);
                let a = self.low[axis].mul_add(per_step, at_origin);
                let b = self.high[axis].mul_add(per_step, at_origin);
                (a.min(b), a.max(b))
            },
        );
        [x.0.max(y.0).max(z.0).max(f32x16::splat(simd, 0.0)), x.1.min(y.1).min(z.1)]
    }

    /// How long the rays are in the cube, in unit lengths; 0 or below where they miss it.
    #[inline(always)]
    fn length(&self, simd: S, rays: &PacketRays) -> f32x16<S> {
        let [enter, leave] = self.depths(simd, rays);
        leave.min(f32x16::from_slice(simd, &rays.end)) - enter
    }

    /// How long they are from where they enter it to where they end.
    #[inline(always)]
    fn length_to_end(&self, simd: S, rays: &PacketRays) -> f32x16<S> {
        f32x16::from_slice(simd, &rays.end) - self.depths(simd, rays)[0]
    }

    /// Puts the cube behind what a packet has seen; whether no ray wants more.
    #[inline(always)]
    fn add(&self, simd: S, length: f32x16<S>, light: &mut Light) -> bool {
        if length.simd_gt(0.0).all_false() {
            return false;
        }
        let length = length.max(f32x16::splat(simd, 0.0));
        let opacity = opacity_of_depth(simd, length * self.depth_per_length);
        let transmittance = f32x16::from_slice(simd, &light[3]);
        let share = opacity * transmittance;
        for (light, color) in light.iter_mut().zip(self.color) {
            let sum = f32x16::from_slice(simd, light);
            *light = share.mul_add(f32x16::splat(simd, color), sum).into();
        }
        let rest = transmittance - share;
        light[3] = rest.into();
        rest.simd_gt(MIN_TRANSMITTANCE).all_false()
    }
}
