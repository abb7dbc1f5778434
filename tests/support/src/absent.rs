//! Tests whose needs are absent from a machine.
//!
//! A skip is an outcome of its own. [`skip`] prints it past the capture of `cargo test`, appends it
//! to the file that `NAVFUSE_SKIPPED` names, and fails where `NAVFUSE_REQUIRE` lists the need.
//! `.ci/run` sets both variables and prints the count.

use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Thing that a test needs and a machine may lack. Its name stands in `NAVFUSE_REQUIRE`.
#[derive(Clone, Copy, Debug)]
pub enum Need {
    /// Recordings, which are not part of the repository.
    Data,
    /// Python with packages of its index.
    Python,
    /// Chromium.
    Browser,
    /// The rerun viewer with a Vulkan driver.
    Viewer,
    /// A version of the viewer that is later than the one that writes the recordings.
    LaterViewer,
    /// The batch system Slurm.
    Slurm,
    /// Valgrind, which counts instructions.
    Valgrind,
    /// `socat`, which makes a serial line.
    Socat,
    /// Devices and programs of a Unix, such as `/dev/full` and `script`.
    Unix,
}

/// Records that the current test is skipped.
///
/// # Panics
/// If `NAVFUSE_REQUIRE` lists the need, or is `all`.
pub fn skip(need: Need, why: &str) {
    let required = std::env::var("NAVFUSE_REQUIRE").unwrap_or_default();
    let thread = std::thread::current();
    let test = thread.name().unwrap_or("a test");
    let line = outcome(&required, need, test, why).unwrap_or_else(|fault| panic!("{fault}"));
    std::io::stderr().write_all(line.as_bytes()).unwrap(); // `eprint` would be captured
    if let Some(file) = std::env::var_os("NAVFUSE_SKIPPED") {
        let mut file = OpenOptions::new().create(true).append(true).open(file).unwrap();
        file.write_all(line.as_bytes()).unwrap();
    }
}

/// The line of a skipped test, or the reason of its failure. `required` is a list with commas.
fn outcome(required: &str, need: Need, test: &str, why: &str) -> Result<String, String> {
    let name = format!("{need:?}").to_lowercase();
    let why = why.trim().lines().last().unwrap_or_default();
    if required.split(',').any(|r| r == "all" || r == name) {
        return Err(format!("NAVFUSE_REQUIRE={required}, but {test} finds no {name}: {why}"));
    }
    Ok(format!("skipped {test}: no {name}: {why}\n"))
}

/// Returns the folder of recorded data of a name, below `NAVFUSE_DATA` or beside the repository. If
/// it is absent, the test is skipped, with the origin of the public original.
pub fn data(name: &str, origin: &str) -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let folder = std::env::var_os("NAVFUSE_DATA").map_or_else(beside, PathBuf::from).join(name);
    if folder.is_dir() {
        return Some(folder);
    }
    let folder = folder.display();
    skip(Need::Data, &format!("{folder} (set NAVFUSE_DATA to its parent). {origin}"));
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_absent_need_is_a_skip_unless_it_is_required() {
        let of = |required| outcome(required, Need::Python, "reads_back", "line\nno pip\n");
        assert_eq!(of("").unwrap(), "skipped reads_back: no python: no pip\n");
        assert!(of("data,browser").is_ok());
        for required in ["all", "python", "data,python"] {
            assert!(of(required).unwrap_err().contains("reads_back finds no python: no pip"));
        }
    }
}
