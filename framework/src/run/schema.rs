//! The JSON Schema of scenarios, and the parameters of types as rows to print.

use crate::compose::keys::{ENABLED, SIMULATION, SensorKeys, TYPE, WANDER};
use crate::compose::settings::EstimatorConfig;
use crate::plugin::{Entry, Kind, Registry};
use crate::run::rules::Rules;
use schemars::{JsonSchema, SchemaGenerator};
use serde_json::{Map, Value, json};

/// The JSON Schema (draft 2020-12) of a scenario with the registered types.
pub fn scenario_schema(registry: &Registry) -> Value {
    let mut definitions = Map::new();
    let rules = Rules::of(registry).names();
    let mut estimator = inline::<EstimatorConfig>(&mut definitions);
    estimator["properties"][UPDATE]["enum"] = json!(rules);
    let mut properties = json!({
        "include": {
            "type": ["string", "array"],
            "items": { "type": "string" },
            "description": "Scenarios over which this one is laid: a path from its folder, or \
                            several, of which a later one is laid over an earlier one",
        },
        "name": { "type": "string", "description": "Name of the scenario. Default: the file's" },
        "description": { "type": "string", "description": "What the scenario shows" },
        "seed": {
            "type": "integer",
            "minimum": 0,
            "description": "Seed of every random number. Default: 1",
        },
        "estimator": estimator,
    });
    for kind in Kind::ALL {
        let mut tables = Map::new();
        let mut names = Vec::new();
        for entry in registry.entries().filter(|e| e.kind == kind) {
            let mut own = entry_schema(entry, &mut definitions);
            if let Some(update) = own["properties"].get_mut(UPDATE) {
                update["enum"] = json!(rules);
            }
            let key = format!("{}.{}", kind.table(), entry.name);
            definitions.insert(key.clone(), own);
            tables.insert(entry.name.to_string(), json!({ "$ref": format!("#/$defs/{key}") }));
            names.push(&*entry.name);
        }
        // a table with another name has the key `type`
        let choices: Vec<Value> = (names.iter())
            .map(|n| {
                json!({ "if": { "properties": { "type": { "const": n } }, "required": ["type"] },
                        "then": { "$ref": format!("#/$defs/{}.{n}", kind.table()) } })
            })
            .collect();
        let other = json!({
            "type": "object",
            "required": ["type"],
            "properties": { "type": { "enum": names } },
            "allOf": choices,
        });
        properties[kind.table()] =
            json!({ "type": "object", "properties": tables, "additionalProperties": other });
    }
    let mut definitions = Value::Object(definitions);
    let mut patterns = Vec::new();
    share_patterns(&mut properties, &mut patterns);
    share_patterns(&mut definitions, &mut patterns);
    for (k, pattern) in patterns.into_iter().enumerate() {
        definitions[format!("{PATTERN}{k}")] = json!({ "pattern": pattern });
    }
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "navfuse scenario",
        "type": "object",
        "additionalProperties": false,
        "properties": properties,
        "$defs": definitions,
    })
}

/// Key of a sensor's update rule, and of that of all sensors.
const UPDATE: &str = "update";

/// Begin of the names of the patterns that quantities of the same dimension share.
const PATTERN: &str = "pattern.";

/// Replaces every pattern in a schema by a reference to its place in `patterns`.
fn share_patterns(schema: &mut Value, patterns: &mut Vec<String>) {
    match schema {
        Value::Object(map) => {
            if let Some(Value::String(pattern)) = map.get("pattern").cloned() {
                let k = patterns.iter().position(|p| *p == pattern).unwrap_or_else(|| {
                    patterns.push(pattern);
                    patterns.len() - 1
                });
                map.remove("pattern");
                map.insert("$ref".to_owned(), json!(format!("#/$defs/{PATTERN}{k}")));
            }
            map.values_mut().for_each(|inner| share_patterns(inner, patterns));
        }
        Value::Array(items) => items.iter_mut().for_each(|item| share_patterns(item, patterns)),
        _ => {}
    }
}

/// Moves the definitions of a root schema to `definitions` and returns the rest. Where plugins have
/// different types of one name, the later one gets a number.
fn lift(mut schema: Value, definitions: &mut Map<String, Value>) -> Value {
    let object = schema.as_object_mut().map(|object| (object.remove("$schema"), object));
    let Some(Value::Object(mut own)) = object.and_then(|(_, object)| object.remove("$defs")) else {
        return schema;
    };
    let differs = |(name, value): &(&String, &Value)| {
        definitions.get(*name).is_some_and(|known| known != *value)
    };
    while let Some((name, value)) = own.iter().find(differs).map(|(n, v)| (n.clone(), v.clone())) {
        let (mut free, mut number) = (name.clone(), 1);
        while own.contains_key(&free) || definitions.get(&free).is_some_and(|known| *known != value)
        {
            number += 1;
            free = format!("{name}{number}");
        }
        own.remove(&name);
        own.insert(free.clone(), value);
        let [from, to] = [name, free].map(|name| format!("#/$defs/{name}"));
        own.values_mut().chain([&mut schema]).for_each(|value| refer(value, &from, &to));
    }
    definitions.extend(own);
    schema
}

