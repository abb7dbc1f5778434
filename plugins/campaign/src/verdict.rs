//! Whether errors and sigmas agree, in words.

use crate::chi_square::{Band, band};
use crate::columns::Columns;
use crate::statistics::{NisSums, PointStatistics};
use serde::Serialize;

/// The probability with which a consistent filter is called inconsistent, shared by all that is looked at: one half by what
/// is looked at once, one half by what is looked at every epoch.
const FALSE_ALARM: f64 = 0.05;

/// The verdict on a point.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// Whether nothing was found.
    pub consistent: bool,
    /// It in one line: `consistent`, or what was found first.
    pub text: String,
    /// What was found.
    pub findings: Vec<Finding>,
}

/// Something that a consistent filter does not do.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// The block or sensor; `whole state`.
    pub of: String,
    /// In words.
    pub text: String,
    /// How many times larger the errors, or innovations, are than their sigma; below 1 where they are smaller.
    pub factor: f64,
    /// When it was first so, s; none where it is so of the end, or of all samples together.
    pub since: Option<f64>,
}

/// What is looked at.
#[derive(Clone, Copy, Debug)]
enum Test {
    /// The mean NEES: of the whole state (0) or a block (from 1).
    Nees(usize),
    /// The NIS of a sensor.
    Nis(usize),
}

/// A number, what it should be, and the number of degrees of freedom of its root as a ratio.
struct Seen {
    ratio: f64,
    value: f64,
    expected: f64,
    band: Band,
}

/// The band of a mean NEES over so many runs.
pub fn anees_band(dimension: usize, runs: usize, alpha: f64) -> Band {
    let freedom = (dimension * runs) as f64;
    let Band { low, high } = band(freedom, 2.0 * freedom, alpha);
    Band { low: low / runs as f64, high: high / runs as f64 }
}

/// The band of a mean NIS.
pub fn nis_band(sums: &NisSums, alpha: f64) -> Option<Band> {
    (sums.used > 0.0 && sums.variance > 0.0).then(|| {
        let Band { low, high } = band(sums.expected, sums.variance, alpha);
        Band { low: low / sums.used, high: high / sums.used }
    })
}

fn dimension(columns: &Columns, of: usize) -> usize {
    if of == 0 { columns.known() } else { columns.blocks[of - 1].dimension }
}

fn nees(columns: &Columns, of: usize, (value, runs): (f64, usize), alpha: f64) -> Seen {
    let dimension = dimension(columns, of);
    let expected = dimension as f64;
    Seen { ratio: (value / expected).sqrt(), value, expected, band: anees_band(dimension, runs, alpha) }
}

fn nis(sums: &NisSums, alpha: f64) -> Option<Seen> {
    let band = nis_band(sums, alpha)?;
    let (value, expected) = (sums.nis / sums.used, sums.expected / sums.used);
    Some(Seen { ratio: (value / expected).sqrt(), value, expected, band })
}

impl Test {
    fn name(self, columns: &Columns) -> String {
        match self {
            Self::Nees(0) => "whole state".into(),
            Self::Nees(of) => columns.blocks[of - 1].name.clone(),
            Self::Nis(sensor) => columns.sensors[sensor].clone(),
        }
    }

    /// What is found of it: when it left the wide band for the first time, and where it ends.
    fn find(self, columns: &Columns, point: &PointStatistics, tests: usize) -> Option<Finding> {
        let count = point.epochs().count().max(1);
        let (once, often) = (0.5 * FALSE_ALARM / tests as f64, 0.5 * FALSE_ALARM / (tests * count) as f64);
        let at = |alpha: f64, epoch: Option<&crate::EpochStatistics>| match (self, epoch) {
            (Self::Nees(of), Some(e)) => e.anees(of).map(|a| nees(columns, of, a, alpha)),
            (Self::Nees(of), None) => {
                let last = point.epochs().next_back()?.1;
                last.anees(of).map(|a| nees(columns, of, a, alpha))
            }
            (Self::Nis(sensor), Some(e)) => nis(&e.nis(sensor), alpha),
            (Self::Nis(sensor), None) => nis(&point.nis(sensor), alpha),
        };
        let outside = |seen: &Seen| !seen.band.holds(seen.value);
        let since = point.epochs().find_map(|(_, e)| at(often, Some(e)).filter(outside).map(|seen| (e.time, seen)));
        let whole = at(once, None).filter(outside);
        let left = since.as_ref().map(|(time, _)| *time);
        let name = self.name(columns);
        let (seen, when) = match (whole, since) {
            (Some(seen), _) => {
                let when = if matches!(self, Self::Nees(_)) { "at the end" } else { "over all samples" };
                let first = left.map_or_else(String::new, |t| format!(", outside for the first time at {t:.0} s"));
                (seen, format!("{when}{first}"))
            }
            (None, Some((time, seen))) => (seen, format!("at {time:.0} s for the first time, not at the end")),
            (None, None) => return None,
        };
        let word = if seen.ratio > 1.0 { "overconfident" } else { "underconfident" };
        let factor = if seen.ratio > 1.0 { seen.ratio } else { 1.0 / seen.ratio };
        let Seen { value, expected, band, ratio } = seen;
        let of = match self {
            Self::Nees(0) => "as a whole".to_owned(),
            Self::Nees(_) => format!("in {name}"),
            Self::Nis(_) => format!("in the innovations of {name}"),
        };
        let what = if matches!(self, Self::Nees(_)) { "ANEES" } else { "mean NIS" };
        let text = format!(
            "{word} {of} by {factor:.2} {when}: {what} {value:.2}, expected {expected:.2} ({:.2} to {:.2})",
            band.low, band.high
        );
        Some(Finding { of: name, text, factor: ratio, since: left })
    }
}

/// The verdict on a point's runs.
pub fn verdict(columns: &Columns, point: &PointStatistics) -> Verdict {
    let blocks = (1..=columns.blocks.len()).filter(|k| columns.blocks[k - 1].known).map(Test::Nees);
    let sensors = (0..columns.sensors.len()).map(Test::Nis);
    // what names a cause comes before what says that there is one
    let tests: Vec<Test> = blocks.chain(sensors).chain([Test::Nees(0)]).collect();
    let mut findings: Vec<Finding> = tests.iter().filter_map(|t| t.find(columns, point, tests.len())).collect();
    findings.sort_by(|a, b| b.factor.ln().abs().total_cmp(&a.factor.ln().abs()));
    if let Some((run, reason)) = point.failures.first() {
        let (failed, all) = (point.failures.len(), point.failures.len() + point.runs);
        let text = format!("{failed} of {all} runs ended early; run {run}: {reason}");
        findings.insert(0, Finding { of: "runs".into(), text, factor: f64::INFINITY, since: None });
    }
    let text = match (findings.first(), point.runs) {
        (_, 0) if findings.is_empty() => "no runs".to_owned(),
        (None, _) => "consistent".to_owned(),
        (Some(first), _) => first.text.clone(),
    };
    Verdict { consistent: findings.is_empty() && point.runs > 0, text, findings }
}
