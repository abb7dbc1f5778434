//! The pages of the runs to look at of a campaign or a sweep: each is run once more.

use crate::error::Result;
use crate::execution::history::{observability, recorded, tracker};
use crate::output;
use crate::output::progress::Bar;
use navfuse_campaign::{Campaign, Job, Results};
use navfuse_core::document::Document;
use navfuse_core::plugin::Registry;
use navfuse_report::campaign::to_look_at;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// Number of runs of a campaign for each page: a page costs a run.
const RUNS: usize = 10;
/// Greatest number of pages.
const MOST: usize = 5;

/// What repeats a run of a campaign.
#[derive(Clone, Copy)]
pub struct Again<'a> {
    pub registry: &'a Registry,
    pub document: &'a Document,
    pub threads: usize,
    pub stop: &'a AtomicBool,
}

impl Again<'_> {
    /// Writes the pages of the first runs to look at into a folder, and returns their files: one for each
    /// ten runs of a campaign or of a sweep. None where it was interrupted.
    pub fn pages(self, campaign: &Campaign, results: &Results, out: &Path) -> Result<Vec<PathBuf>> {
        let most = MOST.min(campaign.runs * results.points.len() / RUNS);
        let mut jobs = to_look_at(results);
        jobs.truncate(most);
        let mut pages = Vec::new();
        for jobs in jobs.chunks(self.threads) {
            let some = std::thread::scope(|scope| {
                let begin = |job: &Job| {
                    let job = *job;
                    scope.spawn(move || self.page(campaign, job))
                };
                let threads: Vec<_> = jobs.iter().map(begin).collect();
                let ended = threads.into_iter().map(|thread| {
                    thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
                });
                ended.collect::<Result<Vec<String>>>()
            })?;
            if self.stop.load(Ordering::Relaxed) {
                break;
            }
            for page in some {
                let path = out.join(format!("worst-{}.html", pages.len() + 1));
                output::write(&path, &page)?;
                pages.push(path);
            }
        }
        Ok(pages)
    }

    /// The page of a run.
    fn page(self, campaign: &Campaign, job: Job) -> Result<String> {
        let scenario = campaign.scenario(self.registry, self.document, job)?;
        let bar = Bar::new(false);
        let (mut history, mut finished) = recorded(&scenario, vec![tracker()], self.stop, &bar)?;
        let observed = observability(&history.name, &mut finished);
        let at: Vec<String> =
            campaign.settings(job.point).iter().map(|s| format!("{s}, ")).collect();
        history.name = format!("{}, {}run {}", history.name, at.concat(), job.run);
        Ok(navfuse_report::page::report(&history, observed.as_ref())?)
    }
}
