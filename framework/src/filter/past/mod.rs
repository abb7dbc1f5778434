//! Past states: clones, and recall for sensors with a time offset.

pub(super) mod clones;
pub(super) mod delay;
pub(super) mod take;
