//! The error of a live run.

use navfuse_core::model::stream::StreamError;
use navfuse_core::plugin::BuildError;

/// The reason why a run cannot start.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LiveError {
    /// The scenario does not fit.
    #[error(transparent)]
    Scenario(#[from] BuildError),
    /// A thread cannot be started, or a checkpoint does not fit.
    #[error(transparent)]
    Start(#[from] StreamError),
    /// A plugin panicked.
    #[error("a plugin panicked: the run has no result")]
    Panicked,
}
