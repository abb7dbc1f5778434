//! Detecting sensors that fall silent.

use crate::checkpoint::saved;
use crate::model::record::{Event, Level, Observer};
use crate::model::sensor::{Purpose, SensorInfo};
use crate::session::outputs::Outputs;
use crate::units::rhythm::Rhythm;
use crate::units::sample::Sample;
use crate::units::time::{Span, Time};

/// Warns when a sensor falls silent, and logs when it is back.
pub(crate) struct SilenceMonitor {
    /// The driving sensor: its clock is the clock of the other sensors.
    driver: Option<usize>,
    sensors: Vec<Activity>,
    /// The time of the previous sample.
    before: Time,
    /// The time of the next check.
    next: Time,
}

saved!(SilenceMonitor { before, next } each { sensors } except { driver });

/// The samples of one sensor over time.
struct Activity {
    /// The timeout that the scenario gives, s.
    timeout: Option<f64>,
    last: Option<Time>,
    rhythm: Rhythm,
    lost: bool,
}

saved!(Activity { last, rhythm, lost } except { timeout });

impl Activity {
    /// Tests whether the sensor is lost at a time. A sensor with one sample never is.
    fn is_lost(&self, time: Time) -> bool {
        self.last.is_some_and(|last| match (time.since(last), self.timeout) {
            (elapsed, Some(timeout)) => elapsed > timeout,
            (elapsed, None) => self.rhythm.misses(elapsed),
        })
    }
}

impl SilenceMonitor {
    /// Time between two checks.
    const PERIOD: Span = Span::from_nanos(100_000_000);

    pub(crate) fn new(timeouts: Vec<Option<f64>>, sensors: &[SensorInfo]) -> Self {
        Self {
            driver: sensors.iter().position(|s| s.purpose == Purpose::Input),
            sensors: timeouts
                .into_iter()
                .map(|timeout| Activity {
                    timeout,
                    last: None,
                    rhythm: Rhythm::default(),
                    lost: false,
                })
                .collect(),
            before: Time::MIN,
            next: Time::MIN,
        }
    }

    /// Takes the time of a sample, and checks all sensors when a check is due.
    pub(crate) fn sample(
        &mut self,
        sample: &Sample,
        sensors: &[SensorInfo],
        outputs: &mut Outputs,
    ) {
        let now = sample.time;
        // the earlier of two successive times: a single wrong time stamp does not move the clock
        let clock = now.min(std::mem::replace(&mut self.before, now));
        self.tick(clock, sensors, outputs);
        let activity = &mut self.sensors[sample.sensor.0];
        let Some(last) = activity.last.replace(now) else { return };
        activity.rhythm.take(now.since(last));
        if std::mem::take(&mut activity.lost) {
            let name = &sensors[sample.sensor.0].name;
            let text = format!("{name} is back after {:.1} s", now.since(last));
            outputs.event(Event { time: now, level: Level::Info, about: name.clone(), text });
        }
    }

    /// Checks all sensors when a check is due.
    pub(crate) fn tick(&mut self, clock: Time, sensors: &[SensorInfo], outputs: &mut Outputs) {
        if clock >= self.next {
            self.next = clock + Self::PERIOD;
            self.check(clock, sensors, outputs);
        }
    }

    fn check(&mut self, clock: Time, sensors: &[SensorInfo], outputs: &mut Outputs) {
        let driven = self.driver.map(|d| self.sensors[d].last.unwrap_or(Time::MIN));
        for (k, (activity, sensor)) in self.sensors.iter_mut().zip(sensors).enumerate() {
            let time = driven.filter(|_| self.driver != Some(k)).unwrap_or(clock);
            if !activity.lost && activity.is_lost(time) {
                activity.lost = true;
                let about = sensor.name.clone();
                let timeout = activity.timeout.unwrap_or_else(|| activity.rhythm.patience());
                let timeout = (timeout * 1e3).round() / 1e3;
                let text = format!("{about} lost: no sample for {timeout} s");
                outputs.event(Event { time, level: Level::Warning, about, text });
            }
        }
    }
}
