//! A device for the GPU tests: the machine's own, or Mesa's Vulkan driver in software.

use std::process::{Command, Stdio};

use crate::{apt, shell};

/// Makes sure that wgpu finds an adapter: asks wgpu itself, through an example of `volery-wgpu`, since driver
/// files alone do not say that a driver works.
///
/// # Errors
/// When there is none and none can be installed; the line says what to install.
pub(crate) fn ensure() -> Result<(), String> {
    // All of the workspace, so that what is built here is what the tests use.
    shell::run(&mut shell::cargo(&["build", "--quiet", "--workspace", "--example", "adapters"]))?;
    let program = shell::target_folder(&shell::metadata()?)?.join("debug/examples/adapters");
    let list = || shell::read(Command::new(&program).stderr(Stdio::null()));
    if let Ok(adapters) = list() {
        print!("{adapters}");
        return Ok(());
    }
    println!("wgpu finds no adapter: Mesa's software Vulkan driver is needed");
    apt::install(&["mesa-vulkan-drivers"]).map_err(|error| {
        format!("no wgpu adapter: a Vulkan driver is missing; {error}, or use --without-gpu")
    })?;
    let adapters = list().map_err(|_| {
        "no wgpu adapter, though mesa-vulkan-drivers is installed; use --without-gpu".to_owned()
    })?;
    print!("{adapters}");
    Ok(())
}
