//! Stages of a filter: waiting for its start, searching for its initial values, running.

use crate::checkpoint::saved;
use crate::units::sample::Sample;
use crate::units::time::Time;

/// Stage of a filter.
#[derive(Clone)]
pub(super) enum Stage {
    /// Waits for the first driving sample from this time on, or for the first measurement if no
    /// sensor drives.
    At(Time),
    /// Waits for the first reference from this time on.
    FromReference(Time),
    /// Searches for the initial values from the time of the state on. The buffer holds the samples
    /// since that time.
    Searching(Vec<Sample>),
    /// Has found the initial values, and begins with the next sample. The samples since the time of
    /// the state, which the filter takes next, are here until `take_found`.
    Found(Vec<Sample>),
    /// Runs.
    Running,
}

saved!(
    enum Stage {
        At(time),
        FromReference(time),
        Searching(samples),
        Found(samples),
        Running,
    }
);
