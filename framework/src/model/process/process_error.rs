//! The error of process models: its kind, its message and its cause.

use std::error::Error;
use std::fmt;
use std::sync::Arc;

/// A failure of a process model. Its text names what is wrong and the remedy; the run adds the time
/// and the name of the process.
///
/// ```
/// use navfuse_core::model::process::{ProcessError, ProcessErrorKind};
///
/// let error = ProcessError::input("no wheel sample covers this time");
/// assert_eq!(error.to_string(), "no wheel sample covers this time");
/// assert_eq!(error.kind(), ProcessErrorKind::Input);
/// ```
#[derive(Clone, Debug)]
pub struct ProcessError {
    kind: ProcessErrorKind,
    message: String,
    source: Option<Arc<dyn Error + Send + Sync>>,
}

/// The kind of a failure, for a program that reacts to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ProcessErrorKind {
    /// The driving sample is missing or incomplete, or its gap is too long.
    Input,
    /// The state or the input is outside the domain of the model.
    Domain,
    /// The initial alignment failed.
    Alignment,
    /// None of the other kinds.
    Other,
}

impl ProcessError {
    /// An error of the kind [`ProcessErrorKind::Other`].
    pub fn new(message: impl Into<String>) -> Self {
        Self::of(ProcessErrorKind::Other, message)
    }

    /// An error of any kind.
    pub fn of(kind: ProcessErrorKind, message: impl Into<String>) -> Self {
        Self { kind, message: message.into(), source: None }
    }

    /// An error of the kind [`ProcessErrorKind::Input`].
    pub fn input(message: impl Into<String>) -> Self {
        Self::of(ProcessErrorKind::Input, message)
    }

    /// An error of the kind [`ProcessErrorKind::Domain`].
    pub fn domain(message: impl Into<String>) -> Self {
        Self::of(ProcessErrorKind::Domain, message)
    }

    /// An error of the kind [`ProcessErrorKind::Alignment`].
    pub fn alignment(message: impl Into<String>) -> Self {
        Self::of(ProcessErrorKind::Alignment, message)
    }

    /// Adds the cause, which [`Error::source`] returns.
    #[must_use]
    pub fn with_source(mut self, cause: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        self.source = Some(Arc::from(cause.into()));
        self
    }

    /// The kind.
    pub fn kind(&self) -> ProcessErrorKind {
        self.kind
    }
}

/// Two errors are equal if kind and message are; causes cannot be compared.
impl PartialEq for ProcessError {
    fn eq(&self, other: &Self) -> bool {
        self.kind == other.kind && self.message == other.message
    }
}

impl fmt::Display for ProcessError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl Error for ProcessError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.source.as_deref().map(|cause| cause as &(dyn Error + 'static))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cause_of_an_error_is_its_source() {
        let error = ProcessError::new("the vehicle has left the map");
        assert!(error.source().is_none());
        let cause = error.with_source("height 12 km").source().map(ToString::to_string);
        assert_eq!(cause.as_deref(), Some("height 12 km"));
    }

    #[test]
    fn errors_are_equal_if_kind_and_text_are_whatever_the_cause() {
        let error = ProcessError::new("the vehicle has left the map");
        assert_eq!(error, error.clone().with_source("height 12 km"));
        assert_ne!(error, ProcessError::new("the vehicle is under ground"));
    }
}
