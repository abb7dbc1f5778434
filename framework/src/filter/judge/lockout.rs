//! Lock-out: a sensor and the filter contradict each other for long. Either may be wrong, so the
//! decision uses the evidence that the samples give:
//! ```text
//! silence       no sample was used for longer than the timeout before the first gated one: the
//!               error of the filter grew unseen. The covariance is inflated at once
//! replaced      the screening replaced samples of the driving sensor since the last used sample, and they
//!               may have been right: a hard stop looks like a spike. The covariance is inflated at once
//! shared        another sensor is gated too: the filter is wrong. The covariance is inflated
//! contradiction other sensors would have removed an error of the filter by now. The sensor is isolated
//! majority      the gated samples agree with each other, and are ten times as many as those that were
//!               used before. The covariance is inflated at once
//! step          the innovation jumped between two samples, and the error of a filter grows
//!               gradually. The sensor is isolated
//! otherwise     the error came gradually, and no other sensor measures it. The covariance is
//!               inflated, and the result must not be used
//! ```

use crate::checkpoint::saved;
use crate::model::record::finding::Severity;
use crate::model::record::{Level, Observer};
use crate::model::sensor::gate::{Action, Recovery};
use crate::units::rhythm::Rhythm;
use crate::units::sample::Channel;
use crate::units::time::Time;
use std::sync::Arc;

mod evidence;
mod words;

pub(in crate::filter) use evidence::{
    Conviction, Evidence, Isolation, Judged, Largest, Streak, Verdict,
};
pub(in crate::filter) use words::first_was_wrong;
use words::{
    CONTRADICTED, EARLIER, EITHER, INFLATED, JUMPED, NOISE, REPLACED, SENSOR, coasted,
    drives_wrong, find, lasts_on, log,
};

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

/// Ratio of gated samples that agree with each other to those used before, from which on the filter
/// follows the gated ones. If nothing but the sensor itself decides, one of the two stretches is wrong,
/// and a sensor that is wrong at random times is wrong in the shorter one at the odds of their lengths.
pub(in crate::filter) const MAJORITY: u64 = 10;

/// Number of times that the filter follows a sensor until it is clear that this ends nothing.
const LASTING: u32 = 3;

/// Share of an innovation's square below which it counts as gone: half of its size.
pub(in crate::filter) const GONE: f64 = 0.25;

/// State of a sensor's lock-out.
#[derive(Clone)]
pub(in crate::filter) struct Lockout {
    pub(in crate::filter) streak: Option<Streak>,
    pub(in crate::filter) isolation: Option<Isolation>,
    timeout: Option<f64>,
    channels: Arc<[Arc<str>]>,
    /// Time of the last judged sample, and of the last used one.
    last: Option<Time>,
    pub(in crate::filter) used: Option<Time>,
    rhythm: Rhythm,
    /// Mean NIS of the used samples for each channel.
    spread: f64,
    /// Set once the sensor was used after a lock-out that no evidence decided: the filter may be
    /// wrong since then, so a jump is no evidence against the sensor any more.
    adopted: bool,
    /// Number of such lock-outs that soon followed each other, from one on at which no other sensor contradicted the
    /// filter: if several do at first, the driving sensor is at fault.
    alone: u32,
    /// Set for a sensor, and not for a rule that the scenario states as one.
    measures: bool,
    /// Number of used samples since the start or the last recovery.
    pub(in crate::filter) accepted: u64,
}

saved!(Lockout {
    streak, isolation, last, used, rhythm, spread, adopted, alone, accepted,
} except {
    timeout, channels, measures,
});

impl Lockout {
    pub(in crate::filter) fn new(
        timeout: Option<f64>,
        channels: &[Channel],
        measures: bool,
    ) -> Self {
        Self {
            streak: None,
            isolation: None,
            timeout,
            channels: channels.iter().map(|channel| channel.words().into()).collect(),
            last: None,
            used: None,
            rhythm: Rhythm::default(),
            spread: 1.0,
            adopted: false,
            alone: 0,
            measures,
            accepted: 0,
        }
    }

    /// The channels that are isolated, one bit each.
    pub(in crate::filter) fn isolated(&self) -> u16 {
        self.isolation.map_or(0, |isolation| isolation.channels)
    }

