//! Samples of sensors that ride on another body: they wait for its pose.
//!
//! The navigation of a ship and its transceiver have samples at times of their own. A sample of the
//! transceiver waits for the first pose of the ship at its time or after it, and takes the pose
//! between this one and the one before. The pose is thus interpolated and never extrapolated, and
//! it depends on the times of the samples alone, in whatever order they arrive.

use crate::checkpoint::saved;
use crate::compose::Composition;
use crate::model::sensor::body::{Pose, Ride};
use crate::units::sample::Sample;
use crate::units::time::{Span, Time};
use std::collections::VecDeque;

/// The poses of the bodies, and the samples that wait for them.
pub(crate) struct Riding {
    /// For each sensor, the body on which it rides.
    rides: Vec<Option<Ride>>,
    /// Span over which poses are kept: a sample that arrives later is too late for the filter.
    kept: Span,
    /// The sensor of the clock: the first driving one, or any if there is none.
    driver: Option<usize>,
    /// The poses of each sensor that has some, in order of time.
    poses: Vec<VecDeque<Sample>>,
    /// Samples that wait, in order of arrival.
    waiting: VecDeque<Sample>,
    /// Samples that can go on.
    ready: VecDeque<Sample>,
}

saved!(Riding { waiting, ready } each { poses } except { rides, kept, driver });

impl Riding {
    /// Creates the place for waiting samples; `None` where no sensor rides on a body.
    pub fn new(composition: &Composition) -> Option<Self> {
        let rides: Vec<Option<Ride>> = composition.sensors.iter().map(|s| s.ride).collect();
        let gap = rides.iter().flatten().map(|ride| ride.gap).max()?;
        let late = composition.sensors.iter().filter_map(|s| s.late).max().unwrap_or(gap);
        Some(Self {
            poses: vec![VecDeque::new(); rides.len()],
            rides,
            kept: late + gap + gap,
            driver: composition.driver(),
            waiting: VecDeque::new(),
            ready: VecDeque::new(),
        })
    }

    /// Takes a sample that arrives. [`Self::next`] gives it back once it can go on, with those that
    /// waited for it.
    pub fn arrive(&mut self, sample: &Sample) {
        let index = sample.sensor.0;
        if self.rides[index].is_some() {
            self.waiting.push_back(*sample);
        } else {
            self.ready.push_back(*sample);
        }
        if self.rides.iter().flatten().any(|ride| ride.sensor == index) {
            self.keep(sample);
        }
        let clock = self.driver.is_none_or(|driver| driver == index).then_some(sample.time);
        self.settle(clock, false);
    }

    /// Ends the waiting: no further pose arrives.
    pub fn close(&mut self) {
        self.settle(None, true);
    }

    /// The next sample that can go on.
    pub fn next(&mut self) -> Option<Sample> {
        self.ready.pop_front()
    }

    /// Keeps a pose in order of time, and forgets old ones.
    fn keep(&mut self, sample: &Sample) {
        let poses = &mut self.poses[sample.sensor.0];
        let at = poses.partition_point(|other| other.time < sample.time);
        if poses.get(at).is_none_or(|other| other.time != sample.time) {
            poses.insert(at, *sample);
        }
        let newest = poses.back().map_or(sample.time, |last| last.time);
        while poses.front().is_some_and(|first| newest - first.time > self.kept) {
            poses.pop_front();
        }
    }

    /// Lets the samples go on whose pose is there, and those for which none will come: the clock has
    /// passed them by the longest gap.
    fn settle(&mut self, clock: Option<Time>, all: bool) {
        for _ in 0..self.waiting.len() {
            let Some(mut sample) = self.waiting.pop_front() else { return };
            let Some(ride) = self.rides[sample.sensor.0] else { continue };
            let poses = &self.poses[ride.sensor];
            let there = poses.back().is_some_and(|last| last.time >= sample.time);
            if there || all || clock.is_some_and(|now| now - sample.time > ride.gap) {
                fill(&mut sample, &ride, poses);
                self.ready.push_back(sample);
            } else {
                self.waiting.push_back(sample);
            }
        }
    }
}

