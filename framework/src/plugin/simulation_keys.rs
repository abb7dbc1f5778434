//! Keys by which a type of sensor extends the table `simulation`.

use crate::compose::keys::SIMULATION;
use serde::de::value::Error;
use serde::de::{DeserializeOwned, Deserializer, Error as _, Visitor};
use serde_json::Value;

/// Returns `true` unless a type names its keys, and none of them is the table `simulation`. It costs
/// nothing, where the schema of a type costs as much as thousands of samples.
pub(super) fn may_extend<T: DeserializeOwned>() -> bool {
    let mut fields = None;
    T::deserialize(Fields(&mut fields)).ok();
    fields.is_none_or(|fields: &[&str]| fields.contains(&SIMULATION))
}

/// Notes the names of the fields of a struct, and gives no value.
struct Fields<'a>(&'a mut Option<&'static [&'static str]>);

impl<'de> Deserializer<'de> for Fields<'_> {
    type Error = Error;

    fn deserialize_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Error> {
        Err(Error::custom(""))
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        _: V,
    ) -> Result<V::Value, Error> {
        *self.0 = Some(fields);
        Err(Error::custom(""))
    }

    serde::forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit
        unit_struct newtype_struct seq tuple tuple_struct map enum identifier ignored_any
    }
}

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

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Deserialize)]
    #[expect(dead_code, reason = "only the names count")]
    struct With {
        noise: f64,
        simulation: Option<f64>,
    }

    #[derive(Deserialize)]
    #[expect(dead_code, reason = "only the names count")]
    struct Without {
        noise: f64,
    }

    #[derive(Deserialize)]
    #[expect(dead_code, reason = "only the names count")]
    struct Flat {
        #[serde(flatten)]
        rest: With,
    }

    #[test]
    fn a_type_whose_keys_are_known_extends_the_table_only_if_it_names_it() {
        assert!(may_extend::<With>() && !may_extend::<Without>());
        // keys that only the schema shows
        assert!(may_extend::<Flat>() && may_extend::<f64>());
    }
}
