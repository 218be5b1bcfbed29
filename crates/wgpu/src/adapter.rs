//! Which devices there are, and which to take.

use volery_frame::{Device, DeviceKind};

use crate::gpu::Gpu;

/// Why no device could be opened.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum OpenError {
    /// There is no device at all.
    #[error(
        "no GPU and no software Vulkan device found, expected a driver for Vulkan, Metal or DirectX 12 \
         (on Debian and Ubuntu: mesa-vulkan-drivers)"
    )]
    NoAdapter,
    /// No device of the kind that was asked for.
    #[error("no device of kind {wanted:?} found, expected one of: {}", names(.found))]
    NoneOfKind {
        /// What was asked for.
        wanted: DeviceKind,
        /// What there is.
        found: Vec<Device>,
    },
    /// A device that is not good enough: see [`needed_limits`](crate::needed_limits).
    #[error("device {name}: limit {limit} is {found}, expected at least {expected}")]
    Limit {
        /// Its name.
        name: String,
        /// Which limit.
        limit: &'static str,
        /// What it is.
        found: u64,
        /// What is needed.
        expected: u64,
    },
    /// The device did not open.
    #[error("device {name}: {reason}")]
    Device {
        /// Its name.
        name: String,
        /// What the driver says.
        reason: String,
    },
}

fn names(devices: &[Device]) -> String {
    devices.iter().map(|d| format!("{} ({:?})", d.name, d.kind)).collect::<Vec<_>>().join(", ")
}

/// The devices that can be opened, best first: GPUs of their own, GPUs in the processor, others, and CPUs
/// that pretend to be GPUs last.
pub fn adapters() -> Vec<Device> {
    found().iter().map(|adapter| device_of(&adapter.get_info())).collect()
}

/// Opens the best device, or the best of one kind.
pub(crate) fn open(wanted: Option<DeviceKind>) -> Result<Gpu, OpenError> {
    let adapters = found();
    let found: Vec<_> = adapters.iter().map(|adapter| device_of(&adapter.get_info())).collect();
    let is_wanted = |device: &Device| wanted.is_none_or(|kind| kind == device.kind);
    let mut failure = match (wanted, found.is_empty()) {
        (Some(wanted), false) => OpenError::NoneOfKind { wanted, found: found.clone() },
        _ => OpenError::NoAdapter,
    };
    for (adapter, device) in adapters.iter().zip(found).filter(|(_, device)| is_wanted(device)) {
        match Gpu::open(adapter, device.clone()) {
            Ok(gpu) => return Ok(gpu),
            Err(reason) => failure = OpenError::Device { name: device.name, reason },
        }
    }
    Err(failure)
}

fn found() -> Vec<wgpu::Adapter> {
    let instance = wgpu::Instance::default();
    let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    // Stable: the drivers' own order stays among equals.
    adapters.sort_by_key(|adapter| rank(adapter.get_info().device_type));
    adapters
}

fn rank(kind: wgpu::DeviceType) -> u32 {
    match kind {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

pub(crate) fn device_of(info: &wgpu::AdapterInfo) -> Device {
    let is_cpu = info.device_type == wgpu::DeviceType::Cpu;
    let kind = if is_cpu { DeviceKind::CpuDevice } else { DeviceKind::Gpu };
    Device { kind, name: info.name.clone(), in_place_of: None }
}
