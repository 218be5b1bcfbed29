//! A volume: samples, their pyramid, and how its bricks are stored on a device.

use std::time::Instant;

use glam::DVec3;
use volery_frame::{Revision, VolumeLayout};
use volery_io::World;
use volery_pyramid::{Kind, NodeSource, Pyramid};
use volery_scene::placement::Sheared;
use volery_scene::{Placement, SampleType, TransferFunction, VoxelGrid};

use super::Data;
use crate::fit::Direction;
use crate::report;
use crate::residency::Store;
use crate::session::RenderError;
use crate::technique::fans::Fans;
use crate::technique::planes::Planes;
use crate::technique::raycast::Raycast;
use crate::technique::{Technique, planes};
use crate::texels::Encoding;
use crate::transfer::Preset;
use crate::view::{Dial, How, PlaneView};

/// Cells of a brick per axis, for every technique: a brick of bytes is 36 kB then, of which shared boundaries are 9 %.
///
/// With 16, the software executor drew engine, heptane and the MRI head 4 to 18 % slower in full resolution,
/// holding 2 to 21 % fewer bytes; a tolerance of 0.05 then halved the bytes of heptane, where 32 saves a fifth.
pub const BRICK_CELLS: usize = 32;

/// A volume with its pyramid.
pub struct VolumeData {
    grid: VoxelGrid,
    placement: Placement,
    world: World,
    pyramid: Pyramid,
    store: Store,
    /// What makes bounds of planes tight, once an error was asked for.
    parts: std::sync::OnceLock<planes::Parts>,
    build_seconds: f64,
}

