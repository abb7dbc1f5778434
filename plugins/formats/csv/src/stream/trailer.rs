//! The rows of a file, and the lines after the last of them.

use super::Stream;
use crate::text::ungrouped;

/// Largest number of lines after the last row.
const TRAILER: usize = 50;

impl Stream {
    /// Reads the next row into the record, with numbers whose digits are not grouped; `false` at the end.
    pub(super) fn read_row(&mut self) -> Result<bool, csv::Error> {
        self.reader.get_mut().begin_row();
        let more = self.reader.read_byte_record(&mut self.record)?;
        // between commas, only a quoted cell can hold one; decimal commas have become points
        if self.record.as_slice().contains(&b',') {
            let plain = |cell: &[u8]| ungrouped(cell, self.comma).unwrap_or_else(|| cell.to_vec());
            self.record = self.record.iter().map(plain).collect();
        }
        self.suffixes.remove(&mut self.record);
        self.vectors.spread(&mut self.record);
        Ok(more)
    }

    /// Tests whether the record is no row: neither its first cell nor that of the time is a number or a time, and
    /// it has another number of cells than the headings, or no number at all.
    fn is_no_row(&self) -> bool {
        let number = |cell: &[u8]| {
            std::str::from_utf8(cell.trim_ascii()).is_ok_and(|text| text.parse::<f64>().is_ok())
        };
        let first = self.record.iter().next().is_some_and(number);
        let fits = self.record.len() == self.headings.len();
        !first && self.time.of(&self.record).is_err() && !(fits && self.record.iter().any(number))
    }

    /// The number of lines from the one that was read last to the end of the file, if there are some rows before them,
    /// and they are none.
    pub(super) fn trailer(&mut self) -> Option<usize> {
        self.counter.before()?;
        for lines in 1..=TRAILER {
            if !self.is_no_row() {
                return None;
            }
            if !self.read_row().ok()? {
                return Some(lines);
            }
        }
        None
    }
}
