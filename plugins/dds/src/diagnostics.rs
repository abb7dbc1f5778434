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
    /// Quality of service that a subscriber asked for and does not get.
    refused: Option<String>,
}

impl Diagnostics {
    pub fn new(run: &RunInfo) -> Self {
        let tally = |name: &str| Tally { name: name.to_owned(), counts: [0; 3], last: None };
        let measures = |purpose: Purpose| purpose == Purpose::Measurement;
        let sensors = run.sensors.iter();
        let sensors = sensors.map(|s| measures(s.purpose).then(|| tally(&s.name))).collect();
        Self { sensors, reached: None, refused: None }
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

    /// Takes the quality of service that a subscriber of an estimate asks for and does not get.
    pub fn refused(&mut self, policy: Option<String>) {
        self.refused = policy.or(self.refused.take());
    }

    /// The state of each sensor, and of the topics where one is not received.
    pub fn all(&self) -> Vec<Diagnosis> {
        let sensors = self.sensors.iter().flatten().map(|tally| tally.at(self.reached));
        let topics = self.refused.as_ref().map(|policy| Diagnosis {
            name: "navfuse: topics".to_owned(),
            health: Health::Warn,
            text: "a subscriber asks for another quality of service, and receives nothing",
            values: vec![("policy", policy.clone())],
        });
        sensors.chain(topics).collect()
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
