//! One run of the recording with a change.

use crate::likelihood::{Channels, Densities, Likelihood};
use crate::patch::Patch;
use crate::scene::Scene;
use navfuse_core::model::record::finding::Severity;
use navfuse_core::model::record::verdict::VerdictLevel;
use navfuse_core::plugin::BuildError;
use navfuse_core::run::runner;
use navfuse_core::run::scenario::{Assembly, Scenario};
use navfuse_core::session::Finished;
use navfuse_core::session::summary::{StateRow, Summary};
use navfuse_core::units::time::Time;
use std::sync::atomic::AtomicBool;

/// The outcome of a run.
#[derive(Clone, Debug)]
pub(crate) struct Outcome {
    pub densities: Densities,
    /// Scales of outliers that its innovations suggest.
    pub scales: Channels<f64>,
    pub severity: Severity,
    pub verdict: String,
    /// Level of the verdict without the reference, and the part that it names first.
    pub blind: (VerdictLevel, Option<String>),
    /// Largest error of a state at the end in units of its sigma, where a reference gives the truth.
    pub worst: Option<f64>,
    /// Latitude, longitude (deg) and height (m) at the end.
    pub position: Option<[f64; 3]>,
    /// State that the change makes uncertain.
    pub estimate: Option<StateRow>,
    /// Time of the first finding that is more than a note.
    pub found: Option<Time>,
    /// Set if no sample was linearised again, though the scenario allows it.
    pub once: bool,
    /// Set if the run was interrupted.
    pub interrupted: bool,
}

/// Setting with which no sample is linearised again.
const ONCE: &str = "estimator.relinearise=\"0 s\"";

/// Runs the samples until a time with a change, and with every sample linearised once unless the scenario
/// demands more: a filter that a wrong change leads astray linearises again and again, in up to
/// 80 times the time.
pub(crate) fn run_once(
    scene: &Scene<'_>,
    patch: &Patch,
    until: Time,
    scales: &Channels<f64>,
    stop: &AtomicBool,
) -> Result<Outcome, BuildError> {
    let estimator = scene.document.root().get("estimator");
    let decided = estimator.is_some_and(|table| table.get("relinearise").is_some());
    let mut patch = patch.clone();
    patch.settings.extend((!decided).then(|| ONCE.to_owned()));
    Ok(Outcome { once: !decided, ..run(scene, &patch, until, scales, stop)? })
}

/// Runs the samples until a time with a change.
pub(crate) fn run(
    scene: &Scene<'_>,
    patch: &Patch,
    until: Time,
    scales: &Channels<f64>,
    stop: &AtomicBool,
) -> Result<Outcome, BuildError> {
    let scenario = Scenario::new(scene.registry, scene.document.clone(), &patch.settings)?;
    let composition = scenario.compose()?;
    let sources = scene.recording.sources(&composition, until);
    let likelihood = Likelihood::new(scales.clone(), patch.stretches.clone());
    let sinks = vec![("likelihood".to_owned(), Box::new(likelihood) as _)];
    let mut finished = runner::run(Assembly { composition, sources, sinks }, stop, |_| {});
    let likelihood = finished.take_sink::<Likelihood>().unwrap_or_default();
    let found = found(&finished);
    Ok(Outcome {
        densities: likelihood.densities(),
        scales: likelihood.scales(),
        severity: severity(&finished),
        verdict: finished.summary.verdict.text.clone(),
        blind: blind(&finished),
        worst: finished.summary.rows.iter().filter_map(worst).max_by(f64::total_cmp),
        position: position(&finished.summary),
        estimate: patch
            .state
            .as_ref()
            .and_then(|state| finished.summary.rows.into_iter().find(|row| row.name == state.name)),
        found,
        once: false,
        interrupted: finished.interrupted,
    })
}

/// The severity of the heaviest reason; a run that an error ended is not used.
fn severity(finished: &Finished) -> Severity {
    match finished.error {
        Some(_) => Severity::DoNotUse,
        None => finished.summary.verdict.severity(),
    }
}

/// The verdict as a user without a reference has it: its level, and the part that it names first
/// unless it is consistent.
fn blind(finished: &Finished) -> (VerdictLevel, Option<String>) {
    let verdict = finished.summary.verdict.without_reference();
    let level = if finished.error.is_some() { VerdictLevel::DoNotUse } else { verdict.level };
    let doubt = verdict.reasons.into_iter().find(|reason| reason.severity > Severity::Note);
    (level, doubt.map(|reason| reason.about))
}

/// Time of the first finding that is more than a note.
fn found(finished: &Finished) -> Option<Time> {
    let findings = finished.findings.iter().filter(|finding| finding.severity > Severity::Note);
    findings.map(|finding| finding.time).min()
}

/// Largest error of the components of a state, in units of its sigma.
fn worst(row: &StateRow) -> Option<f64> {
    let pairs = row.error.as_ref()?.iter().zip(&row.error_sigma);
    let known = pairs.filter(|(_, sigma)| **sigma > 0.0);
    known.map(|(error, sigma)| (error / sigma).abs()).max_by(f64::total_cmp)
}

/// Latitude, longitude and height at the end, of the first state that has them.
fn position(summary: &Summary) -> Option<[f64; 3]> {
    let geodetic = |row: &&StateRow| {
        summary.states.get(&row.name).is_some_and(|state| state.get("estimate_unit").is_some())
    };
    summary.rows.iter().find(geodetic)?.estimate[..].try_into().ok()
}

/// A state with its 1-sigma.
pub(crate) fn words(row: &StateRow) -> String {
    let values = row.estimate.iter().zip(&row.sigma).map(|(value, sigma)| {
        let digits = (1.0 - sigma.abs().max(1e-9).log10().floor()).clamp(0.0, 6.0) as usize;
        format!("{value:.digits$} ± {sigma:.digits$}")
    });
    format!("{} {}", values.collect::<Vec<_>>().join(", "), row.unit)
}

/// Distance of two positions, m, on a sphere.
pub(crate) fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    const RADIUS: f64 = 6_371_000.0;
    let north = (a[0] - b[0]).to_radians() * RADIUS;
    let turn = (a[1] - b[1]).rem_euclid(360.0);
    let east = turn.min(360.0 - turn).to_radians() * RADIUS * a[0].to_radians().cos();
    north.hypot(east).hypot(a[2] - b[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_distance_of_two_positions_is_that_on_the_ground_and_in_height() {
        let minute = distance([60.0, 179.995, 0.0], [60.0, -179.995, 0.0]);
        assert!((minute - 0.01_f64.to_radians() * 6_371_000.0 * 0.5).abs() < 1e-6, "{minute}");
        assert_eq!(distance([0.0, 0.0, 3.0], [0.0, 0.0, 7.0]), 4.0);
    }
}
