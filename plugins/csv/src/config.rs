//! The parameters of the source.

use navfuse_core::units::{Ratio, Time as Duration, Unit, parse_unit};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;
use std::path::PathBuf;

/// Reads recorded samples from CSV files, one file a sensor.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Csv {
    /// Folder of the files, absolute or from the scenario's folder. Default: the scenario's folder.
    #[serde(default)]
    pub directory: PathBuf,
    /// How a sensor's file is read, by the sensor's name. A sensor that is not here reads NAME.csv, if there is one.
    #[serde(default)]
    pub files: BTreeMap<String, FileConfig>,
}

/// How the file of one sensor is read.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FileConfig {
    /// The file, absolute or from the directory. Default: NAME.csv.
    pub path: Option<PathBuf>,
    /// The column of the time. Default: time_s, or time with another unit of time.
    pub time: Named<TimeColumn>,
    /// The columns of channels, by the channel's name. Default: the channel's name and a unit, such as vel_x_mps.
    pub columns: BTreeMap<String, Named<Column>>,
    /// What separates cells: a comma, semicolon, tab, bar or space.
    #[serde(deserialize_with = "delimiter")]
    pub delimiter: char,
    /// What to do with a row whose time is not later than that of the row before.
    pub disorder: Disorder,
    /// What to do with a cell that says that it is no number, such as nan or inf.
    pub nan: Nan,
}

impl Default for FileConfig {
    fn default() -> Self {
        Self {
            path: None,
            time: Named::default(),
            columns: BTreeMap::new(),
            delimiter: ',',
            disorder: Disorder::default(),
            nan: Nan::default(),
        }
    }
}

/// What to do with a row whose time is not later than that of the row before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Disorder {
    /// The run ends.
    #[default]
    Error,
    /// The row is left out, and counted in a warning.
    Skip,
}

/// What to do with a cell that says that it is no number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Nan {
    /// The run ends.
    #[default]
    Error,
    /// The channel is missing in that sample.
    Missing,
}

/// The column of a channel.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Column {
    /// Its heading. Default: the channel's name and a unit.
    pub column: Option<String>,
    /// Its unit. Default: what the heading ends with.
    pub unit: Option<UnitName>,
    /// A factor on it, such as -1 for an axis that points the other way. Default: 1.
    pub scale: Option<Ratio>,
}

/// The column of the time.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TimeColumn {
    /// Its heading. Default: time and a unit.
    pub column: Option<String>,
    /// Its unit. Default: what the heading ends with.
    pub unit: Option<UnitName>,
    /// What is added to it. Default: 0 s.
    pub offset: Option<Duration>,
}

impl From<String> for Column {
    fn from(heading: String) -> Self {
        Self { column: Some(heading), ..Self::default() }
    }
}

impl From<String> for TimeColumn {
    fn from(heading: String) -> Self {
        Self { column: Some(heading), ..Self::default() }
    }
}

/// The description of a column: in TOML its heading alone, or a table.
#[derive(Clone, Debug, Default)]
pub struct Named<T>(pub T);

impl<'de, T: From<String> + Deserialize<'de>> Deserialize<'de> for Named<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(HeadingOrTable(PhantomData))
    }
}

struct HeadingOrTable<T>(PhantomData<T>);

impl<'de, T: From<String> + Deserialize<'de>> Visitor<'de> for HeadingOrTable<T> {
    type Value = Named<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(
            "the heading of a column, or a table such as { column = \"vx\", unit = \"cm/s\" }",
        )
    }
    fn visit_str<E: Error>(self, heading: &str) -> Result<Self::Value, E> {
        Ok(Named(heading.to_owned().into()))
    }
    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
        T::deserialize(MapAccessDeserializer::new(map)).map(Named)
    }
}

impl<T: JsonSchema> JsonSchema for Named<T> {
    fn schema_name() -> Cow<'static, str> {
        format!("Heading_or_{}", T::schema_name()).into()
    }
    fn inline_schema() -> bool {
        true
    }
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({ "anyOf": [{ "type": "string" }, generator.subschema_for::<T>()] })
    }
}

/// A unit, in TOML as in a quantity: `"cm/s"`.
#[derive(Clone, Copy, Debug)]
pub struct UnitName(pub Unit);

impl<'de> Deserialize<'de> for UnitName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        parse_unit(&String::deserialize(deserializer)?).map(Self).map_err(Error::custom)
    }
}

impl JsonSchema for UnitName {
    fn schema_name() -> Cow<'static, str> {
        "Unit".into()
    }
    fn inline_schema() -> bool {
        true
    }
    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "examples": ["cm/s"] })
    }
}

fn delimiter<'de, D: Deserializer<'de>>(deserializer: D) -> Result<char, D::Error> {
    let text = String::deserialize(deserializer)?;
    let mut chars = text.chars();
    match (chars.next(), chars.next()) {
        (Some(c @ (',' | ';' | '\t' | '|' | ' ')), None) => Ok(c),
        _ => Err(Error::custom(
            "a comma, semicolon, tab, bar or space is needed, such as \";\" or \"\\t\"",
        )),
    }
}
