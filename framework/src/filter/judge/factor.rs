//! Comparison of the changes of a sensor's channels with the changes that the filter predicts,
//! which shows a wrong sign or unit of a channel.
//!
//! Between two samples of a channel the filter, driven by the other sensors, predicts the change `p`,
//! where the samples change by `m`. The innovation `y` of the second sample and the part `y0` of the
//! first one's that its correction left give `p = m - (y - y0)`, so that a sample that the gate refused
//! counts as much as any other. With the sums over spans,
//! ```text
//! a = sum m p / sum p^2,      Q(a) = sum (m - a p)^2,      t^2 = (n - 1) (Q(1) / Q(a) - 1)
//! ```
//! is the factor of the channel, and Student's `t` of `n - 1` degrees of freedom against a factor of one.
//! Its tail is about `(1 + t^2 / (n - 1))^(-(n - 1) / 2)`, the root of `(Q(a) / Q(1))^(n - 1)`. Errors of
//! `p` pull `a` towards zero and never away from it, so that no noise gives a factor far above one or
//! below zero.

use crate::checkpoint::saved;
use crate::model::record::Observer;
use crate::model::record::finding::{Basis, Finding, Severity};
use crate::model::sensor::SensorInfo;
use crate::state::covariance::Update;
use crate::units::sample::{Sample, channels};
use crate::units::time::Time;
use std::f64::consts::TAU;

/// Length of the spans, s: a slow vehicle moves by more than the noise of a sample.
const SPAN: f64 = 5.0;
/// Factors outside belong to no healthy channel: a knot is 0.51 m/s.
const PLAUSIBLE: std::ops::Range<f64> = -0.5..1.5;
/// Twice the logarithm of the chance by which a factor of one looks like another one: 2e-9 at each of some
/// ten thousand looks, as at ten channels every five seconds for an hour and a half.
const EVIDENCE: f64 = 40.0;
/// Ratio of the residuals that is no small error of the prediction, and the share of the change that the
/// factor has to explain.
const RATIO: f64 = 9.0;
const EXPLAINED: f64 = 0.5;
/// Largest share of one span in the sum of squares: a jump is no motion. Of a motion in two spans, one
/// of which is half as long, the larger has 1 / (1 + 0.25) = 0.8.
const JUMP: f64 = 0.8;

/// A sample, and what the filter did with it.
pub(in crate::filter) struct Treated<'a> {
    pub(in crate::filter) sample: &'a Sample,
    /// The channels that the sample has, one bit each.
    pub(in crate::filter) present: u16,
    pub(in crate::filter) update: &'a Update,
    /// Set if the sample corrected the state.
    pub(in crate::filter) used: bool,
}

/// A channel with a factor that is none of a healthy sensor.
struct WrongFactor {
    channel: usize,
    factor: f64,
}

/// Changes of one channel.
#[derive(Clone, Copy, Debug, Default)]
struct Change {
    /// Value of the last sample, and its innovation after the correction.
    last: Option<[f64; 2]>,
    begin: Time,
    /// Measured and predicted change of the span.
    span: [f64; 2],
    /// Sums of `m^2`, `m p` and `p^2`, the largest `m^2`, and the number of spans.
    sums: [f64; 3],
    largest: f64,
    count: f64,
}

saved!(Change { last, begin, span, sums, largest, count });

/// Factors of the channels of one sensor.
#[derive(Clone, Debug)]
pub(in crate::filter) struct Factor {
    changes: Vec<Change>,
    /// Channels whose values are angles.
    angles: Vec<bool>,
    reported: bool,
}

saved!(Factor { reported } each { changes } except { angles });

impl Factor {
    /// The factors of the first channels of a sensor.
    pub(in crate::filter) fn new(info: &SensorInfo, channels: usize) -> Self {
        let angle = |k: usize| info.channels.get(k).is_some_and(|c| c.unit.suffix() == "rad");
        let angles = (0..channels).map(angle).collect();
        Self { changes: vec![Change::default(); channels], angles, reported: false }
    }

    /// Ends the comparison: the driving sensor is at fault, which predicts the changes.
    pub(in crate::filter) fn end(&mut self) {
        self.reported = true;
    }

    /// Takes a sample after its correction, or one that was not used, and reports the first channel with
    /// a factor that is none of a healthy sensor.
    pub(in crate::filter) fn take(
        &mut self,
        treated: &Treated<'_>,
        sensor: &SensorInfo,
        observer: &mut dyn Observer,
    ) {
        let &Treated { sample, present, update, used } = treated;
        let mut found = None;
        let w = update.columns.len();
        for (a, channel) in channels(present).enumerate().take(update.m) {
            let (Some(change), Some(value)) = (self.changes.get_mut(channel), sample.get(channel))
            else {
                continue;
            };
            let y = update.innovation[a];
            let h = update.columns.iter().zip(&update.h[a * w..]);
            let corrected = || h.map(|(column, h)| h * update.delta[*column]).sum::<f64>();
            let left = if used { y - corrected() } else { y };
            change.add(sample.time, [value, y, left], self.angles[channel]);
            found = found.or(change.factor().map(|factor| WrongFactor { channel, factor }));
        }
        if let Some(found) = found.filter(|_| !self.reported) {
            self.reported = true;
            observer.finding(found.finding(sample.time, sensor));
        }
    }
}

