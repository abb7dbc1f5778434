//! Cadence of the driving sensor: its usual interval, and intervals with missing samples.

use crate::checkpoint::saved;

/// Ratio to the usual interval above which samples are missing, and below whose inverse the sensor
/// is faster.
const LONG: f64 = 1.5;
/// The same ratio where time stamps scatter: an interval with a missing sample is twice as long.
const LONGEST: f64 = 1.85;
/// Deviation of an interval, in standard deviations, that is no loss.
const SCATTER: f64 = 6.0;
/// Number of long or short intervals in a row that means a new rate, not a loss or a late stamp.
const NEW_RATE: u32 = 8;
/// Weight of an interval in the usual one.
const WEIGHT: f64 = 1.0 / 64.0;

/// Usual interval of the driving sensor: the mean of the intervals that are about as long.
///
/// A late time stamp makes one interval longer and the next one shorter. Neither changes the usual
/// interval much, and a longer interval is no loss if the stamps scatter as much. This matters for
/// an IMU that gives increments: after a late stamp they cover the whole interval, after a loss
/// only the usual one.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::filter) struct Cadence {
    /// Usual interval, s; zero before the second sample.
    pub interval: f64,
    /// Mean square of the relative deviations from the usual interval.
    scatter: f64,
    /// Number of intervals in a row that are longer, and shorter.
    longer: u32,
    shorter: u32,
    /// Number of intervals with missing samples.
    pub missing: u64,
    /// Longest of those intervals, s.
    pub longest: f64,
}

saved!(Cadence { interval, scatter, longer, shorter, missing, longest });

impl Cadence {
    /// Time that a sample covers, s, after an interval of `duration`: the duration itself, or the
    /// usual interval where samples are missing.
    #[inline]
    pub(in crate::filter) fn usual(&mut self, duration: f64) -> f64 {
        if duration <= 0.0 {
            // the first sample, or a second one of the same time
            return duration;
        }
        let Self { interval, scatter, longer, shorter, .. } = *self;
        (self.longer, self.shorter) = (0, 0);
        if interval <= 0.0 {
            self.interval = duration;
        } else if duration > LONG * interval && beyond(duration / interval - 1.0, scatter) {
            if longer < NEW_RATE {
                self.longer = longer + 1;
                self.missing += 1;
                self.longest = self.longest.max(duration);
                return interval;
            }
            self.interval = duration;
        } else if duration * LONG < interval {
            self.shorter = shorter + 1;
            if self.shorter > NEW_RATE {
                self.interval = duration;
            }
        } else {
            let change = duration - interval;
            self.interval += WEIGHT * change;
            self.scatter += WEIGHT * ((change / interval).powi(2) - scatter);
        }
        duration
    }
}

/// Returns `true` for an interval that is longer, by this share, than its scatter explains.
fn beyond(longer: f64, scatter: f64) -> bool {
    longer > LONGEST - 1.0 || longer * longer > SCATTER * SCATTER * scatter
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::simulate::Random;

    #[test]
    fn a_hole_is_noticed_and_a_new_rate_is_learnt() {
        let mut cadence = Cadence::default();
        let seen: Vec<f64> = [0.0, 0.01, 0.01, 0.05, 0.01].map(|d| cadence.usual(d)).to_vec();
        assert_eq!(seen, [0.0, 0.01, 0.01, 0.01, 0.01]);
        assert_eq!((cadence.missing, cadence.longest), (1, 0.05));
        let slower: Vec<f64> = (0..10).map(|_| cadence.usual(0.02)).collect();
        assert_eq!(slower, [0.01, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01, 0.02, 0.02]);
        // a faster rate is no loss, and is learnt after eight samples
        assert!((0..9).all(|_| cadence.usual(0.005) == 0.005));
        assert_eq!((cadence.interval, cadence.usual(0.011)), (0.005, 0.005));
    }

    #[test]
    fn samples_are_missing_above_one_and_a_half_intervals() {
        let mut cadence = Cadence::default();
        assert_eq!([1.0, 1.5].map(|d| cadence.usual(d)), [1.0, 1.5]);
        let usual = 1.0 + 0.5 / 64.0;
        assert_eq!([1.52, 1.5].map(|d| cadence.usual(d)), [usual, 1.5]);
        assert_eq!(cadence.missing, 1);
    }

    /// Increments over the interval before a late stamp and after it are those of the whole intervals
    /// between the stamps, so nothing is bridged.
    #[test]
    fn a_late_time_stamp_is_no_loss() {
        let mut cadence = Cadence::default();
        for _ in 0..100 {
            for duration in [0.01, 0.01, 0.014, 0.006, 0.0065, 0.0135, 0.01] {
                assert_eq!(cadence.usual(duration), duration);
            }
        }
        assert_eq!(cadence.missing, 0);
    }

    /// Stamps with an error of a tenth of an interval: the intervals have a standard deviation of 14 %,
    /// and 1.5 of them are 3.5 standard deviations from the mean. Lost samples are found all the same.
    #[test]
    fn scattered_time_stamps_are_no_loss_and_a_loss_among_them_is_found() {
        let (mut cadence, mut random) = (Cadence::default(), Random::new(1, "stamps"));
        let mut last = 0.0;
        let (mut lost, mut found) = (0, 0);
        for k in 1..100_000_u32 {
            if k % 1000 == 500 {
                lost += 1;
                continue;
            }
            let stamp = 0.01 * f64::from(k) + 0.001 * random.normal();
            let duration = stamp - last;
            let usual = cadence.usual(duration);
            found += u32::from(usual < duration);
            assert!(usual == duration || k % 1000 == 501, "{k}: {duration}");
            last = stamp;
        }
        // a loss makes 20 ms with the same deviation, of which 14 % are below 18.5 ms
        assert!(lost == 100 && found > 75, "{found} of {lost}");
    }

    /// Two samples that come at once at the beginning do not make all others late.
    #[test]
    fn a_short_first_interval_is_forgotten() {
        let mut cadence = Cadence::default();
        cadence.usual(1e-6);
        (0..9).for_each(|_| _ = cadence.usual(0.01));
        assert_eq!((cadence.interval, cadence.usual(0.01)), (0.01, 0.01));
    }
}
