//! Stages of a filter: waiting for its start, searching for its initial values, running.

use crate::units::sample::Sample;
use crate::units::time::Time;

/// Stage of a filter.
#[derive(Clone)]
pub(super) enum Stage {
    /// Waits for the first driving sample from this time on, or the first measurement where no
    /// sensor drives.
    At(Time),
    /// Waits for the first reference from this time on.
    FromReference(Time),
    /// Searches for the initial values from the state's time on. The buffer holds the samples
    /// since.
    Searching(Vec<Sample>),
    /// Runs.
    Running,
}

impl Stage {
    /// Whether a driving sample of that time, or a measurement where no sensor drives, starts the
    /// filter.
    pub(super) fn is_due(&self, time: Time) -> bool {
        matches!(self, Self::At(start) if time >= *start)
    }
}
