//! How often the driving sensor speaks, and when samples are missing.

/// Intervals longer than this multiple of the usual one have samples missing.
const LONG: f64 = 1.5;
/// So many long intervals in a row are a new rate, not a loss.
const NEW_RATE: u32 = 8;

/// The usual interval of the driving sensor.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cadence {
    usual: Option<f64>,
    in_a_row: u32,
    /// How many intervals had samples missing.
    pub missing: u64,
    /// The longest of them, s.
    pub longest: f64,
}

impl Cadence {
    /// The usual interval, s, after one of `duration`: that itself unless samples are missing.
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
}
