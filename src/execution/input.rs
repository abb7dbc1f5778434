//! The scenario of a command: a TOML file, or a log that holds one.

use crate::error::{CommandError, Result};
use navfuse_core::document::Document;
use navfuse_core::units::Time as Duration;
use serde::Deserialize;
use serde::de::IntoDeserializer;
use serde::de::value::Error as ValueError;
use std::path::{Path, PathBuf};

/// The scenario at a path, and the settings that it needs: for a log, the setting that makes the
/// log the source of samples.
pub fn document_of(path: &Path) -> Result<(Document, Vec<String>)> {
    if !has_extension(path, "mcap") {
        return Ok((Document::from_file(path)?, Vec::new()));
    }
    let (document, source) = of_log(path, None)?;
    Ok((document, vec![source]))
}

/// The scenario of a log, or another one, and the setting that makes the log its source.
pub fn of_log(log: &Path, scenario: Option<&Path>) -> Result<(Document, String)> {
    let path = std::fs::canonicalize(log).map_err(CommandError::file(log, "cannot be read", ""))?;
    let document = match scenario {
        Some(path) => Document::from_file(path)?,
        None => {
            let info = navfuse_mcap::read_scenario(log)?;
            let name = path.with_file_name(format!("{}.toml", folder_name(&info.name)));
            Document::parse(name.display().to_string(), info.scenario)?
        }
    };
    Ok((document, format!("source={{ mcap = {{ path = {:?} }} }}", path.display().to_string())))
}

/// True for a path with this extension, in capital or small letters.
pub fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension))
}

/// The default output folder of a run of that name: a folder in `runs`.
pub fn runs_folder(name: &str) -> PathBuf {
    Path::new("runs").join(folder_name(name))
}

/// The name of a scenario as the name of a folder. It never leads out of the folder around it.
fn folder_name(name: &str) -> String {
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    let name: String = name.chars().map(plain).collect();
    let name = name.trim_start_matches('.');
    if name.is_empty() { "run".to_owned() } else { name.to_owned() }
}

/// The time that an option gives, s.
pub fn seconds(option: &str, text: &str) -> Result<f64> {
    let deserializer = IntoDeserializer::<ValueError>::into_deserializer(text);
    let time = Duration::deserialize(deserializer)
        .map_err(|e| CommandError::argument(format!("{option} {text:?}"), e.to_string()))?;
    Ok(time.si())
}
