//! MCAP, read from front to back: messages in chunks and outside, with damaged parts skipped.

use super::faults::Faults;
use super::topics::{Found, Place, Topic, Topics};
use navfuse_frames::Window;
use navfuse_frames::mcap::{
    CHUNK_HEAD, Fields, HEAD, LONGEST, MAGIC, PackedChunk, Unpacker, head, whole_head,
};
use std::collections::BTreeMap;
use std::io::Result;

const HEADER: u8 = 0x01;
const FOOTER: u8 = 0x02;
const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;
const CHUNK: u8 = 0x06;
const ATTACHMENT: u8 = 0x09;
const METADATA: u8 = 0x0c;
const DATA_END: u8 = 0x0f;
/// Bytes of a message before its data.
const MESSAGE_HEAD: usize = 22;
/// Largest size in bytes of a definition, and largest number of them.
const LONGEST_DEFINITION: usize = 1 << 17;
const MOST_DEFINITIONS: usize = 2048;
/// Difference of log times, in nanoseconds, beyond which a possible message after damage is none.
const DAY: u64 = 86_400_000_000_000;

/// An MCAP file.
pub struct Mcap {
    window: Window,
    unpacker: Unpacker,
    /// Offset of the file in the bag.
    base: u64,
    /// The chunk that is being read, the place in it, and its offset.
    chunk: Vec<u8>,
    at: usize,
    chunk_offset: u64,
    schemas: BTreeMap<u16, (String, String, String)>,
    channels: BTreeMap<u16, usize>,
    last_time: Option<u64>,
    /// Size of the record in the window that the next call passes.
    used: usize,
    /// Set once `DataEnd` was read: the summary that follows has no messages.
    ended: bool,
}

impl Mcap {
    /// A file that begins with [`MAGIC`], at an offset of its bag.
    pub fn new(mut window: Window, base: u64) -> Self {
        window.skip(MAGIC.len());
        Self {
            window,
            unpacker: Unpacker::default(),
            base,
            chunk: Vec::new(),
            at: 0,
            chunk_offset: 0,
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            last_time: None,
            used: 0,
            ended: false,
        }
    }

    /// The bytes of a message that [`Self::advance`] found.
    pub fn data(&self, place: &Place) -> &[u8] {
        let (buffer, range) = match place {
            Place::Chunk(range) => (&self.chunk[..], range),
            Place::Window(range) => (self.window.bytes(), range),
            Place::Row(_) => return &[],
        };
        buffer.get(range.clone()).unwrap_or_default()
    }

    /// Offset of the bytes read so far, in the bag.
    pub fn offset(&self) -> u64 {
        self.base + self.window.offset()
    }

    /// Finds the next message; `None` at the end of the file.
    pub fn advance(&mut self, topics: &mut Topics, faults: &mut Faults) -> Result<Option<Found>> {
        loop {
            if self.at < self.chunk.len() {
                if let Some(found) = self.in_chunk(topics, faults) {
                    return Ok(Some(found));
                }
                continue;
            }
            self.window.skip(std::mem::take(&mut self.used));
            if self.ended {
                return Ok(None);
            }
            if !self.window.need(HEAD)? {
                // an intact file ends with `DataEnd` and the summary
                self.end(self.offset(), faults);
                continue;
            }
            let Some((opcode, length)) = head(self.window.bytes()) else { continue };
            match opcode {
                CHUNK | MESSAGE | SCHEMA | CHANNEL if length > LONGEST as u64 => {
                    self.resume(faults)?;
                }
                CHUNK => self.chunk(length as usize, faults)?,
                MESSAGE | SCHEMA | CHANNEL => {
                    let size = HEAD + length as usize;
                    if !self.window.need(size)? {
                        self.resume(faults)?;
                        continue;
                    }
                    self.used = size;
                    let offset = self.offset();
                    if let Some(found) = self.record(opcode, None, offset, topics, faults) {
                        return Ok(Some(found));
                    }
                }
                DATA_END if length == 4 => self.ended = true,
                FOOTER if length == 20 => self.ended = true,
                // also records of later versions and of other programs
                HEADER | ATTACHMENT..=METADATA | 0x07 | 0x08 | 0x0d | 0x0e | 0x80.. => {
                    self.pass(length, faults)?;
                }
                _ => self.resume(faults)?,
            }
        }
    }

    /// Passes a record that is not needed.
    fn pass(&mut self, length: u64, faults: &mut Faults) -> Result<()> {
        // an attachment may have any length, but no file is this long
        if length > 1 << 40 {
            return self.resume(faults);
        }
        if length > LONGEST as u64 {
            let whole = self.window.pass(HEAD as u64 + length)?;
            if !whole {
                self.end(self.offset(), faults);
            }
        } else if self.window.need(HEAD + length as usize)? {
            self.used = HEAD + length as usize;
        } else {
            self.resume(faults)?;
        }
        Ok(())
    }

    /// The file ends too early, after the last intact byte.
    fn end(&mut self, at: u64, faults: &mut Faults) {
        faults.cuts.push(at);
        let left = self.window.bytes().len();
        self.window.skip(left);
        self.ended = true;
    }

    /// Unpacks the chunk in the window.
    fn chunk(&mut self, length: usize, faults: &mut Faults) -> Result<()> {
        let whole = self.window.need(HEAD + length)?;
        let offset = self.offset();
        let there = self.window.bytes().len().min(HEAD + length);
        let content = &self.window.bytes()[HEAD..there];
        let chunk = PackedChunk::new(content).filter(|c| c.fits(length));
        if chunk.is_none() {
            // the length is damaged, or the file ends
            return self.resume(faults);
        }
        (self.at, self.chunk_offset) = (0, offset);
        match chunk {
            Some(c) if whole => {
                if self.unpacker.unpack(&c, &mut self.chunk).is_err() {
                    self.chunk.clear();
                    faults.chunks.add(offset);
                }
                self.used = HEAD + length;
            }
            Some(c) => {
                c.unpack_beginning(&mut self.chunk);
                self.end(offset + there as u64, faults);
            }
            None => {}
        }
        Ok(())
    }

