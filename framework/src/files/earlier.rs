//! Keeping the earlier result of a folder when a new one takes its place.

use super::part_of;
use crate::units::calendar::Calendar;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// The folder, inside a folder of results, with the earlier ones.
pub const EARLIER: &str = "earlier";

/// Pages that commands write beside a result, and that describe this result alone.
const DESCRIPTIONS: [&str; 1] = ["report.html"];

/// Moves the named files of a folder, and the parts that a killed program left, into
/// `earlier/TIME`, where `TIME` is the time of the newest of them (UTC). Returns this folder, or
/// none if there was nothing to move. A device or a pipe stays.
///
/// # Errors
/// When a file cannot be moved.
pub fn keep_earlier<P: AsRef<Path>>(
    folder: &Path,
    names: impl IntoIterator<Item = P>,
) -> io::Result<Option<PathBuf>> {
    let names = names.into_iter().map(|name| name.as_ref().to_owned());
    let names = names.chain(DESCRIPTIONS.map(PathBuf::from));
    let mut moves = Vec::new();
    let mut newest = UNIX_EPOCH;
    for path in names.flat_map(|name| [part_of(&name), name]) {
        // a path outside of the folder keeps its earlier content in its own folder
        let from = folder.join(&path);
        let is_inside = path.is_relative();
        let Ok(found) = fs::metadata(&from) else { continue };
        if found.is_file() {
            newest = newest.max(found.modified().unwrap_or(UNIX_EPOCH));
            moves.push((from, is_inside.then_some(path)));
        }
    }
    if moves.is_empty() {
        return Ok(None);
    }
    let stamp = stamp(newest);
    let mut made = None;
    for (from, inside) in moves {
        let to = match (inside, from.parent(), from.file_name()) {
            (None, Some(parent), Some(name)) => {
                new_folder(&parent.join(EARLIER), &stamp)?.join(name)
            }
            (Some(path), ..) => {
                let kept = match &made {
                    Some(kept) => kept,
                    None => made.insert(new_folder(&folder.join(EARLIER), &stamp)?),
                };
                kept.join(path)
            }
            (None, ..) => continue,
        };
        if let Some(parent) = to.parent() {
            fs::create_dir_all(parent)?;
        }
        fs::rename(&from, &to)?;
    }
    Ok(made)
}

/// Makes a new folder of that name, with a number after it where the name is taken.
fn new_folder(parent: &Path, name: &str) -> io::Result<PathBuf> {
    fs::create_dir_all(parent)?;
    let mut path = parent.join(name);
    let mut number = 1;
    loop {
        match fs::create_dir(&path) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                number += 1;
                path = parent.join(format!("{name}-{number}"));
            }
            other => return other.map(|()| path),
        }
    }
}

/// A time as the name of a folder: `2026-11-22T05-31-07`, UTC.
fn stamp(time: SystemTime) -> String {
    let nanos = time.duration_since(UNIX_EPOCH).map_or(0, |d| d.as_nanos());
    let Calendar { year, month, day, hour, minute, second, .. } =
        Calendar::of_unix_nanos(i64::try_from(nanos).unwrap_or(i64::MAX));
    format!("{year:04}-{month:02}-{day:02}T{hour:02}-{minute:02}-{second:02}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn a_time_is_written_as_in_the_civil_calendar() {
        // from `date -u -d @SECONDS`
        for (seconds, text) in [
            (0, "1970-01-01T00-00-00"),
            (951_782_399, "2000-02-28T23-59-59"),
            (951_782_400, "2000-02-29T00-00-00"),
            (1_795_325_467, "2026-11-22T05-31-07"),
            (4_107_542_400, "2100-03-01T00-00-00"),
        ] {
            assert_eq!(stamp(UNIX_EPOCH + Duration::from_secs(seconds)), text);
        }
    }

    #[test]
    fn earlier_results_and_their_parts_are_kept_and_other_files_stay() -> io::Result<()> {
        let folder = tempfile::tempdir()?;
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text);
        let keep = || keep_earlier(folder.path(), ["run.mcap", "run.rrd"]);
        assert_eq!(keep()?, None);
        let mut kept = Vec::new();
        for text in ["first", "second"] {
            write("run.mcap", text)?;
            write("run.rrd.part", text)?;
            write("report.html", text)?;
            write("notes.txt", text)?;
            kept.extend(keep()?);
        }
        assert_eq!(kept.len(), 2);
        for (path, text) in kept.iter().zip(["first", "second"]) {
            for name in ["run.mcap", "run.rrd.part", "report.html"] {
                assert_eq!(fs::read_to_string(path.join(name))?, text);
            }
        }
        assert_eq!(fs::read_to_string(folder.path().join("notes.txt"))?, "second");
        assert_eq!(fs::read_dir(folder.path())?.count(), 2);
        Ok(())
    }
}
