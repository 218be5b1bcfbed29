//! Lists the devices that wgpu finds, best first; fails where there is none.

use std::process::ExitCode;

fn main() -> ExitCode {
    let devices = volery_wgpu::adapters();
    for device in &devices {
        println!("{} ({:?})", device.name, device.kind);
    }
    if devices.is_empty() { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}
