//! Assignments written into the text of a scenario, whose comments stay.

use crate::DiagnoseError;
use toml_edit::{DocumentMut, InlineTable, Item, Key, Table, TableLike, Value};

/// Depth of the tables with a heading of their own: `[sensor.dvl]`.
const HEADED: usize = 2;

/// The text with the assignments `key.path=value`.
///
/// # Errors
/// When the text is not TOML, or a path leads through a value.
pub fn apply(text: &str, settings: &[String]) -> Result<String, DiagnoseError> {
    let mut document: DocumentMut = text.parse().map_err(DiagnoseError::Text)?;
    for setting in settings {
        let through = || DiagnoseError::Setting(setting.clone());
        let (path, value) = setting.split_once('=').ok_or_else(through)?;
        let mut keys = Key::parse(path).map_err(DiagnoseError::Text)?;
        let last = keys.pop().ok_or_else(through)?;
        let mut table: &mut dyn TableLike = document.as_table_mut();
        for (depth, key) in keys.iter().enumerate() {
            let inner = table.entry(key).or_insert_with(|| missing(depth));
            table = inner.as_table_like_mut().ok_or_else(through)?;
        }
        assign(table, &last, value.parse().unwrap_or_else(|_| value.into()));
    }
    Ok(document.to_string())
}

/// A table that the text does not have yet.
fn missing(depth: usize) -> Item {
    if depth >= HEADED {
        return Item::Value(InlineTable::new().into());
    }
    let mut table = Table::new();
    table.set_implicit(depth + 1 < HEADED);
    Item::Table(table)
}

/// Sets a value; a comment behind the one before stays.
fn assign(table: &mut dyn TableLike, key: &Key, mut value: Value) {
    if let Some(Item::Value(before)) = table.get(key) {
        *value.decor_mut() = before.decor().clone();
    }
    table.insert(key, Item::Value(value));
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;

    #[test]
    fn comments_stay_and_missing_tables_are_made() {
        let text = "# dive\n[sensor.dvl]\nnoise = \"1 cm/s\" # stated\nscale = { sigma = 0.1 }\n";
        let settings = [
            "sensor.dvl.noise=\"2 cm/s\"",
            "sensor.dvl.scale.sigma=20 %",
            "sensor.dvl.samples.factor.vel_x=-1.0",
            "sensor.depth.enabled=false",
        ];
        let written = apply(text, &settings.map(str::to_owned)).unwrap();
        let expected = "# dive\n[sensor.dvl]\nnoise = \"2 cm/s\" # stated\n\
                        scale = { sigma = \"20 %\" }\n\
                        samples = { factor = { vel_x = -1.0 } }\n\n[sensor.depth]\nenabled = false\n";
        assert_eq!(written, expected);
    }

    #[test]
    fn a_path_through_a_value_is_rejected() {
        let error = apply("seed = 1\n", &["seed.x=2".to_owned()]).unwrap_err();
        assert!(error.to_string().contains("seed.x=2"));
    }
}
