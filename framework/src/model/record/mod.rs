//! What a run records: estimates, updates, events, findings and the verdict.

mod derived;
pub mod finding;
#[allow(clippy::module_inception, reason = "the room and its first concept")]
mod record;
mod rejection;
pub mod verdict;
mod wants;

pub use derived::Derived;
pub use record::{Epoch, Event, InputRejection, Level, Observer, Repetition, Truth, UpdateRecord};
pub use rejection::{Outcome, Outcomes, Rejection};
pub use wants::{Record, Wants};
