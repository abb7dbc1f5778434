//! A quantity whose dimension the program learns from another part of the scenario.

use crate::units::dimension::{self, Exponents};
use crate::units::error::UnitError;
use crate::units::quantity::split_number;
use crate::units::unit::parse_unit;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Error, Visitor};
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

/// A quantity of any dimension, such as the size of a fault, whose channel decides the dimension.
///
/// ```
/// use navfuse_core::units::{AnyQuantity, parse_unit};
/// let (speed, length) = (parse_unit("m/s")?.exponents(), parse_unit("m")?.exponents());
/// let size: AnyQuantity = "3 cm/s".parse()?;
/// assert_eq!(size.si_as(speed), Ok(0.03));
/// assert!(size.si_as(length).is_err());
/// # Ok::<(), navfuse_core::units::UnitError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct AnyQuantity {
    si: f64,
    unit: String,
    exponents: Exponents,
}

impl AnyQuantity {
    /// The value in SI, whatever its dimension.
    pub const fn si(&self) -> f64 {
        self.si
    }

    /// Exponents of the dimension; `None` for a zero without unit, which has every dimension.
    pub fn dimension(&self) -> Option<Exponents> {
        (self.si != 0.0 || !self.unit.is_empty()).then_some(self.exponents)
    }

    /// The value in SI if it has the dimension needed.
    ///
    /// # Errors
    /// When it has another dimension.
    pub fn si_as(&self, needed: Exponents) -> Result<f64, UnitError> {
        if self.dimension().is_none_or(|found| found == needed) {
            return Ok(self.si);
        }
        if self.unit.is_empty() {
            let (dimension, example) = (dimension::name(needed), dimension::example(needed));
            return Err(UnitError::Missing { dimension, example });
        }
        Err(UnitError::Dimension {
            unit: self.unit.clone(),
            found: dimension::name(self.exponents),
            needed: dimension::name(needed),
            examples: dimension::usual_units(needed),
        })
    }

    fn number(si: f64) -> Result<Self, UnitError> {
        let (unit, exponents) = (String::new(), Exponents::default());
        Self { si, unit, exponents }.finite(si)
    }

    fn finite(self, text: impl fmt::Display) -> Result<Self, UnitError> {
        if self.si.is_finite() {
            Ok(self)
        } else {
            Err(UnitError::NotFinite { text: text.to_string() })
        }
    }
}

impl FromStr for AnyQuantity {
    type Err = UnitError;

    fn from_str(text: &str) -> Result<Self, UnitError> {
        let text = text.trim();
        let (number, unit) = split_number(text).ok_or_else(|| UnitError::Number {
            text: text.to_owned(),
            needed: "a number with a unit".to_owned(),
            example: "3 cm/s".to_owned(),
        })?;
        if unit.is_empty() {
            return Self::number(number);
        }
        let parsed = parse_unit(unit)?;
        let (si, exponents) = (parsed.to_si(number), parsed.exponents());
        Self { si, unit: unit.to_owned(), exponents }.finite(text)
    }
}

impl<'de> Deserialize<'de> for AnyQuantity {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Written)
    }
}

/// Reads a quantity from TOML: a text with a unit, or a number.
struct Written;

impl Visitor<'_> for Written {
    type Value = AnyQuantity;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number with a unit, e.g. \"3 cm/s\"")
    }
    fn visit_str<E: Error>(self, text: &str) -> Result<AnyQuantity, E> {
        text.parse().map_err(E::custom)
    }
    fn visit_f64<E: Error>(self, number: f64) -> Result<AnyQuantity, E> {
        AnyQuantity::number(number).map_err(E::custom)
    }
    fn visit_i64<E: Error>(self, number: i64) -> Result<AnyQuantity, E> {
        self.visit_f64(number as f64)
    }
    fn visit_u64<E: Error>(self, number: u64) -> Result<AnyQuantity, E> {
        self.visit_f64(number as f64)
    }
}

impl JsonSchema for AnyQuantity {
    fn schema_name() -> Cow<'static, str> {
        "any_quantity".into()
    }
    fn inline_schema() -> bool {
        true
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": ["string", "number"], "title": "quantity",
            "description": "quantity with its unit", "examples": ["3 cm/s"]
        })
    }
}
