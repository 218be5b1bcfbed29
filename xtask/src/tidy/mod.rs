//! `cargo xtask tidy`: what must hold of the tree and no compiler checks. It is a test as well.
//!
//! Each check is a pure function from files, or from cargo's metadata, to findings, and has a test that shows it
//! a bad sample: a check that cannot fail protects nothing.

mod crates;
mod documents;
mod mask;
mod text;

use std::fmt;
use std::fs;
use std::path::Path;

use crate::shell;

/// Something that must not be.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Finding {
    /// Where, relative to the root.
    path: String,
    /// The line, from 1; 0 for the whole file.
    line: usize,
    /// What is wrong, and what would be right.
    message: String,
}

impl Finding {
    fn new(path: &str, line: usize, message: impl Into<String>) -> Self {
        Self { path: path.to_owned(), line, message: message.into() }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.line {
            0 => write!(f, "{}: {}", self.path, self.message),
            line => write!(f, "{}:{line}: {}", self.path, self.message),
        }
    }
}

/// A file of the tree.
pub(crate) struct File {
    /// Relative to the root, with slashes.
    path: String,
    bytes: u64,
    /// What it says; empty for pictures and other files that are no text.
    text: String,
}

impl File {
    fn has_extension(&self, extensions: &[&str]) -> bool {
        let extension = Path::new(&self.path).extension().and_then(|extension| extension.to_str());
        extension.is_some_and(|extension| extensions.contains(&extension))
    }

    #[cfg(test)]
    fn sample(path: &str, text: &str) -> Self {
        Self { path: path.to_owned(), bytes: text.len() as u64, text: text.to_owned() }
    }
}

/// Checks the tree and prints what is wrong.
///
/// # Errors
/// When something is, or the tree cannot be read.
pub(crate) fn run() -> Result<(), String> {
    let findings = findings()?;
    for finding in &findings {
        eprintln!("{finding}");
    }
    match findings.len() {
        0 => Ok(()),
        1 => Err("1 finding".to_owned()),
        count => Err(format!("{count} findings")),
    }
}

fn findings() -> Result<Vec<Finding>, String> {
    let files = files(&shell::root())?;
    let metadata = shell::metadata()?;
    let mut findings = text::findings(&files);
    findings.extend(crates::findings(&metadata, &files)?);
    findings.extend(documents::findings(&metadata, &files)?);
    Ok(findings)
}

/// All files under the root but those that its `.gitignore` names and those of git itself.
fn files(root: &Path) -> Result<Vec<File>, String> {
    let ignored =
        fs::read_to_string(root.join(".gitignore")).map_err(|error| format!(".gitignore: {error}"))?;
    let mut ignored: Vec<&str> = ignored.lines().map(|line| line.trim_start_matches('/')).collect();
    ignored.push(".git");
    let mut found = Vec::new();
    let mut folders = vec![root.to_path_buf()];
    while let Some(folder) = folders.pop() {
        let failed = |error: std::io::Error| format!("{}: {error}", folder.display());
        for entry in fs::read_dir(&folder).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            if ignored.iter().any(|name| entry.file_name() == **name) {
                continue;
            }
            let (path, kind) = (entry.path(), entry.file_type().map_err(failed)?);
            if kind.is_dir() {
                folders.push(path);
            } else {
                let content = fs::read(&path).map_err(|error| format!("{}: {error}", path.display()))?;
                let relative = path.strip_prefix(root).expect("it was found under the root");
                found.push(File {
                    path: relative.to_string_lossy().replace('\\', "/"),
                    bytes: content.len() as u64,
                    text: String::from_utf8(content).unwrap_or_default(),
                });
            }
        }
    }
    found.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tree_is_tidy() {
        let findings = findings().unwrap();
        let lines: Vec<String> = findings.iter().map(Finding::to_string).collect();
        assert!(findings.is_empty(), "{}", lines.join("\n"));
    }

    #[test]
    fn files_of_the_tree_are_found_and_built_ones_are_not() {
        let files = files(&shell::root()).unwrap();
        let has = |path: &str| files.iter().any(|file| file.path == path);
        assert!(has("Cargo.toml") && has("xtask/src/tidy/mod.rs") && has(".cargo/config.toml"));
        assert!(!files.iter().any(|file| file.path.starts_with("target/") || file.path.starts_with(".git/")));
    }
}
