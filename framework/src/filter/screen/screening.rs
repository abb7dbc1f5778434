//! Screening of the driving sensor: spikes, samples out of range, frozen sensors and channels.
//!
//! A good sample passes unchanged and at once. A sample that jumps is held until later samples show
//! if the channel came back (a spike, which is interpolated) or stayed (a manoeuvre, which passes
//! unchanged). While the sensor is frozen or out of range, its samples are replaced by the recent
//! mean, with an uncertainty that grows as the motion of the vehicle allows.
//!
//! Most samples are good, and a good sample costs little: the loops over its channels take four at
//! once where the processor can, with the same bits as one at a time.

use crate::checkpoint::saved;
use crate::filter::screen::repeats::{Fault, Repeats, STUCK};
use crate::filter::screen::usual::Usual;
use crate::model::process::screening::{Screening, Spread};
use crate::units::sample::{MAX_CHANNELS, Sample};
use crate::units::time::Time;
use pulp::{Arch, Scalar, Simd, WithSimd};
use std::collections::VecDeque;
use std::sync::Arc;

/// Largest number of samples of a spike.
const SPIKE: usize = 3;
/// Part of the jump to within which a channel comes back after a spike.
const BACK: f64 = 1.0 / 3.0;
/// Margin of the uncertainty of a bridge. Process noise is white, the unknown rate is constant: a
/// velocity that integrates the angle has the variance `t^4/4`, where noise with the same variance
/// `t^2` of the angle gives `t^4/6`; the ratio of the sigmas is `sqrt(3/2)`.
const CORRELATED: f64 = 1.25;

/// Observation that the screening reports.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::filter) enum News {
    /// Spike of some channels, bridged.
    Spike { time: Time, channel: usize, jump: f64, samples: usize },
    /// Faulty samples before the first good one, which are not used.
    Skipped(Skipped),
    /// End of a span of faulty samples, or its length when it became too long.
    Bridge { fault: Fault, channels: u16, from: Time, to: Time, too_long: bool, first: bool },
}

/// Span of faulty samples.
#[derive(Clone, Copy, Default)]
struct Bridge {
    fault: Fault,
    channels: u16,
    /// Time of the last good sample.
    from: Time,
    /// Time of the last replaced sample.
    to: Time,
    /// Integral of the unknown part of each channel so far, 1-sigma squared.
    unknown: Spread,
    reported: bool,
}

saved!(Bridge { fault, channels, from, to, unknown, reported });

/// Span of faulty samples before the first good one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::filter) struct Skipped {
    pub(in crate::filter) fault: Fault,
    pub(in crate::filter) channels: u16,
    pub(in crate::filter) from: Time,
    pub(in crate::filter) to: Time,
}

saved!(Skipped { fault, channels, from, to });

/// State of the screening.
#[derive(Clone)]
pub(in crate::filter) struct Screen {
    limits: Arc<Screening>,
    /// Number of channels.
    n: usize,
    usual: Usual,
    repeats: Repeats,
    held: VecDeque<Sample>,
    /// Channels for which the first sample was held; set if all held samples are faulty.
    suspects: u16,
    faulty: Option<Fault>,
    bridge: Option<Bridge>,
    /// Faulty samples before the first good one.
    skipped: Option<Skipped>,
    /// Samples that may be used, with the uncertainty of those that were replaced.
    pub(in crate::filter) ready: VecDeque<(Sample, Option<Spread>)>,
    pub(in crate::filter) news: Option<News>,
    /// Set once a bridge, or one that was too long, has been reported.
    bridged: bool,
    unusable: bool,
    /// Number of replaced spikes.
    pub(in crate::filter) spikes: u64,
    /// Time of the last used sample that was replaced.
    pub(in crate::filter) replaced: Time,
}

saved!(Screen {
    usual, repeats, held, suspects, faulty, bridge, skipped, ready, bridged, unusable, spikes,
    replaced,
} except {
    limits, n, news,
});

/// Judgement of a sample with the vector instructions of the processor.
struct Judgement<'a> {
    screen: &'a mut Screen,
    sample: &'a Sample,
}

