//! The three questions that a verdict answers: is the estimate usable, is its sigma true, and what
//! should be changed.

use crate::model::record::finding::Severity;
use crate::model::record::verdict::{Criterion, Reason, Verdict};
use serde::Serialize;

/// What a silence of a sensor leaves behind where the sigma has grown too little.
const SILENCE: &str =
    "after a silence of a sensor the sigma was too small, and has been enlarged since";

/// Use that the estimate is good for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Usable {
    /// It may be used.
    Yes,
    /// It may be used once an engineer has looked at the reasons.
    WithCare,
    /// It must not be used.
    No,
}

/// Size of the reported sigma beside the actual one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Truth {
    /// Nothing contradicts the reported sigma.
    True,
    /// The errors are smaller than reported.
    TooLarge,
    /// The errors are larger than reported.
    TooSmall,
}

/// A change that a reason asks for.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Change {
    /// Sensor, state or process.
    pub about: String,
    /// The key or the part of the vehicle to look at.
    pub remedy: String,
}

/// Answers that follow from the reasons of a verdict.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Answers {
    /// Answer to the first question.
    pub usable: Usable,
    /// Reason of this answer in a few words; empty where nothing speaks against the use.
    pub because: String,
    /// Answer to the second question.
    pub sigma: Truth,
    /// Reason or size of this answer in a few words; may be empty.
    #[serde(skip)]
    pub sigma_because: String,
    /// Answer to the third question: one change for each part, the most urgent first.
    pub change: Vec<Change>,
}

impl Usable {
    /// Words for a person.
    pub fn words(self) -> &'static str {
        match self {
            Self::Yes => "yes",
            Self::WithCare => "with care",
            Self::No => "no",
        }
    }
}

impl Truth {
    /// Words for a person.
    pub fn words(self) -> &'static str {
        match self {
            Self::True => "true",
            Self::TooLarge => "too large",
            Self::TooSmall => "too small",
        }
    }
}

impl Criterion {
    /// What was found, in a few words.
    fn words(self) -> &'static str {
        match self {
            Self::Ended => "the run ended early",
            Self::Finding => "a fault was found",
            Self::Silence => "sigma grew too little in a silence",
            Self::Alignment => "the alignment is incomplete",
            Self::Contradiction => "they contradict each other",
            Self::Prior => "the prior was left behind",
            Self::Linearisation => "the prior is too wide",
            Self::Gated => "many samples were gated",
            Self::Rejected => "many samples were faulty",
            Self::Unused => "no sample was used",
            Self::Nis | Self::NisOfMinute | Self::Channel => "innovations do not fit their sigma",
            Self::Bias => "innovations have a mean",
            Self::Correlation => "innovations are correlated",
            Self::Drift => "innovations drift",
            Self::Reference => "it is far from the reference",
        }
    }
}

impl Reason {
    /// Returns `true` if the reason shows that the reported sigma is wrong. A fault that makes the result
    /// useless stands for the innovations that contradict it.
    fn doubts_sigma(&self) -> bool {
        use Criterion::{Alignment, Ended, Finding, Rejected, Unused};
        let useless = (self.criterion, self.severity) == (Finding, Severity::DoNotUse);
        useless || ![Ended, Finding, Alignment, Rejected, Unused].contains(&self.criterion)
    }

    /// Returns `true` if the noise is stated too large: the actual sigma is the smaller one.
    pub(crate) fn is_safe(&self) -> bool {
        self.severity == Severity::Note && self.remedy.ends_with("too large")
    }
}

/// Distinct parts that some reasons are about, in order.
fn parts<'a>(reasons: impl Iterator<Item = &'a Reason>) -> Vec<&'a str> {
    let mut parts: Vec<&str> = Vec::new();
    for reason in reasons.filter(|reason| !reason.about.is_empty()) {
        if !parts.contains(&reason.about.as_str()) {
            parts.push(&reason.about);
        }
    }
    parts
}

impl Verdict {
    /// Answers the three questions.
    pub fn answers(&self) -> Answers {
        let usable = match self.severity() {
            Severity::Note | Severity::Contained => Usable::Yes,
            Severity::Doubtful => Usable::WithCare,
            Severity::DoNotUse => Usable::No,
        };
        let sigma = || self.reasons.iter().filter(|r| r.doubts_sigma());
        let truth = match () {
            () if sigma().any(|r| r.severity > Severity::Contained && !r.is_safe()) => {
                Truth::TooSmall
            }
            () if sigma().any(Reason::is_safe) && sigma().all(Reason::is_safe) => Truth::TooLarge,
            () => Truth::True,
        };
        let wrong = sigma().find(|r| r.severity > Severity::Contained && !r.is_safe());
        let noisy = || sigma().any(|r| r.severity == Severity::Note && !r.is_safe());
        let sigma_because = match (truth, wrong) {
            (Truth::TooSmall, Some(reason)) => {
                format!("{}: {}", reason.about, reason.criterion.words())
            }
            (Truth::True, _) if self.reasons.iter().any(|r| r.criterion == Criterion::Ended) => {
                "until the run ended".to_owned()
            }
            // a note on a noise that is stated too small has a size of 1.2 at most
            (Truth::True, _) if noisy() => "to 20 %".to_owned(),
            (Truth::TooLarge, _) => "on the safe side".to_owned(),
            _ => String::new(),
        };
        // a reference shows that the estimate is wrong, and not what to change
        let named = self
            .reasons
            .iter()
            .any(|r| r.criterion != Criterion::Reference && !r.remedy.is_empty());
        let remedies = self
            .reasons
            .iter()
            .filter(|r| !r.remedy.is_empty() && (r.criterion != Criterion::Reference || !named));
        let change = parts(remedies.clone()).into_iter().filter_map(|part| {
            let reason = remedies.clone().find(|r| r.about == part)?;
            Some(Change { about: reason.about.clone(), remedy: reason.remedy.clone() })
        });
        let (because, change) = (self.because(), change.collect());
        Answers { usable, because, sigma: truth, sigma_because, change }
    }