/// Sets the channels of the pose at the time of a sample, or clears them where it is not known.
fn fill(sample: &mut Sample, ride: &Ride, poses: &VecDeque<Sample>) {
    let after = poses.partition_point(|pose| pose.time < sample.time);
    let next = poses.get(after);
    let before = after.checked_sub(1).and_then(|k| poses.get(k));
    let pose = match (before, next) {
        (_, Some(next)) if next.time == sample.time => Pose::of(next, 0),
        (Some(before), Some(next)) if next.time - before.time <= ride.gap => {
            let part = sample.time.since(before.time) / next.time.since(before.time);
            let ends = Pose::of(before, 0).zip(Pose::of(next, 0));
            ends.map(|(before, next)| before.toward(&next, part))
        }
        _ => None,
    };
    match pose {
        Some(pose) => pose.put(sample, ride.first),
        None => (0..Pose::CHANNELS).for_each(|k| sample.clear(ride.first + k)),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use super::*;
    use crate::units::sample::SensorId;

    /// Sensor 0 drives, 1 has the pose, and 2 rides on it: its channel 0 is its own, 1 to 6 the pose.
    fn riding() -> Riding {
        let gap = Span::from_nanos(2_000_000_000);
        Riding {
            rides: vec![None, None, Some(Ride { sensor: 1, first: 1, gap })],
            kept: gap + gap,
            driver: Some(0),
            poses: vec![VecDeque::new(); 3],
            waiting: VecDeque::new(),
            ready: VecDeque::new(),
        }
    }

    fn sample(sensor: usize, seconds: f64) -> Sample {
        let time = Time::from_seconds(seconds).unwrap();
        let values = [seconds, 0.0, 10.0 * seconds, 0.0, 0.0, 0.1 * seconds];
        Sample::new(time, SensorId(sensor), if sensor == 1 { &values } else { &values[..1] })
    }

    /// Sensors, times and interpolated heights in the order in which the samples go on.
    fn passed(arrivals: &[(usize, f64)]) -> Vec<(usize, f64, Option<f64>)> {
        let mut riding = riding();
        let mut passed = Vec::new();
        for (sensor, seconds) in arrivals {
            riding.arrive(&self::sample(*sensor, *seconds));
            while let Some(next) = riding.next() {
                passed.push((next.sensor.0, next.time.seconds(), next.get(3)));
            }
        }
        riding.close();
        while let Some(next) = riding.next() {
            passed.push((next.sensor.0, next.time.seconds(), next.get(3)));
        }
        passed
    }

    #[test]
    fn a_sample_waits_for_the_pose_after_it_and_takes_the_one_between() {
        let found = passed(&[(1, 1.0), (2, 1.25), (0, 1.5), (1, 2.0), (0, 2.5)]);
        let height = |k: usize| found[k].2.unwrap();
        let order: Vec<_> = found.iter().map(|(sensor, time, _)| (*sensor, *time)).collect();
        assert_eq!(order, [(1, 1.0), (0, 1.5), (1, 2.0), (2, 1.25), (0, 2.5)]);
        assert!((height(3) - 12.5).abs() < 1e-12, "{found:?}");
        // one that arrives later takes the same pose
        let late = passed(&[(1, 1.0), (1, 2.0), (1, 3.0), (0, 3.1), (2, 1.25)]);
        assert_eq!(late.last(), Some(&found[3]));
    }

    #[test]
    fn a_sample_without_a_pose_goes_on_without_it() {
        for (arrivals, why) in [
            (vec![(2, 0.5), (1, 1.0)], "before the first pose"),
            (vec![(1, 1.0), (2, 2.0), (0, 4.5)], "no pose for 2 s after it"),
            (vec![(1, 1.0), (2, 2.0), (1, 3.5)], "in a gap"),
            (vec![(1, 1.0), (2, 1.5)], "at the end"),
        ] {
            let found = passed(&arrivals);
            let riding = found.iter().find(|(sensor, ..)| *sensor == 2);
            assert!(riding.is_some_and(|(_, _, height)| height.is_none()), "{why}: {found:?}");
        }
        assert_eq!(passed(&[(2, 1.0), (1, 1.0)]).last().and_then(|last| last.2), Some(10.0));
    }
}
