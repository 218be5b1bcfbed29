//! Backends that wrap others.

/// Writes methods of [`Backend`](volery_frame::Backend) that do no more than hand on to another backend, inside an
/// `impl` of it: `hand_on!(self, self.0 => device volume)`. Crates that use it name `volery_frame`.
#[macro_export]
macro_rules! hand_on {
    ($this:ident, $to:expr => $($method:ident)+) => {
        $($crate::hand_on!(@$method $this, $to);)+
    };
    (@device $this:ident, $to:expr) => {
        fn device(&$this) -> ::volery_frame::Device {
            $to.device()
        }
    };
    (@set_volume $this:ident, $to:expr) => {
        fn set_volume(
            &mut $this,
            layout: &::volery_frame::VolumeLayout,
        ) -> Result<(), ::volery_frame::UploadError> {
            $to.set_volume(layout)
        }
    };
    (@volume $this:ident, $to:expr) => {
        fn volume(&$this) -> Option<::volery_frame::Revision> {
            $to.volume()
        }
    };
    (@is_resident $this:ident, $to:expr) => {
        fn is_resident(&$this, id: ::volery_frame::BrickId) -> bool {
            $to.is_resident(id)
        }
    };
    (@upload $this:ident, $to:expr) => {
        fn upload(
            &mut $this,
            bricks: &[::volery_frame::Brick<'_>],
        ) -> Result<(), ::volery_frame::UploadError> {
            $to.upload(bricks)
        }
    };
    (@evict $this:ident, $to:expr) => {
        fn evict(&mut $this, bricks: &[::volery_frame::BrickId]) {
            $to.evict(bricks);
        }
    };
    (@resident_bytes $this:ident, $to:expr) => {
        fn resident_bytes(&$this) -> u64 {
            $to.resident_bytes()
        }
    };
    (@brick_bytes $this:ident, $to:expr) => {
        fn brick_bytes(&$this, layout: &::volery_frame::VolumeLayout, samples: [u32; 3]) -> u64 {
            $to.brick_bytes(layout, samples)
        }
    };
    (@room $this:ident, $to:expr) => {
        fn room(&$this, layout: &::volery_frame::VolumeLayout, max_bytes: u64) -> u64 {
            $to.room(layout, max_bytes)
        }
    };
    (@reserve $this:ident, $to:expr) => {
        fn reserve(&mut $this, num_bricks: usize, max_bytes: u64) -> Result<(), ::volery_frame::UploadError> {
            $to.reserve(num_bricks, max_bytes)
        }
    };
    (@uploaded_bytes $this:ident, $to:expr) => {
        fn uploaded_bytes(&$this) -> ::volery_frame::UploadedBytes {
            $to.uploaded_bytes()
        }
    };
    (@begin $this:ident, $to:expr) => {
        fn begin(
            &mut $this,
            view: &::volery_frame::PictureView<'_>,
        ) -> Result<(), ::volery_frame::DrawError> {
            $to.begin(view)
        }
    };
    (@begin_windows $this:ident, $to:expr) => {
        fn begin_windows(
            &mut $this,
            view: &::volery_frame::PictureView<'_>,
            side: u32,
        ) -> Result<(), ::volery_frame::DrawError> {
            $to.begin_windows(view, side)
        }
    };
    (@draw_windows $this:ident, $to:expr) => {
        fn draw_windows(
            &mut $this,
            content: &::volery_frame::Content<'_>,
            windows: &[::volery_frame::Window],
        ) -> Result<u32, ::volery_frame::DrawError> {
            $to.draw_windows(content, windows)
        }
    };
    (@draw_part $this:ident, $to:expr) => {
        fn draw_part(
            &mut $this,
            content: &::volery_frame::Content<'_>,
        ) -> Result<u32, ::volery_frame::DrawError> {
            $to.draw_part(content)
        }
    };
    (@finished $this:ident, $to:expr) => {
        fn finished(&mut $this) -> Vec<::volery_frame::FinishedPart> {
            $to.finished()
        }
    };
    (@wait $this:ident, $to:expr) => {
        fn wait(&mut $this) -> Result<(), ::volery_frame::DrawError> {
            $to.wait()
        }
    };
    (@finish $this:ident, $to:expr) => {
        fn finish(&mut $this) -> Result<::volery_frame::Drawn, ::volery_frame::DrawError> {
            $to.finish()
        }
    };
}
