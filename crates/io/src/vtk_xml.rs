//! VTK's XML files: elements, arrays and their data, whatever they describe.
//!
//! The text up to the appended data, which need not be XML, is walked once; elements keep their attributes
//! as they lie in the file, so that nothing is decoded that nobody asks for.

use std::borrow::Cow;

use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;

use crate::bytes::{FileBytes, reserve};
use crate::error::{Problem, quoted};
use crate::layout::ByteOrder;
use crate::numbers::{Numbers, Scalar};

mod base64;
mod payload;

pub(crate) use base64::Base64;

use payload::{BinaryForm, Compressor, Encoding, Payload};

/// A file: its elements in their order, and what stands behind them.
pub(crate) struct Document<'a> {
    elements: Vec<Element<'a>>,
    form: BinaryForm,
    /// The encoding of appended data and everything after the underscore that starts them.
    appended: Option<(Encoding, &'a [u8])>,
}

/// One element.
pub(crate) struct Element<'a> {
    start: BytesStart<'a>,
    /// Its place among the elements.
    index: usize,
    /// Elements around it.
    depth: usize,
    /// Index of the first element after it and all in it.
    end: usize,
    /// The text directly in it, which comments and other elements may interrupt.
    text: Cow<'a, str>,
}

/// The bytes of a file whose text is UTF-8, as it is or made so: VTK takes the bytes of Latin-1, too.
pub(crate) enum XmlBytes {
    Same(FileBytes),
    Made(Vec<u8>),
}

impl XmlBytes {
    /// Looks at the text before appended data.
    pub(crate) fn new(file: FileBytes) -> Result<Self, Problem> {
        let appended = file.windows(APPENDED.len()).position(|window| window == APPENDED);
        let (text, rest) = file.split_at(appended.unwrap_or(file.len()));
        if std::str::from_utf8(text).is_ok() {
            return Ok(Self::Same(file));
        }
        let more = text.iter().filter(|byte| !byte.is_ascii()).count();
        let mut made = Vec::new();
        reserve(&mut made, file.len() + more)?;
        for &byte in text {
            // Latin-1 is the first 256 code points.
            made.extend_from_slice(char::from(byte).encode_utf8(&mut [0; 4]).as_bytes());
        }
        made.extend_from_slice(rest);
        Ok(Self::Made(made))
    }
}

impl std::ops::Deref for XmlBytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Same(file) => file,
            Self::Made(bytes) => bytes,
        }
    }
}

/// Where text ends.
const APPENDED: &[u8] = b"<AppendedData";

impl<'a> Document<'a> {
    /// Parses a file whose `type` must be `expected_type`.
    pub(crate) fn parse(bytes: &'a [u8], expected_type: &str) -> Result<Self, Problem> {
        let form = BinaryForm { order: ByteOrder::Little, header_bytes: 4, compressor: None };
        let mut document = Self { elements: Vec::new(), form, appended: None };
        let mut open = Vec::new();
        let mut reader = Reader::from_reader(bytes);
        loop {
            match reader.read_event().map_err(|error| Problem::damaged("the XML", error))? {
                Event::Start(element) if element.local_name().as_ref() == "AppendedData" => {
                    let position = reader.buffer_position() as usize;
                    document.set_appended(&element, &bytes[position.min(bytes.len())..])?;
                    break;
                }
                Event::Start(element) => {
                    open.push(document.elements.len());
                    document.add(element, open.len() - 1, expected_type)?;
                }
                Event::Empty(element) => document.add(element, open.len(), expected_type)?,
                Event::End(_) => {
                    let end = document.elements.len();
                    if let Some(index) = open.pop() {
                        document.elements[index].end = end;
                    }
                }
                Event::Text(text) => {
                    // From a slice quick-xml borrows; anything else could not be kept.
                    if let (Cow::Borrowed(text), Some(&index)) = (text.into_inner(), open.last())
                        && !text.trim_ascii().is_empty()
                    {
                        document.elements[index].add_text(text.trim_ascii());
                    }
                }
                Event::Eof if open.is_empty() => break,
                Event::Eof => return Err(Problem::damaged("the XML", "it ends inside an element")),
                _ => {}
            }
        }
        let end = document.elements.len();
        open.into_iter().for_each(|index| document.elements[index].end = end);
        Ok(document)
    }