/// Replaces the references to a definition.
fn refer(schema: &mut Value, from: &str, to: &str) {
    match schema {
        Value::Object(map) => {
            if map.get("$ref").is_some_and(|name| name == from) {
                map.insert("$ref".to_owned(), to.into());
            }
            map.values_mut().for_each(|inner| refer(inner, from, to));
        }
        Value::Array(items) => items.iter_mut().for_each(|item| refer(item, from, to)),
        _ => {}
    }
}

fn inline<T: JsonSchema>(definitions: &mut Map<String, Value>) -> Value {
    lift(SchemaGenerator::default().into_root_schema_for::<T>().to_value(), definitions)
}

/// The schema of a type's table: its own parameters and the common keys.
fn entry_schema(entry: &Entry, definitions: &mut Map<String, Value>) -> Value {
    let mut own = lift(entry.schema.clone().to_value(), definitions);
    let mut common = Map::new();
    common.insert(
        TYPE.into(),
        json!({
            "const": &*entry.name,
            "description": "The type, where the table's name is another",
        }),
    );
    common.insert(
        ENABLED.into(),
        json!({ "type": "boolean", "description": "false leaves it out. Default: true" }),
    );
    if entry.kind == Kind::Process {
        let about = "Simulation only: the truth moves by the equations and the noise of the process, \
                     and not with the trajectory. Default: false";
        common.insert(WANDER.into(), json!({ "type": "boolean", "description": about }));
    }
    if entry.kind == Kind::Sensor
        && let Value::Object(policy) = inline::<SensorKeys>(definitions)
        && let Some(Value::Object(keys)) = policy.get("properties")
    {
        common.extend(keys.clone());
        if let Some(extension) = own.pointer("/properties/simulation") {
            let whole = extended(&common[SIMULATION], extension, definitions);
            common.insert(SIMULATION.to_owned(), whole);
        }
    }
    if let Some(properties) = own.get_mut("properties").and_then(Value::as_object_mut) {
        properties.extend(common);
    } else {
        own["properties"] = Value::Object(common);
    }
    own
}

/// The schema of the table `simulation` with the keys of the framework and those of a type.
fn extended(common: &Value, own: &Value, definitions: &Map<String, Value>) -> Value {
    let mut whole = resolve(common, definitions).clone();
    let own = resolve(own, definitions);
    let keys = |schema: &Value| schema.get("properties").and_then(Value::as_object).cloned();
    let required = |schema: &Value| schema.get("required").and_then(Value::as_array).cloned();
    let mut properties = keys(&whole).unwrap_or_default();
    properties.extend(keys(own).unwrap_or_default());
    whole["properties"] = Value::Object(properties);
    let all = [required(&whole), required(own)].map(Option::unwrap_or_default).concat();
    whole["required"] = Value::Array(all);
    if let Some(text) = common.get("description") {
        whole["description"] = text.clone();
    }
    whole
}

/// One parameter of a type.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// Its key in TOML.
    pub key: String,
    /// Values that it accepts: a quantity with example units, a choice, a number.
    pub takes: String,
    /// Its default; empty for a key that is required.
    pub default: String,
    /// Its meaning.
    pub meaning: String,
}

/// The parameters of a registered type, its own first. The keys of an inner table follow it as
/// `table.key`, the keys of tables by name as `table.NAME.key`, the keys of the tables of an array as
/// `array.N.key`, and the kinds of these tables as `array: kind`.
pub fn parameters(entry: &Entry) -> Vec<Parameter> {
    let mut definitions = Map::new();
    let own: Vec<String> = (entry.schema.as_value().get("properties").and_then(Value::as_object))
        .map_or_else(Vec::new, |p| p.keys().cloned().collect());
    let mut schema = entry_schema(entry, &mut definitions);
    if let Some(properties) = schema.get_mut("properties").and_then(Value::as_object_mut) {
        let (own, common) = std::mem::take(properties)
            .into_iter()
            .partition::<Map<_, _>, _>(|(k, _)| own.contains(k));
        properties.extend(own);
        properties.extend(common);
    }
    let mut rows = Vec::new();
    inner_parameters("", &schema, &definitions, &mut rows);
    rows
}

