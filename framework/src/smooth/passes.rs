//! Passes over a run, each linearised at the smoothed trajectory of the one before: Gauss-Newton on
//! the whole run.

use super::change::Passes;
use super::error::SmoothError;
use super::forward::Forward;
use super::interval::Smoothed;
use crate::compose::estimator::Linearised;

/// Largest change of a component, in its smoothed sigma, at which the passes have converged.
const CONVERGED: f64 = 1e-3;

/// Smooths a run in up to that many passes.
pub(super) fn smooth(
    forward: &mut Forward,
    ekf: &mut dyn Linearised,
    passes: u32,
) -> Result<Smoothed, SmoothError> {
    ekf.foresee();
    // the filter has followed a wrong first sample until the others outweighed it
    if !ekf.wrong().is_empty() {
        drop(forward.repeat(ekf, None)?);
    }
    let mut best = Smoothed::of(forward, ekf, passes > 1)?;
    if passes == 1 {
        return Ok(best);
    }
    let mut report = Passes { count: 1, ..Passes::default() };
    let mut last = f64::INFINITY;
    while report.count < passes
        && let Some(course) = best.course.take()
    {
        let number = report.count + 1;
        if let Err(error) = forward.repeat(ekf, Some(Box::new(course)))? {
            report.text = format!(
                "pass {number} failed: {error}; the estimates come from the pass before it"
            );
            break;
        }
        let next = Smoothed::of(forward, ekf, true)?;
        report.count = number;
        report.changes.push(next.change.size);
        let words = next.change.words(&ekf.composition().layout);
        // the linear run holds at a step that shrinks
        if next.change.size > last || next.change.size.is_nan() {
            report.text = format!(
                "pass {number} diverges: it changed {words}, more than the pass before it, whose \
                 estimates stay; state a prior nearer to the truth"
            );
            break;
        }
        last = next.change.size;
        best = next;
        report.converged = last <= CONVERGED;
        if report.converged {
            report.text = format!("converged after {number} passes: the last one changed {words}");
            break;
        }
        report.text = format!(
            "not converged after {number} passes: the last one changed {words}; allow more `passes`"
        );
    }
    ekf.leave_course();
    best.quality.passes = Some(report);
    Ok(best)
}
