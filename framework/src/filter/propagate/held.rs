//! The last sample of each driving sensor beside the first.

use super::inputs::{Corrected, replace};
use crate::checkpoint::saved;
use crate::compose::Composition;
use crate::model::process::{Input, Interval};
use crate::units::sample::Sample;

/// Last sample of a driving sensor beside the first.
#[derive(Clone)]
pub(super) struct Held {
    process: usize,
    sensor: usize,
    sample: Option<Sample>,
    /// Time between the last two samples, s.
    interval: f64,
}

saved!(Held { sample, interval } except { process, sensor });

impl Held {
    /// The driving sensors beside the first.
    pub(super) fn of(composition: &Composition) -> Vec<Self> {
        let processes = composition.processes.iter().enumerate();
        let driven = processes.filter_map(|(process, p)| Some((process, p.input?)));
        let others = driven.skip(1);
        others
            .map(|(process, sensor)| Self { process, sensor, sample: None, interval: 0.0 })
            .collect()
    }

    /// The process that the sensor drives.
    pub(super) fn process(&self) -> usize {
        self.process
    }

    /// Returns `true` if the sample is from the sensor.
    pub(super) fn is_of(&self, sample: &Sample) -> bool {
        self.sensor == sample.sensor.0
    }

    /// Last sample of a sensor, if it is this sensor and has had a sample.
    pub(super) fn sample_of(&self, sensor: usize) -> Option<&Sample> {
        self.sample.as_ref().filter(|_| self.sensor == sensor)
    }

    /// Holds a sample from its time on.
    pub(super) fn take(&mut self, sample: &Sample) {
        self.interval = self.sample.map_or(0.0, |before| sample.time.since(before.time));
        self.sample = Some(*sample);
    }

    /// Returns `true` if the sensor drives the process.
    pub(super) fn drives(&self, process: usize) -> bool {
        self.process == process
    }

    /// The input of its process, once the sensor has had a sample.
    pub(super) fn input(&self) -> Option<Input<'_>> {
        let (duration, usual) = (self.interval, self.interval);
        self.sample.as_ref().map(|sample| Input { sample, duration, usual, spread: None })
    }
}

/// Interval as a process sees it: with the sample of its own driving sensor.
pub(super) fn of_process<'a>(
    held: &'a [Held],
    corrected: &'a [Corrected],
    process: usize,
    interval: &Interval<'a>,
) -> Interval<'a> {
    match held.iter().find(|held| held.process == process) {
        Some(own) => {
            let input = own.input().map(|input| replace(corrected, input));
            Interval { input, ..*interval }
        }
        None => *interval,
    }
}
