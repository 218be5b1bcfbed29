//! Wavefront `.obj`, by crate `tobj`.
//!
//! `tobj` is handed what makes surfaces, statement by statement: points, faces and lines. So a name in another
//! encoding, a damaged normal or a missing library of materials does no harm, and an error names its line.

use std::cell::Cell;
use std::io::{self, BufRead, Read};

use glam::DVec3;
use tobj::{LoadError, LoadOptions};

use super::{Surface, polygon};
use crate::error::Problem;

pub(super) fn read(bytes: &[u8], surface: &mut Surface) -> Result<(), Problem> {
    let counts = Counts::default();
    // A byte order mark is no part of the first statement.
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut statements = Statements { rest: bytes, statement: Vec::new(), at: 0, counts: &counts };
    let options = LoadOptions::default();
    // Materials are not used: none is looked for.
    let loaded = tobj::load_obj_buf(&mut statements, &options, |_| Err(LoadError::OpenFileFailed));
    let last = String::from_utf8_lossy(&statements.statement).into_owned();
    let (models, _) = loaded.map_err(|error| problem(error, &counts, &last))?;
    let (mut num_points, mut num_lines) = (counts.points.get(), 0);
    for model in models {
        let mesh = model.mesh;
        let corners = mesh.indices.len() as u64;
        surface.reserve(mesh.positions.len() as u64 / 3, corners)?;
        let first = surface.points.len() as u32;
        surface.points.extend(mesh.positions.chunks_exact(3).map(DVec3::from_slice));
        if mesh.face_arities.is_empty() {
            let triangles = mesh.indices.as_chunks::<3>().0.iter();
            surface.triangles.extend(triangles.map(|triangle| triangle.map(|corner| first + corner)));
        }
        let mut rest = mesh.indices.as_slice();
        for &num_corners in &mesh.face_arities {
            let Some((face, after)) = rest.split_at_checked(num_corners as usize) else { break };
            rest = after;
            match num_corners {
                0 | 1 => num_points += 1,
                2 => num_lines += 1,
                _ => {
                    let face: Vec<u32> = face.iter().map(|corner| first + corner).collect();
                    polygon::cut(&face, &surface.points, &mut surface.triangles);
                }
            }
        }
    }
    num_lines += counts.lines.get();
    surface.leave_out(num_points, ["point", "points"], "left out: no surface");
    surface.leave_out(num_lines, ["line", "lines"], "left out: no surface");
    surface.leave_out(
        counts.free_forms.get(),
        ["free-form curve or surface", "free-form curves and surfaces"],
        "left out",
    );
    Ok(())
}

fn problem(error: LoadError, counts: &Counts, last: &str) -> Problem {
    let field = format!("line {}", counts.line.get());
    match error {
        LoadError::FaceVertexOutOfBounds => {
            let points = counts.vertices.get();
            Problem::field(
                "a corner of a face",
                "a point that does not exist",
                format!("one of the {points} of the file"),
            )
        }
        LoadError::PositionParseError | LoadError::ScalingByZeroError => {
            Problem::field(field, last.trim_end(), "'v' and three numbers, and a fourth other than 0 or none")
        }
        LoadError::FaceParseError => Problem::field(field, last.trim_end(), "'f' and the numbers of points"),
        other => Problem::damaged("the text", format!("{field}: {other}")),
    }
}

/// What has gone by.
#[derive(Default)]
struct Counts {
    line: Cell<u64>,
    vertices: Cell<u64>,
    points: Cell<u64>,
    lines: Cell<u64>,
    free_forms: Cell<u64>,
}

fn add(count: &Cell<u64>, more: u64) {
    count.set(count.get() + more);
}

/// The statements of a file that `tobj` is to see, one after the other.
struct Statements<'a> {
    rest: &'a [u8],
    /// The one being read.
    statement: Vec<u8>,
    /// What of it has been read.
    at: usize,
    counts: &'a Counts,
}

impl Statements<'_> {
    /// The next line without its end, which may be CR, LF or both.
    fn line(&mut self) -> &[u8] {
        let end = self.rest.iter().position(|byte| matches!(byte, b'\n' | b'\r'));
        let (line, rest) = self.rest.split_at(end.unwrap_or(self.rest.len()));
        let after = if rest.starts_with(b"\r\n") { 2 } else { rest.len().min(1) };
        self.rest = &rest[after..];
        add(&self.counts.line, 1);
        line
    }

    /// Goes to the next statement of a kind that counts. It goes on in the next line where it ends in a backslash; a
    /// comment does not, nor does a name.
    fn advance(&mut self) {
        self.statement.clear();
        self.at = 0;
        while !self.rest.is_empty() {
            let mut statement = without_comment(self.line()).to_vec();
            if !is_of_surfaces(&statement) {
                continue;
            }
            while let Some(part) = statement.strip_suffix(b"\\").filter(|_| !self.rest.is_empty()) {
                statement = [part, b" "].concat();
                statement.extend_from_slice(without_comment(self.line()));
            }
            if self.is_wanted(&mut statement) {
                statement.push(b'\n');
                self.statement = statement;
                return;
            }
        }
    }

    /// Whether a statement is one for `tobj`; counts those that are left out.
    fn is_wanted(&self, statement: &mut Vec<u8>) -> bool {
        let words = || statement.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        let num_words = words().count();
        match keyword(statement).as_slice() {
            b"v" => {
                add(&self.counts.vertices, 1);
                // Three numbers, maybe a fourth; what comes after three and is more than one is a colour.
                let kept = if num_words > 5 { 4 } else { num_words };
                *statement =
                    [&b"v"[..]].into_iter().chain(words().take(kept).skip(1)).collect::<Vec<_>>().join(&b' ');
                true
            }
            b"f" => {
                *statement = [&b"f"[..]].into_iter().chain(words().skip(1)).collect::<Vec<_>>().join(&b' ');
                true
            }
            b"l" => {
                add(&self.counts.lines, 1);
                false
            }
            b"p" => {
                add(&self.counts.points, num_words as u64 - 1);
                false
            }
            _ => {
                add(&self.counts.free_forms, 1);
                false
            }
        }
    }
}

/// The first word of a statement in lower case.
fn keyword(statement: &[u8]) -> Vec<u8> {
    let mut words = statement.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    words.next().unwrap_or_default().to_ascii_lowercase()
}

/// Whether a statement makes points, faces, lines or free-form shapes.
fn is_of_surfaces(statement: &[u8]) -> bool {
    matches!(keyword(statement).as_slice(), b"v" | b"f" | b"l" | b"p" | b"curv" | b"curv2" | b"surf")
}

/// A line up to a comment, which starts a word with `#`; without blanks at its end.
fn without_comment(line: &[u8]) -> &[u8] {
    let is_start = |&i: &usize| line[i] == b'#' && (i == 0 || line[i - 1].is_ascii_whitespace());
    let end = (0..line.len()).find(is_start).unwrap_or(line.len());
    line[..end].trim_ascii_end()
}

impl Read for Statements<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let available = self.fill_buf()?;
        let count = available.len().min(buffer.len());
        buffer[..count].copy_from_slice(&available[..count]);
        self.consume(count);
        Ok(count)
    }
}

impl BufRead for Statements<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.at == self.statement.len() && !self.rest.is_empty() {
            self.advance();
        }
        Ok(&self.statement[self.at..])
    }

    fn consume(&mut self, count: usize) {
        self.at += count;
    }
}
