//! Executes frames on the CPU: all cores, SIMD, no driver.
//!
//! # Method
//! The picture is cut into tiles, which rayon hands to the cores. A tile keeps from part to part what its pixels have
//! gathered and what light is left, see `target`. It knows which bricks its rays can meet, in visibility order. Its rays go in packets of 16, four by four pixels, one ray per SIMD lane;
//! [`fearless_simd`] chooses AVX-512, AVX2, SSE, NEON or WebAssembly when the program runs.
//!
//! All rays of a packet meet the same brick together, so the brick's address, level and size are scalars.
//! The ray's entry into a brick is computed in f64 and only then rounded to f32 relative to the brick, so
//! that an eye 1e6 cells away loses nothing. In the brick (see `walk`) each lane goes from cell to cell of
//! its own: within a cell the trilinear field along the ray is a cubic, evaluated at the cell's entry, middle
//! and exit from one fetch of eight corners, and the two halves are integrated through the
//! [`RayTransfer`](volery_frame::RayTransfer).
//!
//! Empty space costs little: a brick keeps the range of each of its blocks, 8x8x8 of them; those that may hold matter
//! are marked once per transfer function, 512 bits in one SIMD register; lanes leap over the others.
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
//! [`RayDoubt`](volery_frame::RayDoubt).
//!
//! # Guarantees
//! The same bits for any number of threads, and for any parts of a picture but those of sheets where a tile ends early
//! (`sheets`). No `unsafe`.

mod brick;
mod cell;
mod cubes;
mod exact;
mod math;
mod packet;
mod plane;
mod plane_field;
mod pool;
mod seams;
mod sheets;
mod surfaces;
mod target;
mod texel;
mod tile;
mod walk;

use std::time::Instant;

use fearless_simd::Level;
use volery_frame::backend::{check_content, check_view, check_window, check_windows};
use volery_frame::{
    Backend, Brick, BrickId, Content, Device, DeviceKind, DrawError, Drawn, FinishedPart, Frame, PictureView,
    Revision, UploadError, UploadedBytes, VolumeLayout, Window,
};

use crate::pool::{Pool, for_bricks};
use crate::target::Target;

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
    planes: plane::Kept,
    sheets: sheets::Kept,
    picture: Option<Target>,
    /// What it took so far.
    seconds: f64,
    finished: Vec<FinishedPart>,
    in_place_of: Option<String>,
}

impl Default for SoftwareBackend {
    fn default() -> Self {
        Self::new()
    }
}

impl SoftwareBackend {
    /// An executor for the best instruction set of this machine.
    pub fn new() -> Self {
        Self::of_level(Level::new())
    }

    /// An executor that draws because something better does not, for this reason: its device says so.
    pub fn in_place_of(reason: String) -> Self {
        Self { in_place_of: Some(reason), ..Self::new() }
    }

    fn of_level(level: Level) -> Self {
        Self {
            level,
            volume: None,
            planes: plane::Kept::default(),
            sheets: sheets::Kept::default(),
            picture: None,
            seconds: 0.0,
            finished: Vec::new(),
            in_place_of: None,
        }
    }

    /// Adds a part to the picture; whether it is the only one makes no difference but to what ends early.
    fn draw_some(&mut self, content: &Content<'_>, is_whole: bool) -> Result<u32, DrawError> {
        let start = Instant::now();
        let target = self.picture.as_mut().ok_or(DrawError::NoPicture)?;
        let volume = self.volume.as_ref();
        check_content(content, volume.map(|(layout, _)| layout))?;
        let level = self.level;
        match (content, volume) {
            (Content::Sheets(content), _) => {
                sheets::draw(level, &mut self.sheets, target, content, is_whole);
                target.shown.add_sheets(content.emitted());
            }
            (_, None) => return Err(DrawError::NoVolume),
            (Content::Rays(rays), Some((layout, pool))) => {
                for_bricks!(pool, |bricks| tile::draw(level, target, rays, layout, bricks))?;
                target.shown.add_rays();
            }
            (Content::Planes(planes), Some((layout, pool))) => {
                let kept = &mut self.planes;
                match pool {
                    Pool::U8(bricks) => plane::draw::<_, 1>(level, kept, target, planes, (layout, bricks))?,
                    Pool::U16(bricks) => plane::draw::<_, 1>(level, kept, target, planes, (layout, bricks))?,
                    Pool::F32(bricks) => plane::draw::<_, 1>(level, kept, target, planes, (layout, bricks))?,
                    Pool::Colors(bricks) => {
                        plane::draw::<_, 4>(level, kept, target, planes, (layout, bricks))?
                    }
                }
                target.shown.add_planes();
            }
            (Content::Cubes(cubes), Some((layout, _))) => {
                cubes::draw(level, target, cubes, layout);
                target.shown.add_cubes();
            }
        }
        let first = target.shown.num_parts - 1;
        let seconds = start.elapsed().as_secs_f64();
        self.seconds += seconds;
        let mut finish = |number, seconds| {
            self.finished.push(FinishedPart { number, device_seconds: Some(seconds) });
        };
        if target.windows.is_empty() {
            finish(first, seconds);
            return Ok(first);
        }
        // Windows that are drawn at one time share its seconds.
        let sum: f64 = target.window_seconds.iter().sum();
        for (number, of_threads) in (first..).zip(&target.window_seconds) {
            let share = if sum > 0.0 { of_threads / sum } else { 1.0 / target.windows.len() as f64 };
            finish(number, share * seconds);
        }
        target.shown.num_parts = first + target.windows.len() as u32;
        Ok(first)
    }
}

