//! Verdict of a run: whether its result may be used, and the reasons.

use crate::model::chi_square::Band;
use crate::model::record::finding::{Severity, belongs};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Level of a verdict.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum VerdictLevel {
    /// No criterion contradicts the reported uncertainty.
    #[default]
    Consistent,
    /// The result may be used with care: an engineer should look at the reasons first.
    Doubtful,
    /// The result must not be used: the reported uncertainty is wrong by a factor of about two or
    /// more, or sensors contradict each other.
    DoNotUse,
}

impl From<Severity> for VerdictLevel {
    fn from(severity: Severity) -> Self {
        match severity {
            Severity::Note => Self::Consistent,
            Severity::Contained | Severity::Doubtful => Self::Doubtful,
            Severity::DoNotUse => Self::DoNotUse,
        }
    }
}

/// Criterion that a run violated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Criterion {
    /// The run ended early with an error.
    Ended,
    /// The filter or a monitor reported a fault.
    Finding,
    /// The filter was without a sensor for longer than its sigma allows for.
    Silence,
    /// The initial alignment is incomplete.
    Alignment,
    /// Two sensors pull the same state in opposite directions.
    Contradiction,
    /// A state ended too far from its prior.
    Prior,
    /// A prior is too wide for the linearisation of the filter.
    Linearisation,
    /// Too many samples were gated.
    Gated,
    /// Too many samples were faulty.
    Rejected,
    /// No sample of a sensor corrected the state.
    Unused,
    /// The mean NIS of a sensor is outside its band.
    Nis,
    /// The mean NIS of one minute is outside its band.
    NisOfMinute,
    /// The innovations of one channel are too large or too small.
    Channel,
    /// The innovations of one channel have a mean.
    Bias,
    /// Successive innovations of one channel are correlated.
    Correlation,
    /// The innovations of one channel drift: their means over a minute are too large.
    Drift,
    /// The reference contradicts the estimate at the end.
    Reference,
}

impl Criterion {
    /// Returns `true` for a statistic of the whole run, which has no time of its own.
    pub fn is_of_the_whole_run(self) -> bool {
        !matches!(self, Self::Finding | Self::Silence)
    }

    /// Returns `true` if a violation shows that sensors contradict the filter, and not why.
    pub(crate) fn compares(self) -> bool {
        use Criterion::{Bias, Channel, Contradiction, Correlation, Drift, Gated};
        use Criterion::{Nis, NisOfMinute, Prior};
        let all =
            [Bias, Channel, Contradiction, Correlation, Drift, Gated, Nis, NisOfMinute, Prior];
        all.contains(&self)
    }
}

/// Reason of a verdict.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reason {
    /// Criterion that was violated.
    pub criterion: Criterion,
    /// Consequence for the result.
    pub severity: Severity,
    /// Sensor, state or process concerned.
    pub about: String,
    /// Evidence: what was measured, and what was expected.
    pub text: String,
    /// Remedy: the key or the part of the vehicle to look at; empty if the evidence names it.
    pub remedy: String,
}

impl Reason {
    /// Returns `true` if the reason is about the sensor or one of its states: `dvl.scale`.
    pub fn is_about(&self, sensor: &str) -> bool {
        belongs(&self.about, sensor)
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.about, self.text)
    }
}

/// NIS of a sensor over a run, against its band.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SensorConsistency {
    /// Name of the sensor.
    pub sensor: String,
    /// Mean NIS of the used samples.
    pub mean_nis: f64,
    /// Expected NIS of samples that passed the gate.
    pub expected_nis: f64,
    /// Band of the mean NIS at the level of the verdict.
    pub band: Band,
    /// Set if the mean NIS is in the band, or close enough to its expectation.
    pub inside: bool,
}

/// Severity of the heaviest reason, which the level of a log without its reasons stands for.
fn severity(level: VerdictLevel, reasons: &[Reason]) -> Severity {
    let contained =
        !reasons.is_empty() && reasons.iter().all(|r| r.severity <= Severity::Contained);
    match level {
        VerdictLevel::Consistent => Severity::Note,
        VerdictLevel::Doubtful if contained => Severity::Contained,
        VerdictLevel::Doubtful => Severity::Doubtful,
        VerdictLevel::DoNotUse => Severity::DoNotUse,
    }
}

/// Verdict of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// Level: the highest severity of the reasons.
    pub level: VerdictLevel,
    /// Verdict in one line.
    pub text: String,
    /// Reasons, the most severe first.
    pub reasons: Vec<Reason>,
    /// NIS of each sensor that corrected the state.
    pub sensors: Vec<SensorConsistency>,
}

impl Verdict {
    /// Number of reasons in the line of the verdict.
    const IN_LINE: usize = 2;

    /// Creates the verdict from its reasons, which it sorts by severity. A reference shows that the
    /// estimate is wrong and not why, so that it follows every doubt that names a part.
    pub fn new(mut reasons: Vec<Reason>, sensors: Vec<SensorConsistency>) -> Self {
        let level = reasons.iter().map(|r| r.severity).max();
        let level = level.map_or(VerdictLevel::Consistent, VerdictLevel::from);
        reasons.sort_by_key(|reason| match reason.criterion {
            Criterion::Reference => std::cmp::Reverse((Severity::Contained, false)),
            _ => std::cmp::Reverse((reason.severity, true)),
        });
        let mut text = severity(level, &reasons).verdict().to_owned();
        let doubts = || reasons.iter().filter(|r| r.severity > Severity::Note);
        for (k, reason) in doubts().take(Self::IN_LINE).enumerate() {
            text += if k == 0 { ": " } else { "; " };
            text += &reason.to_string();
        }
        let count = doubts().count();
        if count > Self::IN_LINE {
            text += &format!("; and {} more", count - Self::IN_LINE);
        }
        Self { level, text, reasons, sensors }
    }

