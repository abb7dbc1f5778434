//! History of a run: counts of everything, and series of a bounded length.

use crate::residuals::Residuals;
pub(crate) use crate::row::{Row, displacement};
use crate::sensors::{Consistency, Envelope, Innovation, SensorHistory};
use navfuse_core::model::record::finding::Finding;
use navfuse_core::model::record::health::{Health, Judged, Judgement};
use navfuse_core::model::record::verdict::Verdict;
use navfuse_core::model::record::{Corrected, Derived, Event, Level, Outcome, Rejection};
use navfuse_core::model::sensor::Purpose;
use navfuse_core::smooth::SMOOTHER;
use navfuse_core::state::Mode;
use navfuse_core::units::sample::Sample;
use navfuse_core::units::thin::Thin;
use navfuse_core::units::time::Time;
use navfuse_diagnose::Sensitivity;

/// Largest number of recorded events of each level.
const EVENTS: usize = 500;

/// History of one run. A [`crate::Recorder`] collects it during the run, and [`crate::read_log`]
/// from the log, with the same result.
#[derive(Clone, Debug, Default)]
pub struct RunHistory {
    /// Name of the scenario.
    pub name: String,
    /// Version of the program that ran the scenario.
    pub version: String,
    /// Scenario in TOML, as it was run.
    pub scenario: String,
    /// Description of the scenario.
    pub description: Option<String>,
    /// Seed of a run whose samples are simulated.
    pub seed: Option<u64>,
    /// Blocks of the state.
    pub blocks: Vec<BlockHistory>,
    /// Sensors, in the order of their ids.
    pub sensors: Vec<SensorHistory>,
    /// First events of each level.
    pub events: Vec<Event>,
    /// First findings.
    pub findings: Vec<Finding>,
    /// Last value of each derived quantity.
    pub derived: Vec<Derived>,
    /// Number of further events.
    pub events_left_out: u64,
    /// Verdict of the run; none in a log that was cut off or that an earlier version wrote.
    pub verdict: Option<Verdict>,
    /// Warnings about the history itself, such as a truncated log.
    pub warnings: Vec<String>,
    /// What the end would move by if each unmodelled thing had its usual size, if that was computed.
    pub sensitivity: Option<Sensitivity>,
    /// The filter's own estimates of blocks that have no smoothed estimate yet.
    pub(crate) waiting: Vec<(String, Filtered)>,
}

/// History of a block.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockHistory {
    /// Full name, such as `dvl.scale`.
    pub name: String,
    /// Treatment by the filter: estimated, considered or fixed.
    pub mode: Mode,
    /// Names of the components.
    pub components: Vec<String>,
    /// Unit of sigma and error, and of the estimate unless it is a position; empty for a ratio.
    pub unit: String,
    /// Set for a position: the estimate is latitude and longitude (deg) and height (m), sigma and
    /// error are north, east, down (m).
    pub geodetic: bool,
    /// Estimates over time; a row represents several epochs by one of them.
    pub rows: Thin<Row>,
    /// First estimate; the prior, if the filter starts from a reference.
    pub first: Row,
    /// Last estimate.
    pub last: Row,
    /// Estimate of a fixed block that was found to be wrong.
    pub corrected: Option<Corrected>,
    /// The filter's own estimates, if the run is smoothed.
    pub filtered: Option<Filtered>,
    /// Last estimate with a known truth.
    pub compared: Option<Row>,
    /// Path length of a position.
    pub travelled: Travelled,
    /// Sum of the squared errors of each component over all epochs with a known truth, and the
    /// number of these epochs.
    pub squares: (Vec<f64>, u64),
}

/// The filter's own estimates of a block in a run that is smoothed.
#[derive(Clone, Debug, PartialEq)]
pub struct Filtered {
    /// First estimate; the prior, if the filter starts from a reference.
    pub first: Row,
    /// Last estimate.
    pub last: Row,
    /// Estimates over time, as [`BlockHistory::rows`].
    pub rows: Thin<Row>,
}

