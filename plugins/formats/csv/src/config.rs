//! The parameters of the source.

pub use crate::delimiter::Delimiter;
use navfuse_core::units::{
    Angle, Date, Density, Duration, Length, Pressure, Ratio, Triple, Unit, parse_unit,
};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;
use std::path::PathBuf;

/// Reads recorded samples from CSV files, one file for each sensor. A file may be compressed with gzip
/// or zstd.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Csv {
    /// Folder of the files, absolute or relative to the folder of the scenario. Default: the folder of the scenario.
    #[serde(default)]
    pub directory: PathBuf,
    /// Format of each sensor's file, by the name of the sensor. Default: the file NAME.csv, if it
    /// exists; beside other sources, and without `directory`, only the files that are named here.
    #[serde(default)]
    pub files: BTreeMap<String, FileConfig>,
    /// A second file of a sensor with its other channels, such as the gyroscope of a phone beside its
    /// accelerometer, by the name of the sensor. Its channels are interpolated to the times of the
    /// first file. Default: none.
    #[serde(default)]
    pub more: BTreeMap<String, FileConfig>,
}

/// The file of one sensor and its format.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct FileConfig {
    /// The file, absolute or relative to the directory. Default: NAME.csv.
    pub path: Option<PathBuf>,
    /// Files of the same form that go on where the one before ends, for a recording that was split by
    /// time. Default: none.
    pub then: Vec<PathBuf>,
    /// Files whose columns stand beside those of the file in the rows of its times, such as a file for each channel. A
    /// heading is the title of a column that stands alone in its file, or `FILE.TITLE`; it needs `labels` and `headings`.
    /// Memory holds the files, of at most 256 MiB. Default: none.
    pub beside: Vec<PathBuf>,
    /// Roll, pitch and yaw of the sensor's axes in the vehicle's, both forward, right, down. Every three
    /// channels along `x`, `y` and `z` are turned by it. Default: zero.
    pub rotation: Option<Triple<Angle>>,
    /// The column of the time. Default: time_s, or time with another unit of time.
    pub time: Named<TimeColumn>,
    /// The columns of the channels, by the name of the channel. Default: the name of the channel
    /// and a unit, such as vel_x_mps.
    pub columns: BTreeMap<String, Named<Column>>,
    /// Separator of the cells: one ASCII character, or `whitespace` for any number of spaces and tabs. Default: a comma.
    #[schemars(with = "String")]
    pub delimiter: Delimiter,
    /// Character at the start of a line that is a comment. Default: #.
    #[serde(deserialize_with = "comment")]
    pub comment: char,
    /// Number of lines at the beginning of the file that are no part of the table. Default: 0.
    pub skip: u64,
    /// Headings of the columns, for a file without a line of headings. Default: the first line.
    pub headings: Option<Vec<String>>,
    /// Number of lines after which the table ends, where another one follows. Default: it ends with the file.
    pub until: Option<u64>,
    /// Columns with several numbers in each cell, such as `[0.1, 0.2, 9.8]`, with how many they are: the headings of
    /// `{ accel = 3 }` are then `accel.0` to `accel.2`. Default: none.
    pub vectors: BTreeMap<String, u8>,
    /// Set if each row names its values: objects of JSON, one after another or in an array, and lines
    /// such as `t=0.01 gx: 0.2`, points of GPX, TCX and KML, one value in each row, matrices and tables of HTML. The heading of a value is its path, as `gyro.x` or `gyro.0`; `stamp`
    /// and `kind` are what precedes the names of a line. It needs `headings`. Default: false.
    pub labels: bool,
    /// Arrays of JSON whose elements are samples each, such as `["samples"]`: a value `samples.0.gx` is then `samples.gx` of
    /// the first row, beside the other values of the object. Default: none.
    pub each: Vec<String>,
    /// Text behind the stamp that a terminal program wrote before each line, such as `->` of the Arduino IDE, or `]`: the
    /// stamp is then the first cell of the line. Default: none.
    pub stamps: Option<String>,
    /// Widths in characters of columns without separators, as in `-0.123-9.807`: commas then stand between them. Default: none.
    pub widths: Vec<u16>,
    /// Set if the rows run from the newest to the oldest. Memory holds the file, of at most 256 MiB. Default: false.
    pub backwards: bool,
    /// Character between the whole part of a number and its decimals: `.` (default) or `,`.
    pub decimal: Decimal,
    /// Texts of the cells that a row must have, by heading, in a file with rows of several kinds:
    /// `{ kind = "IMU" }`. Default: all rows are used.
    pub rows: BTreeMap<String, String>,
    /// Column by which a row counts as valid, such as `{ column = "fix", least = 1 }`. Default: none.
    pub valid: Option<Valid>,
    /// Numbers that stand for no measurement, as the cells have them, such as `[-32768, 99.999]`. A channel
    /// with one of them is missing in that sample. Default: none.
    pub missing: Vec<f64>,
    /// Texts that may stand after the numbers of the cells, with a space before them or without, such as `["sec", "deg/s"]`:
    /// the same one in all cells of a column. Default: none.
    pub suffixes: Vec<String>,
    /// A row whose channels are those of the row before is no new sample, as where a program repeats
    /// the newest fix in each row. Default: false.
    pub changes_only: bool,
    /// Treatment of a row whose time is not later than the time of the row before.
    pub disorder: Disorder,
    /// Treatment of a cell without a number, such as nan or inf.
    pub nan: Nan,
}

