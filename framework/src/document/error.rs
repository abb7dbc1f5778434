//! Errors of documents and of their overrides.

use crate::document::location::{Excerpt, Location};

/// An error of a document: its place, and what is wrong there.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DocumentError {
    /// The file cannot be read.
    #[error("{name}: {source}{remedy}")]
    Read {
        /// The file as it was named.
        name: String,
        /// The remedy, after a semicolon; empty where the cause suffices.
        remedy: String,
        /// The cause.
        source: std::io::Error,
    },
    /// The text is not TOML.
    #[error("{name}:{line}:{column}: {message}")]
    Syntax {
        /// The file as it was named.
        name: String,
        /// The line, counted from 1.
        line: usize,
        /// The column in characters, counted from 1.
        column: usize,
        /// The violation of the syntax.
        message: String,
        /// The line with the violation.
        excerpt: Box<Excerpt>,
    },
    /// A key or value is not allowed.
    #[error("{}{message}", place(location, message))]
    Place {
        /// The place of the key or value.
        location: Location,
        /// The path of the key; empty for the whole document.
        path: String,
        /// The kind of the mistake.
        fault: Fault,
        /// The key, the value found, and what is allowed.
        message: String,
    },
    /// An override cannot be applied.
    #[error("--set {assignment}: {source}")]
    Set {
        /// The override as given.
        assignment: String,
        /// The cause.
        source: OverrideError,
    },
}

/// Kind of a mistake in a document.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fault {
    /// A key, or a name among registered ones, that does not exist; with the one that was meant,
    /// where one is near.
    Unknown(Option<String>),
    /// A table that lacks this key.
    Missing(String),
    /// A value that does not fit.
    Value,
}

/// The place before a message. A message that begins with the key of the override names it by itself.
fn place(location: &Location, message: &str) -> String {
    match location {
        Location::Set { path } if begins_with_key(message, path) => "--set ".to_owned(),
        _ => format!("{location}: "),
    }
}

/// Returns `true` where a message begins with a key path as a whole.
fn begins_with_key(message: &str, path: &str) -> bool {
    message.strip_prefix(path).is_some_and(|rest| rest.starts_with([':', ' ']))
}

impl DocumentError {
    /// The line of the text with the mistake, which carets mark; none for an override.
    pub fn excerpt(&self) -> Option<&Excerpt> {
        match self {
            Self::Syntax { excerpt, .. }
            | Self::Place { location: Location::File { excerpt: Some(excerpt), .. }, .. } => {
                Some(excerpt)
            }
            _ => None,
        }
    }
}

/// An error of an override `key.path=value`.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum OverrideError {
    /// The override has no `=`.
    #[error("`key.path=value` is needed")]
    NoEqualsSign,
    /// The text before `=` is not a key path.
    #[error("{text:?} is not a key path such as sensor.dvl.gate")]
    KeyPath {
        /// The text before `=`.
        text: String,
    },
    /// The text after `=` is empty.
    #[error("a value is needed after `=`")]
    NoValue,
    /// The value starts like TOML but is not TOML.
    #[error("the value is not TOML: {reason}")]
    NotToml {
        /// The violation of the syntax.
        reason: String,
    },
    /// The array has no such element.
    #[error("{array} has {length} elements, counted from 0: there is no {index}")]
    NoElement {
        /// Key path of the array.
        array: String,
        /// Number of its elements.
        length: usize,
        /// The index as given.
        index: String,
    },
    /// The path passes through a value that is neither a table nor an array.
    #[error("{path} is {found}, not a table")]
    NotATable {
        /// Key path of that value.
        path: String,
        /// The kind of that value, with its article.
        found: &'static str,
    },
}
