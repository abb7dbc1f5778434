//! Priors that are too wide for the linearisation of the filter.
//!
//! The filter takes `sin e = e` and `cos e = 1` for an error `e` of a rotation. The neglected part
//! of the cosine, `e^2 / 2`, looks like information on other states and makes them overconfident.
//! Other blocks have no such term of their own.

use super::report::reason;
use crate::compose::Composition;
use crate::model::record::finding::Severity;
use crate::model::record::verdict::{Criterion, Reason};
use crate::state::manifold::Reading;

/// Mean of `e^2 / 2` from which a run is doubtful: 1 %, a sigma of 8 deg.
const DOUBTFUL: f64 = 0.01;
/// Mean of `e^2 / 2` from which a result must not be used: 4 %, a sigma of 16 deg.
const TOO_WIDE: f64 = 0.04;

/// Reports the estimated rotations whose prior is too wide; `moved` marks the blocks that a process
/// moves. An alignment that searches for the initial values linearises at what it has found.
pub(crate) fn wide_priors(composition: &Composition, moved: &[bool]) -> Vec<Reason> {
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
            Some(reason(
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
            ))
        })
        .collect()
}
