//! Health of the sensors over time: one lane for each sensor, and the stretches in which it was
//! not used.

use crate::recording::Recording;
use crate::style::{Colour, GATED, REJECTED, path};
use navfuse_core::model::chi_square::{gated_moments, outside};
use navfuse_core::model::record::{InputRejection, Outcome, Outcomes, UpdateRecord};
use navfuse_core::model::sensor::{Purpose, SensorInfo};
use navfuse_core::model::stream::StreamError;
use navfuse_core::units::rhythm::Rhythm;
use navfuse_core::units::time::{Span, Time};
use re_sdk::EntityPath;
use re_sdk_types::archetypes::{Scalars, SeriesLines, StateChange, StateConfiguration};
use re_sdk_types::components::Color;
use std::collections::VecDeque;

/// Number of latest samples whose majority is the health of a sensor: a single outlier does not
/// interrupt the lane.
const MAJORITY: usize = 9;
/// Number of latest accepted samples whose NIS is judged together.
const NIS_WINDOW: usize = 25;
/// Probability at which a consistent sensor appears as too noisy: once in a million windows.
const NIS_ALPHA: f64 = 1e-6;
/// Least excess of the NIS over its expectation that is shown, whatever its significance.
const NIS_EXCESS: f64 = 1.5;

/// Width of the line of a sensor while the run goes on.
const THICK: f32 = 10.0;

/// Health of a sensor at one time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Health {
    /// Most samples correct the state.
    Used,
    /// The samples correct the state, but their innovations are too large for their sigma.
    Noisy,
    /// The samples correct the state, although the filter or a monitor found a fault of the sensor.
    Doubted,
    /// Most samples are outside the gate.
    Gated,
    /// Most samples are rejected before the gate.
    Rejected,
    /// No samples arrive.
    Silent,
}

impl Health {
    /// All values.
    pub const ALL: [Self; 6] =
        [Self::Used, Self::Noisy, Self::Doubted, Self::Gated, Self::Rejected, Self::Silent];

    /// Word in the lane.
    pub fn word(self) -> &'static str {
        match self {
            Self::Used => "used",
            Self::Noisy => "NIS too large",
            Self::Doubted => "doubted",
            Self::Gated => "gated",
            Self::Rejected => "rejected",
            Self::Silent => "silent",
        }
    }

    /// Colour in the lane: distinct for the colour-blind too, and the one of the marks in the
    /// plots.
    pub fn colour(self) -> Colour {
        match self {
            Self::Used => [0, 158, 115],
            Self::Noisy => [240, 228, 66],
            Self::Doubted => [86, 180, 233],
            Self::Gated => GATED,
            Self::Rejected => REJECTED[0],
            Self::Silent => [96, 100, 108],
        }
    }
}

/// Span of time with the same health.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// Health.
    pub health: Health,
    /// Begin.
    pub from: Time,
    /// End.
    pub to: Time,
}

/// Lane of one sensor.
pub struct Lane {
    /// Name of the sensor.
    pub name: String,
    /// Entity of the lane.
    pub path: EntityPath,
    /// Set for a sensor that corrects the state.
    pub measures: bool,
    /// Numbers of samples by outcome.
    pub outcomes: Outcomes,
    /// Samples that reached the gate, and gated ones, while the vehicle turned.
    pub in_turns: [u64; 2],
    /// Finished stretches.
    pub stretches: Vec<Stretch>,
    current: Option<(Health, Time)>,
    /// Set by the first finding about the sensor.
    doubted: bool,
    latest: VecDeque<(Time, Health)>,
    nis: VecDeque<[f64; 3]>,
    moments: (usize, f64, [f64; 2]),
    rhythm: Rhythm,
    last: Option<Time>,
    /// Time and channels of the last update.
    part: Option<(Time, u16)>,
}

