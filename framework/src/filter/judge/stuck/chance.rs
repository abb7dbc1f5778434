//! Chance by which a sensor repeats a sample, learnt from the samples before.
//!
//! A sensor whose noise is below its resolution repeats its samples while the vehicle keeps the value.
//! Between two samples a channel changes by `m`, where the filter predicts `p`. The noise `v` of the sensor
//! is in two successive differences `d` with opposite signs:
//! ```text
//! d_k = m_k - p_k = v_k - v_(k-1) + q_k
//! scatters if   opposite - same > 4 sqrt(opposite + same)
//! ```
//! counts the pairs of successive differences whose signs are opposite, and the same. Of white noise two
//! thirds are opposite (correlation -1/2), of the error `q` of the prediction half. A pair counts if both
//! differences are above the resolution, which is the smallest change of the channel: rounding alone gives
//! smaller ones. Of `n` samples `r` repeated the one before. With no prior knowledge of their share, the
//! next `k` repeat it by chance with the probability
//! ```text
//! (r + 1) / (n + 2) * (r + 2) / (n + 3) * ... * (r + k) / (n + k + 1)
//! ```
//! (Laplace's rule of succession). Instruments may be quieter at rest, so that a repetition counts only
//! while the vehicle moves.

use crate::checkpoint::saved;
use crate::units::sample::MAX_CHANNELS;

/// Probability of repetitions that are no chance, at each of some ten thousand looks.
const IMPROBABLE: f64 = 1e-9;
/// Sigmas by which opposite signs have to outnumber equal ones.
const SIGMAS: f64 = 4.0;
/// Least share of samples whose differences are above the resolution.
const OFTEN: f64 = 0.1;

/// Repetitions of a sample, or of one of its channels.
#[derive(Clone, Copy, Debug, Default)]
struct Rows {
    /// Number of samples that were compared with the one before, and of those that repeated it.
    compared: f64,
    repeated: f64,
    /// Repetitions in a row, and how many of them while the vehicle moved.
    row: f64,
    moving: f64,
    /// Logarithm of the probability of those while the vehicle moved.
    ln: f64,
}

saved!(Rows { compared, repeated, row, moving, ln });

impl Rows {
    /// Counts a repetition.
    fn repeat(&mut self, moves: bool) {
        self.row += 1.0;
        if moves {
            self.moving += 1.0;
            let share = (self.repeated + self.moving) / (self.compared + self.moving + 1.0);
            self.ln += share.ln();
        }
    }

    /// Ends a row of repetitions with another sample; those that are no chance teach nothing.
    fn end(&mut self, stuck: bool) {
        if !stuck {
            self.compared += self.row + 1.0;
            self.repeated += self.row;
        }
        (self.row, self.moving, self.ln) = (0.0, 0.0, 0.0);
    }

    fn improbable(&self) -> bool {
        self.ln < IMPROBABLE.ln()
    }
}

/// Scatter and repetitions of one channel.
#[derive(Clone, Copy, Debug)]
struct Channel {
    /// Last value and difference; NaN where there is none.
    value: f64,
    difference: f64,
    /// Smallest change.
    resolution: f64,
    /// Pairs with opposite and with equal signs.
    opposite: f64,
    same: f64,
    rows: Rows,
    stuck: bool,
}

saved!(Channel { value, difference, resolution, opposite, same, rows, stuck });

impl Default for Channel {
    fn default() -> Self {
        let (value, difference, resolution) = (f64::NAN, f64::NAN, f64::INFINITY);
        let (opposite, same, rows, stuck) = (0.0, 0.0, Rows::default(), false);
        Self { value, difference, resolution, opposite, same, rows, stuck }
    }
}

impl Channel {
    /// Takes a value, and the innovations of it and of the one before after its correction.
    fn take(&mut self, value: f64, [innovation, left]: [f64; 2], moves: bool) {
        let change = (value - std::mem::replace(&mut self.value, value)).abs();
        if change > 0.0 {
            self.resolution = self.resolution.min(change);
            self.rows.end(std::mem::take(&mut self.stuck));
        } else if change == 0.0 && value != 0.0 {
            self.rows.repeat(moves);
            self.stuck |= self.rows.improbable() && self.scatters(self.rows.compared);
        }
        // without a value before the change is NaN
        let difference = innovation - left + 0.0 * change;
        let before = std::mem::replace(&mut self.difference, difference);
        if difference.abs() > self.resolution && before.abs() > self.resolution {
            let pairs = if difference * before < 0.0 { &mut self.opposite } else { &mut self.same };
            *pairs += 1.0;
        }
    }

