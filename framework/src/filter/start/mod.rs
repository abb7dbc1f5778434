//! The start: stages, initial values, truth, search and alignment.

mod alignment;
mod begin;
pub(super) mod beginning;
mod stage;
pub(super) mod truth;
