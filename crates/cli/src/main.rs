//! The program `volery`: a volume file in, a picture and its distance from the truth out.
//!
//! Exit status 0: done; 1: it could not be done; 2: the command line is wrong. An error is one line on
//! stderr. Results go to stdout, progress to stderr if that is a terminal.

mod args;
mod demo;
mod info;
mod progress;
mod render;
mod sheet;
mod slice;

use std::fmt::Display;
use std::io::{self, ErrorKind, Write};
use std::process::ExitCode;

use clap::Parser;

use crate::args::{Cli, Command};

/// Why a command could not be done: one line.
struct Failure(String);

impl<E: std::error::Error> From<E> for Failure {
    fn from(error: E) -> Self {
        Self(error.to_string())
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
        Err(Failure(message)) => {
            complain(&format!("error: {message}"));
            ExitCode::FAILURE
        }
    }
}

fn run(cli: Cli) -> Result<(), Failure> {
    if let Some(threads) = cli.threads {
        rayon::ThreadPoolBuilder::new().num_threads(threads.into()).build_global()?;
    }
    match cli.command {
        Command::Render(args) => render::run(&args),
        Command::Info(args) => info::run(&args),
        Command::Slice(args) => slice::run(&args),
        Command::Demo(args) => demo::run(&args),
    }
}

/// The first paragraph of a message of clap in one line, and where to read more.
fn one_line_of_usage(message: &str) -> String {
    let paragraph: Vec<_> = message.lines().map(str::trim).take_while(|line| !line.is_empty()).collect();
    format!("{} (see --help)", paragraph.join(" "))
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
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Failure(format!("stdout: {error}"))),
        _ => Ok(()),
    }
}
