//! Tests, benches and checks of the workspace: `cargo xtask test | tidy | bench`.
//!
//! One file per subcommand, plain `std` beside the argument parser and JSON, so that it builds in seconds on a
//! machine that has nothing yet. An error here is a line for a person: what was tried, and what to do.

mod apt;
mod bench;
mod shell;
mod test;
mod tidy;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

#[derive(Parser)]
#[command(about = "Tests, benches and checks of the workspace.", max_term_width = 100)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// What CI runs: adapter, format, lints, tidy, documentation, shaders, all tests; stops at what fails first.
    Test(test::Options),
    /// Checks that no compiler makes: sizes, unfinished marks, paths of a machine, crate graph, documents.
    Tidy,
    /// Criterion benches of all crates; `bench peers` runs VTK and Volery side by side.
    Bench(bench::Options),
}

fn main() -> ExitCode {
    let done = match Arguments::parse().command {
        Command::Test(options) => test::run(&options),
        Command::Tidy => tidy::run(),
        Command::Bench(options) => bench::run(&options),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("xtask: {message}");
            ExitCode::FAILURE
        }
    }
}
