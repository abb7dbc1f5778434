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
        self.place_after(self.time.partition_point(|t| *t <= time), time)
    }

    /// As [`Self::place`], for times of which each is near the one before. `after` is the number of
    /// samples until the last such time, and then until this one.
    pub(crate) fn place_near(&self, after: &mut usize, time: f64) -> Option<(usize, f64)> {
        while *after > 0 && self.time.get(*after - 1).is_none_or(|t| *t > time) {
            *after -= 1;
        }
        while self.time.get(*after).is_some_and(|t| *t <= time) {
            *after += 1;
        }
        self.place_after(*after, time)
    }

    /// The place of a time with that many samples until it.
    fn place_after(&self, after: usize, time: f64) -> Option<(usize, f64)> {
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
        self.place(time).map(|place| self.value_at(place))
    }

    /// Returns the value at a place of [`Self::place`].
    pub(crate) fn value_at(&self, (k, share): (usize, f64)) -> nalgebra::Vector3<f64> {
        let here = self.value[k];
        if share > 0.0 { here + (self.value[k + 1] - here) * share } else { here }
    }

    /// Returns the mean of the values from `from` to `to`, s, and their number.
    pub fn mean(&self, from: f64, to: f64) -> Option<(nalgebra::Vector3<f64>, usize)> {
        let range = self.within(from, to);
        let n = range.len();
        (n > 0).then(|| (self.value[range].iter().sum::<nalgebra::Vector3<f64>>() / n as f64, n))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_place_near_another_time_is_that_of_the_search() {
        let mut series = Series::new("velocity");
        (0..20).for_each(|k| series.push(f64::from(k * k), k));
        // forward, backward, and with jumps, also outside of the series and at its samples
        let times = (-20..800).chain((-20..800).rev()).chain((0..800).map(|k| (k * 577) % 800));
        let mut after = 0;
        for time in times.map(|t| 0.5 * f64::from(t)) {
            assert_eq!(series.place_near(&mut after, time), series.place(time), "{time}");
        }
        assert_eq!(Series::<f64>::new("none").place_near(&mut 3, 1.0), None);
    }
}