impl Change {
    /// Adds a value with its innovation before and after the correction.
    fn add(&mut self, time: Time, [value, y, left]: [f64; 3], angle: bool) {
        let Some([before, rest]) = self.last.replace([value, left]) else {
            self.begin = time;
            return;
        };
        let turns = if angle { ((value - before) / TAU).round() } else { 0.0 };
        let measured = value - before - turns * TAU;
        self.span[0] += measured;
        self.span[1] += measured - (y - rest);
        if time.since(self.begin) >= SPAN {
            let [m, p] = std::mem::take(&mut self.span);
            self.begin = time;
            self.count += 1.0;
            self.largest = self.largest.max(m * m);
            [m * m, m * p, p * p].iter().zip(&mut self.sums).for_each(|(x, sum)| *sum += x);
        }
    }

    /// The factor, if no healthy channel has it.
    fn factor(&self) -> Option<f64> {
        let [mm, mp, pp] = self.sums;
        let factor = mp / pp;
        if self.span != [0.0; 2] || !factor.is_finite() || PLAUSIBLE.contains(&factor) {
            return None;
        }
        let residual = |a: f64| mm - 2.0 * a * mp + a * a * pp;
        let (own, one) = (residual(factor).max(0.0), residual(1.0));
        let clear = one >= RATIO * own && own <= EXPLAINED * mm && self.largest <= JUMP * mm;
        (clear && (self.count - 1.0) * (one / own).ln() >= EVIDENCE).then_some(factor)
    }
}

impl WrongFactor {
    fn finding(&self, time: Time, sensor: &SensorInfo) -> Finding {
        let (name, factor) = (sensor.words(self.channel), self.factor);
        let cause = if factor < 0.0 {
            "its sign is reversed, for example because its axis points the other way"
        } else {
            "its unit is wrong"
        };
        Finding {
            time,
            about: sensor.name.clone(),
            severity: Severity::DoNotUse,
            basis: Basis::Explanation,
            text: format!(
                "its {name} changes by {factor:.2} times what the other sensors predict: {cause}"
            ),
            remedy: format!("check sign and unit of {name}; `navfuse diagnose` tries them"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::simulate::Random;

    /// The factor that is found of a channel that reads `factor` times a slow motion, with the noise
    /// `sigma`, beside a filter that predicts the motion with an error of 2 % and follows the channel
    /// by that share.
    fn found(factor: f64, sigma: f64, share: f64) -> Option<f64> {
        let (mut change, mut random) = (Change::default(), Random::new(1, "factor"));
        let (mut state, mut before) = (0.0, 0.0);
        (0..400).find_map(|k| {
            let time = f64::from(k) * 0.5;
            let truth = 10.0 * (time / 30.0).sin();
            state += 1.02 * (truth - before);
            before = truth;
            let value = factor * truth + sigma * random.normal();
            let (y, left) = (value - state, (1.0 - share) * (value - state));
            state += share * y;
            change.add(Time::from_nanos((time * 1e9) as i64), [value, y, left], false);
            change.factor()
        })
    }

    #[test]
    fn a_wrong_sign_or_unit_is_found_with_its_size_whether_the_filter_follows_it_or_not() {
        for factor in [-1.0, -3.28, 1.94, 3.28, 9.8, 100.0] {
            for share in [0.0, 0.1, 0.5] {
                let found = found(factor, 0.1, share).unwrap_or_default();
                assert!((found / factor - 1.0).abs() < 0.1, "{factor} {share}: {found}");
            }
        }
    }

    #[test]
    fn a_healthy_channel_and_one_of_noise_alone_have_no_factor() {
        for factor in [0.0, 0.1, 0.8, 1.0, 1.2] {
            for sigma in [0.01, 1.0, 100.0] {
                assert_eq!(found(factor, sigma, 0.1), None, "{factor} {sigma}");
            }
        }
    }

    #[test]
    fn an_angle_is_followed_across_a_full_turn() {
        let mut change = Change::default();
        let step = |k: i32| f64::from(k).rem_euclid(2.0 * TAU) - TAU;
        for k in 0..40 {
            let value = step(k) - TAU * (step(k) / TAU).round();
            change.add(Time::from_nanos(i64::from(k) * 250_000_000), [value, 0.0, 0.0], true);
        }
        assert_eq!(change.factor(), None);
        let [mm, mp, pp] = change.sums;
        assert!((mm - 400.0).abs() < 1e-6 && mp == mm && pp == mm, "{mm}");
    }
}
