//! Walks through a legacy file: words, lines and blocks of numbers, which are found but not read.

use crate::error::{Problem, quoted};
use crate::layout::ByteOrder;
use crate::numbers::{Numbers, Scalar};

/// The type of the numbers in a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BlockType {
    Number(Scalar),
    /// Eight to a byte.
    Bit,
    Text,
}

impl BlockType {
    pub(super) fn parse(name: &str) -> Result<Self, Problem> {
        Ok(Self::Number(match name.to_ascii_lowercase().as_str() {
            "bit" => return Ok(Self::Bit),
            "string" => return Ok(Self::Text),
            "unsigned_char" => Scalar::U8,
            "char" | "signed_char" => Scalar::I8,
            "unsigned_short" => Scalar::U16,
            "short" => Scalar::I16,
            "unsigned_int" => Scalar::U32,
            // VTK writes its own type of index as 32 bits.
            "int" | "vtkidtype" => Scalar::I32,
            "unsigned_long" | "unsigned_long_long" | "vtktypeuint64" => Scalar::U64,
            "long" | "long_long" | "vtktypeint64" => Scalar::I64,
            "float" => Scalar::F32,
            "double" => Scalar::F64,
            _ => {
                return Err(Problem::field(
                    "type of an array",
                    quoted(name),
                    "float, double, int and the like",
                ));
            }
        }))
    }
}

/// Numbers somewhere in the file.
#[derive(Clone, Copy)]
pub(crate) struct Block<'a> {
    bytes: &'a [u8],
    is_binary: bool,
    pub(crate) scalar: Scalar,
    pub(super) count: usize,
}

impl<'a> Block<'a> {
    pub(crate) fn numbers(&self) -> Result<Numbers<'a>, Problem> {
        if self.is_binary {
            return Ok(Numbers::Bytes(Box::new(self.bytes), ByteOrder::Big));
        }
        let text = std::str::from_utf8(self.bytes);
        text.map(Numbers::Text).map_err(|error| Problem::damaged("the text", error))
    }
}

/// A place in a file.
pub(super) struct Scanner<'a> {
    bytes: &'a [u8],
    position: usize,
    pub(super) is_binary: bool,
    /// Components of the last array: so many names `METADATA` has for them.
    components: usize,
}

impl<'a> Scanner<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, position: 0, is_binary: false, components: 0 }
    }

    fn rest(&self) -> &'a [u8] {
        &self.bytes[self.position..]
    }

    /// The rest of this line; goes on to the next.
    pub(super) fn line(&mut self) -> &'a [u8] {
        let rest = self.rest();
        let length = rest.iter().position(|&byte| byte == b'\n').unwrap_or(rest.len());
        self.position += (length + 1).min(rest.len());
        rest[..length].trim_ascii()
    }

    /// Passes the lines after `METADATA`, up to a blank one. Names of components may be blank, too.
    pub(super) fn skip_metadata(&mut self) {
        self.line();
        loop {
            match self.line() {
                b"" => return,
                b"COMPONENT_NAMES" => (0..self.components).for_each(|_| _ = self.line()),
                _ => {}
            }
        }
    }

    /// The next word as a real number.
    pub(super) fn number(&mut self, what: &str) -> Result<f64, Problem> {
        let word = self.expect(what)?;
        word.parse().map_err(|_| Problem::field(what, quoted(word), "a number"))
    }

    /// The next word, or `None` at the end of the file.
    pub(super) fn word(&mut self) -> Result<Option<&'a str>, Problem> {
        let rest = self.rest().trim_ascii_start();
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.position = self.bytes.len() - rest.len() + length;
        if length == 0 {
            return Ok(None);
        }
        let word = std::str::from_utf8(&rest[..length]);
        word.map(Some).map_err(|_| Problem::field("keyword", "not text", "a word of the format"))
    }

    /// The next word, which must be there.
    pub(super) fn expect(&mut self, what: &str) -> Result<&'a str, Problem> {
        self.word()?.ok_or_else(|| Problem::missing(what, "it before the file ends"))
    }

    /// The next word as a number of things.
    pub(super) fn count(&mut self, what: &str) -> Result<usize, Problem> {
        let word = self.expect(what)?;
        word.parse().map_err(|_| Problem::field(what, quoted(word), "a whole number"))
    }

    /// Whether this word comes next, in a binary file at the start of the next line; it is not passed.
    pub(super) fn is_next(&self, word: &[u8]) -> bool {
        let rest = self.rest();
        let line_end = rest.iter().position(|&byte| byte == b'\n');
        let next_line = line_end.map_or(&[][..], |end| &rest[end + 1..]);
        if self.is_binary { next_line.starts_with(word) } else { rest.trim_ascii_start().starts_with(word) }
    }

    /// Passes the numbers of an array of `tuples` times `components`, which start after this line if they are
    /// binary or strings. `None` for bits and text, which are no numbers.
    pub(super) fn block(
        &mut self,
        block_type: BlockType,
        tuples: usize,
        components: usize,
    ) -> Result<Option<Block<'a>>, Problem> {
        let too_many = || Problem::field("count of numbers", tuples, "one that can be addressed");
        self.components = components;
        let count = tuples.checked_mul(components).ok_or_else(too_many)?;
        if self.is_binary || block_type == BlockType::Text {
            self.line();
        }
        let start = self.position;
        let bytes = match (block_type, self.is_binary) {
            (BlockType::Text, _) => {
                (0..count).try_for_each(|_| self.skip_text())?;
                return Ok(None);
            }
            (_, false) => {
                (0..count).try_for_each(|done| self.skip_number(done, count))?;
                &self.bytes[start..self.position]
            }
            (BlockType::Bit, true) => self.take(count.div_ceil(8))?,
            (BlockType::Number(scalar), true) => {
                self.take(count.checked_mul(scalar.bytes() as usize).ok_or_else(too_many)?)?
            }
        };
        let BlockType::Number(scalar) = block_type else { return Ok(None) };
        Ok(Some(Block { bytes, is_binary: self.is_binary, scalar, count }))
    }

    fn take(&mut self, length: usize) -> Result<&'a [u8], Problem> {
        let rest = self.rest();
        let taken = rest.get(..length).ok_or(Problem::Size {
            what: "the rest of the file",
            found: rest.len() as u64,
            expected: length as u64,
        })?;
        self.position += length;
        Ok(taken)
    }

    fn skip_number(&mut self, done: usize, count: usize) -> Result<(), Problem> {
        let rest = self.rest().trim_ascii_start();
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.position = self.bytes.len() - rest.len() + length;
        if length > 0 { Ok(()) } else { Err(Problem::field("count of numbers in the array", done, count)) }
    }

    /// Passes a string: a line of text, or bytes after their length, whose upper two bits say how long it is.
    fn skip_text(&mut self) -> Result<(), Problem> {
        if !self.is_binary {
            let at_end = self.rest().is_empty();
            self.line();
            return if at_end { Err(Problem::missing("string", "a line for each")) } else { Ok(()) };
        }
        let first = self.rest().first().copied().unwrap_or(0);
        let length_bytes = 1 << (3 - (first >> 6));
        let length = self.take(length_bytes)?;
        let length = ByteOrder::Big.unsigned(length) & (u64::MAX >> (66 - 8 * length_bytes));
        let fits =
            usize::try_from(length).map_err(|_| Problem::field("length of a string", length, "less"))?;
        self.take(fits).map(|_| ())
    }
}
