//! The bytes that a glTF file names: its own binary part, files beside it, or text in the file.

use std::io::Read as _;
use std::path::Path;

use ::gltf::json::Root;

use crate::bytes::{FileBytes, load};
use crate::error::{Problem, quoted};
use crate::vtk_xml::Base64;

/// The content of each buffer.
pub(super) struct Buffers<'a>(Vec<Bytes<'a>>);

enum Bytes<'a> {
    Own(&'a [u8]),
    File(FileBytes),
    Decoded(Vec<u8>),
}

impl<'a> Buffers<'a> {
    /// Opens all buffers, which may hold so many bytes together.
    pub(super) fn open(
        path: &Path,
        root: &Root,
        blob: Option<&'a [u8]>,
        max_bytes: u64,
    ) -> Result<Self, Problem> {
        let mut sum = 0_u64;
        let mut buffers = Vec::new();
        for (index, buffer) in root.buffers.iter().enumerate() {
            let expected = buffer.byte_length.0;
            sum = sum.saturating_add(expected);
            if sum > max_bytes {
                return Err(Problem::field(
                    "size of the buffers",
                    format!("{sum} bytes"),
                    format!("at most {max_bytes}"),
                ));
            }
            let fail = |problem: Problem| problem.of_array(format!("buffer {index}"));
            let bytes = open(path, buffer.uri.as_deref(), blob, expected).map_err(fail)?;
            let found = bytes.slice().len() as u64;
            if found < expected {
                return Err(fail(Problem::Size { what: "it", found, expected }));
            }
            buffers.push(bytes);
        }
        Ok(Self(buffers))
    }

    pub(super) fn get(&self, index: usize) -> Option<&[u8]> {
        self.0.get(index).map(Bytes::slice)
    }
}

impl Bytes<'_> {
    fn slice(&self) -> &[u8] {
        match self {
            Self::Own(bytes) => bytes,
            Self::File(bytes) => bytes,
            Self::Decoded(bytes) => bytes,
        }
    }
}

fn open<'a>(
    path: &Path,
    uri: Option<&str>,
    blob: Option<&'a [u8]>,
    expected: u64,
) -> Result<Bytes<'a>, Problem> {
    let Some(uri) = uri else {
        let blob = blob.ok_or_else(|| Problem::missing("uri", "one, or a binary part of the file"))?;
        return Ok(Bytes::Own(blob));
    };
    if let Some(data) = uri.strip_prefix("data:") {
        let text = data.split_once(";base64,").map(|(_, text)| text);
        let text = text.ok_or_else(|| Problem::field("uri", quoted(uri), "data in base64"))?;
        let mut bytes = Vec::new();
        let decoded = Base64::new(text.as_bytes()).take(expected).read_to_end(&mut bytes);
        decoded.map_err(|error| Problem::damaged("its base64 text", error))?;
        return Ok(Bytes::Decoded(bytes));
    }
    let name = percent_decoded(uri).filter(|name| !name.contains(':') && Path::new(name).is_relative());
    let name = name.ok_or_else(|| Problem::field("uri", quoted(uri), "a relative path or data in base64"))?;
    let part = path.parent().unwrap_or(Path::new("")).join(name);
    match load(&part) {
        Ok(bytes) => Ok(Bytes::File(bytes)),
        Err(problem) => Err(problem.of_part(&part)),
    }
}

/// A path without the `%20` that URIs have in place of a blank, and the like; none if what it stands for is no text.
fn percent_decoded(uri: &str) -> Option<String> {
    let mut bytes = Vec::new();
    let mut rest = uri.as_bytes();
    while let Some((&byte, after)) = rest.split_first() {
        rest = after;
        if byte == b'%' {
            let (digits, after) = rest.split_at_checked(2)?;
            bytes.push(u8::from_str_radix(str::from_utf8(digits).ok()?, 16).ok()?);
            rest = after;
        } else {
            bytes.push(byte);
        }
    }
    String::from_utf8(bytes).ok()
}
