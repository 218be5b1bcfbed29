//! An open device, and the catching of its errors: wgpu reports them out of band, and panics on those that
//! nobody catches.

use std::cell::Cell;
use std::sync::{Arc, Mutex};

use volery_frame::{Device, UploadedBytes};

use crate::needs::USEFUL_FEATURES;

/// An open device.
pub(crate) struct Gpu {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    pub(crate) info: Device,
    uploaded: Cell<UploadedBytes>,
    /// What went wrong outside of any check, until somebody asks.
    stray: Arc<Mutex<Option<String>>>,
}

/// A number of [`UploadedBytes`].
#[derive(Clone, Copy, Debug)]
pub(crate) enum Upload {
    Bricks,
    Places,
    Choices,
    Transfers,
    Geometry,
    Views,
}

/// What a device reports.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Failure {
    OutOfMemory,
    Other(String),
}

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::OutOfMemory => f.write_str("out of memory"),
            Self::Other(text) => f.write_str(text),
        }
    }
}

impl Gpu {
    pub(crate) fn open(adapter: &wgpu::Adapter, info: Device) -> Result<Self, String> {
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("volery"),
            required_features: adapter.features() & USEFUL_FEATURES,
            required_limits: adapter.limits(),
            ..Default::default()
        };
        let (device, queue) =
            pollster::block_on(adapter.request_device(&descriptor)).map_err(|e| one_line(&e.to_string()))?;
        let stray = Arc::new(Mutex::new(None));
        let keep = |stray: &Arc<Mutex<Option<String>>>, text: String| {
            if let Ok(mut stray) = stray.lock() {
                stray.get_or_insert(one_line(&text));
            }
        };
        let uncaught = stray.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| keep(&uncaught, error.to_string())));
        let lost = stray.clone();
        device.set_device_lost_callback(move |reason, text| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                keep(&lost, format!("lost: {text}"));
            }
        });
        Ok(Self { device, queue, info, uploaded: Cell::default(), stray })
    }

    pub(crate) fn has(&self, features: wgpu::Features) -> bool {
        self.device.features().contains(features)
    }

    /// A device of somebody else's, who hears of what goes wrong outside of any check.
    pub(crate) fn of(device: wgpu::Device, queue: wgpu::Queue, info: Device) -> Self {
        Self { device, queue, info, uploaded: Cell::default(), stray: Arc::default() }
    }

    /// Counts bytes on their way to the device.
    pub(crate) fn count(&self, kind: Upload, bytes: usize) {
        let mut uploaded = self.uploaded.get();
        let UploadedBytes { bricks, places, choices, transfers, geometry, views } = &mut uploaded;
        *match kind {
            Upload::Bricks => bricks,
            Upload::Places => places,
            Upload::Choices => choices,
            Upload::Transfers => transfers,
            Upload::Geometry => geometry,
            Upload::Views => views,
        } += bytes as u64;
        self.uploaded.set(uploaded);
    }

    pub(crate) fn uploaded(&self) -> UploadedBytes {
        self.uploaded.get()
    }

    pub(crate) fn has_clock(&self) -> bool {
        self.has(wgpu::Features::TIMESTAMP_QUERY)
    }

    /// Runs calls to the device, and returns the first error that they cause.
    pub(crate) fn checked<T>(&self, calls: impl FnOnce() -> T) -> Result<T, Failure> {
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let internal = self.device.push_error_scope(wgpu::ErrorFilter::Internal);
        let result = calls();
        // Scopes are a stack: the last one pushed is the first to go.
        let errors =
            [internal.pop(), validation.pop(), memory.pop()].map(|scope| match pollster::block_on(scope) {
                None => None,
                Some(wgpu::Error::OutOfMemory { .. }) => Some(Failure::OutOfMemory),
                Some(error) => Some(Failure::Other(one_line(&error.to_string()))),
            });
        let stray = self.stray.lock().ok().and_then(|mut stray| stray.take()).map(Failure::Other);
        // Out of memory first: the others may follow from it.
        match errors.into_iter().rev().flatten().chain(stray).next() {
            None => Ok(result),
            Some(failure) => Err(failure),
        }
    }

    /// Waits until the device has done all that was submitted.
    pub(crate) fn wait(&self) -> Result<(), Failure> {
        self.poll_as(wgpu::PollType::wait_indefinitely())
    }

    /// Waits until the device has done what was submitted up to there.
    pub(crate) fn wait_for(&self, submission: wgpu::SubmissionIndex) -> Result<(), Failure> {
        self.poll_as(wgpu::PollType::Wait { submission_index: Some(submission), timeout: None })
    }

    /// Hears what the device has done, without waiting.
    pub(crate) fn poll(&self) -> Result<(), Failure> {
        self.poll_as(wgpu::PollType::Poll)
    }

    fn poll_as(&self, kind: wgpu::PollType) -> Result<(), Failure> {
        match self.device.poll(kind) {
            Ok(_) => Ok(()),
            Err(error) => Err(Failure::Other(one_line(&error.to_string()))),
        }
    }
}

/// Drivers' messages run over many lines; an error is one.
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
