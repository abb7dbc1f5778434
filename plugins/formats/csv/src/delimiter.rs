//! The separator of the cells of a row.

use serde::de::Error;
use serde::{Deserialize, Deserializer};

/// The separator of the cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Delimiter {
    /// One ASCII character.
    Byte(u8),
    /// Any number of spaces and tabs.
    Whitespace,
}

impl Default for Delimiter {
    fn default() -> Self {
        Self::Byte(b',')
    }
}

impl Delimiter {
    /// The character between two cells, after spaces and tabs were joined.
    pub fn byte(self) -> u8 {
        match self {
            Self::Byte(byte) => byte,
            Self::Whitespace => b' ',
        }
    }
}

impl<'de> Deserialize<'de> for Delimiter {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        match text.as_bytes() {
            b"whitespace" => Ok(Self::Whitespace),
            [byte] if byte.is_ascii() && !b"\"\r\n".contains(byte) => Ok(Self::Byte(*byte)),
            _ => Err(Error::custom(
                "one character is needed, such as \";\" or \"\\t\", or \"whitespace\"",
            )),
        }
    }
}
