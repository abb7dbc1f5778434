//! The place of each key of a document.

use crate::document::location::Location;
use std::collections::BTreeMap;
use std::ops::Range;
use toml::de::{DeTable, DeValue};

/// The location of a key, and its order among its siblings.
#[derive(Clone, Debug)]
struct Place {
    location: Location,
    order: usize,
}

/// The places of all keys, by path.
#[derive(Clone, Debug)]
pub struct Places {
    places: BTreeMap<String, Place>,
    whole: Location,
}

/// `key` below `path`, quoted where TOML needs it.
pub fn join(path: &str, key: &str) -> String {
    let bare =
        !key.is_empty() && key.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '_' | '-'));
    let key = if bare { key.to_owned() } else { format!("{key:?}") };
    if path.is_empty() { key } else { format!("{path}.{key}") }
}

/// Line and column of a byte offset, both counted from 1.
pub fn position(text: &str, offset: usize) -> (usize, usize) {
    let before = text.get(..offset).unwrap_or(text);
    let line = before.rsplit('\n').next().unwrap_or_default();
    (before.matches('\n').count() + 1, line.chars().count() + 1)
}

impl Places {
    /// The places of all keys in a text, of which `root` is the parsed form.
    pub fn of(file: &str, text: &str, root: &DeTable<'_>) -> Self {
        let line_starts: Vec<usize> = text.match_indices('\n').map(|(end, _)| end + 1).collect();
        let at = |line| Location::File { name: file.to_owned(), line };
        let mut places = BTreeMap::new();
        let mut add = |path: String, span: Range<usize>| {
            let line = line_starts.partition_point(|start| *start <= span.start) + 1;
            places.insert(path, Place { location: at(line), order: span.start });
        };
        table("", root, &mut add);
        Self { places, whole: at(1) }
    }

    /// The location of a path, or of the nearest table around it.
    pub fn location(&self, path: &str) -> &Location {
        self.nearest(path).map_or(&self.whole, |p| &p.location)
    }

    /// The order of a key: keys sorted by it are in the order of the text.
    pub fn order(&self, path: &str) -> usize {
        self.places.get(path).map_or(usize::MAX, |p| p.order)
    }

    fn nearest(&self, path: &str) -> Option<&Place> {
        // the path itself, then its tables from the innermost to the outermost
        let ends = std::iter::once(path.len()).chain(path.rmatch_indices('.').map(|(dot, _)| dot));
        ends.filter_map(|end| self.places.get(path.get(..end)?)).next()
    }

    /// Records that the command line set `path`, and that `outermost` is the outermost table it
    /// created. The key keeps its order; the places below it are removed.
    pub fn set(&mut self, outermost: &str, path: &str) {
        let order = self.order(outermost);
        let below = format!("{outermost}.");
        self.places.retain(|p, _| !p.starts_with(&below));
        let location = Location::Set { path: path.to_owned() };
        self.places.insert(outermost.to_owned(), Place { location, order });
    }
}

fn table(path: &str, table_of: &DeTable<'_>, add: &mut impl FnMut(String, Range<usize>)) {
    for (key, inner) in table_of.iter() {
        let path = join(path, key.get_ref());
        add(path.clone(), key.span());
        value(&path, inner.get_ref(), add);
    }
}

fn value(path: &str, value_of: &DeValue<'_>, add: &mut impl FnMut(String, Range<usize>)) {
    match value_of {
        DeValue::Table(inner) => table(path, inner, add),
        DeValue::Array(items) => {
            for (index, item) in items.iter().enumerate() {
                let path = join(path, &index.to_string());
                add(path.clone(), item.span());
                value(&path, item.get_ref(), add);
            }
        }
        _ => {}
    }
}