    fn add(&mut self, start: BytesStart<'a>, depth: usize, expected_type: &str) -> Result<(), Problem> {
        let index = self.elements.len();
        let element = Element { start, index, depth, end: index + 1, text: Cow::Borrowed("") };
        if self.elements.is_empty() {
            self.form = file_form(&element, expected_type)?;
        }
        self.elements.push(element);
        Ok(())
    }

    fn set_appended(&mut self, element: &BytesStart, rest: &'a [u8]) -> Result<(), Problem> {
        let encoding = match attribute(element, "encoding")?.as_deref() {
            Some("raw") => Encoding::Raw,
            Some("base64") => Encoding::Base64,
            found => return Err(Problem::field("encoding of AppendedData", shown(found), "raw or base64")),
        };
        let data = rest.trim_ascii_start().strip_prefix(b"_");
        let data = data.ok_or_else(|| Problem::missing("underscore before the appended data", "it"))?;
        self.appended = Some((encoding, data));
        Ok(())
    }

    /// The byte order of binary data.
    pub(crate) fn order(&self) -> ByteOrder {
        self.form.order
    }

    /// All elements of a name, wherever they are.
    pub(crate) fn all(&self, name: &str) -> impl Iterator<Item = &Element<'a>> {
        self.elements.iter().filter(move |element| element.is(name))
    }

    /// The elements of a name directly in another one.
    pub(crate) fn children(&self, parent: &Element<'a>, name: &str) -> impl Iterator<Item = &Element<'a>> {
        let depth = parent.depth + 1;
        let inside = &self.elements[parent.index + 1..parent.end];
        inside.iter().filter(move |element| element.depth == depth && element.is(name))
    }

    /// The numbers of a `DataArray`, which take `expected_bytes` in binary form.
    pub(crate) fn numbers<'n>(
        &self,
        array: &'n Element<'a>,
        expected_bytes: u64,
    ) -> Result<Numbers<'n>, Problem> {
        let binary = |encoding, bytes: &'n [u8]| Payload::Binary { encoding, bytes, form: self.form };
        let format = array.attribute("format")?;
        // VTK looks at no case.
        let payload = match format.as_deref().map(str::to_ascii_lowercase).as_deref() {
            None | Some("ascii") => Payload::Ascii(&array.text),
            Some("binary") => binary(Encoding::Base64, array.text.as_bytes()),
            Some("appended") => {
                let appended = self.appended.as_ref();
                let (encoding, data) =
                    appended.ok_or_else(|| Problem::missing("AppendedData", "the element"))?;
                let offset = array.number("offset")?;
                let offset = offset.ok_or_else(|| Problem::missing("offset", "one for each array"))?;
                let data = usize::try_from(offset).ok().and_then(|offset| data.get(offset..));
                let expected = "a place inside the appended data";
                binary(*encoding, data.ok_or_else(|| Problem::field("offset", offset, expected))?)
            }
            _ => {
                let expected = "ascii, binary or appended";
                return Err(Problem::field("format", shown(format.as_deref()), expected));
            }
        };
        payload.open(expected_bytes)
    }
}

