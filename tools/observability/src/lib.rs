//! Observability of a run: which states the measurements determined, since when, and what is
//! missing.
//!
//! [`Tracker`] works for any composition. It needs only `Phi`, `H`, `S` and `K`, which every filter
//! passes to its sinks. [`ObservabilityReport`] presents the result in words and numbers.

mod component;
mod direction;
mod information;
mod initial_error;
mod panel;
pub mod plan;
mod reference;
mod remarks;
mod report;
mod share;
mod status;
mod theorem;
mod tracker;
pub mod words;

pub use component::{Component, Determination};
pub use direction::Direction;
pub use information::{Information, ObservabilityPlugin};
pub use panel::markdown;
pub use report::{DirectionReport, ObservabilityReport, SensorReport, SigmaHistory, StateReport};
pub use share::{Shares, StateShares};
pub use status::{ComponentStatus, DETERMINED, IN_PART, LOST};
pub use theorem::{DirectionsReport, RemarkReport, SegmentRow, SegmentView, SphereReport};
pub use tracker::{SensorShare, Tracker, TrackerSink};