/// The parameters of a table's schema, each key after `prefix`.
fn inner_parameters(
    prefix: &str,
    schema: &Value,
    definitions: &Map<String, Value>,
    rows: &mut Vec<Parameter>,
) {
    let required: Vec<&str> = (schema.get("required").and_then(Value::as_array))
        .map_or_else(Vec::new, |r| r.iter().filter_map(Value::as_str).collect());
    let Some(properties) = schema.get("properties").and_then(Value::as_object) else { return };
    // tables by name of one type in one table have their keys once
    let mut named: Vec<(&Value, String)> = Vec::new();
    for (name, value) in properties {
        let default = match value.get("default") {
            Some(Value::String(s)) => s.clone(),
            Some(v) if !v.is_object() && !v.is_null() => v.to_string(),
            _ if required.contains(&name.as_str()) => "(required)".to_owned(),
            _ => "-".to_owned(),
        };
        let key = format!("{prefix}{name}");
        let resolved = table_of(value, definitions);
        rows.push(Parameter {
            key: key.clone(),
            takes: takes(value, definitions, 0),
            default,
            meaning: meaning(value),
        });
        if calibration(value).is_none() {
            inner_parameters(&format!("{key}."), resolved, definitions, rows);
        }
        let tables = resolved.get("additionalProperties").filter(|s| s.is_object());
        let tables = tables.map(|s| (s, table_of(s, definitions)));
        if let Some((tables, table)) = tables.filter(|(_, t)| t.get("properties").is_some()) {
            let key = format!("{key}.NAME");
            match named.iter().find(|(known, _)| *known == tables) {
                Some((_, first)) => rows.push(Parameter {
                    meaning: format!("The keys of `{first}`."),
                    takes: takes(tables, definitions, 0),
                    default: "-".to_owned(),
                    key,
                }),
                None => {
                    let prefix = format!("{key}.");
                    inner_parameters(&prefix, table, definitions, rows);
                    named.push((tables, key));
                }
            }
        }
        let items = resolved.get("items").map(|i| resolve(i, definitions));
        if let Some(items) = items.filter(|i| i.get("properties").is_some()) {
            inner_parameters(&format!("{key}.N."), items, definitions, rows);
        }
        let kinds = items.and_then(|i| i.get("oneOf"));
        for kind in kinds.and_then(Value::as_array).into_iter().flatten() {
            let name =
                kind.pointer("/properties/type/const").and_then(Value::as_str).unwrap_or_default();
            let keys = kind.get("properties").and_then(Value::as_object);
            let keys: Vec<&str> = keys
                .into_iter()
                .flatten()
                .map(|(k, _)| k.as_str())
                .filter(|k| *k != "type")
                .collect();
            let (key, takes, default) = (format!("{key}: {name}"), keys.join(", "), String::new());
            rows.push(Parameter { key, takes, default, meaning: meaning(kind) });
        }
    }
}

/// The table among the values that a schema accepts, as where a text may stand for a table; else the schema.
fn table_of<'a>(schema: &'a Value, definitions: &'a Map<String, Value>) -> &'a Value {
    let schema = resolve(schema, definitions);
    let choices = schema.get("anyOf").and_then(Value::as_array).into_iter().flatten();
    let mut choices = choices.map(|choice| resolve(choice, definitions));
    choices.find(|choice| choice.get("properties").is_some()).unwrap_or(schema)
}

fn meaning(schema: &Value) -> String {
    schema.get("description").and_then(Value::as_str).unwrap_or_default().replace('\n', " ")
}

/// The schema behind a reference, or the part of a choice that is not null.
fn resolve<'a>(schema: &'a Value, definitions: &'a Map<String, Value>) -> &'a Value {
    if let Some(name) = referenced(schema) {
        return definitions.get(&name).map_or(schema, |s| resolve(s, definitions));
    }
    let choices = schema.get("anyOf").and_then(Value::as_array);
    let mut choices =
        choices.into_iter().flatten().filter(|c| c.get("type").is_none_or(|t| t != "null"));
    match (choices.next(), choices.next()) {
        (Some(only), None) => resolve(only, definitions),
        _ => schema,
    }
}

/// The name of the schema of a calibration, which may be optional; none for another schema.
fn calibration(schema: &Value) -> Option<String> {
    let choices = schema.get("anyOf").and_then(Value::as_array).into_iter().flatten();
    let name = std::iter::once(schema).chain(choices).find_map(referenced)?;
    name.starts_with("Calibration_").then_some(name)
}

