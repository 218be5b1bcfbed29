//! Damaging files at random.

/// xorshift64*: the same numbers for the same seed on every machine.
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    fn below(&mut self, n: usize) -> usize {
        if n == 0 { 0 } else { (self.next() >> 11) as usize % n }
    }
}

/// A damaged copy of one of the files: one to six changes.
pub(crate) fn damage(files: &[Vec<u8>], random: &mut Random) -> Vec<u8> {
    let mut file = files[random.below(files.len())].clone();
    for _ in 0..1 + random.below(6) {
        let at = random.below(file.len());
        match random.below(12) {
            0 | 1 => flip_bit(&mut file, at, random),
            2 => file.truncate(at),
            3 => splice(&mut file, &files[random.below(files.len())], random),
            4..=6 => change_number(&mut file, at, random),
            7..=9 => change_field(&mut file, at, random),
            10 => {
                let end = (at + random.below(16)).min(file.len());
                file.drain(at..end);
            }
            _ => {
                let words: [&[u8]; 8] =
                    [b"-1", b"nan", b"\n", b"\"", b"1e999", b"none", b"\xff\xff\xff\xff", b"<DataArray>"];
                let word = words[random.below(words.len())];
                file.splice(at..at, word.iter().copied());
            }
        }
    }
    file
}

/// Makes the checksums of a PNG's chunks right again, so that damage gets past them.
pub(crate) fn repair_png(file: &mut [u8]) {
    let mut at = 8;
    while let Some((length, _)) = file.get(at..).and_then(|rest| rest.split_first_chunk::<4>()) {
        let end = at + 8 + u32::from_be_bytes(*length) as usize;
        let Some(named_data) = file.get(at + 4..end) else { return };
        let mut crc = flate2::Crc::new();
        crc.update(named_data);
        if let Some(checksum) = file.get_mut(end..end + 4) {
            checksum.copy_from_slice(&crc.sum().to_be_bytes());
        }
        at = end + 4;
    }
}

fn flip_bit(file: &mut [u8], at: usize, random: &mut Random) {
    if let Some(byte) = file.get_mut(at) {
        *byte ^= 1 << random.below(8);
    }
}

/// Replaces a run of bytes by one of another file.
fn splice(file: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    let from = random.below(other.len());
    let piece = &other[from..(from + 1 + random.below(64)).min(other.len())];
    let at = random.below(file.len());
    let end = (at + random.below(64)).min(file.len());
    file.splice(at..end, piece.iter().copied());
}

/// Replaces the number in text at or after a place.
fn change_number(file: &mut Vec<u8>, at: usize, random: &mut Random) {
    let Some(start) = file[at.min(file.len())..].iter().position(u8::is_ascii_digit).map(|i| at + i) else {
        return;
    };
    let length = file[start..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    let numbers = [
        "0",
        "1",
        "2",
        "3",
        "4",
        "7",
        "255",
        "256",
        "65535",
        "65536",
        "1000000",
        "2147483647",
        "2147483648",
        "4294967295",
        "4294967296",
        "9223372036854775807",
        "9223372036854775808",
        "18446744073709551615",
        "99999999999999999999999999",
        "-0",
        "0.5",
        "1e300",
    ];
    let number = numbers[random.below(numbers.len())];
    file.splice(start..start + length, number.bytes());
}

/// Overwrites a binary field by a number that hurts, in either byte order.
fn change_field(file: &mut [u8], at: usize, random: &mut Random) {
    let width = [1, 2, 4, 8][random.below(4)];
    // Fields are mostly aligned.
    let at = if random.below(2) == 0 { at / width * width } else { at };
    let numbers =
        [0, 1, 2, 3, 4, 8, 0x7f, 0x80, 0xff, 0x7fff, 0x8000, 0xffff, 0x7fff_ffff, 0x8000_0000, u64::MAX];
    let small = random.below(300) as u64;
    let number = *numbers.get(random.below(numbers.len() + 5)).unwrap_or(&small);
    let mut bytes = number.to_le_bytes()[..width].to_vec();
    if random.below(2) == 0 {
        bytes.reverse();
    }
    for (slot, byte) in file.iter_mut().skip(at).zip(bytes) {
        *slot = byte;
    }
}
