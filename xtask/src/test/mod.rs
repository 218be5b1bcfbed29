//! `cargo xtask test`: everything that a change must pass, in the order in which it is cheapest to know.
//!
//! A stage that fails ends the run. Tests that a machine cannot run are never silent: they print
//! `ignored: NAME (reason)` when the environment allows it (`VOLERY_WITHOUT_GPU`, `VOLERY_WITHOUT_DATA`) and fail
//! otherwise; this program takes them from the passed, lists them, and counts them as skipped.

mod adapter;
mod tally;

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::Instant;

use crate::{shell, tidy};
use tally::Tally;

/// Options of `cargo xtask test`.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Run without a wgpu adapter: GPU tests are ignored, counted and listed
    #[arg(long)]
    without_gpu: bool,
    /// Run without the folder of real data: tests that need it are ignored, counted and listed
    #[arg(long)]
    without_data: bool,
}

/// Runs all stages.
///
/// # Errors
/// The first stage that fails.
pub(crate) fn run(options: &Options) -> Result<(), String> {
    let without_data = options.without_data || is_data_missing()?;
    if options.without_gpu {
        println!("without a GPU, as asked: GPU tests are ignored");
    } else {
        stage("adapter", adapter::ensure)?;
    }
    stage("format", || shell::run(&mut shell::cargo(&["fmt", "--all", "--check"])))?;
    stage("lints", || {
        shell::run(&mut shell::cargo(&["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"]))
    })?;
    stage("without wgpu", || {
        let software = ["clippy", "--package", "volery", "--no-default-features", "--", "-D", "warnings"];
        shell::run(&mut shell::cargo(&software))
    })?;
    stage("tidy", tidy::run)?;
    // That each can be packaged; what it holds is built by the other stages.
    stage("packages", || {
        let package = ["package", "--workspace", "--exclude", "volery-tests", "--exclude", "xtask"];
        shell::run(shell::cargo(&package).args(["--no-verify", "--allow-dirty", "--quiet"]))
    })?;
    stage("documentation", || {
        let mut doc =
            shell::cargo(&["doc", "--workspace", "--no-deps", "--lib", "--all-features", "--quiet"]);
        shell::run(doc.env("RUSTDOCFLAGS", "-D warnings"))
    })?;

    let mut tally = Tally::default();
    let mut tests = |name: &str, arguments: &[&str]| {
        stage(name, || {
            let mut command = shell::cargo(&["test"]);
            command.args(arguments).args(["--no-fail-fast", "--", "--show-output"]);
            for (variable, is_set) in
                [("VOLERY_WITHOUT_GPU", options.without_gpu), ("VOLERY_WITHOUT_DATA", without_data)]
            {
                if is_set {
                    command.env(variable, "1");
                } else {
                    command.env_remove(variable);
                }
            }
            count(&mut command, &mut tally)
        })
    };
    let done = tests("shaders", &["-p", "volery-shaders"])
        .and_then(|()| tests("tests", &["--workspace", "--exclude", "volery-shaders"]));
    print!("{tally}");
    done
}

/// Whether there is no folder of real data; says so.
fn is_data_missing() -> Result<bool, String> {
    let is_missing = shell::data_folder()?.is_none();
    if is_missing {
        println!("no folder ../shared/data, and VOLERY_DATA is not set: tests on real data are ignored");
    }
    Ok(is_missing)
}

/// Runs one stage under its name and says how long it took.
fn stage(name: &str, work: impl FnOnce() -> Result<(), String>) -> Result<(), String> {
    println!("== {name}");
    let start = Instant::now();
    work().map_err(|error| format!("{name} failed: {error}"))?;
    println!("== {name}: good, {:.1} s", start.elapsed().as_secs_f64());
    Ok(())
}

/// Runs tests, passes their output on, and counts.
fn count(command: &mut Command, tally: &mut Tally) -> Result<(), String> {
    let failed_before = tally.failed;
    let mut child = command.stdout(Stdio::piped()).spawn().map_err(|error| format!("cargo test: {error}"))?;
    let output = child.stdout.take().expect("it is piped");
    for line in BufReader::new(output).split(b'\n') {
        let line = line.map_err(|error| format!("cargo test: {error}"))?;
        let line = String::from_utf8_lossy(&line);
        println!("{line}");
        tally.read(&line);
    }
    let status = child.wait().map_err(|error| format!("cargo test: {error}"))?;
    match tally.failed - failed_before {
        0 if status.success() => Ok(()),
        0 => {
            tally.failed += 1;
            Err(format!(
                "cargo test ended with {status}: something did not build, or a test brought its program down"
            ))
        }
        failed => Err(format!("{failed} tests failed, named above")),
    }
}
