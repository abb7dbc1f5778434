//! The thread that compresses and writes, and the queue before it.

use crate::chunk::Chunk;
use crate::file::LogFile;
use crate::log::StreamFailure;
use navfuse_core::files::WholeFile;
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::thread::{Builder, JoinHandle};

/// Number of chunks that wait for the disk. A disk that is slower than the run makes the run wait
/// from then on, so that its memory does not grow.
const QUEUE: usize = 2;

/// A part of a file, in the order of the file.
enum Job {
    Chunk(Chunk),
    Metadata(&'static str, BTreeMap<String, String>),
    /// The file is whole.
    End,
}

/// A file that can be completed.
pub(crate) trait Whole: Write {
    fn complete(self) -> io::Result<()>;
}

impl Whole for WholeFile {
    fn complete(self) -> io::Result<()> {
        self.finish()
    }
}

/// A file that a thread of its own compresses and writes.
#[derive(Debug)]
pub struct Background {
    /// The queue; `None` once the file is closed.
    jobs: Option<SyncSender<Job>>,
    /// Chunks that were written, and whose memory is used again.
    empty: Receiver<Chunk>,
    thread: Option<JoinHandle<io::Result<()>>>,
    /// Length of the file so far.
    written: Arc<AtomicU64>,
}

impl Background {
    /// Starts the thread.
    pub fn start<W: Whole + Send + 'static>(file: LogFile<W>) -> io::Result<Self> {
        let (jobs, queue) = sync_channel(QUEUE);
        let (returned, empty) = channel();
        let written = Arc::<AtomicU64>::default();
        let length = Arc::clone(&written);
        let thread = Builder::new().name("mcap".into());
        let thread = thread.spawn(move || {
            let mut file = file;
            for job in queue {
                match job {
                    Job::Chunk(mut chunk) => {
                        file.chunk(&chunk)?;
                        length.store(file.length(), Ordering::Relaxed);
                        chunk.clear();
                        // once the run is over, nobody takes the chunk back
                        returned.send(chunk).ok();
                    }
                    Job::Metadata(name, entries) => file.metadata(name, &entries)?,
                    Job::End => return file.finish()?.complete(),
                }
            }
            // a run that was aborted leaves the part, which can be read to its end
            file.finish().map(drop)
        })?;
        Ok(Self { jobs: Some(jobs), empty, thread: Some(thread), written })
    }

    /// Bytes that have been written.
    pub fn written(&self) -> u64 {
        self.written.load(Ordering::Relaxed)
    }

    /// Takes a chunk to be written, and puts an empty one in its place. Waits while the queue is
    /// full.
    pub fn write(&mut self, chunk: &mut Chunk) -> Result<(), StreamFailure> {
        let empty = self.empty.try_recv().unwrap_or_default();
        self.send(Job::Chunk(std::mem::replace(chunk, empty)))
    }

    /// Takes texts by their names.
    pub fn metadata(
        &mut self,
        name: &'static str,
        entries: BTreeMap<String, String>,
    ) -> Result<(), StreamFailure> {
        self.send(Job::Metadata(name, entries))
    }

    /// Completes the file, and waits until it is on the disk.
    pub fn finish(&mut self) -> Result<(), StreamFailure> {
        self.send(Job::End)?;
        self.join().map_err(StreamFailure::Io)
    }

    fn send(&mut self, job: Job) -> Result<(), StreamFailure> {
        let sent = self.jobs.as_ref().is_some_and(|jobs| jobs.send(job).is_ok());
        if sent {
            return Ok(());
        }
        // the thread ends early only with an error
        let ended = || io::Error::other("the thread that writes it has ended");
        Err(StreamFailure::Io(self.join().err().unwrap_or_else(ended)))
    }

    /// Waits for the end of the thread, once.
    fn join(&mut self) -> io::Result<()> {
        self.jobs = None;
        let Some(thread) = self.thread.take() else { return Ok(()) };
        thread.join().unwrap_or_else(|_| Err(io::Error::other("the thread that writes it failed")))
    }
}

impl Drop for Background {
    /// Writes what is in the queue.
    fn drop(&mut self) {
        self.join().ok();
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test ends where it fails")]

    use super::*;
    use crate::chunk::{Definitions, Topic};
    use crate::file::Compression;
    use std::sync::Mutex;
    use std::sync::atomic::AtomicUsize;
    use std::time::Duration;

    /// A disk that stands still while the test holds its lock, and is full after some bytes.
    #[derive(Clone)]
    struct Disk {
        still: Arc<Mutex<()>>,
        room: usize,
    }

    impl Write for Disk {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            drop(self.still.lock().unwrap());
            let full = || io::Error::from(io::ErrorKind::StorageFull);
            self.room = self.room.checked_sub(bytes.len()).ok_or_else(full)?;
            Ok(bytes.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    impl Whole for Disk {
        fn complete(self) -> io::Result<()> {
            Ok(())
        }
    }

    fn start(disk: Disk) -> Background {
        let mut definitions = Definitions::default();
        definitions.topic("/log", &crate::schema::LOG);
        let file = LogFile::begin(disk, Compression::None, "test", definitions);
        Background::start(file.unwrap()).unwrap()
    }

    fn write(file: &mut Background) -> Result<(), StreamFailure> {
        let mut chunk = Chunk::default();
        let topic = Topic { channel: 0, sequence: 0 };
        chunk.message(&topic, 0, |out| out.extend_from_slice(&[0; 1000]));
        file.write(&mut chunk)
    }

    #[test]
    fn a_disk_that_stands_still_makes_the_run_wait_with_few_chunks_in_memory() {
        let still = Arc::new(Mutex::new(()));
        let mut file = start(Disk { still: Arc::clone(&still), room: usize::MAX });
        let held = still.lock().unwrap();
        let taken = Arc::new(AtomicUsize::new(0));
        let count = Arc::clone(&taken);
        let run = std::thread::spawn(move || {
            for _ in 0..50 {
                write(&mut file).unwrap();
                count.fetch_add(1, Ordering::SeqCst);
            }
            file.finish().unwrap();
        });
        // until the run stands still, however busy the machine is
        let mut before = usize::MAX;
        while before != taken.load(Ordering::SeqCst) || before == 0 {
            before = taken.load(Ordering::SeqCst);
            std::thread::sleep(Duration::from_millis(100));
        }
        // those in the queue, and the one that is being written
        assert!(before <= QUEUE + 1, "{before}");
        drop(held);
        run.join().unwrap();
        assert_eq!(taken.load(Ordering::SeqCst), 50);
    }

    #[test]
    fn a_full_disk_is_the_error_of_one_of_the_next_chunks() {
        let mut file = start(Disk { still: Arc::default(), room: 5000 });
        // four chunks fit, the fifth fails while the queue fills, and the next one is refused
        let failed = (0..5 + QUEUE + 1).find_map(|_| write(&mut file).err());
        assert!(
            matches!(&failed, Some(StreamFailure::Io(e)) if e.kind() == io::ErrorKind::StorageFull),
            "{failed:?}"
        );
    }
}
