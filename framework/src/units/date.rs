//! A date as the parameter of a scenario.

use crate::calendar;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Error;
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::str::FromStr;

/// A date, in TOML `"2022-06-01"` or `"2022-06-01T08:30:00Z"`.
///
/// ```
/// use navfuse_core::units::Date;
/// let date: Date = "2022-06-01T08:30:00Z".parse()?;
/// assert_eq!(date.nanos, 1_654_072_200_000_000_000);
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Date {
    /// Nanoseconds since 1970.
    pub nanos: i64,
    /// Set if a time of the day was given.
    pub has_time: bool,
}

impl FromStr for Date {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match calendar::parse(text) {
            Some((nanos, has_time)) => Ok(Self { nanos, has_time }),
            None => Err(format!(
                "{text:?} is no date after 1970; write \"2022-06-01\" or \
                 \"2022-06-01T08:30:00Z\" on the clock of the instrument"
            )),
        }
    }
}

impl<'de> Deserialize<'de> for Date {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(D::Error::custom)
    }
}

impl JsonSchema for Date {
    fn schema_name() -> Cow<'static, str> {
        "Date".into()
    }
    fn inline_schema() -> bool {
        true
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "examples": ["2022-06-01T08:30:00Z"] })
    }
}
