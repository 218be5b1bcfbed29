//! Executes frames on the CPU: all cores, SIMD, no driver.
//!
//! # Method
//! The picture is cut into tiles, which rayon hands to the cores. A tile knows which bricks its rays can
//! meet, in visibility order. Its rays go in packets of 16, four by four pixels, one ray per SIMD lane;
//! [`fearless_simd`] chooses AVX-512, AVX2, SSE, NEON or WebAssembly when the program runs.
//!
//! All rays of a packet meet the same brick together, so the brick's address, level and size are scalars.
//! The ray's entry into a brick is computed in f64 and only then rounded to f32 relative to the brick, so
//! that an eye 1e6 cells away loses nothing. In the brick (see `walk`) each lane goes from cell to cell of
//! its own: within a cell the trilinear field along the ray is a cubic, evaluated at the cell's entry, middle
//! and exit from one fetch of eight corners, and the two halves are integrated through the
//! [`RayTransfer`](volery_frame::RayTransfer).
//!
//! Empty space costs little: a brick keeps the range of each of its blocks, 8x8x8 of them; a frame marks those
//! that may hold matter under its transfer function, 512 bits in one SIMD register; lanes leap over the others.
//!
//! Cutting planes need no walk: `plane` finds the place that each pixel of a packet sees of each plane, nearest
//! first, and samples together the lanes that one brick holds; `plane_field` is that brick's field. An oblique plane
//! through 512^3 samples of 8 bits (bench `plane`, 2 cores of a shared machine): 5.2 ms for 512x512 pixels, 15 ms for
//! 1024x1024, within 2e-6 of f64.
//!
//! Cubes of constant matter are sorted by tile and composited sixteen pixels at a time, see `cubes`: 30 million per
//! second on those 2 cores, where they are two pixels large.
//!
//! Opaque surfaces come first, see `surfaces`: where a pixel's ray meets the nearest, everything else ends for it.
//! A frame without meshes pays one comparison of depths per brick and packet.
//!
//! # Error
//! A half cell is integrated as if the field were linear over it: of second order in the size of a cell, and nothing at
//! all along the axes, where the field is linear. The straight lines are laid so that their means are those of the
//! field, and what the colours of neighbouring pieces differ by tells how much more of a piece's front is seen than of
//! its back. What that may be off by is known per cell (see `walk`): where it is above .002 the packet takes quarters,
//! above .008 or where the table is too coarse the cell is integrated as the cubic that it is, from control point to
//! control point (`exact`). So hard cells cost three to five times as much as others, and easy ones nothing. Values are
//! rounded to the table's bins (1/8192 of what can be seen). A ray ends when less than [`MIN_TRANSMITTANCE`] of what
//! lies behind can come through, and that rest is dropped. Sums are in f32. Each picture says what all that may come to:
//! [`RayDoubt`].
//!
//! # Guarantees
//! The same bits for any number of threads. No `unsafe`.

mod brick;
mod cell;
mod cubes;
mod exact;
mod math;
mod packet;
mod plane;
mod plane_field;
mod pool;
mod sheets;
mod surfaces;
mod texel;
mod tile;
mod walk;

use fearless_simd::Level;
use volery_frame::backend::check_frame;
use volery_frame::{
    Backend, Brick, BrickId, Content, Device, DeviceKind, DrawError, Drawn, Frame, Image, RayDoubt,
    UploadError, VolumeLayout,
};

use crate::pool::{Pool, for_bricks};
use crate::surfaces::Surfaces;

/// A ray ends when its transmittance falls below this.
pub const MIN_TRANSMITTANCE: f32 = 1.0 / 4096.0;

/// Most pixels of a picture per axis.
pub const MAX_SIZE: u32 = 65_536;

/// Most cells of a brick per axis: addresses of samples are exact in f32.
pub const MAX_BRICK_CELLS: u32 = 254;

/// The CPU executor. Uses the current rayon thread pool.
#[derive(Debug)]
pub struct SoftwareBackend {
    level: Level,
    volume: Option<(VolumeLayout, Pool)>,
}

impl Default for SoftwareBackend {
    fn default() -> Self {
        Self::new()
    }
}

impl SoftwareBackend {
    /// An executor for the best instruction set of this machine.
    pub fn new() -> Self {
        Self { level: Level::new(), volume: None }
    }