    /// Ends a lock-out that is explained.
    pub(in crate::filter) fn explain(&mut self) {
        (self.streak, self.isolation, self.accepted) = (None, None, 0);
    }

    /// Returns `true` if gated samples that agree with each other outnumber the used ones clearly. A
    /// filter that was widened for a sensor once follows neither side quickly.
    fn outnumbers(&self, gated: u64, evidence: Evidence) -> bool {
        let before = self.accepted;
        evidence.repeated && !self.adopted && before > 0 && gated >= MAJORITY * before
    }

    /// Returns `true` once a sample was used.
    pub(in crate::filter) fn was_used(&self) -> bool {
        self.used.is_some()
    }

    /// Returns `true` if a sample was used since a time.
    pub(in crate::filter) fn used_since(&self, time: Time) -> bool {
        self.used.is_some_and(|used| used >= time)
    }

    /// Returns `true` from the first gated sample on, until the sensor agrees again.
    pub(in crate::filter) fn disagrees(&self) -> bool {
        self.streak.is_some() || self.isolation.is_some()
    }

    /// Returns `true` if more samples in a row were gated than outliers explain.
    pub(in crate::filter) fn suspects(&self) -> bool {
        self.streak.is_some_and(|streak| streak.count > OUTLIERS)
    }

    /// The factor of the variance below which the jump of the innovation is one, whatever the noise.
    pub(in crate::filter) fn jump(&self) -> f64 {
        let streak = || self.streak.map(|streak| streak.jump);
        self.isolation.map(|isolation| isolation.jump).or_else(streak).unwrap_or(0.0)
    }

    /// Returns `true` if another gated sample is more than outliers explain.
    pub(in crate::filter) fn at_limit(&self) -> bool {
        self.streak.is_some_and(|streak| streak.count >= OUTLIERS)
    }

    /// Returns `true` if another gated sample is one of several in a row, which are worth a warning.
    pub(in crate::filter) fn insists(&self) -> bool {
        self.streak.is_some_and(|streak| streak.count + 1 >= IN_A_ROW)
    }

    /// Channel with the largest innovation of a streak, and its size, in words.
    fn largest(&self, streak: &Streak) -> String {
        let Largest { channel, sigmas } = streak.largest;
        let channel = self.channels.get(channel).map_or("?", |name| name);
        format!("{channel} is off by {sigmas:.1} sigma")
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
            self.judge_isolated(sample, evidence, recovery, observer)
        } else if evidence.passes {
            self.agree(sample, evidence, recovery, observer)
        } else {
            self.disagree(sample, before, evidence, recovery, observer)
        };
        if !matches!(verdict, Verdict::Gate | Verdict::Isolate) {
            self.used = Some(sample.time);
            self.streak = None;
            self.accepted = if verdict.recovers() { 1 } else { self.accepted + 1 };
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
        if let Some(streak @ Streak { since, count, jump, replaced, .. }) = self.streak {
            let isolates = recovery.action == Action::Inflate && !evidence.shared && !replaced;
            if isolates && jump > 1.0 && count > OUTLIERS && sample.share > GONE {
                let gated =
                    format!("every one of {count} samples since {since} was outside the gate");
                return self.isolate(sample, since, JUMPED, &gated, observer);
            }
            let gated = match count {
                1 => format!("1 sample gated at {since}"),
                _ => format!("{count} samples gated since {since}"),
            };
            let text = format!("{gated}, {}; the gate passes again", self.largest(&streak));
            log(sample, Level::Info, text, observer);
        }
        self.spread += WEIGHT * (sample.nis / sample.m as f64 - self.spread);
        Verdict::Pass
    }

    /// Reports that the filter follows gated samples, which outnumber those that it used.
    fn follow(&self, sample: &Judged<'_>, since: Time, count: u64, observer: &mut dyn Observer) {
        let text = format!(
            "{count} samples since {since} agree with each other, but only {} were used before them; the \
             covariance is inflated and this sample is used",
            self.accepted
        );
        find(sample, Severity::Doubtful, text, EARLIER, observer);
    }

