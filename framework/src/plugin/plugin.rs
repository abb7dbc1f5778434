//! Plugins, which register types.

use crate::plugin::Registry;
use crate::plugin::error::{PluginConflict, PluginError};
use crate::plugin::need::Need;
use semver::{Version, VersionReq};
use std::any::{Any, TypeId};
use std::sync::Arc;

/// Adds types to the registry.
///
/// ```
/// use navfuse_core::plugin::{Need, Plugin, Registry};
///
/// struct SonarPlugin;
///
/// impl Plugin for SonarPlugin {
///     fn build(&self, registry: &mut Registry) {
///         // registry.sensor::<Sonar>();
///     }
///     navfuse_core::named_after_crate!();
///     fn needs(&self) -> &[Need] {
///         &[Need { plugin: "navfuse-ins", version: "0.1" }]
///     }
/// }
///
/// let error = Registry::new().add(&SonarPlugin).check().unwrap_err();
/// assert!(error.to_string().contains("needs the plugin navfuse-ins 0.1, which is not there"));
/// ```
///
/// A group is a plugin that adds other plugins in `build`. A program that adds the group can still
/// replace, disable or set each member; see [`Registry`].
pub trait Plugin: Any {
    /// Registers the types of the plugin.
    fn build(&self, registry: &mut Registry);

    /// Name by which other plugins refer to it: the name of its crate. Default: its type.
    fn name(&self) -> &'static str {
        std::any::type_name::<Self>()
    }

    /// Version of its crate. Default: the version of the framework.
    fn version(&self) -> &'static str {
        env!("CARGO_PKG_VERSION")
    }

    /// Plugins without which its types cannot be composed.
    fn needs(&self) -> &[Need] {
        &[]
    }
}

/// Defines [`Plugin::name`] and [`Plugin::version`] inside `impl Plugin`, from the Cargo.toml of
/// the calling crate.
#[macro_export]
macro_rules! named_after_crate {
    () => {
        fn name(&self) -> &'static str {
            env!("CARGO_PKG_NAME")
        }

        fn version(&self) -> &'static str {
            env!("CARGO_PKG_VERSION")
        }
    };
}

/// A plugin that was added.
#[derive(Clone, Debug)]
struct Member {
    plugin: TypeId,
    /// The group that added the plugin.
    group: Option<TypeId>,
    name: &'static str,
    version: &'static str,
    needs: Vec<Need>,
}

/// The plugins of a registry.
#[derive(Debug, Default)]
pub(crate) struct Members {
    members: Vec<Member>,
    /// Plugins whose `build` is running, the innermost last.
    building: Vec<Option<TypeId>>,
    /// Plugins that were to be replaced or disabled but are absent.
    absent: Vec<&'static str>,
}

impl Members {
    pub(crate) fn begin(&mut self, plugin: &dyn Plugin) {
        let id = plugin.type_id();
        self.members.push(Member {
            plugin: id,
            group: self.current(),
            name: plugin.name(),
            version: plugin.version(),
            needs: plugin.needs().to_vec(),
        });
        self.building.push(Some(id));
    }

    pub(crate) fn end(&mut self) {
        self.building.pop();
    }

    /// Assigns the plugins added until [`Self::end`] to the group of a plugin.
    pub(crate) fn begin_beside(&mut self, plugin: TypeId) {
        let group = self.members.iter().find(|m| m.plugin == plugin).and_then(|m| m.group);
        self.building.push(group);
    }

    /// The plugin that is registering types.
    pub(crate) fn current(&self) -> Option<TypeId> {
        self.building.last().copied().flatten()
    }

    /// Removes a plugin and those that it added; returns all removed plugins.
    pub(crate) fn remove(&mut self, plugin: TypeId, name: &'static str) -> Vec<TypeId> {
        if !self.members.iter().any(|m| m.plugin == plugin) {
            self.absent.push(name);
            return Vec::new();
        }
        let mut gone = vec![plugin];
        let mut k = 0;
        while let Some(group) = gone.get(k).copied() {
            let inside = self.members.iter().filter(|m| m.group == Some(group)).map(|m| m.plugin);
            let more: Vec<TypeId> = inside.filter(|plugin| !gone.contains(plugin)).collect();
            gone.extend(more);
            k += 1;
        }
        self.members.retain(|m| !gone.contains(&m.plugin));
        gone
    }

    fn name(&self, plugin: Option<TypeId>) -> &'static str {
        let member = plugin.and_then(|p| self.members.iter().find(|m| m.plugin == p));
        member.map_or("this program", |m| m.name)
    }

    /// Checks that the plugins fit together; `clashes` are the types that were registered twice,
    /// each by its table and name, with the two plugins concerned.
    pub(crate) fn check(
        &self,
        clashes: impl Iterator<Item = (&'static str, Arc<str>, [Option<TypeId>; 2])>,
    ) -> Result<(), PluginError> {
        let absent = self.absent.iter().map(|&plugin| PluginConflict::Absent { plugin });
        let mut conflicts: Vec<PluginConflict> = absent.collect();
        for (k, member) in self.members.iter().enumerate() {
            if self.members[..k].iter().any(|m| m.plugin == member.plugin) {
                conflicts.push(PluginConflict::AddedTwice { plugin: member.name });
            }
        }
        for (table, name, owners) in clashes {
            if owners[0].is_some() && owners[0] == owners[1] {
                continue; // the plugin was added twice, which is a conflict already
            }
            let [first, second] = owners.map(|owner| self.name(owner));
            conflicts.push(PluginConflict::Clash { table, name, first, second });
        }
        for member in &self.members {
            conflicts.extend(member.needs.iter().filter_map(|need| self.unmet(member, *need)));
        }
        PluginError::check(conflicts)
    }

    /// The conflict of a need that is not met.
    fn unmet(&self, member: &Member, need: Need) -> Option<PluginConflict> {
        let Member { name: plugin, version, .. } = *member;
        let found = if need.plugin == env!("CARGO_PKG_NAME") {
            Some(env!("CARGO_PKG_VERSION"))
        } else {
            self.members.iter().find(|m| m.name == need.plugin).map(|m| m.version)
        };
        let Some(found) = found else {
            return Some(PluginConflict::Unmet { plugin, version, need });
        };
        let wanted = match VersionReq::parse(need.version) {
            Ok(wanted) => wanted,
            Err(e) => {
                let reason = e.to_string();
                return Some(PluginConflict::MalformedRequirement {
                    plugin,
                    version,
                    need,
                    reason,
                });
            }
        };
        match Version::parse(found) {
            Ok(parsed) if wanted.matches(&parsed) => None,
            Ok(_) => Some(PluginConflict::WrongVersion { plugin, version, need, found }),
            Err(e) => {
                let reason = e.to_string();
                Some(PluginConflict::MalformedVersion { plugin, version, need, found, reason })
            }
        }
    }
}
