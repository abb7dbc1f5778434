//! The files of a bag: found by its `metadata.yaml` or its folder, and recognised by their first
//! bytes.

use super::{ros1, sqlite};
use navfuse_core::input::{Input, open as open_file};
use navfuse_core::model::stream::StreamError;
use navfuse_frames::{Window, mcap};
use std::fs::File;
use std::io::{ErrorKind, Read, Seek, SeekFrom};
use std::path::{Component, Path, PathBuf};

/// First bytes of what zstd packed.
pub const ZSTD: &[u8] = &[0x28, 0xb5, 0x2f, 0xfd];
/// First bytes of a file that lz4 packed.
const LZ4: &[u8] = &[0x04, 0x22, 0x4d, 0x18];
/// Endings of the files of a bag.
const ENDINGS: [&str; 3] = ["mcap", "db3", "bag"];
/// Endings that packing adds.
const PACKED: [&str; 2] = ["zstd", "lz4"];
/// Largest ratio of an unpacked database to its packed file, and bytes that are always allowed.
const LARGEST_RATIO: u64 = 1000;
const ALWAYS: u64 = 1 << 26;

/// The content of a file.
pub enum Storage {
    Mcap(Window),
    Ros1(Window),
    Sqlite(Input),
}

/// A file of a bag.
pub struct Opened {
    pub storage: Storage,
    /// Its size on the disk in bytes.
    pub length: u64,
    pub notes: Vec<String>,
}

/// Tests whether a path has the ending of a bag's file: `.mcap`, `.db3`, packed or not.
pub fn is_bag(path: &Path) -> bool {
    let name = path.file_name().map(|n| n.to_string_lossy().to_lowercase()).unwrap_or_default();
    let plain = PACKED.iter().find_map(|p| name.strip_suffix(p)?.strip_suffix('.'));
    let plain = plain.unwrap_or(&name);
    ENDINGS.iter().any(|e| plain.strip_suffix(e).is_some_and(|rest| rest.ends_with('.')))
}

/// The paths in the list `relative_file_paths` of a `metadata.yaml`.
fn listed(text: &str) -> Vec<PathBuf> {
    let mut lines = text.lines().map(str::trim);
    lines.by_ref().find(|l| *l == "relative_file_paths:");
    let items = lines.map_while(|l| l.strip_prefix("- "));
    let path = |item: &str| PathBuf::from(item.trim().trim_matches(['"', '\'']));
    // a bag from a stranger names files of its own folder alone
    let own = |p: &PathBuf| p.components().all(|c| matches!(c, Component::Normal(_)));
    items.map(path).filter(own).collect()
}

/// The number at the end of the stem of a name, so that `bag_10` follows `bag_9`.
fn part(path: &Path) -> (String, u64) {
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let stem = name.split('.').next().unwrap_or_default();
    let digits = stem.len() - stem.bytes().rev().take_while(u8::is_ascii_digit).count();
    (stem[..digits].to_owned(), stem[digits..].parse().unwrap_or(0))
}

/// Finds the files of a bag, which is a folder or a list of files.
///
/// # Errors
/// When there are none.
pub fn find(paths: &[PathBuf]) -> Result<Vec<PathBuf>, StreamError> {
    let mut files = Vec::new();
    for path in paths {
        if !path.is_dir() {
            files.push(path.clone());
            continue;
        }
        let metadata = path.join("metadata.yaml");
        let text = match open_file(&metadata) {
            Ok(file) => {
                let mut text = Vec::new();
                file.take(1 << 24)
                    .read_to_end(&mut text)
                    .map_err(|e| StreamError::read(&metadata, e))?;
                String::from_utf8_lossy(&text).into_owned()
            }
            Err(_) => String::new(),
        };
        let mut found: Vec<PathBuf> = listed(&text)
            .iter()
            .map(|file| path.join(file))
            // some versions name the packed file, others the file before it was packed
            .filter_map(|file| {
                let packed = PACKED.map(|p| {
                    let mut name = file.clone().into_os_string();
                    name.push(format!(".{p}"));
                    PathBuf::from(name)
                });
                std::iter::once(file).chain(packed).find(|f| f.is_file())
            })
            .collect();
        if found.is_empty() {
            let entries = std::fs::read_dir(path).map_err(|e| StreamError::open(path, e))?;
            found = entries.filter_map(|e| Some(e.ok()?.path())).filter(|p| is_bag(p)).collect();
            found.sort_by_key(|p| part(p));
        }
        if found.is_empty() {
            return Err(StreamError::format("the folder has no file .mcap, .db3 or .bag of a bag")
                .in_file(path)
                .with_remedy("give the folder that `ros2 bag record` wrote"));
        }
        files.extend(found);
    }
    Ok(files)
}

