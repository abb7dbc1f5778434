//! Usual interval of the samples of a sensor, and the silence after which it is missed.

use crate::checkpoint::saved;

/// Number of latest intervals that decide.
const LATEST: usize = 8;
/// Number of usual intervals within which samples follow each other.
const INTERVALS: f64 = 3.0;
/// Shortest silence, s: an inertial system bridges less without harm.
const SHORTEST: f64 = 5.0;

/// Usual interval of a sequence of samples: the second longest of the latest eight. One gap does not
/// change it, whether at the beginning or later. An irregular sensor has its long intervals, and a new
/// rate is known after two of them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rhythm {
    latest: [f64; LATEST],
    count: usize,
}

saved!(Rhythm { latest, count });

impl Rhythm {
    /// Takes an interval, s. Several observations of one time have no interval.
    pub fn take(&mut self, interval: f64) {
        if interval <= 0.0 {
            return;
        }
        self.latest[self.count % LATEST] = interval;
        self.count += 1;
    }

    /// The usual interval, s; `None` before two samples of different times.
    pub fn usual(&self) -> Option<f64> {
        let [longest, second] = self.latest.iter().fold([0.0; 2], |[first, second], &x| {
            if x > first { [x, first] } else { [first, f64::max(second, x)] }
        });
        (self.count > 0).then_some(if self.count == 1 { longest } else { second })
    }

    /// Tests whether samples that are an interval apart, s, follow each other.
    pub fn follows(&self, interval: f64) -> bool {
        self.usual().is_some_and(|usual| interval <= INTERVALS * usual)
    }

    /// Tests whether a time without a sample, s, is a silence: see [`Self::patience`].
    pub fn misses(&self, elapsed: f64) -> bool {
        elapsed > SHORTEST && elapsed > self.patience()
    }

    /// The longest time without a sample that is no silence, s: three usual intervals, and at least
    /// 5 s. Without a usual interval it is infinite.
    pub fn patience(&self) -> f64 {
        self.usual().map_or(f64::INFINITY, |usual| (INTERVALS * usual).max(SHORTEST))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn patience(intervals: &[f64]) -> f64 {
        let mut rhythm = Rhythm::default();
        intervals.iter().for_each(|dt| rhythm.take(*dt));
        rhythm.patience()
    }

    #[test]
    fn the_silence_is_three_usual_intervals_or_5_s() {
        assert_eq!(patience(&[]), f64::INFINITY);
        assert_eq!(patience(&[0.0]), f64::INFINITY, "two observations of one time");
        assert_eq!(patience(&[0.2]), 5.0);
        assert_eq!(patience(&[2.1, 2.1]), 3.0 * 2.1);
        assert_eq!(patience(&[60.0]), 180.0);
    }

    #[test]
    fn one_gap_changes_nothing_and_the_long_intervals_of_an_irregular_sensor_are_usual() {
        assert_eq!(patience(&[300.0, 2.0, 2.0, 2.0]), 6.0, "a gap at the beginning");
        assert_eq!(patience(&[2.0, 2.0, 2.0, 300.0]), 6.0, "a gap later");
        assert_eq!(patience(&[2.0, 10.0, 2.0, 10.0]), 30.0, "irregular");
        assert_eq!(patience(&[2.0, 2.0, 4.0, 4.0]), 12.0, "slower");
        assert_eq!(patience(&[&[4.0][..], &[2.0; 8]].concat()), 6.0, "faster");
    }
}
