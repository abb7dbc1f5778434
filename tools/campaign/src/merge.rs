//! Shards joined to what one machine would have written.

use crate::CampaignError;
use crate::campaign::{Campaign, Job, Shard};
use crate::execute::JobCount;
use crate::folder::{
    BOUNDS, CAMPAIGN, Failure, Folder, Log, RUNS, Results, bound_names, run_names,
};
use crate::record::{BoundRecord, Record, Row, RunRecord};
use crate::tables::TableReader;
use std::path::{Path, PathBuf};

fn read_log(folder: &Path) -> Result<Log, CampaignError> {
    let path = folder.join(CAMPAIGN);
    let text = std::fs::read_to_string(&path).map_err(|e| {
        let message = format!(
            "{e}: no part of a campaign, or one that was cut off; make it with --shard and --out"
        );
        CampaignError::file(&path, &message)
    })?;
    serde_json::from_str(&text).map_err(|e| {
        CampaignError::file(&path, &format!("{e}: it is not complete; run this part again"))
    })
}

/// The plan that a folder's campaign, or part of one, followed.
///
/// # Errors
/// When there is none.
pub fn campaign_of(folder: &Path) -> Result<Campaign, CampaignError> {
    Ok(read_log(folder)?.campaign)
}

/// A part of a campaign.
struct Part<'a> {
    shard: Shard,
    path: &'a Path,
    log: Log,
}

impl<'a> Part<'a> {
    fn read(path: &'a Path) -> Result<Self, CampaignError> {
        let log = read_log(path)?;
        let Some(shard) = log.shard.as_ref().and_then(|s| s.parse::<Shard>().ok()) else {
            return Err(CampaignError::file(
                path,
                &"a whole campaign, not a part of one made with --shard",
            ));
        };
        Ok(Self { shard, path, log })
    }

    fn error(&self, message: &str) -> CampaignError {
        CampaignError::file(self.path, &message)
    }

    /// Whether it and the first part belong to one campaign, and it is complete.
    fn check(&self, first: &Self) -> Result<(), CampaignError> {
        let (Shard { count, .. }, Log { done, asked, .. }) = (self.shard, &self.log);
        let other = |why: String| {
            self.error(&format!("a part of another campaign than {}: {why}", first.path.display()))
        };
        if let Some(difference) = self.log.campaign.difference(&first.log.campaign) {
            return Err(other(difference));
        }
        if count != first.shard.count {
            return Err(other(format!("there are {count} parts and not {}", first.shard.count)));
        }
        if done < asked {
            let shard = self.shard;
            return Err(self.error(&format!(
                "part {shard} was interrupted after {done} of {asked} jobs; run it again"
            )));
        }
        Ok(())
    }

    /// A file of it has the jobs that the part should have.
    fn check_jobs(
        &self,
        name: &str,
        found: &[Job],
        run: impl Fn(&Job) -> bool,
    ) -> Result<(), CampaignError> {
        let asked: Vec<Job> =
            self.log.campaign.jobs(Some(self.shard)).into_iter().filter(run).collect();
        if found == asked {
            return Ok(());
        }
        Err(self
            .error(&format!("{name} does not hold what part {} should; run it again", self.shard)))
    }

    fn read_bounds(&self, folder: &mut Folder) -> Result<(), CampaignError> {
        let reader =
            TableReader::open(&self.path.join(BOUNDS), &bound_names(&self.log.campaign.columns))?;
        let mut found: Vec<Job> = Vec::new();
        reader.groups(|rows| {
            for k in 0..rows.count() {
                let (point, epoch) = (rows.whole[0][k] as usize, rows.whole[1][k]);
                let Some(statistics) = folder.points.get_mut(point) else {
                    return Err(self.error(&format!("{BOUNDS}: there is no point {point}")));
                };
                if found.last().is_none_or(|job| job.point != point) {
                    found.push(Job { point, run: 0 });
                }
                let pairs = rows.real[1..].as_chunks::<2>().0;
                let row = (
                    epoch,
                    rows.real[0][k],
                    pairs.iter().map(|p| p[0][k]).collect(),
                    pairs.iter().map(|p| p[1][k]).collect(),
                );
                statistics
                    .bound
                    .get_or_insert_with(|| BoundRecord { point, rows: Vec::new() })
                    .rows
                    .push(row);
            }
            Ok(())
        })?;
        self.check_jobs(BOUNDS, &found, |job| job.run == 0)
    }

