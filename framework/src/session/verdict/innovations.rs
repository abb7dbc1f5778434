//! Innovations of one sensor: NIS over the run and over each minute, and bias, correlation and
//! drift of each channel.
//!
//! All statistics are sums, so the memory does not grow with the run. A channel's innovation is
//! divided by its sigma and by the root of `E / m`, the share of the gated NIS, so that a consistent
//! filter gives a white sequence `u` of variance 1.

use super::channel::{ChannelStatistics, Departure, Whole};
use super::nis::{Chance, Memory, NisSums};
use super::report::{Report, SLIGHT, Size, reason, size};
use crate::checkpoint::saved;
use crate::model::chi_square::{Band, band, probability};
use crate::model::record::finding::Severity;
use crate::model::record::verdict::{Criterion, SensorConsistency};
use crate::model::record::{InPart, Outcome, Rejection, UpdateRecord};
use crate::units::sample::{MAX_CHANNELS, channels};
use crate::units::time::Time;

/// Length of a minute, s.
const MINUTE: f64 = 60.0;
/// Share of gated samples from which a run is doubtful: outliers of a good sensor are fewer.
const GATED: f64 = 0.1;
/// Share of gated samples from which a result must not be used: the filter then follows the
/// minority.
const MOSTLY_GATED: f64 = 1.0 / 3.0;
/// Share of refused samples from which on the filter has gone without the sensor.
const NEARLY_ALL: f64 = 0.9;
/// Number of gated samples in a row from which a run is doubtful: with 5 % of outliers, the
/// probability is `0.05^5` at a sample, 0.3 % in ten thousand.
const IN_A_ROW: u64 = 5;
/// Share of faulty samples from which a run is doubtful.
const REJECTED: f64 = 0.1;
/// Smallest number of samples of which a share is judged.
const SHARED: u64 = 10;

/// The most improbable minute so far.
#[derive(Clone, Copy, Debug, Default)]
struct Minute {
    begin: Time,
    probability: f64,
    sums: NisSums,
}

saved!(Minute { begin, probability, sums });

/// Successive gated samples of a channel.
#[derive(Clone, Copy, Debug, Default)]
struct Streak {
    begin: Time,
    end: Time,
    count: u64,
}

saved!(Streak { begin, end, count });

impl Streak {
    fn add(&mut self, time: Time) {
        if self.count == 0 {
            self.begin = time;
        }
        self.end = time;
        self.count += 1;
    }
}

/// Statistics of one measuring sensor.
#[derive(Clone, Debug)]
pub(crate) struct SensorStatistics {
    name: String,
    /// Names of the channels.
    channels: Vec<ChannelStatistics>,
    /// Set for a constraint, whose samples obey a bound and not a noise.
    constraint: bool,
    whole: NisSums,
    memory: Memory,
    /// Beginning of the current minute, and its sums.
    begin: Option<Time>,
    minute: NisSums,
    minutes: u64,
    worst: Option<Minute>,
    gated: u64,
    in_part: InPart,
    /// The current streak of gated samples of each channel, and the longest one.
    streaks: [Streak; MAX_CHANNELS],
    longest: Streak,
    expected_gated: f64,
    faulty: u64,
    /// The distribution for each number of channels.
    chances: [Option<Chance>; MAX_CHANNELS + 1],
}

saved!(SensorStatistics {
    whole, memory, begin, minute, minutes, worst, gated, in_part, streaks, longest, expected_gated,
    faulty,
} each {
    channels,
} except {
    name, constraint, chances,
});

impl SensorStatistics {
    pub(crate) fn new(name: String, channels: Vec<String>, constraint: bool) -> Self {
        Self {
            name,
            channels: channels.into_iter().map(ChannelStatistics::new).collect(),
            constraint,
            whole: NisSums::default(),
            memory: Memory::default(),
            begin: None,
            minute: NisSums::default(),
            minutes: 0,
            worst: None,
            gated: 0,
            in_part: InPart::default(),
            streaks: [Streak::default(); MAX_CHANNELS],
            longest: Streak::default(),
            expected_gated: 0.0,
            faulty: 0,
            chances: [None; MAX_CHANNELS + 1],
        }
    }

