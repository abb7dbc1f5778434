//! Blocks that come and go.

pub(super) mod seen;
pub(super) mod transient;
