//! A scenario's text with some of its values changed, and everything else as a person wrote it:
//! comments, order and spacing.

use crate::error::{CommandError, Result};
use navfuse_core::document::Document;
use toml_edit::{DocumentMut, InlineTable, Item, Key, Table, Value};

/// The text of a document with the changes that [`Document::set`] made.
pub fn text(document: &Document) -> Result<String> {
    let mut edited: DocumentMut = document.text().parse().map_err(|e: toml_edit::TomlError| {
        CommandError::Request(format!("the scenario cannot be changed: {}", e.message()))
    })?;
    for assignment in document.overrides() {
        assign(edited.as_item_mut(), assignment).ok_or_else(|| {
            CommandError::argument(assignment, "the scenario's text cannot be changed there")
        })?;
    }
    Ok(edited.to_string())
}

/// Sets a value, as `key.path=value`. The document has accepted it before.
fn assign(root: &mut Item, assignment: &str) -> Option<()> {
    let (path, text) = assignment.split_once('=')?;
    let mut keys = Key::parse(path.trim()).ok()?;
    let last = keys.pop()?;
    let mut item = root;
    for key in &keys {
        item = inner(item, key.get())?;
    }
    let text = text.trim();
    let mut value: Value = text.parse().unwrap_or_else(|_| text.into());
    value.decor_mut().clear();
    match element(item, last.get()) {
        Some(old) => {
            if let Some(old) = old.as_value() {
                // the comment behind a value is in its decoration
                *value.decor_mut() = old.decor().clone();
            }
            *old = Item::Value(value);
        }
        None => insert(item, last.get(), Item::Value(value))?,
    }
    Some(())
}

/// The item at a key of a table, or at an index of an array.
fn element<'a>(item: &'a mut Item, key: &str) -> Option<&'a mut Item> {
    match key.parse::<usize>() {
        Ok(index) if item.is_array() || item.is_array_of_tables() => item.get_mut(index),
        _ => item.get_mut(key).filter(|item| !item.is_none()),
    }
}

/// As [`element`], and makes the table where there is none.
fn inner<'a>(item: &'a mut Item, key: &str) -> Option<&'a mut Item> {
    if element(item, key).is_none() {
        let table = if item.is_inline_table() {
            Item::Value(Value::InlineTable(InlineTable::new()))
        } else {
            Item::Table(Table::new())
        };
        insert(item, key, table)?;
    }
    element(item, key)
}

/// Adds a key to a table.
fn insert(item: &mut Item, key: &str, new: Item) -> Option<()> {
    item.as_table_like_mut()?.insert(key, new);
    if let Some(table) = item.as_inline_table_mut() {
        table.fmt();
    }
    Some(())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    const SCENARIO: &str = "\
# A dive of a person who writes comments.
name = \"dive\"   # its name

[sensor.dvl]                # the DVL
noise = \"1 cm/s\"            # from its data sheet
scale = { sigma = \"1 %\" }   # as delivered

[sensor.dvl.misalignment]   # from the drawing
sigma = \"1 deg\"             # of each angle

[[source.simulation.segments]]
duration = \"60 s\"           # at rest
# the end
";

    #[test]
    fn comments_and_spacing_stay_and_the_values_are_those_of_the_document() {
        let mut document = Document::parse("dive.toml", SCENARIO).unwrap();
        for assignment in [
            "sensor.dvl.noise=2 cm/s",
            "sensor.dvl.scale.initial=1.002",
            "sensor.dvl.misalignment.initial=['1 deg', '2 deg', '3 deg']",
            "sensor.dvl.misalignment.sigma=0.1 deg",
            "source.simulation.segments.0.duration=30 s",
            "sensor.\"a b\".gate=0.99",
            "seed=7",
        ] {
            document.set(assignment).unwrap();
        }
        let edited = text(&document).unwrap();
        let again = Document::parse("dive.toml", &*edited).unwrap();
        assert_eq!(again.root().value(), document.root().value(), "{edited}");
        let comments = |text: &str| -> Vec<String> {
            let comment = |line: &str| line.find('#').map(|at| line[at..].to_owned());
            text.lines().filter_map(comment).collect()
        };
        assert_eq!(comments(&edited), comments(SCENARIO), "{edited}");
        assert!(edited.contains("noise = \"2 cm/s\"            # from its data sheet"), "{edited}");
        assert!(
            edited.contains("{ sigma = \"1 %\", initial = 1.002 }   # as delivered"),
            "{edited}"
        );
    }
}
