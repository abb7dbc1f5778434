//! Samples of a table with the headings of another program: recognised as `navfuse import` does.

use crate::error::exception;
use crate::samples::{Rows, SOURCE};
use crate::scenario::{Scenario, sensor_info};
use navfuse_core::document::quoted;
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::stream::StreamError;
use navfuse_core::run::scenario::Scenario as Composed;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_import::{TableSensor, recognise_table};
use pyo3::prelude::*;
use std::path::Path;

/// Size in bytes of the beginning of a table by which it is recognised.
const BEGINNING: u64 = 4 * 1024 * 1024;

/// Types of sensors for which a table of another type has the channels.
const SIMILAR: [(&str, &[&str]); 3] = [
    ("reference", &["gnss", "attitude"]),
    ("ahrs", &["attitude", "reference"]),
    ("compass", &["dual-antenna", "attitude"]),
];

/// Samples of a table.
pub struct Recognised {
    pub rows: Rows,
    /// Channels that have samples.
    pub channels: Vec<String>,
    /// Keys of the columns, as in `[source.csv.files]`, and what the headings do not state.
    pub notes: Vec<String>,
}

/// Reads the samples of a sensor in a table of text.
///
/// # Errors
/// When the table is not recognised, or has another sensor.
pub fn read(scenario: &Scenario, sensor: &str, path: &Path) -> PyResult<Recognised> {
    let composition = scenario.composed()?.compose().map_err(exception)?;
    let info = sensor_info(&composition, sensor)?;
    let beginning = navfuse_csv::beginning(path, BEGINNING)
        .map_err(|error| exception(StreamError::open(path, error)))?;
    let found = recognise_table(&navfuse_csv::text(&beginning), sensor)
        .and_then(|found| chosen(found, info))
        .map_err(|why| refused(sensor, &why))?;
    let place = format!("source.csv.files.{sensor}");
    let file = quoted(&path.display().to_string());
    // beside a second source, the table is all that the first one reads
    let mut settings =
        vec![SOURCE.to_owned(), format!("{place}.path={file}"), format!("{place}.nan=missing")];
    let keys = found.source.iter().filter_map(|line| line.split_once(" = "));
    settings.extend(keys.map(|(key, value)| format!("{place}.{key}={value}")));
    let document = scenario.changed(&settings)?;
    let composed = Composed::new(&scenario.registry, document, &[]).map_err(exception)?;
    let assembly = composed.assemble(None).map_err(exception)?;
    let (mut times, mut columns) = (Vec::new(), vec![Vec::new(); info.channels.len()]);
    let mut sample = Sample::empty(Time::MIN, SensorId(0));
    for (_, mut source) in assembly.sources {
        while source.next(&mut sample).map_err(exception)? {
            times.push(sample.time);
            for (channel, column) in columns.iter_mut().enumerate() {
                column.push(sample.get(channel).unwrap_or(f64::NAN));
            }
        }
    }
    let some = |column: &Vec<f64>| column.iter().any(|value| !value.is_nan());
    let named = info.channels.iter().zip(&columns).filter(|(_, column)| some(column));
    let channels = named.map(|(channel, _)| channel.name.to_string()).collect();
    let notes = found.source.into_iter().chain(found.questions).collect();
    Ok(Recognised { rows: Rows::of(sensor, times, columns), channels, notes })
}

/// The sensor of a table that is meant.
fn chosen(found: Vec<TableSensor>, info: &SensorInfo) -> Result<TableSensor, String> {
    let kinds: Vec<&str> = found.iter().map(|found| found.kind).collect();
    let similar = SIMILAR.iter().find(|(kind, _)| *kind == info.kind).map_or(&[][..], |s| s.1);
    let fits = |kind: &str| kind == info.kind || similar.contains(&kind);
    let k = kinds.iter().position(|kind| fits(kind)).or((kinds.len() == 1).then_some(0));
    let Some(k) = k else {
        return Err(format!("it has the sensors {}", kinds.join(", ")));
    };
    let Some(found) = found.into_iter().nth(k) else { return Err("it has no sensor".to_owned()) };
    let channel = |line: &String| {
        let (key, _) = line.split_once(" = ")?;
        key.strip_prefix("columns.").map(str::to_owned)
    };
    let known = |name: &str| info.channels.iter().any(|channel| &*channel.name == name);
    match found.source.iter().filter_map(channel).find(|name| !known(name)) {
        None => Ok(found),
        Some(other) if found.sensor.is_empty() => {
            Err(format!("it has the channel {other} of a sensor of the type {}", found.kind))
        }
        Some(other) => {
            Err(format!("it has the channel {other}: the sensor needs {}", found.sensor.join(", ")))
        }
    }
}

fn refused(sensor: &str, why: &str) -> PyErr {
    let text = format!("the columns for [sensor.{sensor}] are not recognised: {why}");
    let remedy = "name them as Scenario.check() names the channels, with their units";
    exception(StreamError::scenario(text).with_remedy(remedy))
}
