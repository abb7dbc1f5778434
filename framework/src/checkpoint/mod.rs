//! Checkpoints: the memory of a run as bytes, from which a run of the same scenario goes on.

mod bytes;
mod error;
mod io;
mod values;

pub use crate::saved;
pub use bytes::Checkpoint;
pub(crate) use bytes::Part;
pub(crate) use bytes::fnv1a;
pub use error::CheckpointError;
pub use io::{Io, Saved};