impl Default for FileConfig {
    fn default() -> Self {
        Self {
            path: None,
            then: Vec::new(),
            beside: Vec::new(),
            rotation: None,
            time: Named::default(),
            columns: BTreeMap::new(),
            delimiter: Delimiter::default(),
            comment: '#',
            skip: 0,
            headings: None,
            until: None,
            vectors: BTreeMap::new(),
            labels: false,
            each: Vec::new(),
            stamps: None,
            widths: Vec::new(),
            backwards: false,
            decimal: Decimal::default(),
            rows: BTreeMap::new(),
            valid: None,
            missing: Vec::new(),
            suffixes: Vec::new(),
            changes_only: false,
            disorder: Disorder::default(),
            nan: Nan::default(),
        }
    }
}

/// The character before the decimals of a number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
pub enum Decimal {
    /// A point.
    #[default]
    #[serde(rename = ".")]
    Point,
    /// A comma.
    #[serde(rename = ",")]
    Comma,
}

/// The treatment of a row whose time is not later than that of the row before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Disorder {
    /// The run ends.
    #[default]
    Error,
    /// The row is skipped, and a warning reports the number of such rows.
    Skip,
    /// Rows with one time are spread evenly up to the next time, and an earlier row is skipped. The rows of the first
    /// time, of which some may be missing, are not used.
    Spread,
}

/// The treatment of a cell without a number, such as nan or inf.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Nan {
    /// The run ends.
    #[default]
    Error,
    /// The channel is missing in that sample.
    Missing,
}

/// The column by which a row counts as valid.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Valid {
    /// Heading of the column: a number, or `true` and `false`, `y` and `n`, which count as 1 and 0.
    pub column: String,
    /// Least value of a valid row. Default: 1.
    #[serde(default = "one")]
    pub least: f64,
}

fn one() -> f64 {
    1.0
}

/// The column of a channel.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Column {
    /// Heading of the column. Default: the name of the channel and a unit.
    pub column: Option<String>,
    /// Unit of the column. Default: the unit at the end of the heading.
    pub unit: Option<UnitName>,
    /// Heading of the column with the course in degrees, where the column has the speed over ground,
    /// for `vel_n` and `vel_e`. Default: none.
    pub course: Option<String>,
    /// Zone of UTM, such as `32N`, where the column has the easting of a position in m, for `lat` and
    /// `lon`. Default: none.
    pub zone: Option<String>,
    /// Heading of the column with the northing in m, beside an easting. Default: none.
    pub north: Option<String>,
    /// Heading of the column with the height in m above the plane of `origin`, beside an easting and a
    /// northing from there. Default: none.
    pub up: Option<String>,
    /// Heading of the column with the distance in m below the plane of `origin`, in place of `up`. Default: none.
    pub down: Option<String>,
    /// The point from which easting, northing and `up` count, along its own east, north and up, for `lat`,
    /// `lon` and `height`. Default: none.
    pub origin: Option<Point>,
    /// Pressure at the surface, for a depth from a column of a pressure. Default: 101325 Pa where
    /// the unit of the column is one of a pressure.
    pub atmosphere: Option<Pressure>,
    /// Density of the water, for this depth. Default: 1025 kg/m^3.
    pub density: Option<Density>,
    /// Heading of a column in the same unit that is added, such as the height of the geoid beside a
    /// height above it. Default: none.
    pub plus: Option<String>,
    /// Heading of a column with N, S, E or W: the value is negative to the south and to the west. Default: none.
    pub side: Option<String>,
    /// Factor on the value, such as -1 for an axis with the opposite direction. Default: 1.
    pub scale: Option<Ratio>,
    /// Notation of a position: `decimal` (default), `degrees-minutes`, `degrees-minutes-seconds`,
    /// `earth-fixed`, or `latitude-longitude` and `longitude-latitude` for a column with both.
    #[serde(default)]
    pub notation: Notation,
}

/// A point on the Earth.
#[derive(Clone, Copy, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Point {
    /// Latitude.
    pub latitude: Angle,
    /// Longitude.
    pub longitude: Angle,
    /// Height above the ellipsoid.
    pub height: Length,
}

