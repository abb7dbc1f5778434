//! Errors of campaigns.

use navfuse_core::files::FolderError;
use navfuse_core::plugin::BuildError;
use navfuse_core::session::RunError;
use std::fmt::Display;
use std::path::{Path, PathBuf};

type Source = Box<dyn std::error::Error + Send + Sync>;

/// Error of a campaign. The message names the place and, where there is one, the remedy.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CampaignError {
    /// The scenario does not compose.
    #[error(transparent)]
    Scenario(#[from] BuildError),
    /// An option does not fit.
    #[error("{option}: {message}")]
    Option {
        /// The option, with its value where it has one.
        option: String,
        /// The reason and the remedy.
        message: String,
    },
    /// The scenario composes, but a campaign needs more.
    #[error("{0}")]
    Unsuitable(&'static str),
    /// The run that computes the bound failed.
    #[error("the bound: {0}")]
    BoundRun(#[source] RunError),
    /// The bound could not be computed.
    #[error("the bound: {0}")]
    Bound(String),
    /// The file that the backward pass of the bound needs cannot be written or read.
    #[error("{}: {source} (temporary files of the smoothed bound)", .folder.display())]
    Tape {
        /// The folder for temporary files.
        folder: PathBuf,
        /// The error of the operating system.
        source: std::io::Error,
    },
    /// A file or a folder cannot be written, or its content does not fit.
    #[error("{}: {message}", .path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// The reason and the remedy.
        message: String,
        /// The error of the operating system or of the format.
        source: Option<Source>,
    },
    /// The folder of the results cannot be used.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// The parts that are to be merged are not a whole campaign.
    #[error("{0}")]
    Parts(String),
}

impl CampaignError {
    /// An option that does not fit.
    pub(crate) fn option(option: impl Into<String>, message: impl Into<String>) -> Self {
        Self::Option { option: option.into(), message: message.into() }
    }

    /// A file that cannot be read or written.
    pub(crate) fn file(path: &Path, source: impl Into<Source>) -> Self {
        let source = source.into();
        Self::File { path: path.into(), message: source.to_string(), source: Some(source) }
    }

    /// A file that cannot be read or written, with the remedy.
    pub(crate) fn file_with(path: &Path, source: impl Into<Source>, remedy: impl Display) -> Self {
        let source = source.into();
        let message = format!("{source}: {remedy}");
        Self::File { path: path.into(), message, source: Some(source) }
    }

    /// A file or folder whose content does not fit.
    pub(crate) fn content(path: &Path, message: impl Into<String>) -> Self {
        Self::File { path: path.into(), message: message.into(), source: None }
    }

    /// The temporary file of the smoothed bound.
    pub(crate) fn tape(source: std::io::Error) -> Self {
        Self::Tape { folder: std::env::temp_dir(), source }
    }
}

/// Error of a text that is not a part of a campaign, such as `1/7`.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{text:?} is not a part of a campaign: give a part as 1/7, 2/7 ... 7/7")]
pub struct ShardError {
    /// The text.
    pub text: String,
}
