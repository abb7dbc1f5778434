//! Files that are read: regular ones, and never written over while they are needed.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Read};
use std::ops::Deref;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// The inputs of this process, each with the number of its holders.
///
/// A writer deep in a plugin knows nothing of the files that the command reads, hence one table.
static HELD: Mutex<BTreeMap<Identity, usize>> = Mutex::new(BTreeMap::new());

/// A file whatever its path: links, hard links and `..` lead to the same one.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg(unix)]
struct Identity(u64, u64);
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg(not(unix))]
struct Identity(std::path::PathBuf);

#[cfg(unix)]
fn identity(path: &Path) -> Option<Identity> {
    use std::os::unix::fs::MetadataExt;
    fs::metadata(path).ok().map(|m| Identity(m.dev(), m.ino()))
}

#[cfg(not(unix))]
fn identity(path: &Path) -> Option<Identity> {
    fs::canonicalize(path).ok().map(Identity)
}

fn held() -> MutexGuard<'static, BTreeMap<Identity, usize>> {
    HELD.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Keeps a file from being written over, as long as it exists.
#[derive(Debug)]
pub struct Held(Option<Identity>);

impl Held {
    /// Holds a file. There is nothing to hold at a path that leads nowhere.
    pub fn new(path: &Path) -> Self {
        let identity = identity(path);
        if let Some(identity) = &identity {
            *held().entry(identity.clone()).or_insert(0) += 1;
        }
        Self(identity)
    }

    /// Holds what a command reads at a path: a file, or the whole files directly in a folder.
    pub fn all(path: &Path) -> Vec<Self> {
        match fs::read_dir(path) {
            Ok(entries) => {
                let paths = entries.flatten().map(|entry| entry.path());
                let whole = paths.filter(|path| path.extension().is_none_or(|e| e != "part"));
                whole.map(|path| Self::new(&path)).collect()
            }
            Err(_) => vec![Self::new(path)],
        }
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        let Some(identity) = &self.0 else { return };
        let mut held = held();
        if let Some(count) = held.get_mut(identity) {
            *count -= 1;
            if *count == 0 {
                held.remove(identity);
            }
        }
    }
}

/// True for a file that something of this process holds as an input.
pub(crate) fn is_held(path: &Path) -> bool {
    identity(path).is_some_and(|identity| held().contains_key(&identity))
}

/// An open file that nothing of this process writes over.
#[derive(Debug)]
pub struct Input {
    file: File,
    _held: Held,
}

impl From<File> for Input {
    /// A file without a name, to which no result can be written.
    fn from(file: File) -> Self {
        Self { file, _held: Held(None) }
    }
}

impl Deref for Input {
    type Target = File;

    fn deref(&self) -> &File {
        &self.file
    }
}

impl Read for Input {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.file.read(bytes)
    }
}

impl io::Seek for Input {
    fn seek(&mut self, to: io::SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

/// The text of a path, as scenarios and settings hold it.
///
/// # Errors
/// When the path is not UTF-8: any text of it would name another file.
pub fn text_of(path: &Path) -> io::Result<&str> {
    path.to_str().ok_or_else(|| {
        let text =
            "its path is not UTF-8, and no scenario can name it; rename the file or its folder";
        io::Error::new(io::ErrorKind::InvalidInput, text)
    })
}

/// Opens a file for reading. A device may have no end, and a pipe may never have a writer.
///
/// # Errors
/// When the file cannot be opened, or is not a regular file.
pub fn open(path: &Path) -> io::Result<Input> {
    let found = fs::metadata(path)?;
    if found.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    if !found.is_file() {
        let text =
            "it is a device or a pipe, and a regular file is needed; copy it to a file first";
        return Err(io::Error::new(io::ErrorKind::InvalidInput, text));
    }
    Ok(Input { file: File::open(path)?, _held: Held::new(path) })
}

/// The text of a file with at most `most` bytes.
///
/// # Errors
/// As [`open`], and when the file is longer or not UTF-8.
pub fn read_text(path: &Path, most: u64) -> io::Result<String> {
    bounded_text(open(path)?, most)
}

/// The bytes of a file with at most `most` of them.
///
/// # Errors
/// As [`open`], and when the file is longer.
pub fn read_bytes(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    bounded(open(path)?, most)
}

/// The text of a stream with at most `most` bytes.
///
/// # Errors
/// When the stream cannot be read, is longer, or is not UTF-8.
pub fn bounded_text(stream: impl Read, most: u64) -> io::Result<String> {
    let bytes = bounded(stream, most)?;
    String::from_utf8(bytes)
        .map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "it is not UTF-8"))
}

/// The bytes of a stream with at most `most` of them.
fn bounded(stream: impl Read, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let read = stream.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
    if read as u64 > most {
        let text = format!("it has more than the {} MiB that are allowed", most >> 20);
        return Err(io::Error::new(io::ErrorKind::InvalidData, text));
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_held_until_its_last_reader_is_gone() -> io::Result<()> {
        let folder = tempfile::tempdir()?;
        let [path, other] = ["a", "b"].map(|name| folder.path().join(name));
        fs::write(&path, "text")?;
        fs::hard_link(&path, &other)?;
        let (first, second) = (open(&path)?, Held::new(&path));
        assert!(is_held(&folder.path().join("./a")));
        assert_eq!(is_held(&other), cfg!(unix));
        drop(first);
        assert!(is_held(&path));
        drop(second);
        assert!(!is_held(&path));
        Ok(())
    }

    #[test]
    fn a_text_has_a_longest_length() -> io::Result<()> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("text");
        fs::write(&path, "1234")?;
        assert_eq!(read_text(&path, 4)?, "1234");
        assert!(read_text(&path, 3).is_err());
        Ok(())
    }
}
