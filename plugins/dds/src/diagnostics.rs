//! The state of the sensors as `diagnostic_msgs/DiagnosticArray`.

use navfuse_core::model::record::{Outcome, UpdateRecord};
use navfuse_core::model::sensor::{Purpose, SensorInfo};
use navfuse_core::model::stream::RunInfo;
use navfuse_core::units::sample::Channel;
use navfuse_core::units::time::Time;
use navfuse_mcap::{Diagnosis, Health, outcome_words};

/// Time without an update after which a sensor is stale, s.
const STALE: f64 = 5.0;

/// What is known of a sensor.
struct Tally {
    name: String,
    /// Channels with their units.
    columns: Vec<String>,
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
        let tally = |sensor: &SensorInfo| Tally {
            name: sensor.name.clone(),
            columns: sensor.channels.iter().map(Channel::column).collect(),
            counts: [0; 3],
            last: None,
        };
        let measures = |sensor: &SensorInfo| sensor.purpose == Purpose::Measurement;
        let sensors = run.sensors.iter().map(|s| measures(s).then(|| tally(s))).collect();
        Self { sensors, reached: None, refused: None }
    }

    /// Takes the time of a final estimate.
    pub fn reach(&mut self, time: Time) {
        self.reached = Some(time);
    }

    /// The use of a sample: its outcome, the NIS, and each channel's innovation and 1-sigma, SI.
    pub fn innovation(&self, update: &UpdateRecord<'_>) -> Option<Diagnosis> {
        let tally = self.sensors.get(update.sensor.0)?.as_ref()?;
        let health = match update.outcome {
            Outcome::Accepted | Outcome::Placed => Health::Ok,
            Outcome::Gated | Outcome::Rejected(_) => Health::Warn,
        };
        let mut values = vec![("NIS".into(), update.nis.to_string())];
        for (channel, innovation, sigma) in update.channels() {
            let column = &tally.columns[channel];
            values.push((format!("innovation {column}").into(), innovation.to_string()));
            values.push((format!("sigma {column}").into(), sigma.to_string()));
        }
        let text = outcome_words(update.outcome, &tally.columns);
        Some(Diagnosis { name: format!("navfuse: {}", tally.name), health, text, values })
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
            text: "a subscriber asks for another quality of service, and receives nothing".into(),
            values: vec![("policy".into(), policy.clone())],
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
            ("used".into(), used.to_string()),
            ("gated".into(), gated.to_string()),
            ("rejected".into(), rejected.to_string()),
        ];
        if let Some((.., nis)) = self.last {
            values.push(("NIS by degrees of freedom".into(), format!("{nis:.2}")));
        }
        values.extend(age.map(|age| ("age, s".into(), format!("{age:.2}"))));
        let name = format!("navfuse: {}", self.name);
        Diagnosis { name, health, text: text.into(), values }
    }
}
