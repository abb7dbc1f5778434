//! A physical quantity whose dimension is its type.

use crate::units::dimension::{self, Exponents};
use crate::units::error::UnitError;
use crate::units::pattern::pattern;
use crate::units::print::print;
use crate::units::unit::parse_unit;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{Error, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::json;
use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

/// Largest magnitude of a quantity in a scenario, in SI. The square of a prior of this size, 1e24, is
/// 1e8 times what 16 digits hold beside a variance of 1.
pub(super) const LARGEST: f64 = 1e12;

/// A physical quantity in SI. The parameters are the exponents of length, mass, time, angle,
/// temperature and, where there is one, current, counted in halves: a speed is `Quantity<2, 0, -2, 0, 0>`, and a quantity in
/// m/sqrt(s) is `Quantity<2, 0, -1, 0, 0>`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantity<
    const L: i8,
    const M: i8,
    const T: i8,
    const A: i8,
    const K: i8,
    const I: i8 = 0,
>(f64);

/// Splits `NUMBER UNIT`; `None` where the text does not start with a decimal number.
pub(super) fn split_number(text: &str) -> Option<(f64, &str)> {
    let digits = |s: &str| s.len() - s.trim_start_matches(|c: char| c.is_ascii_digit()).len();
    let mut end = usize::from(text.starts_with(['+', '-']));
    end += digits(&text[end..]);
    if text[end..].starts_with('.') {
        end += 1 + digits(&text[end + 1..]);
    }
    if let Some(exponent) = text[end..].strip_prefix(['e', 'E']) {
        let sign = usize::from(exponent.starts_with(['+', '-']));
        let count = digits(&exponent[sign..]);
        // an `e` without digits is the start of a unit
        end += if count > 0 { 1 + sign + count } else { 0 };
    }
    let (number, unit) = text.split_at(end);
    // rejects a decimal comma, a second point and digit groups
    if unit.starts_with([',', '.', '_']) || unit.starts_with(|c: char| c.is_ascii_digit()) {
        return None;
    }
    Some((number.parse().ok()?, unit.trim()))
}

impl<const L: i8, const M: i8, const T: i8, const A: i8, const K: i8, const I: i8>
    Quantity<L, M, T, A, K, I>
{
    const EXPONENTS: Exponents = [L, M, T, A, K, I];

    /// The value in SI.
    pub const fn si(self) -> f64 {
        self.0
    }

    /// The quantity of that value in SI.
    pub const fn from_si(si: f64) -> Self {
        Self(si)
    }
}

// A quantity is read, checked and described by functions of its exponents, which are compiled once and
// not again for each type in each crate.

/// Returns `true` for the exponents of a number without a unit.
fn ratio(exponents: Exponents) -> bool {
    exponents == [0; 6]
}

/// Value in SI, unless it is infinite or no number.
fn finite(si: f64, text: impl fmt::Display) -> Result<f64, UnitError> {
    if si.is_finite() { Ok(si) } else { Err(UnitError::NotFinite { text: text.to_string() }) }
}

/// Value in SI, unless it is too large to be meant: its square, and sums of such squares, have to be
/// numbers.
fn plausible(si: f64, exponents: Exponents) -> Result<f64, UnitError> {
    if si.abs() <= LARGEST {
        return Ok(si);
    }
    let limit = if ratio(exponents) {
        "1e12".to_owned()
    } else {
        format!("1e12 {}", dimension::si_unit(exponents))
    };
    Err(UnitError::TooLarge { text: print(si, exponents), limit })
}

/// Value in SI of a number without a unit.
fn bare(number: f64, text: impl fmt::Display, exponents: Exponents) -> Result<f64, UnitError> {
    if ratio(exponents) {
        finite(number, text)
    } else {
        let (dimension, example) = (dimension::name(exponents), dimension::example(exponents));
        Err(UnitError::Missing { dimension, example })
    }
}

/// Value in SI of `NUMBER UNIT`.
fn parse(text: &str, exponents: Exponents) -> Result<f64, UnitError> {
    let text = text.trim();
    let Some((number, unit)) = split_number(text) else {
        let word = text.trim_start_matches(['+', '-']).to_ascii_lowercase();
        if ["nan", "inf"].iter().any(|n| word.starts_with(n)) {
            return Err(UnitError::NotFinite { text: text.to_owned() });
        }
        let (needed, example) = (dimension::name(exponents), dimension::example(exponents));
        return Err(UnitError::Number { text: text.to_owned(), needed, example });
    };
    if unit.is_empty() {
        return bare(number, text, exponents);
    }
    let parsed = parse_unit(unit).map_err(|e| match e {
        UnitError::Unknown { unit, .. } => {
            let (name, usual) = (dimension::name(exponents), dimension::usual_units(exponents));
            UnitError::Unknown { unit, usual: Some(format!("{name} is needed, e.g. {usual}")) }
        }
        other => other,
    })?;
    if parsed.exponents() != exponents {
        return Err(UnitError::Dimension {
            unit: unit.to_owned(),
            found: parsed.dimension(),
            needed: dimension::name(exponents),
            examples: dimension::usual_units(exponents),
        });
    }
    finite(parsed.to_si(number), text)
}

/// JSON schema of a quantity. The doc comment of a field replaces the description; the title stays.
fn schema(exponents: Exponents) -> Schema {
    let (example, title) = (dimension::example(exponents), dimension::title(exponents));
    let usual = dimension::usual_units(exponents);
    let (kind, description) = if ratio(exponents) {
        (json!(["number", "string"]), format!("{title} as a number or text: {usual}"))
    } else {
        (json!("string"), format!("{title} with its unit: {usual}"))
    };
    json_schema!({
        "type": kind, "title": title, "pattern": pattern(exponents),
        "description": description, "examples": [example]
    })
}

impl<const L: i8, const M: i8, const T: i8, const A: i8, const K: i8, const I: i8> FromStr
    for Quantity<L, M, T, A, K, I>
{
    type Err = UnitError;

    fn from_str(text: &str) -> Result<Self, UnitError> {
        parse(text, Self::EXPONENTS).map(Self)
    }
}

impl<const L: i8, const M: i8, const T: i8, const A: i8, const K: i8, const I: i8> fmt::Display
    for Quantity<L, M, T, A, K, I>
{
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&print(self.0, Self::EXPONENTS))
    }
}

