//! Why a file could not be read, in one line: which file, which field, what was found, what was expected.

use std::fmt::{self, Display};
use std::io;
use std::path::{Path, PathBuf};

/// A file that could not be read as a volume or grid.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", OneLine(.path.display()))]
pub struct ReadError {
    /// The file or folder as asked for.
    pub path: PathBuf,
    /// What is wrong with it.
    pub problem: Problem,
}

/// What is wrong with a file.
#[derive(Debug, thiserror::Error)]
pub enum Problem {
    /// The system could not open or read it.
    #[error("cannot be read: {0}")]
    Io(io::Error),
    /// The path leads to something that cannot hold samples.
    #[error("is {found}, expected {expected}")]
    Kind {
        /// What it is.
        found: &'static str,
        /// What it should be.
        expected: &'static str,
    },
    /// A field of the header has a value that is wrong, or that is not supported.
    #[error("{field} is {found}, expected {expected}")]
    Field {
        /// The field by the name that its format gives it.
        field: String,
        /// Its value, shortened if long.
        found: String,
        /// What would be right.
        expected: String,
    },
    /// There are fewer or more bytes than the header says.
    #[error("{what} holds {found} bytes, expected {expected}")]
    Size {
        /// Which part of the file.
        what: &'static str,
        /// Bytes there are; for compressed data that go on, the first byte too many.
        found: u64,
        /// Bytes there should be.
        expected: u64,
    },
    /// The decoded volume would be larger than [`ReadOptions::max_bytes`](crate::ReadOptions::max_bytes),
    /// or than the memory there is.
    #[error("the volume needs {required} bytes, expected at most {max}")]
    TooLarge {
        /// Bytes of the decoded samples.
        required: u128,
        /// Bytes allowed.
        max: u64,
    },
    /// A compressed or structured part does not decode.
    #[error("{what} is damaged: {message}")]
    Damaged {
        /// Which part of the file.
        what: &'static str,
        /// What its decoder says.
        message: String,
    },
    /// The detached data file of a header, or a slice of a folder, has a problem.
    #[error("{}: {problem}", OneLine(.path.display()))]
    Part {
        /// The file that has it.
        path: PathBuf,
        /// What is wrong with it.
        problem: Box<Problem>,
    },
    /// One of the arrays of a file has a problem.
    #[error("{array}: {problem}")]
    Array {
        /// The array by the name that the file or its format gives it.
        array: String,
        /// What is wrong with it.
        problem: Box<Problem>,
    },
    /// Dims, spacing and samples make no grid.
    #[error("{0}")]
    Grid(volery_scene::grid::Error),
    /// Points, cells and values make no unstructured grid.
    #[error("{0}")]
    Cells(volery_scene::unstructured::Error),
    /// Points, triangles and colour make no mesh.
    #[error("{0}")]
    Mesh(volery_scene::mesh::Error),
    /// Numbers that make no stack of slices.
    #[error("{0}")]
    Slices(volery_slicing::error::Decode),
}

impl Problem {
    pub(crate) fn field(field: impl Display, found: impl Display, expected: impl Display) -> Self {
        Self::Field { field: field.to_string(), found: shorten(found), expected: expected.to_string() }
    }

    pub(crate) fn missing(field: impl Display, expected: impl Display) -> Self {
        Self::field(field, "missing", expected)
    }

    pub(crate) fn damaged(what: &'static str, message: impl Display) -> Self {
        Self::Damaged { what, message: shorten(message) }
    }

    pub(crate) fn of_array(self, array: impl Display) -> Self {
        Self::Array { array: shorten(array), problem: Box::new(self) }
    }

    pub(crate) fn of_part(self, path: &Path) -> Self {
        Self::Part { path: path.to_owned(), problem: Box::new(self) }
    }
}

/// Text from a file in quotes, fit for one line of an error.
pub(crate) fn quoted(text: impl Display) -> String {
    format!("'{}'", shorten(text))
}

/// The first few of a list of defects, so that a file full of them still makes one readable line.
pub(crate) fn first_of(defects: &[impl Display]) -> String {
    const SHOWN: usize = 3;
    let mut line = defects.iter().take(SHOWN).map(ToString::to_string).collect::<Vec<_>>().join("; ");
    if defects.len() > SHOWN {
        line += &format!("; and {} more", defects.len() - SHOWN);
    }
    line
}

/// At most 80 characters, none of them a control character.
fn shorten(text: impl Display) -> String {
    let text = OneLine(text).to_string();
    match text.char_indices().nth(80) {
        None => text,
        Some((end, _)) => format!("{}...", &text[..end]),
    }
}

/// Shows control characters as escapes, so that a hostile name cannot break the line.
pub(crate) struct OneLine<T>(pub(crate) T);

impl<T: Display> Display for OneLine<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for c in self.0.to_string().chars() {
            if c.is_control() { write!(f, "{}", c.escape_default())? } else { write!(f, "{c}")? }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_is_one_line_whatever_the_file_says() {
        let problem = Problem::field("sizes", "3\n4\u{1b}[31m".repeat(50), "three numbers");
        let line = ReadError { path: "a\nb.nrrd".into(), problem }.to_string();
        assert!(line.starts_with("a\\nb.nrrd: sizes is 3\\n4\\u{1b}[31m"), "{line}");
        assert!(!line.contains('\n') && line.len() < 200, "{line}");
    }
}
