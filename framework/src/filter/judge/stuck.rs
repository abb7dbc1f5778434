//! Repeated samples: an instrument that is stuck gives the same numbers again and again.
//!
//! A repetition alone is no fault: a quantised speed at rest repeats too, and zeros do not count. It
//! is one if the prediction has moved meanwhile, or if the samples before scattered so that chance does not
//! repeat them. The filter follows the samples that it uses, so the motion is summed from sample to
//! sample:
//! ```text
//! M = sum (h-(k) - h+(k-1)) = sum (y+(k-1) - y(k))      y+: innovation after the update
//! V = sum (S - R)^2 / S       variance of the corrections H K y that a sample at rest causes
//! stuck if M^2 > 3.5^2 (V + S) in some channel
//! ```
//! The scatter is learnt from the samples before (`judge/stuck/chance.rs`). It also shows a channel that is
//! stuck while the others vary; the others are then used without it.
//!
//! The noise of a repeated sample is the same each time. A filter that takes it for new noise each
//! time would be overconfident. If a sensor of several channels varied before, `R` therefore grows
//! with the square of the number of repetitions, so that any number of them carries bounded
//! information.

mod chance;

use crate::checkpoint::saved;
use crate::model::record::finding::{Basis, Finding, Severity};
use crate::model::sensor::SensorInfo;
use crate::state::covariance::Update;
use crate::units::sample::{MAX_CHANNELS, Sample, channels};
use crate::units::time::Time;
use chance::Chance;

/// Number of equal samples in a row that may be chance.
const CHANCE: u32 = 5;

/// Number of different samples in a row after which equal ones are no property of the instrument.
const VARIED: u32 = 20;

/// Ratio of motion to its sigma from which on the prediction has moved.
const SIGMAS: f64 = 3.5;

/// Repetitions of one sensor.
#[derive(Clone, Default)]
pub(in crate::filter) struct Repeats {
    last: Option<Sample>,
    /// Number of equal samples in a row, and of different ones before.
    count: u32,
    varied: u32,
    /// Motion of the prediction, its variance, and the innovation after the last sample, by channel.
    motion: [f64; MAX_CHANNELS],
    variance: [f64; MAX_CHANNELS],
    left: [f64; MAX_CHANNELS],
    /// Set once the sensor is stuck, and if the motion shows it.
    stuck: bool,
    moved: bool,
    /// Time of the first of the equal samples.
    since: Time,
    chance: Chance,
    /// Channels that are stuck while others vary, one bit each.
    channels: u16,
}

saved!(Repeats {
    last,
    count,
    varied,
    motion,
    variance,
    left,
    stuck,
    moved,
    since,
    chance,
    channels
});

/// A sensor that is stuck.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::filter) struct Stuck {
    since: Time,
    count: u32,
    /// Set if the prediction has moved, and not the scatter of the samples before has shown it.
    moved: bool,
}

impl Stuck {
    /// Finding about the sensor.
    pub(in crate::filter) fn finding(&self, time: Time, sensor: &str) -> Finding {
        let &Self { since, count, moved } = self;
        // more repetitions than a check needs have been used as if their noise were new
        let late = count > 4 * CHANCE;
        let (severity, why) = match (moved, late) {
            (true, true) => (Severity::DoNotUse, "while the vehicle moves"),
            (true, false) => (Severity::Doubtful, "while the vehicle moves"),
            (false, true) => (Severity::Doubtful, "and the samples before scattered"),
            (false, false) => (Severity::Contained, "and the samples before scattered"),
        };
        Finding {
            time,
            about: sensor.to_owned(),
            severity,
            basis: Basis::Samples,
            text: format!(
                "stuck: {count} samples since {since} are equal, {why}; they are rejected from now on"
            ),
            remedy: "look at the instrument and at its driver, which may repeat old samples"
                .to_owned(),
        }
    }
}

/// Finding about channels that are stuck while the others of their samples vary.
pub(in crate::filter) fn stuck_channels(time: Time, sensor: &SensorInfo, stuck: u16) -> Finding {
    let names: Vec<_> = channels(stuck).map(|c| sensor.channel(c)).collect();
    let (repeat, are) = match names.len() {
        1 => ("repeats its value", "it is"),
        _ => ("repeat their values", "they are"),
    };
    Finding {
        time,
        about: sensor.name.clone(),
        severity: Severity::Contained,
        basis: Basis::Samples,
        text: format!(
            "stuck: {} {repeat} while the other channels vary; {are} left out from now on",
            names.join(", ")
        ),
        remedy: "look at the instrument and at its driver, which may repeat old values".to_owned(),
    }
}

