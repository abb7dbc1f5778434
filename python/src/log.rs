//! The log of a run, as it was recorded.

use crate::error::exception;
use crate::names::{Names, index};
use crate::run::bytes;
use navfuse_core::model::record::finding::Finding;
use navfuse_core::model::record::{Event, Level};
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::Time;
use navfuse_csv::ending;
use navfuse_mcap::{BlockEntry, Entry, InnovationEntry, LogReader};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use serde_json::{Value, json};
use std::path::PathBuf;

/// A state over time: of each epoch its estimate, 1-sigma and error, NaN where one is missing.
struct State {
    names: Names,
    has_error: bool,
    rows: Vec<f64>,
}

impl State {
    fn new(block: &BlockEntry<'_>) -> Self {
        let names = Names {
            name: block.name.to_owned(),
            unit: block.unit.to_owned(),
            mode: block.mode,
            components: block.components.iter().map(|c| (*c).to_owned()).collect(),
            geodetic: block.geodetic,
            rotation: block.components == ["roll", "pitch", "yaw"],
        };
        Self { names, has_error: false, rows: Vec::new() }
    }

    /// Numbers of a row.
    fn width(&self) -> usize {
        3 * self.names.components.len()
    }

    /// Adds the estimate of the epoch `index`.
    fn push(&mut self, index: usize, block: &BlockEntry<'_>) {
        self.rows.resize(index * self.width(), f64::NAN);
        self.has_error |= !block.error.is_empty();
        for part in [&block.estimate, &block.sigma, &block.error] {
            let numbers = part.iter().copied().chain(std::iter::repeat(f64::NAN));
            self.rows.extend(numbers.take(self.names.components.len()));
        }
    }

    fn headings(&self) -> Vec<String> {
        let heading = |name: &str, what: &str, unit: &str| {
            format!("{}.{name}{what}{}", self.names.name, ending(unit))
        };
        let Names { components, unit, .. } = &self.names;
        let estimate = components.iter().zip(self.names.units()).map(|(c, u)| heading(c, "", u));
        let kinds = ["_sigma", "_error"].into_iter().take(1 + usize::from(self.has_error));
        let others = kinds.flat_map(|kind| {
            self.names.differences().into_iter().map(move |c| heading(c, kind, unit))
        });
        estimate.chain(others).collect()
    }

    fn columns(&self, epochs: usize) -> impl Iterator<Item = Vec<f64>> + '_ {
        let kinds = 2 + usize::from(self.has_error);
        let (width, used) = (self.width(), kinds * self.names.components.len());
        let cell =
            move |row: usize, k: usize| self.rows.get(row * width + k).copied().unwrap_or(f64::NAN);
        (0..used).map(move |k| (0..epochs).map(|row| cell(row, k)).collect())
    }
}

/// Channels of a sample: index, and innovation and 1-sigma.
type Channels = Vec<(usize, [f64; 2])>;

/// Innovations of a sensor: time, NIS, threshold, outcome; then innovation and 1-sigma of channels.
struct Innovations {
    sensor: String,
    channels: Vec<String>,
    outcomes: Vec<String>,
    rows: Vec<([f64; 4], Channels)>,
}

impl Innovations {
    fn push(&mut self, entry: &InnovationEntry<'_>) {
        let outcome = index(&mut self.outcomes, entry.outcome) as f64;
        let numbers = entry.innovation.iter().zip(&entry.sigma).map(|(i, s)| [*i, *s]);
        let named = entry.channels.iter().map(|name| index(&mut self.channels, name));
        let row = named.zip(numbers).collect();
        self.rows.push(([entry.time.seconds(), entry.nis, entry.threshold, outcome], row));
    }

    fn columns(&self) -> Vec<Vec<f64>> {
        let head = (0..4).map(|k| self.rows.iter().map(|(head, _)| head[k]).collect());
        let cell = |row: &[(usize, [f64; 2])], channel: usize, k: usize| {
            row.iter().find(|(c, _)| *c == channel).map_or(f64::NAN, |(_, pair)| pair[k])
        };
        let pairs = (0..self.channels.len()).flat_map(|channel| [(channel, 0), (channel, 1)]);
        let pairs = pairs.map(|(c, k)| self.rows.iter().map(|(_, row)| cell(row, c, k)).collect());
        head.chain(pairs).collect()
    }

    fn describe(&self) -> Value {
        let unit =
            |column: &String| column.rsplit_once('_').map_or("", |(_, unit)| unit).to_owned();
        json!({
            "sensor": self.sensor, "channels": self.channels, "outcomes": self.outcomes,
            "units": self.channels.iter().map(unit).collect::<Vec<_>>(),
        })
    }
}

/// Samples of a sensor: the time, then its columns in SI.
#[derive(Default)]
struct Samples {
    sensor: String,
    headings: Vec<String>,
    columns: Vec<Vec<f64>>,
}

