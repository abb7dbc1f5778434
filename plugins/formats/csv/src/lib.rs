//! CSV files: a source of recorded samples, and a sink for spreadsheets and scripts.
//!
//! **Source.** The source reads the samples of a sensor NAME from `NAME.csv` in the directory, or
//! from the file that `[source.csv.files.NAME]` names. A heading consists of the name of a channel
//! and its unit, such as `vel_x_mps` or `vel_x_cmps`. The time is in `time_s`, `time_ms`, `time_us`
//! or `time_ns`; it is exact to the nanosecond. An empty cell is a missing channel. A row in which
//! all channels of a sensor are missing is not a sample of that sensor, so that several sensors can
//! share a file. Lines that start with `#` are comments. Dates, weeks of GPS, other separators,
//! decimal commas, positions on a map, files without headings, JSON, files of UTF-16, and files that gzip or zstd packed are
//! read, too: see [`config::FileConfig`].
//!
//! **Sink.** `estimate.csv` has one row for each epoch, `innovations.csv` one for each measurement;
//! see [`sink`].

mod beside;
mod bounded;
mod cdl;
mod cells;
mod columns;
pub mod config;
mod coordinates;
mod counter;
mod dates;
mod delimiter;
mod elements;
mod folder;
mod headings;
mod html;
mod join;
mod keyed;
mod labelled;
mod line;
mod lines;
mod map;
mod matrices;
mod number;
mod object;
mod paths;
mod pieces;
mod pivot;
mod protobuf;
mod records;
mod sequence;
mod series;
pub mod sink;
mod source;
mod spread;
mod stamp;
mod stamps;
mod stream;
mod suffixes;
mod table;
mod tail;
mod text;
mod time;
mod transposed;
mod turned;
mod unused;
mod utf16;
mod vectors;
mod whole;
mod wrapped;
mod xml;
mod yaml;

pub use beside::has_one_value;
pub use bounded::{beginning, beginning_of_files, records_of_all_forms};
pub use columns::{Axes, EstimateColumns, ending};
pub use config::Csv;
pub use coordinates::coordinates;
pub use dates::date;
pub use elements::element;
pub use folder::is_folder;
pub use lines::cut;
pub use number::{is_absent, number};
pub use records::records;
pub use sink::CsvSink;
pub use stamps::{as_cell, stamp};
pub use suffixes::with_unit;
pub use table::Table;
pub use text::{text, ungrouped};
pub use vectors::vector;

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
