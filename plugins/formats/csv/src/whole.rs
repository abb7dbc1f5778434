//! Forms of text that are read as a whole, because the values of one row stand far from each other.

use crate::cdl;
use crate::html;
use crate::keyed;
use crate::matrices;
use crate::pivot;
use crate::transposed::{self, Columns};
use std::io::{Error, ErrorKind, Read, Result};

/// Largest size of such a file in bytes: it takes twice as much memory.
pub const LARGEST: u64 = 1 << 28;

/// The form of a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Whole {
    /// Arrays of JSON, one for each column.
    Json,
    /// An object of JSON for each row.
    Keyed,
    /// A time, a name and a value in each row.
    Long,
    /// Matrices of a script of MATLAB.
    Matrices,
    /// Lists of numbers.
    Lists,
    /// Tables of HTML.
    Html,
    /// NetCDF as text.
    Cdl,
}

impl Whole {
    /// The form of a file that begins with this text.
    pub fn of(text: &str) -> Option<Self> {
        let json = text.trim_start().starts_with(['{', '[']);
        match text {
            _ if json && transposed::begins(text) => Some(Self::Json),
            _ if json && keyed::begins(text) => Some(Self::Keyed),
            _ if matrices::lists(text) => Some(Self::Lists),
            _ if pivot::begins(text) => Some(Self::Long),
            _ if matrices::begins(text) => Some(Self::Matrices),
            _ if html::begins(text) => Some(Self::Html),
            _ if cdl::begins(text) => Some(Self::Cdl),
            _ => None,
        }
    }

    /// Reads a file.
    ///
    /// # Errors
    /// When it cannot be read or is too large.
    pub fn read(self, file: &mut impl Read) -> Result<Columns> {
        let mut bytes = Vec::new();
        file.take(LARGEST + 1).read_to_end(&mut bytes)?;
        if bytes.len() as u64 > LARGEST {
            let text = format!(
                "a file of this form, which is read as a whole, has more than {LARGEST} bytes"
            );
            return Err(Error::new(ErrorKind::InvalidData, text));
        }
        let text = String::from_utf8_lossy(&bytes);
        Ok(match self {
            Self::Json => Columns::of(&text),
            Self::Keyed => Columns::new(keyed::read(&text)),
            Self::Long => Columns::new(pivot::read(&text)),
            Self::Matrices => Columns::new(matrices::read(&text)),
            Self::Lists => Columns::new(matrices::read_lists(&text)),
            Self::Html => Columns::new(html::read(&text)),
            Self::Cdl => Columns::new(cdl::read(&text)),
        })
    }
}
