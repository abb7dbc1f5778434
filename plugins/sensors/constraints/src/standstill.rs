//! Detection of a standstill from the samples of the IMU, and from those of an odometer.

use navfuse_core::checkpoint::{Io, saved};
use navfuse_core::model::sensor::detector::Detector;
use navfuse_core::model::sensor::{Purpose, Sensor};
use navfuse_core::prelude::*;
use navfuse_core::units::Unit;
use std::collections::VecDeque;

/// Longest window, s: at 1 kHz it holds 10 000 samples.
pub(crate) const LONGEST: f64 = 10.0;
/// Interval between two tests of the window, s.
const TEST: f64 = 0.1;
/// Least number of samples in a window with a standard deviation.
const FEWEST: usize = 5;

/// Settings of the detector, in SI.
#[derive(Clone, Debug)]
pub(crate) struct Settings {
    /// Length of the window, s.
    pub window: f64,
    /// Largest standard deviation of the specific force, m/s^2.
    pub force: Vector3<f64>,
    /// Largest mean of the angular rate, rad/s.
    pub rotation: Vector3<f64>,
    /// Name of the odometer.
    pub odometer: Option<String>,
    /// Largest speed that the odometer reports at a standstill, m/s.
    pub speed: f64,
    /// Time between two detections, s.
    pub period: f64,
}

/// Angular rate and specific force of a sample of the IMU.
#[derive(Clone, Copy, Debug, Default)]
struct Inertial {
    time: Time,
    rate: Vector3<f64>,
    force: Vector3<f64>,
}

saved!(Inertial { time, rate, force });

/// Sensors that the detector reads.
#[derive(Clone, Copy, Debug)]
struct Sensed {
    imu: usize,
    /// Set if the IMU gives the integrals over the interval since its previous sample.
    increments: bool,
    /// The odometer, and its channel of the speed.
    odometer: Option<(usize, usize)>,
}

/// The standard deviation of the specific force over a window tells standing from rolling: the road
/// shakes a vehicle that rolls. Its mean does not, since it depends on the slope.
#[derive(Clone, Debug)]
pub(crate) struct Standstill {
    settings: Settings,
    sensed: Option<Sensed>,
    window: VecDeque<Inertial>,
    /// Time of the last sample of the IMU.
    before: Option<Time>,
    /// Time of the last speed beyond the limit, and of the last speed.
    speeds: (Time, Time),
    /// Time of the next test.
    next: Time,
}

saved!(Standstill { window, before, speeds, next } except { settings, sensed });

impl Standstill {
    pub fn new(settings: Settings) -> Self {
        Self {
            settings,
            sensed: None,
            window: VecDeque::new(),
            before: None,
            speeds: (Time::MIN, Time::MIN),
            next: Time::MIN,
        }
    }

    /// Keeps a sample of the IMU, and drops those before the window.
    fn keep(&mut self, sample: &Sample, increments: bool) {
        let interval = self.before.replace(sample.time).map(|before| sample.time.since(before));
        let share = match (increments, interval) {
            (false, _) => 1.0,
            (true, Some(interval)) if interval > 0.0 => 1.0 / interval,
            (true, _) => return, // the interval of the first sample is unknown
        };
        let Some(c) = sample.array::<6>(0) else { return };
        let (rate, force) = (Vector3::new(c[0], c[1], c[2]), Vector3::new(c[3], c[4], c[5]));
        self.window.push_back(Inertial {
            time: sample.time,
            rate: rate * share,
            force: force * share,
        });
        let length = self.settings.window;
        while self.window.front().is_some_and(|first| sample.time.since(first.time) > length) {
            self.window.pop_front();
        }
    }

    /// Tests whether the IMU is quiet over a whole window.
    fn quiet(&self, now: Time) -> bool {
        let Some(first) = self.window.front() else { return false };
        // the window is whole if it lacks less than a tenth of its length
        if self.window.len() < FEWEST || now.since(first.time) < 0.9 * self.settings.window {
            return false;
        }
        let n = self.window.len() as f64;
        let mean = |of: fn(&Inertial) -> Vector3<f64>| {
            self.window.iter().map(of).sum::<Vector3<f64>>() / n
        };
        let (rate, force) = (mean(|s| s.rate), mean(|s| s.force));
        let squares = self.window.iter().map(|s| (s.force - force).map(|d| d * d));
        let deviation = (squares.sum::<Vector3<f64>>() / (n - 1.0)).map(f64::sqrt);
        let below = |value: &Vector3<f64>, limit: &Vector3<f64>| {
            value.iter().zip(limit).all(|(value, limit)| value.abs() <= *limit)
        };
        below(&deviation, &self.settings.force) && below(&rate, &self.settings.rotation)
    }

