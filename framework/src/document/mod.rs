//! A TOML document that remembers the place of every value, so that each error names the file,
//! the line, the key, the value found and the values allowed.

mod absent;
#[allow(clippy::module_inception, reason = "the room and its first concept")]
mod document;
mod error;
mod explain;
mod include;
mod location;
mod node;
mod places;
mod quote;
mod reader;
#[cfg(test)]
mod tests;

pub use absent::file_remedy;
pub use document::{Document, LONGEST};
pub use error::{DocumentError, Fault, OverrideError};
pub use explain::{did_you_mean, unknown};
pub use location::{Excerpt, Location};
pub(crate) use node::Inside;
pub use node::Node;
pub use quote::{key, quoted};
