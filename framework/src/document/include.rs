//! Documents that include others: `include = "base.toml"`.
//!
//! A document is laid over those that it includes, in the order in which it names them: a table is
//! merged key by key, and any other value, an array among them, replaces the earlier one.

use crate::document::document::{Document, LONGEST};
use crate::document::error::DocumentError;
use crate::document::node::Node;
use crate::document::places::join;
use crate::input::{Held, read_text};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use toml::{Table, Value};

/// The key that names the included documents.
const INCLUDE: &str = "include";
/// Largest number of documents that one includes, at any depth; each counts as often as it is named.
const MOST: usize = 1000;

/// The reading of a document with its includes.
struct Reading {
    /// The files on the way to the document that is read.
    way: Vec<PathBuf>,
    /// Number of documents that were included.
    count: usize,
    /// Number of bytes that more documents may have.
    left: u64,
}

impl Document {
    /// Reads the document in a text, and the documents that it includes. Their paths are relative
    /// to the folder of the file `name`, which errors name.
    ///
    /// # Errors
    /// When a text is not TOML, an included file cannot be read, or a file includes itself.
    pub fn parse_with_includes(
        name: impl Into<String>,
        text: impl Into<String>,
    ) -> Result<Self, DocumentError> {
        let document = Self::parse(name, text)?;
        let way = vec![canonical(Path::new(&document.name))];
        let left = LONGEST.saturating_sub(document.text().len() as u64);
        document.resolved(&mut Reading { way, count: 0, left })
    }

    /// The document laid over those that it includes.
    fn resolved(mut self, reading: &mut Reading) -> Result<Self, DocumentError> {
        let Some(node) = self.root().get(INCLUDE) else { return Ok(self) };
        let mut base: Option<Self> = None;
        for (place, path) in named(&node)? {
            let path = self.folder().join(path);
            let included = reading.read(&place, &path)?;
            base = Some(match base {
                None => included,
                Some(before) => included.over(before),
            });
        }
        self.remove(INCLUDE);
        Ok(match base {
            None => self,
            Some(base) => self.over(base),
        })
    }

    /// This document laid over another one. It keeps its name and its text.
    fn over(mut self, included: Self) -> Self {
        let mut merged = included.value;
        let mut replaced = Vec::new();
        let own = std::mem::replace(&mut self.value, Value::Boolean(false));
        merge(&mut merged, own, "", &mut replaced);
        self.value = merged;
        self.places = self.places.over(included.places, &replaced);
        self.inputs.extend(included.inputs);
        self
    }
}

/// The paths that the key names, each with its place: a string, or an array of strings.
fn named<'a>(node: &Node<'a>) -> Result<Vec<(Node<'a>, String)>, DocumentError> {
    if let Value::String(path) = node.value() {
        return Ok(vec![(node.clone(), path.clone())]);
    }
    let Value::Array(items) = node.value() else {
        return Err(node.error("a path is needed, such as \"base.toml\", or an array of paths"));
    };
    let paths = (0..items.len()).filter_map(|k| node.get(&k.to_string()));
    paths.map(|item| Ok((item.clone(), item.parse()?))).collect()
}

impl Reading {
    /// Reads an included document, which the place names.
    fn read(&mut self, place: &Node<'_>, path: &Path) -> Result<Document, DocumentError> {
        let (file, way) = (canonical(path), &self.way);
        if let Some(first) = way.iter().position(|f| *f == file) {
            let circle = way[first..].iter().chain([&file]).map(|f| f.display().to_string());
            let circle = circle.collect::<Vec<_>>().join(" includes ");
            return Err(place.error(format!("a file includes itself: {circle}")));
        }
        self.count += 1;
        if self.count > MOST {
            return Err(
                place.error(format!("more than {MOST} files are included; join some of them"))
            );
        }
        let name = path.display().to_string();
        // an error prints a line of the file, which may be no business of whoever reads it
        if [path, &file].into_iter().any(|path| path.extension().is_none_or(|e| e != "toml")) {
            return Err(place.error(format!("{name} is not included: its name must end in .toml")));
        }
        let text = read_text(path, self.left).map_err(|error| {
            place.error(format!(
                "{name} cannot be read: {error}; the path is relative to the file that includes it"
            ))
        })?;
        self.left = self.left.saturating_sub(text.len() as u64);
        self.way.push(file);
        let mut document = Document::parse(name, text)?.resolved(self)?;
        self.way.pop();
        document.inputs.push(Arc::new(Held::new(path)));
        Ok(document)
    }
}

/// The file as the system knows it, so that two spellings of a path are one file.
fn canonical(path: &Path) -> PathBuf {
    std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned())
}

/// Lays a value over another; `replaced` receives the paths whose whole value was replaced.
fn merge(below: &mut Value, above: Value, path: &str, replaced: &mut Vec<String>) {
    match (below, above) {
        (Value::Table(below), Value::Table(above)) => merge_tables(below, above, path, replaced),
        (below, above) => {
            *below = above;
            replaced.push(path.to_owned());
        }
    }
}

fn merge_tables(below: &mut Table, above: Table, path: &str, replaced: &mut Vec<String>) {
    for (key, value) in above {
        let path = join(path, &key);
        match below.get_mut(&key) {
            Some(before) => merge(before, value, &path, replaced),
            None => {
                below.insert(key, value);
            }
        }
    }
}
