//! CSV files: a source of recorded samples, and a sink that tells a run to spreadsheets and scripts.
//!
//! **Source.** A sensor NAME is read from `NAME.csv` of the directory, or as `[source.csv.files.NAME]` says. A heading is
//! a channel's name and its unit, such as `vel_x_mps`; `vel_x_cmps` is understood too. The time is in `time_s`, `time_ms`,
//! `time_us` or `time_ns`, and kept to the nanosecond. An empty cell is a channel that is missing; a row in which all of a
//! sensor's channels are is not a sample of it, so that several sensors can share a file. Lines that start with `#` are
//! comments.
//!
//! **Sink.** `estimate.csv` has a row an epoch, `innovations.csv` a row a measurement; see [`sink`].

mod cells;
pub mod config;
mod headings;
pub mod sink;
mod source;
mod tail;
mod time;

pub use config::Csv;
pub use sink::CsvSink;

use navfuse_core::plugin::{Plugin, Registry};

/// Registers the source type `csv` and the sink type `csv`.
#[derive(Clone, Copy, Debug)]
pub struct CsvPlugin;

impl Plugin for CsvPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.source::<Csv>();
        registry.sink::<CsvSink>();
    }

    navfuse_core::named_after_crate!();
}
