//! A TOML document that remembers where everything stands, so that every error names file, line, key, what was found and
//! what is allowed.

mod explain;
mod node;
mod places;
#[cfg(test)]
mod tests;

pub use explain::did_you_mean;
pub use node::Node;

use places::{Places, join, position};
use std::fmt;
use std::path::Path;
use toml::de::DeTable;
use toml::{Table, Value};

/// Where a value stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Location {
    /// A line of a file.
    File {
        /// The file as it was named.
        name: String,
        /// The line, from 1.
        line: usize,
    },
    /// It was set on the command line.
    Set {
        /// The key path that was set.
        path: String,
    },
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File { name, line } => write!(f, "{name}:{line}"),
            Self::Set { path } => write!(f, "--set {path}"),
        }
    }
}

/// Why a document cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum DocumentError {
    /// The file cannot be read.
    #[error("{name}: {source}")]
    Read {
        /// The file as it was named.
        name: String,
        /// Why.
        source: std::io::Error,
    },
    /// It is not TOML.
    #[error("{name}:{line}:{column}: {message}")]
    Syntax {
        /// The file as it was named.
        name: String,
        /// The line, from 1.
        line: usize,
        /// The column in characters, from 1.
        column: usize,
        /// What is wrong there.
        message: String,
    },
    /// A value is not as it should be.
    #[error("{location}: {message}")]
    Place {
        /// Where it stands.
        location: Location,
        /// Its key, what was found, and what is allowed.
        message: String,
    },
    /// An override cannot be applied.
    #[error("--set {assignment}: {message}")]
    Set {
        /// The override as given.
        assignment: String,
        /// What is wrong with it.
        message: String,
    },
}

/// A TOML document, with the overrides of the command line.
#[derive(Clone, Debug)]
pub struct Document {
    name: String,
    text: String,
    value: Value,
    places: Places,
    overrides: Vec<String>,
}

impl Document {
    /// Reads the document in a file.
    ///
    /// # Errors
    /// When it cannot be read or is not TOML.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self, DocumentError> {
        let name = path.as_ref().display().to_string();
        match std::fs::read_to_string(path) {
            Ok(text) => Self::parse(name, text),
            Err(source) => Err(DocumentError::Read { name, source }),
        }
    }

    /// Reads the document in a text; errors say it is in a file of that name.
    ///
    /// # Errors
    /// When it is not TOML.
    pub fn parse(name: impl Into<String>, text: impl Into<String>) -> Result<Self, DocumentError> {
        let (name, text) = (name.into(), text.into());
        let syntax = |e: toml::de::Error| {
            let (line, column) = position(&text, e.span().map_or(0, |s| s.start));
            DocumentError::Syntax {
                name: name.clone(),
                line,
                column,
                message: e.message().trim().to_owned(),
            }
        };
        let places = Places::of(&name, &text, DeTable::parse(&text).map_err(syntax)?.get_ref());
        let value = Value::Table(toml::from_str(&text).map_err(syntax)?);
        Ok(Self { name, text, value, places, overrides: Vec::new() })
    }

    /// Sets a value, as `key.path=value`: tables that are missing are created, `segments.2.duration` is in the third
    /// element of an array. The value is TOML; what is not TOML is a string, so that a quantity needs no quotes.
    ///
    /// # Errors
    /// When it is malformed, or the path goes through something else than tables and elements; nothing is changed then.
    pub fn set(&mut self, assignment: &str) -> Result<(), DocumentError> {
        self.assign(assignment)
            .map_err(|message| DocumentError::Set { assignment: assignment.to_owned(), message })?;
        self.overrides.push(assignment.to_owned());
        Ok(())
    }

    fn assign(&mut self, assignment: &str) -> Result<(), String> {
        let (key, text) = assignment.split_once('=').ok_or("`key.path=value` is needed")?;
        let keys = key_path(key.trim())?;
        let new = override_value(text.trim())?;
        let mut path = String::new();
        let mut outermost = None;
        let mut value = &mut self.value;
        for key in &keys {
            let inner = join(&path, key);
            let parent = std::mem::replace(&mut path, inner);
            value = match value {
                Value::Table(table) => table.entry(key.as_str()).or_insert_with(|| {
                    // the tables around a new key are new too
                    outermost.get_or_insert_with(|| path.clone());
                    Value::Table(Table::new())
                }),
                Value::Array(array) => {
                    let length = array.len();
                    let element = key.parse().ok().and_then(|index: usize| array.get_mut(index));
                    element.ok_or_else(|| {
                        format!("{parent} has {length} elements, counted from 0: there is no {key}")
                    })?
                }
                other => return Err(format!("{parent} is {}, not a table", node::kind(other))),
            };
        }
        *value = new;
        self.places.set(outermost.as_ref().unwrap_or(&path), &path);
        Ok(())
    }

    /// The document as a node.
    pub fn root(&self) -> Node<'_> {
        Node::root(self, &self.value)
    }

    /// The text as it was read.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// What [`Self::set`] has set, as given.
    pub fn overrides(&self) -> &[String] {
        &self.overrides
    }

    /// The document with its overrides, as TOML.
    pub fn to_toml(&self) -> String {
        self.value.as_table().map_or_else(String::new, Table::to_string)
    }

    /// The file's name without folder and extension.
    pub fn stem(&self) -> String {
        Path::new(&self.name)
            .file_stem()
            .map_or_else(String::new, |s| s.to_string_lossy().into_owned())
    }

    /// The file's folder, to which paths in the document are relative.
    pub fn folder(&self) -> &Path {
        Path::new(&self.name).parent().unwrap_or(Path::new(""))
    }
}

/// The keys of a dotted path as TOML reads it.
fn key_path(text: &str) -> Result<Vec<String>, String> {
    let malformed = || format!("{text:?} is no key path such as sensor.dvl.gate");
    if text.contains(['\n', '\r']) {
        return Err(malformed());
    }
    let mut table: Table = toml::from_str(&format!("{text} = 0")).map_err(|_| malformed())?;
    let mut keys = Vec::new();
    while let Some((key, inner)) = table.into_iter().next() {
        keys.push(key);
        table = if let Value::Table(inner) = inner { inner } else { Table::new() };
    }
    if keys.is_empty() { Err(malformed()) } else { Ok(keys) }
}

/// A value as TOML, or as a string unless it was meant to be TOML.
fn override_value(text: &str) -> Result<Value, String> {
    match text.parse() {
        Ok(value) => Ok(value),
        Err(_) if text.is_empty() => Err("a value is needed after `=`".to_owned()),
        Err(e) if text.starts_with(['"', '\'', '[', '{']) => {
            Err(format!("the value is not TOML: {}", e.message().trim()))
        }
        Err(_) => Ok(Value::String(text.to_owned())),
    }
}
