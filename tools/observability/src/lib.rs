//! What a run determines of each state, when it became so, and what is missing: for any composition.
//!
//! [`Tracker`] listens to a run and needs nothing but what every filter tells a sink: `Phi`, `H`, `S` and `K`. [`ObservabilityReport`] says
//! it in words and numbers.

mod component;
mod direction;
mod panel;
pub mod plan;
mod reference;
mod remarks;
mod report;
mod start;
mod theorem;
mod tracker;
pub mod words;

pub use component::{Component, Verdict};
pub use direction::Direction;
pub use panel::markdown;
pub use report::{DirectionReport, History, ObservabilityReport, SensorReport, StateReport};
pub use theorem::{DirectionsReport, RemarkReport, SegmentRow, SegmentView, SphereReport};
pub use tracker::{ComponentStatus, DETERMINED, IN_PART, LOST, SensorShare, Tracker, TrackerSink};
