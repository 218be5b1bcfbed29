//! The backend: one volume's bricks, and what of the last frame can be used again.

use volery_frame::backend::check_frame;
use volery_frame::{
    Backend, Brick, BrickId, Content, Device, DeviceKind, DrawError, Drawn, Frame, Image, IntegratedTransfer,
    PlacedBrick, Planes, Rays, UploadError, VolumeLayout,
};
use volery_shaders::raycast;

use crate::adapter::{self, OpenError};
use crate::cubes::CubeFans;
use crate::gpu::{Failure, Gpu};
use crate::picture::{Band, draw_in_bands};
use crate::plane::Plane;
use crate::pool::Pool;
use crate::raycast::{Form, Raycast, Resources, transfer_texture, units_texture};
use crate::units::{Matter, Units};
use crate::view::shader_frame;

/// Most pixels of a picture per axis.
const MAX_SIZE: u32 = 16384;

/// Draws on a device of wgpu's.
pub struct WgpuBackend {
    gpu: Gpu,
    raycast: Raycast,
    plane: Plane,
    cubes: CubeFans,
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
    form: Form,
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
        let plane = Plane::new(&gpu).map_err(fail)?;
        let cubes = CubeFans::new(&gpu).map_err(fail)?;
        Ok(Self { gpu, raycast, plane, cubes, pool: None, prepared: None, band: None })
    }

    /// Everything that depends on bricks and transfer function, made anew only where they changed.
    fn prepare(&mut self, rays: &Rays<'_>) -> Result<(), Failure> {
        let Some(pool) = &self.pool else { return Ok(()) };
        let is_current = self.prepared.as_ref().is_some_and(|prepared| {
            prepared.generation == pool.generation()
                && prepared.bricks == rays.bricks
                && prepared.transfer == *rays.transfer
        });
        if is_current {
            return Ok(());
        }
        let (layout, resident) = (pool.layout(), pool.resident());
        let units = Units::new(
            &Matter { layout, resident, transfer: rays.transfer, slots_per_layer: pool.slots_per_layer() },
            rays.bricks,
        );
        let max = self.gpu.device.limits().max_texture_dimension_3d;
        if units.dims.iter().any(|&n| n > max) {
            let [x, y, z] = units.dims;
            return Err(Failure::Other(format!(
                "volume of {x} x {y} x {z} units, expected at most {max} per axis"
            )));
        }
        let has_blanks = rays.bricks.iter().any(|brick| resident[&brick.id].summary.has_blanks);
        let (units_texture, transfer_texture) = self
            .gpu
            .checked(|| (units_texture(&self.gpu, &units), transfer_texture(&self.gpu, rays.transfer)))?;
        self.prepared = Some(Prepared {
            generation: pool.generation(),
            bricks: rays.bricks.to_vec(),
            transfer: rays.transfer.clone(),
            units,
            units_texture,
            transfer_texture,
            form: Form::new(rays, layout, has_blanks),
        });
        Ok(())
    }

    fn cast_rays(&mut self, frame: &Frame<'_>, rays: &Rays<'_>) -> Result<Drawn, Failure> {
        self.prepare(rays)?;
        let (Some(pool), Some(prepared)) = (&self.pool, &self.prepared) else {
            return Ok(background(frame));
        };
        let Some(atlas) = pool.texture() else { return Ok(background(frame)) };
        let gpu = &self.gpu;
        let pipeline = self.raycast.pipeline(gpu, prepared.form)?;
        let mut shader_frame = shader_frame(frame, rays.transfer, pool.layout(), &prepared.units, pool);
        let (units, transfer) = (&prepared.units_texture, &prepared.transfer_texture);
        let raycast = &self.raycast;
        let bind =
            |picture: &wgpu::Buffer, _| raycast.bind(gpu, &Resources { units, atlas, transfer, picture });
        let size = [frame.width, frame.height];
        draw_in_bands(gpu, &mut self.band, size, raycast::TILE, bind, |pass, bound, rows| {
            (shader_frame.first_row, shader_frame.end_row) = (rows.start, rows.end);
            raycast.set_frame(gpu, &shader_frame);
            Raycast::encode(pass, &pipeline, bound, &shader_frame);
        })
    }

    fn draw_planes(&mut self, frame: &Frame<'_>, planes: &Planes<'_>) -> Result<Drawn, Failure> {
        let Some(pool) = &self.pool else { return Ok(background(frame)) };
        self.plane.draw(&self.gpu, pool, &mut self.band, frame, planes)
    }
}

impl Backend for WgpuBackend {
    fn device(&self) -> Device {
        self.gpu.info.clone()
    }

    fn set_volume(&mut self, layout: &VolumeLayout) -> Result<(), UploadError> {
        let pool = Pool::new(&self.gpu, layout)?;
        self.prepared = None;
        self.plane.forget();
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
        check_frame(frame, self.pool.as_ref().map(Pool::layout), MAX_SIZE)?;
        if let Content::Sheets(_) = &frame.content {
            return Err(DrawError::Device("sheets are not drawn yet".to_owned()));
        }
        let pool = self.pool.as_ref().ok_or(DrawError::NoVolume)?;
        if let Some(brick) = frame.content.bricks().find(|brick| !pool.resident().contains_key(&brick.id)) {
            return Err(DrawError::NotResident { id: brick.id });
        }
        let has_bricks = frame.content.bricks().next().is_some();
        let drawn = match &frame.content {
            Content::Rays(_) if !has_bricks || pool.layout().cells.contains(&0) => Ok(background(frame)),
            Content::Rays(rays) => self.cast_rays(frame, rays),
            Content::Cubes(cubes) if cubes.cubes.is_empty() => Ok(background(frame)),
            Content::Cubes(cubes) => self.cubes.draw(&self.gpu, pool.layout(), &mut self.band, frame, cubes),
            Content::Sheets(_) => Ok(background(frame)),
            Content::Planes(planes) if !has_bricks || planes.planes.is_empty() => Ok(background(frame)),
            Content::Planes(planes) => self.draw_planes(frame, planes),
        };
        drawn.map_err(|failure| DrawError::Device(failure.to_string()))
    }
}

/// The picture of nothing.
fn background(frame: &Frame<'_>) -> Drawn {
    let (width, height) = (frame.width, frame.height);
    let pixels = vec![frame.background; width as usize * height as usize];
    Drawn { image: Image { width, height, pixels }, device_seconds: None }
}
