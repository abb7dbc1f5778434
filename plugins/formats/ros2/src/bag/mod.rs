//! A bag: its files in order, and the messages in them.

mod faults;
mod files;
mod mcap;
mod pages;
mod ros1;
mod sqlite;
mod table;
mod topics;

pub use faults::Faults;
use files::{Opened, Storage, ZSTD};
use mcap::Mcap;
use navfuse_core::model::stream::StreamError;
use navfuse_frames::mcap::LONGEST;
use ros1::Ros1;
use sqlite::Sqlite;
use std::io::Read;
use std::path::{Path, PathBuf};
pub use topics::Topic;
use topics::{Found, Place, Topics};

/// A message of a bag.
#[derive(Clone, Copy, Debug)]
pub struct Message<'a> {
    /// Index of its topic in [`Bag::topics`].
    pub topic: usize,
    /// Time at which it was received, in nanoseconds since 1970.
    pub received: i64,
    /// Offset of the message, or of the chunk or page that holds it. Offsets count from the
    /// beginning of the first file.
    pub offset: u64,
    /// The message in CDR; empty for a topic that is not wanted.
    pub data: &'a [u8],
}

/// The file that is being read.
enum Current {
    Mcap(Box<Mcap>),
    Ros1(Box<Ros1>),
    Sqlite(Box<Sqlite>),
}

/// A bag, read from its first message to its last in constant memory.
///
/// ```no_run
/// use navfuse_ros2::Bag;
/// let mut bag = Bag::open(&["dive".into()])?;
/// while let Some(message) = bag.next(|_| true)? {
///     println!("{} {}", message.received, message.data.len());
/// }
/// println!("{:?}", bag.faults());
/// # Ok::<(), navfuse_core::model::stream::StreamError>(())
/// ```
pub struct Bag {
    files: std::vec::IntoIter<PathBuf>,
    /// The first file, for messages about the whole bag.
    path: PathBuf,
    current: Option<Current>,
    /// The file that is being read, and the offset of the next one.
    file: PathBuf,
    base: u64,
    topics: Topics,
    faults: Faults,
    unpacked: Vec<u8>,
    unpacker: Option<zstd::bulk::Decompressor<'static>>,
}

impl Bag {
    /// Opens a bag, given as its folder or as its files in their order.
    ///
    /// # Errors
    /// When a file is missing, or the first one is neither MCAP nor SQLite.
    pub fn open(paths: &[PathBuf]) -> Result<Self, StreamError> {
        let files = files::find(paths)?;
        let path = paths.first().cloned().unwrap_or_default();
        let mut bag = Self {
            files: files.into_iter(),
            file: path.clone(),
            path,
            current: None,
            base: 0,
            topics: Topics::default(),
            faults: Faults::default(),
            unpacked: Vec::new(),
            unpacker: None,
        };
        bag.next_file()?;
        Ok(bag)
    }

    /// Path of the bag as it was given.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The topics that were found so far. MCAP has most of them where their first message is.
    pub fn topics(&self) -> &[Topic] {
        &self.topics.all
    }

    /// Describes what was damaged so far.
    pub fn faults(&self) -> Option<String> {
        self.faults.describe()
    }

    /// Opens the next file; `false` if there is none.
    fn next_file(&mut self) -> Result<bool, StreamError> {
        self.current = None;
        let Some(path) = self.files.next() else { return Ok(false) };
        self.file = path;
        let Opened { storage, length, notes } = files::open(&self.file)?;
        self.faults.notes.extend(notes);
        let base = self.base;
        self.base += length;
        self.current = Some(match storage {
            Storage::Mcap(window) => Current::Mcap(Box::new(Mcap::new(window, base))),
            Storage::Ros1(window) => Current::Ros1(Box::new(Ros1::new(window, base))),
            Storage::Sqlite(file) => {
                let opened = Sqlite::open(file, base, &mut self.topics, &mut self.faults)
                    .map_err(|e| StreamError::read(&self.file, e))?;
                let bag = opened.map_err(|why| {
                    StreamError::format(why).in_file(&self.file).with_remedy(
                        "give the folder or the files of a bag that `ros2 bag record` wrote",
                    )
                })?;
                Current::Sqlite(Box::new(bag))
            }
        });
        Ok(true)
    }

    /// The next message; `None` at the end. The data of a topic that is not `wanted` is empty.
    ///
    /// # Errors
    /// When a file cannot be read.
    #[allow(clippy::should_implement_trait, reason = "a message borrows from the bag")]
    pub fn next(
        &mut self,
        wanted: impl Fn(&Topic) -> bool,
    ) -> Result<Option<Message<'_>>, StreamError> {
        let found = loop {
            let (topics, faults) = (&mut self.topics, &mut self.faults);
            let found = match &mut self.current {
                None => return Ok(None),
                Some(Current::Mcap(file)) => file.advance(topics, faults),
                Some(Current::Ros1(file)) => file.advance(topics, faults),
                Some(Current::Sqlite(file)) => {
                    file.advance(|topic| topics.all.get(topic).is_some_and(&wanted), faults)
                }
            };
            match found.map_err(|e| StreamError::read(&self.file, e))? {
                Some(found) => break found,
                None => {
                    self.next_file()?;
                }
            }
        };
        let Found { topic, received, offset, place } = found;
        if !self.topics.all.get(topic).is_some_and(&wanted) {
            return Ok(Some(Message { topic, received, offset, data: &[] }));
        }
        let data = match (&self.current, &place) {
            (Some(Current::Mcap(file)), Place::Record(place)) => file.data(place),
            (Some(Current::Sqlite(file)), Place::Row(column)) => file.data(*column),
            (Some(Current::Ros1(file)), Place::Bytes(place)) => file.data(place),
            _ => &[],
        };
        // a message that was packed by itself; plain CDR begins with a zero
        if data.starts_with(ZSTD) {
            unpack(&mut self.unpacker, data, &mut self.unpacked);
            return Ok(Some(Message { topic, received, offset, data: &self.unpacked }));
        }
        Ok(Some(Message { topic, received, offset, data }))
    }
}

/// Unpacks a message; nothing is left of one that is damaged.
fn unpack(
    unpacker: &mut Option<zstd::bulk::Decompressor<'static>>,
    packed: &[u8],
    out: &mut Vec<u8>,
) {
    out.clear();
    if unpacker.is_none() {
        *unpacker = zstd::bulk::Decompressor::new().ok();
    }
    let bound = zstd::bulk::Decompressor::upper_bound(packed).filter(|n| *n <= LONGEST);
    match (unpacker, bound) {
        (Some(unpacker), Some(bound)) => {
            out.reserve(bound);
            if unpacker.decompress_to_buffer(packed, out).is_err() {
                out.clear();
            }
        }
        _ => {
            let decoder = zstd::Decoder::with_buffer(packed);
            let read = decoder.map(|d| d.take(LONGEST as u64).read_to_end(out));
            if !matches!(read, Ok(Ok(_))) {
                out.clear();
            }
        }
    }
}
