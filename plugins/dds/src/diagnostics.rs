//! The state of the sensors as `diagnostic_msgs/DiagnosticArray`.

use navfuse_core::model::record::{Outcome, UpdateRecord};
use navfuse_core::model::sensor::Purpose;
use navfuse_core::model::stream::RunInfo;
use navfuse_core::units::time::Time;
use navfuse_mcap::{Diagnosis, Health};

/// Time without an update after which a sensor is stale, s.
const STALE: f64 = 5.0;

/// What is known of a sensor.
struct Tally {
    name: String,
    /// Updates that were used, gated and rejected.
    counts: [u64; 3],
    /// Time and outcome of the last one, and its NIS by its degrees of freedom.
    last: Option<(Time, Health, f64)>,
}

/// The measuring sensors of a run.
pub struct Diagnostics {
    sensors: Vec<Option<Tally>>,
    /// Time up to which the updates are final: behind the newest estimate by the longest `late`.
    reached: Option<Time>,
}

impl Diagnostics {
    pub fn new(run: &RunInfo) -> Self {
        let tally = |name: &str| Tally { name: name.to_owned(), counts: [0; 3], last: None };
        let measures = |purpose: Purpose| purpose == Purpose::Measurement;
        let sensors = run.sensors.iter();
        let sensors = sensors.map(|s| measures(s.purpose).then(|| tally(&s.name))).collect();
        Self { sensors, reached: None }
    }

    /// Takes the time of a final estimate.
    pub fn reach(&mut self, time: Time) {
        self.reached = Some(time);
    }

    /// Takes an update.
    pub fn take(&mut self, update: &UpdateRecord<'_>) {
        let Some(Some(tally)) = self.sensors.get_mut(update.sensor.0) else { return };
        let (kind, health) = match update.outcome {
            Outcome::Accepted | Outcome::Placed => (0, Health::Ok),
            Outcome::Gated => (1, Health::Warn),
            Outcome::Rejected(_) => (2, Health::Warn),
        };
        tally.counts[kind] += 1;
        let freedom = update.channels().count().max(1) as f64;
        tally.last = Some((update.time, health, update.nis / freedom));
    }

    /// The state of each sensor.
    pub fn all(&self) -> Vec<Diagnosis> {
        self.sensors.iter().flatten().map(|tally| tally.at(self.reached)).collect()
    }
}

impl Tally {
    fn at(&self, now: Option<Time>) -> Diagnosis {
        let [used, gated, rejected] = self.counts;
        let age = self.last.zip(now).map(|((time, ..), now)| now.since(time));
        let (health, text) = match self.last {
            Some((_, health, _)) if age.is_none_or(|age| age <= STALE) => match health {
                Health::Ok => (health, "used"),
                _ => (health, "the last sample was not used"),
            },
            Some(_) => (Health::Stale, "silent"),
            None => (Health::Stale, "waiting"),
        };
        let mut values = vec![
            ("used", used.to_string()),
            ("gated", gated.to_string()),
            ("rejected", rejected.to_string()),
        ];
        if let Some((.., nis)) = self.last {
            values.push(("NIS by degrees of freedom", format!("{nis:.2}")));
        }
        values.extend(age.map(|age| ("age, s", format!("{age:.2}"))));
        Diagnosis { name: format!("navfuse: {}", self.name), health, text, values }
    }
}