impl Repeats {
    /// Takes the next sample with these channels, and returns the factor of its sigma.
    pub(in crate::filter) fn take(&mut self, sample: &Sample, present: u16) -> f64 {
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
            self.chance.end(self.stuck);
        }
        (self.count, self.since) = (1, sample.time);
        (self.stuck, self.moved) = (false, false);
        self.motion = [0.0; MAX_CHANNELS];
        self.variance = [0.0; MAX_CHANNELS];
        1.0
    }

    /// Adds the motion up to a sample, whose sigma has that factor, and returns the number of equal
    /// samples if the sensor is stuck. `moves` is asked for a vehicle that moves. Call after
    /// [`Update::innovate`].
    pub(in crate::filter) fn stuck(
        &mut self,
        update: &Update,
        present: u16,
        factor: f64,
        moves: bool,
    ) -> Option<Stuck> {
        for (a, c) in channels(present).enumerate().take(update.m) {
            if let Some(value) = self.last.as_ref().and_then(|last| last.get(c)) {
                self.chance.take(c, value, [update.innovation[a], self.left[c]], moves);
            }
        }
        if self.count > 1 && !self.stuck {
            for (a, c) in channels(present).enumerate().take(update.m) {
                let r = update.r[a * update.m + a];
                // S with the noise of a single sample
                let s = update.s[a * update.m + a] - r * (1.0 - 1.0 / (factor * factor));
                self.motion[c] += self.left[c] - update.innovation[a];
                let bound = SIGMAS * SIGMAS * (self.variance[c] + s);
                self.moved |= self.count >= CHANCE && self.motion[c] * self.motion[c] > bound;
            }
            self.stuck = self.moved || self.chance.repeats(moves);
        }
        let &mut Self { since, count, moved, .. } = self;
        self.stuck.then_some(Stuck { since, count, moved })
    }

    /// Channels of a sample that are stuck while others vary, and those of them that were not before, one
    /// bit each. Call after [`Self::stuck`].
    pub(in crate::filter) fn stuck_alone(&mut self, present: u16) -> [u16; 2] {
        let stuck = self.chance.stuck() & present;
        let alone = if self.count > 1 { self.channels & stuck } else { stuck };
        let before = std::mem::replace(&mut self.channels, alone);
        [alone, alone & !before]
    }

    /// Innovation after the last sample, by channel.
    pub(in crate::filter) fn left(&self) -> &[f64; MAX_CHANNELS] {
        &self.left
    }

    /// Keeps the innovation for the next sample: as it is, or after the update by this sample.
    pub(in crate::filter) fn keep(&mut self, update: &Update, present: u16, used: bool) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::sample::SensorId;

    /// An update by one channel that measures the only state, with `S` = 4 and `R` = 1.
    fn update(innovation: f64, delta: f64) -> Update {
        let mut update = Update::with_capacity(1, 1);
        update.m = 1;
        update.columns.push(0);
        update.h.push(1.0);
        update.innovation.push(innovation);
        update.r.push(1.0);
        update.s.push(4.0);
        update.delta[0] = delta;
        update
    }

    /// Takes equal samples whose innovation is `y` each, none of which the filter uses; returns the
    /// number at which the sensor is stuck.
    fn stuck_after(y: impl Fn(u32) -> f64) -> Option<u32> {
        let mut repeats = Repeats::default();
        (1..=30).find(|&k| {
            let sample = Sample::new(Time::default(), SensorId(0), &[3.0]);
            let factor = repeats.take(&sample, 1);
            let update = update(y(k), 0.0);
            let stuck = repeats.stuck(&update, 1, factor, true);
            repeats.keep(&update, 1, false);
            stuck.is_some()
        })
    }

    /// 4 CHANCE = 20 samples.
    #[test]
    fn more_than_20_equal_samples_make_a_result_unusable() {
        let severity = |moved, count| {
            Stuck { since: Time::MIN, count, moved }.finding(Time::MIN, "log").severity
        };
        assert_eq!([20, 21].map(|n| severity(true, n)), [Severity::Doubtful, Severity::DoNotUse]);
        assert_eq!([20, 21].map(|n| severity(false, n)), [Severity::Contained, Severity::Doubtful]);
    }

    /// Without an update the motion is y(1) - y(k), and the bound is 3.5 sqrt(S) = 7. Fewer than 5
    /// equal samples may be chance.
    #[test]
    fn equal_samples_are_stuck_once_the_prediction_has_moved_by_3_5_sigma() {
        assert_eq!(stuck_after(|_| 9.0), None);
        assert_eq!(stuck_after(|k| if k > 1 { -6.9 } else { 0.0 }), None);
        assert_eq!(stuck_after(|k| if k > 1 { -7.1 } else { 0.0 }), Some(5));
        assert_eq!(stuck_after(|k| if k > 1 { 7.1 } else { 0.0 }), Some(5));
        assert_eq!(stuck_after(|k| if k > 8 { 7.1 } else { 0.0 }), Some(9));
    }

    /// Each update adds (S - R)^2 / S = 9/4 to the variance, and takes H delta off the innovation.
    #[test]
    fn each_used_sample_adds_the_variance_of_its_correction() {
        let mut repeats = Repeats::default();
        for k in 1..=3 {
            repeats.keep(&update(2.0, 0.5), 0b100, true);
            assert_eq!((repeats.variance[2], repeats.left[2]), (2.25 * f64::from(k), 1.5));
        }
        repeats.keep(&update(2.0, 0.5), 0b100, false);
        assert_eq!((repeats.variance[2], repeats.left[2]), (6.75, 2.0));
    }

    /// After 21 different samples the noise of the ninth equal one is 9/5 times that of the first,
    /// so that the root of S without the repetition is 2, and the prediction of the second channel
    /// has moved by 7.1. The first channel and their correlation have no part in it.
    #[test]
    fn each_channel_has_its_own_noise() {
        let sample = |x: f64| Sample::new(Time::default(), SensorId(0), &[x, 2.0 * x]);
        let mut repeats = Repeats::default();
        (1..=21).for_each(|k| assert_eq!(repeats.take(&sample(f64::from(k)), 0b11), 1.0));
        let stuck = (1..=30).find(|&k| {
            let factor = repeats.take(&sample(0.5), 0b11);
            assert_eq!(factor, f64::from(k.max(5)) / 5.0);
            let mut update = Update::with_capacity(2, 2);
            update.m = 2;
            update.innovation.extend([0.0, if k > 8 { 7.1 } else { 0.0 }]);
            update.r.extend([100.0, -50.0, -50.0, 1.0].map(|r| r * factor * factor));
            update.s.extend([400.0, 0.0, 0.0, 3.0 + factor * factor]);
            let stuck = repeats.stuck(&update, 0b11, factor, true);
            repeats.keep(&update, 0b11, false);
            stuck.is_some()
        });
        assert_eq!(stuck, Some(9));
    }
}
