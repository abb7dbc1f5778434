//! Health of the sensors over time: one lane for each sensor, and the stretches in which it was
//! not used.

use crate::model::chi_square::outside;
use crate::model::record::finding::{Basis, Finding, Severity};
use crate::model::record::latest::{LATEST, Latest, Sums};
use crate::model::record::{Outcome, Rejection, UpdateRecord};
use crate::units::rhythm::Rhythm;
use crate::units::time::{Span, Time};
use std::collections::VecDeque;

/// Number of latest samples whose majority is the health of a sensor: a single outlier does not
/// interrupt the lane.
const MAJORITY: usize = 9;
/// Shortest silence at the begin of a lane, s: until then its first sample is waited for.
const FIRST_SILENCE: f64 = 5.0;
/// Probability at which a consistent sensor appears as too noisy: once in a million windows.
const NIS_ALPHA: f64 = 1e-6;
/// Least excess of the NIS over its expectation that is shown, whatever its significance.
const NIS_EXCESS: f64 = 1.5;
/// Probability, in both directions, beyond which the NIS of a window does not agree: one consistent
/// window in twenty is that large.
const AGREES_ALPHA: f64 = 0.1;

/// Health of a sensor at one time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Health {
    /// Most samples correct the state.
    Used,
    /// The samples correct the state, but their innovations are too large for their sigma.
    Noisy,
    /// The samples correct the state, although the filter or a monitor found a fault of the sensor,
    /// after which they have not agreed with the filter yet.
    Doubted,
    /// Most samples are outside the gate.
    Gated,
    /// Most samples are rejected before the gate.
    Rejected,
    /// The sensor is isolated: the filter judges its samples and uses none.
    Isolated,
    /// No samples arrive.
    Silent,
}

impl Health {
    /// All values.
    pub const ALL: [Self; 7] = [
        Self::Used,
        Self::Noisy,
        Self::Doubted,
        Self::Gated,
        Self::Rejected,
        Self::Isolated,
        Self::Silent,
    ];

    /// Health that an outcome shows.
    pub fn of(outcome: Outcome) -> Self {
        match outcome {
            Outcome::Accepted | Outcome::Placed => Self::Used,
            Outcome::Gated => Self::Gated,
            Outcome::Rejected(Rejection::Isolated) => Self::Isolated,
            Outcome::Rejected(_) => Self::Rejected,
        }
    }

    /// Returns `true` if the filter refuses the samples.
    pub fn refuses(self) -> bool {
        matches!(self, Self::Gated | Self::Rejected | Self::Isolated)
    }

