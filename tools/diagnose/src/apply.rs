//! Assignments written into the text of a scenario, whose comments stay.

use crate::DiagnoseError;
use toml_edit::{
    Array, ArrayOfTables, DocumentMut, InlineTable, Item, Key, Table, TableLike, Value,
};

/// Depth of the tables with a heading of their own: `[sensor.dvl]`.
const HEADED: usize = 2;

/// A place in the text that holds others.
enum At<'a> {
    Table(&'a mut dyn TableLike),
    Array(&'a mut Array),
    /// `[[source.simulation.segments]]`
    Tables(&'a mut ArrayOfTables),
}

impl<'a> At<'a> {
    fn item(item: &'a mut Item) -> Option<Self> {
        match item {
            Item::Table(table) => Some(At::Table(table)),
            Item::ArrayOfTables(tables) => Some(At::Tables(tables)),
            Item::Value(value) => At::value(value),
            Item::None => None,
        }
    }

    fn value(value: &'a mut Value) -> Option<Self> {
        match value {
            Value::InlineTable(table) => Some(At::Table(table)),
            Value::Array(array) => Some(At::Array(array)),
            _ => None,
        }
    }

    /// The place under a key, or at an index. A missing table is made, and no missing array.
    fn inner(self, key: &Key, next: &Key, depth: usize) -> Option<Self> {
        match self {
            At::Table(table) if table.contains_key(key) || index(next).is_none() => {
                At::item(table.entry(key).or_insert_with(|| missing(depth)))
            }
            At::Table(_) => None,
            At::Array(array) => At::value(array.get_mut(index(key)?)?),
            At::Tables(tables) => Some(At::Table(tables.get_mut(index(key)?)?)),
        }
    }

    /// Sets a value; a comment behind the one before stays.
    fn assign(self, key: &Key, value: Value) -> Option<()> {
        match self {
            At::Table(table) => match (table.get_mut(key), value) {
                (Some(Item::Table(of)), Value::InlineTable(values)) => merge(of, values),
                // inserting over a key would drop the comment above it
                (Some(item), value) => *item = Item::Value(placed_as(item.as_value(), value)),
                (None, value) => {
                    table.insert(key, Item::Value(value));
                }
            },
            At::Array(array) => {
                let element = array.get_mut(index(key)?)?;
                *element = placed_as(Some(&*element), value);
            }
            At::Tables(_) => return None,
        }
        Some(())
    }
}

/// The text with the assignments `key.path=value`. A number in the path is the index of an element, as for
/// [`Document::set`](navfuse_core::document::Document::set).
///
/// # Errors
/// When the text is not TOML, or a path leads through a value or to an element that is not there.
pub fn apply(text: &str, settings: &[String]) -> Result<String, DiagnoseError> {
    let mut document: DocumentMut = text.parse().map_err(DiagnoseError::Text)?;
    for setting in settings {
        let through = || DiagnoseError::Setting(setting.clone());
        let (path, value) = setting.split_once('=').ok_or_else(through)?;
        let keys = Key::parse(path).map_err(DiagnoseError::Text)?;
        let (last, _) = keys.split_last().ok_or_else(through)?;
        let mut at = At::Table(document.as_table_mut());
        for (depth, pair) in keys.windows(2).enumerate() {
            at = at.inner(&pair[0], &pair[1], depth).ok_or_else(through)?;
        }
        let value = value.trim();
        at.assign(last, value.parse().unwrap_or_else(|_| value.into())).ok_or_else(through)?;
    }
    Ok(document.to_string())
}

/// Gives a table with a heading of its own the entries of another one. What stays keeps its comments.
fn merge(table: &mut Table, values: InlineTable) {
    table.retain(|key, _| values.contains_key(key));
    for (key, value) in values {
        let (key, value) = (Key::new(key), value);
        let _ = At::Table(&mut *table).assign(&key, value);
    }
}

/// The index of an element that a key is.
fn index(key: &Key) -> Option<usize> {
    key.get().parse().ok()
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

/// A value with the spaces and the comment of the one before.
fn placed_as(before: Option<&Value>, mut value: Value) -> Value {
    if let Some(before) = before {
        *value.decor_mut() = before.decor().clone();
    }
    value
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

    /// A table on one line takes the new keys on that line.
    #[test]
    fn a_table_on_one_line_gets_the_new_part() {
        let text = "sensor = { dvl = { noise = \"1 cm/s\" } }\n[process]\nins = {}\n";
        let settings = ["sensor.depth.enabled = false", "process.ins.bias.sigma = 1 deg/h"];
        let written = apply(text, &settings.map(str::to_owned)).unwrap();
        let expected = "sensor = { dvl = { noise = \"1 cm/s\" } , depth.enabled = false }\n\
                        [process]\nins = { bias = { sigma = \"1 deg/h\" } }\n";
        assert_eq!(written, expected);
    }

    /// As for `--set`, a number in the path is the index of an element.
    #[test]
    fn an_element_of_an_array_is_set() {
        let text = "[source.simulation]\nstops = [1, 2] # two\nlegs = [{ length = 1 }]\n\
                    [[sensor.dvl.simulation.faults]]\nsize = 1\n";
        let settings = [
            "source.simulation.stops.1=3",
            "source.simulation.legs.0.length=2",
            "sensor.dvl.simulation.faults.0.size=5 m",
        ];
        let written = apply(text, &settings.map(str::to_owned)).unwrap();
        let expected = "[source.simulation]\nstops = [1, 3] # two\nlegs = [{ length = 2 }]\n\
                        [[sensor.dvl.simulation.faults]]\nsize = \"5 m\"\n";
        assert_eq!(written, expected);
        for path in
            ["source.simulation.stops.2=3", "source.simulation.stops.x=3", "source.others.0.x=1"]
        {
            let error = apply(text, &[path.to_owned()]).unwrap_err();
            assert!(error.to_string().contains(path), "{error}");
        }
    }

    #[test]
    fn a_table_with_a_heading_keeps_it_and_its_comments() {
        let text = "# of the receiver\n[sensor.gnss.time_offset] # lag\n# of the data sheet\n\
                    sigma = \"50 ms\" # usual\nmode = \"fixed\"\n";
        let setting = "sensor.gnss.time_offset={ initial = \"1 s\", sigma = \"0.3 s\" }";
        let written = apply(text, &[setting.to_owned()]).unwrap();
        let expected = "# of the receiver\n[sensor.gnss.time_offset] # lag\n# of the data sheet\n\
                        sigma = \"0.3 s\" # usual\ninitial = \"1 s\"\n";
        assert_eq!(written, expected);
    }

    #[test]
    fn a_path_through_a_value_is_rejected() {
        let error = apply("seed = 1\n", &["seed.x=2".to_owned()]).unwrap_err();
        assert!(error.to_string().contains("seed.x=2"));
    }
}
