//! Text of two bytes per unit, as Windows programs write it, becomes UTF-8.

use crate::pieces::{Joined, Pieces};
use std::io::{Read, Result};

/// Size in bytes of what is read at once.
const CHUNK: usize = 16 * 1024;

/// First bytes of a file of UTF-16: little-endian and big-endian.
pub const MARKS: [[u8; 2]; 2] = [[0xff, 0xfe], [0xfe, 0xff]];

/// The index of the order of a text without a mark, whose first two characters are plain.
pub fn without_mark(beginning: &[u8]) -> Option<usize> {
    let plain = |b: u8| b.is_ascii_alphanumeric() || b" \"#%-.".contains(&b);
    match *beginning {
        [a, 0, b, 0] if plain(a) && plain(b) => Some(0),
        [0, a, 0, b] if plain(a) && plain(b) => Some(1),
        _ => None,
    }
}

/// The characters of a file of UTF-16. A unit without its pair becomes U+FFFD.
pub struct Utf16<R> {
    file: R,
    to_unit: fn([u8; 2]) -> u16,
    /// Bytes that do not yet make a character.
    rest: Vec<u8>,
}

impl<R: Read> Utf16<R> {
    /// The file after its mark.
    pub(crate) fn new(file: R, little: bool) -> Joined<Self> {
        let to_unit = if little { u16::from_le_bytes } else { u16::from_be_bytes };
        Joined::new(Self { file, to_unit, rest: Vec::new() })
    }
}

impl<R: Read> Pieces for Utf16<R> {
    /// Decodes the next bytes; at the end also half a character.
    fn next(&mut self, text: &mut Vec<u8>) -> Result<bool> {
        let read = self.file.by_ref().take(CHUNK as u64).read_to_end(&mut self.rest)?;
        let mut units: Vec<u16> =
            self.rest.as_chunks::<2>().0.iter().map(|b| (self.to_unit)(*b)).collect();
        let high = |unit: &u16| (0xd800..0xdc00).contains(unit);
        if read > 0 && units.last().is_some_and(high) {
            units.pop();
        }
        self.rest.drain(..if read > 0 { 2 * units.len() } else { self.rest.len() });
        let characters =
            char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER));
        text.extend_from_slice(characters.collect::<String>().as_bytes());
        Ok(read > 0 || !text.is_empty())
    }
}
