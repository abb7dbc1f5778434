//! A filter that takes its samples once more.

use crate::compose::estimator::Linearised;
use crate::compose::snapshot::Snapshot;

/// Returns to a snapshot, and leaves out from now on the first samples that were found to be wrong since then.
pub(super) fn repeat_from(ekf: &mut dyn Linearised, snapshot: &Snapshot) {
    let wrong = ekf.wrong().clone();
    ekf.restore(snapshot);
    *ekf.wrong() = wrong;
}
