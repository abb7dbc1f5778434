//! Plugins, and the types that they register.

mod context;
mod entry;
mod error;
mod link;
mod need;
mod owned;
#[allow(clippy::module_inception, reason = "the room and its first concept")]
mod plugin;
mod registry;
mod shared;
mod simulation_keys;
mod types;

pub use context::OpenContext;
pub(crate) use entry::{BuiltSensor, Make, PreparedSink};
pub use entry::{Entry, Kind};
pub use error::{BuildError, PluginConflict, PluginError};
pub use link::LinkType;
pub use need::Need;
pub use plugin::Plugin;
pub use registry::Registry;
pub use shared::Shared;
pub use types::{ProcessType, SensorType, SinkType, SourceType};
