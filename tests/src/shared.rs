//! A backend that several sessions use in turn, so that a device is opened once.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use volery::Backend;
use volery_frame::{
    Brick, BrickId, Content, Device, DrawError, Drawn, FinishedPart, Frame, PictureView, UploadError,
    UploadedBytes, VolumeLayout,
};

/// A backend of which more than one has hold. It holds the bricks of the session that was opened last.
#[derive(Clone)]
pub struct Shared(Arc<Mutex<State>>);

struct State {
    backend: Box<dyn Backend>,
    layout: Option<VolumeLayout>,
}

impl Shared {
    /// Shares a backend.
    pub fn new(backend: Box<dyn Backend>) -> Self {
        Self(Arc::new(Mutex::new(State { backend, layout: None })))
    }

    /// Forgets all bricks.
    ///
    /// # Errors
    /// When the device fails.
    pub fn cool(&self) -> Result<(), UploadError> {
        let State { backend, layout } = &mut *self.lock();
        layout.as_ref().map_or(Ok(()), |layout| backend.set_volume(layout))
    }

    /// A draw that panicked leaves a backend that the next session sets up anew.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Backend for Shared {
    fn device(&self) -> Device {
        self.lock().backend.device()
    }

    fn set_volume(&mut self, layout: &VolumeLayout) -> Result<(), UploadError> {
        let mut state = self.lock();
        state.layout = Some(*layout);
        state.backend.set_volume(layout)
    }

    fn is_resident(&self, id: BrickId) -> bool {
        self.lock().backend.is_resident(id)
    }

    fn upload(&mut self, bricks: &[Brick<'_>]) -> Result<(), UploadError> {
        self.lock().backend.upload(bricks)
    }

    fn evict(&mut self, bricks: &[BrickId]) {
        self.lock().backend.evict(bricks);
    }

    fn resident_bytes(&self) -> u64 {
        self.lock().backend.resident_bytes()
    }

    fn uploaded_bytes(&self) -> UploadedBytes {
        self.lock().backend.uploaded_bytes()
    }

    fn begin(&mut self, view: &PictureView<'_>) -> Result<(), DrawError> {
        self.lock().backend.begin(view)
    }

    fn draw_part(&mut self, content: &Content<'_>) -> Result<u32, DrawError> {
        self.lock().backend.draw_part(content)
    }

    fn finished(&mut self) -> Vec<FinishedPart> {
        self.lock().backend.finished()
    }

    fn finish(&mut self) -> Result<Drawn, DrawError> {
        self.lock().backend.finish()
    }

    fn draw(&mut self, frame: &Frame<'_>) -> Result<Drawn, DrawError> {
        self.lock().backend.draw(frame)
    }
}
