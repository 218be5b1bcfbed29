//! The backend: one volume's bricks, and what of the last frame can be used again.

use volery_frame::backend::{check_content, check_view, check_window, check_windows};
use volery_frame::{
    Backend, Brick, BrickId, Content, Device, DeviceKind, DrawError, Drawn, FinishedPart, PictureView,
    Revision, UploadError, UploadedBytes, VolumeLayout, Window,
};

use crate::adapter::{self, OpenError, device_of};
use crate::cubes::CubeFans;
use crate::gpu::{Failure, Gpu};
use crate::jobs::Jobs;
use crate::needs;
use crate::picture::{Finish, Kept, PartKind, Picture};
use crate::plane::Plane;
use crate::pool::{Pool, Shape};
use crate::present::Present;
use crate::raycast::Raycast;
use crate::sheets::SheetStacks;
use crate::surfaces::Surfaces;
use crate::tiles::Tiles;

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
    finish: Finish,
    present: Present,
    picture: Option<Picture>,
    kept: Option<Kept>,
    jobs: Jobs,
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

    /// Draws on a device of somebody else's, who may go on using both, between any two calls. Its limits must be
    /// [`needed_limits`](crate::needed_limits) or better; of [`USEFUL_FEATURES`](crate::USEFUL_FEATURES) those count that
    /// it was opened with.
    ///
    /// # Errors
    /// [`OpenError::Limit`], or [`OpenError::Device`] when it fails.
    pub fn with_device(device: wgpu::Device, queue: wgpu::Queue) -> Result<Self, OpenError> {
        let info = device_of(&device.adapter_info());
        Self::on(Gpu::of(device, queue, info))
    }

    fn open(kind: Option<DeviceKind>) -> Result<Self, OpenError> {
        Self::on(adapter::open(kind)?)
    }

    fn on(gpu: Gpu) -> Result<Self, OpenError> {
        needs::check(&gpu.info.name, &gpu.device.limits())?;
        let fail =
            |failure: Failure| OpenError::Device { name: gpu.info.name.clone(), reason: failure.to_string() };
        let raycast = Raycast::new(&gpu).map_err(fail)?;
        let plane = Plane::new(&gpu).map_err(fail)?;
        let tiles = Tiles::new(&gpu).map_err(fail)?;
        let cubes = CubeFans::new(&gpu).map_err(fail)?;
        let sheets = SheetStacks::new(&gpu).map_err(fail)?;
        let surfaces = Surfaces::new(&gpu).map_err(fail)?;
        let finish = Finish::new(&gpu).map_err(fail)?;
        let present = Present::new(&gpu).map_err(fail)?;
        Ok(Self {
            gpu,
            raycast,
            plane,
            tiles,
            cubes,
            sheets,
            surfaces,
            pool: None,
            finish,
            present,
            picture: None,
            kept: None,
            jobs: Jobs::default(),
        })
    }

    /// Ends the picture in a texture of the device, in place of reading it: in its upper left corner, which must have
    /// room for it; the rest stays as it is. Colours are linear, opacity is 1; `format` is the view's, of any kind that
    /// can be drawn to. Nobody waits: what is submitted to the queue afterwards finds the picture there.
    ///
    /// # Errors
    /// [`DrawError::NoPicture`], or [`DrawError::Device`] when the texture is too small or cannot be drawn to, or the
    /// device fails.
    pub fn finish_into(
        &mut self,
        target: &wgpu::TextureView,
        format: wgpu::TextureFormat,
    ) -> Result<(), DrawError> {
        let picture = self.picture.take().ok_or(DrawError::NoPicture)?;
        let drawn = self.present.draw(&self.gpu, &mut self.jobs, &picture, (target, format));
        self.kept = Some(picture.into_kept());
        drawn.map_err(device)
    }

    /// Adds a checked part to a picture.
    fn add(&mut self, picture: &mut Picture, content: &Content<'_>) -> Result<u32, Failure> {
        let Self { gpu, raycast, plane, tiles, cubes, sheets, pool, jobs, .. } = self;
        match (content, pool) {
            (Content::Rays(content), Some(pool)) if !content.bricks.is_empty() => {
                raycast.add(gpu, pool, (picture, jobs), content)
            }
            (Content::Rays(_), _) => Ok(picture.add_nothing(jobs, PartKind::RAYS)),
            (Content::Planes(content), Some(pool))
                if !content.bricks.is_empty() && !content.planes.is_empty() =>
            {
                plane.add(gpu, pool, (picture, jobs), content)
            }
            (Content::Cubes(content), Some(pool)) if !content.cubes.is_empty() => {
                cubes.add(gpu, pool.layout(), tiles, (picture, jobs), content)
            }
            (Content::Sheets(content), _) if content.sheets.iter().any(|sheet| sheet.count > 0) => {
                sheets.add(gpu, tiles, (picture, jobs), content)
            }
            (Content::Sheets(content), _) => Ok(picture.add_nothing(jobs, PartKind::sheets(content))),
            (Content::Planes(_) | Content::Cubes(_), _) => Ok(picture.add_nothing(jobs, PartKind::default())),
        }
    }

    /// Begins a picture of a checked view.
    fn begin_picture(
        &mut self,
        view: &PictureView<'_>,
        window_side: Option<u32>,
    ) -> Result<Picture, Failure> {
        let kept = match self.kept.take().filter(|kept| kept.fits(view, window_side)) {
            Some(kept) => kept,
            None => Kept::new(&self.gpu, [view.width, view.height], window_side)?,
        };
        let surfaces = self.surfaces.draw(&self.gpu, &mut self.jobs, view, kept.tiles())?;
        Ok(Picture::new(view, kept, surfaces))
    }

    fn begin_checked(&mut self, view: &PictureView<'_>, window_side: Option<u32>) -> Result<(), DrawError> {
        self.kept = self.picture.take().map(Picture::into_kept).or(self.kept.take());
        self.jobs.clear(window_side.is_some());
        check_view(view, MAX_SIZE)?;
        if let Some(side) = window_side {
            check_windows(view, side)?;
        }
        self.picture = Some(self.begin_picture(view, window_side).map_err(device)?);
        Ok(())
    }

    /// Draws a part of the whole picture or in one window.
    fn draw_some(&mut self, content: &Content<'_>, window: Option<Window>) -> Result<u32, DrawError> {
        if self.picture.is_none() {
            return Err(DrawError::NoPicture);
        }
        check_content(content, self.pool.as_ref().map(Pool::layout))?;
        if let Some(brick) = content.bricks().find(|brick| !self.is_resident(brick.id)) {
            return Err(DrawError::NotResident { id: brick.id });
        }
        // A picture in which the device failed is dropped.
        let mut picture = self.picture.take().ok_or(DrawError::NoPicture)?;
        picture.set_window(window);
        let number = self.add(&mut picture, content).map_err(device)?;
        self.picture = Some(picture);
        Ok(number)
    }
}

