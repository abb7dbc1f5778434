//! Lock-out: a sensor and the filter contradict each other for long. Either may be wrong, so the
//! decision uses the evidence that the samples give:
//! ```text
//! silence       no sample was used for longer than the timeout before the first gated one: the
//!               error of the filter grew unseen. The covariance is inflated at once
//! shared        another sensor is gated too: the filter is wrong. The covariance is inflated
//! contradiction other sensors would have removed an error of the filter by now. The sensor is isolated
//! step          the innovation jumped between two samples, and the error of a filter grows
//!               gradually. The sensor is isolated
//! otherwise     the error came gradually, and no other sensor measures it. The covariance is
//!               inflated, and the result must not be used
//! ```

use crate::checkpoint::saved;
use crate::model::record::finding::{Basis, Finding, Severity};
use crate::model::record::{Event, Level, Observer};
use crate::model::sensor::gate::{Action, Recovery};
use crate::units::rhythm::Rhythm;
use crate::units::sample::Channel;
use crate::units::time::Time;
use std::sync::Arc;

/// Number of gated samples in a row that causes a warning.
const IN_A_ROW: u64 = 5;

/// Largest number of gated samples in a row that is no lock-out, however long they took: an outlier
/// on either side of an outage.
const OUTLIERS: u64 = 2;

/// Multiple of the gate's threshold from which a NIS is a jump. With one channel and the default
/// gate it is 7.8 sigma.
const STEP: f64 = 4.0;

/// Weight of the last sample in the mean NIS of the samples that passed.
const WEIGHT: f64 = 0.02;

/// Number of samples in a row with which an isolated sensor has to agree to be taken back.
const RETURN: u32 = 5;

/// Share of an innovation's square below which it counts as gone: half of its size.
pub(in crate::filter) const GONE: f64 = 0.25;

/// Decision on a measured sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::filter) enum Verdict {
    Pass,
    Gate,
    /// The sample is used, although the gate does not pass.
    Accept,
    Inflate,
    Isolate,
}

/// A sample as the gate sees it.
#[derive(Clone, Copy)]
pub(in crate::filter) struct Judged<'a> {
    pub(in crate::filter) sensor: &'a str,
    pub(in crate::filter) time: Time,
    pub(in crate::filter) nis: f64,
    pub(in crate::filter) threshold: f64,
    /// Number of channels.
    pub(in crate::filter) m: usize,
    /// Square of the innovation relative to that of the first gated sample.
    pub(in crate::filter) share: f64,
    /// Index of the channel with the largest innovation, and its size in sigma.
    pub(in crate::filter) worst: (usize, f64),
}

/// Evidence on a sample that is gated, or follows a gated one, beside its innovation.
#[derive(Clone, Copy, Default)]
pub(in crate::filter) struct Evidence {
    /// The sample passes its gate.
    pub(in crate::filter) passes: bool,
    /// Another sensor is gated at the same time.
    pub(in crate::filter) shared: bool,
    /// Other sensors would have removed the error from the filter; `None` where the sample has
    /// other channels than the first gated one.
    pub(in crate::filter) contradicted: Option<bool>,
}

/// Consecutive gated samples of one sensor.
#[derive(Clone, Copy, Default)]
pub(in crate::filter) struct Streak {
    pub(in crate::filter) since: Time,
    pub(in crate::filter) count: u64,
    /// Time without a used sample before the streak, s, if it was longer than the timeout.
    silence: Option<f64>,
    /// Set if the innovation jumped.
    step: bool,
    /// Set if other sensors contradicted the last sample.
    contradicted: bool,
    /// Set once the lock-out has been reported.
    reported: bool,
    /// Index of the channel with the largest innovation of all samples, and its size in sigma.
    worst: (usize, f64),
}

saved!(Streak { since, count, silence, step, contradicted, reported, worst });

