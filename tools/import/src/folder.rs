//! The files in a folder that is no bag, as programs of phones and data sets write them.

use std::path::{Path, PathBuf};

/// Depth to which folders are searched, and the largest number of files.
const DEPTH: usize = 4;
const MOST: usize = 200;
/// Ends of the files of a bag.
const BAGS: [&str; 2] = ["mcap", "db3"];

/// The files in a folder, in the order of their paths, or the folders among them that have a file for
/// each row. `None` for a file, for a bag, and for such a folder itself.
pub fn files(folder: &Path) -> Option<Vec<PathBuf>> {
    let mut files = Vec::new();
    if !folder.is_dir() || is_one(folder) {
        return None;
    }
    collect(folder, DEPTH, &mut files);
    (!files.is_empty()).then_some(files)
}

/// Tests whether a folder is one recording: a bag, or a file for each row.
fn is_one(folder: &Path) -> bool {
    let entries = || std::fs::read_dir(folder).into_iter().flatten().flatten();
    let bag = |path: PathBuf| path.extension().is_some_and(|e| BAGS.iter().any(|bag| e == *bag));
    navfuse_csv::is_folder(folder) || entries().any(|entry| bag(entry.path()))
}

fn collect(folder: &Path, depth: usize, files: &mut Vec<PathBuf>) {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    paths.sort();
    for path in paths {
        let inside = path.is_dir() && !is_one(&path);
        if inside && depth > 0 {
            collect(&path, depth - 1, files);
        } else if !inside && files.len() < MOST {
            files.push(path);
        }
    }
}
