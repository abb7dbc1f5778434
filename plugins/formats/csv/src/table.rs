//! A CSV file that is written cell by cell.

use crate::time::write_seconds;
use csv::Writer;
use navfuse_core::files::WholeFile;
use navfuse_core::model::stream::StreamError;
use navfuse_core::units::time::Time;
use std::borrow::Cow;
use std::io::Write;
use std::path::PathBuf;

/// A text that a spreadsheet shows and never runs: an apostrophe stands before a sign that begins a
/// formula, and a control character becomes a replacement character.
fn harmless(text: &str) -> Cow<'_, str> {
    let runs = text.starts_with(['=', '+', '-', '@']);
    if !runs && !text.contains(char::is_control) {
        return text.into();
    }
    let shown = text.replace(char::is_control, "\u{fffd}");
    if runs { format!("'{shown}").into() } else { shown.into() }
}

/// A file, written cell by cell.
pub struct Table {
    path: PathBuf,
    /// Until the file is whole.
    writer: Option<Writer<WholeFile>>,
    /// The text of one cell.
    cell: Vec<u8>,
}

impl Table {
    /// Creates the part of a file.
    ///
    /// # Errors
    /// When the file cannot be created.
    pub fn create(path: PathBuf) -> Result<Self, StreamError> {
        let file = WholeFile::create(&path).map_err(|e| StreamError::write(&path, e))?;
        Ok(Self { path, writer: Some(Writer::from_writer(file)), cell: Vec::new() })
    }

    fn write(
        &mut self,
        write: impl FnOnce(&mut Writer<WholeFile>) -> csv::Result<()>,
    ) -> Result<(), StreamError> {
        let Some(writer) = &mut self.writer else {
            return Err(StreamError::write(&self.path, "it is closed"));
        };
        let written = write(writer);
        if written.is_err() {
            // a table with a hole never takes its name
            self.writer = None;
        }
        written.map_err(|e| StreamError::write(&self.path, e))
    }

    /// Writes a cell of text from a scenario.
    ///
    /// # Errors
    /// When the file cannot be written, as for all cells and rows.
    pub fn text(&mut self, cell: &str) -> Result<(), StreamError> {
        self.bytes(harmless(cell).as_bytes())
    }

    /// Writes a cell as it is.
    ///
    /// # Errors
    /// As for [`Self::text`].
    pub fn bytes(&mut self, cell: &[u8]) -> Result<(), StreamError> {
        self.write(|writer| writer.write_field(cell))
    }

    /// Writes a number that reads back to the same bits; a number that is not finite is an empty
    /// cell.
    ///
    /// # Errors
    /// As for [`Self::text`].
    pub fn number(&mut self, value: f64) -> Result<(), StreamError> {
        let mut cell = std::mem::take(&mut self.cell);
        cell.clear();
        if value.is_finite() {
            // writing into a vector cannot fail
            let _ = write!(cell, "{value}");
        }
        let done = self.bytes(&cell);
        self.cell = cell;
        done
    }

    /// Writes a time in seconds, with nine decimals at most.
    ///
    /// # Errors
    /// As for [`Self::bytes`].
    pub fn time(&mut self, time: Time) -> Result<(), StreamError> {
        let mut cell = std::mem::take(&mut self.cell);
        cell.clear();
        write_seconds(time.nanos(), &mut cell);
        let done = self.bytes(&cell);
        self.cell = cell;
        done
    }

    /// Ends a row of cells.
    ///
    /// # Errors
    /// As for [`Self::bytes`].
    pub fn end_row(&mut self) -> Result<(), StreamError> {
        self.write(|writer| writer.write_record(None::<&[u8]>))
    }

    /// Writes a whole row of text.
    ///
    /// # Errors
    /// As for [`Self::bytes`].
    pub fn row<'a>(&mut self, cells: impl IntoIterator<Item = &'a str>) -> Result<(), StreamError> {
        let cells = cells.into_iter().map(harmless);
        self.write(|writer| writer.write_record(cells.map(|cell| cell.into_owned().into_bytes())))
    }

    /// Gives the file its name, and returns its path; `None` for a table with a hole, whose error
    /// has been returned.
    ///
    /// # Errors
    /// When the disk is full or the file cannot be renamed.
    pub fn finish(&mut self) -> Result<Option<String>, StreamError> {
        let failed = |e: std::io::Error| StreamError::write(&self.path, e);
        let Some(writer) = self.writer.take() else { return Ok(None) };
        let file = writer.into_inner().map_err(|e| failed(e.into_error()))?;
        file.finish().map_err(failed)?;
        Ok(Some(self.path.display().to_string()))
    }
}

#[cfg(test)]
mod tests {
    use super::harmless;

    #[test]
    fn a_spreadsheet_runs_no_text_of_a_scenario() {
        for (text, shown) in [
            ("dvl.scale", "dvl.scale"),
            ("=1+1", "'=1+1"),
            ("@SUM(A1)", "'@SUM(A1)"),
            ("-2", "'-2"),
            ("\t=1", "\u{fffd}=1"),
            ("a\u{1b}[2J", "a\u{fffd}[2J"),
        ] {
            assert_eq!(harmless(text), shown);
        }
    }
}