/// Isolation of a sensor: its samples are judged and not used.
#[derive(Clone, Copy, Default)]
pub(in crate::filter) struct Isolation {
    /// Time of the first gated sample.
    pub(in crate::filter) since: Time,
    /// Set if other sensors contradicted the sensor; otherwise its innovation jumped.
    pub(in crate::filter) contradicted: bool,
    /// Time at which the isolation began.
    began: Time,
    /// Number of samples in a row that agreed.
    agreed: u32,
}

saved!(Isolation { since, contradicted, began, agreed });

/// State of a sensor's lock-out.
#[derive(Clone)]
pub(in crate::filter) struct Lockout {
    pub(in crate::filter) streak: Option<Streak>,
    pub(in crate::filter) isolation: Option<Isolation>,
    timeout: Option<f64>,
    channels: Arc<[Arc<str>]>,
    /// Time of the last judged sample, and of the last used one.
    last: Option<Time>,
    used: Option<Time>,
    rhythm: Rhythm,
    /// Mean NIS of the used samples for each channel.
    spread: f64,
    /// Set once the sensor was used after a lock-out that no evidence decided: the filter may be
    /// wrong since then, so a jump is no evidence against the sensor any more.
    adopted: bool,
}

saved!(Lockout {
    streak, isolation, last, used, rhythm, spread, adopted,
} except {
    timeout, channels,
});

impl Lockout {
    pub(in crate::filter) fn new(timeout: Option<f64>, channels: &[Channel]) -> Self {
        Self {
            streak: None,
            isolation: None,
            timeout,
            channels: channels.iter().map(|channel| Arc::clone(&channel.name)).collect(),
            last: None,
            used: None,
            rhythm: Rhythm::default(),
            spread: 1.0,
            adopted: false,
        }
    }

    /// Returns `true` from the first gated sample on, until the sensor agrees again.
    pub(in crate::filter) fn disagrees(&self) -> bool {
        self.streak.is_some() || self.isolation.is_some()
    }

    /// Returns `true` if more samples in a row were gated than outliers explain.
    pub(in crate::filter) fn suspects(&self) -> bool {
        self.streak.is_some_and(|streak| streak.count > OUTLIERS)
    }

    /// Channel with the largest innovation of a streak, and its size, in words.
    fn worst(&self, streak: &Streak) -> String {
        let (channel, size) = streak.worst;
        let channel = self.channels.get(channel).map_or("?", |name| name);
        format!("{channel} is off by {size:.1} sigma")
    }

    /// Decides on a sample.
    pub(in crate::filter) fn judge(
        &mut self,
        sample: &Judged<'_>,
        evidence: Evidence,
        recovery: &Recovery,
        observer: &mut dyn Observer,
    ) -> Verdict {
        let before = self.last.replace(sample.time);
        if let Some(before) = before {
            self.rhythm.take(sample.time.since(before));
        }
        let verdict = if self.isolation.is_some() {
            self.judge_isolated(sample, evidence.passes, recovery, observer)
        } else if evidence.passes {
            self.agree(sample, evidence, recovery, observer)
        } else {
            self.disagree(sample, before, evidence, recovery, observer)
        };
        if matches!(verdict, Verdict::Pass | Verdict::Accept | Verdict::Inflate) {
            self.used = Some(sample.time);
            self.streak = None;
        }
        verdict
    }

    /// Ends a streak with a sample that passes, unless the innovation jumped and is still there:
    /// the covariance has grown, and a jump does not become the filter's error by that.
    fn agree(
        &mut self,
        sample: &Judged<'_>,
        evidence: Evidence,
        recovery: &Recovery,
        observer: &mut dyn Observer,
    ) -> Verdict {
        if let Some(streak @ Streak { since, count, step, .. }) = self.streak {
            let isolates = recovery.action == Action::Inflate && !evidence.shared;
            if isolates && step && count > OUTLIERS && sample.share > GONE {
                let gated = format!("every one of {count} samples was gated since {since}");
                return self.isolate(sample, since, false, &gated, observer);
            }
            let gated = match count {
                1 => format!("1 sample gated at {since}"),
                _ => format!("{count} samples gated since {since}"),
            };
            let text = format!("{gated}, {}; the gate passes again", self.worst(&streak));
            log(sample, Level::Info, text, observer);
        }
        self.spread += WEIGHT * (sample.nis / sample.m as f64 - self.spread);
        Verdict::Pass
    }