impl Lane {
    /// The lane of a sensor; `None` for a reference.
    pub fn new(info: &SensorInfo) -> Option<Self> {
        (info.purpose != Purpose::Reference).then(|| Self {
            name: info.name.clone(),
            path: path(&["health", &info.name]),
            measures: info.purpose == Purpose::Measurement,
            outcomes: Outcomes::default(),
            in_turns: [0; 2],
            stretches: Vec::new(),
            current: None,
            doubted: false,
            latest: VecDeque::with_capacity(MAJORITY),
            nis: VecDeque::with_capacity(NIS_WINDOW),
            moments: (0, f64::NAN, [0.0; 2]),
            rhythm: Rhythm::default(),
            last: None,
            part: None,
        })
    }

    /// Set where a finding or a reason is about the sensor or one of its states: `dvl.scale`.
    pub fn is_meant_by(&self, about: &str) -> bool {
        about.split(['.', ' ']).next() == Some(&self.name)
    }

    /// Writes the colours of the lane.
    pub fn start(&self, recording: &Recording) -> Result<(), StreamError> {
        let colours = Health::ALL.map(|h| {
            let [r, g, b] = h.colour();
            Color::from_rgb(r, g, b)
        });
        let look = StateConfiguration::new()
            .with_values(Health::ALL.map(Health::word))
            .with_colors(colours);
        recording.log_static(&self.path, &look)
    }

    /// Sends the present health to the viewers that watch, as a point of the `k`-th thick line: their
    /// lanes do not follow the cursor.
    pub fn show(&self, recording: &Recording, k: usize, now: Time) -> Result<(), StreamError> {
        let Some((health, _)) = self.current else { return Ok(()) };
        let entity = path(&["live", "health", &self.name]);
        let level = k as f64 + 1.0;
        let look = SeriesLines::update_fields()
            .with_names([format!("{level} {}", self.name)])
            .with_widths([THICK]);
        recording.log_static_to_viewers(&entity, &look)?;
        let colour = SeriesLines::update_fields().with_colors([health.colour()]);
        let point =
            Scalars::single(level).columns_of_unit_batches().map_err(|e| recording.error(e))?;
        let colour = colour.columns_of_unit_batches().map_err(|e| recording.error(e))?;
        recording.columns_to_viewers(&entity, &[now.nanos()], point.chain(colour))
    }

    /// Notes the time, and with it a silence. The first call begins the lane.
    pub fn tick(&mut self, recording: &Recording, now: Time) -> Result<(), StreamError> {
        match (self.current, self.last) {
            (None, None) => self.change(recording, Health::Silent, now),
            (Some((health, _)), Some(last)) if health != Health::Silent => {
                let Some(usual) = self.rhythm.usual() else { return Ok(()) };
                if now.since(last) <= self.rhythm.patience() {
                    return Ok(());
                }
                self.latest.clear();
                self.change(recording, Health::Silent, after(last, usual))
            }
            _ => Ok(()),
        }
    }

    /// Adds a sample of a driving sensor.
    pub fn sample(&mut self, recording: &Recording, time: Time) -> Result<(), StreamError> {
        if self.measures {
            return Ok(());
        }
        self.outcomes.accepted += 1;
        self.judge(recording, time, Health::Used)
    }

    /// Takes a finding about the sensor: from its time on the sensor is doubted where it is used.
    pub fn doubt(&mut self, recording: &Recording, time: Time) -> Result<(), StreamError> {
        self.doubted = true;
        match self.current {
            Some((Health::Used | Health::Noisy, from)) => {
                self.change(recording, Health::Doubted, time.max(from))
            }
            _ => Ok(()),
        }
    }

    /// Takes back a sample of a driving sensor, which the filter rejected.
    pub fn reject(
        &mut self,
        recording: &Recording,
        rejection: &InputRejection,
    ) -> Result<(), StreamError> {
        self.outcomes.accepted = self.outcomes.accepted.saturating_sub(1);
        self.outcomes.reject(rejection.reason);
        if self.latest.back().is_some_and(|latest| latest.0 == rejection.time) {
            self.latest.pop_back();
        }
        self.follow(recording, rejection.time, Health::Rejected)
    }

