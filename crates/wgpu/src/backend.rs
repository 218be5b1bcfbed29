//! The backend: one volume's bricks, and what of the last frame can be used again.

use volery_frame::backend::check_frame;
use volery_frame::{
    Backend, Brick, BrickId, Device, DeviceKind, DrawError, Drawn, Frame, Image, IntegratedTransfer,
    PlacedBrick, UploadError, VolumeLayout,
};
use volery_shaders::raycast;

use crate::adapter::{self, OpenError};
use crate::gpu::{Failure, Gpu};
use crate::picture::{Band, rows_per_band};
use crate::pool::Pool;
use crate::raycast::{Raycast, Resources, transfer_texture, units_texture};
use crate::units::{Matter, Units};
use crate::view::shader_frame;

/// Most pixels of a picture per axis.
const MAX_SIZE: u32 = 16384;

/// Draws on a device of wgpu's.
pub struct WgpuBackend {
    gpu: Gpu,
    raycast: Raycast,
    pool: Option<Pool>,
    prepared: Option<Prepared>,
    band: Option<Band>,
}

/// What was made for the bricks and the transfer function of the last frame.
struct Prepared {
    generation: u64,
    bricks: Vec<PlacedBrick>,
    transfer: IntegratedTransfer,
    units: Units,
    units_texture: wgpu::Texture,
    transfer_texture: wgpu::Texture,
    has_blanks: bool,
}

impl WgpuBackend {
    /// Opens the best device there is: a GPU before a CPU that pretends to be one.
    ///
    /// # Errors
    /// When there is no device or none that opens.
    pub fn new() -> Result<Self, OpenError> {
        Self::open(None)
    }

    /// Opens the best device of one kind.
    ///
    /// # Errors
    /// When there is no such device or none that opens.
    pub fn of_kind(kind: DeviceKind) -> Result<Self, OpenError> {
        Self::open(Some(kind))
    }

    fn open(kind: Option<DeviceKind>) -> Result<Self, OpenError> {
        let gpu = adapter::open(kind)?;
        let fail =
            |failure: Failure| OpenError::Device { name: gpu.info.name.clone(), reason: failure.to_string() };
        let raycast = Raycast::new(&gpu).map_err(fail)?;
        Ok(Self { gpu, raycast, pool: None, prepared: None, band: None })
    }

    /// Everything that depends on bricks and transfer function, made anew only where they changed.
    fn prepare(&mut self, frame: &Frame<'_>) -> Result<(), Failure> {
        let Some(pool) = &self.pool else { return Ok(()) };
        let is_current = self.prepared.as_ref().is_some_and(|prepared| {
            prepared.generation == pool.generation()
                && prepared.bricks == frame.bricks
                && prepared.transfer == *frame.transfer
        });
        if is_current {
            return Ok(());
        }
        let (layout, resident) = (pool.layout(), pool.resident());
        let units = Units::new(
            &Matter { layout, resident, transfer: frame.transfer, slots_per_layer: pool.slots_per_layer() },
            frame.bricks,
        );
        let max = self.gpu.device.limits().max_texture_dimension_3d;
        if units.dims.iter().any(|&n| n > max) {
            let [x, y, z] = units.dims;
            return Err(Failure::Other(format!(
                "volume of {x} x {y} x {z} units, expected at most {max} per axis"
            )));
        }
        let (units_texture, transfer_texture) = self
            .gpu
            .checked(|| (units_texture(&self.gpu, &units), transfer_texture(&self.gpu, frame.transfer)))?;
        self.prepared = Some(Prepared {
            generation: pool.generation(),
            bricks: frame.bricks.to_vec(),
            transfer: frame.transfer.clone(),
            units,
            units_texture,
            transfer_texture,
            has_blanks: frame.bricks.iter().any(|brick| resident[&brick.id].summary.has_blanks),
        });
        Ok(())
    }