    /// Begins an isolation for a reason.
    fn isolate(
        &mut self,
        sample: &Judged<'_>,
        since: Time,
        reason: &'static str,
        gated: &str,
        observer: &mut dyn Observer,
    ) -> Verdict {
        let (began, channels) = (sample.time, sample.channels);
        let Streak { count, jump, .. } = self.streak.take().unwrap_or_default();
        let (contradicted, agreed) = (reason == CONTRADICTED, 0);
        self.isolation =
            Some(Isolation { since, contradicted, channels, count, began, agreed, jump });
        let text = format!("{gated}; the sensor is isolated: {reason}");
        find(sample, Severity::Contained, text, SENSOR, observer);
        Verdict::Isolate
    }

    /// Silence from which on the filter is suspected, s, as where a sensor counts as lost.
    fn silence(&self) -> f64 {
        self.timeout.unwrap_or_else(|| self.rhythm.patience())
    }

    /// Returns `true` for the first sample that is used after a silence or an isolation, if the evidence
    /// decides on the sensor.
    pub(in crate::filter) fn returns(&self, time: Time, recovery: &Recovery) -> bool {
        let unused = self.isolation.is_some() || self.streak.is_some_and(|s| s.silence.is_some());
        let silent = |last| time.since(last) > self.silence();
        recovery.action == Action::Inflate && (unused || self.last.is_some_and(silent))
    }

