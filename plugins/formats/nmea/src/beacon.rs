//! Acoustic transponders.

use std::fmt;

/// Number or name of an acoustic transponder, as an acoustic positioning system writes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Beacon {
    text: [u8; Self::LENGTH],
    length: usize,
}

impl Beacon {
    /// Largest length of a name, bytes.
    pub const LENGTH: usize = 16;

    /// A transponder of this number or name; `None` if the text is empty or too long. `01` and `1`
    /// are the same transponder.
    pub fn new(text: &str) -> Option<Self> {
        let text = text.trim();
        let number = text.parse::<i32>().map(|n| n.to_string());
        let bytes = number.as_ref().map_or(text, |n| n).as_bytes();
        let mut beacon = Self { text: [0; Self::LENGTH], length: bytes.len() };
        beacon.text.get_mut(..bytes.len())?.copy_from_slice(bytes);
        (!bytes.is_empty()).then_some(beacon)
    }
}

impl fmt::Display for Beacon {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&String::from_utf8_lossy(&self.text[..self.length]))
    }
}
