//! Why a part cannot be composed.

use crate::document::{DocumentError, Node};

/// Why a part cannot be composed: the key below its table, and what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{key}: {message}")]
pub struct ComposeError {
    key: String,
    message: String,
}

impl ComposeError {
    /// An error about a key of the part's table (empty for the table itself).
    pub fn new(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self { key: key.into(), message: message.into() }
    }

    /// The error with its place in the document.
    pub(crate) fn at(&self, node: &Node<'_>) -> DocumentError {
        let mut place = node.clone();
        for key in self.key.split('.').filter(|k| !k.is_empty()) {
            match place.get(key) {
                Some(inner) => place = inner,
                None => return place.error(format!("{key}: {}", self.message)),
            }
        }
        place.error(&self.message)
    }
}
