//! A run as far as it can be shown: counts of everything, and series of a bounded length.

use crate::thin::{Merge, Thin};
use navfuse_core::model::record::{Event, Level};
use navfuse_core::model::sensor::Purpose;
use navfuse_core::state::Mode;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::Time;

/// The most events that are kept of each level.
const EVENTS: usize = 500;

/// One run: filled by a [`crate::Recorder`] while it runs, or from its log by [`crate::read_log`], with the same result.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct History {
    /// The scenario's name.
    pub name: String,
    /// Version of the program that ran it.
    pub version: String,
    /// The scenario in TOML, as it was run.
    pub scenario: String,
    /// The blocks of the state.
    pub blocks: Vec<BlockHistory>,
    /// The sensors, in the order of their ids.
    pub sensors: Vec<SensorHistory>,
    /// The first events of each level.
    pub events: Vec<Event>,
    /// How many more there were.
    pub events_left_out: u64,
    /// What a reader should know of this history itself, such as that the log was cut off.
    pub warnings: Vec<String>,
}

/// What is known of a block.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockHistory {
    /// `owner.name`, such as `dvl.scale`.
    pub name: String,
    /// What the filter does with it.
    pub mode: Mode,
    /// One name a component.
    pub components: Vec<String>,
    /// The unit of sigma and error, and of the estimate unless that is a position; empty for a ratio.
    pub unit: String,
    /// Whether the estimate is latitude and longitude (deg) and height (m), and sigma and error north, east, down (m).
    pub geodetic: bool,
    /// The estimate over time: rows stand for several epochs, of which they show one.
    pub rows: Thin<Row>,
    /// The first estimate: of a filter that starts from a reference that before any measurement.
    pub first: Row,
    /// The last estimate.
    pub last: Row,
    /// The last estimate that the truth was known of.
    pub compared: Option<Row>,
    /// Of a position: how far it went.
    pub travelled: Travelled,
}

/// A block's estimate at one epoch, in display units.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// s.
    pub time: f64,
    /// One a component.
    pub estimate: Vec<f64>,
    /// 1-sigma.
    pub sigma: Vec<f64>,
    /// Estimate minus truth; empty where that is not known.
    pub error: Vec<f64>,
}

impl Merge for Row {
    /// The first that is compared with the truth, so that a slow reference is seen.
    fn merge(&mut self, next: Self) {
        if self.error.is_empty() && !next.error.is_empty() {
            *self = next;
        }
    }
}

/// Horizontal path lengths and errors, at all epochs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Travelled {
    /// Of the estimate, m.
    pub estimate: f64,
    /// Of the truth, where it is known, m.
    pub truth: f64,
    /// Sum of the squares of the horizontal error, m^2, and how many there are.
    pub squares: (f64, u64),
}

/// What is known of a sensor.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SensorHistory {
    /// Its name in the scenario.
    pub name: String,
    /// Its registered type, where it is known.
    pub kind: Option<String>,
    /// What it is for, where it is known.
    pub purpose: Option<Purpose>,
    /// Name and SI unit of its channels, such as `vel_x_mps`; none before its first sample.
    pub channels: Vec<String>,
    /// How many samples there were.
    pub read: u64,
    /// The samples over time: rows stand for several, with the least and the greatest of each channel.
    pub samples: Thin<Envelope>,
    /// What became of the samples of a measuring sensor.
    pub updates: Updates,
}

/// The range of a sensor's channels over some samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Envelope {
    /// Of the first, s.
    pub time: f64,
    /// One a channel; NaN where it is missing.
    pub low: Vec<f64>,
    /// One a channel.
    pub high: Vec<f64>,
}

impl Merge for Envelope {
    fn merge(&mut self, next: Self) {
        // `min` and `max` take the other where one is NaN
        self.low.iter_mut().zip(next.low).for_each(|(a, b)| *a = a.min(b));
        self.high.iter_mut().zip(next.high).for_each(|(a, b)| *a = a.max(b));
    }
}

/// What became of the samples of a measuring sensor.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Updates {
    /// Corrected the state.
    pub accepted: u64,
    /// Were outside the gate.
    pub gated: u64,
    /// Could not be used: why, and how many.
    pub rejected: Vec<(String, u64)>,
    /// Sum of the normalised innovation squared of those that were accepted, and of their degrees of freedom.
    pub nis: [f64; 2],
    /// Of those that were accepted, every n-th.
    pub innovations: Thin<Innovation>,
    /// Of those that were gated, every n-th where there are very many.
    pub outliers: Thin<Innovation>,
    /// The sums of `nis` over time.
    pub consistency: Thin<Consistency>,
}