    /// The pixels of a checked frame.
    fn pixels(&self, frame: &Frame<'_>) -> Result<(Vec<[f32; 3]>, Option<RayDoubt>), DrawError> {
        let surfaces = Surfaces::new(frame);
        let scene = (frame, &surfaces);
        if let Content::Sheets(content) = &frame.content {
            return Ok((sheets::draw(self.level, scene, content), None));
        }
        let (layout, pool) = self.volume.as_ref().ok_or(DrawError::NoVolume)?;
        let pixels = match &frame.content {
            Content::Rays(rays) => {
                let (pixels, doubt) =
                    for_bricks!(pool, |bricks| tile::draw(self.level, scene, rays, layout, bricks))?;
                return Ok((pixels, Some(doubt)));
            }
            Content::Cubes(content) => cubes::draw(self.level, scene, content, layout),
            Content::Planes(planes) => match pool {
                Pool::U8(bricks) => plane::draw::<_, 1>(self.level, scene, planes, layout, bricks)?,
                Pool::U16(bricks) => plane::draw::<_, 1>(self.level, scene, planes, layout, bricks)?,
                Pool::F32(bricks) => plane::draw::<_, 1>(self.level, scene, planes, layout, bricks)?,
                Pool::Colors(bricks) => plane::draw::<_, 4>(self.level, scene, planes, layout, bricks)?,
            },
            // Sheets belong to no volume.
            Content::Sheets(content) => sheets::draw(self.level, scene, content),
        };
        Ok((pixels, None))
    }
}

impl Backend for SoftwareBackend {
    fn device(&self) -> Device {
        let name = format!("{:?}", self.level);
        let set = name.split('(').next().unwrap_or_default().to_lowercase();
        let threads = rayon::current_num_threads();
        let plural = if threads == 1 { "" } else { "s" };
        Device { kind: DeviceKind::Software, name: format!("CPU, {set}, {threads} thread{plural}") }
    }

    fn set_volume(&mut self, layout: &VolumeLayout) -> Result<(), UploadError> {
        if !(1..=MAX_BRICK_CELLS).contains(&layout.brick_cells) {
            return Err(UploadError::Device(format!(
                "bricks of {} cells, expected 1 to {MAX_BRICK_CELLS}",
                layout.brick_cells
            )));
        }
        self.volume = Some((*layout, Pool::new(layout.texel)));
        Ok(())
    }

    fn is_resident(&self, id: BrickId) -> bool {
        self.volume.as_ref().is_some_and(|(_, pool)| pool.contains(id))
    }

    fn upload(&mut self, bricks: &[Brick<'_>]) -> Result<(), UploadError> {
        let Some(first) = bricks.first() else { return Ok(()) };
        let (layout, pool) = self.volume.as_mut().ok_or(UploadError::NoVolume { id: first.id })?;
        bricks.iter().try_for_each(|brick| brick::check(brick, layout))?;
        pool.insert(bricks, brick::block_cells(layout.brick_cells));
        Ok(())
    }

    fn resident_bytes(&self) -> u64 {
        self.volume.as_ref().map_or(0, |(_, pool)| pool.bytes())
    }

    fn draw(&mut self, frame: &Frame<'_>) -> Result<Drawn, DrawError> {
        check_frame(frame, self.volume.as_ref().map(|(layout, _)| layout), MAX_SIZE)?;
        let (pixels, ray_doubt) = self.pixels(frame)?;
        let image = Image { width: frame.width, height: frame.height, pixels };
        Ok(Drawn { image, device_seconds: None, ray_doubt })
    }
}

#[cfg(test)]
mod tests {
    use volery_frame::conformance;

    use super::*;

    /// Every instruction set of this machine but the best, which `tests/conformance.rs` runs.
    fn lesser_levels() -> Vec<Level> {
        let best = Level::new();
        #[cfg(target_arch = "x86_64")]
        let levels =
            [best.as_avx2().map(Level::Avx2), best.as_sse4_2().map(Level::Sse4_2), Some(Level::baseline())];
        #[cfg(not(target_arch = "x86_64"))]
        let levels = [Some(Level::baseline())];
        levels.into_iter().flatten().collect()
    }

    #[test]
    fn every_instruction_set_passes_the_conformance_suite() {
        for level in lesser_levels() {
            for (name, property) in conformance::ALL {
                println!("{level:?}: {name}");
                property(&mut SoftwareBackend { level, volume: None });
            }
        }
    }
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
