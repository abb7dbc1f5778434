//! Keys in which scenarios differ.

use navfuse_core::document::{Document, DocumentError, Node};
use serde::Serialize;

/// Keys that change no result, listed last.
const NAMES: [&str; 2] = ["name", "description"];

/// Key in which scenarios differ.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct KeyDifference {
    /// Path of the key, as `--set` takes it.
    pub key: String,
    /// Value of each scenario as TOML; none where the scenario does not have the key.
    pub values: Vec<Option<String>>,
}

/// Lists the keys in which scenarios differ, in the order of the first scenario that has the key.
///
/// A list of numbers or quantities is one value. Values are compared as text, so `"1 cm/s"` differs
/// from `"0.01 m/s"`.
///
/// # Errors
/// Returns an error if the document cannot be read as a table.
pub fn differences(scenarios: &[Document]) -> Result<Vec<KeyDifference>, DocumentError> {
    let mut keys: Vec<KeyDifference> = Vec::new();
    for (run, scenario) in scenarios.iter().enumerate() {
        let mut leaves = Vec::new();
        collect(&scenario.root(), &mut leaves)?;
        for (key, value) in leaves {
            let at = keys.iter().position(|k| k.key == key).unwrap_or_else(|| {
                keys.push(KeyDifference { key, values: vec![None; scenarios.len()] });
                keys.len() - 1
            });
            keys[at].values[run] = Some(value);
        }
    }
    keys.retain(|k| k.values.iter().any(|v| *v != k.values[0]));
    keys.sort_by_key(|k| NAMES.contains(&k.key.as_str()));
    Ok(keys)
}

/// Collects the values of a table, of its inner tables and of the tables in arrays.
fn collect(node: &Node<'_>, leaves: &mut Vec<(String, String)>) -> Result<(), DocumentError> {
    let value = node.value();
    let tables = value.as_array().is_some_and(|items| items.iter().any(|v| v.is_table()));
    if value.as_table().is_some_and(|table| !table.is_empty()) {
        for (_, inner) in node.entries()? {
            collect(&inner, leaves)?;
        }
    } else if tables {
        let mut index = 0_usize;
        while let Some(inner) = node.get(&index.to_string()) {
            collect(&inner, leaves)?;
            index += 1;
        }
    } else if !node.path().is_empty() {
        leaves.push((node.path().to_owned(), value.to_string()));
    }
    Ok(())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn differing_keys_have_the_paths_of_set_and_equal_ones_are_left_out() {
        let text = "name = \"a\"\nseed = 1\n[sensor.\"my dvl\"]\nnoise = \"1 cm/s\"\nscale = {}\n\
                    [[source.simulation.segments]]\nduration = \"1 s\"\n\
                    [[source.simulation.segments]]\nduration = \"2 s\"\naxes = [1, 2, 3]\n";
        let first = Document::parse("a.toml", text).unwrap();
        let mut second = first.clone();
        for change in [
            "name=b",
            "seed=2",
            "sensor.\"my dvl\".gate=0.9",
            "source.simulation.segments.1.axes=[1, 2, 4]",
        ] {
            second.set(change).unwrap();
        }
        let found = differences(&[first.clone(), second.clone(), first]).unwrap();
        let keys: Vec<&str> = found.iter().map(|k| k.key.as_str()).collect();
        let segment = "source.simulation.segments.1.axes";
        assert_eq!(keys, ["seed", segment, "sensor.\"my dvl\".gate", "name"]);
        let gate = [None, Some("0.9".to_owned()), None];
        assert_eq!(found[2].values, gate);
        assert_eq!(found[1].values[1].as_deref(), Some("[1, 2, 4]"));
        // each path is accepted by `--set`, and taking its value over removes the difference
        let mut third = second.clone();
        for key in &found {
            if let Some(value) = &key.values[0] {
                third.set(&format!("{}={value}", key.key)).unwrap();
            }
        }
        let left = differences(&[second, third]).unwrap();
        assert_eq!(left.len(), 3);
    }
}