    /// The verdict as if there were no reference: a campaign judges how far a run finds out without
    /// the truth that it is wrong.
    pub fn without_reference(&self) -> Self {
        let others = self.reasons.iter().filter(|r| r.criterion != Criterion::Reference);
        Self::new(others.cloned().collect(), self.sensors.clone())
    }

    /// Severity of the heaviest reason: a verdict whose faults are all contained is no reason not to use
    /// the result.
    pub fn severity(&self) -> Severity {
        severity(self.level, &self.reasons)
    }

    /// Words for a person, with which [`Verdict::text`] begins; see [`Severity::verdict`].
    pub fn words(&self) -> &'static str {
        self.severity().verdict()
    }

    /// Returns `true` if a statistic of the whole run speaks against the sensor, which doubts the sensor
    /// throughout.
    pub fn doubts_throughout(&self, sensor: &str) -> bool {
        let doubts = self.reasons.iter().filter(|r| r.severity > Severity::Contained);
        doubts.into_iter().any(|r| r.criterion.is_of_the_whole_run() && r.is_about(sensor))
    }

    /// NIS of the sensor of that name.
    pub fn sensor(&self, name: &str) -> Option<&SensorConsistency> {
        self.sensors.iter().find(|s| s.sensor == name)
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reason(severity: Severity, about: &str) -> Reason {
        let (text, remedy) = ("is wrong".to_owned(), String::new());
        Reason { criterion: Criterion::Nis, severity, about: about.to_owned(), text, remedy }
    }

    #[test]
    fn the_most_severe_reason_gives_the_level_and_comes_first() {
        let reasons = [
            reason(Severity::Doubtful, "dvl"),
            reason(Severity::DoNotUse, "depth"),
            reason(Severity::Doubtful, "gnss"),
        ];
        let verdict = Verdict::new(reasons.to_vec(), Vec::new());
        assert_eq!(verdict.level, VerdictLevel::DoNotUse);
        assert_eq!(verdict.to_string(), "do not use: depth: is wrong; dvl: is wrong; and 1 more");
        assert_eq!(verdict.headline(), "do not use: depth, dvl, gnss");
        let consistent = Verdict::new(vec![reason(Severity::Note, "dvl")], Vec::new());
        assert_eq!(
            (consistent.to_string().as_str(), &*consistent.headline()),
            ("consistent", "consistent")
        );
    }

    /// The line, its short form and the words are one wording for every severity.
    #[test]
    fn the_line_and_the_headline_begin_with_the_words_of_the_verdict() {
        for severity in Severity::ALL {
            let verdict = Verdict::new(vec![reason(severity, "dvl")], Vec::new());
            assert_eq!((verdict.severity(), verdict.words()), (severity, severity.verdict()));
            assert!(verdict.text.starts_with(verdict.words()), "{verdict}");
            assert!(verdict.headline().starts_with(verdict.words()), "{}", verdict.headline());
        }
        let contained = Verdict::new(vec![reason(Severity::Contained, "gnss")], Vec::new());
        assert_eq!(contained.headline(), "usable, with a contained fault: gnss");
        assert_eq!(contained.text, "usable, with a contained fault: gnss: is wrong");
    }

    #[test]
    fn a_statistic_of_the_whole_run_doubts_a_sensor_throughout_and_a_finding_does_not() {
        let nis = |severity, about| Verdict::new(vec![reason(severity, about)], Vec::new());
        let doubted = nis(Severity::Doubtful, "dvl.scale");
        assert!(doubted.doubts_throughout("dvl") && !doubted.doubts_throughout("depth"));
        assert!(!nis(Severity::Contained, "dvl").doubts_throughout("dvl"));
        let either = nis(Severity::DoNotUse, "imu, dvl");
        assert_eq!(
            ["imu", "dvl", "depth"].map(|s| either.doubts_throughout(s)),
            [true, true, false]
        );
        let found = Reason { criterion: Criterion::Finding, ..reason(Severity::DoNotUse, "dvl") };
        assert!(!Verdict::new(vec![found], Vec::new()).doubts_throughout("dvl"));
    }

    #[test]
    fn a_note_is_no_doubt_and_not_in_the_line() {
        let verdict = Verdict::new(vec![reason(Severity::Note, "depth")], Vec::new());
        assert_eq!(
            (verdict.level, verdict.text.as_str()),
            (VerdictLevel::Consistent, "consistent")
        );
        assert_eq!(verdict.reasons.len(), 1);
    }

    #[test]
    fn a_reference_gives_the_level_and_follows_the_doubts_that_name_a_part() {
        let severe =
            Reason { criterion: Criterion::Reference, ..reason(Severity::DoNotUse, "ref") };
        let reasons =
            vec![severe, reason(Severity::Note, "dvl"), reason(Severity::Doubtful, "gnss")];
        let verdict = Verdict::new(reasons, Vec::new());
        let parts: Vec<&str> = verdict.reasons.iter().map(|r| r.about.as_str()).collect();
        assert_eq!((verdict.level, parts), (VerdictLevel::DoNotUse, vec!["gnss", "ref", "dvl"]));
        assert_eq!(verdict.text, "do not use: gnss: is wrong; ref: is wrong");
        let alone = verdict.without_reference();
        assert_eq!((alone.level, alone.reasons.len()), (VerdictLevel::Doubtful, 2));
    }
}
