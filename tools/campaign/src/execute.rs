//! Execution of the jobs on all cores, with the records in the order of the jobs.

use crate::CampaignError;
use crate::bound::bound;
use crate::campaign::{Campaign, Job, Shard};
use crate::collect;
use crate::record::Record;
use navfuse_core::document::Document;
use navfuse_core::plugin::{Registry, Shared};
use navfuse_core::run::scenario::Scenario;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError, mpsc};

/// Number of jobs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JobCount {
    /// Completed jobs.
    pub done: usize,
    /// Requested jobs.
    pub asked: usize,
}

impl JobCount {
    /// Returns `true` if the campaign was interrupted.
    pub fn interrupted(&self) -> bool {
        self.done < self.asked
    }
}

/// The jobs to execute, and the number of threads for them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Extent {
    /// A part of the campaign; all of it without one.
    pub shard: Option<Shard>,
    /// Number of threads; at least one is used.
    pub threads: usize,
    /// Number of jobs at the beginning that are done already.
    pub done: usize,
}

/// Executes jobs of a campaign. It passes each record to `each` in the order of the jobs, for any
/// number of threads, and reports the number of completed jobs to `progress`. If `stop` is set, it
/// passes the records that are complete by then.
///
/// # Errors
/// Returns an error if a point does not compose, a bound fails, or `each` fails. A run that fails
/// is not an error: its record has the reason.
pub fn execute(
    campaign: &Campaign,
    registry: &Registry,
    document: &Document,
    Extent { shard, threads, done }: Extent,
    stop: &AtomicBool,
    mut progress: impl FnMut(JobCount),
    mut each: impl FnMut(Record) -> Result<(), CampaignError>,
) -> Result<JobCount, CampaignError> {
    let mut jobs = campaign.jobs(shard);
    let mut count = JobCount { done, asked: jobs.len() };
    let jobs = jobs.split_off(done.min(count.asked));
    let threads = threads.clamp(1, jobs.len().max(1));
    let columns = Arc::new(campaign.columns.clone());
    let failed = AtomicBool::new(false);
    let over = || stop.load(Ordering::Relaxed) || failed.load(Ordering::Relaxed);
    let next = AtomicUsize::new(0);
    let point = PointValues::default();
    progress(count);
    std::thread::scope(|scope| {
        // the channel is bounded: a slow reader makes the workers wait, and memory stays small
        let (sender, receiver) = mpsc::sync_channel(2 * threads);
        for _ in 0..threads {
            let (sender, jobs, next, columns) = (sender.clone(), &jobs, &next, &columns);
            let point = &point;
            scope.spawn(move || {
                while !over() {
                    let at = next.fetch_add(1, Ordering::Relaxed);
                    let Some(&job) = jobs.get(at) else { break };
                    let scenario = campaign
                        .scenario(registry, document, job)
                        .map(|scenario| scenario.sharing(&point.of(job.point)));
                    let record = scenario
                        .and_then(|scenario| do_job(&scenario, columns, job, campaign.every, stop));
                    if sender.send((at, record)).is_err() {
                        break;
                    }
                }
            });
        }
        drop(sender);
        let mut waiting = BTreeMap::new();
        let mut due = 0;
        let mut give = |record| -> Result<(), CampaignError> {
            let done = each(record);
            if done.is_err() {
                failed.store(true, Ordering::Relaxed);
            }
            done
        };
        let mut result = Ok(());
        for (at, record) in receiver {
            let record = match record {
                Ok(record) => record,
                Err(error) => {
                    failed.store(true, Ordering::Relaxed);
                    result = result.and(Err(error));
                    None
                }
            };
            waiting.insert(at, record);
            while let Some(record) = waiting.remove(&due) {
                due += 1;
                if let Some(record) = record.filter(|_| result.is_ok()) {
                    count.done += 1;
                    progress(count);
                    result = give(record);
                }
            }
        }
        // after an interruption, records may remain behind a job that did not complete
        for record in waiting.into_values().flatten() {
            if result.is_ok() {
                count.done += 1;
                result = give(record);
            }
        }
        result.map(|()| count)
    })
}

/// Values that the runs of the present point share. Those of a point before it are freed with its
/// last run.
#[derive(Default)]
struct PointValues(Mutex<(usize, Shared)>);

impl PointValues {
    fn of(&self, point: usize) -> Shared {
        let mut present = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if present.0 != point {
            *present = (point, Shared::default());
        }
        present.1.clone()
    }
}

/// Executes one job; `None` if it was stopped.
fn do_job(
    scenario: &Scenario<'_>,
    columns: &Arc<crate::Columns>,
    job: Job,
    every: i64,
    stop: &AtomicBool,
) -> Result<Option<Record>, CampaignError> {
    if job.run == 0 {
        return Ok(bound(scenario.assemble_at_truth()?, columns, job.point, every, stop)?
            .map(Record::Bound));
    }
    let assembly = scenario.assemble(None)?;
    Ok(collect::run(assembly, columns, job, every, stop).map(Record::Run))
}
