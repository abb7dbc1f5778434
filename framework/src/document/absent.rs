//! The file that was meant where a path leads to none.

use crate::document::explain::did_you_mean;
use crate::input::read_text;
use std::fs;
use std::io::{Error, ErrorKind};
use std::path::{Path, PathBuf};

/// Largest number of files that are named, and of entries of a folder that are looked at.
const NAMED: usize = 5;
const ENTRIES: usize = 10_000;

/// Largest file that is looked at, bytes.
const LARGEST: u64 = 1 << 20;
/// Extension of a scenario, and the tables by which one is known.
const SCENARIO: &str = "toml";
const TABLES: [&str; 4] = ["sensor", "source", "process", "include"];

/// What to do about a file that cannot be read, after a semicolon; empty where the reason suffices. The file
/// that was meant has that extension.
pub fn file_remedy(path: &Path, extension: &str, error: &Error) -> String {
    match error.kind() {
        ErrorKind::NotFound => format!("; {}", of_absent(path, extension)),
        ErrorKind::IsADirectory => match listed(&meant_files(path, extension)) {
            Some(there) => format!("; name a file in it: {there}"),
            None => format!("; it has no {}", what(extension)),
        },
        _ => String::new(),
    }
}

fn of_absent(path: &Path, extension: &str) -> String {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    if !folder.is_dir() {
        return format!("the folder {} does not exist either", folder.display());
    }
    let with_extension = path.with_added_extension(extension);
    let there = meant_files(folder, extension);
    let meant = if with_extension.is_file() {
        Some(with_extension)
    } else {
        // the same name elsewhere is nearer than another name here
        let below = || in_a_folder_below(folder, &with_extension);
        in_a_folder_below(folder, path).or_else(below).or_else(|| near(path, &there))
    };
    if let Some(meant) = meant {
        return format!("did you mean {}?", plain(&meant).display());
    }
    let has = |folder: &Path, there: &str| format!("the folder {} has {there}", folder.display());
    let here = fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned());
    let below = || {
        let mut folders: Vec<PathBuf> = entries(folder).filter(|p| p.is_dir()).collect();
        folders.sort();
        folders.iter().find_map(|f| Some(has(plain(f), &listed(&meant_files(f, extension))?)))
    };
    let there = listed(&there).map(|there| has(&here, &there)).or_else(below);
    there.unwrap_or_else(|| format!("the folder {} has no {}", here.display(), what(extension)))
}

/// The word for a file with that extension.
fn what(extension: &str) -> String {
    if extension == SCENARIO { "scenario".to_owned() } else { format!(".{extension} file") }
}

/// The file whose name is near that of a path.
fn near(path: &Path, there: &[PathBuf]) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?;
    let names: Vec<&str> = there.iter().filter_map(|p| p.file_name()?.to_str()).collect();
    let meant = did_you_mean(name, names)?;
    there.iter().find(|p| p.file_name().is_some_and(|n| n == meant)).cloned()
}

/// The file of that name in a folder of the folder.
fn in_a_folder_below(folder: &Path, path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?;
    let mut found: Vec<PathBuf> =
        entries(folder).map(|inner| inner.join(name)).filter(|p| p.is_file()).collect();
    found.sort();
    found.into_iter().next()
}

/// The files of a folder with that extension, in order of their names.
fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let fits = |path: &PathBuf| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension));
    let mut files: Vec<PathBuf> = entries(folder).filter(|p| fits(p) && p.is_file()).collect();
    files.sort();
    files
}

/// The files that may have been meant: of TOML files the scenarios, not the settings of other programs.
fn meant_files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut files = files(folder, extension);
    if extension == SCENARIO {
        files.retain(|path| is_scenario(path));
    }
    files
}

/// Returns `true` for a document with a table that every scenario has, or with an include.
fn is_scenario(path: &Path) -> bool {
    let text = read_text(path, LARGEST).ok();
    let table = text.and_then(|text| toml::from_str::<toml::Table>(&text).ok());
    table.is_some_and(|table| TABLES.iter().any(|name| table.contains_key(*name)))
}

fn entries(folder: &Path) -> impl Iterator<Item = PathBuf> {
    fs::read_dir(folder).into_iter().flatten().flatten().take(ENTRIES).map(|entry| entry.path())
}

/// The names of files, the first few; `None` without any.
fn listed(files: &[PathBuf]) -> Option<String> {
    let names: Vec<String> = (files.iter().take(NAMED))
        .filter_map(|p| Some(p.file_name()?.to_string_lossy().into_owned()))
        .collect();
    let more = match files.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    (!names.is_empty()).then(|| names.join(", ") + &more)
}

/// A path without `./` before it.
fn plain(path: &Path) -> &Path {
    path.strip_prefix(".").unwrap_or(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_not_there_is_answered_with_the_one_that_was_meant()
    -> Result<(), Box<dyn std::error::Error>> {
        let folder = tempfile::tempdir()?;
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("faults"))?;
        for name in ["auv.toml", "quickstart.toml", "faults/gnss-jump.toml", "notes.md"] {
            fs::write(at(name), "[sensor.imu]")?;
        }
        let said = |path: &Path| file_remedy(path, "toml", &ErrorKind::NotFound.into());
        let meant = |name: &str| format!("; did you mean {}?", at(name).display());
        assert_eq!(said(&at("quickstrat.toml")), meant("quickstart.toml"));
        assert_eq!(said(&at("auv")), meant("auv.toml"));
        // although the name of `auv.toml` is nearer
        fs::write(at("faults/auw.toml"), "")?;
        assert_eq!(said(&at("auw.toml")), meant("faults/auw.toml"));
        fs::remove_file(at("faults/auw.toml"))?;
        for name in ["gnss-jump", "gnss-jump.toml"] {
            assert_eq!(said(&at(name)), meant("faults/gnss-jump.toml"));
        }
        // the settings of another program are no scenario
        fs::write(at("typos.toml"), "[files]")?;
        fs::write(at("broken.toml"), "[sensor")?;
        assert!(!said(&at("types.toml")).contains("typos"));
        let others = said(&at("nowhere.toml"));
        assert!(others.ends_with(" has auv.toml, quickstart.toml"), "{others}");
        fs::remove_file(at("auv.toml"))?;
        fs::remove_file(at("quickstart.toml"))?;
        let others = said(&at("nowhere.toml"));
        assert!(others.ends_with("faults has gnss-jump.toml"), "{others}");
        fs::remove_file(at("faults/gnss-jump.toml"))?;
        let none = said(&at("nowhere.toml"));
        assert!(none.ends_with(" has no scenario"), "{none}");
        fs::write(at("faults/gnss-jump.toml"), "[sensor.imu]")?;
        let below = said(&at("dives/auv.toml"));
        assert!(below.ends_with("dives does not exist either"), "{below}");
        let itself = file_remedy(&at("faults"), "toml", &ErrorKind::IsADirectory.into());
        assert_eq!(itself, "; name a file in it: gnss-jump.toml");
        assert_eq!(file_remedy(&at("auv.toml"), "toml", &ErrorKind::PermissionDenied.into()), "");
        Ok(())
    }
}
