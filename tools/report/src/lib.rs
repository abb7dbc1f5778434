//! What a run was: gathered while it runs or read from its log, drawn, and written as one page that opens offline.
//!
//! A [`History`] is everything that is shown: series of a bounded length however long the run was, and counts of all.
//! [`Recorder`] gathers it from a run, [`read_log`] from a log, with the same result. [`plots`] draws it, [`page`] writes the
//! report, and [`pan_wu`] makes the figures of Pan & Wu (2016) from the histories of their two runs.

mod history;
mod log;
pub mod page;
pub mod pan_wu;
pub mod plots;
mod sink;
mod thin;

pub use history::{
    BlockHistory, Consistency, Envelope, History, Innovation, Row, SensorHistory, Travelled,
    Updates,
};
pub use log::read_log;
pub use sink::Recorder;
pub use thin::{Merge, ROWS, Thin};
