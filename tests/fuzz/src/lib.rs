//! Files from a stranger, for every reader of navfuse.
//!
//! Each [`Target`] reads bytes as one kind of file. The fuzz targets in `fuzz/`, the driver of this
//! crate and the test of the corpus call the same functions.
#![allow(missing_docs, clippy::unwrap_used, clippy::panic, reason = "tests fail by panicking")]

mod files;
mod memory;
mod structured;

pub use files::{registry, write_campaign};

use navfuse_testing::damage::{Random, damaged};
use std::cell::OnceCell;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// One kind of file.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Name of the target and of the folder of its corpus.
    pub name: &'static str,
    /// Share of the inputs, by the time that one takes.
    pub weight: u64,
    /// Reads the bytes; returns how much was understood, from 0 for nothing.
    pub read: fn(&[u8]) -> usize,
    /// Damages a file of the corpus, with parts of another one.
    pub damage: fn(&[u8], &[u8], &mut Random) -> Vec<u8>,
    /// Set if mostly good files of the corpus are damaged. A text without sense stays one.
    pub mostly_good: bool,
}

const fn target(name: &'static str, weight: u64, read: fn(&[u8]) -> usize) -> Target {
    Target { name, weight, read, damage: damaged, mostly_good: false }
}

impl Target {
    /// A target of texts, whose structure the damage keeps.
    const fn damaged_by(self, damage: fn(&[u8], &[u8], &mut Random) -> Vec<u8>) -> Self {
        Self { damage, mostly_good: true, ..self }
    }
}

/// All targets. Those with a large weight read in memory, the others read a file.
pub const TARGETS: [Target; 33] = [
    target("pd0", 100, memory::pd0),
    target("pd4", 100, memory::pd4),
    target("pd6", 100, memory::pd6),
    target("ad2cp", 100, memory::ad2cp),
    target("nortek-nmea", 100, memory::nortek_nmea),
    target("water-linked-json", 50, memory::water_linked_json),
    target("water-linked-serial", 100, memory::water_linked_serial),
    target("ulog", 40, memory::ulog),
    target("tlog", 10, memory::tlog),
    target("novatel", 100, memory::novatel),
    target("vectornav", 100, memory::vectornav),
    target("sbet", 100, memory::sbet),
    target("kf-gins", 100, memory::kf_gins),
    target("dataflash", 100, memory::dataflash),
    target("ubx", 100, memory::ubx),
    target("nucleus", 100, memory::nucleus),
    target("sbf", 100, memory::sbf),
    target("psins", 100, memory::psins),
    target("sbg-ecom", 100, memory::sbg_ecom),
    target("vectornav-binary", 100, memory::vectornav_binary),
    target("mip", 100, memory::mip),
    target("lcm", 100, memory::lcm),
    target("imc", 100, memory::imc),
    target("grid", 50, memory::grid),
    target("nmea-sentences", 100, memory::nmea_sentences),
    target("nmea", 4, files::nmea),
    target("bag", 4, files::bag),
    target("csv", 4, files::csv).damaged_by(structured::table),
    target("labels", 4, files::labels),
    target("import", 2, files::import).damaged_by(structured::table),
    target("mcap", 4, files::mcap),
    target("toml", 2, files::toml).damaged_by(structured::scenario),
    target("campaign", 1, files::campaign).damaged_by(structured::definition),
];

/// The target of this name.
///
/// # Panics
/// When there is none.
pub fn named(name: &str) -> Target {
    TARGETS.into_iter().find(|t| t.name == name).unwrap_or_else(|| panic!("no target {name}"))
}

/// The files of the corpus of a target, in order of their names.
pub fn corpus(name: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus").join(name);
    let entries =
        std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths.into_iter().map(|path| (path.clone(), std::fs::read(path).unwrap())).collect()
}

thread_local! {
    /// The folder of the files that are read, in memory where the system has such a folder.
    static FOLDER: OnceCell<TempDir> = const { OnceCell::new() };
}

/// Calls `read` with the folder of this thread.
fn in_folder(read: impl FnOnce(&Path) -> usize) -> usize {
    let memory = Path::new("/dev/shm");
    let make = || {
        if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() }.unwrap()
    };
    FOLDER.with(|folder| read(folder.get_or_init(make).path()))
}