    /// Begins an isolation.
    fn isolate(
        &mut self,
        sample: &Judged<'_>,
        since: Time,
        contradicted: bool,
        gated: &str,
        observer: &mut dyn Observer,
    ) -> Verdict {
        self.isolation = Some(Isolation { since, contradicted, began: sample.time, agreed: 0 });
        self.streak = None;
        let reason = if contradicted {
            "other sensors contradict it"
        } else {
            "its innovation jumped between two samples, and an error of the filter grows gradually"
        };
        let text = format!("{gated}; the sensor is isolated: {reason}");
        find(sample, Severity::Contained, text, SENSOR, observer);
        Verdict::Isolate
    }

    /// Silence from which on the filter is suspected, s, as where a sensor counts as lost.
    fn silence(&self) -> f64 {
        self.timeout.unwrap_or_else(|| self.rhythm.patience())
    }

    /// Begins a streak.
    fn streak(&self, sample: &Judged<'_>) -> Streak {
        let gap = self.used.map(|used| sample.time.since(used));
        // the jump is judged against the innovations before it: those of a filter whose noise is
        // too small scatter widely without any fault
        let jump = sample.nis > STEP * sample.threshold * self.spread.max(1.0);
        Streak {
            since: sample.time,
            count: 0,
            silence: None,
            step: jump && !self.adopted && gap.is_some_and(|gap| self.rhythm.follows(gap)),
            contradicted: false,
            reported: false,
            worst: sample.worst,
        }
    }

    fn disagree(
        &mut self,
        sample: &Judged<'_>,
        before: Option<Time>,
        evidence: Evidence,
        recovery: &Recovery,
        observer: &mut dyn Observer,
    ) -> Verdict {
        let &Judged { time, nis, .. } = sample;
        let mut streak = self.streak.unwrap_or_else(|| self.streak(sample));
        // a streak may begin before the silence
        let gap = before.map(|before| time.since(before)).filter(|gap| *gap > self.silence());
        streak.silence = streak.silence.or(gap);
        streak.count += 1;
        if sample.worst.1 > streak.worst.1 {
            streak.worst = sample.worst;
        }
        streak.contradicted = evidence.contradicted.unwrap_or(streak.contradicted);
        self.streak = Some(streak);
        let Streak { since, count, silence, step, contradicted, reported, .. } = streak;
        // a single gated sample is expected; several in a row are worth a warning
        if count == IN_A_ROW {
            let text =
                format!("{count} samples gated in a row since {since}, {}", self.worst(&streak));
            log(sample, Level::Warning, text, observer);
        }
        let inflates = recovery.action == Action::Inflate;
        let due =
            time.since(since) >= recovery.after.value().si() || (inflates && silence.is_some());
        if !due || count <= OUTLIERS || !nis.is_finite() {
            return Verdict::Gate;
        }
        let lock_out = format!("locked out: every one of {count} samples was gated since {since}");
        match recovery.action {
            Action::Report if reported => Verdict::Gate,
            Action::Report => {
                log(sample, Level::Warning, lock_out, observer);
                self.streak = Some(Streak { reported: true, ..streak });
                Verdict::Gate
            }
            Action::Accept => {
                log(sample, Level::Warning, format!("{lock_out}; this one is used"), observer);
                Verdict::Accept
            }
            Action::Inflate if !evidence.shared && (contradicted || step) => {
                self.isolate(sample, since, contradicted, &lock_out, observer)
            }
            Action::Inflate => {
                let (severity, reason, remedy) = match silence {
                    Some(silence) => (
                        Severity::Contained,
                        format!(", after {silence:.1} s without a used sample"),
                        NOISE,
                    ),
                    None if evidence.shared => {
                        (Severity::DoNotUse, ", and another sensor is gated too".to_owned(), NOISE)
                    }
                    None => (Severity::DoNotUse, String::new(), EITHER),
                };
                self.adopted |= silence.is_none();
                let text =
                    format!("{lock_out}{reason}; the covariance is inflated and this one used");
                find(sample, severity, text, remedy, observer);
                Verdict::Inflate
            }
        }
    }

