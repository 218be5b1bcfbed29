//! What a file has several of.

use std::fmt;

use serde::Serialize;

/// How many there are to choose from; missing where there is one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Choices {
    /// Numbers of each place, for `--channel`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channels: Option<u64>,
    /// Volumes or grids, for `--time-step`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_steps: Option<u64>,
}

impl Choices {
    /// Whether there is nothing to choose.
    pub(super) fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

impl From<volery_io::Choices> for Choices {
    fn from(found: volery_io::Choices) -> Self {
        let several = |count: u64| (count > 1).then_some(count);
        Self { channels: several(found.channels), time_steps: several(found.time_steps) }
    }
}

/// A line for each, with the option that chooses.
impl fmt::Display for Choices {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { channels, time_steps } = *self;
        for (option, count) in [("--channel", channels), ("--time-step", time_steps)] {
            if let Some(count) = count {
                writeln!(f, "choose    {option} 0 to {}", count - 1)?;
            }
        }
        Ok(())
    }
}
