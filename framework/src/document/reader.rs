//! Reads a value of TOML into a type.
//!
//! The deserializer of the crate `toml` does not keep the key path of a mistake. A wrapper can add the
//! path, but it is compiled again for each type of each sensor and made up a fifth of a sensor's code.
//! This deserializer has one type, borrows the value, and lets each table on the way out add its key.

use crate::document::node::kind;
use serde::de::value::StrDeserializer;
use serde::de::{
    DeserializeSeed, Deserializer, EnumAccess, Error, Expected, IntoDeserializer, MapAccess,
    SeqAccess, Unexpected, VariantAccess, Visitor,
};
use std::fmt::{self, Display};
use toml::Value;
use toml::map::Iter;

/// A value that does not fit its type.
#[derive(Debug)]
pub struct Mistake {
    /// Message of serde or of the type.
    pub message: String,
    /// Keys from the value concerned outwards: the innermost key is the first.
    pub path: Vec<String>,
}

impl Mistake {
    fn below(mut self, key: impl Into<String>) -> Self {
        self.path.push(key.into());
        self
    }
}

impl Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Mistake {}

impl Error for Mistake {
    fn custom<T: Display>(message: T) -> Self {
        Self { message: message.to_string(), path: Vec::new() }
    }
}

/// A value to be read.
#[derive(Clone, Copy, Debug)]
pub struct Reader<'a>(pub &'a Value);

impl<'a> Deserializer<'a> for Reader<'a> {
    type Error = Mistake;

    fn deserialize_any<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Mistake> {
        match self.0 {
            Value::String(text) => visitor.visit_str(text),
            Value::Integer(number) => visitor.visit_i64(*number),
            Value::Float(number) => visitor.visit_f64(*number),
            Value::Boolean(flag) => visitor.visit_bool(*flag),
            Value::Datetime(_) => Err(Error::invalid_type(Unexpected::Other("date"), &visitor)),
            Value::Array(values) => {
                let mut elements = Elements { values, next: 0 };
                let read = visitor.visit_seq(&mut elements)?;
                all_read(
                    values.len(),
                    values.len() - elements.next,
                    &"fewer elements in the array",
                )?;
                Ok(read)
            }
            Value::Table(table) => {
                let mut entries = Entries { iter: table.iter(), entry: None };
                let read = visitor.visit_map(&mut entries)?;
                all_read(table.len(), entries.iter.len(), &"fewer keys in the table")?;
                Ok(read)
            }
        }
    }

    fn deserialize_option<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Mistake> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'a>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Mistake> {
        visitor.visit_newtype_struct(self)
    }

    /// A variant without content is a string, one with content a table of one key.
    fn deserialize_enum<V: Visitor<'a>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Mistake> {
        match self.0 {
            Value::String(name) => visitor.visit_enum(Variant { name, content: None }),
            Value::Table(table) => match (table.iter().next(), table.len()) {
                (Some((name, content)), 1) => {
                    visitor.visit_enum(Variant { name, content: Some(content) })
                }
                _ => Err(Error::invalid_length(table.len(), &"a table of one key")),
            },
            other => Err(Error::invalid_type(Unexpected::Other(kind(other)), &"a string")),
        }
    }

    serde::forward_to_deserialize_any! {
        <W: Visitor<'a>>
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit
        unit_struct seq tuple tuple_struct map struct identifier ignored_any
    }
}

/// Rejects a collection of which the type did not read everything.
fn all_read(found: usize, left: usize, expected: &dyn Expected) -> Result<(), Mistake> {
    if left == 0 { Ok(()) } else { Err(Error::invalid_length(found, expected)) }
}

/// Elements of an array.
struct Elements<'a> {
    values: &'a [Value],
    next: usize,
}

impl<'a> SeqAccess<'a> for Elements<'a> {
    type Error = Mistake;

    fn next_element_seed<S: DeserializeSeed<'a>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, Mistake> {
        let Some(value) = self.values.get(self.next) else {
            return Ok(None);
        };
        self.next += 1;
        match seed.deserialize(Reader(value)) {
            Ok(read) => Ok(Some(read)),
            Err(mistake) => Err(mistake.below((self.next - 1).to_string())),
        }
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.values.len() - self.next)
    }
}

/// Keys and values of a table.
struct Entries<'a> {
    iter: Iter<'a, String, Value>,
    /// The entry whose key has been read and whose value is next.
    entry: Option<(&'a str, &'a Value)>,
}

impl<'a> MapAccess<'a> for Entries<'a> {
    type Error = Mistake;

    fn next_key_seed<S: DeserializeSeed<'a>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, Mistake> {
        let Some((key, value)) = self.iter.next() else {
            return Ok(None);
        };
        self.entry = Some((key, value));
        let name: StrDeserializer<'_, Mistake> = key.as_str().into_deserializer();
        match seed.deserialize(name) {
            Ok(read) => Ok(Some(read)),
            Err(mistake) => Err(mistake.below(key)),
        }
    }

    fn next_value_seed<S: DeserializeSeed<'a>>(&mut self, seed: S) -> Result<S::Value, Mistake> {
        let Some((key, value)) = self.entry.take() else {
            return Err(Mistake::custom("a value was read before its key"));
        };
        match seed.deserialize(Reader(value)) {
            Ok(read) => Ok(read),
            Err(mistake) => Err(mistake.below(key)),
        }
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.iter.len())
    }
}

/// Variant of an enum, with its content unless it has none.
struct Variant<'a> {
    name: &'a str,
    content: Option<&'a Value>,
}

impl<'a> Variant<'a> {
    fn content(&self, expected: &dyn Expected) -> Result<Reader<'a>, Mistake> {
        match self.content {
            Some(value) => Ok(Reader(value)),
            None => Err(Error::invalid_type(Unexpected::UnitVariant, expected)),
        }
    }
}

impl<'a> EnumAccess<'a> for Variant<'a> {
    type Error = Mistake;
    type Variant = Self;

    fn variant_seed<S: DeserializeSeed<'a>>(
        self,
        seed: S,
    ) -> Result<(S::Value, Self::Variant), Mistake> {
        let name: StrDeserializer<'_, Mistake> = self.name.into_deserializer();
        Ok((seed.deserialize(name)?, self))
    }
}

impl<'a> VariantAccess<'a> for Variant<'a> {
    type Error = Mistake;

    fn unit_variant(self) -> Result<(), Mistake> {
        match self.content {
            None => Ok(()),
            Some(_) => {
                let mistake: Mistake = Error::invalid_type(Unexpected::Map, &"a name alone");
                Err(mistake.below(self.name))
            }
        }
    }

    fn newtype_variant_seed<S: DeserializeSeed<'a>>(self, seed: S) -> Result<S::Value, Mistake> {
        let reader = self.content(&"a table with the variant's content")?;
        seed.deserialize(reader).map_err(|mistake| mistake.below(self.name))
    }

    fn tuple_variant<V: Visitor<'a>>(self, _: usize, visitor: V) -> Result<V::Value, Mistake> {
        let read = self.content(&visitor)?.deserialize_any(visitor);
        read.map_err(|mistake| mistake.below(self.name))
    }

    fn struct_variant<V: Visitor<'a>>(
        self,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Mistake> {
        let read = self.content(&visitor)?.deserialize_any(visitor);
        read.map_err(|mistake| mistake.below(self.name))
    }
}
