//! Campaigns without files.

use crate::campaign::{Campaign, Options};
use crate::error::CampaignError;
use crate::execute::{Extent, execute};
use crate::folder::Folder;
use crate::report::CampaignReport;
use navfuse_core::document::Document;
use navfuse_core::plugin::Registry;
use std::num::NonZeroUsize;
use std::sync::atomic::AtomicBool;

/// Runs the campaign of a scenario on all cores and reports on it, without files: for the tests of
/// a sensor.
///
/// # Errors
/// Returns an error if the options do not fit the scenario, the scenario does not compose or its
/// bound fails.
pub fn report(
    registry: &Registry,
    document: &Document,
    options: &Options,
) -> Result<CampaignReport, CampaignError> {
    let campaign = Campaign::new(registry, document, options)?;
    let mut folder = Folder::create(None, &campaign, None)?;
    let threads = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let (stop, extent) = (AtomicBool::new(false), Extent { threads, ..Extent::default() });
    let done =
        execute(&campaign, registry, document, extent, &stop, |_| {}, |record| folder.add(record))?;
    let results = folder.finish(done)?;
    results.map(|r| r.report).ok_or(CampaignError::Unsuitable("a shard has no report of its own"))
}
