//! The scenario of a command: a TOML file, or a log that holds one.

use crate::error::{CommandError, Result};
use crate::output::warn;
use navfuse_core::document::{Document, LONGEST, file_remedy, quoted};
use navfuse_core::files::part_of;
use navfuse_core::input::{bounded_text, text_of};
use navfuse_core::plugin::Kind;
use navfuse_core::units::Duration;
use serde::Deserialize;
use serde::de::IntoDeserializer;
use serde::de::value::Error as ValueError;
use std::path::{Path, PathBuf};

/// Name of standard input, where a scenario is read.
const STANDARD_INPUT: &str = "-";

/// The scenario in a file, or in standard input for `-`. Paths in it are then relative to the
/// working folder.
pub fn document(path: &Path) -> Result<Document> {
    if path != Path::new(STANDARD_INPUT) {
        return Ok(Document::from_file(path)?);
    }
    let name = "standard input";
    let text = bounded_text(std::io::stdin(), LONGEST);
    let text = text.map_err(CommandError::file(Path::new(name), "cannot be read", ""))?;
    Ok(Document::parse_with_includes("stdin", text)?)
}

/// Name of the log of a run in its folder.
const LOG: &str = "run.mcap";
/// Number of files of a folder that an error names.
const NAMED: usize = 5;

/// The log in the folder of a run: `run.mcap`, or the only log there.
pub fn log_in(folder: &Path) -> Option<PathBuf> {
    let usual = folder.join(LOG);
    if usual.is_file() || part_of(&usual).is_file() {
        return Some(usual);
    }
    let mut logs =
        names(folder).into_iter().map(|name| folder.join(name)).filter(|path| is_log(path));
    logs.next().filter(|_| logs.next().is_none())
}

/// The log at a path, or in the folder of a run there.
///
/// # Errors
/// When the folder has no log, or several: the error names what is there.
pub fn log_of(path: &Path) -> Result<PathBuf> {
    if !path.is_dir() {
        return Ok(path.to_owned());
    }
    log_in(path).ok_or_else(|| {
        let names = names(path);
        let (logs, others): (Vec<_>, Vec<_>) =
            names.into_iter().partition(|name| is_log(Path::new(name)));
        let message = match (logs.is_empty(), others.is_empty()) {
            (false, _) => format!("the folder has several logs; name one of {}", listed(&logs)),
            (true, true) => "the folder is empty; name the log of a run".to_owned(),
            (true, false) => format!("the folder has no log, only {}", listed(&others)),
        };
        CommandError::argument(path.display().to_string(), message)
    })
}

/// The names in a folder, in order.
fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> =
        entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// The first few of some names.
fn listed(names: &[String]) -> String {
    let more = match names.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    names.iter().take(NAMED).cloned().collect::<Vec<_>>().join(", ") + &more
}

/// The scenario at a path, and the settings that it needs: for a log, or the folder of a run with one, the
/// setting that makes the log the source of samples.
pub fn document_of(path: &Path) -> Result<(Document, Vec<String>)> {
    let inside = log_in(path);
    let path = inside.as_deref().unwrap_or(path);
    if !is_log(path) {
        return Ok((document(path)?, Vec::new()));
    }
    let (document, source) = of_log(path, None)?;
    Ok((document, vec![source]))
}

/// The error of a log that cannot be opened. A run that was killed leaves a part of its log.
pub fn missing_log(log: &Path) -> impl FnOnce(std::io::Error) -> CommandError {
    let log = log.to_owned();
    move |error| {
        let remedy = if part_of(&log).is_file() {
            "; the run was killed before the log was whole: name the file that ends in .part, which has \
             everything until then"
                .to_owned()
        } else {
            file_remedy(&log, "mcap", &error)
        };
        CommandError::file(&log, "cannot be read", remedy)(error)
    }
}

/// The scenario of a log, or another one, and the setting that makes the log its source.
pub fn of_log(log: &Path, scenario: Option<&Path>) -> Result<(Document, String)> {
    let path = std::fs::canonicalize(log).map_err(missing_log(log))?;
    let text = text_of(&path).map_err(CommandError::file(log, "cannot be read", ""))?;
    let source = format!("source={{ mcap = {{ path = {} }} }}", quoted(text));
    let document = match scenario {
        Some(path) => self::document(path)?,
        None => {
            let info = navfuse_mcap::read_scenario(log)?;
            let own = env!("CARGO_PKG_VERSION");
            if info.version != own {
                warn(format_args!(
                    "warning: {}: recorded by another version, navfuse {}; this one is {own}, whose results \
                     may differ",
                    log.display(),
                    info.version
                ));
            }
            let name = path.with_file_name(format!("{}.toml", folder_name(&info.name)));
            let name = name.display().to_string();
            let mut document = Document::parse(name.clone(), info.scenario)?;
            // a sink writes files, opens connections and starts a viewer: whoever replays a log,
            // perhaps of a stranger, decides about that, not the log
            if document.remove(Kind::Sink.table()) {
                document = Document::parse(name, document.to_toml())?;
            }
            document
        }
    };
    Ok((document, source))
}

/// True for the path of a log, which may be the part of one that a killed run left.
pub fn is_log(path: &Path) -> bool {
    let whole = if has_extension(path, "part") { path.with_extension("") } else { path.to_owned() };
    has_extension(&whole, "mcap")
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