    /// Word in the lane.
    pub fn word(self) -> &'static str {
        match self {
            Self::Used => "used",
            Self::Noisy => "NIS too large",
            Self::Doubted => "doubted",
            Self::Gated => "gated",
            Self::Rejected => "rejected",
            Self::Isolated => "isolated",
            Self::Silent => "silent",
        }
    }

    /// Colour, red, green and blue: distinct for the colour-blind too.
    pub fn colour(self) -> [u8; 3] {
        match self {
            Self::Used => [0, 158, 115],
            Self::Noisy => [240, 228, 66],
            Self::Doubted => [86, 180, 233],
            Self::Gated => [255, 0, 200],
            Self::Rejected => [213, 94, 0],
            Self::Isolated => [160, 20, 60],
            Self::Silent => [186, 190, 198],
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

/// A sample that the filter judged.
#[derive(Clone, Copy, Debug)]
pub struct Judged {
    /// Time of the sample.
    pub time: Time,
    /// What became of the sample.
    pub health: Health,
    /// Bit `k` is set for a channel that the sample has.
    pub present: u16,
    /// Innovation of an accepted sample.
    pub innovation: Option<Judgement>,
}

/// Innovation of a sample.
#[derive(Clone, Copy, Debug)]
pub struct Judgement {
    /// Number of its channels.
    pub channels: usize,
    /// Normalised innovation squared.
    pub nis: f64,
    /// Threshold of the gate; infinite without a gate.
    pub threshold: f64,
}

impl From<&UpdateRecord<'_>> for Judged {
    fn from(update: &UpdateRecord<'_>) -> Self {
        // a placed sample has no innovation
        let innovation = (update.outcome == Outcome::Accepted).then_some(Judgement {
            channels: update.innovation.len(),
            nis: update.nis,
            threshold: update.threshold,
        });
        let health = Health::of(update.outcome);
        Self { time: update.time, health, present: update.present, innovation }
    }
}

/// Doubt of a sensor with a fault.
#[derive(Clone, Copy, Debug)]
struct Doubt {
    /// Set where no later sample removes the doubt.
    lasts: bool,
    /// Number of accepted samples since the fault was found, or since a sample was refused.
    accepted: usize,
}

/// Lane of one sensor.
#[derive(Clone, Debug, Default)]
pub struct Lane {
    /// Finished stretches.
    pub stretches: Vec<Stretch>,
    current: Option<(Health, Time)>,
    /// Time of the first call.
    first: Option<Time>,
    /// Time of the first finding about the sensor.
    doubted: Option<Time>,
    doubt: Option<Doubt>,
    latest: VecDeque<(Time, Health)>,
    nis: Latest,
    rhythm: Rhythm,
    last: Option<Time>,
    /// Time and channels of the last update.
    part: Option<(Time, u16)>,
}

impl Lane {
    /// Health at present and its begin; `None` before the first time.
    pub fn current(&self) -> Option<(Health, Time)> {
        self.current
    }

    /// Time of the first finding about the sensor.
    pub fn doubted(&self) -> Option<Time> {
        self.doubted
    }

    /// Mean NIS of the latest used samples, at most 25, and its expectation.
    pub fn nis(&self) -> Option<[f64; 2]> {
        let sums = self.nis.sums();
        let count = sums.count as f64;
        (sums.count > 0).then(|| [sums.nis / count, sums.mean / count])
    }

    /// Health and begin of all stretches but the first ones, the present one included.
    pub fn begun(&self, first: usize) -> impl Iterator<Item = (Health, Time)> + '_ {
        let more = self.stretches.get(first..).unwrap_or_default();
        let current = self.current.filter(|_| first <= self.stretches.len());
        more.iter().map(|s| (s.health, s.from)).chain(current)
    }

    /// Notes the time, and with it a silence. The lane begins with its first sample, or with a silence from
    /// the first call on.
    pub fn tick(&mut self, now: Time) {
        match (self.current, self.last) {
            (None, None) => {
                let first = *self.first.get_or_insert(now);
                if now.since(first) >= FIRST_SILENCE {
                    self.change(Health::Silent, first);
                }
            }
            (Some((health, _)), Some(last)) if health != Health::Silent => {
                let Some(usual) = self.rhythm.usual() else { return };
                if now.since(last) > self.rhythm.patience() {
                    self.latest.clear();
                    self.change(Health::Silent, after(last, usual));
                }
            }
            _ => {}
        }
    }

    /// Adds a sample of a driving sensor.
    pub fn sample(&mut self, time: Time) {
        self.judge(time, Health::Used);
    }

    /// Takes a finding about the sensor: from its time on the sensor is doubted where it is used.
    ///
    /// A fault that was contained is doubted until the latest 25 samples agree with the filter, of which
    /// none was refused. A sensor without innovations, such as a driving one, shows no agreement. A note
    /// is no doubt, and neither is what follows a silence: the filter was off.
    pub fn doubt(&mut self, finding: &Finding) {
        let Finding { time, severity, basis, .. } = *finding;
        if severity == Severity::Note || basis == Basis::Silence {
            return;
        }
        self.doubted.get_or_insert(time);
        let lasts = severity > Severity::Contained || self.doubt.is_some_and(|doubt| doubt.lasts);
        self.doubt = Some(Doubt { lasts, accepted: 0 });
        if let Some((Health::Used | Health::Noisy, from)) = self.current {
            self.change(Health::Doubted, time.max(from));
        }
    }

    /// Takes back a sample of a driving sensor, which the filter rejected.
    pub fn reject(&mut self, time: Time) {
        if self.latest.back().is_some_and(|latest| latest.0 == time) {
            self.latest.pop_back();
        }
        self.follow(time, Health::Rejected);
    }

    /// Adds a sample that the filter judged.
    pub fn update(&mut self, update: &Judged) {
        let health = match &update.innovation {
            Some(innovation) => self.consistent(innovation),
            None => update.health,
        };
        if let Some(doubt) = self.doubt.as_mut().filter(|_| health.refuses()) {
            doubt.accepted = 0;
        }
        if self.is_part(update) {
            // of a sample in parts the worst one counts
            match self.latest.back() {
                Some((_, before)) if before.refuses() => return,
                _ => drop(self.latest.pop_back()),
            }
        }
        self.judge(update.time, health);
    }

    /// Returns `true` for a further part of a sample, which has channels of its own: the filter
    /// uses the groups of channels that pass the gate.
    fn is_part(&mut self, update: &Judged) -> bool {
        let before = self.part.replace((update.time, update.present));
        before.is_some_and(|(time, present)| time == update.time && present & update.present == 0)
    }

    /// Ends the last stretch.
    pub fn finish(&mut self, end: Time) {
        if self.last.is_none() {
            self.current = self.current.or(self.first.map(|first| (Health::Silent, first)));
        }
        if let Some((health, from)) = self.current.take() {
            self.stretches.push(Stretch { health, from, to: end.max(from) });
        }
    }

    /// Judges the NIS of the latest accepted samples against its expectation behind the gate.
    fn consistent(&mut self, innovation: &Judgement) -> Health {
        let latest = self.nis.take(innovation);
        self.agree(&latest);
        let noisy = latest.count == LATEST
            && latest.nis > NIS_EXCESS * latest.mean
            && outside(latest.nis, latest.mean, latest.variance, NIS_ALPHA);
        if noisy { Health::Noisy } else { Health::Used }
    }

    /// Ends the doubt of a contained fault if the latest accepted samples agree with the filter.
    fn agree(&mut self, latest: &Sums) {
        let Some(doubt) = &mut self.doubt else { return };
        doubt.accepted += 1;
        let agrees = latest.nis <= latest.mean
            || !outside(latest.nis, latest.mean, latest.variance, AGREES_ALPHA);
        if !doubt.lasts && doubt.accepted >= LATEST && agrees {
            self.doubt = None;
        }
    }

    /// Takes the health of a sample that arrives.
    fn judge(&mut self, time: Time, health: Health) {
        self.tick(time);
        if let Some(last) = self.last {
            self.rhythm.take(time.since(last));
        }
        self.last = Some(time);
        self.follow(time, health);
    }

    /// Lets the lane follow the majority of the latest samples, of which this is one.
    fn follow(&mut self, time: Time, health: Health) {
        let health = match health {
            Health::Used | Health::Noisy if self.doubt.is_some() => Health::Doubted,
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
            self.change(health, begun);
        }
    }

    fn change(&mut self, health: Health, at: Time) {
        if let Some((before, from)) = self.current.replace((health, at)) {
            self.stretches.push(Stretch { health: before, from, to: at });
        }
    }
}

/// The time that many seconds later.
fn after(time: Time, seconds: f64) -> Time {
    time + Span::from_nanos((seconds * 1e9) as i64)
}
