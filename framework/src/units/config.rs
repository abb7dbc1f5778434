//! Values for three axes, and values whose sign is checked.

use crate::units::quantity::Quantity;
use nalgebra::Vector3;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{DeserializeOwned, Error, IntoDeserializer, SeqAccess, Visitor};
use serde::ser::SerializeSeq;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;

/// A configured value of one or three components.
///
/// ```
/// use navfuse_core::units::{Components, Length, Triple};
/// assert_eq!(Length::from_si(2.0).components(), [2.0]);
/// assert_eq!(Triple::new([Length::from_si(1.0); 3]).components(), [1.0; 3]);
/// ```
pub trait Components:
    Copy + fmt::Debug + fmt::Display + Serialize + DeserializeOwned + JsonSchema
{
    /// The components in SI.
    fn components(&self) -> Vec<f64>;
}

impl<const L: i8, const M: i8, const T: i8, const A: i8, const K: i8, const I: i8> Components
    for Quantity<L, M, T, A, K, I>
{
    fn components(&self) -> Vec<f64> {
        vec![self.si()]
    }
}

impl<Q: Components> Components for Triple<Q> {
    fn components(&self) -> Vec<f64> {
        self.0.iter().flat_map(Components::components).collect()
    }
}

/// A quantity for each of three axes: in TOML one value for all of them, or an array of three.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triple<Q>([Q; 3]);

impl<Q> Triple<Q> {
    /// The values of the axes x, y, z.
    pub const fn new(axes: [Q; 3]) -> Self {
        Self(axes)
    }
}

impl<const L: i8, const M: i8, const T: i8, const A: i8, const K: i8, const I: i8>
    Triple<Quantity<L, M, T, A, K, I>>
{
    /// The three values in SI.
    pub fn si(&self) -> Vector3<f64> {
        Vector3::from(self.0.map(Quantity::si))
    }
}

impl<Q: fmt::Display> fmt::Display for Triple<Q> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = &self.0;
        write!(f, "[{x}, {y}, {z}]")
    }
}

impl<Q: Components> Serialize for Triple<Q> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let [x, y, z] = self.components()[..] else {
            return Err(serde::ser::Error::custom("three components"));
        };
        if x.to_bits() == y.to_bits() && y.to_bits() == z.to_bits() {
            return self.0[0].serialize(serializer);
        }
        let mut seq = serializer.serialize_seq(Some(3))?;
        self.0.iter().try_for_each(|axis| seq.serialize_element(axis))?;
        seq.end()
    }
}

impl<'de, Q: Components> Deserialize<'de> for Triple<Q> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(OneOrThree(PhantomData))
    }
}

struct OneOrThree<Q>(PhantomData<Q>);

impl<'de, Q: Components> Visitor<'de> for OneOrThree<Q> {
    type Value = Triple<Q>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("one value for all three axes, or an array of three")
    }
    fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
        Ok(Triple([Q::deserialize(text.into_deserializer())?; 3]))
    }
    fn visit_f64<E: Error>(self, number: f64) -> Result<Self::Value, E> {
        Ok(Triple([Q::deserialize(number.into_deserializer())?; 3]))
    }
    fn visit_i64<E: Error>(self, number: i64) -> Result<Self::Value, E> {
        self.visit_f64(number as f64)
    }
    fn visit_u64<E: Error>(self, number: u64) -> Result<Self::Value, E> {
        self.visit_f64(number as f64)
    }
    fn visit_seq<S: SeqAccess<'de>>(self, mut seq: S) -> Result<Self::Value, S::Error> {
        let mut axes = Vec::with_capacity(3);
        while let Some(axis) = seq.next_element::<Q>()? {
            axes.push(axis);
        }
        let found = axes.len();
        let axes = axes.try_into().map_err(|_| {
            let needed = "one value for all three axes or an array of three is needed";
            Error::custom(format!("found an array of {found}; {needed}"))
        })?;
        Ok(Triple(axes))
    }
}

impl<Q: JsonSchema> JsonSchema for Triple<Q> {
    fn schema_name() -> Cow<'static, str> {
        format!("Triple_{}", Q::schema_name()).into()
    }
    fn inline_schema() -> bool {
        true
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        one_or_three(generator.subschema_for::<Q>())
    }
}

