//! The lock of a folder, so that two programs do not write into it at once.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

/// The name of the file that is locked; it is there while a program writes into the folder.
const LOCK: &str = ".lock";

/// The reason why a folder cannot be written into.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FolderError {
    /// The folder cannot be made, or no file in it.
    #[error("{}: the output folder cannot be made: {source}; give another with --out", .path.display())]
    Make {
        /// The folder.
        path: PathBuf,
        /// The reason.
        source: io::Error,
    },
    /// Another program writes into the folder.
    #[error(
        "{}: another run writes into this folder now; wait for its end, or give another folder \
         with --out", .path.display()
    )]
    Busy {
        /// The folder.
        path: PathBuf,
    },
    /// The earlier results of the folder cannot be kept.
    #[error(
        "{}: its earlier results cannot be moved to {}: {source}; give another folder \
         with --out", .path.display(), super::EARLIER
    )]
    Keep {
        /// The folder.
        path: PathBuf,
        /// The reason.
        source: io::Error,
    },
}

/// A folder into which this program alone writes, until the lock is dropped or the program ends,
/// however it ends.
#[derive(Debug)]
pub struct FolderLock {
    path: PathBuf,
    /// The open file with the lock; none on a disk that has no locks.
    _file: Option<File>,
}

impl FolderLock {
    /// Makes the folder, if it is not there, and locks it.
    ///
    /// # Errors
    /// When the folder cannot be made, or another program writes into it.
    pub fn take(folder: &Path) -> Result<Self, FolderError> {
        let failed = |source| FolderError::Make { path: folder.to_owned(), source };
        fs::create_dir_all(folder).map_err(failed)?;
        let path = folder.join(LOCK);
        loop {
            let open = OpenOptions::new().write(true).create(true).truncate(false).open(&path);
            let file = open.map_err(failed)?;
            match file.try_lock() {
                Ok(()) if is_at(&file, &path) => return Ok(Self { path, _file: Some(file) }),
                // the program that had the lock removed the file in between
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    return Err(FolderError::Busy { path: folder.to_owned() });
                }
                Err(TryLockError::Error(_)) => return Ok(Self { path, _file: None }),
            }
        }
    }
}

impl Drop for FolderLock {
    fn drop(&mut self) {
        fs::remove_file(&self.path).ok();
    }
}

/// True if the path leads to the open file.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let place = |m: fs::Metadata| (m.dev(), m.ino());
    file.metadata().map(place).ok() == fs::metadata(path).map(place).ok()
}

/// True: an open file cannot be removed here.
#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_has_one_writer_at_a_time_and_no_trace_of_it_afterwards() -> Result<(), FolderError>
    {
        let failed = |source| FolderError::Make { path: PathBuf::new(), source };
        let folder = tempfile::tempdir().map_err(failed)?;
        let path = folder.path().join("runs").join("dive");
        for _ in 0..2 {
            let first = FolderLock::take(&path)?;
            let second = FolderLock::take(&path);
            assert!(matches!(second, Err(FolderError::Busy { .. })), "{second:?}");
            drop(first);
            assert_eq!(fs::read_dir(&path).map_or(0, Iterator::count), 0);
        }
        Ok(())
    }

    /// Another program may remove the file between opening and locking it: a lock on a file without
    /// a name locks nobody out.
    #[test]
    #[cfg(unix)]
    fn a_file_that_was_replaced_is_not_at_its_path_any_more() -> std::io::Result<()> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("lock");
        let first = File::create(&path)?;
        assert!(is_at(&first, &path));
        fs::remove_file(&path)?;
        assert!(!is_at(&first, &path));
        let second = File::create(&path)?;
        assert!(is_at(&second, &path) && !is_at(&first, &path));
        Ok(())
    }
}
