//! The columns of the time and the channels of a sensor, and their conversion to SI.

use crate::config::FileConfig;
use crate::headings::Wanted;
use crate::time;
use navfuse_core::document::did_you_mean;
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::stream::StreamError;
use navfuse_core::units::Unit;
use navfuse_core::units::time::Time;

/// The column of the time.
pub struct TimeCell {
    /// Index of the column.
    pub column: usize,
    /// Its unit in nanoseconds.
    pub unit: u64,
    /// Offset that is added to the time.
    pub offset: Time,
}

/// The column of a channel.
pub struct ChannelCell {
    /// Index of the column.
    pub column: usize,
    unit: Option<Unit>,
    scale: f64,
}

impl ChannelCell {
    /// Converts a number of the column to SI.
    pub fn to_si(&self, number: f64) -> f64 {
        self.unit.map_or(number, |u| u.to_si(number)) * self.scale
    }
}

/// The headings that a sensor needs by default.
pub fn usual_header(info: &SensorInfo) -> String {
    let channels = info.channels.iter().map(|c| c.column().trim_end_matches('_').to_owned());
    std::iter::once("time_s".to_owned()).chain(channels).collect::<Vec<_>>().join(",")
}

/// Finds the column of the time.
///
/// # Errors
/// When the column is missing, is ambiguous, or has an unsuitable unit.
pub fn time_cell(
    info: &SensorInfo,
    config: &FileConfig,
    headings: &[String],
) -> Result<TimeCell, StreamError> {
    let (given, key) = (&config.time.0, format!("files.{}.time", info.name));
    let others: Vec<&str> = info.channels.iter().map(|c| c.name).collect();
    let (column, unit) = (given.column.as_deref(), given.unit.map(|u| u.0));
    let found = Wanted { name: "time", si: "s", column, unit, key: &key, others: &others }
        .find(headings)?;
    let nanos = found.unit.map_or(1e9, |u| u.to_si(1e9));
    // exact times need a unit of whole nanoseconds, as all usual units of time are
    if !(1.0..=86_400e9).contains(&nanos) || (nanos - nanos.round()).abs() > 1e-6 {
        let message = "a unit of time from ns to day is needed, such as \"ms\"";
        return Err(StreamError::scenario(format!("{key}.unit: {message}")));
    }
    let offset = time::from_seconds(given.offset.map_or(0.0, |o| o.si()));
    let offset =
        offset.ok_or_else(|| StreamError::scenario(format!("{key}.offset: beyond 73 years")))?;
    Ok(TimeCell { column: found.index, unit: nanos.round() as u64, offset })
}

/// Finds the columns of the channels.
///
/// # Errors
/// When the column is missing, is ambiguous, or has an unsuitable unit.
pub fn channel_cells(
    info: &SensorInfo,
    config: &FileConfig,
    headings: &[String],
) -> Result<Vec<ChannelCell>, StreamError> {
    let (sensor, names) = (&info.name, || info.channels.iter().map(|c| c.name));
    if let Some(unknown) = config.columns.keys().find(|key| names().all(|c| c != key.as_str())) {
        let near = did_you_mean(unknown, names())
            .map_or_else(String::new, |n| format!("; did you mean {n:?}?"));
        let list = names().collect::<Vec<_>>().join(", ");
        return Err(StreamError::scenario(format!(
            "files.{sensor}.columns: [sensor.{sensor}] has no channel {unknown:?}{near} \
             (channels: {list})"
        )));
    }
    let cell = |c: &navfuse_core::units::sample::Channel| {
        let given = config.columns.get(c.name).map(|g| &g.0);
        let (column, unit) =
            (given.and_then(|g| g.column.as_deref()), given.and_then(|g| g.unit).map(|u| u.0));
        let key = format!("files.{sensor}.columns.{}", c.name);
        let others: Vec<&str> =
            std::iter::once("time").chain(names().filter(|n| *n != c.name)).collect();
        let found = Wanted { name: c.name, si: c.unit, column, unit, key: &key, others: &others }
            .find(headings)?;
        let scale = given.and_then(|g| g.scale).map_or(1.0, |s| s.si());
        Ok(ChannelCell { column: found.index, unit: found.unit, scale })
    };
    info.channels.iter().map(cell).collect()
}
