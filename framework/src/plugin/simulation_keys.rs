//! Keys by which a type of sensor extends the table `simulation`.

use crate::compose::keys::SIMULATION;
use serde_json::Value;

/// Names of the keys that the `simulation` of a type's own schema has; none if it has no such key.
pub(super) fn own(schema: &Value) -> Vec<String> {
    let pointer = |path: &str| schema.pointer(path);
    let Some(mut table) = pointer(&format!("/properties/{SIMULATION}")) else { return Vec::new() };
    // `Option<T>` is a choice between `T` and null
    if let Some(choices) = table.get("anyOf").and_then(Value::as_array) {
        table = choices.first().unwrap_or(table);
    }
    if let Some(path) = table.get("$ref").and_then(Value::as_str) {
        table = path.strip_prefix('#').and_then(pointer).unwrap_or(table);
    }
    let keys = table.get("properties").and_then(Value::as_object);
    keys.map_or_else(Vec::new, |keys| keys.keys().cloned().collect())
}
