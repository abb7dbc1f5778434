//! The records of an MCAP file from front to back, in chunks and outside, with damaged parts skipped.

use super::{
    CHUNK_HEAD, Fields, HEAD, LONGEST, MAGIC, PackedChunk, Unpacker, head, op, whole_head,
};
use crate::{Count, Window};
use std::collections::BTreeSet;
use std::io::Result;
use std::ops::Range;

/// Bytes of a message before its data.
pub const MESSAGE_HEAD: usize = 22;
/// Largest length in bytes that a record without use may claim: no file is this long.
const PASSED: u64 = 1 << 40;
/// Largest size in bytes of a schema or channel that ends a search.
const DEFINITION: usize = 1 << 20;
/// Difference of log times, in nanoseconds, beyond which a possible message after damage is none.
const DAY: u64 = 86_400_000_000_000;

/// Treatment of chunks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Chunks {
    /// The records in a chunk are read.
    Unpacked,
    /// A chunk is one record without content.
    Passed,
}

/// The parts of a file that hold no intact record.
#[derive(Clone, Debug, Default)]
pub struct Lost {
    /// Chunks whose checksum differs, or that do not unpack.
    pub chunks: Count,
    /// Places at which no record begins.
    pub places: Count,
    /// Number of bytes from these places to the next record.
    pub bytes: u64,
    /// Offset at which a file ends too early.
    pub cuts: Vec<u64>,
}

impl Lost {
    /// Describes what was skipped, in clauses; the cuts are left to the caller.
    pub fn describe(&self) -> Vec<String> {
        let mut parts = Vec::from_iter(self.chunks.describe("chunk", "skipped, damaged,"));
        if let Some(places) = self.places.describe("place", "without an intact record") {
            parts.push(format!("{places}, {} bytes skipped", self.bytes));
        }
        parts
    }
}

/// The place of the content of a record, until the next one is read.
#[derive(Clone, Debug)]
pub struct Place {
    in_chunk: bool,
    range: Range<usize>,
}

impl Place {
    /// The place without the first bytes.
    #[must_use]
    pub fn after(mut self, count: usize) -> Self {
        self.range.start = self.range.end.min(self.range.start + count);
        self
    }
}

/// A record.
#[derive(Clone, Debug)]
pub struct Found {
    /// The opcode.
    pub opcode: u8,
    /// Offset of the record, or of its chunk.
    pub offset: u64,
    /// The place of its content.
    pub place: Place,
}

/// The records of a file. The memory needed does not depend on the length of the file.
pub struct Records {
    window: Window,
    chunks: Chunks,
    unpacker: Unpacker,
    /// Offset of the beginning of the file.
    base: u64,
    /// The chunk that is being read, the place in it, and its offset.
    chunk: Vec<u8>,
    at: usize,
    chunk_offset: u64,
    /// The channels that were described, and the log time of the last message.
    channels: BTreeSet<u16>,
    last_time: Option<u64>,
    /// Size of the record in the window that the next call passes.
    used: usize,
    ended: bool,
}

impl Records {
    /// The records of a file that begins with [`MAGIC`]; offsets count from `base`.
    pub fn new(mut window: Window, base: u64, chunks: Chunks) -> Self {
        window.skip(MAGIC.len());
        Self {
            window,
            chunks,
            unpacker: Unpacker::default(),
            base,
            chunk: Vec::new(),
            at: 0,
            chunk_offset: 0,
            channels: BTreeSet::new(),
            last_time: None,
            used: 0,
            ended: false,
        }
    }

    /// Number of bytes that were read.
    pub fn position(&self) -> u64 {
        self.window.read()
    }

    /// The content of the record that was found last.
    pub fn content(&self, place: &Place) -> &[u8] {
        let buffer = if place.in_chunk { &self.chunk } else { self.window.bytes() };
        buffer.get(place.range.clone()).unwrap_or_default()
    }

