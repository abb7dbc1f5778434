//! Samples of one sensor in order of time.

use std::ops::Range;

/// Samples of one sensor: ascending times on the recording's clock, and a value for each time.
#[derive(Clone, Debug)]
pub struct Series<T> {
    /// Name of the sensor in the scenario.
    pub name: String,
    /// Times, s.
    pub time: Vec<f64>,
    /// Values.
    pub value: Vec<T>,
}

impl<T> Series<T> {
    /// Creates a series without samples.
    pub fn new(name: &str) -> Self {
        Self { name: name.to_owned(), time: Vec::new(), value: Vec::new() }
    }

    /// Appends a sample; a sample that is not later than the last one is dropped.
    pub fn push(&mut self, time: f64, value: T) {
        if self.time.last().is_none_or(|last| time > *last) {
            self.time.push(time);
            self.value.push(value);
        }
    }

    /// Returns `true` if there are no samples.
    pub fn is_empty(&self) -> bool {
        self.time.is_empty()
    }

    /// Returns the indices of the samples from `from` to `to`, both inclusive, s.
    pub fn within(&self, from: f64, to: f64) -> Range<usize> {
        self.time.partition_point(|t| *t < from)..self.time.partition_point(|t| *t <= to)
    }

    /// Iterates over times and values from `from` to `to`, both inclusive, s.
    pub fn samples(&self, from: f64, to: f64) -> impl Iterator<Item = (f64, &T)> {
        let range = self.within(from, to);
        self.time[range.clone()].iter().copied().zip(&self.value[range])
    }

    /// Returns the median interval between samples, s; infinite for fewer than two samples.
    pub fn period(&self) -> f64 {
        let mut intervals: Vec<f64> = self.time.windows(2).map(|w| w[1] - w[0]).collect();
        if intervals.is_empty() {
            return f64::INFINITY;
        }
        let middle = intervals.len() / 2;
        *intervals.select_nth_unstable_by(middle, f64::total_cmp).1
    }

    /// Returns the spans from `from` to `to` without samples that are longer than `limit`, s.
    pub fn gaps(&self, from: f64, to: f64, limit: f64) -> Vec<[f64; 2]> {
        let range = self.within(from, to);
        let inner = self.time[range].iter().copied();
        let times: Vec<f64> =
            std::iter::once(from).chain(inner).chain(std::iter::once(to)).collect();
        times.windows(2).filter(|w| w[1] - w[0] > limit).map(|w| [w[0], w[1]]).collect()
    }

    /// Finds a time between the samples: the index of the sample before or at it, and the fraction
    /// of the interval to the next sample. Times outside the series have the first or the last
    /// sample. `None` if the series is empty.
    pub(crate) fn place(&self, time: f64) -> Option<(usize, f64)> {
        let after = self.time.partition_point(|t| *t <= time);
        match (after, self.time.len()) {
            (_, 0) => None,
            (0, _) => Some((0, 0.0)),
            (k, n) if k == n => Some((n - 1, 0.0)),
            (k, _) => Some((k - 1, (time - self.time[k - 1]) / (self.time[k] - self.time[k - 1]))),
        }
    }
}

impl Series<nalgebra::Vector3<f64>> {
    /// Returns the value at a time, interpolated linearly and held before the first and after the
    /// last sample; `None` if the series is empty.
    pub fn at(&self, time: f64) -> Option<nalgebra::Vector3<f64>> {
        let (k, share) = self.place(time)?;
        let here = self.value[k];
        Some(if share > 0.0 { here + (self.value[k + 1] - here) * share } else { here })
    }

    /// Returns the mean of the values from `from` to `to`, s, and their number.
    pub fn mean(&self, from: f64, to: f64) -> Option<(nalgebra::Vector3<f64>, usize)> {
        let range = self.within(from, to);
        let n = range.len();
        (n > 0).then(|| (self.value[range].iter().sum::<nalgebra::Vector3<f64>>() / n as f64, n))
    }
}
