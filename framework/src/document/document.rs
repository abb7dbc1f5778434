//! A TOML document with the overrides of the command line.

use crate::document::absent::file_remedy;
use crate::document::error::{DocumentError, OverrideError};
use crate::document::location::Excerpt;
use crate::document::node::{Node, kind};
use crate::document::places::{Places, join};
use crate::input::{Held, read_text, text_of};
use serde::Deserialize;
use std::path::Path;
use std::sync::Arc;
use toml::de::{DeTable, Deserializer};
use toml::{Table, Value};

/// Largest number of bytes of a document with all that it includes.
pub const LONGEST: u64 = 64 << 20;

/// A TOML document, with the overrides of the command line.
#[derive(Clone, Debug)]
pub struct Document {
    pub(super) name: String,
    text: String,
    pub(super) value: Value,
    pub(super) places: Places,
    overrides: Vec<String>,
    /// The files that were read, which no result replaces as long as the document is used.
    pub(super) inputs: Vec<Arc<Held>>,
}

impl Document {
    /// Reads the document in a file, and the documents that it includes.
    ///
    /// # Errors
    /// When a file cannot be read or is not TOML, or a file includes itself.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self, DocumentError> {
        let path = path.as_ref();
        match text_of(path).and_then(|name| Ok((name, read_text(path, LONGEST)?))) {
            Ok((name, text)) => Self::parse_with_includes(name, text),
            Err(source) => {
                let remedy = file_remedy(path, "toml", &source);
                Err(DocumentError::Read { name: path.display().to_string(), remedy, source })
            }
        }
    }

    /// Reads the document in a text, which includes no other one. Errors name the file `name`.
    ///
    /// # Errors
    /// When the text is not TOML.
    pub fn parse(name: impl Into<String>, text: impl Into<String>) -> Result<Self, DocumentError> {
        let (name, text) = (name.into(), text.into());
        let syntax = |e: toml::de::Error| {
            let excerpt = Excerpt::of(&text, e.span().unwrap_or(0..0));
            DocumentError::Syntax {
                name: name.clone(),
                line: excerpt.line,
                column: excerpt.column(),
                message: e.message().trim().to_owned(),
                excerpt: Box::new(excerpt),
            }
        };
        let table = DeTable::parse(&text).map_err(syntax)?;
        let places = Places::of(&name, &text, table.get_ref());
        let table = Table::deserialize(Deserializer::from(table)).map_err(syntax)?;
        let value = Value::Table(table);
        Ok(Self { name, text, value, places, overrides: Vec::new(), inputs: Vec::new() })
    }

    /// Sets a value, as `key.path=value`. Missing tables are created. A number in the path is the
    /// index of an array's element: `segments.2.duration` belongs to the third segment. The value
    /// is TOML; any other text is a string, so that a quantity needs no quotes.
    ///
    /// # Errors
    /// When the override is malformed, or its path passes through a value that is neither a table
    /// nor an array. The document then stays as it was.
    pub fn set(&mut self, assignment: &str) -> Result<(), DocumentError> {
        self.assign(assignment)
            .map_err(|source| DocumentError::Set { assignment: assignment.to_owned(), source })?;
        self.overrides.push(assignment.to_owned());
        Ok(())
    }

    fn assign(&mut self, assignment: &str) -> Result<(), OverrideError> {
        let (key, text) = assignment.split_once('=').ok_or(OverrideError::NoEqualsSign)?;
        let keys = key_path(key.trim())?;
        let new = override_value(text.trim())?;
        let mut path = String::new();
        let mut outermost = None;
        let mut value = &mut self.value;
        for key in &keys {
            let inner = join(&path, key);
            let parent = std::mem::replace(&mut path, inner);
            value = match value {
                Value::Table(table) => table.entry(key.as_str()).or_insert_with(|| {
                    // a missing table is created for the new key, and so are those inside it
                    outermost.get_or_insert_with(|| path.clone());
                    Value::Table(Table::new())
                }),
                Value::Array(array) => {
                    let length = array.len();
                    let element = key.parse().ok().and_then(|index: usize| array.get_mut(index));
                    let index = key.clone();
                    element.ok_or(OverrideError::NoElement { array: parent, length, index })?
                }
                other => {
                    return Err(OverrideError::NotATable { path: parent, found: kind(other) });
                }
            };
        }
        *value = new;
        self.places.set(outermost.as_ref().unwrap_or(&path), &path);
        Ok(())
    }

    /// Removes a table or value at the top of the document; returns `true` if there was one.
    pub fn remove(&mut self, key: &str) -> bool {
        let table = self.value.as_table_mut();
        table.is_some_and(|table| table.remove(key).is_some())
    }

    /// Removes the value at a key path; returns `true` if there was one. An element of an array
    /// stays, since its removal would move the others.
    pub fn remove_path(&mut self, path: &str) -> bool {
        let Some((table, key)) = self.table_of(path) else { return false };
        table.remove(&key).is_some()
    }

    /// Renames the key at a path; returns `true` if there is one and the new key was free.
    pub fn rename_path(&mut self, path: &str, new: &str) -> bool {
        let Some((table, key)) = self.table_of(path) else { return false };
        if table.contains_key(new) {
            return false;
        }
        let Some(value) = table.remove(&key) else { return false };
        table.insert(new.to_owned(), value);
        let parent = path.strip_suffix(&join("", &key)).unwrap_or_default();
        self.places.rename(path, &join(parent.trim_end_matches('.'), new));
        true
    }

    /// The table with the key at the end of a path, and that key.
    fn table_of(&mut self, path: &str) -> Option<(&mut Table, String)> {
        let mut keys = key_path(path).ok()?;
        let key = keys.pop()?;
        let value = keys.iter().try_fold(&mut self.value, |value, key| match value {
            Value::Table(table) => table.get_mut(key),
            Value::Array(array) => array.get_mut(key.parse::<usize>().ok()?),
            _ => None,
        });
        Some((value?.as_table_mut()?, key))
    }

    /// The document as a node.
    pub fn root(&self) -> Node<'_> {
        Node::root(&self.places, &self.value)
    }

    /// The text as it was read.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The overrides that [`Self::set`] has applied, as given.
    pub fn overrides(&self) -> &[String] {
        &self.overrides
    }

    /// The document with its overrides, as TOML.
    pub fn to_toml(&self) -> String {
        self.value.as_table().map_or_else(String::new, Table::to_string)
    }

    /// The file's name without folder and extension.
    pub fn stem(&self) -> String {
        Path::new(&self.name)
            .file_stem()
            .map_or_else(String::new, |s| s.to_string_lossy().into_owned())
    }

    /// The file's folder, to which paths in the document are relative.
    pub fn folder(&self) -> &Path {
        Path::new(&self.name).parent().unwrap_or(Path::new(""))
    }
}

/// The keys of a dotted path as TOML reads it.
fn key_path(text: &str) -> Result<Vec<String>, OverrideError> {
    let malformed = || OverrideError::KeyPath { text: text.to_owned() };
    if text.contains(['\n', '\r']) {
        return Err(malformed());
    }
    let mut table: Table = toml::from_str(&format!("{text} = 0")).map_err(|_| malformed())?;
    let mut keys = Vec::new();
    while let Some((key, inner)) = table.into_iter().next() {
        keys.push(key);
        table = if let Value::Table(inner) = inner { inner } else { Table::new() };
    }
    if keys.is_empty() { Err(malformed()) } else { Ok(keys) }
}

/// The value of an override: TOML, or a string where the text does not start like TOML.
fn override_value(text: &str) -> Result<Value, OverrideError> {
    match text.parse() {
        Ok(value) => Ok(value),
        Err(_) if text.is_empty() => Err(OverrideError::NoValue),
        Err(e) if text.starts_with(['"', '\'', '[', '{']) => {
            Err(OverrideError::NotToml { reason: e.message().trim().to_owned() })
        }
        Err(_) => Ok(Value::String(text.to_owned())),
    }
}