    /// Tests whether the odometer shows no speed over a whole window.
    fn no_speed(&self, now: Time) -> bool {
        let (moved, last) = self.speeds;
        let within = |time: Time| time > Time::MIN && now.since(time) <= self.settings.window;
        within(last) && !within(moved)
    }
}

impl Detector for Standstill {
    fn connect(&mut self, sensors: &[Sensor]) -> Result<(), ComposeError> {
        let driving = |s: &Sensor| s.info.purpose == Purpose::Input && s.info.channels.len() == 6;
        let Some(imu) = sensors.iter().position(driving) else {
            let text = "a standstill is found from the samples of an IMU: add [sensor.imu]";
            return Err(ComposeError::new("", text));
        };
        let increments = sensors[imu].info.channels.iter().any(|c| c.unit == Unit::RADIAN);
        let odometer = match &self.settings.odometer {
            None => None,
            Some(name) => {
                let index = sensors.iter().position(|s| s.info.name == *name);
                let speed = |k: usize| Some((k, sensors[k].info.position("speed")?));
                let text = format!("there is no [sensor.{name}] with a channel speed");
                let found = index.and_then(speed);
                Some(found.ok_or_else(|| ComposeError::new("odometer", text))?)
            }
        };
        self.sensed = Some(Sensed { imu, increments, odometer });
        Ok(())
    }

    fn detects(&mut self, sample: &Sample) -> bool {
        let Some(sensed) = self.sensed else { return false };
        if let Some((odometer, channel)) = sensed.odometer
            && sample.sensor.0 == odometer
            && let Some(speed) = sample.get(channel)
        {
            let moves = speed.abs() > self.settings.speed;
            self.speeds = (if moves { sample.time } else { self.speeds.0 }, sample.time);
        }
        if sample.sensor.0 != sensed.imu {
            return false;
        }
        self.keep(sample, sensed.increments);
        if sample.time < self.next {
            return false;
        }
        let rests =
            self.quiet(sample.time) && (sensed.odometer.is_none() || self.no_speed(sample.time));
        let pause = if rests { self.settings.period } else { TEST };
        self.next = sample.time + Span::from_seconds(pause).unwrap_or_default();
        rests
    }

    fn memory(&mut self, io: &mut Io<'_>) {
        io.pass(self);
    }