    /// Begins a streak.
    fn streak(&self, sample: &Judged<'_>, replaced: Time) -> Streak {
        let gap = self.used.map(|used| sample.time.since(used));
        // the jump is judged against the innovations before it: those of a filter whose noise is
        // too small scatter widely without any fault
        let jump = sample.nis / (STEP * sample.threshold * self.spread.max(1.0));
        let shows = !self.adopted && gap.is_some_and(|gap| self.rhythm.follows(gap));
        Streak {
            since: sample.time,
            count: 0,
            silence: None,
            replaced: self.used.is_some_and(|used| replaced >= used),
            jump: if shows { jump } else { 0.0 },
            contradicted: false,
            reported: false,
            largest: sample.largest,
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
        let mut streak = self.streak.unwrap_or_else(|| self.streak(sample, evidence.replaced));
        // a streak may begin before the silence
        let gap = before.map(|before| time.since(before)).filter(|gap| *gap > self.silence());
        streak.silence = streak.silence.or(gap);
        streak.count += 1;
        if sample.largest.sigmas > streak.largest.sigmas {
            streak.largest = sample.largest;
        }
        streak.contradicted = evidence.contradicted.unwrap_or(streak.contradicted);
        self.streak = Some(streak);
        let Streak { since, count, silence, replaced, jump, contradicted, reported, .. } = streak;
        let step = jump > 1.0;
        // a single gated sample is expected; several in a row are worth a warning
        if count == IN_A_ROW {
            let text =
                format!("{count} samples gated in a row since {since}, {}", self.largest(&streak));
            log(sample, Level::Warning, text, observer);
        }
        let inflates = recovery.action == Action::Inflate;
        let majority = self.outnumbers(count, evidence);
        let lasts = time.since(since) >= recovery.after.value().si()
            || (inflates && (silence.is_some() || majority || replaced));
        let due = recovery.action == Action::Obey || count > OUTLIERS && lasts;
        if !due || !nis.is_finite() {
            return Verdict::Gate;
        }
        let lock_out =
            format!("locked out: every one of {count} samples since {since} was outside the gate");
        match recovery.action {
            Action::Report if reported => Verdict::Gate,
            Action::Report => {
                log(sample, Level::Warning, lock_out, observer);
                self.streak = Some(Streak { reported: true, ..streak });
                Verdict::Gate
            }
            Action::Obey => {
                let text = format!("the estimate is set: {}", self.largest(&streak));
                log(sample, Level::Warning, text, observer);
                Verdict::Obey
            }
            Action::Accept => {
                log(sample, Level::Warning, format!("{lock_out}; this sample is used"), observer);
                Verdict::Accept
            }
            Action::Inflate if !evidence.shared && contradicted => {
                self.isolate(sample, since, CONTRADICTED, &lock_out, observer)
            }
            Action::Inflate if majority => {
                self.follow(sample, since, count, observer);
                self.adopted = true;
                Verdict::Follow
            }
            Action::Inflate if !evidence.shared && !replaced && step => {
                self.isolate(sample, since, JUMPED, &lock_out, observer)
            }
            Action::Inflate => {
                if let Some(silence) = silence.filter(|_| !replaced) {
                    coasted(sample, silence, (count, since), observer);
                } else {
                    let (severity, reason, remedy) = if replaced {
                        let reason = ", after samples of the driving sensor were replaced";
                        (Severity::Contained, reason, REPLACED)
                    } else if evidence.shared {
                        (Severity::DoNotUse, ", and another sensor is gated too", NOISE)
                    } else {
                        (Severity::DoNotUse, "", EITHER)
                    };
                    let first = !self.adopted && evidence.shared;
                    self.adopted |= !replaced;
                    if self.accepted > MAJORITY * count {
                        self.alone = 0;
                    }
                    let counts = self.measures && (self.alone > 0 || !evidence.shared);
                    self.alone += u32::from(counts && !replaced);
                    let text = format!("{lock_out}{reason}; {INFLATED}");
                    match self.alone {
                        times @ LASTING.. if !replaced => lasts_on(sample, times, &text, observer),
                        _ if first && !replaced => drives_wrong(sample, &text, observer),
                        _ => find(sample, severity, text, remedy, observer),
                    }
                }
                let undecided = silence.is_some() && !replaced && !evidence.shared;
                if undecided { Verdict::Adopt } else { Verdict::Inflate }
            }
        }
    }

    fn judge_isolated(
        &mut self,
        sample: &Judged<'_>,
        evidence: Evidence,
        recovery: &Recovery,
        observer: &mut dyn Observer,
    ) -> Verdict {
        let Some(isolation) = &mut self.isolation else { return Verdict::Pass };
        // an innovation that the growing covariance makes plausible has not gone
        let agrees = evidence.passes && sample.share <= GONE;
        isolation.agreed = if agrees { isolation.agreed + 1 } else { 0 };
        isolation.count += 1;
        let &mut Isolation { since, contradicted, count, began, agreed, .. } = isolation;
        let lasted = sample.time.since(began);
        if agreed >= RETURN {
            let text = format!("the sensor agrees again and is taken back, isolated since {began}");
            log(sample, Level::Info, text, observer);
            self.isolation = None;
            return Verdict::Pass;
        }
        let lasts = lasted >= recovery.isolate.value().si();
        if contradicted && lasts && evidence.passes {
            let text = format!(
                "the sensor was isolated for {lasted:.0} s; the filter's uncertainty has grown so much that it \
                 no longer contradicts the sensor: the sensor is used again, and the sigma contains both cases"
            );
            find(sample, Severity::Doubtful, text, SENSOR, observer);
            self.isolation = None;
            return Verdict::Try;
        }
        if contradicted || !sample.nis.is_finite() {
            return Verdict::Isolate;
        }
        let follows = self.outnumbers(count, evidence);
        if follows {
            self.follow(sample, since, count, observer);
        } else if lasts {
            let text = format!(
                "the sensor has contradicted the filter since {since} and was isolated for {lasted:.0} s; \
                 the covariance is inflated and this sample is used"
            );
            find(sample, Severity::DoNotUse, text, EITHER, observer);
        } else {
            return Verdict::Isolate;
        }
        (self.isolation, self.adopted) = (None, true);
        if follows { Verdict::Follow } else { Verdict::Inflate }
    }

    /// Reports that the samples since a time were wrong, and isolates the channels that still are.
    pub(in crate::filter) fn convict(
        &mut self,
        Conviction { since, at: began, channels }: Conviction,
        sensor: &str,
        observer: &mut dyn Observer,
    ) {
        if channels != 0 {
            let (contradicted, count, agreed, jump) = (true, 0, 0, 0.0);
            self.isolation =
                Some(Isolation { since, contradicted, channels, count, began, agreed, jump });
        }
        self.streak = None;
        let text = format!(
            "its samples since {since} were wrong, not the filter, which continues as if it had not used them"
        );
        find(&Judged::none(sensor, began), Severity::Contained, text, SENSOR, observer);
    }

    /// The time since which most channels are isolated.
    pub(in crate::filter) fn mostly_isolated_since(&self) -> Option<Time> {
        let most = |isolated: &Isolation| {
            2 * isolated.channels.count_ones() as usize > self.channels.len()
        };
        self.isolation.filter(most).map(|isolation| isolation.since)
    }
}

#[cfg(test)]
mod tests;
