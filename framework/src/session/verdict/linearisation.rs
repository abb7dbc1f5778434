//! Priors that are too wide for the linearisation of the filter.
//!
//! The filter takes `sin e = e` and `cos e = 1` for an error `e` of a rotation. The neglected part
//! of the cosine, `e^2 / 2`, looks like information on other states and makes them overconfident.
//! Other blocks have no such term of their own.

use super::report::reason;
use crate::checkpoint::saved;
use crate::compose::Composition;
use crate::model::record::Epoch;
use crate::model::record::finding::Severity;
use crate::model::record::verdict::{Criterion, Reason};
use crate::state::manifold::Reading;

/// Mean of `e^2 / 2` from which a run is doubtful: 1 %, a sigma of 8 deg.
const DOUBTFUL: f64 = 0.01;
/// Mean of `e^2 / 2` from which a result must not be used: 4 %, a sigma of 16 deg.
const TOO_WIDE: f64 = 0.04;

/// A prior that is too wide, and what the run has made of it.
#[derive(Clone, Debug)]
pub(crate) struct WidePrior {
    reason: Reason,
    /// Place in the error state, and the latest variance there.
    place: usize,
    variance: f64,
}

saved!(WidePrior { variance } except { reason, place });

impl WidePrior {
    pub(crate) fn reason(&self) -> &Reason {
        &self.reason
    }

    /// Takes the covariance of an estimate.
    pub(crate) fn epoch(&mut self, epoch: &Epoch<'_>) {
        self.variance = epoch.covariance.get(self.place, self.place);
    }

    /// Acquits the prior of a run whose samples have made it narrow enough, and in which nothing
    /// else is in doubt: samples that were used while it was wide would contradict later ones.
    pub(crate) fn acquit(&self, reasons: &mut [Reason]) {
        let narrow = 0.5 * self.variance < DOUBTFUL;
        let of = |r: &Reason| r.criterion == Criterion::Linearisation;
        if !narrow || reasons.iter().any(|r| r.severity > Severity::Note && !of(r)) {
            return;
        }
        for reason in reasons.iter_mut().filter(|reason| **reason == self.reason) {
            reason.severity = Severity::Note;
            reason.text += &format!(
                "; the samples reduced it to {:.2} deg, and nothing contradicts the result",
                self.variance.sqrt().to_degrees()
            );
        }
    }
}

/// Finds the estimated rotations whose prior is too wide; `moved` marks the blocks that a process
/// moves. An alignment that searches for the initial values linearises at what it has found.
pub(crate) fn wide_priors(composition: &Composition, moved: &[bool]) -> Vec<WidePrior> {
    let searched = composition.processes.iter().any(|p| p.searches);
    let blocks = composition.layout.blocks.iter().zip(moved);
    blocks
        .filter(|(block, moved)| {
            block.estimated()
                && block.operations.reading == Reading::Angles
                && !(searched && **moved)
        })
        .filter_map(|(block, _)| {
            let (k, sigma) = (block.spec.sigma.iter().copied().enumerate())
                .max_by(|a, b| a.1.total_cmp(&b.1))?;
            let neglected = 0.5 * sigma * sigma;
            let severity = match neglected {
                n if n >= TOO_WIDE => Severity::DoNotUse,
                n if n >= DOUBTFUL => Severity::Doubtful,
                _ => return None,
            };
            let component = block.spec.display.components.get(k).copied().unwrap_or_default();
            let place = block.tangent_range().start + k;
            let reason = reason(
                Criterion::Linearisation,
                severity,
                format!("{} {component}", block.name).trim_end(),
                format!(
                    "a prior sigma of {:.0} deg is too wide for a linearised filter, which neglects \
                     {:.0} % of the cosine",
                    sigma.to_degrees(),
                    100.0 * neglected
                ),
                "give a better initial value with a smaller sigma, or let an alignment find it \
                 ([process.NAME.alignment])",
            );
            Some(WidePrior { reason, place, variance: sigma * sigma })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reason_of(criterion: Criterion, severity: Severity) -> Reason {
        reason(criterion, severity, "ins.attitude yaw", String::new(), "")
    }

    /// A prior of 20 deg that the run reduced to `deg`, beside another reason.
    fn acquitted(deg: f64, other: Severity) -> bool {
        let wide = reason_of(Criterion::Linearisation, Severity::DoNotUse);
        let prior =
            WidePrior { reason: wide.clone(), place: 0, variance: deg.to_radians().powi(2) };
        let mut reasons = [wide, reason_of(Criterion::Nis, other)];
        prior.acquit(&mut reasons);
        reasons[0].severity == Severity::Note
    }

    /// 8 deg neglect 1 % of the cosine.
    #[test]
    fn a_wide_prior_is_acquitted_if_the_run_narrowed_it_and_nothing_contradicts_the_result() {
        assert!(acquitted(0.1, Severity::Note) && acquitted(8.0, Severity::Note));
        assert!(!acquitted(8.2, Severity::Note) && !acquitted(f64::NAN, Severity::Note));
        assert!(!acquitted(0.1, Severity::Contained) && !acquitted(0.1, Severity::Doubtful));
    }
}
