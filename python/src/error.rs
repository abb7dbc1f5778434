//! Exceptions: the classes of `navfuse/_errors.py`, with the place and the remedy of an error.

use navfuse::CommandError;
use navfuse_core::document::{DocumentError, Location};
use navfuse_core::model::stream::StreamError;
use navfuse_core::plugin::BuildError;
use navfuse_core::session::RunError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Module of the classes.
const MODULE: &str = "navfuse._errors";

/// The place of an error, as far as it is known.
#[derive(Default)]
struct Place {
    file: Option<String>,
    line: Option<u64>,
    column: Option<usize>,
    key: Option<String>,
}

impl Place {
    fn of(error: &CommandError) -> Self {
        match error {
            CommandError::Document(error) | CommandError::Build(BuildError::Document(error)) => {
                Self::of_document(error)
            }
            CommandError::Stream(error) | CommandError::Run(RunError::Source { error, .. }) => {
                Self::of_stream(error)
            }
            CommandError::File { path, .. } => {
                Self { file: Some(path.display().to_string()), ..Self::default() }
            }
            _ => Self::default(),
        }
    }

    fn of_document(error: &DocumentError) -> Self {
        let column = error.excerpt().map(|excerpt| excerpt.column());
        match error {
            DocumentError::Read { name, .. } => {
                Self { file: Some(name.clone()), ..Self::default() }
            }
            DocumentError::Syntax { name, line, column, .. } => Self {
                file: Some(name.clone()),
                line: Some(*line as u64),
                column: Some(*column),
                key: None,
            },
            DocumentError::Place { location, path, .. } => {
                let (file, line) = match location {
                    Location::File { name, line, .. } => (Some(name.clone()), Some(*line as u64)),
                    Location::Set { .. } => (None, None),
                };
                Self { file, line, column, key: Some(path.clone()).filter(|p| !p.is_empty()) }
            }
            DocumentError::Set { assignment, .. } => {
                let key = assignment.split('=').next().map(str::to_owned);
                Self { key, ..Self::default() }
            }
            _ => Self::default(),
        }
    }

    fn of_stream(error: &StreamError) -> Self {
        let place = error.place();
        let file = place.path.as_ref().map(|path| path.display().to_string());
        let key = place.key.clone().or_else(|| place.sensor.clone());
        Self { file, line: place.line, column: None, key }
    }
}

/// Name of the class of an error.
fn class(error: &CommandError) -> &'static str {
    match error {
        CommandError::Document(DocumentError::Read { .. })
        | CommandError::Build(BuildError::Document(DocumentError::Read { .. }))
        | CommandError::File { .. }
        | CommandError::Folder(_)
        | CommandError::Stream(_)
        | CommandError::Run(RunError::Source { .. }) => "DataError",
        CommandError::Document(_) | CommandError::Build(_) => "ScenarioError",
        CommandError::Run(_) => "RunError",
        _ => "NavfuseError",
    }
}

/// The exception of an error.
pub fn exception(error: impl Into<CommandError>) -> PyErr {
    exception_of(&error.into())
}

/// The exception of an error that is kept.
pub fn exception_of(error: &CommandError) -> PyErr {
    let message = error.to_string();
    let excerpt = error.excerpt().map(ToString::to_string);
    raised(class(error), &message, &Place::of(error), excerpt)
}

fn raised(class: &str, message: &str, place: &Place, excerpt: Option<String>) -> PyErr {
    Python::attach(|py| {
        let new = || {
            let details = PyDict::new(py);
            details.set_item("file", &place.file)?;
            details.set_item("line", place.line)?;
            details.set_item("column", place.column)?;
            details.set_item("key", &place.key)?;
            details.set_item("excerpt", excerpt)?;
            py.import(MODULE)?.getattr(class)?.call((message,), Some(&details))
        };
        new().map_or_else(|error| error, PyErr::from_value)
    })
}
