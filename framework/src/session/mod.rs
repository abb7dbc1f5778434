//! The heart of a run: samples go in, in the order of their arrival, and records come out.

mod announced;
mod comparison;
mod estimators;
mod finished;
mod info;
mod output_rate;
mod outputs;
mod resume;
mod riding;
#[allow(clippy::module_inception, reason = "the room and its first concept")]
mod session;
mod silence;
pub mod summary;
mod verdict;

pub(crate) use estimators::{check, find, settle};
pub use finished::{End, Finished, RunError};
pub use session::Session;