    /// Finds the next schema, channel, message or metadata; `None` at the end of the file.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn next(&mut self, lost: &mut Lost) -> Result<Option<Found>> {
        loop {
            let found = if self.at < self.chunk.len() {
                self.in_chunk(lost)
            } else {
                self.window.skip(std::mem::take(&mut self.used));
                if self.ended {
                    return Ok(None);
                }
                self.in_window(lost)?
            };
            if let Some(found) = found.filter(|found| is_used(found.opcode)) {
                self.note(&found);
                return Ok(Some(found));
            }
        }
    }

    /// Keeps what tells a message from damage.
    fn note(&mut self, found: &Found) {
        let mut fields = Fields(self.content(&found.place));
        match (found.opcode, fields.u16()) {
            (op::CHANNEL, Some(id)) => drop(self.channels.insert(id)),
            (op::MESSAGE, Some(_)) => self.last_time = fields.u32().and_then(|_| fields.u64()),
            _ => {}
        }
    }

    /// Reads the next record of the chunk.
    fn in_chunk(&mut self, lost: &mut Lost) -> Option<Found> {
        let Some((opcode, length)) = whole_head(&self.chunk[self.at..]) else {
            self.at = self.chunk.len();
            // of a chunk that the end of the file cuts off, the rest is missing
            if !self.ended {
                lost.chunks.add(self.chunk_offset);
            }
            return None;
        };
        let range = self.at + HEAD..self.at + HEAD + length;
        self.at = range.end;
        let place = Place { in_chunk: true, range };
        Some(Found { opcode, offset: self.chunk_offset, place })
    }

    /// Reads the record at the beginning of the window; `None` if it holds nothing of use.
    fn in_window(&mut self, lost: &mut Lost) -> Result<Option<Found>> {
        self.window.need(HEAD)?;
        let Some((opcode, length)) = head(self.window.bytes()) else {
            self.cut_off(lost);
            return Ok(None);
        };
        let offset = self.offset();
        match opcode {
            op::FOOTER if length == 20 => self.footer(lost)?,
            op::CHUNK if self.chunks == Chunks::Passed => {
                self.pass(length, lost)?;
                let place = Place { in_chunk: false, range: 0..0 };
                return Ok(Some(Found { opcode, offset, place }));
            }
            op::CHUNK if length <= LONGEST as u64 => self.unpack(length as usize, lost)?,
            _ if is_used(opcode) && length <= LONGEST as u64 => {
                let size = HEAD + length as usize;
                if self.window.need(size)? {
                    self.used = size;
                    let place = Place { in_chunk: false, range: HEAD..size };
                    return Ok(Some(Found { opcode, offset, place }));
                }
                self.resume(lost)?;
            }
            // also records of later versions and of other programs
            op::HEADER | op::MESSAGE_INDEX..=op::DATA_END | 0x80.. if !is_used(opcode) => {
                self.pass(length, lost)?;
            }
            _ => self.resume(lost)?,
        }
        Ok(None)
    }

    /// Offset of the window.
    fn offset(&self) -> u64 {
        self.base + self.window.offset()
    }

    /// Ends the file at its footer, which the mark at the end follows.
    fn footer(&mut self, lost: &mut Lost) -> Result<()> {
        let size = HEAD + 20;
        if self.window.need(size + MAGIC.len())? && self.window.bytes()[size..].starts_with(MAGIC) {
            self.ended = true;
        } else {
            self.cut_off(lost);
        }
        Ok(())
    }

    /// Passes a record without use.
    fn pass(&mut self, length: u64, lost: &mut Lost) -> Result<()> {
        if length > PASSED {
            return self.resume(lost);
        }
        if length > LONGEST as u64 || self.chunks == Chunks::Passed {
            if !self.window.pass(HEAD as u64 + length)? {
                self.cut_off(lost);
            }
        } else if self.window.need(HEAD + length as usize)? {
            self.used = HEAD + length as usize;
        } else {
            self.resume(lost)?;
        }
        Ok(())
    }

    /// The file ends too early: all of it was read.
    fn cut_off(&mut self, lost: &mut Lost) {
        lost.cuts.push(self.base + self.window.read());
        self.window.skip(self.window.bytes().len());
        self.ended = true;
    }

    /// Unpacks the chunk in the window, as far as it is there.
    fn unpack(&mut self, length: usize, lost: &mut Lost) -> Result<()> {
        let whole = self.window.need(HEAD + length)?;
        let offset = self.offset();
        let there = self.window.bytes().len().min(HEAD + length);
        let content = &self.window.bytes()[HEAD..there];
        let Some(chunk) = PackedChunk::new(content).filter(|c| c.fits(length)) else {
            // the length is damaged, or the file ends
            return self.resume(lost);
        };
        (self.at, self.chunk_offset) = (0, offset);
        if whole {
            if !self.unpacker.unpack(&chunk, &mut self.chunk) {
                self.chunk.clear();
                lost.chunks.add(offset);
            }
            self.used = HEAD + length;
        } else {
            chunk.unpack_beginning(&mut self.chunk);
            self.cut_off(lost);
        }
        Ok(())
    }

    /// Searches the next record after damage.
    fn resume(&mut self, lost: &mut Lost) -> Result<()> {
        let from = self.offset();
        self.window.skip(1);
        loop {
            self.window.need(1 << 16)?;
            let bytes = self.window.bytes();
            if bytes.len() < HEAD {
                self.cut_off(lost);
                return Ok(());
            }
            // opcodes of the records between which a search can end
            let begins = |b: &u8| (op::SCHEMA..=op::DATA_END).contains(b) || *b == op::FOOTER;
            let skip = bytes.iter().position(begins).unwrap_or(bytes.len());
            self.window.skip(skip);
            if self.window.bytes().len() >= HEAD && self.plausible()? {
                break;
            }
            self.window.skip(1);
        }
        lost.places.add(from);
        lost.bytes += self.offset() - from;
        Ok(())
    }

    /// Tests whether a record begins here, after damage.
    fn plausible(&mut self) -> Result<bool> {
        let Some((opcode, length)) = head(self.window.bytes()) else { return Ok(false) };
        let Some(length) = usize::try_from(length).ok().filter(|n| *n <= LONGEST) else {
            return Ok(false);
        };
        match opcode {
            op::DATA_END => return Ok(length == 4),
            op::FOOTER => return Ok(length == 20),
            op::CHUNK => {
                self.window.need(HEAD + CHUNK_HEAD + 4)?;
                let content = &self.window.bytes()[HEAD..];
                return Ok(PackedChunk::new(content).is_some_and(|c| {
                    matches!(c.compression, b"" | b"zstd" | b"lz4") && c.fits(length)
                }));
            }
            op::MESSAGE if length < MESSAGE_HEAD || !self.is_near() => return Ok(false),
            op::MESSAGE => {}
            op::SCHEMA | op::CHANNEL if (8..DEFINITION).contains(&length) => {}
            _ => return Ok(false),
        }
        // another record follows, or the end
        self.window.need(HEAD + length + HEAD)?;
        let next = self.window.bytes().get(HEAD + length..).unwrap_or_default();
        Ok(match head(next) {
            Some((opcode, length)) => {
                (op::SCHEMA..=op::DATA_END).contains(&opcode) && length <= LONGEST as u64
            }
            None => next.is_empty() && self.window.bytes().len() == HEAD + length,
        })
    }

    /// Tests whether the message here is of a known channel and of a time near the last one.
    fn is_near(&self) -> bool {
        let mut fields = Fields(self.window.bytes().get(HEAD..).unwrap_or_default());
        let (channel, _, log) = (fields.u16(), fields.u32(), fields.u64());
        let known = channel.is_some_and(|c| self.channels.contains(&c));
        known && log.zip(self.last_time).is_some_and(|(a, b)| a.abs_diff(b) < DAY)
    }
}

/// True for a record whose content is read.
fn is_used(opcode: u8) -> bool {
    matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE | op::METADATA | op::CHUNK)
}
