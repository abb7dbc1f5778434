//! Processes: their models, driving sensors, screening, monitors and initial alignment.

pub mod input;
pub mod monitor;
#[allow(clippy::module_inception, reason = "the room and its first concept")]
mod process;
mod process_error;
mod product;
pub mod screening;
mod second_order;
pub mod start;
mod step;
mod stepping;
mod wanderer;

pub use process::{BuiltProcess, Input, Interval, OwnDynamics, ProcessModel};
pub use process_error::{ProcessError, ProcessErrorKind};
pub use product::Product;
pub use second_order::SecondOrder;
pub use step::{Densities, Moved, Step};
pub(crate) use stepping::Stepping;
pub(crate) use wanderer::Wanderer;