    /// Adds the outcome of a sample; `turning` while the vehicle turns.
    pub fn update(
        &mut self,
        recording: &Recording,
        update: &UpdateRecord<'_>,
        turning: bool,
    ) -> Result<(), StreamError> {
        if turning && !matches!(update.outcome, Outcome::Rejected(_)) {
            self.in_turns[0] += 1;
            self.in_turns[1] += u64::from(update.outcome == Outcome::Gated);
        }
        self.outcomes.add(update.outcome);
        let health = match update.outcome {
            Outcome::Accepted => self.consistent(update),
            Outcome::Placed => Health::Used,
            Outcome::Gated => Health::Gated,
            Outcome::Rejected(_) => Health::Rejected,
        };
        if self.is_part(update) {
            // of a sample in parts the worst one counts
            match self.latest.back() {
                Some((_, Health::Gated | Health::Rejected)) => return Ok(()),
                _ => drop(self.latest.pop_back()),
            }
        }
        self.judge(recording, update.time, health)
    }

    /// Returns `true` for a further part of a sample, which has channels of its own: the filter
    /// uses the groups of channels that pass the gate.
    fn is_part(&mut self, update: &UpdateRecord<'_>) -> bool {
        let before = self.part.replace((update.time, update.present));
        before.is_some_and(|(time, present)| time == update.time && present & update.present == 0)
    }

    /// Ends the last stretch.
    pub fn finish(&mut self, end: Time) {
        if let Some((health, from)) = self.current.take() {
            self.stretches.push(Stretch { health, from, to: end.max(from) });
        }
    }

    /// Judges the NIS of the latest accepted samples against its expectation behind the gate.
    fn consistent(&mut self, update: &UpdateRecord<'_>) -> Health {
        let m = update.innovation.len();
        if (self.moments.0, self.moments.1.to_bits()) != (m, update.threshold.to_bits()) {
            let (mean, variance) = gated_moments(m, update.threshold);
            self.moments = (m, update.threshold, [mean, variance]);
        }
        if self.nis.len() == NIS_WINDOW {
            self.nis.pop_front();
        }
        let [mean, variance] = self.moments.2;
        self.nis.push_back([update.nis, mean, variance]);
        let [sum, mean, variance] =
            self.nis.iter().fold([0.0; 3], |a, b| std::array::from_fn(|k| a[k] + b[k]));
        let noisy = self.nis.len() == NIS_WINDOW
            && sum > NIS_EXCESS * mean
            && outside(sum, mean, variance, NIS_ALPHA);
        if noisy { Health::Noisy } else { Health::Used }
    }

    /// Takes the health of a sample that arrives.
    fn judge(
        &mut self,
        recording: &Recording,
        time: Time,
        health: Health,
    ) -> Result<(), StreamError> {
        self.tick(recording, time)?;
        if let Some(last) = self.last {
            self.rhythm.take(time.since(last));
        }
        self.last = Some(time);
        self.follow(recording, time, health)
    }

    /// Lets the lane follow the majority of the latest samples, of which this is one.
    fn follow(
        &mut self,
        recording: &Recording,
        time: Time,
        health: Health,
    ) -> Result<(), StreamError> {
        let health = match health {
            Health::Used | Health::Noisy if self.doubted => Health::Doubted,
            other => other,
        };
        if self.latest.len() == MAJORITY {
            self.latest.pop_front();
        }
        self.latest.push_back((time, health));
        let same = || self.latest.iter().filter(|l| l.1 == health);
        let shown = self.current.map(|c| c.0);
        // after a silence the first sample counts alone
        if shown != Some(health) && 2 * same().count() > self.latest.len() {
            let begun = same().next().map_or(time, |l| l.0);
            let begun = self.current.map_or(begun, |c| begun.max(c.1));
            self.change(recording, health, begun)?;
        }
        Ok(())
    }

    fn change(
        &mut self,
        recording: &Recording,
        health: Health,
        at: Time,
    ) -> Result<(), StreamError> {
        if let Some((before, from)) = self.current.replace((health, at)) {
            self.stretches.push(Stretch { health: before, from, to: at });
        }
        recording.log(&self.path, at.nanos(), &StateChange::single(health.word()))
    }
}

/// The time that many seconds later.
fn after(time: Time, seconds: f64) -> Time {
    time + Span::from_nanos((seconds * 1e9) as i64)
}
