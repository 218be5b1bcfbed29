//! Counts tests from what libtest prints.

use std::fmt;

/// Tests of any number of test programs.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Tally {
    pub(crate) passed: usize,
    pub(crate) failed: usize,
    /// One line each: the test's name and why it was not run.
    pub(crate) skipped: Vec<String>,
    /// Name of the passed test whose output is being read, and whether it said that it was ignored.
    block: Option<(String, bool)>,
    /// Tests of the present program that libtest counts as passed though they said that they were ignored.
    not_run: usize,
}

impl Tally {
    /// Takes one line of output of `cargo test -- --show-output`.
    pub(crate) fn read(&mut self, line: &str) {
        if let Some(name) = line.strip_prefix("---- ").and_then(|rest| rest.strip_suffix(" stdout ----")) {
            self.block = Some((name.to_owned(), false));
        } else if let Some(reason) = line.strip_prefix("ignored: ") {
            if let Some((name, said @ false)) = &mut self.block {
                *said = true;
                self.not_run += 1;
                // The name that libtest gives tells more than the test's own.
                let reason =
                    reason.rsplit_once(" (").map_or(reason, |(_, reason)| reason.trim_end_matches(')'));
                self.skipped.push(format!("{name}: {reason}"));
            }
        } else if let Some((name, reason)) = ignored_by_attribute(line) {
            self.skipped.push(format!("{name}: {reason}"));
        } else if let Some(counts) = line.strip_prefix("test result: ") {
            self.block = None;
            self.passed += number_before(counts, " passed") - std::mem::take(&mut self.not_run);
            self.failed += number_before(counts, " failed");
        }
    }
}

/// `test NAME ... ignored, REASON`.
fn ignored_by_attribute(line: &str) -> Option<(&str, &str)> {
    let (name, outcome) = line.strip_prefix("test ")?.split_once(" ... ")?;
    let reason = outcome.strip_prefix("ignored")?;
    Some((name.trim_end(), reason.strip_prefix(", ").unwrap_or("marked as ignored")))
}

/// The number that stands before `word`.
fn number_before(counts: &str, word: &str) -> usize {
    let before = counts.split(word).next().unwrap_or_default();
    before.rsplit(|c: char| !c.is_ascii_digit()).next().and_then(|digits| digits.parse().ok()).unwrap_or(0)
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.skipped.is_empty() {
            writeln!(f, "ignored:")?;
            for test in &self.skipped {
                writeln!(f, "    {test}")?;
            }
        }
        writeln!(f, "{} passed, {} failed, {} skipped", self.passed, self.failed, self.skipped.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tally_of(text: &str) -> Tally {
        let mut tally = Tally::default();
        text.lines().for_each(|line| tally.read(line));
        tally
    }

    #[test]
    fn sums_all_programs_and_takes_what_was_not_run_from_the_passed() {
        let found = tally_of(
            "running 3 tests\n\
             test trees::a ... ok\ntest trees::b ... ok\ntest trees::c    ... ignored, takes an hour\n\
             \nsuccesses:\n\n---- trees::b stdout ----\nignored: trees::b (no GPU)\nignored: trees::b (no data)\n\
             \nsuccesses:\n    trees::b\n\
             test result: ok. 2 passed; 0 failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.10s\n\
             running 2 tests\ntest x ... ok\ntest y ... FAILED\n\
             test result: FAILED. 1 passed; 1 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.1s\n",
        );
        assert_eq!((found.passed, found.failed), (2, 1));
        assert_eq!(found.skipped, ["trees::c: takes an hour", "trees::b: no GPU"]);
        let printed = found.to_string();
        assert_eq!(printed.lines().last(), Some("2 passed, 1 failed, 2 skipped"));
        assert_eq!(printed.lines().next(), Some("ignored:"));
    }

    #[test]
    fn the_word_ignored_in_other_places_counts_nothing() {
        let found = tally_of(
            "ignored: nobody's output\ntest ignored_cells_are_empty ... ok\n\
             test result: ok. 1 passed; 0 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.10s\n",
        );
        assert_eq!(found.to_string(), "1 passed, 0 failed, 0 skipped\n");
    }
}
