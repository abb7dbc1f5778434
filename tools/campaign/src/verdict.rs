//! Verdict on the consistency of errors and reported uncertainty.

use crate::columns::Columns;
use crate::statistics::{EpochStatistics, NisSums, PointStatistics};
use navfuse_core::model::chi_square::{Band, band, outside};
use serde::Serialize;

/// Probability that a consistent filter is called inconsistent. All tests share it (Bonferroni):
/// one half goes to the tests that are made once, the other half to those made at every epoch.
const FALSE_ALARM: f64 = 0.05;

/// The verdict on a point.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PointVerdict {
    /// Set if no test found an inconsistency.
    pub consistent: bool,
    /// Verdict in one line: `consistent`, or the first finding.
    pub text: String,
    /// Findings, the largest deviation first.
    pub findings: Vec<Finding>,
}

/// One deviation from the statistics of a consistent filter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Name of the block or sensor; `whole state`.
    pub of: String,
    /// Description.
    pub text: String,
    /// Ratio of the errors, or innovations, to their reported sigma; above 1 the filter is
    /// overconfident.
    pub factor: f64,
    /// Time of the first deviation, s; `None` if only the value at the end, or over all samples,
    /// deviates.
    pub since: Option<f64>,
}

/// Tested quantity.
#[derive(Clone, Copy, Debug)]
enum Test {
    /// Mean NEES of the whole state (0) or of a block (from 1).
    Nees(usize),
    /// NIS of a sensor.
    Nis(usize),
}

/// Sum of squared normalised errors, its expectation and variance, and its number of terms.
struct SquaredSum {
    sum: f64,
    expectation: f64,
    variance: f64,
    count: f64,
}

impl SquaredSum {
    /// Returns the ratio of the errors to their sigma, `sqrt(sum / expectation)`.
    fn ratio(&self) -> f64 {
        (self.sum / self.expectation).sqrt()
    }

    /// Returns `true` if the sum is outside its band for the false-alarm probability `alpha`.
    fn outside(&self, alpha: f64) -> bool {
        outside(self.sum, self.expectation, self.variance, alpha)
    }
}

/// Returns the band of the mean NEES of `runs` runs: their sum is chi-square with `dimension *
/// runs` degrees of freedom.
pub fn anees_band(dimension: usize, runs: usize, alpha: f64) -> Band {
    let freedom = (dimension * runs) as f64;
    let Band { low, high } = band(freedom, 2.0 * freedom, alpha);
    Band { low: low / runs as f64, high: high / runs as f64 }
}

/// Returns the band of a mean NIS, with the moments of the gated distribution.
pub fn nis_band(sums: &NisSums, alpha: f64) -> Option<Band> {
    (sums.used > 0.0 && sums.variance > 0.0).then(|| {
        let Band { low, high } = band(sums.expected, sums.variance, alpha);
        Band { low: low / sums.used, high: high / sums.used }
    })
}

fn dimension(columns: &Columns, of: usize) -> usize {
    if of == 0 { columns.known() } else { columns.blocks[of - 1].dimension }
}

/// Returns the summed NEES of all runs. Each run's NEES is chi-square with `dimension` degrees of
/// freedom, so the sum has the variance `2 dimension runs`.
fn nees(columns: &Columns, of: usize, mean: f64, runs: usize) -> SquaredSum {
    let count = runs as f64;
    let expectation = dimension(columns, of) as f64 * count;
    SquaredSum { sum: mean * count, expectation, variance: 2.0 * expectation, count }
}

/// Returns the summed NIS of a sensor; `None` without samples.
fn nis(sums: &NisSums) -> Option<SquaredSum> {
    let NisSums { used: count, nis: sum, expected: expectation, variance, .. } = *sums;
    (count > 0.0 && variance > 0.0).then_some(SquaredSum { sum, expectation, variance, count })
}

impl Test {
    fn name(self, columns: &Columns) -> String {
        match self {
            Self::Nees(0) => "whole state".into(),
            Self::Nees(of) => columns.blocks[of - 1].name.clone(),
            Self::Nis(sensor) => columns.sensors[sensor].clone(),
        }
    }

    /// Tests the quantity once at the end, or over all samples, and once at every epoch.
    fn find(self, columns: &Columns, point: &PointStatistics, tests: usize) -> Option<Finding> {
        let count = point.judged().count().max(1);
        // Bonferroni: the probabilities of all tests add up to FALSE_ALARM
        let (once, often) =
            (0.5 * FALSE_ALARM / tests as f64, 0.5 * FALSE_ALARM / (tests * count) as f64);
        let at = |epoch: &EpochStatistics| match self {
            Self::Nees(of) => epoch.anees(of).map(|(mean, runs)| nees(columns, of, mean, runs)),
            Self::Nis(sensor) => nis(&epoch.nis(sensor)),
        };
        let whole = match self {
            Self::Nees(_) => point.judged().next_back().and_then(at),
            Self::Nis(sensor) => nis(&point.nis(sensor)),
        };
        let whole = whole.filter(|seen| seen.outside(once));
        let since = point
            .judged()
            .find_map(|e| at(e).filter(|seen| seen.outside(often)).map(|seen| (e.time, seen)));
        let left = since.as_ref().map(|(time, _)| *time);
        let name = self.name(columns);
        let end = if matches!(self, Self::Nees(_)) { "at the end" } else { "over all samples" };
        let (seen, alpha, when) = match (whole, since) {
            (Some(seen), _) => {
                let first = left
                    .map_or_else(String::new, |t| format!(", first outside its band at {t:.0} s"));
                (seen, once, format!("{end}{first}"))
            }
            (None, Some((time, seen))) => {
                (seen, often, format!("first at {time:.0} s, but not {end}"))
            }
            (None, None) => return None,
        };
        let ratio = seen.ratio();
        let word = if ratio > 1.0 { "overconfident" } else { "underconfident" };
        let factor = if ratio > 1.0 { ratio } else { 1.0 / ratio };
        let Band { low, high } = band(seen.expectation, seen.variance, alpha);
        let [value, expected, low, high] =
            [seen.sum, seen.expectation, low, high].map(|sum| sum / seen.count);
        let of = match self {
            Self::Nees(0) => "as a whole".to_owned(),
            Self::Nees(_) => format!("in {name}"),
            Self::Nis(_) => format!("in the innovations of {name}"),
        };
        let what = if matches!(self, Self::Nees(_)) { "ANEES" } else { "mean NIS" };
        let text = format!(
            "{word} {of} by {factor:.2} {when}: {what} {value:.2}, expected {expected:.2} \
             ({low:.2} to {high:.2})"
        );
        Some(Finding { of: name, text, factor: ratio, since: left })
    }
}

/// Computes the verdict on a point's runs.
pub fn verdict(columns: &Columns, point: &PointStatistics) -> PointVerdict {
    let blocks = (1..=columns.blocks.len()).filter(|k| columns.blocks[k - 1].known).map(Test::Nees);
    let sensors = (0..columns.sensors.len()).map(Test::Nis);
    // blocks and sensors, which name a cause, come before the whole state, which does not
    let tests: Vec<Test> = blocks.chain(sensors).chain([Test::Nees(0)]).collect();
    let mut findings: Vec<Finding> =
        tests.iter().filter_map(|t| t.find(columns, point, tests.len())).collect();
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
    PointVerdict { consistent: findings.is_empty() && point.runs > 0, text, findings }
}

#[cfg(test)]
#[path = "verdict_tests.rs"]
mod tests;
