//! The records of a log, in the order of the file.

use crate::log::StreamFailure;
use mcap::McapError;
use mcap::records::op;
use navfuse_core::model::stream::StreamError;
use navfuse_frames::Window;
use navfuse_frames::mcap::{HEAD, LONGEST, MAGIC, PackedChunk, Unpacker, head, whole_head};
use std::path::{Path, PathBuf};

/// The result of a search in a log.
#[derive(Debug, PartialEq)]
pub enum Step<T> {
    /// The search found something.
    Found(T),
    /// The log has ended.
    End,
    /// The log ends within a record.
    Cut,
}

/// Treatment of the chunks of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Chunks {
    /// The records in a chunk are read.
    Unpacked,
    /// A chunk is one record without content.
    Passed,
}

/// A reason to stop before the next record.
enum Stop {
    /// The file ends within a record.
    Cut,
    /// The file is damaged here, or cannot be read.
    Error(StreamError),
}

/// The records of a file in their order. The memory needed does not depend on the length of the
/// file.
pub struct Records {
    path: PathBuf,
    window: Window,
    chunks: Chunks,
    unpacker: Unpacker,
    /// The records of the current chunk, and the place of the next one in them.
    chunk: Vec<u8>,
    at: usize,
    /// Set if the file ends within this chunk.
    cut: bool,
    /// Number of bytes of the window up to the next record of the file.
    used: usize,
    ended: bool,
}

/// A record: its opcode and the place of its content.
enum Place {
    Window(usize),
    Chunk(usize, usize),
    Passed,
}

impl Records {
    /// Opens a file.
    pub fn open(path: &Path, chunks: Chunks) -> Result<Self, StreamError> {
        let file = navfuse_core::input::open(path).map_err(|e| StreamError::open(path, e))?;
        Ok(Self {
            path: path.to_path_buf(),
            window: Window::new(Box::new(file)),
            chunks,
            unpacker: Unpacker::default(),
            chunk: Vec::new(),
            at: 0,
            cut: false,
            used: 0,
            ended: false,
        })
    }

    /// The path of this file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Number of bytes that were read.
    pub fn position(&self) -> u64 {
        self.window.read()
    }

    /// Reads records until `take` returns a result for one of them.
    pub fn find<T>(
        &mut self,
        mut take: impl FnMut(u8, &[u8]) -> Result<Option<T>, StreamError>,
    ) -> Result<Step<T>, StreamError> {
        loop {
            let (opcode, place) = match self.advance() {
                Ok(Some(record)) => record,
                Ok(None) => return Ok(Step::End),
                Err(Stop::Cut) => return Ok(Step::Cut),
                Err(Stop::Error(error)) => return Err(error),
            };
            let content = match place {
                Place::Window(length) => &self.window.bytes()[HEAD..HEAD + length],
                Place::Chunk(start, end) => &self.chunk[start..end],
                Place::Passed => &[],
            };
            if let Some(found) = take(opcode, content).map_err(|e| e.in_file(&self.path))? {
                return Ok(Step::Found(found));
            }
        }
    }

