//! Cadence of the driving sensor: its usual interval, and intervals with missing samples.

/// Ratio to the usual interval above which samples are missing.
const LONG: f64 = 1.5;
/// Number of long intervals in a row that is a new rate, not a loss.
const NEW_RATE: u32 = 8;

/// Usual interval of the driving sensor.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cadence {
    usual: Option<f64>,
    in_a_row: u32,
    /// Number of intervals with missing samples.
    pub missing: u64,
    /// Longest of those intervals, s.
    pub longest: f64,
}

impl Cadence {
    /// Usual interval, s, after an interval of `duration`: the duration itself unless samples are
    /// missing.
    pub(super) fn usual(&mut self, duration: f64) -> f64 {
        match self.usual {
            Some(usual) if duration > LONG * usual && self.in_a_row < NEW_RATE => {
                self.in_a_row += 1;
                self.missing += 1;
                self.longest = self.longest.max(duration);
                usual
            }
            _ => {
                self.in_a_row = 0;
                // the first sample has no interval
                self.usual = (duration > 0.0).then_some(duration);
                duration
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hole_is_noticed_and_a_new_rate_is_learnt() {
        let mut cadence = Cadence::default();
        let seen: Vec<f64> = [0.0, 0.01, 0.01, 0.05, 0.01].map(|d| cadence.usual(d)).to_vec();
        assert_eq!(seen, [0.0, 0.01, 0.01, 0.01, 0.01]);
        assert_eq!((cadence.missing, cadence.longest), (1, 0.05));
        let slower: Vec<f64> = (0..10).map(|_| cadence.usual(0.02)).collect();
        assert_eq!(slower, [0.01, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01, 0.02, 0.02]);
    }

    /// 1.5 s is the longest interval that is a new rate of 1 Hz at once.
    #[test]
    fn samples_are_missing_above_one_and_a_half_intervals() {
        let mut cadence = Cadence::default();
        assert_eq!([1.0, 1.5].map(|d| cadence.usual(d)), [1.0, 1.5]);
        assert_eq!([2.26, 1.5].map(|d| cadence.usual(d)), [1.5, 1.5]);
        assert_eq!(cadence.missing, 1);
    }
}