impl WithSimd for Judgement<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        self.screen.judge(simd, self.sample)
    }
}

impl Screen {
    pub(in crate::filter) fn new(limits: &Screening) -> Self {
        let limits = Arc::new(limits.clone());
        Self {
            n: limits.channels.len().min(MAX_CHANNELS),
            usual: Usual::new(Arc::clone(&limits)),
            repeats: Repeats::new(Arc::clone(&limits)),
            limits,
            held: VecDeque::with_capacity(SPIKE + 1),
            suspects: 0,
            faulty: None,
            bridge: None,
            skipped: None,
            ready: VecDeque::with_capacity(SPIKE + 2),
            news: None,
            bridged: false,
            unusable: false,
            spikes: 0,
            replaced: Time::MIN,
        }
    }

    /// Takes a sample. Returns `true` if it passes as it is; otherwise the samples to use, if any,
    /// are in `ready`.
    pub(in crate::filter) fn take(&mut self, sample: &Sample) -> bool {
        Arch::new().dispatch(Judgement { screen: self, sample })
    }

    #[inline(always)]
    fn judge<S: Simd>(&mut self, simd: S, sample: &Sample) -> bool {
        let x = sample.values();
        self.usual.tick(sample.time);
        let bad = self.repeats.judge(simd, x, self.usual.interval());
        if self.bridge.is_some() {
            return self.go_on(sample, bad);
        }
        if !self.held.is_empty() {
            self.compare(sample, bad);
            return false;
        }
        if self.usual.good == Time::MIN {
            return self.skip(sample, bad);
        }
        match bad {
            Some((fault @ (Fault::Frozen | Fault::Stuck), channels)) => {
                self.begin(fault, channels);
                self.go_on(sample, bad)
            }
            Some((fault, channels)) => {
                self.hold(sample, channels, Some(fault));
                false
            }
            None => {
                let jumping = self.usual.jumping(simd, x);
                if jumping != 0 {
                    self.hold(sample, jumping, None);
                    return false;
                }
                self.usual.learn(simd, x, sample.time, self.repeats.in_a_row == 0);
                true
            }
        }
    }

    /// Skips a faulty sample before the first good one: there is nothing to bridge it with. Returns
    /// `true` if the sample is good.
    #[cold]
    fn skip(&mut self, sample: &Sample, bad: Option<(Fault, u16)>) -> bool {
        let Some((fault, channels)) = bad else {
            self.news = self.skipped.take().map(News::Skipped);
            self.usual.learn(Scalar::new(), sample.values(), sample.time, true);
            return true;
        };
        let to = sample.time;
        self.skipped = Some(match self.skipped {
            // the first fault names the span, as for a bridge
            Some(before) => Skipped { channels: before.channels | channels, to, ..before },
            None => Skipped { fault, channels, from: to, to },
        });
        false
    }

    /// Begins the run of the filter: a fault that goes on is reported once more.
    pub(in crate::filter) fn begin_run(&mut self) {
        (self.bridged, self.unusable) = (false, false);
        if let Some(bridge) = &mut self.bridge {
            bridge.reported = false;
        }
    }

    /// Number of samples so far.
    pub(in crate::filter) fn samples(&self) -> u64 {
        self.repeats.samples
    }

    /// Samples that are held at the end of a run.
    pub(in crate::filter) fn finish(&mut self) {
        let recent: Spread =
            std::array::from_fn(|c| (self.repeats.raw[c] - self.usual.last[c]).abs());
        while let Some(held) = self.held.pop_front() {
            let replaced = self.replaced(&held, self.suspects, &self.usual.last);
            self.ready.push_back((replaced, Some(recent)));
        }
        self.end_of_bridge();
        if let Some(skipped) = self.skipped.take() {
            self.news = Some(News::Skipped(skipped));
        }
    }

