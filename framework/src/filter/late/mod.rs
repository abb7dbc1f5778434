//! Late samples.

pub(super) mod timeline;