    /// Adds the outcome of a sample.
    pub(crate) fn update(&mut self, update: &UpdateRecord<'_>) {
        self.in_part.add(update.time, update.outcome);
        let m = update.innovation.len();
        let chance = |place: &mut Option<Chance>| {
            *place.get_or_insert_with(|| Chance::of(m, update.threshold))
        };
        match update.outcome {
            Outcome::Rejected(
                Rejection::NotFinite(_)
                | Rejection::OutOfOrder
                | Rejection::Late
                | Rejection::Singular
                | Rejection::Prediction
                | Rejection::Repeated
                | Rejection::OutOfRange(_)
                | Rejection::TooFast(_),
            ) => self.faulty += 1,
            // it contradicts the filter like a gated sample; the filter reports it as a finding
            Outcome::Rejected(Rejection::Isolated) => self.gated += 1,
            // a missing channel and a silent driving sensor make no sigma wrong
            Outcome::Rejected(
                Rejection::Missing
                | Rejection::Unset
                | Rejection::NoInput
                | Rejection::Excluded
                | Rejection::Absent,
            )
            | Outcome::Placed => {}
            Outcome::Gated => {
                self.gated += 1;
                for channel in channels(update.present) {
                    let streak = &mut self.streaks[channel];
                    streak.add(update.time);
                    if streak.count > self.longest.count {
                        self.longest = *streak;
                    }
                }
                self.expected_gated += chance(&mut self.chances[m]).gated;
            }
            Outcome::Accepted => {
                let chance = chance(&mut self.chances[m]);
                self.expected_gated += chance.gated;
                channels(update.present).for_each(|k| self.streaks[k] = Streak::default());
                self.accepted(update, &chance);
            }
        }
    }

    fn accepted(&mut self, update: &UpdateRecord<'_>, chance: &Chance) {
        let begin = *self.begin.get_or_insert(update.time);
        if update.time.since(begin) >= MINUTE {
            self.end_minute();
            self.begin = Some(update.time);
        }
        self.whole.add(update.nis, chance);
        self.minute.add(update.nis, chance);
        self.memory.add((update.nis - chance.mean) / chance.variance.sqrt());
        let scale = (chance.mean / update.innovation.len() as f64).sqrt();
        for (channel, innovation, sigma) in update.channels() {
            if let Some(channel) = self.channels.get_mut(channel) {
                channel.add(innovation / (sigma * scale), innovation);
            }
        }
    }

    fn end_minute(&mut self) {
        let Some(begin) = self.begin.take() else { return };
        let sums = std::mem::take(&mut self.minute);
        let inflated = sums.variance * self.memory.inflation();
        let probability = probability(sums.nis, sums.expected, inflated);
        self.minutes += 1;
        let worse = |w: &Minute| {
            let size = |sums: &NisSums| sums.ratio().ln().abs();
            (probability, size(&w.sums)) < (w.probability, size(&sums))
        };
        if self.worst.as_ref().is_none_or(worse) {
            self.worst = Some(Minute { begin, probability, sums });
        }
        self.channels.iter_mut().for_each(ChannelStatistics::end_minute);
    }

    /// Ends the last minute. A short one joins no statistics of minutes.
    pub(crate) fn finish(&mut self) {
        let long = self.minute.count * self.minutes >= self.whole.count / 2;
        if long {
            self.end_minute();
        }
    }

    /// Number of tests. `white` is set if the filter's gain is optimal, so that innovations are
    /// white.
    pub(crate) fn tests(&self, white: bool) -> usize {
        if self.constraint {
            return 1; // the share of gated samples
        }
        let of_channel = if white { 4 } else { 1 };
        3 + of_channel * self.channels.iter().filter(|c| c.used()).count()
    }