/// What the root element says about the file.
fn file_form(root: &Element, expected_type: &str) -> Result<BinaryForm, Problem> {
    if !root.is("VTKFile") {
        return Err(Problem::field("root element", quoted(root.start.local_name().as_ref()), "VTKFile"));
    }
    let of = |name: &str| root.attribute(name);
    match of("type")?.as_deref() {
        Some(found) if found == expected_type => {}
        found => return Err(Problem::field("type", shown(found), expected_type)),
    }
    let order = match of("byte_order")?.as_deref() {
        None | Some("LittleEndian") => ByteOrder::Little,
        Some("BigEndian") => ByteOrder::Big,
        found => return Err(Problem::field("byte_order", shown(found), "LittleEndian or BigEndian")),
    };
    let header_bytes = match of("header_type")?.as_deref() {
        None | Some("UInt32") => 4,
        Some("UInt64") => 8,
        found => return Err(Problem::field("header_type", shown(found), "UInt32 or UInt64")),
    };
    let compressor = match of("compressor")?.as_deref() {
        None | Some("") => None,
        Some("vtkZLibDataCompressor") => Some(Compressor::Zlib),
        Some("vtkLZ4DataCompressor") => Some(Compressor::Lz4),
        Some("vtkLZMADataCompressor") => Some(Compressor::Lzma),
        found => {
            let expected = "vtkZLibDataCompressor, vtkLZ4DataCompressor, vtkLZMADataCompressor or none";
            return Err(Problem::field("compressor", shown(found), expected));
        }
    };
    Ok(BinaryForm { order, header_bytes, compressor })
}

impl<'a> Element<'a> {
    fn add_text(&mut self, text: &'a str) {
        if self.text.is_empty() {
            self.text = Cow::Borrowed(text);
        } else {
            let whole = self.text.to_mut();
            whole.push(' ');
            whole.push_str(text);
        }
    }
}

impl Element<'_> {
    fn is(&self, name: &str) -> bool {
        self.start.local_name().as_ref() == name
    }

    pub(crate) fn attribute(&self, name: &str) -> Result<Option<String>, Problem> {
        attribute(&self.start, name)
    }

    /// An attribute that is one whole number.
    pub(crate) fn number(&self, name: &str) -> Result<Option<u64>, Problem> {
        let Some(text) = self.attribute(name)? else { return Ok(None) };
        let number = text.trim().parse();
        number.map(Some).map_err(|_| Problem::field(name, quoted(text), "a whole number"))
    }

    /// Numbers of each value of a `DataArray`; an empty attribute counts as none.
    pub(crate) fn components(&self) -> Result<u64, Problem> {
        match self.attribute("NumberOfComponents")?.as_deref().map(str::trim) {
            None | Some("") => Ok(1),
            Some(text) => {
                text.parse().map_err(|_| Problem::field("NumberOfComponents", quoted(text), "a whole number"))
            }
        }
    }

    /// An attribute of exactly `N` numbers.
    pub(crate) fn numbers<T: std::str::FromStr, const N: usize>(
        &self,
        name: &str,
    ) -> Result<Option<[T; N]>, Problem> {
        let Some(text) = self.attribute(name)? else { return Ok(None) };
        let parsed: Option<Vec<T>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
        let array = parsed.and_then(|numbers| numbers.try_into().ok());
        array.map(Some).ok_or_else(|| Problem::field(name, quoted(text), format!("{N} numbers")))
    }

    /// The type of a `DataArray`.
    pub(crate) fn scalar(&self) -> Result<Scalar, Problem> {
        Ok(match self.attribute("type")?.as_deref() {
            Some("UInt8") => Scalar::U8,
            Some("Int8") => Scalar::I8,
            Some("UInt16") => Scalar::U16,
            Some("Int16") => Scalar::I16,
            Some("UInt32") => Scalar::U32,
            Some("Int32") => Scalar::I32,
            Some("UInt64") => Scalar::U64,
            Some("Int64") => Scalar::I64,
            Some("Float32") => Scalar::F32,
            Some("Float64") => Scalar::F64,
            found => {
                let found = quoted(found.unwrap_or_default());
                return Err(Problem::field("type of DataArray", found, "an integer or a float"));
            }
        })
    }
}

fn attribute(element: &BytesStart, name: &str) -> Result<Option<String>, Problem> {
    let damaged = |error: &dyn std::fmt::Display| Problem::damaged("the XML", error);
    let Some(attribute) = element.try_get_attribute(name).map_err(|error| damaged(&error))? else {
        return Ok(None);
    };
    let value = attribute.normalized_value(XmlVersion::Implicit1_0).map_err(|error| damaged(&error))?;
    Ok(Some(value.into_owned()))
}

fn shown(value: Option<&str>) -> String {
    value.map_or_else(|| "missing".to_owned(), quoted)
}
