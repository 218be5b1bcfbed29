//! The program `volery`: a volume file in, a picture and its distance from the truth out.
//!
//! Exit status 0: done; 1: it could not be done; 2: the command line is wrong. An error is one line on
//! stderr. Results go to stdout, progress to stderr if that is a terminal.

mod args;
mod demo;
mod extent;
mod info;
mod interrupts;
mod outputs;
mod progress;
mod quiet;
mod render;
mod save;
mod sheet;
mod slice;
mod wanted;

use std::fmt::Display;
use std::io::{self, ErrorKind, Write};
use std::path::Path;
use std::process::ExitCode;

use clap::Parser;
use volery::{Backend, BackendChoice, open_backend};

use crate::args::{Cli, Command};

/// Why a command could not be done: one line, and the exit status.
struct Failure {
    message: String,
    status: u8,
}

impl Failure {
    /// It could not be done.
    fn undone(message: impl Into<String>) -> Self {
        Self { message: message.into(), status: 1 }
    }

    /// The command line is wrong.
    fn usage(message: impl Into<String>) -> Self {
        Self { message: message.into(), status: 2 }
    }

    /// The same of a file.
    fn of_file(path: &Path, error: impl Display) -> Self {
        Self::undone(format!("{}: {}", path.display(), short_numbers(&error.to_string())))
    }
}

/// A text in which numbers have no hundreds of digits.
fn short_numbers(text: &str) -> String {
    const LONGEST: usize = 24;
    let is_digit = |c: char| c.is_ascii_digit() || c == '.';
    let mut short = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(start) = rest.find(is_digit) {
        let (before, number) = rest.split_at(start);
        let (number, after) = number.split_at(number.find(|c| !is_digit(c)).unwrap_or(number.len()));
        short += before;
        match number.parse::<f64>() {
            Ok(value) if number.len() > LONGEST => short += &format!("{value:e}"),
            _ => short += number,
        }
        rest = after;
    }
    short + rest
}

impl<E: std::error::Error> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::undone(error.to_string())
    }
}

fn main() -> ExitCode {
    let cli = match Cli::try_parse().and_then(Cli::checked) {
        Ok(cli) => cli,
        Err(error) if error.use_stderr() => {
            complain(&one_line_of_usage(&error.to_string()));
            return ExitCode::from(2);
        }
        // Help and version; nothing can be done if nobody reads them.
        Err(help) => {
            let _ = help.print();
            return ExitCode::SUCCESS;
        }
    };
    match run(cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure { message, status }) => {
            complain(&format!("error: {message}"));
            ExitCode::from(status)
        }
    }
}

fn run(cli: Cli) -> Result<(), Failure> {
    interrupts::watch()?;
    if let Some(threads) = cli.threads {
        rayon::ThreadPoolBuilder::new().num_threads(threads as usize).build_global()?;
    }
    match cli.command {
        Command::Render(args) => render::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Slice(args) => slice::run(&args),
        Command::Demo(args) => demo::run(&args),
    }
}

/// Opens who draws, and says it where a GPU was found that does not.
fn open(choice: BackendChoice) -> Result<Box<dyn Backend>, Failure> {
    if choice.loads_drivers() {
        quiet::hush_drivers();
    }
    let backend = open_backend(choice)?;
    if let Some(reason) = backend.device().in_place_of {
        complain(&format!("note: drawn on the CPU: {reason}"));
    }
    Ok(backend)
}

/// The first paragraph of a message of clap in one line, what may have been meant, and where to read more.
fn one_line_of_usage(message: &str) -> String {
    let paragraph: Vec<_> = message.lines().map(str::trim).take_while(|line| !line.is_empty()).collect();
    let tips: String = message
        .lines()
        .filter_map(|line| line.trim().strip_prefix("tip: "))
        .map(|tip| format!("; {tip}"))
        .collect();
    format!("{}{tips} (see --help)", paragraph.join(" "))
}

/// Prints one line to stderr, whatever is in it.
fn complain(message: &str) {
    let line: String = message
        .chars()
        .flat_map(|c| if c.is_control() { c.escape_default().collect() } else { vec![c] })
        .collect();
    // Where stderr is closed there is nobody to tell.
    let _ = writeln!(io::stderr(), "{line}");
}

/// Prints to stdout; a reader that has gone away is no error.
fn say(text: impl Display) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(Failure::undone(format!("stdout: {error}")))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_errors_are_short_and_stay_what_they_are() {
        for text in ["", "plane 1 at 0.30000000000000004", "sizes 1.2.840.113619.2.55.3.604688119.969.1"] {
            assert_eq!(short_numbers(text), text);
        }
        let long = format!("position -{} of plane 1", f64::MAX);
        assert_eq!(short_numbers(&long), "position -1.7976931348623157e308 of plane 1");
    }
}