    fn hold(&mut self, sample: &Sample, channels: u16, fault: Option<Fault>) {
        if self.held.is_empty() {
            (self.suspects, self.faulty) = (channels, fault);
        } else {
            self.suspects |= channels;
            self.faulty = self.faulty.and(fault);
        }
        self.held.push_back(*sample);
    }

    /// Compares a sample with those that are held: the channel came back, stays, or is faulty.
    fn compare(&mut self, sample: &Sample, bad: Option<(Fault, u16)>) {
        let x = sample.values();
        let Some(first) = self.held.front().map(|s| *s.values()) else { return };
        let suspects = (0..self.n).filter(|c| self.suspects >> c & 1 == 1);
        let (mut back, mut away) = (bad.is_none(), true);
        for c in suspects {
            let jump = first[c] - self.usual.last[c];
            let now = x[c] - self.usual.last[c];
            back &= now.abs() <= BACK * jump.abs();
            // an oscillation is no spike
            away &= self.held.iter().all(|s| (s.values()[c] - self.usual.last[c]) * jump > 0.0);
        }
        if back && (away || self.faulty.is_some()) {
            self.interpolate(sample);
        } else if self.held.len() < SPIKE && (bad.is_some() || away) {
            let (fault, channels) = bad.map_or((None, 0), |(f, c)| (Some(f), c));
            self.hold(sample, channels, fault);
        } else if let Some(fault) = self.faulty.filter(|_| bad.is_some()) {
            self.begin(fault, self.suspects);
            while let Some(held) = self.held.pop_front() {
                self.fill(&held);
            }
            self.go_on(sample, bad);
        } else {
            // a step is a manoeuvre, or a fault that the sensor does not show by itself
            while let Some(held) = self.held.pop_front() {
                self.pass(held);
            }
            self.pass(*sample);
        }
    }

    /// Passes a held sample on as it came.
    fn pass(&mut self, sample: Sample) {
        self.usual.learn(Scalar::new(), sample.values(), sample.time, true);
        self.ready.push_back((sample, None));
    }

    /// Replaces the held spike by the line between the samples before and after it.
    fn interpolate(&mut self, after: &Sample) {
        let held = self.held.len();
        let (x, last) = (*after.values(), self.usual.last);
        let Some(first) = self.held.front().map(|s| *s.values()) else { return };
        let size = |c: usize| {
            (first[c] - last[c]).abs() / self.usual.rough[c].max(self.usual.least[c] * 1e-3)
        };
        let channel = (0..self.n).filter(|c| self.suspects >> c & 1 == 1);
        let channel = channel.max_by(|a, b| size(*a).total_cmp(&size(*b))).unwrap_or(0);
        let news = News::Spike {
            time: self.held.front().map_or(after.time, |s| s.time),
            channel,
            jump: (first[channel] - last[channel]) / self.usual.unit(),
            samples: held,
        };
        // an interpolated value is uncertain by the roughness of the signal and by its change
        let share = |c: usize| 0.5 * (self.usual.rough[c] + (x[c] - last[c]).abs()) * held as f64;
        let suspects = self.suspects;
        let unknown = |c: usize| if suspects >> c & 1 == 1 { share(c) } else { 0.0 };
        let spread: Spread = std::array::from_fn(unknown);
        for k in 1..=held {
            let Some(sample) = self.held.pop_front() else { break };
            let part = k as f64 / (held + 1) as f64;
            let line: Spread = std::array::from_fn(|c| last[c] + (x[c] - last[c]) * part);
            let replaced = self.replaced(&sample, suspects, &line);
            self.usual.before = self.usual.last;
            self.usual.last = *replaced.values();
            self.ready.push_back((replaced, Some(spread)));
        }
        self.spikes += 1;
        self.news = Some(news);
        self.pass(*after);
    }

    /// The sample with other values in some channels.
    fn replaced(&self, sample: &Sample, channels: u16, values: &Spread) -> Sample {
        let mut replaced = *sample;
        for c in (0..self.n).filter(|c| channels >> c & 1 == 1) {
            replaced.set(c, values[c]);
        }
        replaced
    }

