//! Results that consist of several files: `run.mcap`, `run-0002.mcap`, `run-0003.mcap`.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// The path of the file with that number in a result; the first one has the path of the result.
///
/// ```
/// # use navfuse_core::files::numbered;
/// # use std::path::Path;
/// assert_eq!(numbered(Path::new("out/run.mcap"), 1), Path::new("out/run.mcap"));
/// assert_eq!(numbered(Path::new("out/run.mcap"), 12), Path::new("out/run-0012.mcap"));
/// ```
pub fn numbered(path: &Path, number: u32) -> PathBuf {
    if number < 2 {
        return path.to_owned();
    }
    let mut name = path.file_stem().map_or_else(OsString::new, OsString::from);
    name.push(format!("-{number:04}"));
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}