impl Backend for WgpuBackend {
    fn device(&self) -> Device {
        self.gpu.info.clone()
    }

    fn set_volume(&mut self, layout: &VolumeLayout) -> Result<(), UploadError> {
        let pool = Pool::new(&self.gpu, layout)?;
        self.raycast.forget();
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

    fn evict(&mut self, bricks: &[BrickId]) {
        if let Some(pool) = &mut self.pool {
            pool.evict(bricks);
        }
    }

    fn resident_bytes(&self) -> u64 {
        self.pool.as_ref().map_or(0, Pool::resident_bytes)
    }

    fn brick_bytes(&self, layout: &VolumeLayout, samples: [u32; 3]) -> u64 {
        Shape::of(&self.gpu, layout).brick_bytes(layout, samples)
    }

    fn room(&self, layout: &VolumeLayout, max_bytes: u64) -> u64 {
        Shape::of(&self.gpu, layout).room(max_bytes)
    }

    fn reserve(&mut self, num_bricks: usize, max_bytes: u64) -> Result<(), UploadError> {
        let Some(pool) = &mut self.pool else { return Ok(()) };
        pool.reserve_within(&self.gpu, num_bricks, max_bytes)
    }

    fn uploaded_bytes(&self) -> UploadedBytes {
        self.gpu.uploaded()
    }

    fn begin(&mut self, view: &PictureView<'_>) -> Result<(), DrawError> {
        self.begin_checked(view, None)
    }

    fn begin_windows(&mut self, view: &PictureView<'_>, side: u32) -> Result<(), DrawError> {
        self.begin_checked(view, Some(side))
    }

    fn draw_part(&mut self, content: &Content<'_>) -> Result<u32, DrawError> {
        self.draw_some(content, None)
    }

    fn draw_windows(&mut self, content: &Content<'_>, windows: &[Window]) -> Result<u32, DrawError> {
        let picture = self.picture.as_ref().ok_or(DrawError::NoPicture)?;
        let (first, num_windows) = (picture.num_parts(), picture.num_windows());
        windows.iter().try_for_each(|&window| check_window(content, window, num_windows))?;
        for &window in windows {
            self.draw_some(content, Some(window))?;
        }
        Ok(first)
    }

    fn finished(&mut self) -> Vec<FinishedPart> {
        // A device that fails here tells the next who asks something of it.
        let _ = self.jobs.look(&self.gpu);
        self.jobs.take_told()
    }

    fn wait(&mut self) -> Result<(), DrawError> {
        self.jobs.wait(&self.gpu).map_err(device)
    }

    fn finish(&mut self) -> Result<Drawn, DrawError> {
        let picture = self.picture.take().ok_or(DrawError::NoPicture)?;
        let drawn = self.finish.read(&self.gpu, &mut self.jobs, &picture).map_err(device)?;
        self.kept = Some(picture.into_kept());
        Ok(drawn)
    }
}

fn device(failure: Failure) -> DrawError {
    DrawError::Device(failure.to_string())
}
