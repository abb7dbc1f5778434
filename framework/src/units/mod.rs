//! Physical quantities as on a data sheet, checked by dimension: `"0.01 deg/h"`, `"10 ug/sqrt(Hz)"`, `"2 cm/s"`.
//!
//! A [`Quantity`] is an `f64` in SI whose dimension is its type, so that a scenario which gives an angle where an angular
//! rate is needed is refused where it is read. It prints as it is written, and what it prints reads back to the bit.

mod config;
mod dimension;
pub mod sample;
#[cfg(test)]
mod tests;
pub mod time;
mod unit;

pub use config::{Components, Positive, Sigma, Triple};
pub use unit::{Exponents, Unit, column_suffix, parse_unit};

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Error, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

/// A physical quantity in SI. The parameters are the exponents of length, mass, time, angle and temperature in halves:
/// a speed is `Quantity<2, 0, -2, 0, 0>`, and m/sqrt(s) is `Quantity<2, 0, -1, 0, 0>`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantity<const L: i8, const M: i8, const T: i8, const A: i8, const K: i8>(f64);

/// A number without unit: a scale, a fraction. In TOML `0.002`, `"0.2 %"` or `"200 ppm"`.
pub type Ratio = Quantity<0, 0, 0, 0, 0>;
/// An angle, rad.
pub type Angle = Quantity<0, 0, 0, 2, 0>;
/// An angular rate, rad/s.
pub type AngularRate = Quantity<0, 0, -2, 2, 0>;
/// Root spectral density of an angular rate, rad/s/sqrt(Hz) = rad/sqrt(s): the angle random walk of a gyro, or of an
/// angle that is a state.
pub type AngularRateNoise = Quantity<0, 0, -1, 2, 0>;
/// How a gyro's bias random-walks, rad/s/sqrt(s).
pub type AngularRateRandomWalk = Quantity<0, 0, -3, 2, 0>;
/// An angular acceleration, rad/s^2.
pub type AngularAcceleration = Quantity<0, 0, -4, 2, 0>;
/// A length, m.
pub type Length = Quantity<2, 0, 0, 0, 0>;
/// How a length random-walks, m/sqrt(s).
pub type LengthRandomWalk = Quantity<2, 0, -1, 0, 0>;
/// A speed, m/s.
pub type Speed = Quantity<2, 0, -2, 0, 0>;
/// An acceleration, m/s^2.
pub type Acceleration = Quantity<2, 0, -4, 0, 0>;
/// Root spectral density of an acceleration, m/s^2/sqrt(Hz): the velocity random walk of an accelerometer.
pub type AccelerationNoise = Quantity<2, 0, -3, 0, 0>;
/// How an accelerometer's bias random-walks, m/s^2/sqrt(s).
pub type AccelerationRandomWalk = Quantity<2, 0, -5, 0, 0>;
/// A time, s.
pub type Time = Quantity<0, 0, 2, 0, 0>;
/// A frequency, Hz.
pub type Frequency = Quantity<0, 0, -2, 0, 0>;
/// A pressure, Pa.
pub type Pressure = Quantity<-2, 2, -4, 0, 0>;
/// A density, kg/m^3.
pub type Density = Quantity<-6, 2, 0, 0, 0>;
/// A difference of temperature, K.
pub type Temperature = Quantity<0, 0, 0, 0, 2>;
/// How a time random-walks, s/sqrt(s).
pub type TimeRandomWalk = Quantity<0, 0, 1, 0, 0>;
/// How a ratio random-walks, 1/sqrt(s).
pub type RatioRandomWalk = Quantity<0, 0, -1, 0, 0>;

