//! Files that a run replaces from time to time, on a thread of their own: a disk may be slow.

use navfuse_core::checkpoint::Checkpoint;
use navfuse_core::files::{check_output, create_growing, part_of};
use navfuse_core::model::record::Level;
use navfuse_core::model::stream::{Inbox, StreamError};
use std::fs::{File, rename};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::{Builder, JoinHandle};

/// Name of the checkpoint in the folder of a run.
pub const CHECKPOINT: &str = "live.checkpoint";
/// Name of the file with the state of the run and of its sensors.
pub const STATUS: &str = "live.json";

/// Files that wait to be written. A later one is not written while these wait.
const WAITING: usize = 2;

/// Replaces a file by a new one that is whole, whenever the computer loses its power. A file of
/// somebody else stays.
fn replace(path: &Path, content: &[u8]) -> io::Result<()> {
    check_output(path)?;
    if !path.exists() {
        // from now on, the name is known as that of a file that changes
        create_growing(path)?;
    }
    let part = part_of(path);
    let mut file = File::create(&part)?;
    file.write_all(content)?;
    file.sync_all()?;
    rename(part, path)
}

/// Writes the files of one folder, each whole.
pub struct Saver {
    folder: PathBuf,
    to: SyncSender<(&'static str, Vec<u8>)>,
    thread: JoinHandle<()>,
}

impl Saver {
    /// Starts the thread, which reports failures to `inbox`.
    pub fn start(folder: &Path, mut inbox: Inbox) -> Result<Self, StreamError> {
        let (to, files) = sync_channel::<(&'static str, Vec<u8>)>(WAITING);
        let place = folder.to_path_buf();
        let work = move || {
            let mut failing = false;
            for (name, content) in files {
                let path = place.join(name);
                let written = replace(&path, &content);
                if let (Err(error), false) = (&written, failing) {
                    let text = format!("{}: cannot be written: {error}", path.display());
                    inbox.report(Level::Warning, format!("{text}; the run goes on without it"));
                }
                failing = written.is_err();
            }
        };
        let thread = Builder::new().name("saver".to_owned()).spawn(work);
        let no_thread = |e| StreamError::new("the system cannot start a thread").with_source(e);
        Ok(Self { folder: folder.to_path_buf(), to, thread: thread.map_err(no_thread)? })
    }

    /// Writes a file, unless earlier ones still wait for the disk.
    pub fn save(&self, name: &'static str, content: Vec<u8>) {
        self.to.try_send((name, content)).ok();
    }

    /// Waits until everything is written, and writes the last files.
    pub fn finish(self, last: Vec<(&'static str, Vec<u8>)>) {
        drop(self.to);
        self.thread.join().ok();
        for (name, content) in last {
            // a full disk was reported before
            replace(&self.folder.join(name), &content).ok();
        }
    }
}

/// Reads the checkpoint in the folder of a run; `None` if there is none.
///
/// # Errors
/// When it cannot be read, or is damaged or of another version.
pub fn read_checkpoint(folder: &Path) -> Result<Option<Checkpoint>, StreamError> {
    let path = folder.join(CHECKPOINT);
    let remedy = "remove it, or run without --resume";
    match std::fs::read(&path) {
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(None),
        Err(e) => Err(StreamError::read(path, e)),
        // the run ended before its first checkpoint was whole
        Ok(bytes) if bytes.is_empty() => Ok(None),
        Ok(bytes) => Checkpoint::from_bytes(&bytes).map(Some).map_err(|e| {
            StreamError::format(e.to_string()).in_file(path).with_remedy(remedy).with_source(e)
        }),
    }
}
