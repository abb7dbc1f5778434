//! Reports of runs: collected during a run or from its log, plotted, and written as one page that
//! opens offline.
//!
//! A [`RunHistory`] holds all content of a report: series of a bounded length, however long the run,
//! and counts over all samples. [`Recorder`] collects it from a run and [`read_log`] from a log,
//! with the same result. [`plots`] plots it, [`page`] writes the report, [`compare`] compares several
//! runs, and [`pan_wu`] makes the figures of Pan & Wu (2016) from the histories of their two runs.

mod bar;
pub mod calibration;
pub mod campaign;
pub mod compare;
pub mod diagnosis;
mod health;
mod histogram;
mod history;
mod innovations;
mod log;
pub mod observability;
pub mod page;
pub mod pan_wu;
pub mod plots;
pub mod quality;
mod residuals;
mod results;
mod row;
mod sensors;
mod sink;

pub use bar::Bar;
pub use health::{Span, spans};
pub use history::{BlockHistory, RunHistory, Travelled};
pub use log::read_log;
pub use navfuse_core::units::thin::{Merge, ROWS, Thin};
pub use residuals::Residuals;
pub use results::Standard;
pub use row::Row;
pub use sensors::{Consistency, Envelope, Innovation, SensorHistory, Updates};
pub use sink::Recorder;