    /// Reads the next record of the chunk.
    fn in_chunk(&mut self, topics: &mut Topics, faults: &mut Faults) -> Option<Found> {
        let Some((opcode, length)) = whole_head(&self.chunk[self.at..]) else {
            // the rest of a chunk that was cut off; a whole one has a checksum
            self.at = self.chunk.len();
            return None;
        };
        let content = self.at + HEAD..self.at + HEAD + length;
        self.at = content.end;
        self.record(opcode, Some(content), self.chunk_offset, topics, faults)
    }

    /// Reads a record: in the chunk, or at the beginning of the window.
    fn record(
        &mut self,
        opcode: u8,
        in_chunk: Option<std::ops::Range<usize>>,
        offset: u64,
        topics: &mut Topics,
        faults: &mut Faults,
    ) -> Option<Found> {
        let content = match &in_chunk {
            Some(range) => &self.chunk[range.clone()],
            None => &self.window.bytes()[HEAD..self.used],
        };
        let mut fields = Fields(content);
        match opcode {
            MESSAGE => {
                let times = (fields.u16(), fields.u32(), fields.u64(), fields.u64());
                let (Some(channel), Some(_), Some(log), Some(_)) = times else {
                    faults.records.add(offset);
                    return None;
                };
                self.last_time = Some(log);
                let Some(topic) = self.channels.get(&channel) else {
                    faults.strangers.add(offset);
                    return None;
                };
                let place = match in_chunk {
                    Some(range) => Place::Chunk(range.start + MESSAGE_HEAD..range.end),
                    None => Place::Window(HEAD + MESSAGE_HEAD..self.used),
                };
                let received = i64::try_from(log).unwrap_or(i64::MAX);
                Some(Found { topic: *topic, received, offset, place })
            }
            SCHEMA => {
                if let (Some(id), Some(name), Some(encoding), Some(text)) =
                    (fields.u16(), fields.text(), fields.text(), fields.text())
                    && text.len() <= LONGEST_DEFINITION
                    && self.schemas.len() < MOST_DEFINITIONS
                {
                    self.schemas.insert(id, (name, encoding, text));
                }
                None
            }
            CHANNEL => {
                if let (Some(id), Some(schema), Some(name), Some(encoding)) =
                    (fields.u16(), fields.u16(), fields.text(), fields.text())
                {
                    let schema = self.schemas.get(&schema).cloned();
                    let (kind, form, text) = schema.unwrap_or_default();
                    let definition = (form == "ros2msg").then_some(text);
                    match topics.add(Topic { name, kind, encoding, definition }) {
                        Some(topic) => drop(self.channels.insert(id, topic)),
                        None => faults.records.add(offset),
                    }
                }
                None
            }
            _ => None,
        }
    }

    /// Searches the next record after damage.
    fn resume(&mut self, faults: &mut Faults) -> Result<()> {
        let from = self.offset();
        self.window.skip(1);
        loop {
            self.window.need(1 << 16)?;
            let bytes = self.window.bytes();
            if bytes.len() < HEAD {
                self.end(from, faults);
                return Ok(());
            }
            // opcodes of the records between which a search can end
            let begins = |b: &u8| (SCHEMA..=DATA_END).contains(b) || *b == FOOTER;
            let skip = bytes.iter().position(begins).unwrap_or(bytes.len());
            self.window.skip(skip);
            if self.window.bytes().len() >= HEAD && self.plausible()? {
                break;
            }
            self.window.skip(1);
        }
        faults.places.add(from);
        faults.bytes += self.offset() - from;
        Ok(())
    }

    /// Tests whether a record begins here, after damage.
    fn plausible(&mut self) -> Result<bool> {
        let Some((opcode, length)) = head(self.window.bytes()) else { return Ok(false) };
        let Some(length) = usize::try_from(length).ok().filter(|n| *n <= LONGEST) else {
            return Ok(false);
        };
        match opcode {
            DATA_END => return Ok(length == 4),
            FOOTER => return Ok(length == 20),
            CHUNK => {
                self.window.need(HEAD + CHUNK_HEAD + 4)?;
                let content = &self.window.bytes()[HEAD..];
                return Ok(PackedChunk::new(content).is_some_and(|c| {
                    matches!(c.compression, b"" | b"zstd" | b"lz4") && c.fits(length)
                }));
            }
            MESSAGE => {
                let mut fields = Fields(&self.window.bytes()[HEAD..]);
                let (channel, _, log) = (fields.u16(), fields.u32(), fields.u64());
                let known = channel.is_some_and(|c| self.channels.contains_key(&c));
                let near = log.zip(self.last_time).is_some_and(|(a, b)| a.abs_diff(b) < DAY);
                if length < MESSAGE_HEAD || !known || !near {
                    return Ok(false);
                }
            }
            SCHEMA | CHANNEL if (8..1 << 20).contains(&length) => {}
            _ => return Ok(false),
        }
        // another record follows, or the end
        self.window.need(HEAD + length + HEAD)?;
        let next = self.window.bytes().get(HEAD + length..).unwrap_or_default();
        Ok(match head(next) {
            Some((opcode, length)) => {
                (SCHEMA..=DATA_END).contains(&opcode) && length <= LONGEST as u64
            }
            None => next.is_empty() && self.window.bytes().len() == HEAD + length,
        })
    }
}
