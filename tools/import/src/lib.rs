//! A scenario from the files of a recording.
//!
//! [`import`] recognises tables (CSV, RTKLIB, KF-GINS, SBG), files of Doppler velocity logs, NMEA
//! 0183, logs of vehicles and bags of ROS 2, writes a first scenario, reads all samples through its
//! sources, and writes the final scenario with what the samples show. What no sample shows is
//! marked with [`MARK`].

mod aids;
mod axes;
mod bag;
mod beams;
mod beside;
mod class;
mod clocks;
mod draft;
mod earth;
mod folder;
mod found;
mod instrument;
mod lcm;
mod log_axes;
mod marks;
mod pressure;
mod rates;
mod recording;
mod rotation;
mod samples;
mod several;
mod stream;
mod sums;
mod table;
mod track;
mod turns;
mod vehicle;
mod vertical;

pub use axes::{Mounted, Sense, Turn};
pub use clocks::ClockOffset;
pub use draft::MARK;
pub use found::OdometryUse;
pub use stream::StreamSurvey;

use navfuse_core::document::{Document, DocumentError};
use navfuse_core::model::stream::StreamError;
use navfuse_core::plugin::{BuildError, Registry};
use navfuse_core::run::scenario::Scenario;
use recording::Recording;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// The reason why no scenario can be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImportError {
    /// A file cannot be read, or has no form that is known.
    #[error(transparent)]
    Stream(#[from] StreamError),
    /// The files do not fit together.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The scenario cannot be read.
    #[error(transparent)]
    Document(#[from] DocumentError),
}

/// The heading at the start, as answered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Heading {
    /// The heading and its 1-sigma, deg.
    Known(f64, f64),
    /// Nobody knows it: headings, velocities and the track count from the heading at the start.
    Relative,
}

/// Answers that the files do not give.
#[derive(Clone, Debug, Default)]
pub struct Answers {
    /// Name of the scenario.
    pub name: String,
    /// Latitude and longitude (deg) and height (m) at the start.
    pub position: Option<[f64; 3]>,
    /// Heading at the start, for a recording that does not show it.
    pub heading: Option<Heading>,
    /// Use of an odometry in a bag. Default: relative poses where the recording has GNSS or a
    /// reference, else the reference.
    pub odometry: Option<OdometryUse>,
}

/// The result of an import.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The scenario.
    pub scenario: String,
    /// The sensors with what their samples show.
    pub streams: Vec<StreamSurvey>,
    /// The questions that remain.
    pub questions: Vec<String>,
    /// Other answers to one of the questions, each as `key.path=value`: the likelihood of the samples
    /// decides between them and the one in the scenario.
    pub alternatives: Vec<String>,
    /// Notes on files and sensors.
    pub notes: Vec<String>,
}

/// A sensor of a table.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct TableSensor {
    /// Registered type of the sensor.
    pub kind: &'static str,
    /// Keys that the sensor needs, such as `output = "increments"`.
    pub sensor: Vec<String>,
    /// Keys of its table in `[source.csv.files]`, each as `key = value`.
    pub source: Vec<String>,
    /// What the headings do not state, with what is assumed.
    pub questions: Vec<String>,
}

/// The sensors of a table by the beginning of its text, as [`import`] recognises those of a file; `name`
/// is the name of the file.
///
/// # Errors
/// With the reason why no sensor is recognised.
pub fn recognise_table(beginning: &str, name: &str) -> Result<Vec<TableSensor>, String> {
    let of = |found: found::Found| {
        let found::Found { kind, sensor, source, questions, .. } = found;
        TableSensor { kind, sensor, source, questions }
    };
    Ok(table::recognise(beginning, name)?.into_iter().map(of).collect())
}

/// Looks at the files, and writes a scenario for the place `scenario`, whose folder relative paths
/// start at. Returns `None` if `stop` was set.
///
/// # Errors
/// When a file cannot be read or recognised, two files have the same sensor, no file has an IMU, or a
/// sensor has no time in common with the IMU.
pub fn import(
    registry: &Registry,
    files: &[PathBuf],
    scenario: &Path,
    answers: &Answers,
    stop: &AtomicBool,
) -> Result<Option<Imported>, ImportError> {
    let Some(mut recording) = Recording::recognise(files, answers.odometry, stop)? else {
        return Ok(None);
    };
    recording.count_from(answers.position)?;
    let mut streams: Option<Vec<StreamSurvey>> = None;
    // again with what the samples showed, such as their axes
    let streams = loop {
        let text = draft::scenario(&recording, streams.as_deref(), answers).text;
        let document = Document::parse(scenario.display().to_string(), text)?;
        let assembly = Scenario::new(registry, document, &[])?.assemble(None)?;
        let Some(surveyed) = stream::survey(assembly, recording.beams(), stop)? else {
            return Ok(None);
        };
        if !recording.learn(&surveyed) {
            break surveyed;
        }
        streams = Some(surveyed);
    };
    recording.keeps_an_aid(files)?;
    recording.share_time(&streams)?;
    recording.is_held(&streams, answers.position.is_some())?;
    recording.swims_along_its_axes()?;
    recording.doubt_forward(&streams);
    let draft = draft::scenario(&recording, Some(&streams), answers);
    let parts = recording.parts.iter().filter(|part| part.samples.clock.is_some());
    let shifted: Vec<String> = parts.map(|part| part.name.to_owned()).collect();
    let mut notes = recording.notes;
    if answers.heading.is_some() && !draft.text.contains(draft::AS_ANSWERED) {
        notes
            .push("the answer of the heading is not used: the samples show the heading".to_owned());
    }
    for stream in &streams {
        // of a clock that was shifted, a note has the offset
        let rest =
            stream.clock.filter(|clock| clock.matters() || !shifted.contains(&stream.sensor));
        notes.extend(rest.map(|clock| format!("{}: {}", stream.sensor, clock.describe())));
    }
    let draft::Text { text: scenario, questions, alternatives, .. } = draft;
    Ok(Some(Imported { scenario, streams, questions, alternatives, notes }))
}
