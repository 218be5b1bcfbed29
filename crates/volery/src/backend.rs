//! Which backend draws.
//!
//! `Auto` takes a real GPU; without one it takes the software executor, also where a CPU device pretends to
//! be a GPU: on two cores Mesa's llvmpipe took two to three times as long for the same pictures (`cargo xtask
//! bench peers` prints both), and both use the same cores. A GPU that was found and did not open is named by the device of
//! the executor that draws in its place.

#[cfg(feature = "wgpu")]
use std::path::Path;

use volery_frame::Backend;
#[cfg(feature = "wgpu")]
use volery_frame::DeviceKind;
use volery_software::SoftwareBackend;
#[cfg(feature = "wgpu")]
use volery_wgpu::{OpenError, WgpuBackend};

/// Who shall draw.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BackendChoice {
    /// A real GPU, else the software executor.
    #[default]
    Auto,
    /// The software executor.
    Software,
    /// The best device that wgpu finds, a CPU that pretends to be a GPU too.
    Wgpu,
}

impl BackendChoice {
    /// Whether to open it loads drivers, which may talk.
    pub fn loads_drivers(self) -> bool {
        match self {
            Self::Auto => may_have_gpu(),
            Self::Software => false,
            Self::Wgpu => true,
        }
    }
}

/// Why a backend could not be had.
#[derive(Debug, thiserror::Error)]
#[error("backend wgpu: {0}")]
pub struct BackendError(#[from] Refused);

#[cfg(feature = "wgpu")]
type Refused = OpenError;

/// What is left out of this build.
#[cfg(not(feature = "wgpu"))]
#[derive(Debug, thiserror::Error)]
#[error("not in this build of the library, expected its feature wgpu")]
struct Refused;

/// Opens a backend.
///
/// # Errors
/// When wgpu was asked for and has no device; the other choices always succeed.
pub fn open_backend(choice: BackendChoice) -> Result<Box<dyn Backend>, BackendError> {
    match choice {
        BackendChoice::Software => Ok(Box::new(SoftwareBackend::new())),
        BackendChoice::Wgpu => Ok(of_wgpu()?),
        BackendChoice::Auto => Ok(gpu()),
    }
}

#[cfg(feature = "wgpu")]
fn of_wgpu() -> Result<Box<dyn Backend>, Refused> {
    Ok(Box::new(WgpuBackend::new()?))
}

#[cfg(not(feature = "wgpu"))]
fn of_wgpu() -> Result<Box<dyn Backend>, Refused> {
    Err(Refused)
}

/// A real GPU, or what draws in its place.
#[cfg(feature = "wgpu")]
fn gpu() -> Box<dyn Backend> {
    if may_have_gpu() {
        or_software(WgpuBackend::of_kind(DeviceKind::Gpu))
    } else {
        Box::new(SoftwareBackend::new())
    }
}

#[cfg(not(feature = "wgpu"))]
fn gpu() -> Box<dyn Backend> {
    Box::new(SoftwareBackend::new())
}

/// What opened, or the software executor, which says why if there was something to open.
#[cfg(feature = "wgpu")]
fn or_software<B: Backend + 'static>(opened: Result<B, OpenError>) -> Box<dyn Backend> {
    match opened {
        Ok(backend) => Box::new(backend),
        Err(OpenError::NoAdapter | OpenError::NoneOfKind { .. }) => Box::new(SoftwareBackend::new()),
        Err(lost) => Box::new(SoftwareBackend::in_place_of(lost.to_string())),
    }
}

/// Whether it is worth looking for a GPU. On Linux each kind of driver has a file of its own; without any of
/// them, loading Vulkan to find nothing takes longer than a small picture.
#[cfg(feature = "wgpu")]
fn may_have_gpu() -> bool {
    const DRIVER_FILES: [&str; 5] = ["/dev/dri", "/dev/nvidiactl", "/dev/dxg", "/dev/kgsl-3d0", "/dev/mali0"];
    !cfg!(target_os = "linux") || DRIVER_FILES.iter().any(|file| Path::new(file).exists())
}

#[cfg(not(feature = "wgpu"))]
fn may_have_gpu() -> bool {
    false
}

#[cfg(all(test, feature = "wgpu"))]
mod tests {
    use super::*;

    #[test]
    fn a_lost_gpu_is_named_and_one_that_is_not_there_is_not() {
        let opened = |error| or_software::<WgpuBackend>(Err(error)).device();
        let lost = OpenError::Device { name: "some GPU".to_owned(), reason: "lost".to_owned() };
        let device = opened(lost);
        assert_eq!(device.kind, DeviceKind::Software);
        assert_eq!(device.in_place_of.as_deref(), Some("device some GPU: lost"));
        let none = OpenError::NoneOfKind { wanted: DeviceKind::Gpu, found: Vec::new() };
        for none in [OpenError::NoAdapter, none] {
            assert_eq!(opened(none).in_place_of, None);
        }
    }
}