/// The name of the definition to which a schema refers. The name of a quantity without one of its own is its
/// unit, such as `A/m^2`, which a reference escapes (RFC 6901, RFC 3986).
fn referenced(schema: &Value) -> Option<String> {
    let name = schema.get("$ref")?.as_str()?.rsplit('/').next()?;
    Some(name.replace("%5E", "^").replace("~1", "/").replace("~0", "~"))
}

/// The values that a schema accepts, in words.
fn takes(schema: &Value, definitions: &Map<String, Value>, depth: usize) -> String {
    if depth > 4 {
        return String::new();
    }
    let inner = |s: &Value| takes(s, definitions, depth + 1);
    if let Some(name) = calibration(schema) {
        let value = definitions.get(&name).and_then(|d| d.pointer("/anyOf/0"));
        return format!("calibration, {}", value.map_or_else(String::new, inner));
    }
    if let Some(name) = referenced(schema) {
        return definitions.get(&name).map_or(name, inner);
    }
    if let Some(constant) = schema.get("const") {
        return constant.to_string();
    }
    if let Some(values) = schema.get("enum").and_then(Value::as_array) {
        return values.iter().map(Value::to_string).collect::<Vec<_>>().join(" | ");
    }
    if let Some(example) = schema.get("examples").and_then(Value::as_array).and_then(|e| e.first())
    {
        return format!("e.g. {example}");
    }
    for key in ["anyOf", "oneOf"] {
        if let Some(choices) = schema.get(key).and_then(Value::as_array) {
            let mut words: Vec<String> =
                choices.iter().map(inner).filter(|w| !w.is_empty() && w != "null").collect();
            words.dedup();
            return words.join(" | ");
        }
    }
    if schema.get("properties").is_some() {
        return "table".to_owned();
    }
    match schema.get("type") {
        Some(Value::String(t)) if t == "array" => {
            schema.get("items").map_or_else(|| t.clone(), |i| format!("[{}]", inner(i)))
        }
        Some(Value::String(t)) if t == "object" => "table".to_owned(),
        Some(Value::String(t)) => t.clone(),
        Some(Value::Array(ts)) => ts
            .iter()
            .filter_map(Value::as_str)
            .filter(|t| *t != "null")
            .collect::<Vec<_>>()
            .join(" | "),
        _ => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_keys_of_tables_by_name_follow_their_table_once() {
        let schema = json!({
            "$defs": {
                "Calibration_x": { "anyOf": [{ "type": "string" }, { "properties": { "sigma": {} } }] },
                "Topic": { "properties": { "field": { "type": "string", "description": "Where." } } },
                "Named": { "anyOf": [{ "type": "string" }, { "$ref": "#/$defs/Topic" }] },
            },
            "properties": {
                "sensors": { "type": "object", "additionalProperties": { "$ref": "#/$defs/Topic" } },
                "more": { "type": "object", "additionalProperties": { "$ref": "#/$defs/Topic" } },
                "columns": { "type": "object", "additionalProperties": { "$ref": "#/$defs/Named" } },
                "only": { "type": "object", "additionalProperties": { "type": "number" } },
                "bias": { "anyOf": [{ "$ref": "#/$defs/Calibration_x" }, { "type": "null" }] },
            },
            "additionalProperties": false,
        });
        let mut definitions = Map::new();
        let lifted = lift(schema, &mut definitions);
        let mut rows = Vec::new();
        inner_parameters("", &lifted, &definitions, &mut rows);
        let keys: Vec<&str> = rows.iter().map(|row| row.key.as_str()).collect();
        let expected = ["sensors", "sensors.NAME.field", "more", "more.NAME", "columns"];
        assert_eq!(keys, [&expected[..], &["columns.NAME.field", "only", "bias"]].concat());
        assert_eq!(rows[3].meaning, "The keys of `sensors.NAME`.");
    }

    /// Two plugins may have a type `Format`, each within a type `Files`.
    #[test]
    fn types_of_one_name_have_a_definition_each_and_the_same_type_has_one() {
        let schema = |format: &str| {
            json!({
                "$defs": {
                    "Format": { "const": format },
                    "Files": { "items": { "$ref": "#/$defs/Format" } },
                },
                "$ref": "#/$defs/Files",
            })
        };
        let mut definitions = Map::new();
        for format in ["a", "b", "a", "b"] {
            let lifted = lift(schema(format), &mut definitions);
            let files = resolve(&lifted, &definitions);
            let found = resolve(&files["items"], &definitions);
            assert_eq!(found, &json!({ "const": format }), "{definitions:?}");
        }
        assert_eq!(definitions.len(), 4, "{definitions:?}");
    }
}
