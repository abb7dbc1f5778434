//! The time stamps of the sensors, against the moments at which the samples arrive.
//!
//! A stamp and the arrival of its sample advance alike. Where they do not, the clock of the sensor
//! was set, or the stamp is damaged. A single such sample is refused; once several agree with each
//! other, the clock was set, and its step is taken out, so that the time of the run goes on.

use crate::delays::{ClockStatus, Delays};
use navfuse_core::units::time::{Span, Time};
use std::time::Instant;

/// Difference between stamps and arrivals beyond which they contradict each other, s: far more than
/// a link or a loaded computer delays a sample.
const STEP: f64 = 10.0;
/// Successive samples that agree with each other before a clock counts as set.
const AGREEING: u32 = 4;

/// What a stamp means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Judged {
    /// The time of the sample.
    Usable(Time),
    /// The stamp contradicts the arrival by this, s; positive if it is in the future.
    Refused(f64),
    /// The clock of the sensor was set by this, s; the time of the sample is without the step.
    Stepped(Time, f64),
}

/// A stamp and its arrival.
#[derive(Clone, Copy, Debug)]
struct Mark {
    stamp: Time,
    at: Instant,
}

/// The clock of one sensor.
#[derive(Clone, Debug, Default)]
struct Clock {
    /// The latest time that was used.
    last: Option<Mark>,
    /// The sample with the least delay so far.
    lead: Option<Mark>,
    /// Time that is added to the stamps.
    shift: Span,
    /// The latest stamp that was refused, and the number of those that agree with it.
    refused: Option<(Mark, u32)>,
    delays: Delays,
}

/// The clocks of all sensors.
#[derive(Clone, Debug)]
pub struct Stamps {
    sensors: Vec<Clock>,
    /// The driving sensor, whose clock is that of the run.
    driver: Option<usize>,
    /// The key `late` of each sensor, s.
    late: Vec<f64>,
    /// Seconds of the run in a second.
    speed: f64,
    /// The first sample of the run.
    first: Option<Mark>,
}

impl Stamps {
    /// The clocks of sensors with these bounds `late`.
    pub fn new(driver: Option<usize>, late: Vec<f64>, speed: f64) -> Self {
        Self { sensors: vec![Clock::default(); late.len()], driver, late, speed, first: None }
    }

    /// The clock of a sensor, as far as it is known.
    pub fn clock(&self, sensor: usize) -> ClockStatus {
        let delays = &self.sensors[sensor].delays;
        let driver = self.driver.and_then(|driver| self.sensors[driver].delays.least());
        let delay_s = delays.least().zip(driver).map(|(own, driver)| own - driver);
        ClockStatus { delay_s, drift_ppm: delays.drift() }
    }

    /// The time of the run at a moment, once the driving sensor has one.
    pub fn now(&self, at: Instant) -> Option<Time> {
        let last = self.sensors[self.driver?].last?;
        Some(last.stamp + Span::from_seconds(self.elapsed(last, at)).unwrap_or_default())
    }

    /// Time since the driving sensor's latest sample, s.
    pub fn silence(&self, at: Instant) -> Option<f64> {
        Some(self.elapsed(self.sensors[self.driver?].last?, at))
    }

    fn elapsed(&self, since: Mark, at: Instant) -> f64 {
        at.saturating_duration_since(since.at).as_secs_f64() * self.speed
    }

    /// Judges the stamp of a sample that arrived at this moment.
    pub fn judge(&mut self, sensor: usize, stamp: Time, at: Instant) -> Judged {
        let clock = &self.sensors[sensor];
        let (last, refused) = (clock.last, clock.refused);
        let time = stamp + clock.shift;
        let mark = Mark { stamp: time, at };
        let Some(error) = self.error(sensor, mark) else { return self.accept(sensor, mark) };
        let agreeing = match refused {
            Some((before, count)) if self.follows(before, Mark { stamp, at }) => count + 1,
            _ => 1,
        };
        self.sensors[sensor].refused = Some((Mark { stamp, at }, agreeing));
        match last {
            Some(last) if agreeing >= AGREEING => {
                let expected = self.elapsed(last, at).max(1e-6);
                let expected = last.stamp + Span::from_seconds(expected).unwrap_or_default();
                self.sensors[sensor].shift = expected - stamp;
                let step = time.since(expected);
                self.accept(sensor, Mark { stamp: expected, at });
                Judged::Stepped(expected, step)
            }
            _ => Judged::Refused(error),
        }
    }

    fn accept(&mut self, sensor: usize, mark: Mark) -> Judged {
        let lead = self.sensors[sensor].lead;
        let leads = lead.is_none_or(|lead| self.ahead(lead, mark) >= 0.0);
        let first = *self.first.get_or_insert(mark);
        let [now, delay] = [self.elapsed(first, mark.at), -self.ahead(first, mark)];
        let clock = &mut self.sensors[sensor];
        // a recording that is played at any speed has no clock
        if self.speed.is_finite() {
            clock.delays.take(now, delay);
        }
        clock.refused = None;
        clock.lead = if leads { Some(mark) } else { lead };
        if clock.last.is_none_or(|last| mark.stamp >= last.stamp) {
            clock.last = Some(mark);
        }
        Judged::Usable(mark.stamp)
    }

