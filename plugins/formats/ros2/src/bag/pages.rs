//! The pages of an SQLite database.

use navfuse_core::input::Input;
use std::io::{ErrorKind, Read, Result, Seek, SeekFrom};

/// Bytes that are read at once where pages follow each other.
const AHEAD: usize = 256 * 1024;
/// Bytes that are read at once elsewhere.
const APART: usize = 16 * 1024;

/// The pages of a file, numbered from 1.
pub struct Pages {
    file: Input,
    /// Size of a page, and the bytes of it that are used.
    pub size: usize,
    pub usable: usize,
    /// Number of pages that the file has.
    pub count: u32,
    buffer: Vec<u8>,
    /// Offset of the buffer in the file.
    at: u64,
}

impl Pages {
    /// The pages of a database; `None` if its header is damaged.
    pub fn new(mut file: Input) -> Result<Option<Self>> {
        let mut header = [0; 100];
        file.seek(SeekFrom::Start(0))?;
        match file.read_exact(&mut header) {
            Err(e) if e.kind() == ErrorKind::UnexpectedEof => return Ok(None),
            other => other?,
        }
        let size = match u16::from_be_bytes([header[16], header[17]]) {
            1 => 65_536,
            n => usize::from(n),
        };
        let usable = size.saturating_sub(usize::from(header[20]));
        if !size.is_power_of_two() || size < 512 || usable < 480 {
            return Ok(None);
        }
        let length = file.metadata()?.len();
        let count = u32::try_from(length.div_ceil(size as u64)).unwrap_or(u32::MAX);
        Ok(Some(Self { file, size, usable, count, buffer: Vec::new(), at: 0 }))
    }

    /// The bytes of a page; `None` if the file has it not, or not whole.
    pub fn page(&mut self, number: u32) -> Result<Option<&[u8]>> {
        if number == 0 || number > self.count {
            return Ok(None);
        }
        let offset = u64::from(number - 1) * self.size as u64;
        let end = self.at + self.buffer.len() as u64;
        if offset < self.at || offset + self.size as u64 > end {
            let ahead = if offset == end { AHEAD } else { APART };
            self.buffer.resize(ahead.max(self.size), 0);
            self.at = offset;
            self.file.seek(SeekFrom::Start(offset))?;
            let mut filled = 0;
            while filled < self.buffer.len() {
                match self.file.read(&mut self.buffer[filled..]) {
                    Ok(0) => break,
                    Ok(n) => filled += n,
                    Err(e) if e.kind() == ErrorKind::Interrupted => {}
                    Err(e) => return Err(e),
                }
            }
            self.buffer.truncate(filled);
        }
        let from = (offset - self.at) as usize;
        Ok(self.buffer.get(from..from + self.size))
    }
}
