//! Base64 as VTK writes it, decoded as it is read.

use std::io::{self, Read};

/// Decodes base64 in groups of four characters, each of which may be padded; white space is skipped; the
/// data end with the text or before a `<`.
pub(crate) struct Base64<'a> {
    text: &'a [u8],
    group: [u8; 3],
    /// The part of `group` not handed out yet.
    left: std::ops::Range<usize>,
}

impl<'a> Base64<'a> {
    pub(crate) fn new(text: &'a [u8]) -> Self {
        Self { text, group: [0; 3], left: 0..0 }
    }

    /// Decodes the next group; `false` at the end.
    fn next_group(&mut self) -> io::Result<bool> {
        let invalid = |what: &str| io::Error::new(io::ErrorKind::InvalidData, what.to_owned());
        let (mut bits, mut characters, mut padding) = (0u32, 0, 0);
        while characters < 4 {
            let Some((&byte, rest)) = self.text.split_first().filter(|(byte, _)| **byte != b'<') else {
                let error = invalid("the base64 text ends inside a group of four");
                return if characters == 0 { Ok(false) } else { Err(error) };
            };
            self.text = rest;
            let value = SIX_BITS[usize::from(byte)];
            if value == SPACE {
                continue;
            }
            if byte == b'=' && characters >= 2 {
                padding += 1;
            } else if value == INVALID || padding > 0 {
                return Err(invalid(&format!("byte {byte:#04x} in base64 text")));
            }
            bits = bits << 6 | u32::from(value & 63);
            characters += 1;
        }
        self.group = [(bits >> 16) as u8, (bits >> 8) as u8, bits as u8];
        self.left = 0..3 - padding;
        Ok(true)
    }
}

impl Read for Base64<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut filled = 0;
        while filled < buffer.len() {
            if self.left.is_empty() && !self.next_group()? {
                break;
            }
            let count = self.left.len().min(buffer.len() - filled);
            buffer[filled..filled + count].copy_from_slice(&self.group[self.left.start..][..count]);
            self.left.start += count;
            filled += count;
        }
        Ok(filled)
    }
}

const INVALID: u8 = 0x80;
const SPACE: u8 = 0x81;

/// The six bits of each character.
const SIX_BITS: [u8; 256] = {
    let mut table = [INVALID; 256];
    let alphabet = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut value = 0;
    while value < 64 {
        table[alphabet[value as usize] as usize] = value;
        value += 1;
    }
    table[b' ' as usize] = SPACE;
    table[b'\t' as usize] = SPACE;
    table[b'\r' as usize] = SPACE;
    table[b'\n' as usize] = SPACE;
    table
};

#[cfg(test)]
mod tests {
    use super::*;

    fn decode(text: &str) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        Base64::new(text.as_bytes()).read_to_end(&mut bytes)?;
        Ok(bytes)
    }

    #[test]
    fn base64_matches_the_vectors_of_rfc_4648() {
        let vectors = [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYg==", "foob")];
        for (text, bytes) in vectors {
            assert_eq!(decode(text).unwrap(), bytes.as_bytes());
        }
    }

    #[test]
    fn padding_may_stand_inside_and_space_anywhere() {
        assert_eq!(decode("Zg==\n Zm 9v</AppendedData>").unwrap(), b"ffoo");
        for bad in ["Zg", "Z===", "Zg=v", "Zm9*", "====", "Zm9v\u{e9}"] {
            assert!(decode(bad).is_err(), "{bad}");
        }
    }
}
