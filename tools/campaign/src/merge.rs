//! Merging of shards into the files of the whole campaign.

use crate::CampaignError;
use crate::campaign::{Campaign, Job, Shard};
use crate::execute::JobCount;
use crate::folder::{
    BOUNDS, CAMPAIGN, Failure, Folder, Log, RUNS, Results, bound_names, run_names,
};
use crate::record::{BoundRecord, Record, Row, RunRecord};
use crate::tables::{Names, TableReader, checksum};
use navfuse_core::document::LONGEST;
use navfuse_core::input::read_text;
use navfuse_core::model::record::verdict::VerdictLevel;
use std::path::{Path, PathBuf};

fn read_log(folder: &Path) -> Result<Log, CampaignError> {
    let path = folder.join(CAMPAIGN);
    let text = read_text(&path, LONGEST).map_err(|e| {
        CampaignError::file_with(
            &path,
            e,
            "the folder holds no part of a campaign, or an incomplete one; make it with --shard \
             and --out",
        )
    })?;
    serde_json::from_str(&text).map_err(|e| {
        CampaignError::file_with(&path, e, "the file is not complete; run this part again")
    })
}

/// Reads the definition of the campaign in a folder, which may hold a part of it.
///
/// # Errors
/// Returns an error if the folder holds no campaign.
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
            return Err(CampaignError::content(
                path,
                "the folder holds a whole campaign; merge the parts made with --shard",
            ));
        };
        Ok(Self { shard, path, log })
    }

    fn error(&self, message: impl Into<String>) -> CampaignError {
        CampaignError::content(self.path, message)
    }

    /// Checks that the part is complete and that it belongs to the same campaign as the first part.
    fn check(&self, first: &Self) -> Result<(), CampaignError> {
        let (Shard { count, .. }, Log { done, asked, .. }) = (self.shard, &self.log);
        let other = |why: String| {
            self.error(format!("a part of another campaign than {}: {why}", first.path.display()))
        };
        if let Some(difference) = self.log.campaign.difference(&first.log.campaign) {
            return Err(other(difference));
        }
        if count != first.shard.count {
            return Err(other(format!("it has {count} parts instead of {}", first.shard.count)));
        }
        if done < asked {
            let shard = self.shard;
            return Err(self.error(format!(
                "part {shard} was interrupted after {done} of {asked} jobs; run it again \
                 with --resume"
            )));
        }
        Ok(())
    }

    /// Opens a table, whose bytes have to be those that the campaign wrote.
    fn table(&self, name: &str, names: &Names) -> Result<TableReader, CampaignError> {
        let path = self.path.join(name);
        let table = TableReader::open(&path, names)?;
        let found = checksum(&path).map_err(|e| CampaignError::file(&path, e))?;
        match self.log.checksums.get(name) {
            Some(written) if *written == found => Ok(table),
            written => Err(CampaignError::content(
                &path,
                format!(
                    "its bytes are not those that part {} wrote: its checksum is {found}, and \
                     {CAMPAIGN} has {}; copy the part again, or run it again",
                    self.shard,
                    written.map_or("none", String::as_str)
                ),
            )),
        }
    }

    /// Checks that a file holds the jobs of the part.
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
        Err(self.error(format!("{name} lacks jobs of part {}; run it again", self.shard)))
    }

    /// Level of the verdict of a run.
    fn judged(&self, point: usize, run: usize) -> VerdictLevel {
        let of_run = self.log.doubted.iter().find(|d| (d.point, d.run) == (point, run));
        of_run.map_or(VerdictLevel::Consistent, |d| d.level)
    }

    fn read_bounds(&self, folder: &mut Folder) -> Result<(), CampaignError> {
        let reader = self.table(BOUNDS, &bound_names(&self.log.campaign.columns))?;
        let mut found: Vec<Job> = Vec::new();
        reader.groups(|rows| {
            for k in 0..rows.count() {
                let (point, epoch) = (rows.whole[0][k] as usize, rows.whole[1][k]);
                let Some(statistics) = folder.points.get_mut(point) else {
                    return Err(self.error(format!("{BOUNDS}: there is no point {point}")));
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
        let reader = self.table(RUNS, &run_names(&campaign.columns))?;
        let mut failures = self.log.failures.clone();
        let mut found: Vec<Job> = Vec::new();
        let mut current: Option<RunRecord> = None;
        let mut give = |mut run: RunRecord, folder: &mut Folder| {
            if run.point >= campaign.points.len() || run.seed != campaign.seed_of(run.run) {
                return Err(self.error(format!(
                    "{RUNS}: the campaign has no run {} of point {}",
                    run.run, run.point
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
                    let judged = self.judged(point, run);
                    let next = RunRecord { point, run, seed, judged, ..RunRecord::default() };
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
        // runs that failed before their first epoch have no rows
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
                unusable: false,
                warned: Vec::new(),
                blamed: None,
                judged: self.judged(point, run),
            }))?;
        }
        Ok(())
    }
}

/// Merges the shards of a campaign into the files that one machine would have written.
///
/// # Errors
/// Returns an error if the parts are not all the complete parts of one campaign, or if a file
/// cannot be read or written.
pub fn merge(parts: &[PathBuf], out: &Path) -> Result<Results, CampaignError> {
    let mut parts = parts.iter().map(|path| Part::read(path)).collect::<Result<Vec<_>, _>>()?;
    parts.sort_by_key(|part| part.shard.index);
    let Some(first) = parts.first() else {
        return Err(CampaignError::Parts("no parts to merge: name their folders".into()));
    };
    for part in &parts {
        part.check(first)?;
        if std::fs::canonicalize(part.path).ok() == std::fs::canonicalize(out).ok() {
            return Err(part.error("a part cannot be the output, too; give another --out"));
        }
    }
    for (k, part) in parts.iter().enumerate() {
        let Shard { index, count } = part.shard;
        if index < k + 1 {
            return Err(part.error(format!("part {index}/{count} is given twice; name it once")));
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
    results.ok_or_else(|| CampaignError::Parts("the merged campaign is itself a part".into()))
}

fn missing(index: usize, count: usize) -> CampaignError {
    CampaignError::Parts(format!(
        "part {index}/{count} is missing: name its folder too, or run --shard {index}/{count}"
    ))
}

#[cfg(test)]
#[path = "merge_tests.rs"]
mod tests;
