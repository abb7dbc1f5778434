//! Repetitions of the driving sensor's samples, zeros, and values beyond the range.

use crate::model::screening::{Screening, Spread};
use crate::units::sample::MAX_CHANNELS;
use std::sync::Arc;

/// Probability of a repetition by chance that counts as frozen.
const CHANCE: f64 = 1e-9;
/// Least number of identical samples in a row that counts as frozen.
const FROZEN: f64 = 5.0;
/// Number of identical values in a row after which a single channel counts as stuck.
pub(super) const STUCK: u32 = 25;
/// Share of repetitions above which a channel is too coarse to judge it by its repetitions.
const COARSE: f64 = 0.02;
/// Longest repetition of a channel that counts for its share.
const SHORT: u32 = 3;
/// Number of samples before identical samples are judged.
const WARM: u64 = 100;

/// Fault of a sample of the driving sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    /// Every channel is exactly zero.
    Zeros,
    /// Channels are beyond their range.
    Range,
    /// Every channel repeats its value.
    Frozen,
    /// Single channels repeat their value.
    Stuck,
}

/// Repetitions so far.
#[derive(Clone)]
pub(super) struct Repeats {
    limits: Arc<Screening>,
    /// Last values as they came.
    pub(super) raw: Spread,
    /// Number of samples.
    pub(super) samples: u64,
    /// Number of identical samples in a row, of all so far, and of each channel in a row.
    pub(super) in_a_row: u32,
    repeated: u32,
    runs: [u32; MAX_CHANNELS],
    /// Share of repetitions of each channel.
    coarse: Spread,
}

impl Repeats {
    pub(super) fn new(limits: Arc<Screening>) -> Self {
        const ZERO: Spread = [0.0; MAX_CHANNELS];
        Self {
            limits,
            raw: ZERO,
            samples: 0,
            in_a_row: 0,
            repeated: 0,
            runs: [0; MAX_CHANNELS],
            coarse: ZERO,
        }
    }

    /// Fault of a sample by itself and by its repetition, with the channels that have it.
    pub(super) fn judge(&mut self, x: &Spread, interval: f64) -> Option<(Fault, u16)> {
        let n = self.limits.channels.len().min(MAX_CHANNELS);
        self.samples += 1;
        let all = ((1_u32 << n) - 1) as u16;
        let unit = if self.limits.integrals { interval } else { 1.0 };
        let (mut zero, mut same, mut beyond, mut stuck) = (true, self.samples > 1, 0_u16, 0_u16);
        for (c, &x) in x.iter().enumerate().take(n) {
            zero &= x == 0.0;
            // a channel without an interval has no limits yet
            if x.abs() > self.limits.channels[c].range * unit && unit > 0.0 {
                beyond |= 1 << c;
            }
            if x == self.raw[c] {
                self.runs[c] += 1;
                if self.runs[c] <= SHORT {
                    self.coarse[c] += (1.0 - self.coarse[c]) / 1000.0;
                } else if self.runs[c] >= STUCK && self.coarse[c] < COARSE && self.samples > 1000 {
                    stuck |= 1 << c;
                }
            } else {
                self.runs[c] = 0;
                self.coarse[c] -= self.coarse[c] / 1000.0;
                same = false;
            }
        }
        self.raw = *x;
        self.in_a_row = if same { self.in_a_row + 1 } else { 0 };
        if zero {
            return Some((Fault::Zeros, all));
        }
        if beyond != 0 {
            return Some((Fault::Range, beyond));
        }
        if same {
            if self.in_a_row <= FROZEN as u32 {
                self.repeated += 1;
            }
            if self.samples > WARM && f64::from(self.in_a_row) >= self.frozen_after(interval) {
                return Some((Fault::Frozen, all));
            }
        }
        (stuck != 0 && stuck != all).then_some((Fault::Stuck, stuck))
    }

    /// Number of identical samples in a row that counts as frozen: as many as chance repeats with
    /// the probability [`CHANCE`].
    fn frozen_after(&self, interval: f64) -> f64 {
        match self.limits.frozen {
            Some(seconds) => (seconds / interval).max(1.0),
            None => {
                let share = f64::from(self.repeated + 1) / (self.samples + 2) as f64;
                (CHANCE.ln() / share.min(0.99).ln()).max(FROZEN)
            }
        }
    }
}
