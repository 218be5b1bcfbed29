//! Signs of life on a terminal, nothing elsewhere.

use std::io::IsTerminal;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Steps of a bar.
const STEPS: u64 = 1000;

/// What goes on now; disappears when dropped.
pub(crate) struct Progress(ProgressBar);

impl Progress {
    /// Work of unknown length.
    pub(crate) fn spinner(what: impl Into<String>) -> Self {
        let bar = Self::bar_of(None, "{spinner} {msg} {elapsed}", what.into());
        bar.enable_steady_tick(Duration::from_millis(100));
        Self(bar)
    }

    /// Work that says how much of it is done.
    pub(crate) fn bar(what: impl Into<String>) -> Self {
        Self(Self::bar_of(Some(STEPS), "{msg} {bar:40} {percent}% {eta}", what.into()))
    }

    fn bar_of(length: Option<u64>, template: &str, what: String) -> ProgressBar {
        let terminal = std::io::stderr().is_terminal();
        let target = if terminal { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let style = ProgressStyle::with_template(template).expect("the templates above are valid");
        ProgressBar::with_draw_target(length, target).with_style(style).with_message(what)
    }

    /// `done` is in [0, 1].
    pub(crate) fn set(&self, done: f64) {
        self.0.set_position((done * STEPS as f64) as u64);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
