//! A window on a stream of bytes, as long as the record that is looked at.

use std::io::{ErrorKind, Read, Result};

/// Smallest number of bytes that the first call reads from the stream, and every later one.
const FIRST: usize = 16 * 1024;
const BLOCK: usize = 256 * 1024;

/// The bytes of a stream from a place on.
#[derive(Debug)]
pub struct Window<R = Box<dyn Read + Send>> {
    reader: R,
    buffer: Vec<u8>,
    start: usize,
    end: usize,
    /// Offset in the stream of the first byte of the buffer.
    base: u64,
    ended: bool,
}

impl<R: Read> Window<R> {
    /// A window at the beginning of a stream.
    pub fn new(reader: R) -> Self {
        Self { reader, buffer: Vec::new(), start: 0, end: 0, base: 0, ended: false }
    }

    /// Offset of the window in the stream.
    pub fn offset(&self) -> u64 {
        self.base + self.start as u64
    }

    /// Number of bytes that were read from the stream.
    pub fn read(&self) -> u64 {
        self.base + self.end as u64
    }

    /// The bytes that are there.
    pub fn bytes(&self) -> &[u8] {
        &self.buffer[self.start..self.end]
    }

    /// Reads until this many bytes are there; `false` if the stream ends before. The buffer grows
    /// with the bytes that exist, whatever their number is claimed to be.
    ///
    /// # Errors
    /// When the stream cannot be read.
    pub fn need(&mut self, count: usize) -> Result<bool> {
        while self.end - self.start < count {
            if !self.more()? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Reads more bytes; `false` at the end of the stream.
    ///
    /// # Errors
    /// When the stream cannot be read.
    pub fn more(&mut self) -> Result<bool> {
        if self.ended {
            return Ok(false);
        }
        let block = self.buffer.len().clamp(FIRST, BLOCK);
        if self.start > 0 && self.buffer.len() - self.end < block {
            self.buffer.copy_within(self.start..self.end, 0);
            self.base += self.start as u64;
            self.end -= self.start;
            self.start = 0;
        }
        if self.buffer.len() - self.end < block {
            self.buffer.resize(self.end + block.max(self.end / 2), 0);
        }
        loop {
            match self.reader.read(&mut self.buffer[self.end..]) {
                Ok(0) => self.ended = true,
                Ok(read) => self.end += read,
                Err(e) if e.kind() == ErrorKind::Interrupted => continue,
                Err(e) => return Err(e),
            }
            return Ok(!self.ended);
        }
    }

    /// Moves forward by bytes that are there.
    pub fn skip(&mut self, count: usize) {
        self.start = (self.start + count).min(self.end);
    }

    /// Moves forward by any number of bytes; `false` if the stream ends before.
    pub fn pass(&mut self, mut count: u64) -> Result<bool> {
        loop {
            let here = (self.end - self.start) as u64;
            if count <= here {
                self.skip(count as usize);
                return Ok(true);
            }
            self.skip(here as usize);
            count -= here;
            if !self.need(1)? {
                return Ok(false);
            }
        }
    }
}
