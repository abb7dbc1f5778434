//! Monte Carlo campaigns: many runs of a scenario, the consistency of the reported uncertainty with
//! the errors, and the Cramer-Rao bound.
//!
//! ```text
//! Campaign ──jobs──▶ execute ──records in order──▶ Tables (Parquet)
//!                      │ bound, run              Statistics ──▶ CampaignReport
//! ```
//! A [`Record`] is the complete result of one job. Shards write their records to files. [`merge`]
//! reads these records in order and continues as if they had just been computed, so the merged
//! files equal the files of a campaign on one machine.

mod bound;
mod campaign;
mod collect;
mod columns;
mod error;
mod execute;
mod figures;
mod folder;
mod grid;
mod in_memory;
mod journal;
mod merge;
mod outcome;
mod record;
mod report;
mod statistics;
mod sweep;
mod tables;
mod tape;
mod verdict;
pub mod words;

pub use bound::bound;
pub use campaign::{Campaign, InitialErrors, Job, Options, Point, Shard, variation};
pub use columns::{BlockColumns, Columns, Component};
pub use error::{CampaignError, ShardError};
pub use execute::{Extent, JobCount, execute};
pub use figures::figures;
pub use folder::{Folder, Results, is_complete};
pub use in_memory::report;
pub use merge::{campaign_of, merge};
pub use navfuse_core::model::chi_square::{Band, band};
pub use outcome::{LIMIT, Outcomes, WorstState};
pub use record::{BoundRecord, Record, Row, RunRecord};
pub use report::{Anees, CampaignReport, Nis, PointReport, StateReport, WorstRun};
pub use statistics::{EpochStatistics, Judged, PointStatistics};
pub use verdict::{Finding, PointVerdict};
