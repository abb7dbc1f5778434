//! The lines of a file, each of which is changed before its cells are read: a stamp of a terminal program, columns of a
//! fixed width, and rows from the newest to the oldest.

use crate::pieces::{Joined, Pieces};
use crate::stamps::as_cell;
use std::io::{BufRead, BufReader, Error, ErrorKind, Read, Result};
use std::ops::Range;

/// Longest line that is changed, in bytes.
const LONGEST: u64 = 1 << 20;
/// Largest size in bytes of a file whose rows are read from its end: it is held as a whole.
const LARGEST: u64 = 1 << 28;

/// The change of a line.
pub enum Change {
    /// The stamp, which this mark ends, becomes a cell before this separator.
    Stamp(String, char),
    /// Columns of these widths become cells between commas.
    Widths(Vec<u16>),
}

impl Change {
    fn of(&self, line: &str) -> Option<String> {
        match self {
            Self::Stamp(mark, delimiter) => as_cell(line, mark, *delimiter),
            Self::Widths(widths) => Some(cut(line, widths)),
        }
    }
}

/// A line whose columns have these widths in characters, with commas between its cells; the last column reaches to the
/// end of the line.
#[must_use]
pub fn cut(line: &str, widths: &[u16]) -> String {
    let ends = |c: char| c == '\n' || c == '\r';
    let text = line.trim_end_matches(ends);
    let mut rest = text;
    let mut cells = Vec::new();
    for width in widths.iter().take(widths.len().saturating_sub(1)) {
        let end = rest.char_indices().nth(usize::from(*width)).map_or(rest.len(), |(at, _)| at);
        let (cell, after) = rest.split_at(end);
        cells.push(cell.trim());
        rest = after;
    }
    cells.push(rest.trim());
    cells.join(",") + &line[text.len()..]
}

/// The lines of a file, changed one by one.
pub struct Lines<R> {
    file: BufReader<R>,
    change: Change,
}

impl<R: Read> Lines<R> {
    pub(crate) fn new(file: R, change: Change) -> Joined<Self> {
        Joined::new(Self { file: BufReader::new(file), change })
    }
}

impl<R: Read> Pieces for Lines<R> {
    fn next(&mut self, line: &mut Vec<u8>) -> Result<bool> {
        (&mut self.file).take(LONGEST).read_until(b'\n', line)?;
        let changed = (!line.is_empty()).then(|| self.change.of(&String::from_utf8_lossy(line)));
        if let Some(changed) = changed.flatten() {
            *line = changed.into_bytes();
        }
        Ok(!line.is_empty())
    }
}

/// The lines of a file from the last to the first, below as many of its first lines as stand before its rows.
pub struct Backwards<R> {
    file: R,
    above: usize,
    bytes: Vec<u8>,
    /// The places of the lines that are still to be given, the next one last, once the file was read.
    left: Option<Vec<Range<usize>>>,
}

impl<R: Read> Backwards<R> {
    pub(crate) fn new(file: R, above: u64) -> Joined<Self> {
        let above = usize::try_from(above).unwrap_or(usize::MAX);
        Joined::new(Self { file, above, bytes: Vec::new(), left: None })
    }

    /// Reads the file, and finds its lines.
    fn fill(&mut self) -> Result<Vec<Range<usize>>> {
        (&mut self.file).take(LARGEST + 1).read_to_end(&mut self.bytes)?;
        if self.bytes.len() as u64 > LARGEST {
            let text = format!(
                "a file whose rows run backwards may have {LARGEST} bytes: sort its rows by their time"
            );
            return Err(Error::new(ErrorKind::InvalidData, text));
        }
        if !self.bytes.is_empty() && !self.bytes.ends_with(b"\n") {
            self.bytes.push(b'\n');
        }
        let mut begin = 0;
        let place = |line: &[u8]| {
            let from = begin;
            begin += line.len();
            from..begin
        };
        let mut lines: Vec<_> = self.bytes.split_inclusive(|b| *b == b'\n').map(place).collect();
        let first: Vec<_> = lines.drain(..self.above.min(lines.len())).collect();
        lines.extend(first.into_iter().rev());
        Ok(lines)
    }
}

impl<R: Read> Pieces for Backwards<R> {
    fn next(&mut self, line: &mut Vec<u8>) -> Result<bool> {
        let mut left = match self.left.take() {
            Some(left) => left,
            None => self.fill()?,
        };
        let place = left.pop();
        self.left = Some(left);
        place.clone().into_iter().for_each(|place| line.extend_from_slice(&self.bytes[place]));
        Ok(place.is_some())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_a_fixed_width_are_cells_also_where_they_touch() {
        let text = "    TIME      GX\r\n   0.010-0.12345-9.80665\n\u{e4}1.5";
        let mut rows = String::new();
        let change = Change::Widths(vec![8, 8, 8]);
        assert!(Lines::new(text.as_bytes(), change).read_to_string(&mut rows).is_ok());
        assert_eq!(rows, "TIME,GX,\r\n0.010,-0.12345,-9.80665\n\u{e4}1.5,,");
    }

    #[test]
    fn rows_are_given_from_the_last_to_the_first_below_their_headings() {
        for (text, above, rows) in [
            ("t,x\n3,c\n2,b\n1,a", 1, "t,x\n1,a\n2,b\n3,c\n"),
            ("2\n1\n", 0, "1\n2\n"),
            ("a\nb\n", 5, "a\nb\n"),
            ("", 1, ""),
        ] {
            let mut read = String::new();
            assert!(Backwards::new(text.as_bytes(), above).read_to_string(&mut read).is_ok());
            assert_eq!(read, rows);
        }
    }
}