/// An innovation.
#[derive(Clone, Debug, PartialEq)]
pub struct Innovation {
    /// s.
    pub time: f64,
    /// Sample minus prediction, SI, one a channel; NaN where it was not there.
    pub innovation: Vec<f64>,
    /// Its 1-sigma, one a channel.
    pub sigma: Vec<f64>,
    /// Normalised innovation squared.
    pub nis: f64,
    /// The gate's threshold on it; infinite where the gate is off.
    pub threshold: f64,
}

impl Merge for Innovation {
    /// The first: a choice that does not depend on the value does not mislead.
    fn merge(&mut self, _: Self) {}
}

/// Sums over some accepted samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Consistency {
    /// From the first to the last, s.
    pub span: [f64; 2],
    /// Sum of the normalised innovation squared.
    pub nis: f64,
    /// Sum of the degrees of freedom: the expectation of `nis`.
    pub expected: f64,
}

impl Merge for Consistency {
    fn merge(&mut self, next: Self) {
        self.span[1] = next.span[1];
        self.nis += next.nis;
        self.expected += next.expected;
    }
}

/// A block before its first estimate.
#[derive(Clone, Copy, Debug)]
pub struct BlockInfo<'a, C> {
    pub name: &'a str,
    pub mode: Mode,
    pub components: C,
    pub unit: &'a str,
    pub geodetic: bool,
}

/// What became of a sample.
#[derive(Clone, Copy, Debug)]
pub enum Fate<'a> {
    Accepted,
    Gated,
    Rejected(&'a str),
}

impl History {
    /// When the filter started and ended, s.
    pub fn span(&self) -> Option<[f64; 2]> {
        let first = self.blocks.first()?;
        Some([first.first.time, first.last.time])
    }

    /// The block that is a position.
    pub fn position(&self) -> Option<&BlockHistory> {
        self.blocks.iter().find(|b| b.geodetic)
    }

    /// The block of that name.
    pub fn block(&self, name: &str) -> Option<&BlockHistory> {
        self.blocks.iter().find(|b| b.name == name)
    }

    /// The sensor of that name.
    pub fn sensor(&self, name: &str) -> Option<&SensorHistory> {
        self.sensors.iter().find(|s| s.name == name)
    }

    /// The estimate of a block, which is introduced with its first.
    pub(crate) fn state<'c, C: Iterator<Item = &'c str>>(
        &mut self,
        info: BlockInfo<'_, C>,
        row: Row,
    ) {
        match self.blocks.iter_mut().find(|b| b.name == info.name) {
            Some(block) => block.push(row),
            None => self.blocks.push(BlockHistory::new(info, row)),
        }
    }

    /// A sample.
    pub(crate) fn sample<'c>(
        &mut self,
        sample: &Sample,
        columns: impl ExactSizeIterator<Item = &'c str>,
    ) {
        let Some(sensor) = self.sensors.get_mut(sample.sensor.0) else { return };
        let values: Vec<f64> =
            (0..columns.len()).map(|k| sample.get(k).unwrap_or(f64::NAN)).collect();
        if sensor.channels.is_empty() {
            sensor.channels = columns.map(str::to_owned).collect();
        }
        sensor.read += 1;
        sensor.samples.push(Envelope {
            time: sample.time.seconds(),
            low: values.clone(),
            high: values,
        });
    }

    /// What became of a sample, with the innovation and its 1-sigma of the channels that were there.
    pub(crate) fn update(
        &mut self,
        (sensor, time, fate): (usize, Time, Fate<'_>),
        (nis, threshold): (f64, f64),
        channels: impl Iterator<Item = (usize, f64, f64)>,
    ) {
        let Some(sensor) = self.sensors.get_mut(sensor) else { return };
        let count = sensor.channels.len();
        let time = time.seconds();
        let (innovation, sigma) = (vec![f64::NAN; count], vec![f64::NAN; count]);
        let mut row = Innovation { time, innovation, sigma, nis, threshold };
        let mut freedom = 0.0;
        for (k, innovation, sigma) in channels.filter(|c| c.0 < count) {
            (row.innovation[k], row.sigma[k]) = (innovation, sigma);
            freedom += 1.0;
        }
        let updates = &mut sensor.updates;
        match fate {
            Fate::Accepted => {
                updates.accepted += 1;
                updates.nis = [updates.nis[0] + nis, updates.nis[1] + freedom];
                updates.consistency.push(Consistency { span: [time; 2], nis, expected: freedom });
                updates.innovations.push(row);
            }
            Fate::Gated => {
                updates.gated += 1;
                updates.outliers.push(row);
            }
            Fate::Rejected(why) => match updates.rejected.iter_mut().find(|r| r.0 == why) {
                Some((_, count)) => *count += 1,
                None => updates.rejected.push((why.to_owned(), 1)),
            },
        }
    }

    /// Something to read.
    pub(crate) fn event(&mut self, event: &Event) {
        if self.events.iter().filter(|e| e.level == event.level).count() < EVENTS {
            self.events.push(event.clone());
        } else {
            self.events_left_out += 1;
        }
    }

    /// The worst level of all events.
    pub fn level(&self) -> Level {
        self.events.iter().map(|e| e.level).max().unwrap_or(Level::Info)
    }
}