    /// Finds the next record; `None` at the end of the file.
    fn advance(&mut self) -> Result<Option<(u8, Place)>, Stop> {
        loop {
            if self.at < self.chunk.len() {
                return self.in_chunk().map(Some);
            }
            if self.cut {
                return Err(Stop::Cut);
            }
            if self.ended {
                return Ok(None);
            }
            self.window.skip(std::mem::take(&mut self.used));
            if self.window.offset() == 0 {
                self.begin()?;
            }
            if !self.need(HEAD)? {
                return Err(Stop::Cut);
            }
            let Some((opcode, length)) = head(self.window.bytes()) else {
                return Err(Stop::Cut);
            };
            // nobody reads attachments, which may be of any length
            let passed =
                opcode == op::ATTACHMENT || (opcode == op::CHUNK && self.chunks == Chunks::Passed);
            if passed {
                let size = length.saturating_add(HEAD as u64);
                let whole = self.window.pass(size);
                if !whole.map_err(|e| Stop::Error(StreamError::read(&self.path, e)))? {
                    return Err(Stop::Cut);
                }
                return Ok(Some((opcode, Place::Passed)));
            }
            let Some(length) = usize::try_from(length).ok().filter(|n| *n <= LONGEST) else {
                return Err(self.damaged(McapError::RecordTooLarge { opcode, len: length }));
            };
            let whole = self.need(HEAD + length)?;
            match opcode {
                op::CHUNK => self.unpack(length, whole)?,
                _ if !whole => return Err(Stop::Cut),
                op::FOOTER => {
                    self.end(length)?;
                    return Ok(Some((opcode, Place::Window(length))));
                }
                _ => {
                    self.used = HEAD + length;
                    return Ok(Some((opcode, Place::Window(length))));
                }
            }
        }
    }

    /// Reads the mark at the beginning of the file.
    fn begin(&mut self) -> Result<(), Stop> {
        if !self.need(MAGIC.len())? || !self.window.bytes().starts_with(MAGIC) {
            return Err(Stop::Error(
                StreamError::format("this is not an MCAP file")
                    .in_file(&self.path)
                    .with_remedy("a log of navfuse is called run.mcap"),
            ));
        }
        self.window.skip(MAGIC.len());
        Ok(())
    }

    /// Reads the mark at the end of the file, after the footer.
    fn end(&mut self, length: usize) -> Result<(), Stop> {
        if !self.need(HEAD + length + MAGIC.len())? {
            return Err(Stop::Cut);
        }
        if !self.window.bytes()[HEAD + length..].starts_with(MAGIC) {
            return Err(self.damaged(McapError::BadMagic));
        }
        self.ended = true;
        Ok(())
    }

    /// Unpacks the chunk in the window, as far as it is there.
    fn unpack(&mut self, length: usize, whole: bool) -> Result<(), Stop> {
        let there = self.window.bytes().len().min(HEAD + length);
        let Some(chunk) = PackedChunk::new(&self.window.bytes()[HEAD..there]) else {
            return Err(if whole { self.damaged(McapError::UnexpectedEoc) } else { Stop::Cut });
        };
        if !chunk.fits(length) {
            let (header, available) = (chunk.length, chunk.packed.len() as u64);
            return Err(self.damaged(McapError::BadChunkLength { header, available }));
        }
        self.at = 0;
        if whole {
            let unpacked = self.unpacker.unpack(&chunk, &mut self.chunk);
            if let Err(e) = unpacked {
                self.chunk.clear();
                return Err(self.damaged(e));
            }
            self.used = HEAD + length;
        } else {
            chunk.unpack_beginning(&mut self.chunk);
            self.cut = true;
        }
        Ok(())
    }

    /// Finds the next record of the chunk.
    fn in_chunk(&mut self) -> Result<(u8, Place), Stop> {
        let Some((opcode, length)) = whole_head(&self.chunk[self.at..]) else {
            self.at = self.chunk.len();
            return Err(if self.cut { Stop::Cut } else { self.damaged(McapError::UnexpectedEoc) });
        };
        let start = self.at + HEAD;
        self.at = start + length;
        Ok((opcode, Place::Chunk(start, self.at)))
    }

    fn need(&mut self, count: usize) -> Result<bool, Stop> {
        self.window.need(count).map_err(|e| Stop::Error(StreamError::read(&self.path, e)))
    }

    /// The error of damage at the current place.
    fn damaged(&self, cause: impl Into<StreamFailure>) -> Stop {
        let (at, cause) = (self.window.offset(), cause.into());
        Stop::Error(
            StreamError::format(format!("damaged at byte {at}: {cause}"))
                .in_file(&self.path)
                .with_source(cause),
        )
    }
}
