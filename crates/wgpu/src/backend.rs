//! The backend: one volume's bricks, and what of the last frame can be used again.

use volery_frame::backend::check_frame;
use volery_frame::{
    Backend, Brick, BrickId, Content, Cubes, Device, DeviceKind, DrawError, Drawn, Frame, Image, PlacedBrick,
    Planes, RayTransfer, Rays, Revision, Sheets, UploadError, VolumeLayout,
};
use volery_shaders::raycast;

use crate::adapter::{self, OpenError};
use crate::cubes::CubeFans;
use crate::gpu::{Failure, Gpu};
use crate::picture::{Band, band_size, draw_in_bands};
use crate::plane::Plane;
use crate::pool::Pool;
use crate::raycast::{Form, Raycast, Resources, bands_buffer, transfer_texture, units_texture};
use crate::sheets::SheetStacks;
use crate::surfaces::Surfaces;
use crate::tiles::{ANY_COLOR, Tiles};
use crate::units::{Matter, Units};
use crate::view::shader_frame;

/// Most pixels of a picture per axis.
const MAX_SIZE: u32 = 16384;

/// Draws on a device of wgpu's.
pub struct WgpuBackend {
    gpu: Gpu,
    raycast: Raycast,
    plane: Plane,
    tiles: Tiles,
    cubes: CubeFans,
    sheets: SheetStacks,
    surfaces: Surfaces,
    pool: Option<Pool>,
    prepared: Option<Prepared>,
    band: Option<Band>,
}

