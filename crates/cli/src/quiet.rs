//! Drivers that talk on stderr where nothing is wrong.

/// Starts the program anew with an environment in which Mesa keeps quiet, if it would not. Its layer for choosing a
/// device looks for a Wayland server, and without `XDG_RUNTIME_DIR` the Wayland library writes a line to stderr that
/// begins with `error:`, though all is well. A display whose name is a path needs no `XDG_RUNTIME_DIR`. The
/// environment of a running program cannot be changed safely, so that of a new one is.
#[cfg(target_os = "linux")]
pub(crate) fn hush_drivers() {
    use std::env;
    use std::os::unix::process::CommandExt;
    use std::process::Command;

    /// Nobody listens there.
    const NO_DISPLAY: &str = "/dev/null";
    let (display, folder) = (env::var_os("WAYLAND_DISPLAY"), env::var_os("XDG_RUNTIME_DIR"));
    let is_path = |name: &std::ffi::OsString| std::path::Path::new(name).is_absolute();
    if display.as_ref().is_some_and(is_path) || folder.as_ref().is_some_and(is_path) {
        return;
    }
    let mut arguments = env::args_os();
    let (Ok(program), Some(name)) = (env::current_exe(), arguments.next()) else { return };
    // It returns only where it failed; then a line more on stderr is the lesser evil.
    let _ = Command::new(program).arg0(name).args(arguments).env("WAYLAND_DISPLAY", NO_DISPLAY).exec();
}

#[cfg(not(target_os = "linux"))]
pub(crate) fn hush_drivers() {}
