//! Plugins, and the types that they register.

mod context;
mod error;
mod link;
mod need;
mod owned;
#[allow(clippy::module_inception, reason = "the room and its first concept")]
mod plugin;
mod registry;
mod shared;
mod simulation_keys;

pub use context::OpenContext;
pub use error::{PluginConflict, PluginError};
pub use link::LinkType;
pub use need::Need;
pub use plugin::Plugin;
pub use registry::*;
pub use shared::Shared;
