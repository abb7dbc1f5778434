//! Readers written by others, in Python, with which tests compare.

use crate::absent::{Need, skip};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};

/// Held while an environment is made: the tests of a process run at the same time.
static MAKING: Mutex<()> = Mutex::new(());

/// Packages of the Python package index, in a virtual environment of their own.
#[derive(Debug)]
pub struct Packages<'a> {
    /// Names for the message where they cannot be installed.
    pub names: &'a str,
    /// Folder of the environment, below the target's folder for temporary files.
    pub folder: PathBuf,
    /// Variable that may name an interpreter that has the packages.
    pub variable: Option<&'a str>,
    /// Program that succeeds where the packages are there.
    pub check: &'a str,
    /// Arguments of each `pip install`.
    pub install: &'a [&'a [&'a str]],
}

/// Runs a command and returns its output, or the reason of its failure.
pub fn output(command: &mut Command) -> Result<String, String> {
    let output = command.output().map_err(|e| e.to_string())?;
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    if output.status.success() { Ok(text(&output.stdout)) } else { Err(text(&output.stderr)) }
}

/// The reader and writer of bags of ROS 2, in a folder for temporary files.
pub fn rosbags(folder: &str) -> Packages<'static> {
    Packages {
        names: "rosbags",
        folder: Path::new(folder).join("rosbags"),
        variable: Some("NAVFUSE_ROSBAGS_PYTHON"),
        check: "import lz4, rosbags",
        install: &[&["rosbags==0.11.9", "lz4"]],
    }
}

/// The readers of the tables of campaigns and of exported files, in a folder for temporary files.
pub fn tables(folder: &str) -> Packages<'static> {
    Packages {
        names: "the readers of tables and exported files",
        folder: Path::new(folder).join("tables"),
        variable: Some("NAVFUSE_EXPORT_PYTHON"),
        check: "import evo, fastkml, geojson, gpxpy, pynmea2\n\
                import importlib.metadata as m\n\
                found = [m.version(p) for p in ('polars', 'pandas', 'pyarrow')]\n\
                assert found == ['2.1.0', '3.1.1', '26.0.1'], found",
        install: &[&[
            "polars==2.1.0",
            "pandas==3.1.1",
            "pyarrow==26.0.1",
            "evo",
            "fastkml",
            "geojson",
            "gpxpy",
            "pynmea2",
        ]],
    }
}

/// The readers of logs of vehicles, in a folder for temporary files.
pub fn vehicle_logs(folder: &str) -> Packages<'static> {
    Packages {
        names: "pyulog and pymavlink",
        folder: Path::new(folder).join("vehicle-logs"),
        variable: Some("NAVFUSE_VEHICLE_LOGS_PYTHON"),
        check: "import pyulog, pymavlink",
        install: &[&["pyulog", "pymavlink"]],
    }
}

impl Packages<'_> {
    /// Returns an interpreter with the packages. Without one, the test is skipped.
    pub fn python(&self) -> Option<PathBuf> {
        if let Some(variable) = self.variable
            && let Some(python) = std::env::var_os(variable).map(PathBuf::from)
        {
            let found = self.works(&python);
            assert!(found, "{} of {variable} lacks {}", python.display(), self.names);
            return Some(python);
        }
        let _one_at_a_time = MAKING.lock().unwrap_or_else(PoisonError::into_inner);
        let python = self.folder.join("bin/python");
        if self.works(&python) {
            return Some(python);
        }
        match self.install(&python) {
            Ok(()) => Some(python),
            Err(why) => {
                skip(Need::Python, &format!("{} cannot be installed: {why}", self.names));
                None
            }
        }
    }

    fn works(&self, python: &Path) -> bool {
        output(Command::new(python).args(["-c", self.check])).is_ok()
    }

    fn install(&self, python: &Path) -> Result<(), String> {
        output(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&self.folder))?;
        for packages in self.install {
            // a test imports few of the files, whose compilation takes two thirds of an installation
            let pip = ["-m", "pip", "install", "--quiet", "--no-compile"];
            let more = ["--disable-pip-version-check", "--retries", "1"];
            output(Command::new(python).args(pip).args(more).args(*packages))?;
        }
        output(Command::new(python).args(["-c", self.check])).map(drop)
    }
}