    fn boxed_clone(&self) -> Box<dyn Detector> {
        Box::new(self.clone())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;

    /// Largest mean of the angular rate, rad/s.
    const ROTATION: f64 = 0.01;

    /// A detector with a window of one second for an IMU.
    fn detector(increments: bool) -> Standstill {
        let settings = Settings {
            window: 1.0,
            force: Vector3::repeat(0.05),
            rotation: Vector3::repeat(ROTATION),
            odometer: None,
            speed: 0.0,
            period: 1.0,
        };
        let sensed = Some(Sensed { imu: 0, increments, odometer: None });
        Standstill { sensed, ..Standstill::new(settings) }
    }

    fn sample(nanos: i64, rate: f64, share: f64) -> Sample {
        let channels = [0.0, 0.0, rate, 0.0, 0.0, -9.81].map(|x| x * share);
        Sample::new(Time::from_nanos(nanos), SensorId(0), &channels)
    }

    /// A second holds five samples at 4 Hz, both ends included, and four at 3 Hz.
    #[test]
    fn a_standstill_needs_five_samples_in_the_window() {
        let first = |interval: i64| {
            let mut detector = detector(false);
            (0..40).find(|k| detector.detects(&sample(k * interval, 0.0, 1.0)))
        };
        assert_eq!(first(250_000_000), Some(4), "at 1 s, the fifth sample");
        assert_eq!(first(333_000_000), None);
    }

    /// Samples that cover 10 and 30 ms in turn: the integrals differ threefold, the rates do not. A
    /// vehicle that turns by a tenth less than the limit stands, by a tenth more it does not.
    #[test]
    fn increments_count_by_the_time_that_they_cover() {
        let stands = |rate: f64| {
            let (mut detector, mut nanos) = (detector(true), 0);
            (0..500).any(|k| {
                let interval = if k % 2 == 0 { 10_000_000 } else { 30_000_000 };
                nanos += interval;
                detector.detects(&sample(nanos, rate, Time::from_nanos(interval).seconds()))
            })
        };
        assert!(stands(0.9 * ROTATION) && stands(-0.9 * ROTATION));
        assert!(!stands(1.1 * ROTATION) && !stands(-1.1 * ROTATION));
    }

    /// Specific force that differs from sample to sample by twice `size`, in five of 250 ms: a
    /// standard deviation of `sqrt(1.2)` of it.
    #[test]
    fn the_deviation_of_a_few_samples_is_that_of_the_force_without_a_bias() {
        let stands = |size: f64, increments: bool| {
            let mut detector = detector(increments);
            (0..40_i64).any(|k| {
                let shake = if k % 2 == 0 { size } else { -size };
                let share = if increments { 0.25 } else { 1.0 };
                let channels = [0.0, 0.0, 0.0, shake, 0.0, -9.81].map(|x| x * share);
                let time = Time::from_nanos(k * 250_000_000);
                detector.detects(&Sample::new(time, SensorId(0), &channels))
            })
        };
        let limit = 0.05 / 1.2_f64.sqrt();
        for increments in [false, true] {
            assert!(stands(0.99 * limit, increments) && !stands(1.01 * limit, increments));
        }
    }

    /// Nine tenths of a window of two seconds suffice. After a standstill the next test follows one
    /// period later.
    #[test]
    fn a_standstill_is_found_after_the_window_and_then_once_a_period() {
        let mut detector = detector(false);
        detector.settings.window = 2.0;
        let at = |k: i64| k * 125_000_000;
        let found: Vec<i64> =
            (0..40).filter(|k| detector.detects(&sample(at(*k), 0.0, 1.0))).collect();
        // the first one after 1.8 s is at 1.875 s
        assert_eq!(found, [15, 23, 31, 39]);
    }

    /// A sample that comes again covers no time, so that its increments have no rate.
    #[test]
    fn increments_that_come_twice_count_once() {
        let mut detector = detector(true);
        let found = (1..40).any(|k| {
            let one = sample(k * 125_000_000, 0.0, 0.125);
            detector.detects(&one) || detector.detects(&one)
        });
        assert!(found);
    }

    /// The odometer's limit is 0.25 m/s: up to it the vehicle stands, in either direction. It counts
    /// for as long as the window, 1 s.
    #[test]
    fn a_standstill_is_none_while_the_odometer_shows_speed_or_nothing() {
        let found = |speed: &dyn Fn(f64) -> Option<f64>| {
            let mut detector = detector(false);
            detector.settings.speed = 0.25;
            detector.sensed = Some(Sensed { imu: 0, increments: false, odometer: Some((1, 2)) });
            let at = |k: i64| k * 125_000_000;
            let mut stands = |k: i64| {
                if let Some(speed) = speed(k as f64 / 8.0) {
                    let channels = [9.0, 9.0, speed];
                    let sample = Sample::new(Time::from_nanos(at(k)), SensorId(1), &channels);
                    assert!(!detector.detects(&sample), "the odometer alone");
                }
                detector.detects(&sample(at(k), 0.0, 1.0))
            };
            (0..80).filter(|k| stands(*k)).map(|k| k as f64 / 8.0).collect::<Vec<_>>()
        };
        let all: Vec<f64> = (1..10).map(f64::from).collect();
        assert_eq!(found(&|_| Some(0.0)), all);
        assert_eq!(found(&|_| Some(-0.25)), all);
        assert!(found(&|_| Some(0.26)).is_empty() && found(&|_| Some(-0.26)).is_empty());
        assert!(found(&|_| None).is_empty());
        // a speed at 4.5 s counts up to 5.5 s; after 7 s the odometer is silent
        let moves = |t: f64| (t <= 7.0).then_some(if t == 4.5 { 1.0 } else { 0.0 });
        assert_eq!(found(&moves), [1.0, 2.0, 3.0, 4.0, 5.625, 6.625, 7.625]);
    }
}