impl Filtered {
    fn new(row: Row) -> Self {
        let mut new = Self { first: row.clone(), last: row.clone(), rows: Thin::default() };
        new.rows.push(row);
        new
    }

    fn push(&mut self, row: Row) {
        self.last = row.clone();
        self.rows.push(row);
    }
}

/// Horizontal path lengths and errors over all epochs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Travelled {
    /// Path length of the estimate, m.
    pub estimate: f64,
    /// Path length of the truth, where it is known, m.
    pub truth: f64,
    /// Sum of squared horizontal errors, m^2, and their number.
    pub squares: (f64, u64),
}

/// Description of a block before its first estimate.
#[derive(Clone, Copy, Debug)]
pub struct BlockInfo<'a, C> {
    pub name: &'a str,
    pub mode: Mode,
    pub components: C,
    pub unit: &'a str,
    pub geodetic: bool,
}

/// Outcome of a sample.
#[derive(Clone, Copy, Debug)]
pub enum Fate<'a> {
    Accepted,
    /// It placed a block, and has no innovation.
    Placed,
    Gated,
    Rejected(&'a str),
}

impl RunHistory {
    /// Returns the times of the first and the last estimate, s.
    pub fn span(&self) -> Option<[f64; 2]> {
        let first = self.blocks.first()?;
        Some([first.first.time, first.last.time])
    }

    /// Returns `true` for a run that is smoothed.
    pub fn is_smoothed(&self) -> bool {
        self.blocks.iter().any(|b| b.filtered.is_some())
    }

    /// Returns the position block.
    pub fn position(&self) -> Option<&BlockHistory> {
        self.blocks.iter().find(|b| b.geodetic)
    }

    /// Returns the attitude of the vehicle: roll, pitch and yaw beside the position.
    pub fn attitude(&self) -> Option<&BlockHistory> {
        let owner = |b: &BlockHistory| b.name.rsplit_once('.').map(|(owner, _)| owner.to_owned());
        let vehicle = owner(self.position()?);
        let angles = |b: &&BlockHistory| b.components == ["roll", "pitch", "yaw"];
        self.blocks.iter().filter(angles).find(|b| owner(b) == vehicle)
    }

    /// Finds a block by its name.
    pub fn block(&self, name: &str) -> Option<&BlockHistory> {
        self.blocks.iter().find(|b| b.name == name)
    }

    /// Finds a sensor by its name.
    pub fn sensor(&self, name: &str) -> Option<&SensorHistory> {
        self.sensors.iter().find(|s| s.name == name)
    }

    /// Adds an estimate of a block; the first estimate adds the block.
    pub(crate) fn state<'c, C: Iterator<Item = &'c str>>(
        &mut self,
        info: BlockInfo<'_, C>,
        row: Row,
    ) {
        match self.blocks.iter_mut().find(|b| b.name == info.name) {
            Some(block) => block.push(row),
            None => {
                let found = self.waiting.iter().position(|(name, _)| name == info.name);
                let filtered = found.map(|k| self.waiting.swap_remove(k).1);
                self.blocks.push(BlockHistory { filtered, ..BlockHistory::new(info, row) });
            }
        }
    }

    /// Adds the filter's own estimate of a block in a run that is smoothed. The first ones come
    /// before the block's first smoothed estimate.
    pub(crate) fn filtered(&mut self, name: &str, row: Row) {
        let known = match self.blocks.iter_mut().find(|b| b.name == name) {
            Some(block) => block.filtered.as_mut(),
            None => self.waiting.iter_mut().find(|(of, _)| of == name).map(|(_, f)| f),
        };
        match known {
            Some(filtered) => filtered.push(row),
            None => self.waiting.push((name.to_owned(), Filtered::new(row))),
        }
    }

