//! A scenario on a vehicle: samples are used as they arrive.
//!
//! [`run`] starts the links of a scenario, each on a thread of its own, and pushes their samples into
//! a session in the order of arrival, until it is told to stop. It never waits for a link, reports a
//! sensor while it is silent, follows a clock that steps, and saves a checkpoint every few seconds.
//! [`Live`] is the same for a program that pushes samples itself.

mod delays;
mod determined;
mod driver;
mod error;
mod events;
mod health;
mod latency;
mod live;
mod ports;
mod saver;
mod stamps;
mod status;

pub use delays::ClockStatus;
pub use driver::{Options, Watch, run};
pub use error::LiveError;
pub use latency::Latency;
pub use live::{Live, Newest};
pub use saver::{CHECKPOINT, STATUS, read_checkpoint};
pub use status::{Accuracy, Estimate, LinkStatus, SensorState, SensorStatus, StateStatus, Status};
