//! The sensors of a run while it goes on.

use crate::status::{SensorState, SensorStatus};
use navfuse_core::model::record::finding::Severity;
use navfuse_core::model::record::verdict::Verdict;
use navfuse_core::model::record::{Outcome, Record, Wants};
use navfuse_core::model::sensor::SensorInfo;
use navfuse_core::model::stream::{Sink, StreamError};
use navfuse_core::units::rhythm::Rhythm;
use navfuse_core::units::time::Time;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// Samples over which the mean NIS reaches.
const LATEST: f64 = 50.0;

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
        let sensors = self.lock();
        let newest = sensors.iter().filter_map(|sensor| Some(sensor.last?.0)).max();
        let status = |sensor: &Sensor| {
            let mut status = sensor.status.clone();
            status.rate_hz = sensor.rhythm.usual().map(|usual| 1.0 / usual);
            status.age_s = match self.speed.is_finite() {
                true => sensor.last.map(|(_, at)| self.seconds(now, at)),
                // time goes on by the samples alone
                false => newest.zip(sensor.last).map(|(newest, (time, _))| newest.since(time)),
            };
            if status.age_s.is_some_and(|age| age > sensor.rhythm.patience()) {
                status.state = SensorState::Silent;
            } else if doubted(&status.name) {
                status.state = SensorState::Doubted;
            }
            status
        };
        sensors.iter().map(status).collect()
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
