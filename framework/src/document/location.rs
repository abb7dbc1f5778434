//! The place of a value.

use std::fmt;

/// The place of a value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Location {
    /// A line of a file.
    File {
        /// The file as it was named.
        name: String,
        /// The line, counted from 1.
        line: usize,
    },
    /// An override on the command line.
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