    fn read_runs(&self, folder: &mut Folder) -> Result<(), CampaignError> {
        let campaign = &self.log.campaign;
        let reader = TableReader::open(&self.path.join(RUNS), &run_names(&campaign.columns))?;
        let mut failures = self.log.failures.clone();
        let mut found: Vec<Job> = Vec::new();
        let mut current: Option<RunRecord> = None;
        let mut give = |mut run: RunRecord, folder: &mut Folder| {
            if run.point >= campaign.points.len() || run.seed != campaign.seed_of(run.run) {
                return Err(self.error(&format!(
                    "{RUNS}: no run of this campaign: point {}, run {}",
                    run.point, run.run
                )));
            }
            found.push(Job { point: run.point, run: run.run });
            if let Some(k) = failures.iter().position(|f| (f.point, f.run) == (run.point, run.run))
            {
                run.failure = Some(failures.swap_remove(k).reason);
            }
            folder.add(Record::Run(run))
        };
        reader.groups(|rows| {
            for k in 0..rows.count() {
                let [point, run, seed, epoch] = [0, 1, 2, 3].map(|c| rows.whole[c][k]);
                let (point, run, seed) = (point as usize, run as usize, seed as u64);
                if current.as_ref().is_none_or(|c| (c.point, c.run) != (point, run)) {
                    let next = RunRecord { point, run, seed, rows: Vec::new(), failure: None };
                    if let Some(before) = current.replace(next) {
                        give(before, folder)?;
                    }
                }
                if let Some(current) = &mut current {
                    let values = rows.real[1..].iter().map(|c| c[k]).collect();
                    current.rows.push(Row { epoch, time: rows.real[0][k], values });
                }
            }
            Ok(())
        })?;
        if let Some(last) = current {
            give(last, folder)?;
        }
        // those that failed before their first epoch have no rows
        let absent: Vec<(usize, usize)> = failures.iter().map(|f| (f.point, f.run)).collect();
        self.check_jobs(RUNS, &found, |job| {
            job.run > 0 && !absent.contains(&(job.point, job.run))
        })?;
        for Failure { point, run, seed, reason } in failures {
            folder.add(Record::Run(RunRecord {
                point,
                run,
                seed,
                rows: Vec::new(),
                failure: Some(reason),
            }))?;
        }
        Ok(())
    }
}

/// Joins the shards of a campaign to what one machine would have written.
///
/// # Errors
/// When they are not all the complete parts of one campaign, or a file cannot be read or written.
pub fn merge(parts: &[PathBuf], out: &Path) -> Result<Results, CampaignError> {
    let mut parts = parts.iter().map(|path| Part::read(path)).collect::<Result<Vec<_>, _>>()?;
    parts.sort_by_key(|part| part.shard.index);
    let Some(first) = parts.first() else {
        return Err(CampaignError::other("no parts to merge: name their folders"));
    };
    for part in &parts {
        part.check(first)?;
        if std::fs::canonicalize(part.path).ok() == std::fs::canonicalize(out).ok() {
            return Err(part.error("a part cannot be the output too; give another --out"));
        }
    }
    for (k, part) in parts.iter().enumerate() {
        let Shard { index, count } = part.shard;
        if index < k + 1 {
            return Err(part.error(&format!("part {index}/{count} is there twice; name it once")));
        }
        if index > k + 1 {
            return Err(missing(k + 1, count));
        }
    }
    if parts.len() < first.shard.count {
        return Err(missing(parts.len() + 1, first.shard.count));
    }
    let campaign = first.log.campaign.clone();
    let mut folder = Folder::create(Some(out), &campaign, None)?;
    for part in &parts {
        part.read_bounds(&mut folder)?;
        if campaign.runs > 0 {
            part.read_runs(&mut folder)?;
        }
    }
    let asked = campaign.jobs(None).len();
    let results = folder.finish(JobCount { done: asked, asked })?;
    results.ok_or_else(|| CampaignError::other("the merged campaign is a part"))
}

fn missing(index: usize, count: usize) -> CampaignError {
    CampaignError::other(format!(
        "part {index}/{count} is missing: name its folder too, or run --shard {index}/{count}"
    ))
}

#[cfg(test)]
#[path = "merge_tests.rs"]
mod tests;
