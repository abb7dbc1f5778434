//! The state of a run and of its sensors while it goes on.

use crate::delays::ClockStatus;
use navfuse_core::model::record::finding::Severity;
use navfuse_core::model::record::verdict::{Verdict, VerdictLevel};
use navfuse_core::model::record::{Epoch, Outcome, Record, Wants};
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::stream::{Sink, StreamError};
use navfuse_core::state::Vehicle;
use navfuse_core::units::rhythm::Rhythm;
use navfuse_core::units::time::Time;
use serde::{Deserialize, Serialize};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// Samples over which the mean NIS reaches.
const LATEST: f64 = 50.0;

/// State of a sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SensorState {
    /// No sample has arrived.
    #[default]
    Waiting,
    /// Its samples are used.
    Used,
    /// The gate refused its latest sample.
    Gated,
    /// Its latest sample could not be used.
    Rejected,
    /// No sample has arrived for longer than usual.
    Silent,
    /// It contradicts the other sensors, or a fault of it was found.
    Contradicting,
    /// A command switched it off.
    Off,
}

/// A sensor while the run goes on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SensorStatus {
    /// Name in the scenario.
    pub name: String,
    /// State.
    pub state: SensorState,
    /// Samples that arrived.
    pub samples: u64,
    /// Samples that were used.
    pub used: u64,
    /// Samples that the gate refused.
    pub gated: u64,
    /// Samples that could not be used.
    pub rejected: u64,
    /// Samples whose time stamp contradicts its arrival, which never reach the filter.
    pub refused: u64,
    /// Samples that arrived while a command had switched it off.
    #[serde(default)]
    pub left_out: u64,
    /// Mean NIS of its latest samples by their degrees of freedom, about 1 where its noise is right.
    #[serde(default)]
    pub nis: Option<f64>,
    /// Usual rate of the samples, Hz.
    pub rate_hz: Option<f64>,
    /// Time since the latest sample, s.
    pub age_s: Option<f64>,
    /// Its clock.
    #[serde(default)]
    pub clock: ClockStatus,
}

/// A link while the run goes on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LinkStatus {
    /// Name in the scenario.
    pub name: String,
    /// Samples that it gave.
    pub samples: u64,
    /// Samples that were dropped, since the filter did not keep up with them.
    pub dropped: u64,
    /// Set once it has ended.
    pub ended: bool,
}

/// The 1-sigma of the newest estimate along or about north, east and down, as far as it is estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Accuracy {
    /// Position, m.
    pub position_m: Option<[f64; 3]>,
    /// Velocity, m/s.
    pub velocity_mps: Option<[f64; 3]>,
    /// Attitude, deg.
    pub attitude_deg: Option<[f64; 3]>,
}

impl Accuracy {
    /// The accuracy of an estimate.
    pub fn of(epoch: &Epoch<'_>) -> Self {
        let sigma = |slot: usize| {
            let first = epoch.layout.blocks[slot].tangent?;
            Some([0, 1, 2].map(|k| epoch.covariance.sigma(first + k)))
        };
        let Vehicle { position, velocity, attitude } = epoch.layout.vehicle();
        Self {
            position_m: position.and_then(|block| sigma(block.slot())),
            velocity_mps: velocity.and_then(|block| sigma(block.slot())),
            attitude_deg: attitude
                .and_then(|block| sigma(block.slot()))
                .map(|sigma| sigma.map(f64::to_degrees)),
        }
    }
}

/// A run while it goes on.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// Name of the scenario.
    pub name: String,
    /// Set once there is an estimate.
    pub running: bool,
    /// Time of the newest estimate on the run's clock, s.
    pub time_s: Option<f64>,
    /// Its 1-sigma.
    #[serde(default)]
    pub accuracy: Accuracy,
    /// Verdict so far.
    pub verdict: VerdictLevel,
    /// Verdict so far, in one line.
    pub text: String,
    /// Sensors.
    pub sensors: Vec<SensorStatus>,
    /// Links.
    pub links: Vec<LinkStatus>,
    /// The last command, and what came of it.
    #[serde(default)]
    pub command: Option<String>,
    /// Latency from a sample to its estimate, ms: median, 99 %, largest.
    pub latency_ms: [f64; 3],
}

