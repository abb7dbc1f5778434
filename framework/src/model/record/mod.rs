//! What a run records: estimates, updates, events, findings and the verdict.

pub mod answers;
mod corrected;
mod derived;
mod event;
pub mod finding;
pub mod health;
pub mod latest;
mod outcome;
#[allow(clippy::module_inception, reason = "the room and its first concept")]
mod record;
pub mod verdict;
mod wants;

pub use corrected::Corrected;
pub use derived::Derived;
pub use event::{Event, Level};
pub use outcome::{InPart, Outcome, Outcomes, Rejection};
pub use record::{Epoch, InputRejection, Observer, Repetition, Truth, UpdateRecord};
pub use wants::{Record, Wants};
