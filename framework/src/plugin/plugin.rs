//! Plugins: what registers types, under which name and version, and what of others it needs.

use crate::plugin::{Entry, Registry};
use semver::{Version, VersionReq};
use std::any::{Any, TypeId};
use std::fmt::Write as _;

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
/// A group is a plugin that adds others in `build`; whoever takes it can still replace, disable or set each of them:
/// see [`Registry`].
pub trait Plugin: Any {
    /// Registers what the plugin brings.
    fn build(&self, registry: &mut Registry);

    /// The name by which other plugins need it: that of its crate. Default: its type.
    fn name(&self) -> &'static str {
        std::any::type_name::<Self>()
    }

    /// Its version: that of its crate. Default: that of the framework.
    fn version(&self) -> &'static str {
        env!("CARGO_PKG_VERSION")
    }

    /// The plugins without which its types cannot be composed.
    fn needs(&self) -> &[Need] {
        &[]
    }
}

/// [`Plugin::name`] and [`Plugin::version`] from the Cargo.toml of the crate that calls it, inside of `impl Plugin`.
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

/// A plugin that another needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Need {
    /// Its [`Plugin::name`]; `navfuse-core` is the framework.
    pub plugin: &'static str,
    /// The versions that serve, as in Cargo.toml: `"0.1"`, `">=0.1.3, <0.3"`.
    pub version: &'static str,
}

/// Why plugins do not fit together: every reason, each with what to do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct PluginError(pub String);

/// A plugin that was added.
#[derive(Clone, Debug)]
struct Member {
    plugin: TypeId,
    /// The group that added it.
    group: Option<TypeId>,
    name: &'static str,
    version: &'static str,
    needs: Vec<Need>,
}

/// The plugins of a registry.
#[derive(Debug, Default)]
pub(crate) struct Members {
    members: Vec<Member>,
    /// Those whose `build` runs, the innermost last.
    building: Vec<Option<TypeId>>,
    /// What was to be replaced or disabled and is not there.
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

    /// What is added until [`Self::end`] belongs to the group of a plugin.
    pub(crate) fn begin_beside(&mut self, plugin: TypeId) {
        let group = self.members.iter().find(|m| m.plugin == plugin).and_then(|m| m.group);
        self.building.push(group);
    }

    /// The plugin that registers now.
    pub(crate) fn current(&self) -> Option<TypeId> {
        self.building.last().copied().flatten()
    }

    /// Forgets a plugin and those that it added; gives all that are gone.
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

    /// Whether they fit together; `clashes` are types that were registered twice, by whom.
    pub(crate) fn check<'e>(
        &self,
        clashes: impl Iterator<Item = (&'e Entry, [Option<TypeId>; 2])>,
    ) -> Result<(), PluginError> {
        let mut text = String::new();
        let mut say = |what: std::fmt::Arguments<'_>| {
            let _ = write!(text, "{}{what}", if text.is_empty() { "" } else { "\n" });
        };
        for name in &self.absent {
            say(format_args!(
                "{name} is to be replaced or disabled, but is no plugin here; add it first, or leave that out"
            ));
        }
        for (k, member) in self.members.iter().enumerate() {
            if self.members[..k].iter().any(|m| m.plugin == member.plugin) {
                say(format_args!(
                    "the plugin {} is added twice; add it once, or `set` it for other settings",
                    member.name
                ));
            }
        }
        for (entry, owners) in clashes {
            if owners[0].is_some() && owners[0] == owners[1] {
                continue; // added twice, as told
            }
            let ([before, now], table) = (owners.map(|o| self.name(o)), entry.kind.table());
            say(format_args!(
                "{now} registers the {table} type {:?}, which {before} has registered; rename it, or `replace` the plugin",
                entry.name
            ));
        }
        for member in &self.members {
            for need in &member.needs {
                if let Some(what) = self.lacks(need) {
                    say(format_args!(
                        "the plugin {} {} needs the plugin {what}",
                        member.name, member.version
                    ));
                }
            }
        }
        if text.is_empty() { Ok(()) } else { Err(PluginError(text)) }
    }

    /// What is not as it is needed.
    fn lacks(&self, Need { plugin, version }: &Need) -> Option<String> {
        let there = if *plugin == env!("CARGO_PKG_NAME") {
            Some(env!("CARGO_PKG_VERSION"))
        } else {
            self.members.iter().find(|m| m.name == *plugin).map(|m| m.version)
        };
        let Some(there) = there else {
            return Some(format!(
                "{plugin} {version}, which is not there; add that one, or disable this"
            ));
        };
        let wanted = match VersionReq::parse(version) {
            Ok(wanted) => wanted,
            Err(e) => {
                return Some(format!("{plugin} in the version {version:?}, which is none: {e}"));
            }
        };
        match Version::parse(there) {
            Ok(parsed) if wanted.matches(&parsed) => None,
            Ok(_) => Some(format!(
                "{plugin} {version}, but {there} is there; take versions that fit together"
            )),
            Err(e) => Some(format!("{plugin}, whose version {there:?} is none: {e}")),
        }
    }
}