/// Why a volume cannot be drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum VolumeError {
    /// Every sample is NaN or infinite.
    #[error("every sample is blank, expected some finite values")]
    Blank,
    /// Values so far apart that their difference is no number.
    #[error("values from {:e} to {:e}, expected a range below 1.8e308", .range[0], .range[1])]
    TooWide {
        /// Smallest and largest value.
        range: [f64; 2],
    },
    /// The world of the file is no turn of the samples.
    #[error("{0} (by index, samples lie along axes of their own)")]
    Sheared(#[from] Sheared),
    /// The pyramid cannot be built.
    #[error("pyramid: {0}")]
    Layout(#[from] volery_pyramid::layout::Error),
}

impl VolumeData {
    /// A volume in the world of its file: samples are where [`VoxelGrid::world_from_index`] says.
    ///
    /// # Errors
    /// As [`VolumeData::new`], and when the axes of the samples are not at right angles.
    pub fn in_world(grid: VoxelGrid, world: World) -> Result<Self, VolumeError> {
        let (grid, placement) = grid.in_world()?;
        Ok(Self { placement, world, ..Self::new(grid)? })
    }

    /// Builds the pyramid of a volume: one walk over the samples. The first is at the origin of the world, the others at
    /// their index times the spacing, whatever the orientation.
    ///
    /// # Errors
    /// When there is no finite sample, or an axis is too long.
    pub fn new(grid: VoxelGrid) -> Result<Self, VolumeError> {
        let start = Instant::now();
        let pyramid = Pyramid::build(&grid, Kind::Decimated, BRICK_CELLS)?;
        let channels = pyramid.stats(pyramid.layout().root());
        if channels[0].is_blank() {
            return Err(VolumeError::Blank);
        }
        let range = if channels.len() == 1 { [channels[0].min, channels[0].max] } else { [0.0, 255.0] };
        if !(range[1] - range[0]).is_finite() {
            return Err(VolumeError::TooWide { range });
        }
        let encoding = Encoding::new(grid.sample_type(), range);
        let layout = VolumeLayout {
            revision: Revision::new(),
            // A layout's axes are below 2^31 samples.
            cells: grid.dims().map(|n| (n - 1) as u32),
            spacing: grid.spacing(),
            brick_cells: BRICK_CELLS as u32,
            texel: encoding.texel,
            value_scale: encoding.scale,
            value_offset: encoding.offset,
            value_range: range,
        };
        let store = Store { layout, encoding };
        let parts = std::sync::OnceLock::new();
        Ok(Self {
            grid,
            placement: Placement::default(),
            world: World::Plain,
            pyramid,
            store,
            parts,
            build_seconds: start.elapsed().as_secs_f64(),
        })
    }

    /// The samples.
    pub fn grid(&self) -> &VoxelGrid {
        &self.grid
    }

    /// The middle of the samples in the world.
    pub fn middle(&self) -> DVec3 {
        self.placement.to_world(self.grid.extent() / 2.0)
    }

    /// From where matter is seen where nobody says: from the front, as radiologists look, of what is anatomical.
    pub(crate) fn usual_direction(&self) -> Direction {
        match self.world {
            World::Anatomical => Direction { azimuth_deg: 180.0, elevation_deg: 0.0, zoom: 1.0 },
            World::Plain => Direction::default(),
        }
    }

    pub(crate) fn source(&self) -> &dyn NodeSource {
        &self.pyramid
    }

    /// What makes bounds of planes tight.
    pub(crate) fn parts(&self) -> &planes::Parts {
        self.parts.get_or_init(|| planes::Parts::new(&self.grid))
    }

    /// How bricks are stored now.
    pub(crate) fn store(&self) -> Store {
        self.store
    }

    /// How bricks are stored from now on: as a transfer function asks, where texels are neither whole numbers nor colours.
    /// Where that changes, it is another volume to a backend.
    pub(crate) fn store_for(&mut self, transfer: &TransferFunction) -> Store {
        let range = self.store.layout.value_range;
        // Of the transfer function alone: pictures do not depend on those before.
        let encoding = Encoding::new(self.sample_type(), range).suiting(transfer, range);
        if encoding != self.store.encoding {
            let layout = VolumeLayout {
                revision: Revision::new(),
                value_scale: encoding.scale,
                value_offset: encoding.offset,
                ..self.store.layout
            };
            self.store = Store { layout, encoding };
        }
        self.store
    }

    /// The tolerance that a dial asks for, in data units.
    pub(crate) fn tolerance(&self, dial: Dial) -> Option<f64> {
        let [low, high] = self.value_range();
        match dial {
            Dial::Tolerance(tolerance) => Some(tolerance * (high - low)),
            Dial::Full | Dial::Error(_) | Dial::Deadline(_) | Dial::Memory(_) => None,
        }
    }

    /// Refuses what has no matter.
    pub(crate) fn check_matter(&self, how: &How) -> Result<(), RenderError> {
        let (found, dims, technique) = (self.grid.sample_type(), self.grid.dims(), how.name());
        if found.channels() != 1 {
            return Err(RenderError::Colors { technique, found });
        }
        if dims.contains(&1) { Err(RenderError::Flat { technique, dims }) } else { Ok(()) }
    }

    fn sample_type(&self) -> SampleType {
        self.grid.sample_type()
    }
}

impl Data for VolumeData {
    fn techniques() -> Vec<Box<dyn Technique<Self>>> {
        vec![Box::<Raycast>::default(), Box::<Planes>::default(), Box::<Fans>::default()]
    }

    /// Planes for images and for colours, which have no matter, rays for everything else.
    fn suiting(&self) -> How {
        let is_flat = self.grid.dims().contains(&1);
        if is_flat || self.has_colors() { How::Planes(PlaneView::default()) } else { How::Raycast }
    }

    fn value_range(&self) -> [f64; 2] {
        self.store.layout.value_range
    }

    /// Of the samples.
    fn world_bounds(&self) -> [DVec3; 2] {
        self.placement.bounds_to_world([DVec3::ZERO, self.grid.extent()])
    }

    /// Along the axes of the samples.
    fn extent(&self) -> DVec3 {
        self.grid.extent()
    }

    fn placement(&self) -> Placement {
        self.placement
    }

    fn world(&self) -> World {
        self.world
    }

    /// # Panics
    /// Never: making it ready found finite values and their range.
    fn preset_over(&self, preset: Preset, range: Option<[f64; 2]>) -> TransferFunction {
        let transfer = preset.over(self.grid.samples(), range, self.extent());
        transfer.expect("making it ready found finite values and their range")
    }

    fn has_colors(&self) -> bool {
        self.sample_type().channels() > 1
    }

    fn input(&self) -> report::Input {
        let dims = self.grid.dims();
        report::Input {
            path: None,
            kind: if dims[2] == 1 { "image" } else { "volume" },
            dims: Some(dims),
            cells: None,
            scalar: self.sample_type().name(),
            place: None,
        }
    }

    fn build_seconds(&self) -> f64 {
        self.build_seconds
    }

    fn bricks(&self) -> Option<&dyn NodeSource> {
        Some(&self.pyramid)
    }
}
