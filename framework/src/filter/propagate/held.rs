//! The last sample of each driving sensor beside the first.

use crate::compose::Composition;
use crate::filter::propagate::inputs::{Corrected, replace};
use crate::model::process::{Input, Interval};
use crate::units::sample::Sample;

/// Last sample of a driving sensor beside the first.
#[derive(Clone)]
pub(in crate::filter) struct Held {
    pub(in crate::filter) process: usize,
    pub(in crate::filter) sensor: usize,
    pub(in crate::filter) sample: Option<Sample>,
    /// Time between the last two samples, s.
    pub(in crate::filter) interval: f64,
}

impl Held {
    /// The driving sensors beside the first.
    pub(in crate::filter) fn of(composition: &Composition) -> Vec<Self> {
        let processes = composition.processes.iter().enumerate();
        let driven = processes.filter_map(|(process, p)| Some((process, p.input?)));
        let others = driven.skip(1);
        others
            .map(|(process, sensor)| Self { process, sensor, sample: None, interval: 0.0 })
            .collect()
    }

    /// Returns `true` if the sensor drives the process.
    pub(in crate::filter) fn drives(&self, process: usize) -> bool {
        self.process == process
    }

    /// The input of its process, once a sample was there.
    pub(in crate::filter) fn input(&self) -> Option<Input<'_>> {
        let (duration, usual) = (self.interval, self.interval);
        self.sample.as_ref().map(|sample| Input { sample, duration, usual, spread: None })
    }
}

/// Interval as a process sees it: with the sample of its own driving sensor.
pub(in crate::filter) fn of_process<'a>(
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
