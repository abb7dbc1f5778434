//! A log that cannot be written for a while: its disk is full, or is away.

use navfuse_core::model::stream::StreamError;
use navfuse_core::units::time::Time;
use std::fs::{OpenOptions, remove_file};
use std::io::{self, Write};
use std::path::Path;
use std::time::{Duration, Instant};

/// Time between two looks at the disk.
const LOOK: Duration = Duration::from_secs(5);
/// Room that the disk must have: a few chunks of messages.
const ROOM: usize = 4 << 20;
/// Ending of the name of the file by which the room is tried.
const TRIAL: &str = "room";

/// A pause of the log.
#[derive(Debug)]
pub(crate) struct Pause {
    /// The time of the run from which on nothing is logged.
    since: Time,
    /// The reason.
    pub(crate) cause: StreamError,
    looked: Instant,
}

impl Pause {
    /// A pause from this time of the run on.
    pub(crate) fn begin(since: Time, cause: StreamError) -> Self {
        Self { since, cause, looked: Instant::now() }
    }

    /// Looks from time to time whether the disk of a file has room again.
    pub(crate) fn is_over(&mut self, path: &Path) -> bool {
        if self.looked.elapsed() < LOOK {
            return false;
        }
        self.looked = Instant::now();
        // a device or a pipe that failed has no next file
        let is_device = std::fs::metadata(path).is_ok_and(|m| !m.is_file());
        !is_device && has_room(path).is_ok()
    }

    /// The pause in words, once the log goes on.
    pub(crate) fn describe(&self, until: Time) -> String {
        format!("nothing was logged from {} to {until}: {}", self.since, self.cause)
    }
}

/// Writes a file beside the log, and removes it.
fn has_room(path: &Path) -> io::Result<()> {
    let trial = path.with_extension(TRIAL);
    let mut file = OpenOptions::new().write(true).create_new(true).open(&trial)?;
    let written = file.write_all(&vec![0; ROOM]).and_then(|()| file.sync_data());
    remove_file(trial)?;
    written
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_room_of_a_disk_is_tried_and_nothing_stays() -> io::Result<()> {
        let folder = tempfile::tempdir()?;
        has_room(&folder.path().join("run.mcap"))?;
        assert_eq!(std::fs::read_dir(folder.path())?.count(), 0);
        // a disk that is away, and a file of somebody else
        assert!(has_room(&folder.path().join("away/run.mcap")).is_err());
        let theirs = folder.path().join("run.room");
        std::fs::write(&theirs, "theirs")?;
        assert!(has_room(&folder.path().join("run.mcap")).is_err());
        assert_eq!(std::fs::read_to_string(theirs)?, "theirs");
        Ok(())
    }
}
