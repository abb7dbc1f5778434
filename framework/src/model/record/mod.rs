//! What a run records: estimates, updates, events, findings and the verdict.

pub mod finding;
#[allow(clippy::module_inception, reason = "the room and its first concept")]
mod record;
pub mod verdict;
mod wants;

pub use record::{
    Epoch, Event, InputRejection, Level, Observer, Outcome, Rejection, Repetition, Truth,
    UpdateRecord,
};
pub use wants::{Record, Wants};
