//! The viewer's program: finding it, and opening a recording in it.

use crate::live::{LATER, PROGRAM, VERSION};
use navfuse_core::model::stream::StreamError;
use std::path::Path;
use std::process::{Command, Stdio};

/// The viewer's program on this machine.
#[derive(Clone, Debug)]
pub struct ViewerProgram {
    program: String,
    /// Warnings about its version.
    pub warnings: Vec<String>,
}

/// Finds the viewer's program: the one that RERUN_BIN names, or `rerun`.
///
/// # Errors
/// When the program cannot be started; the remedy explains how to install it.
pub fn find() -> Result<ViewerProgram, StreamError> {
    let program = std::env::var(PROGRAM).unwrap_or_else(|_| "rerun".into());
    let output = Command::new(&program).arg("--version").stdin(Stdio::null()).output();
    let output = output.map_err(|e| missing(&program).with_source(e))?;
    let text = String::from_utf8_lossy(&output.stdout);
    let version = text.split_whitespace().find(|word| word.starts_with(|c: char| c.is_numeric()));
    let warnings = match version {
        Some(VERSION | LATER) => Vec::new(),
        found => vec![format!(
            "the viewer `{program}` is {}, and the recording is for version {VERSION}: {}",
            found.map_or_else(|| "of an unknown version".to_owned(), |v| format!("version {v}")),
            install()
        )],
    };
    Ok(ViewerProgram { program, warnings })
}

fn missing(program: &str) -> StreamError {
    StreamError::network(format!("there is no viewer `{program}`"))
        .with_remedy(format!("{}, or set {PROGRAM} to its path", install()))
}

fn install() -> String {
    format!(
        "install it with `pip install rerun-sdk=={VERSION}`, or with \
         `cargo install rerun-cli --version {VERSION} --locked`"
    )
}

impl ViewerProgram {
    /// Opens a recording. The viewer goes on after this program has ended.
    ///
    /// # Errors
    /// When the viewer cannot be started.
    pub fn open(&self, recording: &Path) -> Result<(), StreamError> {
        let mut command = Command::new(&self.program);
        command.arg(recording).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        command.spawn().map(drop).map_err(|e| missing(&self.program).with_source(e))
    }
}