    /// Reports the reasons against the run at `alpha`, the probability of a false alarm of one test.
    pub(crate) fn judge(&self, alpha: f64, white: bool, report: &mut Report) {
        self.judge_shares(alpha, report);
        if self.constraint || self.whole.count == 0 {
            return;
        }
        let inside = self.judge_nis(alpha, report);
        self.judge_minutes(alpha, inside, report);
        let mut found = Vec::new();
        let whole = Whole { white, channels: self.channels.len(), inside };
        for channel in self.channels.iter().filter(|c| c.used()) {
            channel.judge(alpha, &whole, &mut found);
        }
        // one reason for each criterion: of the channel that violates it most
        let order = |a: &&Departure, b: &&Departure| {
            a.severity.cmp(&b.severity).then(a.size.total_cmp(&b.size))
        };
        while let Some(worst) = found.iter().max_by(order).cloned() {
            let of_criterion = |d: &&Departure| d.criterion == worst.criterion;
            let others: Vec<&str> = (found.iter().filter(of_criterion))
                .map(|d| d.channel.as_str())
                .filter(|channel| *channel != worst.channel)
                .collect();
            let Departure { criterion, severity, mut text, remedy, .. } = worst;
            if !others.is_empty() {
                text += &format!("; likewise {}", others.join(", "));
            }
            found.retain(|d| d.criterion != criterion);
            report.reasons.push(reason(criterion, severity, &self.name, text, remedy));
        }
    }

    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Returns `true` if the gate refused nearly all samples.
    pub(crate) fn is_refused(&self) -> bool {
        let measured = self.whole.count + self.gated;
        measured >= SHARED && self.gated as f64 >= NEARLY_ALL * measured as f64
    }

    fn judge_shares(&self, alpha: f64, report: &mut Report) {
        let NisSums { count, .. } = self.whole;
        let measured = count + self.gated;
        let share = self.gated as f64 / measured as f64;
        let chance = crate::model::chi_square::poisson_tail(self.gated, self.expected_gated);
        let Streak { begin, end, count: in_a_row } = self.longest;
        if measured >= SHARED && share >= GATED && chance < alpha {
            let severity =
                if share >= MOSTLY_GATED { Severity::DoNotUse } else { Severity::Doubtful };
            report.reasons.push(reason(
                Criterion::Gated,
                severity,
                &self.name,
                // a sample of which other channels were used counts once
                format!(
                    "{} of {} samples were refused ({:.0} %, {:.1} samples expected)",
                    self.gated,
                    measured - self.in_part.count,
                    100.0 * self.gated as f64 / (measured - self.in_part.count) as f64,
                    self.expected_gated
                ),
                "look at its noise, mounting, clock and units, and at the noise of the driving \
                 sensor",
            ));
        } else if in_a_row >= IN_A_ROW && !self.constraint {
            report.reasons.push(reason(
                Criterion::Gated,
                Severity::Doubtful,
                &self.name,
                format!("{in_a_row} samples in a row were gated, from {begin} to {end}"),
                "look at the samples of that time, and at what moved the estimate before it",
            ));
        }
        let all = measured + self.faulty;
        if all >= SHARED && self.faulty as f64 >= REJECTED * all as f64 {
            report.reasons.push(reason(
                Criterion::Rejected,
                Severity::Doubtful,
                &self.name,
                format!("{} of {all} samples were faulty and rejected", self.faulty),
                "the warnings name the fault",
            ));
        }
        if count == 0 && !self.constraint {
            report.reasons.push(reason(
                Criterion::Unused,
                Severity::Doubtful,
                &self.name,
                "no sample corrected the state".to_owned(),
                "look at the source of its samples, or set enabled = false",
            ));
        }
    }