/// The notation of a position.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Notation {
    /// A number of the unit.
    #[default]
    Decimal,
    /// Degrees times 100 plus minutes, ddmm.mmmm, as in NMEA 0183.
    DegreesMinutes,
    /// Degrees, minutes and seconds, in three columns from this one on, or in one such as
    /// `48°06'00.1"N`.
    DegreesMinutesSeconds,
    /// Coordinates x, y, z of Earth-fixed axes, in three columns from this one on, in m.
    EarthFixed,
    /// Latitude and longitude in one text, such as `57.1 N 11.9 E`, `57°06.0'N 011°54.0'E`, `57.1, 11.9` or
    /// `POINT (11.9 57.1)`; a third number is the height in m.
    LatitudeLongitude,
    /// The same with the longitude first, such as `11.9, 57.1`.
    LongitudeLatitude,
}

/// The column of the time.
#[derive(Clone, Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TimeColumn {
    /// Heading of the column. Default: time and a unit.
    pub column: Option<String>,
    /// Unit of the column. Default: the unit at the end of the heading.
    pub unit: Option<UnitName>,
    /// Form of the time: `number` (default), `date-time` for text such as 2022-06-01T08:30:00.25Z,
    /// 2022-06-01 10:30:00.25+02:00, 2022/06/01 8:30:00.25 AM, 01-Jun-2022 08:30:00.25, 2022:152:08:30:00.25 or
    /// 20220601T083000.25, `time-of-day` for 08:30:00.25 or 083000.25, which counts from midnight; days in `matlab`
    /// (`datenum`, since the year 0), `excel` (since 1899-12-30), `julian` and `modified-julian`; 100 ns in `dotnet`
    /// (since the year 1) and `filetime` (since 1601); seconds in `labview` (since 1904) and `cocoa` (since 2001).
    #[serde(default)]
    pub format: TimeFormat,
    /// Order of the parts of a date. Default: `year-month-day`.
    #[serde(default)]
    pub order: Order,
    /// Headings of year, month, day, hour and minute, where the column of the time has the seconds
    /// of the minute. Default: none.
    pub fields: Option<[String; 5]>,
    /// Headings of the year and of the day of the year, where the column of the time has the seconds of the day; with those
    /// of hour and minute behind them, it has the seconds of the minute. Default: none.
    pub of_year: Option<Vec<String>>,
    /// Heading of the column of nanoseconds that are added to the column of the time. Default: none.
    pub nanos: Option<String>,
    /// Unit of this column, such as `ms`. Default: ns.
    pub nanos_unit: Option<UnitName>,
    /// Heading of the column of the date, where the column of the time has the time of the day.
    /// Default: none.
    pub date: Option<String>,
    /// Heading of the column of the GPS week, where the column of the time has the seconds of the
    /// week. Default: none.
    pub week: Option<String>,
    /// Scale of dates and weeks: `utc`, or `gps`, from which the leap seconds are subtracted.
    /// Default: `gps` with `week`, else `utc`.
    pub scale: Option<Scale>,
    /// Date and time, on UTC, at which the run's clock is zero, for dates and weeks. Default:
    /// 1970-01-01T00:00:00.
    pub origin: Option<Date>,
    /// Offset that is added to the time. Default: 0 s.
    pub offset: Option<Duration>,
}

/// The form of a time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum TimeFormat {
    /// A number with a unit.
    #[default]
    Number,
    /// A date and a time of the day.
    DateTime,
    /// A time of the day.
    TimeOfDay,
    /// Days since the year 0, as `datenum` of MATLAB counts them.
    Matlab,
    /// Days since 1899-12-30, as Excel counts them.
    Excel,
    /// Julian days, which begin at noon.
    Julian,
    /// Modified Julian days, since 1858-11-17.
    ModifiedJulian,
    /// Ticks of 100 ns since the year 1, as .NET counts them.
    Dotnet,
    /// Ticks of 100 ns since 1601, as Windows counts them.
    Filetime,
    /// Seconds since 2001, as Apple counts them.
    Cocoa,
    /// Seconds since 1904, as LabVIEW counts them.
    Labview,
}

/// The order of the parts of a date.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Order {
    /// 2022-06-01.
    #[default]
    YearMonthDay,
    /// 01.06.2022.
    DayMonthYear,
    /// 06/01/2022.
    MonthDayYear,
}

/// The scale of a date.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Scale {
    /// UTC, or any other scale that is used as it is.
    Utc,
    /// GPS time, which has no leap seconds.
    Gps,
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

/// The description of a column: in TOML the heading alone, or a table.
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

fn comment<'de, D: Deserializer<'de>>(deserializer: D) -> Result<char, D::Error> {
    let text = String::deserialize(deserializer)?;
    match text.as_bytes() {
        [byte] if byte.is_ascii() && !b"\"\r\n".contains(byte) => Ok(char::from(*byte)),
        _ => Err(Error::custom("one character is needed, such as \"%\"")),
    }
}
