//! A file that appears under its name once it is whole.

use super::earlier::keep;
use super::own::{check_output, list, list_part};
use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// The ending of the name of a file that is not whole.
const PART: &str = ".part";

/// The place of the bytes of a file until the file is whole: `run.mcap.part` for `run.mcap`.
pub fn part_of(path: &Path) -> PathBuf {
    let mut name = path.file_name().map_or_else(OsString::new, OsString::from);
    name.push(PART);
    path.with_file_name(name)
}

/// A file that is written beside its place, as `NAME.part`, and takes its name once it is whole.
///
/// All results are written so. The file takes the place of no input and of no file that navfuse
/// did not write ([`check_output`]); an earlier result moves into the folder `earlier`. A program
/// that ends before [`WholeFile::finish`] leaves the part, and an earlier file stays as it was. A
/// device or a pipe has no content to protect and is written directly.
///
/// ```
/// # use navfuse_core::files::WholeFile;
/// # use std::io::Write;
/// # fn main() -> std::io::Result<()> {
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("table.csv");
/// let mut file = WholeFile::create(&path)?;
/// file.write_all(b"time_s,depth_m\n")?;
/// assert!(!path.exists());
/// file.finish()?;
/// assert!(path.exists());
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct WholeFile {
    file: File,
    /// Where the bytes are, and the name that the file takes; none for a device or a pipe.
    places: Option<[PathBuf; 2]>,
}

impl WholeFile {
    /// Creates the part of a file. A part that a killed program left is kept as an earlier result.
    ///
    /// # Errors
    /// When the part, or the device, cannot be opened, or a file at the path has to stay.
    pub fn create(path: &Path) -> io::Result<Self> {
        check_output(path)?;
        if fs::metadata(path).is_ok_and(|m| !m.is_file()) {
            return Ok(Self { file: OpenOptions::new().write(true).open(path)?, places: None });
        }
        // the file behind a link is replaced, not the link
        let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let part = part_of(&path);
        check_output(&part)?;
        keep(&part)?;
        // listed first: a program that is killed between the two leaves no part that nobody wrote
        list_part(&part);
        let file = OpenOptions::new().write(true).create_new(true).open(&part)?;
        if let Ok(existing) = fs::metadata(&path) {
            file.set_permissions(existing.permissions())?;
        }
        Ok(Self { file, places: Some([part, path]) })
    }

    /// Gives the file its name, once its bytes are on the disk.
    ///
    /// # Errors
    /// When the disk is full or the file cannot be renamed. The part stays.
    pub fn finish(mut self) -> io::Result<()> {
        self.file.flush()?;
        let Some([part, path]) = &self.places else { return Ok(()) };
        // a disk that is full may report it only here
        self.file.sync_data()?;
        check_output(path)?;
        keep(path)?;
        list(path, &self.file);
        fs::rename(part, path)
    }
}

impl Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Writes a file whole or not at all.
///
/// # Errors
/// When the file cannot be written. An earlier file of the same name then stays as it was.
pub fn write_whole(path: &Path, content: &[u8]) -> io::Result<()> {
    let mut file = WholeFile::create(path)?;
    let part = file.places.as_ref().map(|[part, _]| part.clone());
    let written = file.write_all(content).and_then(|()| file.finish());
    if let (Err(_), Some(part)) = (&written, part) {
        fs::remove_file(part).ok();
    }
    written
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_appears_under_its_name_once_it_is_whole() -> io::Result<()> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("run.mcap");
        write_whole(&path, b"earlier")?;
        let mut file = WholeFile::create(&path)?;
        file.write_all(b"new")?;
        assert_eq!(fs::read_to_string(&path)?, "earlier");
        drop(file);
        assert_eq!(fs::read_to_string(part_of(&path))?, "new");
        let mut file = WholeFile::create(&path)?;
        file.write_all(b"newer")?;
        file.finish()?;
        assert_eq!(fs::read_to_string(&path)?, "newer");
        assert!(!part_of(&path).exists());
        Ok(())
    }

    /// The part cannot be created where a folder is, as if the program had been killed before.
    #[test]
    fn a_part_is_listed_before_it_is_there() -> io::Result<()> {
        let folder = tempfile::tempdir()?;
        let path = folder.path().join("run.mcap");
        fs::create_dir(part_of(&path))?;
        assert!(WholeFile::create(&path).is_err());
        fs::remove_dir(part_of(&path))?;
        fs::write(part_of(&path), "")?;
        write_whole(&path, b"log")
    }

    #[cfg(unix)]
    #[test]
    fn a_link_and_the_permissions_of_a_file_stay() -> io::Result<()> {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir()?;
        let [path, link] = ["scenario.toml", "link.toml"].map(|name| folder.path().join(name));
        write_whole(&path, b"a")?;
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640))?;
        symlink(&path, &link)?;
        write_whole(&link, b"b")?;
        assert!(fs::symlink_metadata(&link)?.is_symlink());
        assert_eq!(fs::read_to_string(&path)?, "b");
        assert_eq!(fs::metadata(&path)?.permissions().mode() & 0o777, 0o640);
        Ok(())
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_device_is_an_error_and_stays_a_device() {
        let error = write_whole(Path::new("/dev/full"), b"x").err().map(|e| e.kind());
        assert_eq!(error, Some(io::ErrorKind::StorageFull));
    }
}