    /// Judges the mean NIS over the run; returns `true` if it is consistent.
    fn judge_nis(&self, alpha: f64, report: &mut Report) -> bool {
        let NisSums { count, nis, expected, variance } = self.whole;
        let inflated = variance * self.memory.inflation();
        let Band { low, high } = band(expected, inflated, alpha);
        // a millionth is enough, and such a number is the same when it is read from a log
        let [mean_nis, expected_nis, low, high] =
            [nis, expected, low, high].map(|x| (x / count as f64 * 1e6).round() / 1e6);
        let ratio = self.whole.ratio();
        let slight = (ratio.max(1.0 / ratio)) < SLIGHT;
        let band = Band { low, high };
        let inside = slight || band.holds(mean_nis);
        report.sensors.push(SensorConsistency {
            sensor: self.name.clone(),
            mean_nis,
            expected_nis,
            band,
            inside,
        });
        if !inside {
            let Size { severity, words, remedy } = size(ratio);
            report.reasons.push(reason(
                Criterion::Nis,
                severity,
                &self.name,
                format!(
                    "mean NIS {mean_nis:.2}, expected {expected_nis:.2} ({low:.2} to {high:.2}): \
                     its innovations are {words} sigma"
                ),
                remedy,
            ));
        }
        inside
    }

    fn judge_minutes(&self, alpha: f64, inside: bool, report: &mut Report) {
        let Some(Minute { begin, probability, sums }) = self.worst else { return };
        // where the whole run is outside its band, so are its minutes
        if !inside || self.minutes < 2 || probability * self.minutes as f64 >= alpha {
            return;
        }
        let (ratio, count) = (sums.ratio(), sums.count as f64);
        if ratio.max(1.0 / ratio) < SLIGHT {
            return;
        }
        let Size { severity, words, .. } = size(ratio);
        report.reasons.push(reason(
            Criterion::NisOfMinute,
            severity.min(Severity::Doubtful),
            &self.name,
            format!(
                "in the minute from {begin} its mean NIS is {:.2}, expected {:.2}: its innovations \
                 are {words} sigma there",
                sums.nis / count,
                sums.expected / count
            ),
            "look at the samples of that minute",
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::sample::SensorId;

    /// The probability 0.004 of the worst of `minutes` minutes, of which one in twenty may be
    /// wrong.
    #[test]
    fn the_worst_minute_counts_from_two_minutes_on_and_by_their_number() {
        let found = |minutes: u64, probability: f64, inside: bool| {
            let mut sensor = SensorStatistics::new("dvl".to_owned(), Vec::new(), false);
            let sums = NisSums { count: 60, nis: 360.0, expected: 180.0, variance: 360.0 };
            sensor.worst = Some(Minute { begin: Time::default(), probability, sums });
            sensor.minutes = minutes;
            let mut report = Report::default();
            sensor.judge_minutes(0.05, inside, &mut report);
            !report.reasons.is_empty()
        };
        assert!(found(2, 0.004, true) && found(12, 0.004, true));
        assert!(!found(1, 0.004, true), "one minute is the run");
        assert!(!found(12, 0.004, false), "the run is outside its band");
        assert!(!found(13, 0.004, true), "0.052");
        assert!(!found(10, 0.005, true), "0.05");
    }

    /// Four samples in a row are chance, and five are not, whatever other channels of the same samples do.
    #[test]
    fn gated_samples_in_a_row_are_those_of_a_channel() {
        let doubted = |gated: i64| {
            let mut sensor = SensorStatistics::new("gnss".to_owned(), Vec::new(), false);
            let mut take = |second: i64, present, outcome| {
                sensor.update(&UpdateRecord {
                    time: Time::from_nanos(second * 1_000_000_000),
                    sensor: SensorId(0),
                    outcome,
                    nis: 1.0,
                    threshold: 10.8,
                    present,
                    innovation: &[1.0],
                    covariance: &[1.0],
                });
            };
            for second in 0..600 {
                let height = if second < gated { Outcome::Gated } else { Outcome::Accepted };
                take(second, 0b01, height);
                take(second, 0b10, Outcome::Accepted);
            }
            let mut report = Report::default();
            sensor.judge_shares(1e-4, &mut report);
            report.reasons.iter().any(|reason| reason.criterion == Criterion::Gated)
        };
        assert!(!doubted(4) && doubted(5));
    }
}
