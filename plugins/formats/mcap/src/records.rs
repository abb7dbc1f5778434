//! The records of a log, in the order of the file.

use navfuse_core::model::stream::StreamError;
use navfuse_frames::Window;
use navfuse_frames::mcap::{self, Chunks, Lost, MAGIC};
use std::path::{Path, PathBuf};

/// The records of a file in their order. Damaged parts are skipped and counted.
pub struct Records {
    path: PathBuf,
    records: mcap::Records,
    lost: Lost,
}

impl Records {
    /// Opens a file.
    pub fn open(path: &Path, chunks: Chunks) -> Result<Self, StreamError> {
        let file = navfuse_core::input::open(path).map_err(|e| StreamError::open(path, e))?;
        let mut window = Window::new(Box::new(file) as _);
        let whole = window.need(MAGIC.len()).map_err(|e| StreamError::read(path, e))?;
        if !whole || !window.bytes().starts_with(MAGIC) {
            return Err(StreamError::format("this is not an MCAP file")
                .in_file(path)
                .with_remedy("a log of navfuse is called run.mcap"));
        }
        let records = mcap::Records::new(window, 0, chunks);
        Ok(Self { path: path.to_path_buf(), records, lost: Lost::default() })
    }

    /// The path of this file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Number of bytes that were read.
    pub fn position(&self) -> u64 {
        self.records.position()
    }

    /// Reads records until `take` returns a result for one of them; `None` at the end.
    pub fn find<T>(
        &mut self,
        mut take: impl FnMut(u8, &[u8]) -> Result<Option<T>, StreamError>,
    ) -> Result<Option<T>, StreamError> {
        loop {
            let record = self.records.next(&mut self.lost);
            let record = record.map_err(|e| StreamError::read(&self.path, e))?;
            let Some(record) = record else { return Ok(None) };
            let content = self.records.content(&record.place);
            if let Some(found) = take(record.opcode, content).map_err(|e| e.in_file(&self.path))? {
                return Ok(Some(found));
            }
        }
    }

    /// True if something of the file could not be read.
    pub fn is_damaged(&self) -> bool {
        !(self.lost.cuts.is_empty() && self.lost.chunks.is_zero() && self.lost.places.is_zero())
    }

    /// Describes the damage that was skipped, if there is any.
    pub fn skipped(&self) -> Option<String> {
        let parts = self.lost.describe();
        (!parts.is_empty()).then(|| parts.join("; "))
    }

    /// Describes what could not be read, in clauses. A file may be cut off `after` something.
    pub fn damage(&self, after: &str) -> Vec<String> {
        let mut parts = self.lost.describe();
        let cut = |at: &u64| format!("cut off at byte {at}{after}; everything before was read");
        parts.extend(self.lost.cuts.iter().map(cut));
        parts
    }
}
