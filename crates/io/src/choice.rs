//! One of several volumes, and one of several numbers of each place: what a file offers and what is asked for.

use crate::error::Problem;

/// What a file offers to choose from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Choices {
    /// Numbers of each place: the channels of a colour, the components of a vector.
    pub channels: u64,
    /// Volumes or grids: time steps, or what else the file has several of.
    pub time_steps: u64,
}

impl Default for Choices {
    /// One of each.
    fn default() -> Self {
        Self { channels: 1, time_steps: 1 }
    }
}

/// Checks which of several channels is asked for.
pub(crate) fn checked_channel(channels: u64, wanted: Option<usize>) -> Result<Option<u64>, Problem> {
    let Some(wanted) = wanted.map(|wanted| wanted as u64) else { return Ok(None) };
    if wanted < channels {
        return Ok(Some(wanted));
    }
    let expected = match channels {
        1 => "0: there is one".to_owned(),
        _ => format!("0 to {}", channels - 1),
    };
    Err(Problem::field("channel asked for", wanted, expected))
}

/// What is said where one channel of several is drawn.
pub(crate) fn channel_note(channel: usize, channels: u64) -> String {
    format!("channel {channel} of {channels} is used (another one, 0 to {}, can be chosen)", channels - 1)
}

/// Checks which of several volumes or grids is asked for.
pub(crate) fn checked_step(steps: u64, wanted: Option<usize>) -> Result<Option<u64>, Problem> {
    match wanted.map(|wanted| wanted as u64) {
        Some(step) if step >= steps => {
            let expected =
                if steps == 1 { "0: the file holds one".to_owned() } else { format!("0 to {}", steps - 1) };
            Err(Problem::field("time step asked for", step, expected))
        }
        step => Ok(step),
    }
}

/// What is said where the first of several is drawn because none was asked for.
pub(crate) fn first_note(what: &str, count: u64, wanted: Option<usize>) -> Option<String> {
    let is_due = count > 1 && wanted.is_none();
    let note = || {
        let last = count.saturating_sub(1);
        format!("the file holds {count} {what}; the first is used (another, 0 to {last}, can be chosen)")
    };
    is_due.then(note)
}

/// Which of several volumes is read: the first, with a note, where none is asked for.
pub(crate) fn wanted_volume(
    volumes: u64,
    wanted: Option<usize>,
    notes: &mut Vec<String>,
) -> Result<u64, Problem> {
    notes.extend(first_note("volumes", volumes, wanted));
    Ok(checked_step(volumes, wanted)?.unwrap_or(0))
}