impl Samples {
    fn push(&mut self, sample: &Sample, headings: &[&str]) {
        if self.columns.is_empty() {
            self.headings =
                std::iter::once(&"time_s").chain(headings).map(|h| (*h).into()).collect();
            self.columns.resize(self.headings.len(), Vec::new());
        }
        let values = (0..headings.len()).map(|k| sample.get(k).unwrap_or(f64::NAN));
        let row = std::iter::once(sample.time.seconds()).chain(values);
        self.columns.iter_mut().zip(row).for_each(|(column, value)| column.push(value));
    }
}

/// The content of a log.
#[derive(Default)]
struct Log {
    samples: Vec<Samples>,
    times: Vec<f64>,
    states: Vec<State>,
    innovations: Vec<Innovations>,
    verdict: Value,
    findings: Vec<Value>,
    warnings: Vec<Value>,
}

impl Log {
    fn take(&mut self, entry: Entry<'_>) {
        match entry {
            Entry::Sensor(sensor) => {
                self.samples.push(Samples { sensor: sensor.name.to_owned(), ..Samples::default() });
            }
            Entry::Sample(sample, headings) => {
                if let Some(samples) = self.samples.get_mut(sample.sensor.0) {
                    samples.push(&sample, &headings);
                }
            }
            Entry::Block(block) => self.block(&block),
            Entry::Innovation(entry) => self.innovation(&entry),
            Entry::Verdict(verdict) => self.verdict = json!(verdict),
            Entry::Finding(finding) => self.findings.push(describe(&finding)),
            Entry::Event(event) if event.level > Level::Info => self.warnings.push(warning(&event)),
            _ => {}
        }
    }

    fn block(&mut self, block: &BlockEntry<'_>) {
        let time = block.time.seconds();
        if self.times.last() != Some(&time) {
            self.times.push(time);
        }
        let found = self.states.iter().position(|s| s.names.name == block.name);
        let slot = found.unwrap_or_else(|| {
            self.states.push(State::new(block));
            self.states.len() - 1
        });
        self.states[slot].push(self.times.len() - 1, block);
    }

    fn innovation(&mut self, entry: &InnovationEntry<'_>) {
        let found = self.innovations.iter().position(|i| i.sensor == entry.sensor);
        let slot = found.unwrap_or_else(|| {
            let (channels, outcomes, rows) = Default::default();
            let sensor = entry.sensor.to_owned();
            self.innovations.push(Innovations { sensor, channels, outcomes, rows });
            self.innovations.len() - 1
        });
        self.innovations[slot].push(entry);
    }

    fn describe(&self, scenario: &str, version: &str) -> Value {
        let (mut headings, mut blocks) = (vec!["time_s".to_owned()], Vec::new());
        for state in &self.states {
            blocks.push(state.names.describe(headings.len(), state.has_error));
            headings.extend(state.headings());
        }
        json!({
            "summary": {
                "scenario": scenario, "version": version, "verdict": self.verdict,
                "findings": self.findings, "warnings": self.warnings, "paths": [],
            },
            "estimate": { "headings": headings, "blocks": blocks },
        })
    }
}

/// A time in JSON: null for the whole run.
fn seconds(time: Time) -> Option<f64> {
    (time > Time::MIN).then(|| time.seconds())
}

fn describe(finding: &Finding) -> Value {
    json!({
        "time_s": seconds(finding.time), "about": finding.about, "text": finding.text,
        "severity": finding.severity.name(), "basis": finding.basis.name(), "remedy": finding.remedy,
    })
}

fn warning(event: &Event) -> Value {
    json!({
        "time_s": seconds(event.time), "level": event.level, "about": event.about,
        "text": event.text,
    })
}

/// Reads the log of a run: the same content as the result of a run.
#[pyfunction]
pub fn read_log(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let (log, text) = py.detach(|| {
        let mut reader = LogReader::open(&path).map_err(exception)?;
        let mut log = Log::default();
        while reader.next(|entry| log.take(entry)).map_err(exception)? {}
        if let Some(text) = reader.warning() {
            let event = Event { time: Time::MIN, level: Level::Warning, about: "log".into(), text };
            log.warnings.push(warning(&event));
        }
        let info = reader.info();
        let text = log.describe(&info.name, &info.version).to_string();
        PyResult::Ok((log, text))
    })?;
    let result = PyDict::new(py);
    let columns = log.states.iter().flat_map(|state| state.columns(log.times.len()));
    let columns = std::iter::once(log.times.clone()).chain(columns).collect();
    result.set_item("text", text)?;
    result.set_item("columns", bytes(py, columns)?)?;
    let tables = PyList::empty(py);
    for sensor in &log.innovations {
        tables.append((sensor.describe().to_string(), bytes(py, sensor.columns())?))?;
    }
    result.set_item("innovations", tables)?;
    let samples = PyList::empty(py);
    for Samples { sensor, headings, columns } in log.samples {
        samples.append((sensor, headings, bytes(py, columns)?))?;
    }
    result.set_item("samples", samples)?;
    Ok(result)
}