/// Why a text is not a quantity of the dimension that is needed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UnitError {
    /// A bare number where there must be a unit.
    #[error("{dimension} needs a unit, e.g. \"{example}\"")]
    Missing {
        /// What is needed, with its article.
        dimension: String,
        /// A value of that dimension.
        example: String,
    },
    /// No such unit.
    #[error("unknown unit '{unit}'{}", .remedy.as_ref().map_or_else(String::new, |r| format!("; {r}")))]
    Unknown {
        /// The unit as found.
        unit: String,
        /// The nearest unit, or the usual ones.
        remedy: Option<String>,
    },
    /// A unit of another dimension.
    #[error("found '{unit}' which is {found}, {needed} is needed, e.g. {examples}")]
    Dimension {
        /// The unit as found.
        unit: String,
        /// Its dimension.
        found: String,
        /// The dimension that is needed.
        needed: String,
        /// Some units of that.
        examples: String,
    },
    /// The expression of units cannot be read.
    #[error("cannot read the unit '{unit}': {reason}")]
    Expression {
        /// The expression as found.
        unit: String,
        /// What is wrong.
        reason: String,
    },
    /// What comes first is no number.
    #[error(
        "found \"{text}\", which does not start with a number; {needed} is needed, e.g. \"{example}\""
    )]
    Number {
        /// The text as found.
        text: String,
        /// The dimension that is needed.
        needed: String,
        /// A value of that dimension.
        example: String,
    },
    /// Not a number, infinite, or too large for an `f64`.
    #[error("found \"{text}\", a finite number is needed")]
    NotFinite {
        /// The text as found.
        text: String,
    },
}

/// Splits "<number> <unit>"; none where it does not start with a decimal number.
fn split_number(text: &str) -> Option<(f64, &str)> {
    let digits = |s: &str| s.len() - s.trim_start_matches(|c: char| c.is_ascii_digit()).len();
    let mut end = usize::from(text.starts_with(['+', '-']));
    end += digits(&text[end..]);
    if text[end..].starts_with('.') {
        end += 1 + digits(&text[end + 1..]);
    }
    if let Some(exponent) = text[end..].strip_prefix(['e', 'E']) {
        let sign = usize::from(exponent.starts_with(['+', '-']));
        let count = digits(&exponent[sign..]);
        // without digits it is the start of a unit
        end += if count > 0 { 1 + sign + count } else { 0 };
    }
    let (number, unit) = text.split_at(end);
    // a decimal comma, a second point or digit groups
    if unit.starts_with([',', '.', '_']) || unit.starts_with(|c: char| c.is_ascii_digit()) {
        return None;
    }
    Some((number.parse().ok()?, unit.trim()))
}

impl<const L: i8, const M: i8, const T: i8, const A: i8, const K: i8> Quantity<L, M, T, A, K> {
    const EXPONENTS: Exponents = [L, M, T, A, K];
    const RATIO: bool = matches!(Self::EXPONENTS, [0, 0, 0, 0, 0]);

    /// The value in SI.
    pub const fn si(self) -> f64 {
        self.0
    }

    /// The quantity of that value in SI.
    pub const fn from_si(si: f64) -> Self {
        Self(si)
    }

    fn finite(si: f64, text: impl fmt::Display) -> Result<Self, UnitError> {
        if si.is_finite() {
            Ok(Self(si))
        } else {
            Err(UnitError::NotFinite { text: text.to_string() })
        }
    }

    fn missing_unit() -> UnitError {
        let (dimension, example) =
            (dimension::name(Self::EXPONENTS), dimension::example(Self::EXPONENTS));
        UnitError::Missing { dimension, example }
    }
}

