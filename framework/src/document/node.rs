//! A value of a document with its place.

use super::explain::{Complaint, complaint, unknown};
use super::places::join;
use super::{Document, DocumentError, Location};
use serde::de::DeserializeOwned;
use serde_path_to_error::Segment;
use toml::Value;

/// Which keys of a table [`Node::parse`] sees.
#[derive(Clone, Copy, Debug)]
enum Seen {
    All,
    Only(&'static [&'static str]),
    Without(&'static [&'static str]),
}

/// A value of a [`Document`], which knows its path and where it stands.
#[derive(Clone, Debug)]
pub struct Node<'a> {
    document: &'a Document,
    path: String,
    value: &'a Value,
    seen: Seen,
}

impl<'a> Node<'a> {
    pub(super) fn root(document: &'a Document, value: &'a Value) -> Self {
        Self { document, path: String::new(), value, seen: Seen::All }
    }

    fn below(&self, key: &str, value: &'a Value) -> Self {
        Self { document: self.document, path: join(&self.path, key), value, seen: Seen::All }
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

    /// The keys of a table and their values, in the order in which they are written.
    ///
    /// # Errors
    /// When it is not a table.
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
        entries.sort_by_key(|(_, node)| self.document.places.order(&node.path));
        Ok(entries)
    }

    /// The same table, of which [`Self::parse`] sees only these keys.
    pub fn only(&self, keys: &'static [&'static str]) -> Self {
        Self { seen: Seen::Only(keys), ..self.clone() }
    }

    /// The same table, of which [`Self::parse`] does not see these keys; as they are allowed, errors list them.
    pub fn without(&self, keys: &'static [&'static str]) -> Self {
        Self { seen: Seen::Without(keys), ..self.clone() }
    }

    /// Its key path, such as `sensor.dvl.gate`; empty for the whole document.
    pub fn path(&self) -> &str {
        &self.path
    }

    /// Where it stands.
    pub fn location(&self) -> Location {
        self.document.places.location(&self.path).clone()
    }

    /// The value.
    pub fn value(&self) -> &'a Value {
        self.value
    }

    /// An error about this value, which names its place, path and what was found.
    pub fn error(&self, message: impl std::fmt::Display) -> DocumentError {
        let place = match (self.path.is_empty(), shown(self.value)) {
            (true, _) => String::new(),
            (_, Some(value)) => format!("{} = {value}: ", self.path),
            (_, None) => format!("{}: ", self.path),
        };
        DocumentError::Place { location: self.location(), message: format!("{place}{message}") }
    }

    /// Refuses the first key of a table that is not among the allowed.
    ///
    /// # Errors
    /// When there is one, or it is not a table.
    pub fn check_keys(&self, allowed: &[&str]) -> Result<(), DocumentError> {
        match self.entries()?.iter().find(|(key, _)| !allowed.contains(key)) {
            Some((key, _)) => Err(self.unknown_key(key, allowed)),
            None => Ok(()),
        }
    }

    fn unknown_key(&self, key: &str, allowed: &[&str]) -> DocumentError {
        let path = join(&self.path, key);
        let location = self.document.places.location(&path).clone();
        DocumentError::Place {
            location,
            message: format!("{path}: {}", unknown("key", key, allowed)),
        }
    }

    /// Reads the value as a `T`.
    ///
    /// # Errors
    /// When it does not fit, naming the most specific key and its line.
    pub fn parse<T: DeserializeOwned>(&self) -> Result<T, DocumentError> {
        let mut value = self.value.clone();
        if let Value::Table(table) = &mut value {
            table.retain(|key, _| match self.seen {
                Seen::All => true,
                Seen::Only(keys) => keys.contains(&key),
                Seen::Without(keys) => !keys.contains(&key),
            });
        }
        serde_path_to_error::deserialize(value)
            .map_err(|e| self.explain(e.path(), e.inner().message()))
    }

    /// The error of serde at that path below this node.
    fn explain(&self, path: &serde_path_to_error::Path, message: &str) -> DocumentError {
        let mut place = self.clone();
        for segment in path {
            let inner = match segment {
                Segment::Map { key } => place.get(key),
                Segment::Enum { variant } => place.get(variant),
                Segment::Seq { index } => place.get(&index.to_string()),
                Segment::Unknown => None,
            };
            match inner {
                Some(inner) => place = inner,
                None => break,
            }
        }
        match complaint(message, kind(place.value)) {
            Complaint::Other(words) => place.error(words),
            Complaint::UnknownKey { key, mut allowed } => {
                let table = self.table_of(&place, key);
                if let Seen::Without(common) = table.seen {
                    allowed.extend(common);
                }
                table.unknown_key(key, &allowed)
            }
        }
    }

    /// The table with the unknown key: serde's path ends at that key, or at its table.
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

/// The value as it would be written on a line, unless it is a table or long.
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
