//! Errors of the smoother.

use crate::units::time::Time;
use std::io;
use std::sync::Arc;

/// Reason why a run cannot be smoothed.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SmoothError {
    /// A temporary file cannot be written or read.
    #[error(
        "the temporary files of the smoother, in {}: {source}; free space there, or name another \
         folder in the environment variable TMPDIR",
        std::env::temp_dir().display()
    )]
    Scratch {
        /// Reason.
        source: Arc<io::Error>,
    },
    /// A segment of the run gave another estimate when it was computed again.
    #[error(
        "the segment that ends at {time} gave another estimate when it was computed again: a model \
         or a detector keeps a part of its state outside of its clone"
    )]
    NotRepeatable {
        /// End of the segment.
        time: Time,
    },
}

impl From<io::Error> for SmoothError {
    fn from(source: io::Error) -> Self {
        Self::Scratch { source: Arc::new(source) }
    }
}
