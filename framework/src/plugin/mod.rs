//! Plugins, and the types that they register.

#[allow(clippy::module_inception, reason = "the room and its first concept")]
mod plugin;
mod registry;

pub use plugin::{Need, Plugin, PluginError};
pub use registry::*;
