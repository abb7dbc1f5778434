//! Conflicts between plugins, and reasons why a scenario cannot be built with them.

use crate::document::DocumentError;
use crate::files::FolderError;
use crate::plugin::need::Need;
use std::fmt;
use std::sync::Arc;

/// All conflicts between the plugins of a registry. The message has one line for each, with its
/// remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PluginError {
    conflicts: Vec<PluginConflict>,
}

/// Conflict between plugins.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PluginConflict {
    /// A plugin was to be replaced or disabled but was never added.
    #[error(
        "{plugin} is to be replaced or disabled, but is no plugin here; \
         add it first, or neither replace nor disable it"
    )]
    Absent {
        /// Type of the plugin.
        plugin: &'static str,
    },
    /// A plugin was added twice.
    #[error("the plugin {plugin} is added twice; add it once, or `set` it for other settings")]
    AddedTwice {
        /// Name of the plugin.
        plugin: &'static str,
    },
    /// Two plugins register the same type.
    #[error(
        "{second} registers the {table} type {name:?}, which {first} has registered; \
         rename it, or `replace` the plugin"
    )]
    Clash {
        /// Table of the type in TOML: process, sensor, source or sink.
        table: &'static str,
        /// Name of the type in TOML.
        name: Arc<str>,
        /// The plugin that registered the type first.
        first: &'static str,
        /// The plugin that registered the type again.
        second: &'static str,
    },
    /// A plugin needs another one that was not added.
    #[error(
        "the plugin {plugin} {version} needs the plugin {} {}, which is not there; \
         add that one, or disable this", .need.plugin, .need.version
    )]
    Unmet {
        /// Name of the plugin with the need.
        plugin: &'static str,
        /// Version of the plugin with the need.
        version: &'static str,
        /// The need.
        need: Need,
    },
    /// A plugin needs another version of a plugin than the one that was added.
    #[error(
        "the plugin {plugin} {version} needs the plugin {} {}, but {found} is there; \
         take versions that fit together", .need.plugin, .need.version
    )]
    WrongVersion {
        /// Name of the plugin with the need.
        plugin: &'static str,
        /// Version of the plugin with the need.
        version: &'static str,
        /// The need.
        need: Need,
        /// Version of the plugin that was added.
        found: &'static str,
    },
    /// A need names a version requirement that cannot be parsed.
    #[error(
        "the plugin {plugin} {version} needs the plugin {} in the version {:?}, \
         which is none: {reason}", .need.plugin, .need.version
    )]
    MalformedRequirement {
        /// Name of the plugin with the need.
        plugin: &'static str,
        /// Version of the plugin with the need.
        version: &'static str,
        /// The need.
        need: Need,
        /// The violation of the syntax.
        reason: String,
    },
    /// The version of a needed plugin cannot be parsed.
    #[error(
        "the plugin {plugin} {version} needs the plugin {}, whose version {found:?} is malformed: \
         {reason}", .need.plugin
    )]
    MalformedVersion {
        /// Name of the plugin with the need.
        plugin: &'static str,
        /// Version of the plugin with the need.
        version: &'static str,
        /// The need.
        need: Need,
        /// Version of the plugin that was added.
        found: &'static str,
        /// The violation of the syntax.
        reason: String,
    },
}

impl PluginError {
    /// An error of these conflicts; nothing if there are none.
    pub(crate) fn check(conflicts: Vec<PluginConflict>) -> Result<(), Self> {
        if conflicts.is_empty() { Ok(()) } else { Err(Self { conflicts }) }
    }

    /// All conflicts; there is at least one.
    pub fn conflicts(&self) -> &[PluginConflict] {
        &self.conflicts
    }
}

impl fmt::Display for PluginError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (k, conflict) in self.conflicts.iter().enumerate() {
            write!(f, "{}{conflict}", if k == 0 { "" } else { "\n" })?;
        }
        Ok(())
    }
}

impl std::error::Error for PluginError {}

/// The reason why a part of a scenario cannot be built.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// The scenario does not fit, or a source or sink cannot be opened.
    #[error(transparent)]
    Document(#[from] DocumentError),
    /// The plugins do not fit together.
    #[error(transparent)]
    Plugin(#[from] PluginError),
    /// The folder of the results cannot be written into.
    #[error(transparent)]
    Folder(#[from] FolderError),
}
