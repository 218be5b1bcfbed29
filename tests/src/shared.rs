//! A backend that several sessions use in turn, so that a device is opened once.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use volery::Backend;
use volery_frame::{UploadError, VolumeLayout};

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
    volery_conformance::hand_on!(self, self.lock().backend => device volume is_resident upload evict resident_bytes brick_bytes room reserve
        uploaded_bytes begin begin_windows draw_windows wait draw_part finished finish);

    fn set_volume(&mut self, layout: &VolumeLayout) -> Result<(), UploadError> {
        let mut state = self.lock();
        state.layout = Some(*layout);
        state.backend.set_volume(layout)
    }
}
