//! Direction of a beam, and values that may differ from beam to beam.

use navfuse_core::nalgebra::Vector3;
use navfuse_core::units::Angle;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Error, IntoDeserializer, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::f64::consts::FRAC_PI_2;
use std::fmt;
use std::marker::PhantomData;

/// Scales a vector to length one, unless it is zero or not finite.
pub(crate) fn unit_vector(axes: [f64; 3]) -> Option<Vector3<f64>> {
    let v = Vector3::from(axes);
    // scaled by its largest component first, so that no square overflows or vanishes: [1e-200, 0,
    // 0] has a direction
    let unit = (v / v.amax()).normalize();
    unit.iter().all(|x| x.is_finite()).then_some(unit)
}

/// The direction in which a beam leaves the instrument: a unit vector in its axes forward, right,
/// down.
///
/// In TOML a vector of any length, `[1, 0, 1]`, or two angles,
/// `{ azimuth = "0 deg", elevation = "-45 deg" }`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beam(Vector3<f64>);

/// The form with angles, which provides the schema.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Angles {
    /// From forward towards right.
    azimuth: Angle,
    /// Above the plane of forward and right: negative for a beam to the ground, -90 deg straight
    /// down.
    elevation: Angle,
}

impl Beam {
    /// The direction, of length one.
    pub fn direction(&self) -> Vector3<f64> {
        self.0
    }

    fn from_vector<E: Error>(axes: [f64; 3]) -> Result<Self, E> {
        unit_vector(axes).map(Self).ok_or_else(|| {
            E::custom(format!(
                "{axes:?} has no direction; give three finite numbers that are not all zero"
            ))
        })
    }

    fn from_angles<E: Error>(angles: &Angles) -> Result<Self, E> {
        let (azimuth, elevation) = (angles.azimuth.si(), angles.elevation.si());
        // 90 deg in radians, rounded up
        if elevation.abs() > FRAC_PI_2 * (1.0 + f64::EPSILON) {
            return Err(E::custom(format!(
                "elevation = {} is outside of -90 to 90 deg",
                angles.elevation
            )));
        }
        let ((sin_a, cos_a), (sin_e, cos_e)) = (azimuth.sin_cos(), elevation.sin_cos());
        Ok(Self(Vector3::new(cos_e * cos_a, cos_e * sin_a, -sin_e)))
    }
}

impl<'de> Deserialize<'de> for Beam {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Written;
        impl<'de> Visitor<'de> for Written {
            type Value = Beam;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(
                    "the direction of a beam: [forward, right, down] or \
                     { azimuth = \"0 deg\", elevation = \"-45 deg\" }",
                )
            }
            fn visit_seq<S: SeqAccess<'de>>(self, seq: S) -> Result<Beam, S::Error> {
                let axes = Vec::<f64>::deserialize(SeqAccessDeserializer::new(seq))?;
                let axes: [f64; 3] = axes.try_into().map_err(|axes: Vec<f64>| {
                    S::Error::custom(format!(
                        "found {} numbers; a direction has three: [forward, right, down]",
                        axes.len()
                    ))
                })?;
                Beam::from_vector(axes)
            }
            fn visit_map<M: MapAccess<'de>>(self, map: M) -> Result<Beam, M::Error> {
                Beam::from_angles(&Angles::deserialize(MapAccessDeserializer::new(map))?)
            }
        }
        deserializer.deserialize_any(Written)
    }
}

impl JsonSchema for Beam {
    fn schema_name() -> Cow<'static, str> {
        "Beam".into()
    }
    fn inline_schema() -> bool {
        true
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let angles = Angles::json_schema(generator);
        json_schema!({
            "anyOf": [
                { "type": "array", "items": { "type": "number" }, "minItems": 3, "maxItems": 3 },
                angles,
            ],
            "description": "forward, right, down; or azimuth and elevation",
            "examples": [[1, 0, 1]],
        })
    }
}

/// A value for each beam: in TOML one for all beams, or an array.
#[derive(Clone, Debug, PartialEq)]
pub struct PerBeam<T>(Values<T>);

#[derive(Clone, Debug, PartialEq)]
enum Values<T> {
    All(T),
    Each(Vec<T>),
}

impl<T: Copy> PerBeam<T> {
    /// One value for all beams.
    pub const fn all(value: T) -> Self {
        Self(Values::All(value))
    }

    /// The values of `N` beams.
    ///
    /// # Errors
    /// The number of values found, where it differs from `N`.
    pub fn values<const N: usize>(&self) -> Result<[T; N], usize> {
        match &self.0 {
            Values::All(value) => Ok([*value; N]),
            Values::Each(values) => values.as_slice().try_into().map_err(|_| values.len()),
        }
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for PerBeam<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Written<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for Written<T> {
            type Value = PerBeam<T>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("one value for all beams, or an array with one per beam")
            }
            fn visit_str<E: Error>(self, text: &str) -> Result<PerBeam<T>, E> {
                Ok(PerBeam(Values::All(T::deserialize(text.into_deserializer())?)))
            }
            fn visit_f64<E: Error>(self, number: f64) -> Result<PerBeam<T>, E> {
                Ok(PerBeam(Values::All(T::deserialize(number.into_deserializer())?)))
            }
            fn visit_i64<E: Error>(self, number: i64) -> Result<PerBeam<T>, E> {
                self.visit_f64(number as f64)
            }
            fn visit_seq<S: SeqAccess<'de>>(self, seq: S) -> Result<PerBeam<T>, S::Error> {
                Ok(PerBeam(Values::Each(Vec::deserialize(SeqAccessDeserializer::new(seq))?)))
            }
        }
        deserializer.deserialize_any(Written(PhantomData))
    }
}

impl<T: JsonSchema> JsonSchema for PerBeam<T> {
    fn schema_name() -> Cow<'static, str> {
        format!("PerBeam_{}", T::schema_name()).into()
    }
    fn inline_schema() -> bool {
        true
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let value = generator.subschema_for::<T>();
        let each = json_schema!({ "type": "array", "items": value, "minItems": 1, "maxItems": 4 });
        json_schema!({
            "anyOf": [value, each],
            "description": "one value for all beams, or an array with one per beam",
        })
    }
}