    fn judge_isolated(
        &mut self,
        sample: &Judged<'_>,
        passes: bool,
        recovery: &Recovery,
        observer: &mut dyn Observer,
    ) -> Verdict {
        let Some(isolation) = &mut self.isolation else { return Verdict::Pass };
        // an innovation that the growing covariance makes plausible has not gone
        let agrees = passes && sample.share <= GONE;
        isolation.agreed = if agrees { isolation.agreed + 1 } else { 0 };
        let &mut Isolation { since, contradicted, began, agreed } = isolation;
        let lasted = sample.time.since(began);
        if agreed >= RETURN {
            let text = format!("the sensor agrees again and is taken back, isolated since {began}");
            log(sample, Level::Info, text, observer);
            self.isolation = None;
            return Verdict::Pass;
        }
        if contradicted || lasted < recovery.isolate.value().si() || !sample.nis.is_finite() {
            return Verdict::Isolate;
        }
        let text = format!(
            "the sensor contradicts the filter since {since} and was isolated for {lasted:.0} s; \
             the covariance is inflated and this sample used"
        );
        find(sample, Severity::DoNotUse, text, EITHER, observer);
        (self.isolation, self.adopted) = (None, true);
        Verdict::Inflate
    }

    /// Reports a sensor that is still gated or isolated after the last sample.
    pub(in crate::filter) fn finish(&self, sensor: &str, time: Time, observer: &mut dyn Observer) {
        let (nis, threshold, share) = (f64::NAN, f64::NAN, f64::NAN);
        let sample = Judged { sensor, time, nis, threshold, m: 0, share, worst: (0, f64::NAN) };
        if let Some(streak @ Streak { since, count, .. }) = self.streak {
            let text = format!(
                "the last {count} samples were gated, since {since}, {}",
                self.worst(&streak)
            );
            log(&sample, Level::Warning, text, observer);
        }
        if let Some(Isolation { since, contradicted, .. }) = self.isolation {
            let text = format!(
                "the sensor is isolated at the end, and contradicts the filter since {since}"
            );
            let (severity, remedy) = if contradicted {
                (Severity::Contained, SENSOR)
            } else {
                (Severity::DoNotUse, EITHER)
            };
            find(&sample, severity, text, remedy, observer);
        }
    }
}

/// Remedy where the sensor is at fault.
const SENSOR: &str = "look at the sensor's samples from then on; its range, mounting and settings \
                      may have changed";

/// Remedy where the filter is at fault.
const NOISE: &str = "the uncertainty was too small: raise the noise of the driving sensor, or \
                     the priors, until the innovations are consistent";

/// Remedy where the fault may be in the sensor or in the filter.
const EITHER: &str = "no other sensor decides which one is wrong: look at the sensor's samples from \
                      then on, and at the noise of the driving sensor; recovery.action = \"report\" \
                      keeps the filter from adopting them";

fn log(sample: &Judged<'_>, level: Level, text: String, observer: &mut dyn Observer) {
    observer.event(Event { time: sample.time, level, about: sample.sensor.to_owned(), text });
}

fn find(
    sample: &Judged<'_>,
    severity: Severity,
    text: String,
    remedy: &str,
    observer: &mut dyn Observer,
) {
    let (time, about, remedy) = (sample.time, sample.sensor.to_owned(), remedy.to_owned());
    let basis = Basis::Comparison;
    observer.finding(Finding { time, about, severity, basis, text, remedy });
}

#[cfg(test)]
mod tests;
