//! What a run determines of each state, when it became so, and what is missing: for any composition.
//!
//! [`Tracker`] listens to a run and needs nothing but what every filter tells a sink: `Phi`, `H`, `S` and `K`. [`Report`] says
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
pub use report::{DirectionReport, History, Report, SensorReport, StateReport};
pub use theorem::{DirectionsReport, RemarkReport, SegmentRow, SegmentView, SphereReport};
pub use tracker::{DETERMINED, IN_PART, LOST, Now, SensorShare, Tracker, Watch};
