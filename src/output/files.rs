//! Writing files.

use super::line;
use crate::error::{CommandError, Result};
use navfuse_core::files::{check_output, write_whole};
use std::path::Path;

/// Tests that a file may be written, before the work for it begins.
pub fn check(path: &Path) -> Result<()> {
    check_output(path).map_err(CommandError::cannot_write(path))
}

/// Writes a file whole or not at all, and makes the folder around it.
pub fn write(path: &Path, text: &str) -> Result<()> {
    check(path)?;
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    folder
        .map_or(Ok(()), std::fs::create_dir_all)
        .and_then(|()| write_whole(path, text.as_bytes()))
        .map_err(CommandError::file(path, "cannot be written", "; give another place with --out"))
}

/// Writes files, each with its name and text, into a folder; with `shown` their paths are printed.
pub fn write_files(
    folder: &Path,
    files: impl IntoIterator<Item = (String, String)>,
    shown: bool,
) -> Result<()> {
    for (name, text) in files {
        let path = folder.join(name);
        write(&path, &text)?;
        if shown {
            line(path.display());
        }
    }
    Ok(())
}
