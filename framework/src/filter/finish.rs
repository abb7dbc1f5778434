//! The end of a run: what the filter reports after the last sample.

use super::ekf::Ekf;
use super::judge::reject::rejected;
use super::screen::screened::Driver;
use crate::model::record::{Event, Level, Observer, Rejection};
use crate::units::sample::SensorId;
use crate::units::time::Time;

impl Ekf {
    /// Reports unused samples and sensors that are still gated after the last sample.
    pub fn finish(&mut self, observer: &mut dyn Observer) {
        self.finish_screening(observer);
        self.finish_pace(observer);
        let time = self.state().time;
        if let Some(branch) = self.parts.branch.take() {
            if branch.is_in_doubt() {
                branch.finish(time, &self.composition.sensors, observer);
            } else {
                self.decide_first(&branch, false, observer);
            }
            self.parts.branch = Some(branch);
        }
        let all = || self.parts.sensors.iter().zip(&self.composition.sensors);
        for (slot, sensor) in all() {
            let level = slot.noise.as_ref().filter(|_| slot.adaptive);
            if let Some(noise) = level {
                let level = if noise.is_at_limit() { Level::Warning } else { Level::Info };
                let text = noise.words();
                observer.event(Event { time, level, about: slot.name.clone(), text });
            }
            // the alignment has already reported the samples of its own constraint
            if !sensor.constraint || sensor.detector.is_some() {
                let used = |since: Time| {
                    all().any(|(other, sensor)| {
                        let counts = !sensor.constraint && other.name != slot.name;
                        counts && other.lockout.used_since(since)
                    })
                };
                let only = slot.lockout.mostly_isolated_since().is_some_and(|since| !used(since));
                slot.lockout.finish((&slot.name, slot.last), only, observer);
            }
        }
    }

    /// Uses the samples that the screening holds, and reports its counts.
    fn finish_screening(&mut self, observer: &mut dyn Observer) {
        let Some(driver) = self.driver else { return };
        let waits = self.parts.start.waits();
        let counts = {
            let info = &self.composition.sensors[driver].info;
            self.parts.screening.finish(Driver { info, waits }, observer)
        };
        // a failure here loses a few samples at the very end of the run
        self.use_screened(observer).ok();
        let (time, info) = (self.state().time, &self.composition.sensors[driver].info);
        if let Some(counts) = counts {
            counts.report(time, info, observer);
        }
    }

    /// Reports missing samples of the driving sensor, and measurements that it never reached: of each sensor
    /// once.
    fn finish_pace(&mut self, observer: &mut dyn Observer) {
        let (missing, longest) = self.parts.pace.missing();
        if let Some(driver) = self.driver
            && missing > 1
        {
            let about = self.composition.sensors[driver].info.name.clone();
            let text =
                format!("samples were missing {missing} times, for {longest:.3} s at the longest");
            let time = self.state().time;
            observer.event(Event { time, level: Level::Warning, about, text });
        }
        let mut unused: Vec<(SensorId, Time, u64)> = Vec::new();
        while let Some(sample) = self.parts.pace.next_within(&..) {
            observer.update(&rejected(&sample, Rejection::NoInput));
            match unused.iter_mut().find(|(sensor, ..)| *sensor == sample.sensor) {
                Some((.., count)) => *count += 1,
                None => unused.push((sample.sensor, sample.time, 1)),
            }
        }
        for (sensor, time, count) in unused {
            let about = self.composition.sensors[sensor.0].info.name.clone();
            let text = match count {
                1 => "1 sample unused: it is after the last one of the driving sensor".to_owned(),
                _ => format!(
                    "{count} samples unused: they are after the last one of the driving sensor"
                ),
            };
            observer.event(Event { time, level: Level::Info, about, text });
        }
    }
}