impl BlockHistory {
    fn new<'c, C: Iterator<Item = &'c str>>(info: BlockInfo<'_, C>, row: Row) -> Self {
        let mut block = Self {
            name: info.name.to_owned(),
            mode: info.mode,
            components: info.components.map(str::to_owned).collect(),
            unit: info.unit.to_owned(),
            geodetic: info.geodetic,
            rows: Thin::default(),
            first: row.clone(),
            last: row.clone(),
            compared: None,
            travelled: Travelled::default(),
        };
        block.push(row);
        block
    }

    fn push(&mut self, row: Row) {
        if self.geodetic && row.estimate.len() == 3 {
            self.travel(&row);
        }
        if !row.error.is_empty() {
            self.compared = Some(row.clone());
        }
        self.last = row.clone();
        self.rows.push(row);
    }

    fn travel(&mut self, row: &Row) {
        let [north, east, _] = displacement(&row.estimate, &self.last.estimate);
        self.travelled.estimate += north.hypot(east);
        if let [e_north, e_east, _] = row.error[..] {
            self.travelled.squares.0 += e_north * e_north + e_east * e_east;
            self.travelled.squares.1 += 1;
            if let Some(before) = self.compared.as_ref() {
                let [north, east, _] = displacement(&row.estimate, &before.estimate);
                let north = north - (e_north - before.error[0]);
                self.travelled.truth += north.hypot(east - (e_east - before.error[1]));
            }
        }
    }

    /// The rows, and the last estimate.
    pub fn shown(&self) -> impl Iterator<Item = &Row> + Clone {
        let more = self.rows.rows().last().is_some_and(|r| r.time < self.last.time);
        self.rows.rows().iter().chain(more.then_some(&self.last))
    }

    /// Whether the filter says how good it is: not of a block that is held fixed.
    pub fn uncertain(&self) -> bool {
        self.mode != Mode::Fixed
    }

    /// `owner.name component`.
    pub fn component(&self, k: usize) -> String {
        match self.components.len() {
            1 => self.name.clone(),
            _ => format!("{} {}", self.name, self.axis(k)),
        }
    }

    /// The name of a component of sigma and error.
    pub fn axis(&self, k: usize) -> &str {
        if self.geodetic {
            ["north", "east", "down"][k]
        } else {
            self.components.get(k).map_or("", String::as_str)
        }
    }

    /// Whether its true value does not move, as that of a calibration; where no truth is known, whether the estimate stays
    /// where 10 prior sigmas could have it.
    pub fn constant(&self) -> bool {
        if self.geodetic {
            return false;
        }
        let range = |values: &mut dyn Iterator<Item = f64>| {
            let (low, high) =
                values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
            (low <= high).then(|| (high - low, low.abs().max(high.abs())))
        };
        (0..self.components.len()).all(|k| {
            let truth = &mut self
                .shown()
                .filter(|r| !r.error.is_empty())
                .map(|r| r.estimate[k] - r.error[k]);
            match range(truth) {
                Some((range, size)) => range <= 1e-9 * size.max(1e-3 * self.first.sigma[k]),
                None => range(&mut self.shown().map(|r| r.estimate[k]))
                    .is_none_or(|(range, _)| range <= 10.0 * self.first.sigma[k]),
            }
        })
    }
}

/// North, east and down metres from one position to another: latitude and longitude in deg, height in m.
pub(crate) fn displacement(to: &[f64], from: &[f64]) -> [f64; 3] {
    let place = |p: &[f64]| match *p {
        [latitude, longitude, height] => Some(Geodetic {
            latitude: latitude.to_radians(),
            longitude: longitude.to_radians(),
            height,
        }),
        _ => None,
    };
    place(to).zip(place(from)).map_or([f64::NAN; 3], |(to, from)| to.ned_from(&from).into())
}
