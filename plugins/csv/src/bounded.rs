//! A file whose rows have a bounded length: a file without line ends, or with a quotation mark that
//! is never closed, would otherwise fill the memory with one row.

use std::fs::File;
use std::io::{self, ErrorKind, Read};

/// Largest length of a row, in bytes.
const LONGEST_ROW: usize = 1 << 20;

/// A file, of which at most [`LONGEST_ROW`] bytes and a buffer are read for one row.
pub struct Bounded {
    file: File,
    buffer: usize,
    left: usize,
}

impl Bounded {
    /// A file that is read through a buffer of this size in bytes.
    pub fn new(file: File, buffer: usize) -> Self {
        Self { file, buffer, left: LONGEST_ROW + buffer }
    }

    /// Begins a row.
    pub fn begin_row(&mut self) {
        self.left = LONGEST_ROW + self.buffer;
    }
}

impl Read for Bounded {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let length = bytes.len().min(self.left);
        if length == 0 && !bytes.is_empty() {
            return Err(io::Error::new(
                ErrorKind::InvalidData,
                format!(
                    "a row has more than {LONGEST_ROW} bytes; check the line ends and the \
                     quotation marks"
                ),
            ));
        }
        let count = self.file.read(&mut bytes[..length])?;
        self.left -= count;
        Ok(count)
    }
}