/// JSON schema of one value or an array of three.
fn one_or_three(mut axis: Schema) -> Schema {
    let taken = ["title", "examples"].map(|key| axis.remove(key));
    let mut schema = json_schema!({
        "anyOf": [axis, { "type": "array", "items": axis, "minItems": 3, "maxItems": 3 }],
        "description": "one value for all three axes, or an array of three",
    });
    for (key, value) in ["title", "examples"].into_iter().zip(taken) {
        schema.insert(key.to_owned(), value.unwrap_or_default());
    }
    schema
}

/// Adds a bound at zero to a JSON schema, whose example may be negative.
fn bounded(mut schema: Schema, bound: &str) -> Schema {
    schema.insert(bound.to_owned(), 0.into());
    if let Some(examples) = schema.get_mut("examples").and_then(|e| e.as_array_mut()) {
        for example in examples {
            if let Some(text) = example.as_str() {
                *example = text.trim_start_matches('-').to_owned().into();
            }
        }
    }
    schema
}

/// Defines a wrapper that rejects a value of the wrong sign where it is read.
macro_rules! checked {
    ($(#[$doc:meta])* $name:ident, $refused:expr, $message:literal, $bound:literal) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $name<V>(V);

        impl<V: Copy> $name<V> {
            /// The value.
            pub const fn value(&self) -> V {
                self.0
            }
        }

        impl<const L: i8, const M: i8, const T: i8, const A: i8, const K: i8, const I: i8>
            $name<Quantity<L, M, T, A, K, I>>
        {
            /// A value in SI from the program, such as a default; its sign is not checked.
            pub const fn from_si(si: f64) -> Self {
                Self(Quantity::from_si(si))
            }
            /// The value in SI.
            pub const fn si(&self) -> f64 {
                self.0.si()
            }
        }

        impl<const L: i8, const M: i8, const T: i8, const A: i8, const K: i8, const I: i8>
            $name<Triple<Quantity<L, M, T, A, K, I>>>
        {
            /// The same value in SI for each axis, from the program; its sign is not checked.
            pub const fn each(si: f64) -> Self {
                Self(Triple::new([Quantity::from_si(si); 3]))
            }
            /// The three values in SI.
            pub fn si(&self) -> Vector3<f64> {
                self.0.si()
            }
        }

        impl<V: Serialize> Serialize for $name<V> {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                self.0.serialize(serializer)
            }
        }

        impl<'de, V: Components> Deserialize<'de> for $name<V> {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let value = V::deserialize(deserializer)?;
                if value.components().into_iter().any($refused) {
                    return Err(Error::custom(format!($message, value)));
                }
                Ok(Self(value))
            }
        }

        impl<V: JsonSchema> JsonSchema for $name<V> {
            fn schema_name() -> Cow<'static, str> {
                format!("{}_{}", stringify!($name), V::schema_name()).into()
            }
            fn inline_schema() -> bool {
                true
            }
            fn json_schema(generator: &mut SchemaGenerator) -> Schema {
                bounded(V::json_schema(generator), $bound)
            }
        }
    };
}

checked! {
    /// A standard deviation or another magnitude; a negative one is rejected.
    Sigma, |c| c < 0.0, "a sigma cannot be negative: {}", "minimum"
}
checked! {
    /// A value that may be zero.
    NonNegative, |c| c < 0.0, "a negative value is not possible: {}", "minimum"
}
checked! {
    /// A value that must be greater than zero.
    Positive, |c| c <= 0.0, "a value greater than zero is needed: {}", "exclusiveMinimum"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Length;

    /// One value stands for three equal ones, to the bit.
    #[test]
    fn three_axes_are_written_as_one_value_where_all_are_equal() {
        let written = |axes: [f64; 3]| {
            let triple = Triple(axes.map(Length::from_si));
            serde_json::to_value(triple).map_or(0, |value| value.as_array().map_or(1, Vec::len))
        };
        assert_eq!(written([1.0, 1.0, 1.0]), 1);
        for axes in [[2.0, 1.0, 1.0], [1.0, 2.0, 1.0], [1.0, 1.0, 2.0]] {
            assert_eq!(written(axes), 3, "{axes:?}");
        }
    }
}