impl<const L: i8, const M: i8, const T: i8, const A: i8, const K: i8> FromStr
    for Quantity<L, M, T, A, K>
{
    type Err = UnitError;

    fn from_str(text: &str) -> Result<Self, UnitError> {
        let text = text.trim();
        let Some((number, unit)) = split_number(text) else {
            let word = text.trim_start_matches(['+', '-']).to_ascii_lowercase();
            if ["nan", "inf"].iter().any(|n| word.starts_with(n)) {
                return Err(UnitError::NotFinite { text: text.to_owned() });
            }
            let (needed, example) =
                (dimension::name(Self::EXPONENTS), dimension::example(Self::EXPONENTS));
            return Err(UnitError::Number { text: text.to_owned(), needed, example });
        };
        if unit.is_empty() {
            return if Self::RATIO {
                Self::finite(number, text)
            } else {
                Err(Self::missing_unit())
            };
        }
        let parsed = parse_unit(unit).map_err(|e| match e {
            UnitError::Unknown { unit, remedy: None } => {
                let (name, usual) =
                    (dimension::name(Self::EXPONENTS), dimension::usual_units(Self::EXPONENTS));
                UnitError::Unknown { unit, remedy: Some(format!("{name} is needed, e.g. {usual}")) }
            }
            other => other,
        })?;
        if parsed.exponents() != Self::EXPONENTS {
            return Err(UnitError::Dimension {
                unit: unit.to_owned(),
                found: parsed.dimension(),
                needed: dimension::name(Self::EXPONENTS),
                examples: dimension::usual_units(Self::EXPONENTS),
            });
        }
        Self::finite(parsed.to_si(number), text)
    }
}

impl<const L: i8, const M: i8, const T: i8, const A: i8, const K: i8> fmt::Display
    for Quantity<L, M, T, A, K>
{
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&dimension::print(self.0, Self::EXPONENTS))
    }
}

impl<const L: i8, const M: i8, const T: i8, const A: i8, const K: i8> Serialize
    for Quantity<L, M, T, A, K>
{
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if !self.0.is_finite() {
            return Err(serde::ser::Error::custom(format!("{self} is not finite")));
        }
        let text = self.to_string();
        match text.parse() {
            Ok(number) if Self::RATIO => serializer.serialize_f64(number),
            _ => serializer.serialize_str(&text),
        }
    }
}

impl<'de, const L: i8, const M: i8, const T: i8, const A: i8, const K: i8> Deserialize<'de>
    for Quantity<L, M, T, A, K>
{
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Written)
    }
}

/// Reads a quantity as it is written: a text with a unit, or for a ratio a number.
struct Written<const L: i8, const M: i8, const T: i8, const A: i8, const K: i8>;

impl<const L: i8, const M: i8, const T: i8, const A: i8, const K: i8> Visitor<'_>
    for Written<L, M, T, A, K>
{
    type Value = Quantity<L, M, T, A, K>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let exponents = Self::Value::EXPONENTS;
        write!(f, "{}, e.g. \"{}\"", dimension::name(exponents), dimension::example(exponents))
    }
    fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
        text.parse().map_err(E::custom)
    }
    fn visit_f64<E: Error>(self, number: f64) -> Result<Self::Value, E> {
        if Self::Value::RATIO {
            Self::Value::finite(number, number).map_err(E::custom)
        } else {
            Err(E::custom(Self::Value::missing_unit()))
        }
    }
    fn visit_i64<E: Error>(self, number: i64) -> Result<Self::Value, E> {
        self.visit_f64(number as f64)
    }
    fn visit_u64<E: Error>(self, number: u64) -> Result<Self::Value, E> {
        self.visit_f64(number as f64)
    }
}

impl<const L: i8, const M: i8, const T: i8, const A: i8, const K: i8> JsonSchema
    for Quantity<L, M, T, A, K>
{
    fn schema_name() -> Cow<'static, str> {
        dimension::title(Self::EXPONENTS).replace(' ', "_").into()
    }
    fn inline_schema() -> bool {
        true
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let (example, title) =
            (dimension::example(Self::EXPONENTS), dimension::title(Self::EXPONENTS));
        let usual = dimension::usual_units(Self::EXPONENTS);
        // a field's own documentation replaces the description; the title stays
        if Self::RATIO {
            let description = format!("{title} as a number or text: {usual}");
            json_schema!({ "type": ["number", "string"], "title": title, "description": description, "examples": [example] })
        } else {
            let description = format!("{title} with its unit: {usual}");
            json_schema!({ "type": "string", "title": title, "description": description, "examples": [example] })
        }
    }
}