impl<const L: i8, const M: i8, const T: i8, const A: i8, const K: i8, const I: i8> Serialize
    for Quantity<L, M, T, A, K, I>
{
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if !self.0.is_finite() {
            return Err(serde::ser::Error::custom(format!("{self} is not finite")));
        }
        let text = self.to_string();
        match text.parse() {
            Ok(number) => serializer.serialize_f64(number),
            Err(_) => serializer.serialize_str(&text),
        }
    }
}

impl<'de, const L: i8, const M: i8, const T: i8, const A: i8, const K: i8, const I: i8>
    Deserialize<'de> for Quantity<L, M, T, A, K, I>
{
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Written)
    }
}

/// Reads a quantity from TOML: a text with a unit, or for a ratio also a number.
struct Written<const L: i8, const M: i8, const T: i8, const A: i8, const K: i8, const I: i8>;

impl<const L: i8, const M: i8, const T: i8, const A: i8, const K: i8, const I: i8> Visitor<'_>
    for Written<L, M, T, A, K, I>
{
    type Value = Quantity<L, M, T, A, K, I>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let exponents = Self::Value::EXPONENTS;
        write!(f, "{}, e.g. \"{}\"", dimension::name(exponents), dimension::example(exponents))
    }
    fn visit_str<E: Error>(self, text: &str) -> Result<Self::Value, E> {
        let exponents = Self::Value::EXPONENTS;
        let si = parse(text, exponents).and_then(|si| plausible(si, exponents));
        si.map(Quantity).map_err(E::custom)
    }
    fn visit_f64<E: Error>(self, number: f64) -> Result<Self::Value, E> {
        let exponents = Self::Value::EXPONENTS;
        let si = bare(number, number, exponents).and_then(|si| plausible(si, exponents));
        si.map(Quantity).map_err(E::custom)
    }
    fn visit_i64<E: Error>(self, number: i64) -> Result<Self::Value, E> {
        self.visit_f64(number as f64)
    }
    fn visit_u64<E: Error>(self, number: u64) -> Result<Self::Value, E> {
        self.visit_f64(number as f64)
    }
}

impl<const L: i8, const M: i8, const T: i8, const A: i8, const K: i8, const I: i8> JsonSchema
    for Quantity<L, M, T, A, K, I>
{
    fn schema_name() -> Cow<'static, str> {
        dimension::title(Self::EXPONENTS).replace(' ', "_").into()
    }
    fn inline_schema() -> bool {
        true
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        schema(Self::EXPONENTS)
    }
}