impl Backend for SoftwareBackend {
    fn device(&self) -> Device {
        let name = format!("{:?}", self.level);
        let set = name.split('(').next().unwrap_or_default().to_lowercase();
        let threads = rayon::current_num_threads();
        let plural = if threads == 1 { "" } else { "s" };
        let name = format!("CPU, {set}, {threads} thread{plural}");
        Device { kind: DeviceKind::Software, name, in_place_of: self.in_place_of.clone() }
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

    fn volume(&self) -> Option<Revision> {
        self.volume.as_ref().map(|(layout, _)| layout.revision)
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

    fn evict(&mut self, bricks: &[BrickId]) {
        if let Some((_, pool)) = &mut self.volume {
            pool.remove(bricks);
        }
    }

    fn resident_bytes(&self) -> u64 {
        self.volume.as_ref().map_or(0, |(_, pool)| pool.bytes())
    }

    fn brick_bytes(&self, layout: &VolumeLayout, samples: [u32; 3]) -> u64 {
        Pool::brick_bytes(layout.texel, samples, brick::block_cells(layout.brick_cells))
    }

    /// Without one brick on its way.
    fn room(&self, layout: &VolumeLayout, max_bytes: u64) -> u64 {
        max_bytes.saturating_sub(self.brick_bytes(layout, [layout.brick_cells.saturating_add(1); 3]))
    }

    /// Bricks take what they need when they come.
    fn reserve(&mut self, _num_bricks: usize, _max_bytes: u64) -> Result<(), UploadError> {
        Ok(())
    }

    fn uploaded_bytes(&self) -> UploadedBytes {
        UploadedBytes::default()
    }

    fn begin(&mut self, view: &PictureView<'_>) -> Result<(), DrawError> {
        let start = Instant::now();
        self.picture = None;
        self.finished.clear();
        check_view(view, MAX_SIZE)?;
        self.picture = Some(Target::new(view));
        self.seconds = start.elapsed().as_secs_f64();
        Ok(())
    }

    fn begin_windows(&mut self, view: &PictureView<'_>, side: u32) -> Result<(), DrawError> {
        self.begin(view)?;
        let checked = check_windows(view, side);
        self.picture = self.picture.take().filter(|_| checked.is_ok());
        if let Some(picture) = &mut self.picture {
            picture.window_side = Some(side);
        }
        checked.map(drop)
    }

    fn draw_windows(&mut self, content: &Content<'_>, windows: &[Window]) -> Result<u32, DrawError> {
        let picture = self.picture.as_mut().ok_or(DrawError::NoPicture)?;
        let num_windows = picture.window_side.map_or(Ok(0), |side| check_windows(&picture.view, side))?;
        windows.iter().try_for_each(|&window| check_window(content, window, num_windows))?;
        if windows.is_empty() {
            return Ok(picture.shown.num_parts);
        }
        picture.windows = windows.to_vec();
        let number = self.draw_some(content, true);
        if let Some(picture) = &mut self.picture {
            picture.windows.clear();
        }
        number
    }

    fn draw_part(&mut self, content: &Content<'_>) -> Result<u32, DrawError> {
        self.draw_some(content, false)
    }

    fn finished(&mut self) -> Vec<FinishedPart> {
        std::mem::take(&mut self.finished)
    }

    /// Parts are drawn when their call returns.
    fn wait(&mut self) -> Result<(), DrawError> {
        Ok(())
    }

    fn finish(&mut self) -> Result<Drawn, DrawError> {
        let start = Instant::now();
        let target = self.picture.take().ok_or(DrawError::NoPicture)?;
        let (image, ray_doubt) = (target.image(self.level), target.ray_doubt());
        let device_seconds = Some(self.seconds + start.elapsed().as_secs_f64());
        Ok(Drawn { image, device_seconds, ray_doubt })
    }

    fn draw(&mut self, frame: &Frame<'_>) -> Result<Drawn, DrawError> {
        self.begin(&frame.view)?;
        self.draw_some(&frame.content, true)?;
        self.finish()
    }
}

#[cfg(test)]
mod tests {
    use volery_conformance as conformance;

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
                property(&mut SoftwareBackend::of_level(level));
            }
        }
    }
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
