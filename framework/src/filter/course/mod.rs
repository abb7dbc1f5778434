//! A given trajectory as the point of linearisation.

pub(super) mod guide;
pub(super) mod guided;