    /// The contradiction between a stamp and its arrival, s, if there is one.
    fn error(&self, sensor: usize, mark: Mark) -> Option<f64> {
        let limit = STEP * self.speed;
        if let Some(last) = self.sensors[sensor].last {
            let since = mark.stamp.since(last.stamp);
            // after a delivery that stalled, the samples catch up
            let ahead = self.ahead(self.sensors[sensor].lead.unwrap_or(last), mark);
            if ahead > limit {
                return Some(ahead);
            }
            if -since > limit + self.late[sensor] {
                return Some(since);
            }
        }
        // without a driving sample, nothing is known of the time of the run
        let ahead = mark.stamp.since(self.now(mark.at)?);
        (self.driver != Some(sensor) && ahead > limit).then_some(ahead)
    }

    /// The time by which a stamp is ahead of another one and of their arrivals, s.
    fn ahead(&self, lead: Mark, mark: Mark) -> f64 {
        mark.stamp.since(lead.stamp) - self.elapsed(lead, mark.at)
    }

    /// Tests whether a stamp follows another one as their arrivals do.
    fn follows(&self, before: Mark, mark: Mark) -> bool {
        let since = mark.stamp.since(before.stamp);
        since > 0.0 && (since - self.elapsed(before, mark.at)).abs() <= STEP * self.speed
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::panic, reason = "a test fails by panicking")]
    use super::*;
    use std::time::Duration;

    const SECOND: i64 = 1_000_000_000;

    /// Judges stamps, s, that arrive a second apart, of the driving sensor 0 or of sensor 1.
    fn judge(sensor: usize, stamps: &[f64]) -> Vec<Judged> {
        let mut clocks = Stamps::new(Some(0), vec![0.0, 2.0], 1.0);
        let begin = Instant::now();
        let mut judged = Vec::new();
        for (k, stamp) in stamps.iter().enumerate() {
            let at = begin + Duration::from_secs(k as u64);
            if sensor == 1 {
                clocks.judge(0, Time::from_nanos(k as i64 * SECOND), at);
            }
            let stamp = Time::from_seconds(*stamp).unwrap_or_default();
            judged.push(clocks.judge(sensor, stamp, at));
        }
        judged
    }

    fn usable(seconds: i64) -> Judged {
        Judged::Usable(Time::from_nanos(seconds * SECOND))
    }

    #[test]
    fn a_clock_that_is_set_by_an_hour_is_followed_and_the_time_of_the_run_goes_on() {
        for (sensor, hour) in [(0, 3600.0), (0, -3600.0), (1, 3600.0), (1, -3600.0)] {
            let set: Vec<f64> = (3..9).map(|k| f64::from(k) + hour).collect();
            let judged = judge(sensor, &[&[0.0, 1.0, 2.0], &set[..]].concat());
            assert_eq!(judged[..3], [usable(0), usable(1), usable(2)]);
            assert!(judged[3..6].iter().all(|j| matches!(j, Judged::Refused(_))), "{judged:?}");
            let Judged::Stepped(time, step) = judged[6] else { panic!("{judged:?}") };
            assert_eq!(time, Time::from_nanos(6 * SECOND));
            assert!((step - hour).abs() < 1e-6, "{step}");
            assert_eq!(judged[7..], [usable(7), usable(8)], "sensor {sensor}, {hour} s");
        }
    }

    #[test]
    fn a_single_damaged_stamp_costs_one_sample() {
        for wrong in [1e6, -1e6, 3600.0] {
            for sensor in [0, 1] {
                let judged = judge(sensor, &[0.0, 1.0, wrong, 3.0]);
                assert!(matches!(judged[2], Judged::Refused(_)), "{judged:?}");
                assert_eq!(judged[3], usable(3));
            }
        }
    }

    #[test]
    fn stamps_of_another_clock_are_refused_from_the_first_on() {
        let judged = judge(1, &[1.79e9, 1.79e9 + 1.0, 1.79e9 + 2.0, 1.79e9 + 3.0, 1.79e9 + 4.0]);
        assert!(judged.iter().all(|j| matches!(j, Judged::Refused(_))), "{judged:?}");
    }

    #[test]
    fn an_outage_a_delay_and_shuffled_samples_are_no_steps() {
        let mut clocks = Stamps::new(Some(0), vec![0.0, 2.0], 1.0);
        let begin = Instant::now();
        // (stamp, arrival): a delivery that stalls for 30 s, samples in another order, 1 h unplugged
        for (stamp, at) in [(0, 0), (1, 31), (2, 31), (31, 31), (30, 31), (29, 31), (3631, 3631)] {
            let judged =
                clocks.judge(0, Time::from_nanos(stamp * SECOND), begin + Duration::from_secs(at));
            assert_eq!(judged, usable(stamp));
        }
    }
}