/// Opens a file and recognises its content.
///
/// # Errors
/// When it cannot be read, or is no file of a bag.
pub fn open(path: &Path) -> Result<Opened, StreamError> {
    let absolute = || std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let read = |e| StreamError::read(path, e);
    let mut file = open_file(path).map_err(|e| StreamError::open(absolute(), e))?;
    let length = file.metadata().map_err(read)?.len();
    let mut magic = Vec::new();
    (&mut file).take(16).read_to_end(&mut magic).map_err(read)?;
    file.seek(SeekFrom::Start(0)).map_err(read)?;
    let mut notes = Vec::new();
    let unpacked: Option<Box<dyn Read + Send>> = if magic.starts_with(ZSTD) {
        Some(Box::new(zstd::Decoder::new(file.try_clone().map_err(read)?).map_err(read)?))
    } else if magic.starts_with(LZ4) {
        Some(Box::new(lz4_flex::frame::FrameDecoder::new(file.try_clone().map_err(read)?)))
    } else {
        None
    };
    let packed = unpacked.is_some();
    let stream: Box<dyn Read + Send> = match unpacked {
        Some(unpacked) => Box::new(Tolerant(unpacked)),
        None => Box::new(file.try_clone().map_err(read)?),
    };
    let mut window = Window::new(stream);
    window.need(16).map_err(read)?;
    let storage = if window.bytes().starts_with(mcap::MAGIC) {
        Storage::Mcap(window)
    } else if window.bytes().starts_with(ros1::MAGIC) {
        Storage::Ros1(window)
    } else if window.bytes().starts_with(sqlite::MAGIC) {
        let wal = PathBuf::from(format!("{}-wal", path.display()));
        if wal.metadata().is_ok_and(|m| m.len() > 0) {
            notes.push(format!(
                "messages in {} are not read: `ros2 bag info` merges them into the bag",
                wal.display()
            ));
        }
        Storage::Sqlite(if packed {
            unpack(window, length, path, &mut notes)?.into()
        } else {
            file
        })
    } else {
        let text = match length {
            0 => "the file is empty",
            _ => {
                "this is neither MCAP nor SQLite, the storages of bags of ROS 2, nor a bag of ROS 1"
            }
        };
        return Err(StreamError::format(text)
            .in_file(path)
            .with_remedy("give the folder or the files of a bag that `ros2 bag record` wrote"));
    };
    Ok(Opened { storage, length, notes })
}

/// Unpacks a database to a temporary file, since its pages are read in any order.
fn unpack(
    mut window: Window,
    length: u64,
    path: &Path,
    notes: &mut Vec<String>,
) -> Result<File, StreamError> {
    let most = length.saturating_mul(LARGEST_RATIO).saturating_add(ALWAYS);
    let fail = |e| StreamError::read(path, e);
    let mut file = tempfile::tempfile().map_err(fail)?;
    while window.need(1).map_err(fail)? {
        std::io::Write::write_all(&mut file, window.bytes()).map_err(fail)?;
        let count = window.bytes().len();
        window.skip(count);
        if window.offset() > most {
            notes.push(format!("the unpacked database is not read beyond byte {most}"));
            break;
        }
    }
    Ok(file)
}

/// A packed stream, which ends where it is damaged or cut off. The storage in it reports the cut.
struct Tolerant(Box<dyn Read + Send>);

impl Read for Tolerant {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        match self.0.read(out) {
            Err(e) if e.kind() == ErrorKind::Interrupted => Err(e),
            other => Ok(other.unwrap_or(0)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_of_files_has_those_of_the_own_folder_alone() {
        let text = "rosbag2_bagfile_information:\n  version: 5\n  relative_file_paths:\n    - a_0.db3\n    \
                    - \"a_1.db3\"\n    - ../b.db3\n    - /etc/passwd\n  duration:\n    nanoseconds: 1\n";
        assert_eq!(listed(text), ["a_0.db3", "a_1.db3"].map(PathBuf::from));
        assert_eq!(listed("no list\n- a"), Vec::<PathBuf>::new());
    }

    #[test]
    fn parts_follow_in_the_order_of_their_numbers() {
        let mut names = ["bag_10.mcap", "bag_9.mcap", "bag_0.mcap.zstd"].map(PathBuf::from);
        assert!(names.iter().all(|n| is_bag(n)));
        names.sort_by_key(|p| part(p));
        assert_eq!(names, ["bag_0.mcap.zstd", "bag_9.mcap", "bag_10.mcap"].map(PathBuf::from));
        assert!(!is_bag(Path::new("metadata.yaml")) && !is_bag(Path::new("mcap")));
    }
}