    /// Returns `true` if the sensor itself scatters by more than its resolution, in `n` samples.
    fn scatters(&self, n: f64) -> bool {
        let pairs = self.opposite + self.same;
        self.opposite - self.same > SIGMAS * pairs.sqrt() && pairs > OFTEN * n
    }
}

/// What the samples before show of repetitions.
#[derive(Clone, Debug, Default)]
pub(super) struct Chance {
    channels: [Channel; MAX_CHANNELS],
    /// Repetitions of whole samples.
    rows: Rows,
}

saved!(Chance { rows } each { channels });

impl Chance {
    /// Ends a row of repetitions with another sample; those of a sensor that was stuck teach nothing.
    pub(super) fn end(&mut self, stuck: bool) {
        self.rows.end(stuck);
    }

    /// Takes a value of a channel, and the innovations of it and of the one before after its correction.
    pub(super) fn take(&mut self, channel: usize, value: f64, innovations: [f64; 2], moves: bool) {
        self.channels[channel].take(value, innovations, moves);
    }

    /// Channels whose repetitions are no chance, one bit each.
    pub(super) fn stuck(&self) -> u16 {
        let bits =
            self.channels.iter().enumerate().map(|(c, channel)| u16::from(channel.stuck) << c);
        bits.sum()
    }

    /// Counts a repetition, and returns `true` if so many are no chance.
    pub(super) fn repeats(&mut self, moves: bool) -> bool {
        self.rows.repeat(moves);
        let compared = self.rows.compared;
        self.rows.improbable() && self.channels.iter().any(|c| c.scatters(compared))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::simulate::Random;

    /// Number of repetitions after which chance is excluded, of a channel that reads a motion with noise
    /// and a resolution for 400 samples, and then the last value. The filter predicts with an error that
    /// walks.
    fn found(seed: u64, noise: f64, resolution: f64, walk: f64) -> Option<u32> {
        let (mut chance, mut random) = (Chance::default(), Random::new(seed, "chance"));
        let (mut value, mut left, mut error) = (f64::NAN, 0.0, 0.0);
        for k in 0..800 {
            let truth = 30.0 * resolution * (f64::from(k.min(400)) / 20.0).sin();
            error += walk * random.normal();
            let read = ((truth + noise * random.normal()) / resolution).round() * resolution;
            let now = if k < 400 { read } else { value };
            let innovation = now - truth - error;
            if now == value {
                chance.take(0, now, [innovation, left], true);
                if chance.repeats(true) {
                    return Some(k - 399);
                }
            } else {
                chance.end(false);
                chance.take(0, now, [innovation, left], true);
            }
            (value, left) = (now, innovation);
        }
        None
    }

    /// With noise of the resolution a sample repeats the one before with 0.28, and 0.28^17 is 4e-10; the share
    /// of 400 samples is known to 8 %, and a last row of chance may be longer by a few.
    #[test]
    fn a_sensor_that_scattered_is_stuck_after_a_few_repetitions() {
        for seed in 0..30 {
            for (noise, most) in [(1.0, 25), (3.0, 14), (100.0, 8)] {
                let found = found(seed, noise, 1.0, 0.3);
                assert!(found.is_some_and(|found| found <= most), "{seed} {noise}: {found:?}");
            }
        }
    }

    #[test]
    fn a_sensor_whose_noise_is_below_its_resolution_repeats_by_right() {
        for seed in 0..30 {
            for noise in [0.0, 0.05, 0.2, 0.35] {
                assert_eq!(found(seed, noise, 1.0, 0.0), None, "{seed} {noise}");
                assert_eq!(found(seed, noise, 1.0, 0.05), None, "{seed} {noise}");
            }
        }
    }

    /// The errors of the prediction are independent from sample to sample.
    #[test]
    fn a_filter_that_predicts_badly_shows_no_scatter_of_a_sensor() {
        for seed in 0..30 {
            assert_eq!(found(seed, 0.2, 1.0, 5.0), None, "{seed}");
        }
    }

    #[test]
    fn repetitions_at_rest_do_not_count() {
        let mut chance = Chance::default();
        let mut random = Random::new(1, "rest");
        let mut left = 0.0;
        for k in 0..400 {
            let value = random.normal();
            if k > 0 {
                chance.end(false);
            }
            chance.take(0, value, [value, left], true);
            left = value;
        }
        assert!((0..1000).all(|_| !chance.repeats(false)));
        // of 399 samples none repeated the one before: (1 / 401) (2 / 402) (3 / 403) (4 / 404) is 9e-10
        assert!((0..3).all(|_| !chance.repeats(true)) && chance.repeats(true));
    }
}