    /// Words, and the parts that are doubted, in one line: the reasons stand elsewhere.
    pub fn headline(&self) -> String {
        let (words, doubted) = (self.words(), self.doubted());
        if doubted.is_empty() { words.to_owned() } else { format!("{words}: {doubted}") }
    }

    /// Parts with a reason that is more than a note.
    fn doubted(&self) -> String {
        parts(self.reasons.iter().filter(|r| r.severity > Severity::Note)).join(", ")
    }

    /// Reason of the level, in a few words.
    fn because(&self) -> String {
        let doubts = || self.reasons.iter().filter(|r| r.severity > Severity::Note);
        let Some(worst) = doubts().max_by_key(|r| r.severity) else { return String::new() };
        if worst.severity == Severity::Contained {
            let faults = || doubts().filter(|r| r.criterion != Criterion::Silence);
            let names = parts(faults()).join(", ");
            return match (faults().next(), doubts().find(|r| r.criterion == Criterion::Silence)) {
                (None, _) => SILENCE.to_owned(),
                (_, None) => format!("a fault of {names} was found and contained"),
                _ => format!("a fault of {names} was found and contained; {SILENCE}"),
            };
        }
        let first = doubts().find(|r| r.severity == worst.severity).unwrap_or(worst);
        format!("{}: {}", first.about, first.criterion.words())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn verdict(reasons: &[(Criterion, Severity, &str, &str)]) -> Answers {
        let reasons = reasons.iter().map(|(criterion, severity, about, remedy)| Reason {
            criterion: *criterion,
            severity: *severity,
            about: (*about).to_owned(),
            text: String::new(),
            remedy: (*remedy).to_owned(),
        });
        Verdict::new(reasons.collect(), Vec::new()).answers()
    }

    const LARGE: &str = "its stated noise is too large";

    #[test]
    fn noise_that_is_stated_too_large_is_a_change_and_no_doubt() {
        let answers = verdict(&[(Criterion::Nis, Severity::Note, "depth", LARGE)]);
        let change = Change { about: "depth".to_owned(), remedy: LARGE.to_owned() };
        assert_eq!(
            answers,
            Answers {
                usable: Usable::Yes,
                because: String::new(),
                sigma: Truth::TooLarge,
                sigma_because: "on the safe side".to_owned(),
                change: vec![change]
            }
        );
        assert_eq!(verdict(&[]).sigma, Truth::True);
        let slight = (Criterion::Nis, Severity::Note, "dvl", "its noise is slightly too small");
        let answers = verdict(&[slight]);
        assert_eq!((answers.sigma, answers.sigma_because.as_str()), (Truth::True, "to 20 %"));
    }

    #[test]
    fn a_contained_fault_leaves_the_estimate_usable_and_names_its_part() {
        let contained = (Criterion::Finding, Severity::Contained, "gnss", "look at it");
        let gated = (Criterion::Gated, Severity::Contained, "gnss", "look at its noise");
        let answers = verdict(&[contained, gated, (Criterion::Nis, Severity::Note, "dvl", LARGE)]);
        assert_eq!((answers.usable, answers.sigma), (Usable::Yes, Truth::True));
        assert_eq!(answers.because, "a fault of gnss was found and contained");
        let abouts: Vec<&str> = answers.change.iter().map(|c| c.about.as_str()).collect();
        assert_eq!(abouts, ["gnss", "dvl"]);
    }

    #[test]
    fn the_heaviest_doubt_answers_whether_the_estimate_is_usable() {
        let doubt = (Criterion::Bias, Severity::Doubtful, "dvl", "look for a bias");
        let contained = (Criterion::Finding, Severity::Contained, "gnss", "");
        let answers = verdict(&[contained, doubt]);
        assert_eq!((answers.usable, answers.sigma), (Usable::WithCare, Truth::TooSmall));
        assert_eq!(answers.because, "dvl: innovations have a mean");
        assert_eq!(answers.sigma_because, "dvl: innovations have a mean");
        let answers = verdict(&[doubt, (Criterion::Ended, Severity::DoNotUse, "run", "")]);
        assert_eq!(
            (answers.usable, answers.because.as_str()),
            (Usable::No, "run: the run ended early")
        );
        let answers = verdict(&[(Criterion::Ended, Severity::DoNotUse, "run", "")]);
        assert_eq!(
            (answers.sigma, answers.sigma_because.as_str()),
            (Truth::True, "until the run ended")
        );
    }

    /// A reference names no part: the change is the one of the sensor, and the reference is not bad.
    #[test]
    fn an_estimate_far_from_its_reference_accuses_the_sensor_alone() {
        let off = (Criterion::Reference, Severity::DoNotUse, "estimate", "look at the sensors");
        let fault = (Criterion::Finding, Severity::DoNotUse, "imu", "check its axes");
        let parts = |reasons: &[_]| -> Vec<String> {
            verdict(reasons).change.into_iter().map(|change| change.about).collect()
        };
        assert_eq!(parts(&[fault, off]), ["imu"]);
        assert_eq!(parts(&[off]), ["estimate"]);
    }
}
