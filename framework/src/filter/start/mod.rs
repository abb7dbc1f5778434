//! The start: stages, initial values, search and alignment.

pub(super) mod alignment;
pub(super) mod begin;
pub(super) mod stage;
