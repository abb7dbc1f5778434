//! How far a filter is: it waits for its start, searches for its initial values, or runs.

use crate::units::sample::Sample;
use crate::units::time::Time;

/// When the filter starts.
#[derive(Clone)]
pub(super) enum Start {
    /// At the first driving sample, or measurement where nothing drives, from this time on.
    At(Time),
    /// At the first reference from this time on.
    FromReference(Time),
    /// A process searches for its initial values from the state's time on: what came since then.
    Searching(Vec<Sample>),
    /// It has.
    Running,
}

impl Start {
    /// Whether a driving sample, or measurement where nothing drives, of that time starts the filter.
    pub(super) fn is_due(&self, time: Time) -> bool {
        matches!(self, Self::At(start) if time >= *start)
    }
}