    /// Notes the time of an estimate, and with it which sensors are silent.
    pub(crate) fn tick(&mut self, now: Time) {
        let known = self.sensors.iter_mut().filter(|s| s.purpose != Some(Purpose::Reference));
        known.for_each(|sensor| sensor.health.tick(now));
    }

    /// Adds a sample.
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
        if sensor.purpose == Some(Purpose::Input) {
            sensor.health.sample(sample.time);
        }
        sensor.samples.push(Envelope {
            time: sample.time.seconds(),
            low: values.clone(),
            high: values,
        });
    }

    /// Adds the outcome of a sample, with the innovation and its 1-sigma of the channels that are
    /// present.
    pub(crate) fn update(
        &mut self,
        sensor: usize,
        time: Time,
        fate: Fate<'_>,
        nis: f64,
        threshold: f64,
        channels: impl Iterator<Item = (usize, f64, f64)>,
    ) {
        let Some(sensor) = self.sensors.get_mut(sensor) else { return };
        let count = sensor.channels.len();
        let at = time;
        let time = time.seconds();
        let (innovation, sigma) = (vec![f64::NAN; count], vec![f64::NAN; count]);
        let mut row = Innovation { time, innovation, sigma, nis, threshold };
        let (mut freedom, mut present) = (0.0, 0_u16);
        for (k, innovation, sigma) in channels {
            // a constraint has innovations, and samples without a channel
            if k < count {
                (row.innovation[k], row.sigma[k]) = (innovation, sigma);
            }
            freedom += 1.0;
            present |= 1_u16.checked_shl(k as u32).unwrap_or(0);
        }
        // a sample without an innovation is one whole sample
        let present = if present == 0 { u16::MAX } else { present };
        let health = match fate {
            Fate::Accepted | Fate::Placed => Health::Used,
            Fate::Gated => Health::Gated,
            Fate::Rejected(why) if why == Rejection::Isolated.reason(&[""]) => Health::Isolated,
            Fate::Rejected(_) => Health::Rejected,
        };
        let channels = freedom as usize;
        let innovation =
            matches!(fate, Fate::Accepted).then_some(Judgement { channels, nis, threshold });
        sensor.health.update(&Judged { time: at, health, present, innovation });
        let updates = &mut sensor.updates;
        if matches!(fate, Fate::Accepted | Fate::Gated) {
            updates.residuals.resize_with(count, Residuals::default);
            let normalised = row.innovation.iter().zip(&row.sigma).map(|(z, sigma)| z / sigma);
            updates.residuals.iter_mut().zip(normalised).for_each(|(all, z)| all.push(z));
        }
        match health {
            Health::Used if matches!(fate, Fate::Accepted) => {
                updates.in_part.add(at, Outcome::Accepted)
            }
            Health::Gated | Health::Isolated => updates.in_part.add(at, Outcome::Gated),
            _ => {}
        }
        match fate {
            Fate::Accepted => {
                updates.outcomes.accepted += 1;
                updates.nis = [updates.nis[0] + nis, updates.nis[1] + freedom];
                updates.consistency.push(Consistency { span: [time; 2], nis, expected: freedom });
                updates.innovations.push(row);
            }
            Fate::Placed => updates.outcomes.placed += 1,
            Fate::Gated => {
                updates.outcomes.gated += 1;
                updates.outliers.push(row);
            }
            Fate::Rejected(why) => updates.outcomes.reject(why.to_owned()),
        }
    }

    /// Adds a rejected sample of a driving sensor.
    pub(crate) fn input_rejection(&mut self, sensor: usize, time: Time, why: &str) {
        if let Some(sensor) = self.sensors.get_mut(sensor) {
            sensor.updates.outcomes.reject(why.to_owned());
            sensor.health.reject(time);
        }
    }

    /// Adds an event.
    pub(crate) fn event(&mut self, event: &Event) {
        if self.events.iter().filter(|e| e.level == event.level).count() < EVENTS {
            self.events.push(event.clone());
        } else {
            self.events_left_out += 1;
        }
    }

    /// Adds a finding.
    pub(crate) fn finding(&mut self, finding: &Finding) {
        let sensors = self.sensors.iter_mut().filter(|s| finding.is_about(&s.name));
        sensors.for_each(|sensor| sensor.health.doubt(finding));
        if self.findings.len() < EVENTS {
            self.findings.push(finding.clone());
        }
    }

    /// Adds a value of a derived quantity.
    pub(crate) fn derived(&mut self, derived: &Derived) {
        if let Some(corrected) = Corrected::read(derived) {
            let block = self.blocks.iter_mut().find(|block| block.name == corrected.block);
            block.into_iter().for_each(|block| block.corrected = Some(corrected.clone()));
            return;
        }
        match self.derived.iter_mut().find(|known| known.name == derived.name) {
            Some(known) => known.clone_from(derived),
            None => self.derived.push(derived.clone()),
        }
    }

    /// Returns what the smoother reports about the run; nothing if the run is not smoothed.
    pub fn smoothed(&self) -> impl Iterator<Item = &Event> {
        self.events.iter().filter(|event| event.about == SMOOTHER)
    }

    /// Returns the highest level of all events.
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
            corrected: None,
            filtered: None,
            compared: None,
            travelled: Travelled::default(),
            squares: (vec![0.0; row.estimate.len()], 0),
        };
        block.push(row);
        block
    }

    /// A block with one component and one estimate.
    #[cfg(test)]
    pub(crate) fn of_row(name: &str, unit: &str, row: Row) -> Self {
        let (mode, components) = (Mode::Estimate, [name].into_iter());
        Self::new(BlockInfo { name, mode, components, unit, geodetic: false }, row)
    }

    fn push(&mut self, row: Row) {
        if self.geodetic && row.estimate.len() == 3 {
            self.travel(&row);
        }
        if !row.error.is_empty() {
            self.squares.0.iter_mut().zip(&row.error).for_each(|(sum, e)| *sum += e * e);
            self.squares.1 += 1;
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

    /// Iterates over the rows and the last estimate.
    pub fn shown(&self) -> impl Iterator<Item = &Row> + Clone {
        let more = self.rows.rows().last().is_some_and(|r| r.time < self.last.time);
        self.rows.rows().iter().chain(more.then_some(&self.last))
    }

    /// Returns `true` if the filter has an uncertainty of the block; a fixed block has none.
    pub fn uncertain(&self) -> bool {
        self.mode != Mode::Fixed
    }

    /// Returns what was known before the run: the first estimate, and in a run that is smoothed the
    /// filter's own one, since the first smoothed estimate knows the whole run.
    pub fn prior(&self) -> &Row {
        self.filtered.as_ref().map_or(&self.first, |filtered| &filtered.first)
    }

    /// Returns the full name of a component: `owner.name component`.
    pub fn component(&self, k: usize) -> String {
        match self.components.len() {
            1 => self.name.clone(),
            _ => format!("{} {}", self.name, self.axis(k)),
        }
    }

    /// Returns the name of a component of sigma and error.
    pub fn axis(&self, k: usize) -> &str {
        if self.geodetic {
            ["north", "east", "down"][k]
        } else {
            self.components.get(k).map_or("", String::as_str)
        }
    }

    /// Returns `true` if the true value is constant, as for a calibration. Without a truth, the
    /// block counts as constant if its estimate stays within 10 prior sigmas.
    pub fn constant(&self) -> bool {
        if self.geodetic {
            return false;
        }
        let prior = self.prior();
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
                Some((range, size)) => range <= 1e-9 * size.max(1e-3 * prior.sigma[k]),
                None => range(&mut self.shown().map(|r| r.estimate[k]))
                    .is_none_or(|(range, _)| range <= 10.0 * prior.sigma[k]),
            }
        })
    }
}
