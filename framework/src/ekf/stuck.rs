//! Repeated samples: an instrument that is stuck gives the same numbers again and again.
//!
//! A repetition alone is no fault: a quantised speed at rest repeats too, and zeros do not count. It
//! is one if the prediction has moved meanwhile. The filter follows the samples that it uses, so
//! the motion is summed from sample to sample:
//! ```text
//! M = sum (h-(k) - h+(k-1)) = sum (y+(k-1) - y(k))      y+: innovation after the update
//! V = sum (S - R)^2 / S       variance of the corrections H K y that a sample at rest causes
//! stuck if M^2 > 3.5^2 (V + S) in some channel
//! ```
//! The noise of a repeated sample is the same each time. A filter that takes it for new noise each
//! time would be overconfident. If a sensor of several channels varied before, `R` therefore grows
//! with the square of the number of repetitions, so that any number of them carries bounded
//! information.

use crate::model::finding::{Basis, Finding, Severity};
use crate::state::covariance::Update;
use crate::units::sample::{MAX_CHANNELS, Sample};
use crate::units::time::Time;

/// Number of equal samples in a row that may be chance.
const CHANCE: u32 = 5;

/// Number of different samples in a row after which equal ones are no property of the instrument.
const VARIED: u32 = 20;

/// Ratio of motion to its sigma from which on the prediction has moved.
const SIGMAS: f64 = 3.5;

/// Repetitions of one sensor.
#[derive(Clone, Default)]
pub(super) struct Repeats {
    last: Option<Sample>,
    /// Number of equal samples in a row, and of different ones before.
    count: u32,
    varied: u32,
    /// Motion of the prediction, its variance, and the innovation after the last sample, by channel.
    motion: [f64; MAX_CHANNELS],
    variance: [f64; MAX_CHANNELS],
    left: [f64; MAX_CHANNELS],
    stuck: bool,
    /// Time of the first of the equal samples.
    since: Time,
}

/// A sensor that is stuck.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stuck {
    since: Time,
    count: u32,
}

impl Stuck {
    /// Finding about the sensor.
    pub(super) fn finding(&self, time: Time, sensor: &str) -> Finding {
        let &Self { since, count } = self;
        // more repetitions than a check needs have been used as if their noise were new
        let severity = if count > 4 * CHANCE { Severity::DoNotUse } else { Severity::Doubtful };
        Finding {
            time,
            about: sensor.to_owned(),
            severity,
            basis: Basis::Samples,
            text: format!(
                "stuck: {count} samples since {since} are equal, while the vehicle moves; they are \
                 rejected from now on"
            ),
            remedy: "look at the instrument and at its driver, which may repeat old samples"
                .to_owned(),
        }
    }
}

/// Channels of a mask, ascending.
fn channels(mask: u16) -> impl Iterator<Item = usize> {
    (0..MAX_CHANNELS).filter(move |channel| mask >> channel & 1 == 1)
}

impl Repeats {
    /// Takes the next sample with these channels, and returns the factor of its sigma.
    pub(super) fn take(&mut self, sample: &Sample, present: u16) -> f64 {
        let bits = |sample: &Sample, c: usize| sample.get(c).map(f64::to_bits);
        // a zero is no evidence: instruments give it at rest, and constraints always
        let varying = |c: &usize| sample.get(*c).is_some_and(|value| value != 0.0);
        let varying = channels(present).filter(varying).count();
        let same = varying > 0
            && self.last.as_ref().is_some_and(|last| {
                channels(present).all(|channel| bits(last, channel) == bits(sample, channel))
            });
        if same {
            self.count += 1;
            let several = self.varied >= VARIED && varying > 1;
            return if several {
                f64::from(self.count.max(CHANCE)) / f64::from(CHANCE)
            } else {
                1.0
            };
        }
        if self.last.replace(*sample).is_some() {
            self.varied = if self.count > 1 { 0 } else { self.varied.saturating_add(1) };
        }
        (self.count, self.stuck, self.since) = (1, false, sample.time);
        self.motion = [0.0; MAX_CHANNELS];
        self.variance = [0.0; MAX_CHANNELS];
        1.0
    }

    /// Adds the motion up to a sample, whose sigma has that factor, and returns the number of equal
    /// samples if the sensor is stuck. Call after [`Update::innovate`].
    pub(super) fn stuck(&mut self, update: &Update, present: u16, factor: f64) -> Option<Stuck> {
        if self.count > 1 && !self.stuck {
            for (a, c) in channels(present).enumerate().take(update.m) {
                let r = update.r[a * update.m + a];
                // S with the noise of a single sample
                let s = update.s[a * update.m + a] - r * (1.0 - 1.0 / (factor * factor));
                self.motion[c] += self.left[c] - update.innovation[a];
                let bound = SIGMAS * SIGMAS * (self.variance[c] + s);
                self.stuck |= self.count >= CHANCE && self.motion[c] * self.motion[c] > bound;
            }
        }
        self.stuck.then_some(Stuck { since: self.since, count: self.count })
    }

    /// Keeps the innovation for the next sample: as it is, or after the update by this sample.
    pub(super) fn keep(&mut self, update: &Update, present: u16, used: bool) {
        let (m, w) = (update.m, update.columns.len());
        for (a, c) in channels(present).enumerate().take(m) {
            let mut left = update.innovation[a];
            if used {
                let h = update.h[a * w..a * w + w].iter().zip(&update.columns);
                left -= h.map(|(h, &column)| h * update.delta[column]).sum::<f64>();
                let (s, r) = (update.s[a * m + a], update.r[a * m + a]);
                self.variance[c] += (s - r) * (s - r) / s;
            }
            self.left[c] = left;
        }
    }
}