/// What is known of one sensor.
#[derive(Debug)]
struct Sensor {
    status: SensorStatus,
    rhythm: Rhythm,
    last: Option<(Time, Instant)>,
}

/// The sensors of a run, which the filter and the driver both report on.
#[derive(Clone, Debug)]
pub struct Sensors {
    shared: Arc<Mutex<Vec<Sensor>>>,
    speed: f64,
}

impl Sensors {
    /// The sensors, none of which has given a sample.
    pub fn new(sensors: &[SensorInfo], speed: f64) -> Self {
        let sensor = |info: &SensorInfo| Sensor {
            status: SensorStatus { name: info.name.clone(), ..SensorStatus::default() },
            rhythm: Rhythm::default(),
            last: None,
        };
        Self { shared: Arc::new(Mutex::new(sensors.iter().map(sensor).collect())), speed }
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Sensor>> {
        // counts are counts, whatever happened to a thread that held them
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a sample that arrives.
    pub fn arrived(&self, sensor: usize, time: Time, at: Instant) {
        let sensor = &mut self.lock()[sensor];
        sensor.status.samples += 1;
        if let Some((last, _)) = sensor.last {
            sensor.rhythm.take(time.since(last));
        }
        sensor.last = Some((time, at));
    }

    /// Counts a sample of a sensor that is switched off.
    pub fn left_out(&self, sensor: usize) {
        self.lock()[sensor].status.left_out += 1;
    }

    /// Takes a sample whose time stamp is refused; returns the number of those so far.
    pub fn refused(&self, sensor: usize) -> u64 {
        let status = &mut self.lock()[sensor].status;
        status.refused += 1;
        status.state = SensorState::Rejected;
        status.refused
    }

    /// The state of all sensors at a moment.
    pub fn status(&self, now: Instant, verdict: &Verdict) -> Vec<SensorStatus> {
        let doubted = |name: &str| {
            verdict.reasons.iter().any(|r| r.about == name && r.severity >= Severity::Doubtful)
        };
        let status = |sensor: &Sensor| {
            let mut status = sensor.status.clone();
            status.rate_hz = sensor.rhythm.usual().map(|usual| 1.0 / usual);
            status.age_s = sensor.last.map(|(_, at)| self.seconds(now, at));
            if status.age_s.is_some_and(|age| age > sensor.rhythm.patience()) {
                status.state = SensorState::Silent;
            } else if doubted(&status.name) {
                status.state = SensorState::Contradicting;
            }
            status
        };
        self.lock().iter().map(status).collect()
    }

    fn seconds(&self, now: Instant, at: Instant) -> f64 {
        now.saturating_duration_since(at).as_secs_f64() * self.speed
    }
}

impl Sink for Sensors {
    fn wants(&self) -> Wants {
        Wants::SAMPLES | Wants::UPDATES | Wants::INPUT_REJECTIONS
    }

    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        let mut sensors = self.lock();
        match record {
            // a measurement is judged by the record of its update, which comes after its sample
            Record::Sample(sample) => {
                let status = &mut sensors[sample.sensor.0].status;
                status.used += 1;
                status.state = SensorState::Used;
            }
            Record::Update(update) => {
                let status = &mut sensors[update.sensor.0].status;
                status.judged(update.nis / update.channels().count().max(1) as f64);
                match update.outcome {
                    Outcome::Accepted | Outcome::Placed => {}
                    Outcome::Gated => status.turn(SensorState::Gated),
                    Outcome::Rejected(_) => status.turn(SensorState::Rejected),
                }
            }
            Record::InputRejection(rejection) => {
                sensors[rejection.sensor.0].status.turn(SensorState::Rejected);
            }
            _ => {}
        }
        Ok(())
    }
}

impl SensorStatus {
    /// Takes the NIS of a sample by its degrees of freedom.
    fn judged(&mut self, nis: f64) {
        if nis.is_finite() {
            let mean = self.nis.unwrap_or(nis);
            self.nis = Some(mean + (nis - mean) / LATEST);
        }
    }

    /// Counts the latest sample as one that was not used.
    fn turn(&mut self, state: SensorState) {
        self.used = self.used.saturating_sub(1);
        self.state = state;
        match state {
            SensorState::Gated => self.gated += 1,
            _ => self.rejected += 1,
        }
    }
}
