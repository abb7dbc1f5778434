//! Campaigns: many runs of a scenario, what its errors and sigmas say of each other, and how good it could ever be.
//!
//! ```text
//! Campaign ──jobs──▶ execute ──records in order──▶ Tables (Parquet)
//!                  │ bound, run                 Statistics ──▶ CampaignReport (verdict, tables, figures)
//! ```
//! A record is all that a job leaves. Shards write their records; merging reads them in order and goes on as if they had
//! just been made, so that it gives what one machine would have written.

mod bound;
mod campaign;
mod chi_square;
mod collect;
mod columns;
mod execute;
mod figures;
mod folder;
mod grid;
mod merge;
mod record;
mod report;
mod statistics;
mod sweep;
mod tables;
mod tape;
mod verdict;

pub use bound::bound;
pub use campaign::{Campaign, InitialErrors, Options, Point, Shard, variation};
pub use chi_square::{Band, band};
pub use columns::{BlockColumns, Columns, Component};
pub use execute::{JobCount, execute};
pub use figures::figures;
pub use folder::{Folder, Results};
pub use merge::{campaign_of, merge};
pub use record::{BoundRecord, Record, Row, RunRecord};
pub use report::{Anees, CampaignReport, Nis, PointReport, StateReport, WorstRun};
pub use statistics::{EpochStatistics, PointStatistics};
pub use verdict::{Finding, Verdict};

use navfuse_core::plugin::BuildError;

/// Why a campaign cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    /// The scenario does not fit.
    #[error(transparent)]
    Scenario(#[from] BuildError),
    /// A file cannot be read or written, or an option does not fit.
    #[error("{0}")]
    Other(String),
}

impl CampaignError {
    pub(crate) fn other(message: impl Into<String>) -> Self {
        Self::Other(message.into())
    }

    /// About a file.
    pub(crate) fn file(path: &std::path::Path, error: &dyn std::fmt::Display) -> Self {
        Self::Other(format!("{}: {error}", path.display()))
    }
}
