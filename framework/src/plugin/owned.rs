//! Types of one kind, with the plugins that registered them.

use std::any::TypeId;
use std::sync::Arc;

/// A kind, a name of it that is registered twice, and the two plugins.
pub(super) type Clash = (&'static str, Arc<str>, [Option<TypeId>; 2]);

/// Types, each with the plugin that registered it, if a plugin did.
#[derive(Debug)]
pub(super) struct Owned<T>(Vec<(T, Option<TypeId>)>);

impl<T> Default for Owned<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T: Copy> Owned<T> {
    pub(super) fn push(&mut self, one: T, owner: Option<TypeId>) {
        self.0.push((one, owner));
    }

    /// Removes the types of a plugin.
    pub(super) fn remove(&mut self, plugin: TypeId) {
        self.0.retain(|(_, owner)| *owner != Some(plugin));
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = T> + '_ {
        self.0.iter().map(|(one, _)| *one)
    }

    /// Names that are registered twice.
    pub(super) fn clashes(
        &self,
        kind: &'static str,
        name: impl Fn(T) -> &'static str,
    ) -> impl Iterator<Item = Clash> {
        self.0.iter().enumerate().filter_map(move |(k, (one, owner))| {
            let before = self.0[..k].iter().find(|(other, _)| name(*other) == name(*one))?;
            Some((kind, name(*one).into(), [before.1, *owner]))
        })
    }
}
