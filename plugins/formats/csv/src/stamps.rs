//! Stamps that a terminal program writes before each line: `22:13:20.010 -> 0.1,0.2` of the Arduino IDE, and
//! `[2023-11-14 22:13:20.010] 0.1,0.2`.

use std::io::{BufRead, BufReader, Read, Result};

/// Longest line of which a stamp is taken, in bytes.
const LONGEST: u64 = 1 << 20;

/// The stamp and the rest of a line; `None` for a line without the mark that ends the stamp.
#[must_use]
pub fn stamp<'a>(line: &'a str, mark: &str) -> Option<(&'a str, &'a str)> {
    let (stamp, rest) = line.split_once(mark)?;
    Some((stamp.trim_start_matches('[').trim(), rest.trim_start()))
}

/// A line whose stamp is its first cell; a date and its time become one word.
#[must_use]
pub fn as_cell(line: &str, mark: &str, delimiter: char) -> Option<String> {
    let (stamp, rest) = stamp(line, mark)?;
    Some(format!("{}{delimiter}{rest}", stamp.replacen(' ', "T", 1)))
}

/// The lines of a file with their stamps as first cells.
pub struct Stamps<R> {
    file: BufReader<R>,
    mark: String,
    delimiter: char,
    line: Vec<u8>,
    /// Number of bytes of the line that were given.
    given: usize,
}

impl<R: Read> Stamps<R> {
    /// The lines of a file, with the mark that ends a stamp.
    pub fn new(file: R, mark: String, delimiter: char) -> Self {
        Self { file: BufReader::new(file), mark, delimiter, line: Vec::new(), given: 0 }
    }
}

impl<R: Read> Read for Stamps<R> {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize> {
        if self.given == self.line.len() {
            let mut line = Vec::new();
            (&mut self.file).take(LONGEST).read_until(b'\n', &mut line)?;
            let changed = as_cell(&String::from_utf8_lossy(&line), &self.mark, self.delimiter);
            (self.line, self.given) = (changed.map_or(line, String::into_bytes), 0);
        }
        let rest = &self.line[self.given..];
        let count = rest.len().min(bytes.len());
        bytes[..count].copy_from_slice(&rest[..count]);
        self.given += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stamp_of_a_terminal_is_the_first_cell_of_its_line() {
        let text = "Opening port\n22:13:20.010 -> 0.1,-0.2\r\n[2023-11-14 22:13:20.020] 0.3,0.4";
        let read = |mark: &str| {
            let mut rows = String::new();
            let done = Stamps::new(text.as_bytes(), mark.to_owned(), ',').read_to_string(&mut rows);
            assert!(done.is_ok());
            rows
        };
        assert!(read("->").contains("\n22:13:20.010,0.1,-0.2\r\n["));
        assert!(read("]").ends_with("\n2023-11-14T22:13:20.020,0.3,0.4"));
    }
}
