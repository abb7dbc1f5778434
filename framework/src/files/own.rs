//! The rule of every file that navfuse writes: it takes the place of no input and of no file that
//! navfuse did not write, and an earlier result is kept.
//!
//! Few formats have room for a mark, so each folder has a list, [`LIST`]: a line for each file,
//! with its length and the time of its last change. A file that was changed, copied or put there
//! since is somebody else's. A lost list only makes navfuse more careful.

use crate::input::{self, is_held};
use std::error::Error;
use std::ffi::OsStr;
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Read, Write};
use std::path::Path;
use std::time::UNIX_EPOCH;

/// The name of the list.
pub const LIST: &str = ".navfuse";
/// Largest difference in seconds of times that are equal: some disks keep every second one.
const TOLERANCE: u64 = 2;
/// Length in the list of a part, which grows.
const PART: &str = "part";
/// Largest number of bytes of a list that are read.
const LONGEST: u64 = 64 << 20;

/// Tests that a result may be written to a path: there is nothing, a device or a pipe, or a file
/// that navfuse wrote and does not read now.
///
/// # Errors
/// When a file at the path has to stay. The message has the reason and the remedy.
pub fn check_output(path: &Path) -> io::Result<()> {
    reason_to_stay(path).map_or(Ok(()), |(kind, reason)| Err(io::Error::new(kind, Stays(reason))))
}

/// The reason for which a file has to stay.
#[derive(Debug, thiserror::Error)]
#[error("{0}; give another place for the result, or move the file")]
struct Stays(&'static str);

/// Checks whether an error comes from [`check_output`]. Its message then has its remedy.
pub fn has_to_stay(error: &(dyn Error + 'static)) -> bool {
    let reason = error.downcast_ref::<io::Error>().and_then(io::Error::get_ref);
    reason.is_some_and(|reason| reason.is::<Stays>()) || error.source().is_some_and(has_to_stay)
}

/// The reason for which a file at a path has to stay, if there is one.
pub(super) fn reason_to_stay(path: &Path) -> Option<(ErrorKind, &'static str)> {
    fs::symlink_metadata(path).ok()?;
    if is_held(path) {
        return Some((ErrorKind::InvalidInput, "it is an input of this command"));
    }
    let Ok(real) = fs::canonicalize(path) else {
        return Some((ErrorKind::AlreadyExists, "it is a link that leads nowhere"));
    };
    let foreign = real.is_file() && !is_own(&real);
    foreign.then_some((ErrorKind::AlreadyExists, "it exists, and navfuse did not write it"))
}

/// True for a file that is in the list of its folder, as it was written.
pub(super) fn is_own(path: &Path) -> bool {
    let Some((folder, name)) = split(path) else { return false };
    let list = listed(folder).unwrap_or_default();
    let whole = state(path);
    let of_this = |line: &[u8]| {
        let mut fields = line.splitn(3, |b| *b == b' ');
        let (length, time, listed) = (fields.next()?, fields.next()?, fields.next()?);
        (listed == name.as_encoded_bytes()).then_some(())?;
        let [length, time] = [length, time].map(|field| std::str::from_utf8(field).ok());
        let near = |(size, changed): (u64, u64)| {
            let time = time.and_then(|t| t.parse().ok());
            length == Some(&size.to_string())
                && time.is_some_and(|t| changed.abs_diff(t) <= TOLERANCE)
        };
        Some(length == Some(PART) || whole.is_some_and(near))
    };
    list.split(|b| *b == b'\n').any(|line| of_this(line).unwrap_or(false))
}

/// The lines of a folder's list, as far as it is a list.
fn listed(folder: &Path) -> io::Result<Vec<u8>> {
    let mut lines = Vec::new();
    input::open(&folder.join(LIST))?.take(LONGEST).read_to_end(&mut lines)?;
    Ok(lines)
}

/// Adds a file to the list of its folder. Without room for it, the file counts as somebody else's.
pub(super) fn list(path: &Path, file: &File) {
    if let Some((length, time)) = file.metadata().ok().and_then(|m| state_of(&m)) {
        add(path, &format!("{length} {time}"));
    }
}

/// Creates a file that grows as long as a command goes on, such as the journal of a campaign.
///
/// # Errors
/// When it cannot be created, or a file at the path has to stay ([`check_output`]).
pub fn create_growing(path: &Path) -> io::Result<File> {
    check_output(path)?;
    // listed first: a program that is killed between the two leaves no file that nobody wrote
    list_part(path);
    File::create(path)
}

/// Adds a file that is being written to the list.
pub(super) fn list_part(path: &Path) {
    if !is_own(path) {
        add(path, &format!("{PART} 0"));
    }
}

fn add(path: &Path, state: &str) {
    let Some((folder, name)) = split(path) else { return };
    let name = name.as_encoded_bytes();
    let list = folder.join(LIST);
    if name.contains(&b'\n') || fs::metadata(&list).is_ok_and(|m| !m.is_file()) {
        return;
    }
    let line = [state.as_bytes(), b" ", name, b"\n"].concat();
    let open = OpenOptions::new().append(true).create(true).open(list);
    open.and_then(|mut list| list.write_all(&line)).ok();
}

fn split(path: &Path) -> Option<(&Path, &OsStr)> {
    path.parent().zip(path.file_name())
}

/// Length of a file, and the time of its last change, s since 1970.
fn state(path: &Path) -> Option<(u64, u64)> {
    fs::metadata(path).ok().and_then(|m| state_of(&m))
}

fn state_of(m: &fs::Metadata) -> Option<(u64, u64)> {
    Some((m.len(), m.modified().ok()?.duration_since(UNIX_EPOCH).ok()?.as_secs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::write_whole;
    use crate::input::Held;

    #[test]
    fn a_file_is_own_as_long_as_nobody_changes_it() -> io::Result<()> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("track 1.csv");
        write_whole(&path, b"a,b\n")?;
        assert!(is_own(&path));
        fs::write(&path, "changed\n")?;
        assert!(!is_own(&path));
        assert!(check_output(&path).is_err());
        Ok(())
    }

    #[test]
    fn an_input_is_no_output_even_if_it_is_own() -> io::Result<()> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("run.mcap");
        write_whole(&path, b"log")?;
        check_output(&path)?;
        let held = Held::new(&path);
        assert!(check_output(&path).is_err());
        drop(held);
        check_output(&path)
    }
}
