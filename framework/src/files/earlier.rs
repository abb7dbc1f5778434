//! Keeping the earlier result of a folder when a new one takes its place.

use super::numbered::numbered;
use super::own::{is_own, reason_to_stay};
use super::part_of;
use crate::calendar::Calendar;
use crate::input::is_held;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// The folder, inside a folder of results, with the earlier ones.
pub const EARLIER: &str = "earlier";

/// Pages that commands write beside a result, and that describe this result alone.
const DESCRIPTIONS: [&str; 1] = ["report.html"];

/// Moves the named files of a folder, the numbered ones that follow them ([`super::numbered`]), and the
/// parts that a killed program left, into
/// `earlier/TIME`, where `TIME` is the time of the newest of them (UTC). Returns this folder, or
/// none if there was nothing to move. A device or a pipe stays. A file outside of the folder, such
/// as the one behind a link, is kept in a folder beside it.
///
/// # Errors
/// When a file cannot be moved, or has to stay ([`super::check_output`]). Then none is moved.
pub fn keep_earlier<P: AsRef<Path>>(
    folder: &Path,
    names: impl IntoIterator<Item = P>,
) -> io::Result<Option<PathBuf>> {
    let mut inside = Vec::new();
    let mut outside = Vec::new();
    let with_following = |name: P| {
        let mut all = following(folder, name.as_ref());
        all.push(name.as_ref().into());
        all
    };
    let names = names.into_iter().flat_map(with_following);
    for name in names.flat_map(|name| [part_of(&name), name]) {
        let path = folder.join(&name);
        if let Some((kind, reason)) = reason_to_stay(&path) {
            return Err(io::Error::new(kind, format!("{}: {reason}", path.display())));
        }
        if !fs::metadata(&path).is_ok_and(|m| m.is_file()) {
            continue;
        }
        if name.is_relative() && !path.is_symlink() {
            inside.push(name);
        } else {
            outside.push(fs::canonicalize(path)?);
        }
    }
    outside.iter().try_for_each(|path| keep(path))?;
    if inside.is_empty() {
        return Ok(None);
    }
    let pages = DESCRIPTIONS.map(PathBuf::from).into_iter();
    inside.extend(pages.filter(|page| is_own(&folder.join(page)) && !is_held(&folder.join(page))));
    let newest = inside.iter().map(|name| changed(&folder.join(name))).max();
    let kept = new_folder(&folder.join(EARLIER), &stamp(newest.unwrap_or(UNIX_EPOCH)))?;
    for name in inside {
        let to = kept.join(&name);
        if let Some(parent) = to.parent() {
            fs::create_dir_all(parent)?;
        }
        fs::rename(folder.join(name), to)?;
    }
    Ok(Some(kept))
}

/// The names of a result's files in a folder that follow the first one, without a gap. The last one
/// may be a part that a killed program left.
fn following(folder: &Path, name: &Path) -> Vec<PathBuf> {
    let names = (2..).map(|number| numbered(name, number));
    let is_there = |name: &PathBuf| {
        let path = folder.join(name);
        path.exists() || part_of(&path).exists()
    };
    names.take_while(is_there).collect()
}

/// Moves a file, if it is there, into `earlier/TIME` beside it.
pub(super) fn keep(path: &Path) -> io::Result<()> {
    let Some((folder, name)) = path.parent().zip(path.file_name()).filter(|_| path.is_file())
    else {
        return Ok(());
    };
    let kept = new_folder(&folder.join(EARLIER), &stamp(changed(path)))?;
    fs::rename(path, kept.join(name))
}

/// The time of the last change of a file.
fn changed(path: &Path) -> SystemTime {
    fs::metadata(path).and_then(|m| m.modified()).unwrap_or(UNIX_EPOCH)
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
    use crate::files::{WholeFile, write_whole};
    use std::io::Write;
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
        let write =
            |name: &str, text: &str| write_whole(&folder.path().join(name), text.as_bytes());
        let keep = || keep_earlier(folder.path(), ["run.mcap", "run.rrd"]);
        assert_eq!(keep()?, None);
        let mut kept = Vec::new();
        for text in ["first", "second"] {
            write("run.mcap", text)?;
            let mut part = WholeFile::create(&folder.path().join("run.rrd"))?;
            part.write_all(text.as_bytes())?;
            drop(part);
            write("report.html", text)?;
            fs::write(folder.path().join("notes.txt"), text)?;
            kept.extend(keep()?);
        }
        assert_eq!(kept.len(), 2);
        for (path, text) in kept.iter().zip(["first", "second"]) {
            for name in ["run.mcap", "run.rrd.part", "report.html"] {
                assert_eq!(fs::read_to_string(path.join(name))?, text);
            }
        }
        assert_eq!(fs::read_to_string(folder.path().join("notes.txt"))?, "second");
        // the notes, the earlier results, and the list
        assert_eq!(fs::read_dir(folder.path())?.count(), 3);
        Ok(())
    }
}
