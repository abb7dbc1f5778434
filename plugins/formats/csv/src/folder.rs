//! A folder with a file for each row, as KITTI has them: `data/0000000000.txt` and so on, and the times
//! of the rows in the lines of `timestamps.txt`.

use navfuse_core::input::{self, Input};
use std::io::{BufRead, BufReader, Error, ErrorKind, Read, Result};
use std::path::{Path, PathBuf};

/// Largest size of a row, in bytes.
const ROW: u64 = 64 * 1024;

/// Tests whether a folder has a file for each row, and their times.
pub fn is_folder(path: &Path) -> bool {
    path.join("timestamps.txt").is_file() && path.join("data").is_dir()
}

/// The rows of a folder as one table, each after its time.
pub struct Folder {
    files: std::vec::IntoIter<PathBuf>,
    times: BufReader<Input>,
    row: Vec<u8>,
    /// Number of bytes of the row that were given.
    given: usize,
}

impl Folder {
    /// Opens a folder.
    ///
    /// # Errors
    /// When it has no rows or no times.
    pub fn open(path: &Path) -> Result<Self> {
        let entries = std::fs::read_dir(path.join("data"))?.flatten().map(|entry| entry.path());
        let mut files: Vec<PathBuf> =
            entries.filter(|p| p.extension().is_some_and(|e| e == "txt")).collect();
        files.sort();
        let times = BufReader::new(input::open(&path.join("timestamps.txt"))?);
        Ok(Self { files: files.into_iter(), times, row: Vec::new(), given: 0 })
    }

    /// Reads the next row; `false` at the end.
    fn advance(&mut self) -> Result<bool> {
        let Some(file) = self.files.next() else { return Ok(false) };
        self.row.clear();
        self.given = 0;
        (&mut self.times).take(ROW).read_until(b'\n', &mut self.row)?;
        while self.row.last().is_some_and(u8::is_ascii_whitespace) {
            self.row.pop();
        }
        if self.row.is_empty() {
            let text = format!("timestamps.txt has no line for {}", file.display());
            return Err(Error::new(ErrorKind::InvalidData, text));
        }
        self.row.push(b' ');
        let begin = self.row.len();
        input::open(&file)?.take(ROW).read_to_end(&mut self.row)?;
        // a row has one line
        let line = self.row[begin..].iter().position(|b| matches!(b, b'\n' | b'\r'));
        self.row.truncate(line.map_or(self.row.len(), |at| begin + at));
        self.row.push(b'\n');
        Ok(true)
    }
}

impl Read for Folder {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize> {
        while self.given == self.row.len() {
            if !self.advance()? {
                return Ok(0);
            }
        }
        let count = bytes.len().min(self.row.len() - self.given);
        bytes[..count].copy_from_slice(&self.row[self.given..self.given + count]);
        self.given += count;
        Ok(count)
    }
}
