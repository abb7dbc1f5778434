//! Sentences: lines of text, each with a mark at its start and mostly a checksum.

use crate::{Fault, Framing, Judgement};

/// The checksum of a sentence: two hexadecimal digits after an asterisk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Check {
    /// The exclusive or of all bytes after the mark, as in NMEA 0183.
    Xor,
    /// CRC-8 with the polynomial 0x07 of all bytes before the asterisk.
    Crc8,
    /// None: the sentence ends with its line.
    None,
    /// Two digits after an asterisk that nobody compares, or none.
    Ignored,
}

/// The framing of sentences that begin with one of some marks.
///
/// A frame reaches from the mark to the checksum or, without one, to the end of the line, which is
/// not part of it. A mark within a sentence means that the sentence lost its end.
#[derive(Clone, Copy, Debug)]
pub struct Sentences {
    /// Bytes at which a sentence may begin.
    pub marks: &'static [u8],
    /// Its checksum.
    pub check: Check,
    /// Set where a mark cannot stand within a sentence.
    pub marks_are_reserved: bool,
}

impl Sentences {
    /// Sentences as NMEA 0183 defines them: `$GPGGA,...*hh`.
    pub const NMEA: Self = Self { marks: b"$!", check: Check::Xor, marks_are_reserved: true };

    /// Sentences of a program that writes wrong checksums, or none.
    pub const NMEA_UNCHECKED: Self = Self { check: Check::Ignored, ..Self::NMEA };

    /// The part of a sentence between its mark and its checksum.
    pub fn content<'a>(&self, frame: &'a [u8]) -> &'a [u8] {
        let checked = match self.check {
            Check::None => false,
            Check::Ignored => frame.len() > 3 && frame[frame.len() - 3] == b'*',
            Check::Xor | Check::Crc8 => true,
        };
        &frame[1..if checked { frame.len() - 3 } else { frame.len() }]
    }

    /// Tests whether a sentence has the checksum of NMEA 0183.
    pub fn is_checked(frame: &[u8]) -> bool {
        matches!(Self::NMEA.judge(frame), Judgement::Frame(size) if size == frame.len())
    }
}

impl Framing for Sentences {
    const MAX: usize = 2048;

    fn find(&self, bytes: &[u8]) -> Option<usize> {
        bytes.iter().position(|b| self.marks.contains(b))
    }

    fn judge(&self, bytes: &[u8]) -> Judgement {
        let rest = bytes.get(1..).unwrap_or_default();
        let ends = |b: &u8| {
            !(b' '..=b'~').contains(b)
                || (*b == b'*' && self.check != Check::None)
                || (self.marks_are_reserved && self.marks.contains(b))
        };
        let Some(length) = rest.iter().position(ends) else { return Judgement::Incomplete };
        let end = 1 + length;
        match (bytes[end], self.check) {
            (b'*', Check::Xor | Check::Crc8 | Check::Ignored) => {
                match bytes.get(end + 1..end + 3) {
                    None => Judgement::Incomplete,
                    Some(digits) => {
                        let Some(written) = hexadecimal(digits) else {
                            return Judgement::Rejected(Fault::Form);
                        };
                        let computed = match self.check {
                            Check::Crc8 => crc8(&bytes[..end]),
                            _ => bytes[1..end].iter().fold(0, |sum, b| sum ^ b),
                        };
                        if written == computed || self.check == Check::Ignored {
                            Judgement::Frame(end + 3)
                        } else {
                            Judgement::Rejected(Fault::Checksum)
                        }
                    }
                }
            }
            (b'\r' | b'\n', Check::None | Check::Ignored) => Judgement::Frame(end),
            _ => Judgement::Rejected(Fault::Form),
        }
    }

    fn separates(&self, byte: u8) -> bool {
        matches!(byte, b'\r' | b'\n')
    }
}

fn hexadecimal(digits: &[u8]) -> Option<u8> {
    digits.iter().try_fold(0_u8, |value, digit| {
        let digit = char::from(*digit).to_digit(16)?;
        u8::try_from(u32::from(value) * 16 + digit).ok()
    })
}

/// The CRC-8 with the polynomial `x^8 + x^2 + x + 1` (0x07), start 0, not reflected.
pub fn crc8(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ byte, |c, _| if c & 0x80 == 0 { c << 1 } else { (c << 1) ^ 0x07 })
    })
}