/// What was made for the bricks and the transfer function of the last frame.
struct Prepared {
    generation: u64,
    bricks: Vec<PlacedBrick>,
    transfer: RayTransfer,
    units: Units,
    units_texture: wgpu::Texture,
    transfer_texture: wgpu::Texture,
    bands: wgpu::Buffer,
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
        let tiles = Tiles::new(&gpu).map_err(fail)?;
        let cubes = CubeFans::new(&gpu).map_err(fail)?;
        let sheets = SheetStacks::new(&gpu).map_err(fail)?;
        let surfaces = Surfaces::new(&gpu).map_err(fail)?;
        Ok(Self {
            gpu,
            raycast,
            plane,
            tiles,
            cubes,
            sheets,
            surfaces,
            pool: None,
            prepared: None,
            band: None,
        })
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
        let gpu = &self.gpu;
        let (units_texture, transfer_texture, bands) = gpu.checked(|| {
            (
                units_texture(gpu, &units),
                transfer_texture(gpu, rays.transfer),
                bands_buffer(gpu, rays.transfer),
            )
        })?;
        let form = Form::new(layout, &units, has_blanks);
        self.prepared = Some(Prepared {
            generation: pool.generation(),
            bricks: rays.bricks.to_vec(),
            transfer: rays.transfer.clone(),
            units,
            units_texture,
            transfer_texture,
            bands,
            form,
        });
        Ok(())
    }

    fn cast_rays(&mut self, frame: &Frame<'_>, rays: &Rays<'_>) -> Result<Drawn, Failure> {
        if rays.bricks.is_empty() || self.pool.as_ref().is_none_or(|pool| pool.layout().cells.contains(&0)) {
            return self.draw_surfaces(frame);
        }
        self.prepare(rays)?;
        let (Some(pool), Some(prepared)) = (&self.pool, &self.prepared) else {
            return self.draw_surfaces(frame);
        };
        let Some(atlas) = pool.texture() else { return self.draw_surfaces(frame) };
        let gpu = &self.gpu;
        let size = [frame.width, frame.height];
        let surfaces = self.surfaces.of_frame(gpu, frame, band_size(gpu, size, raycast::TILE))?;
        let form = Form { has_surfaces: !surfaces.is_empty(), ..prepared.form };
        let pipeline = self.raycast.pipeline(gpu, form)?;
        let held = (pool, &surfaces);
        let mut shader_frame = shader_frame(frame, rays.transfer, pool.layout(), &prepared.units, held);
        let Prepared { units_texture: units, transfer_texture: transfer, bands, .. } = prepared;
        let raycast = &self.raycast;
        let bind = |picture: &wgpu::Buffer, _| {
            let surfaces = surfaces.view();
            raycast.bind(gpu, &Resources { units, atlas, transfer, bands, picture, surfaces })
        };
        let passes = (raycast::TILE, &surfaces);
        raycast.reset_doubt(gpu);
        let drawn = draw_in_bands(gpu, &mut self.band, size, passes, bind, |pass, bound, rows| {
            (shader_frame.first_row, shader_frame.end_row) = (rows.start, rows.end);
            raycast.set_frame(gpu, &shader_frame);
            Raycast::encode(pass, &pipeline, bound, &shader_frame);
        })?;
        Ok(Drawn { ray_doubt: Some(raycast.doubt(gpu)?), ..drawn })
    }

    fn draw_planes(&mut self, frame: &Frame<'_>, planes: &Planes<'_>) -> Result<Drawn, Failure> {
        match &self.pool {
            Some(pool) if !planes.bricks.is_empty() && !planes.planes.is_empty() => {
                let kept = (&mut self.band, &mut self.surfaces);
                self.plane.draw(&self.gpu, pool, kept, frame, planes)
            }
            _ => self.draw_surfaces(frame),
        }
    }

    fn draw_cubes(&mut self, frame: &Frame<'_>, cubes: &Cubes<'_>) -> Result<Drawn, Failure> {
        match &self.pool {
            Some(pool) if !cubes.cubes.is_empty() => {
                let surfaces = self.surfaces.of_frame(&self.gpu, frame, Tiles::size(frame))?;
                let kept = (&mut self.tiles, &mut self.band);
                self.cubes.draw(&self.gpu, pool.layout(), kept, (frame, &surfaces), cubes)
            }
            _ => self.draw_surfaces(frame),
        }
    }

    fn draw_sheets(&mut self, frame: &Frame<'_>, sheets: &Sheets<'_>) -> Result<Drawn, Failure> {
        if sheets.sheets.iter().all(|sheet| sheet.count == 0) {
            return self.draw_surfaces(frame);
        }
        let surfaces = self.surfaces.of_frame(&self.gpu, frame, Tiles::size(frame))?;
        let kept = (&mut self.tiles, &mut self.band);
        self.sheets.draw(&self.gpu, kept, (frame, &surfaces), sheets)
    }

    /// The picture of a frame whose content shows nothing.
    fn draw_surfaces(&mut self, frame: &Frame<'_>) -> Result<Drawn, Failure> {
        let surfaces = self.surfaces.of_frame(&self.gpu, frame, Tiles::size(frame))?;
        if surfaces.is_empty() {
            return Ok(background(frame));
        }
        self.tiles.draw(&self.gpu, &mut self.band, (frame, &surfaces), ANY_COLOR, |_| (), |_, ()| ())
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

    fn volume(&self) -> Option<Revision> {
        self.pool.as_ref().map(|pool| pool.layout().revision)
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
        if let Some(brick) = frame.content.bricks().find(|brick| !self.is_resident(brick.id)) {
            return Err(DrawError::NotResident { id: brick.id });
        }
        let drawn = match &frame.content {
            Content::Rays(rays) => self.cast_rays(frame, rays),
            Content::Planes(planes) => self.draw_planes(frame, planes),
            Content::Cubes(cubes) => self.draw_cubes(frame, cubes),
            Content::Sheets(sheets) => self.draw_sheets(frame, sheets),
        };
        drawn.map_err(|failure| DrawError::Device(failure.to_string()))
    }
}

/// The picture of nothing.
fn background(frame: &Frame<'_>) -> Drawn {
    let (width, height) = (frame.width, frame.height);
    let pixels = vec![frame.background; width as usize * height as usize];
    Drawn { image: Image { width, height, pixels }, device_seconds: None, ray_doubt: None }
}