    fn begin(&mut self, fault: Fault, channels: u16) {
        // identical samples in a row passed before they counted as frozen
        let repeated = match fault {
            Fault::Frozen => f64::from(self.repeats.in_a_row),
            Fault::Stuck => f64::from(STUCK),
            Fault::Zeros | Fault::Range => 0.0,
        };
        let from = Time::from_nanos(
            self.usual.good.nanos() - (repeated * self.usual.interval() * 1e9) as i64,
        );
        let (to, unknown) = (self.usual.good, [0.0; MAX_CHANNELS]);
        self.bridge = Some(Bridge { fault, channels, from, to, unknown, reported: false });
    }

    /// Uses a sample while the sensor is faulty, or ends the bridge. Returns `true` if the sample
    /// passes as it is.
    fn go_on(&mut self, sample: &Sample, bad: Option<(Fault, u16)>) -> bool {
        let Some(bridge) = &mut self.bridge else { return true };
        // a sensor that repeats itself is still frozen, however few its repetitions
        let frozen = bad.is_none() && self.repeats.in_a_row > 0 && bridge.fault != Fault::Stuck;
        if let Some((fault, channels)) = bad {
            bridge.channels |= channels;
            if fault == Fault::Frozen && bridge.fault == Fault::Stuck {
                bridge.fault = fault;
            }
        } else if !frozen {
            self.end_of_bridge();
            (self.usual.last, self.usual.before) = (*sample.values(), *sample.values());
            self.usual.good = sample.time;
            return true;
        }
        self.fill(sample);
        let Some(bridge) = &mut self.bridge else { return false };
        let too_long = bridge.to.since(bridge.from) > self.limits.max_bridge;
        if too_long && !bridge.reported {
            bridge.reported = true;
            let &mut Bridge { fault, channels, from, to, .. } = bridge;
            let first = !std::mem::replace(&mut self.unusable, true);
            self.news = Some(News::Bridge { fault, channels, from, to, too_long, first });
        }
        false
    }

    fn end_of_bridge(&mut self) {
        if let Some(Bridge { fault, channels, from, to, reported, .. }) = self.bridge.take()
            && !reported
        {
            let first = !std::mem::replace(&mut self.bridged, true);
            self.news = Some(News::Bridge { fault, channels, from, to, too_long: false, first });
        }
    }

    /// Replaces a faulty sample by the recent mean. A stuck channel keeps its value, which is the
    /// nearest one where the sensor is saturated.
    ///
    /// The unknown rate `s(t)` at the age `t` of the bridge makes the integral uncertain by
    /// `s(t) t`. The spread of one sample over its interval `T` is the increase of that variance,
    /// `(s T)^2 = (s(t) t)^2 - (s(t-T) (t-T))^2`.
    fn fill(&mut self, sample: &Sample) {
        let unit = self.usual.unit();
        let Some(bridge) = &mut self.bridge else { return };
        let age = sample.time.since(bridge.from);
        let interval = sample.time.since(bridge.to).max(0.5 * self.usual.interval());
        bridge.to = sample.time;
        let mut spread = [0.0; MAX_CHANNELS];
        let mut values = self.usual.mean;
        for c in (0..self.n).filter(|c| bridge.channels >> c & 1 == 1) {
            let mut motion = self.usual.motion[c].max(self.limits.channels[c].motion * unit);
            if bridge.fault == Fault::Stuck {
                values[c] = sample.values()[c];
                motion =
                    motion.max((values[c] - self.usual.mean[c]).abs()).max(0.5 * values[c].abs());
            }
            let rate = CORRELATED
                * (motion * (age / Usual::CHANGE).min(25.0).sqrt() + 0.5 * self.usual.rough[c]);
            let unknown = (rate * age).powi(2);
            spread[c] = (unknown - bridge.unknown[c]).max(0.0).sqrt() / interval;
            bridge.unknown[c] = unknown;
        }
        let channels = bridge.channels;
        let replaced = self.replaced(sample, channels, &values);
        self.ready.push_back((replaced, Some(spread)));
    }
}

#[cfg(test)]
mod tests;
