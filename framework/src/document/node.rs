//! A value of a document with its place.

use crate::document::error::{DocumentError, Fault};
use crate::document::explain::{Complaint, complaint, did_you_mean, unknown};
use crate::document::location::Location;
use crate::document::places::{Part, Places, join};
use crate::document::reader::{Mistake, Reader};
use serde::de::DeserializeOwned;
use toml::Value;

/// The keys of a table that [`Node::parse`] reads.
#[derive(Clone, Copy, Debug)]
enum Seen {
    All,
    Only(&'static [&'static str]),
    Without(&'static [&'static str]),
}

/// Part of an inner table that [`Node::parse`] reads.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Inside<'a> {
    /// Key of the inner table.
    pub key: &'static str,
    /// The keys that are read, or, with `others`, those that are not.
    pub keys: &'a [String],
    pub others: bool,
}

impl Inside<'_> {
    fn reads(&self, key: &str) -> bool {
        self.keys.iter().any(|own| own == key) != self.others
    }
}

/// A value of a [`crate::document::Document`], with its key path and its place.
#[derive(Clone, Debug)]
pub struct Node<'a> {
    places: &'a Places,
    path: String,
    value: &'a Value,
    seen: Seen,
    inside: Option<Inside<'a>>,
}

impl<'a> Node<'a> {
    pub(super) fn root(places: &'a Places, value: &'a Value) -> Self {
        Self { places, path: String::new(), value, seen: Seen::All, inside: None }
    }

    fn below(&self, key: &str, value: &'a Value) -> Self {
        let path = join(&self.path, key);
        Self { places: self.places, path, value, seen: Seen::All, inside: None }
    }

    /// The value at a key of a table, or at an index of an array.
    pub fn get(&self, key: &str) -> Option<Self> {
        let value = match self.value {
            Value::Table(table) => table.get(key),
            Value::Array(array) => array.get(key.parse::<usize>().ok()?),
            _ => None,
        }?;
        Some(self.below(key, value))
    }

