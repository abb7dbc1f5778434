//! Errors of the command.

use navfuse_calibration::CalibrationError;
use navfuse_campaign::CampaignError;
use navfuse_core::document::{DocumentError, Excerpt};
use navfuse_core::files::FolderError;
use navfuse_core::model::stream::StreamError;
use navfuse_core::plugin::{BuildError, PluginError};
use navfuse_core::session::RunError;
use navfuse_diagnose::DiagnoseError;
use navfuse_figures::FigureError;
use navfuse_import::ImportError;
use navfuse_live::LiveError;
use navfuse_observability::plan::PlanError;
use navfuse_report::pan_wu::Missing;
use navfuse_segments::SegmentError;
use std::borrow::Cow;
use std::io;
use std::path::{Path, PathBuf};

/// Result of a command.
pub type Result<T> = std::result::Result<T, CommandError>;

/// The reason for which a command failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CommandError {
    /// An argument that cannot be used.
    #[error("{argument}: {message}")]
    Argument {
        /// The argument as it was given.
        argument: String,
        /// The reason and the remedy.
        message: String,
    },
    /// A request that cannot be fulfilled.
    #[error("{0}")]
    Request(String),
    /// A file or folder that cannot be read or written.
    #[error("{}: {failure}: {source}{remedy}", path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// The action that failed.
        failure: &'static str,
        /// The remedy, after a semicolon; empty where the reason suffices.
        remedy: Cow<'static, str>,
        /// The reason.
        source: io::Error,
    },
    /// A method of calibration gave no estimate.
    #[error("{name}: {source}")]
    Method {
        /// Name of the method.
        name: String,
        /// The reason.
        source: Box<CommandError>,
    },
    /// One of many runs failed.
    #[error("with --set seed={seed}: {source}")]
    Seed {
        /// The seed of the run.
        seed: u64,
        /// The reason.
        source: Box<CommandError>,
    },
    /// The scenario cannot be read or changed.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// The scenario cannot be composed or opened.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The folder of the results cannot be used.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// Standard output cannot be written.
    #[error("standard output cannot be written: {0}; the result was not printed whole")]
    StandardOutput(String),
    /// The plugins do not fit together.
    #[error(transparent)]
    Plugin(#[from] PluginError),
    /// A log or a recording failed.
    #[error(transparent)]
    Stream(#[from] StreamError),
    /// The run failed.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The campaign failed.
    #[error(transparent)]
    Campaign(#[from] CampaignError),
    /// The samples do not give what was asked of them.
    #[error(transparent)]
    Segments(#[from] SegmentError),
    /// The method of calibration cannot be applied.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// No manoeuvre can be suggested.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// A figure cannot be drawn.
    #[error(transparent)]
    Figure(#[from] FigureError),
    /// A figure of the paper needs something that the run does not have.
    #[error(transparent)]
    Paper(#[from] Missing),
    /// A result cannot be written as JSON.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
}

impl From<LiveError> for CommandError {
    fn from(error: LiveError) -> Self {
        match error {
            LiveError::Scenario(error) => error.into(),
            LiveError::Start(error) => error.into(),
            other => Self::Request(other.to_string()),
        }
    }
}

impl From<ImportError> for CommandError {
    fn from(error: ImportError) -> Self {
        match error {
            ImportError::Stream(error) => error.into(),
            ImportError::Build(error) => error.into(),
            ImportError::Document(error) => error.into(),
            other => Self::Request(other.to_string()),
        }
    }
}

impl From<DiagnoseError> for CommandError {
    fn from(error: DiagnoseError) -> Self {
        match error {
            DiagnoseError::Build(error) => error.into(),
            DiagnoseError::Document(error) => error.into(),
            other => Self::Request(other.to_string()),
        }
    }
}

impl CommandError {
    /// The line of a file with the mistake; none where the error is not about a place in a file.
    pub fn excerpt(&self) -> Option<&Excerpt> {
        match self {
            Self::Document(error) | Self::Build(BuildError::Document(error)) => error.excerpt(),
            Self::Method { source, .. } | Self::Seed { source, .. } => source.excerpt(),
            _ => None,
        }
    }

    /// The error of a text that cannot be made, for `map_err`.
    pub fn rendering(source: io::Error) -> Self {
        Self::Request(format!("the text cannot be made: {source}"))
    }

    /// An error about an argument.
    pub fn argument(argument: impl Into<String>, message: impl Into<String>) -> Self {
        Self::Argument { argument: argument.into(), message: message.into() }
    }

    /// The error of a file that cannot be written, for `map_err`.
    pub fn cannot_write(path: &Path) -> impl FnOnce(io::Error) -> Self {
        Self::file(path, "cannot be written", "")
    }

    /// The error of a file or folder, for `map_err`.
    pub fn file(
        path: &Path,
        failure: &'static str,
        remedy: impl Into<Cow<'static, str>>,
    ) -> impl FnOnce(io::Error) -> Self {
        let (path, remedy) = (path.to_owned(), remedy.into());
        move |source| Self::File { path, failure, remedy, source }
    }
}
