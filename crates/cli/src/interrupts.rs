//! Signals that end the program leave no part of a file behind.

/// From now on an interrupt deletes what is not whole before it ends the program, and a file that grows beyond the
/// limit of the process is an error of the write. Signals that whoever started the program ignores stay ignored.
#[cfg(unix)]
pub(crate) fn watch() -> std::io::Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
    use signal_hook::iterator::Signals;
    use signal_hook::low_level::emulate_default_handler;

    let ignored = ignored_signals();
    let is_heard = |signal: &i32| ignored >> (signal - 1) & 1 == 0;
    // With any handler at all, a write that is too much fails in place of ending the program.
    signal_hook::flag::register(SIGXFSZ, std::sync::Arc::default())?;
    let mut signals = Signals::new([SIGHUP, SIGINT, SIGTERM].into_iter().filter(is_heard))?;
    std::thread::Builder::new().name("interrupts".to_owned()).spawn(move || {
        for signal in signals.forever() {
            let _nothing_is_written = volery::io::abandon_unfinished();
            // It ends the program; where that fails, the next signal tries again.
            let _ = emulate_default_handler(signal);
        }
    })?;
    Ok(())
}

#[cfg(not(unix))]
pub(crate) fn watch() -> std::io::Result<()> {
    Ok(())
}

/// A bit for each signal that is ignored, the lowest for signal 1; none where the system does not say.
#[cfg(unix)]
fn ignored_signals() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}
