//! Parts that the criteria share: the level of the tests, and the reasons that they report.

use crate::model::record::finding::Severity;
use crate::model::record::verdict::{Criterion, Reason, SensorConsistency};

/// Probability that the statistical tests doubt a consistent run. All tests share it.
pub(crate) const FALSE_ALARM: f64 = 0.005;

/// Ratio of actual to reported sigma below which a run is not doubted, however many samples show
/// it: no decision depends on 5 %.
pub(crate) const SLIGHT: f64 = 1.05;

/// Ratio of actual to reported sigma up to which the result may be used, although the noise should
/// be stated anew: a drift or a correlation within its limit makes the sigma just as wrong.
pub(crate) const SMALL: f64 = 1.2;

/// Ratio of actual to reported sigma from which a result must not be used.
pub(crate) const UNTRUE: f64 = 2.0;

/// Reasons and figures, as the criteria find them.
#[derive(Default)]
pub(crate) struct Report {
    pub(crate) reasons: Vec<Reason>,
    pub(crate) sensors: Vec<SensorConsistency>,
}

/// Creates a reason.
pub(crate) fn reason(
    criterion: Criterion,
    severity: Severity,
    about: &str,
    text: String,
    remedy: &str,
) -> Reason {
    Reason { criterion, severity, about: about.to_owned(), text, remedy: remedy.to_owned() }
}

/// Judgement on a ratio of innovations to their sigma.
pub(crate) struct Size {
    pub(crate) severity: Severity,
    pub(crate) words: String,
    pub(crate) remedy: &'static str,
}

/// Judges a ratio of innovations to their sigma.
pub(crate) fn size(ratio: f64) -> Size {
    if ratio < 1.0 {
        return Size {
            severity: Severity::Note,
            words: format!("only {ratio:.2} times their reported"),
            remedy: "its stated noise is too large",
        };
    }
    let severity = match ratio {
        r if r >= UNTRUE => Severity::DoNotUse,
        r if r >= SMALL => Severity::Doubtful,
        _ => Severity::Note,
    };
    let remedy =
        "its stated noise or the driving sensor's is too small, or an effect is not modelled";
    Size { severity, words: format!("{ratio:.2} times their reported"), remedy }
}