    /// The value at a path of keys and indices, or the last one above it that is there, with the first key that is
    /// not.
    pub(crate) fn reach<'k>(&self, path: &'k str) -> (Self, Option<&'k str>) {
        let mut place = self.clone();
        for key in path.split('.').filter(|key| !key.is_empty()) {
            match place.get(key) {
                Some(inner) => place = inner,
                None => return (place, Some(key)),
            }
        }
        (place, None)
    }

    /// The keys of a table and their values, in the order in which they are written.
    ///
    /// # Errors
    /// When the value is not a table.
    pub fn entries(&self) -> Result<Vec<(&'a str, Self)>, DocumentError> {
        let Value::Table(table) = self.value else {
            return Err(self.error(format!(
                "found {}, a table is needed: [{}]",
                kind(self.value),
                self.path
            )));
        };
        let mut entries: Vec<_> =
            table.iter().map(|(key, value)| (key.as_str(), self.below(key, value))).collect();
        entries.sort_by_key(|(_, node)| self.places.order(&node.path));
        Ok(entries)
    }

    /// Restricts the table: [`Self::parse`] reads only these keys.
    pub fn only(&self, keys: &'static [&'static str]) -> Self {
        Self { seen: Seen::Only(keys), ..self.clone() }
    }

    /// Excludes keys from the table: [`Self::parse`] skips them. They are allowed in the document,
    /// so errors list them among the allowed keys.
    pub fn without(&self, keys: &'static [&'static str]) -> Self {
        Self { seen: Seen::Without(keys), ..self.clone() }
    }

    /// Restricts an inner table: [`Self::parse`] reads a part of its keys. Errors list all of them.
    pub(crate) fn inside(&self, inside: Inside<'a>) -> Self {
        Self { inside: Some(inside), ..self.clone() }
    }

    /// The key path of the value, such as `sensor.dvl.gate`; empty for the whole document.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// The place of the value.
    pub fn location(&self) -> Location {
        self.places.location(&self.path, Part::Value)
    }

    /// The value.
    pub fn value(&self) -> &'a Value {
        self.value
    }

    /// An error about this value. It names the place, the key path and the value.
    pub fn error(&self, message: impl std::fmt::Display) -> DocumentError {
        self.mistake(message, Fault::Value)
    }

    /// As [`Self::error`], about a name that is not registered; `meant` is the one that is near.
    pub fn unknown_name(
        &self,
        message: impl std::fmt::Display,
        meant: Option<&str>,
    ) -> DocumentError {
        self.mistake(message, Fault::Unknown(meant.map(str::to_owned)))
    }

    fn mistake(&self, message: impl std::fmt::Display, fault: Fault) -> DocumentError {
        let place = match (self.path.is_empty(), shown(self.value)) {
            (true, _) => String::new(),
            (_, Some(value)) => format!("{} = {value}: ", self.path),
            (_, None) => format!("{}: ", self.path),
        };
        DocumentError::Place {
            location: self.location(),
            path: self.path.clone(),
            fault,
            message: format!("{place}{message}"),
        }
    }

    /// Rejects a table with a key that is not among the allowed ones.
    ///
    /// # Errors
    /// When the table has such a key (the first one is named), or the value is not a table.
    pub fn check_keys(&self, allowed: &[&str]) -> Result<(), DocumentError> {
        match self.entries()?.iter().find(|(key, _)| !allowed.contains(key)) {
            Some((key, _)) => Err(self.unknown_key(key, allowed)),
            None => Ok(()),
        }
    }

    fn unknown_key(&self, key: &str, allowed: &[&str]) -> DocumentError {
        let path = join(&self.path, key);
        let meant = did_you_mean(key, allowed.iter().copied());
        DocumentError::Place {
            location: self.places.location(&path, Part::Key),
            message: format!("{path}: {}", unknown("key", key, allowed)),
            path,
            fault: Fault::Unknown(meant.map(str::to_owned)),
        }
    }

    /// Reads the value as a `T`.
    ///
    /// # Errors
    /// When the value does not fit `T`. The error names the innermost key and its line.
    pub fn parse<T: DeserializeOwned>(&self) -> Result<T, DocumentError> {
        let mut value = self.value.clone();
        if let Value::Table(table) = &mut value {
            table.retain(|key, _| match self.seen {
                Seen::All => true,
                Seen::Only(keys) => keys.contains(&key),
                Seen::Without(keys) => {
                    let own = |inside: Inside<'_>| !inside.others && inside.key == key;
                    !keys.contains(&key) || self.inside.is_some_and(own)
                }
            });
            if let Some(inside) = self.inside
                && let Some(Value::Table(inner)) = table.get_mut(inside.key)
            {
                inner.retain(|key, _| inside.reads(key));
            }
        }
        T::deserialize(Reader(&value)).map_err(|mistake| self.explain(&mistake))
    }

    /// The error about a value at or below this node.
    fn explain(&self, mistake: &Mistake) -> DocumentError {
        let mut place = self.clone();
        for key in mistake.path.iter().rev() {
            match place.get(key) {
                Some(inner) => place = inner,
                None => break,
            }
        }
        match complaint(&mistake.message, kind(place.value)) {
            Complaint::MissingKey(key) => {
                let fault = Fault::Missing(key.to_owned());
                place.mistake(format_args!("missing key {key:?}"), fault)
            }
            Complaint::Other(words) => place.error(words),
            Complaint::UnknownKey { key, mut allowed } => {
                let table = self.table_of(&place, key);
                if let Seen::Without(common) = table.seen {
                    let more = common.iter().filter(|key| !allowed.contains(key));
                    let more: Vec<&str> = more.copied().collect();
                    allowed.extend(more);
                }
                if let Some(inside) = self.inside.filter(|i| join(&self.path, i.key) == table.path)
                {
                    allowed.extend(inside.keys.iter().map(String::as_str));
                }
                table.unknown_key(key, &allowed)
            }
        }
    }

    /// The table with the unknown key. The path ends at that key or at its table.
    fn table_of(&self, place: &Self, key: &str) -> Self {
        let parent = (place.path.strip_suffix(&join("", key)))
            .map(|p| p.strip_suffix('.').unwrap_or(p))
            .filter(|p| join(p, key) == place.path && p.len() >= self.path.len());
        match parent {
            Some(path) if path == self.path => self.clone(),
            Some(path) => Self { path: path.to_owned(), ..place.clone() },
            None => place.clone(),
        }
    }
}

/// The kind of a value, with its article.
pub fn kind(value: &Value) -> &'static str {
    match value {
        Value::String(_) => "a string",
        Value::Integer(_) => "a whole number",
        Value::Float(_) => "a number",
        Value::Boolean(_) => "a boolean",
        Value::Datetime(_) => "a date",
        Value::Array(_) => "an array",
        Value::Table(_) => "a table",
    }
}

/// The value as TOML writes it on one line; `None` for a table and for a long value.
fn shown(value: &Value) -> Option<String> {
    const MAX: usize = 60;
    match value {
        Value::Table(_) => None,
        Value::String(text) if text.chars().count() > MAX => {
            Some(format!("{:?}...", text.chars().take(MAX).collect::<String>()))
        }
        Value::String(text) => Some(format!("{text:?}")),
        other => Some(other.to_string()).filter(|t| t.chars().count() <= MAX),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_of_an_inner_table_reads_its_keys_or_all_others() {
        let keys = ["rate".to_owned(), "offset".to_owned()];
        let part = |others| Inside { key: "simulation", keys: &keys, others };
        for (key, own) in [("rate", true), ("offset", true), ("noise", false)] {
            assert_eq!(part(false).reads(key), own, "{key}");
            assert_eq!(part(true).reads(key), !own, "{key}");
        }
    }
}
