//! Blocks that come and go.

pub(super) mod presence;
pub(super) mod transient;
