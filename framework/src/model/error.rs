//! Errors of composition.

use crate::document::{DocumentError, Node};

/// Reason why a part cannot be composed: the key below the part's table, and a message with the
/// remedy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{key}: {message}")]
pub struct ComposeError {
    key: String,
    message: String,
}

impl ComposeError {
    /// Creates an error about a key of the part's table (empty for the table itself).
    pub fn new(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self { key: key.into(), message: message.into() }
    }

    /// Adds the place in the document.
    pub(crate) fn at(&self, node: &Node<'_>) -> DocumentError {
        match node.reach(&self.key) {
            (place, None) => place.error(&self.message),
            (place, Some(key)) => place.error(format!("{key}: {}", self.message)),
        }
    }
}