    fn cast_rays(&mut self, frame: &Frame<'_>) -> Result<Drawn, Failure> {
        self.prepare(frame)?;
        let (width, height) = (frame.width, frame.height);
        let num_pixels = width as usize * height as usize;
        let mut pixels = Vec::new();
        let no_memory = |_| Failure::Other(format!("no memory for a picture of {width}x{height} pixels"));
        pixels.try_reserve_exact(num_pixels).map_err(no_memory)?;
        let (Some(pool), Some(prepared)) = (&self.pool, &self.prepared) else {
            return Ok(background(frame));
        };
        let Some(atlas) = pool.texture() else { return Ok(background(frame)) };
        let rows = rows_per_band(&self.gpu, width, height, raycast::TILE);
        let gpu = &self.gpu;
        let band = match self.band.take().filter(|band| band.fits(width, rows)) {
            Some(band) => band,
            None => gpu.checked(|| Band::new(gpu, width, rows))?,
        };
        let resources = Resources {
            units: &prepared.units_texture,
            atlas,
            transfer: &prepared.transfer_texture,
            picture: &band.pixels,
        };
        let bound = gpu.checked(|| self.raycast.bind(gpu, &resources))?;
        let pipeline = self.raycast.pipeline(gpu, prepared.has_blanks)?;
        let mut shader_frame = shader_frame(frame, pool.layout(), &prepared.units, pool);
        let mut seconds = Some(0.0);
        for first_row in (0..height).step_by(rows as usize) {
            let end_row = (first_row + rows).min(height);
            (shader_frame.first_row, shader_frame.end_row) = (first_row, end_row);
            let num_pixels = width as usize * (end_row - first_row) as usize;
            self.raycast.set_frame(gpu, &shader_frame);
            let band_seconds = band.run(gpu, num_pixels, &mut pixels, |pass| {
                Raycast::encode(pass, &pipeline, &bound, &shader_frame);
            })?;
            seconds = seconds.zip(band_seconds).map(|(sum, band)| sum + band);
        }
        self.band = Some(band);
        Ok(Drawn { image: Image { width, height, pixels }, device_seconds: seconds })
    }
}

impl Backend for WgpuBackend {
    fn device(&self) -> Device {
        self.gpu.info.clone()
    }

    fn set_volume(&mut self, layout: &VolumeLayout) -> Result<(), UploadError> {
        let pool = Pool::new(&self.gpu, layout)?;
        self.prepared = None;
        self.pool = Some(pool);
        Ok(())
    }

    fn is_resident(&self, id: BrickId) -> bool {
        self.pool.as_ref().is_some_and(|pool| pool.resident().contains_key(&id))
    }

    fn upload(&mut self, bricks: &[Brick<'_>]) -> Result<(), UploadError> {
        let Some(first) = bricks.first() else { return Ok(()) };
        match &mut self.pool {
            Some(pool) => pool.upload(&self.gpu, bricks),
            None => Err(UploadError::NoVolume { id: first.id }),
        }
    }

    fn resident_bytes(&self) -> u64 {
        self.pool.as_ref().map_or(0, Pool::resident_bytes)
    }

    fn draw(&mut self, frame: &Frame<'_>) -> Result<Drawn, DrawError> {
        let pool = self.pool.as_ref().ok_or(DrawError::NoVolume)?;
        check_frame(frame, pool.layout(), MAX_SIZE)?;
        if let Some(brick) = frame.bricks.iter().find(|brick| !pool.resident().contains_key(&brick.id)) {
            return Err(DrawError::NotResident { id: brick.id });
        }
        if frame.bricks.is_empty() || pool.layout().cells.contains(&0) {
            return Ok(background(frame));
        }
        self.cast_rays(frame).map_err(|failure| DrawError::Device(failure.to_string()))
    }
}

/// The picture of nothing.
fn background(frame: &Frame<'_>) -> Drawn {
    let (width, height) = (frame.width, frame.height);
    let pixels = vec![frame.background; width as usize * height as usize];
    Drawn { image: Image { width, height, pixels }, device_seconds: None }
}
