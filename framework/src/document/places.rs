//! The place of each key of a document.

use crate::document::location::{Excerpt, Location};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;
use toml::de::{DeTable, DeValue};

/// A text and the name of its file.
#[derive(Debug)]
struct Source {
    name: String,
    text: String,
}

/// Where a key was given.
#[derive(Clone, Debug)]
enum Given {
    /// In a text, by its index: the bytes of the key and of its value.
    Text { source: usize, key: Range<usize>, value: Range<usize> },
    /// On the command line.
    Set { path: String },
}

/// The place of a key, and its order among its siblings.
#[derive(Clone, Debug)]
struct Place {
    given: Given,
    order: usize,
}

/// The part of an entry that a location means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The key.
    Key,
    /// The value, or the key of a value of several lines.
    Value,
}

/// The places of all keys, by path.
#[derive(Clone, Debug)]
pub struct Places {
    /// The texts: first those that are included, last the document's own.
    sources: Vec<Arc<Source>>,
    places: BTreeMap<String, Place>,
}

/// `key` below `path`, quoted where TOML needs it.
pub fn join(path: &str, key: &str) -> String {
    let key = super::quote::key(key);
    if path.is_empty() { key } else { format!("{path}.{key}") }
}

impl Places {
    /// The places of all keys in a text, of which `root` is the parsed form.
    pub fn of(file: &str, text: &str, root: &DeTable<'_>) -> Self {
        let mut places = BTreeMap::new();
        let mut add = |path: String, key: Range<usize>, value: Range<usize>| {
            let order = key.start;
            places.insert(path, Place { given: Given::Text { source: 0, key, value }, order });
        };
        table("", root, &mut add);
        let source = Source { name: file.to_owned(), text: text.to_owned() };
        Self { sources: vec![Arc::new(source)], places }
    }

    /// The location of a path, or of the nearest table around it.
    pub fn location(&self, path: &str, part: Part) -> Location {
        let Some((nearest, place)) = self.nearest(path) else {
            let name = self.sources.last().map_or_else(String::new, |s| s.name.clone());
            return Location::File { name, line: 1, excerpt: None };
        };
        match &place.given {
            Given::Set { path } => Location::Set { path: path.clone() },
            Given::Text { source, key, value } => {
                let Source { name, text } = &*self.sources[*source];
                let on_key = Excerpt::of(text, key.clone());
                let own = nearest == path && part == Part::Value;
                // the span of a table with a heading is that of its heading
                let heading = value.contains(&key.start);
                let one_line = text.get(value.clone()).is_some_and(|v| !v.contains('\n'));
                let one_line = one_line && !heading;
                let excerpt =
                    if own && one_line { Excerpt::of(text, value.clone()) } else { on_key.clone() };
                let (name, line) = (name.clone(), on_key.line);
                Location::File { name, line, excerpt: Some(Box::new(excerpt)) }
            }
        }
    }

    /// The order of a key: keys sorted by it are in the order of the text.
    pub fn order(&self, path: &str) -> usize {
        self.places.get(path).map_or(usize::MAX, |p| p.order)
    }

    fn nearest<'p>(&self, path: &'p str) -> Option<(&'p str, &Place)> {
        // the path itself, then its tables from the innermost to the outermost
        let ends = std::iter::once(path.len()).chain(path.rmatch_indices('.').map(|(dot, _)| dot));
        let mut paths = ends.filter_map(|end| path.get(..end));
        paths.find_map(|path| self.places.get(path).map(|place| (path, place)))
    }

    /// Records that the command line set `path`, and that `outermost` is the outermost table it
    /// created. The key keeps its order; the places below it are removed.
    pub fn set(&mut self, outermost: &str, path: &str) {
        let order = self.order(outermost);
        self.forget_below(outermost);
        let given = Given::Set { path: path.to_owned() };
        self.places.insert(outermost.to_owned(), Place { given, order });
    }

    /// Records that the key at a path has the path `to` from now on.
    pub fn rename(&mut self, path: &str, to: &str) {
        let below = format!("{path}.");
        let moved: Vec<String> =
            self.places.keys().filter(|p| *p == path || p.starts_with(&below)).cloned().collect();
        for old in moved {
            if let Some(place) = self.places.remove(&old) {
                self.places.insert(format!("{to}{}", &old[path.len()..]), place);
            }
        }
    }

    fn forget_below(&mut self, path: &str) {
        let below = format!("{path}.");
        self.places.retain(|p, _| !p.starts_with(&below));
    }

    /// Lays the places of a document over those of the one that it includes. A key that both have
    /// keeps its order and has its place in the document; of the keys in `replaced`, the document
    /// replaces the whole value.
    pub fn over(self, mut included: Self, replaced: &[String]) -> Self {
        for path in replaced {
            included.forget_below(path);
        }
        let first = included.sources.len();
        let later = included.places.values().map(|p| p.order + 1).max().unwrap_or(0);
        included.sources.extend(self.sources);
        for (path, mut place) in self.places {
            if let Given::Text { source, .. } = &mut place.given {
                *source += first;
            }
            let before = included.places.get(&path).map(|p| p.order);
            place.order = before.unwrap_or_else(|| place.order.saturating_add(later));
            included.places.insert(path, place);
        }
        included
    }
}

type Add<'a> = &'a mut dyn FnMut(String, Range<usize>, Range<usize>);

fn table(path: &str, table_of: &DeTable<'_>, add: Add<'_>) {
    for (key, inner) in table_of.iter() {
        let path = join(path, key.get_ref());
        add(path.clone(), key.span(), inner.span());
        value(&path, inner.get_ref(), add);
    }
}

fn value(path: &str, value_of: &DeValue<'_>, add: Add<'_>) {
    match value_of {
        DeValue::Table(inner) => table(path, inner, add),
        DeValue::Array(items) => {
            for (index, item) in items.iter().enumerate() {
                let path = join(path, &index.to_string());
                add(path.clone(), item.span(), item.span());
                value(&path, item.get_ref(), add);
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;

    /// Places of `a.b`, `a.c` and `d`.
    fn places() -> Places {
        let text = "a = { b = 1, c = 2 }\nd = 3";
        Places::of("s.toml", text, DeTable::parse(text).unwrap().get_ref())
    }

    fn shown(places: &Places, path: &str) -> String {
        places.location(path, Part::Key).to_string()
    }

    #[test]
    fn a_table_that_is_set_replaces_the_places_below_it() {
        let mut places = places();
        places.set("a", "a");
        assert_eq!(
            ["a", "a.b", "d"].map(|p| shown(&places, p)),
            ["--set a", "--set a", "s.toml:2"]
        );
    }

    #[test]
    fn a_table_that_the_document_replaces_has_no_place_in_the_included_one() {
        let text = "a = { e = 1 }";
        let over = Places::of("own.toml", text, DeTable::parse(text).unwrap().get_ref());
        let places = over.over(places(), &["a".to_owned()]);
        assert_eq!(["a.b", "d"].map(|p| shown(&places, p)), ["own.toml:1", "s.toml:2"]);
    }
}
