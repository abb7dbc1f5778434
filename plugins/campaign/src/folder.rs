//! What a campaign writes: its records, and once all are there what they say.

use crate::CampaignError;
use crate::columns::Columns;
use crate::execute::Done;
use crate::plan::{Plan, Shard};
use crate::record::{BoundRecord, Record, Row, RunRecord};
use crate::report::Report;
use crate::statistics::PointStatistics;
use crate::sweep;
use crate::tables::{Names, TableReader, TableWriter};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

const CAMPAIGN: &str = "campaign.json";
const RUNS: &str = "runs.parquet";
const BOUNDS: &str = "bounds.parquet";
const EPOCHS: &str = "epochs.parquet";
const REPORT: &str = "report.json";
/// What a campaign of any kind writes.
const ALL: [&str; 12] = [
    CAMPAIGN,
    RUNS,
    BOUNDS,
    EPOCHS,
    REPORT,
    sweep::CSV,
    sweep::PARQUET,
    "consistency.svg",
    "states.svg",
    "bound.svg",
    "sweep.svg",
    "campaign.rrd",
];

/// `campaign.json`: what was done.
#[derive(Debug, Serialize, Deserialize)]
struct Log {
    /// Which part of the campaign it is; null for the whole.
    shard: Option<String>,
    /// Jobs that were done.
    done: usize,
    /// Jobs that were asked for.
    asked: usize,
    failures: Vec<Failure>,
    plan: Plan,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Failure {
    point: usize,
    run: usize,
    seed: u64,
    reason: String,
}

/// What all records together say.
#[derive(Debug)]
pub struct Results {
    /// In numbers.
    pub report: Report,
    /// Over time, one entry a point.
    pub points: Vec<PointStatistics>,
    /// The files that were written.
    pub files: Vec<PathBuf>,
}

/// Takes records in order and writes them.
pub struct Folder {
    path: Option<PathBuf>,
    plan: Plan,
    shard: Option<Shard>,
    runs: Option<TableWriter>,
    points: Vec<PointStatistics>,
    failures: Vec<Failure>,
}

impl Folder {
    /// A folder to write into, or none to only sum up; a shard's records are written, but not summed up.
    ///
    /// # Errors
    /// When it cannot be written to.
    pub fn create(path: Option<&Path>, plan: &Plan, shard: Option<Shard>) -> Result<Self, CampaignError> {
        let mut runs = None;
        if let Some(path) = path {
            std::fs::create_dir_all(path).map_err(|e| CampaignError::file(path, &e))?;
            // nothing of an earlier campaign stays beside this one
            for name in ALL {
                std::fs::remove_file(path.join(name)).ok();
            }
            runs = Some(TableWriter::create(&path.join(RUNS), &run_names(&plan.columns))?);
        }
        let points = vec![PointStatistics::new(); plan.points.len()];
        Ok(Self { path: path.map(Into::into), plan: plan.clone(), shard, runs, points, failures: Vec::new() })
    }

    /// Takes a record.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn add(&mut self, record: Record) -> Result<(), CampaignError> {
        match record {
            Record::Bound(bound) => {
                let point = bound.point;
                self.points[point].bound = Some(bound);
            }
            Record::Run(run) => {
                self.points[run.point].add(&self.plan.columns, &run);
                if let Some(reason) = run.failure {
                    self.failures.push(Failure { point: run.point, run: run.run, seed: run.seed, reason });
                }
                if let Some(table) = &mut self.runs {
                    for row in &run.rows {
                        let whole = [run.point as i64, run.run as i64, run.seed as i64, row.epoch];
                        table.push(&[], &whole, std::iter::once(&row.time).chain(&row.values))?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Completes the files; a shard has no results.
    ///
    /// # Errors
    /// When they cannot be written.
    pub fn finish(mut self, done: Done) -> Result<Option<Results>, CampaignError> {
        let mut files = Vec::new();
        if let Some(table) = self.runs.take() {
            table.finish()?;
        }
        self.failures.sort_by_key(|f| (f.point, f.run));
        if let Some(path) = &self.path {
            self.write_bounds(&path.join(BOUNDS))?;
            let (plan, failures) = (self.plan.clone(), self.failures.clone());
            let shard = self.shard.map(|s| s.to_string());
            write_json(&path.join(CAMPAIGN), &Log { shard, done: done.done, asked: done.asked, failures, plan })?;
            files.extend([RUNS, BOUNDS, CAMPAIGN].map(|name| path.join(name)));
        }
        if self.shard.is_some() {
            return Ok(None);
        }
        let report = Report::new(&self.plan, &self.points);
        if let Some(path) = &self.path {
            self.write_epochs(&path.join(EPOCHS))?;
            write_json(&path.join(REPORT), &report)?;
            files.extend([EPOCHS, REPORT].map(|name| path.join(name)));
            if !self.plan.keys.is_empty() {
                files.extend(sweep::write(path, &report)?);
            }
        }
        Ok(Some(Results { report, points: self.points, files }))
    }

    fn write_bounds(&self, path: &Path) -> Result<(), CampaignError> {
        let mut table = TableWriter::create(path, &bound_names(&self.plan.columns))?;
        for bound in self.points.iter().filter_map(|p| p.bound.as_ref()) {
            for (epoch, time, filtered, smoothed) in &bound.rows {
                let pairs = filtered.iter().zip(smoothed).flat_map(|(f, s)| [f, s]);
                table.push(&[], &[bound.point as i64, *epoch], std::iter::once(time).chain(pairs))?;
            }
        }
        table.finish()
    }

    /// What the runs say together at each epoch.
    fn write_epochs(&self, path: &Path) -> Result<(), CampaignError> {
        let columns = &self.plan.columns;
        let mut real = vec!["time_s".to_owned()];
        for c in &columns.components {
            real.extend(["rmse", "mean_error", "sigma", "bound"].map(|what| format!("{}.{what}", c.name())));
        }
        real.push("anees".into());
        real.extend(columns.blocks.iter().map(|b| format!("{}.anees", b.name)));
        real.extend(
            columns.sensors.iter().flat_map(|s| ["mean_nis", "expected_nis"].map(|what| format!("{s}.{what}"))),
        );
        let names = Names { text: Vec::new(), whole: vec!["point".into(), "epoch".into(), "runs".into()], real };
        let mut table = TableWriter::create(path, &names)?;
        for (number, point) in self.points.iter().enumerate() {
            for (epoch, e) in point.epochs() {
                let bound = point.bound.as_ref().and_then(|b| b.at(epoch));
                let mut row = vec![e.time];
                for k in 0..columns.components.len() {
                    let values = [e.rmse(k), e.mean_error(k), e.sigma(k), bound.map(|b| b.2[k])];
                    row.extend(values.map(|v| v.unwrap_or(f64::NAN)));
                }
                row.extend((0..=columns.blocks.len()).map(|of| e.anees(of).map_or(f64::NAN, |a| a.0)));
                for sensor in 0..columns.sensors.len() {
                    let nis = e.nis(sensor);
                    row.extend([nis.nis / nis.used, nis.expected / nis.used]);
                }
                let runs = e.anees(0).map_or(0, |a| a.1) as i64;
                table.push(&[], &[number as i64, epoch, runs], &row)?;
            }
        }
        table.finish()
    }
}

fn run_names(columns: &Columns) -> Names {
    let mut real = vec!["time_s".to_owned()];
    real.extend(Row::names(columns));
    let whole = ["point", "run", "seed", "epoch"].map(String::from).to_vec();
    Names { text: Vec::new(), whole, real }
}

fn bound_names(columns: &Columns) -> Names {
    let mut real = vec!["time_s".to_owned()];
    real.extend(
        columns.components.iter().flat_map(|c| ["bound", "smoothed"].map(|what| format!("{}.{what}", c.name()))),
    );
    Names { text: Vec::new(), whole: ["point", "epoch"].map(String::from).to_vec(), real }
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<(), CampaignError> {
    let text = serde_json::to_string_pretty(value).map_err(|e| CampaignError::file(path, &e))?;
    std::fs::write(path, text + "\n").map_err(|e| CampaignError::file(path, &e))
}

fn read_log(folder: &Path) -> Result<Log, CampaignError> {
    let path = folder.join(CAMPAIGN);
    let text = std::fs::read_to_string(&path)
        .map_err(|e| CampaignError::file(&path, &format!("{e}: no part of a campaign, or one that was cut off")))?;
    serde_json::from_str(&text).map_err(|e| CampaignError::file(&path, &e))
}

/// The plan that a folder's campaign, or part of one, followed.
///
/// # Errors
/// When there is none.
pub fn plan_of(folder: &Path) -> Result<Plan, CampaignError> {
    Ok(read_log(folder)?.plan)
}

/// Joins the shards of a campaign to what one machine would have written.
///
/// # Errors
/// When they are not all the complete parts of one campaign, or a file cannot be read or written.
pub fn merge(parts: &[PathBuf], out: &Path) -> Result<Results, CampaignError> {
    let mut logs = Vec::new();
    for path in parts {
        let log = read_log(path)?;
        let Some(shard) = log.shard.as_ref().and_then(|s| s.parse::<Shard>().ok()) else {
            return Err(CampaignError::file(path, &"a whole campaign, not a part of one"));
        };
        logs.push((shard, path, log));
    }
    logs.sort_by_key(|(shard, ..)| shard.index);
    let Some((first, first_path, _)) = logs.first() else {
        return Err(CampaignError::other("no parts to merge: name their folders"));
    };
    for (shard, path, log) in &logs {
        if log.plan != logs[0].2.plan || shard.count != first.count {
            let message = format!("a part of another campaign than {}", first_path.display());
            return Err(CampaignError::file(path, &message));
        }
        if log.done < log.asked {
            let message =
                format!("part {shard} was interrupted after {} of {} jobs; run it again", log.done, log.asked);
            return Err(CampaignError::file(path, &message));
        }
        if std::fs::canonicalize(path).ok() == std::fs::canonicalize(out).ok() {
            return Err(CampaignError::file(path, &"a part cannot be the output too; give another --out"));
        }
    }
    for (k, (shard, path, _)) in logs.iter().enumerate() {
        if shard.index < k + 1 {
            return Err(CampaignError::file(path, &format!("part {shard} is there twice")));
        }
        if shard.index > k + 1 {
            return Err(missing(k + 1, shard.count));
        }
    }
    if logs.len() < first.count {
        return Err(missing(logs.len() + 1, first.count));
    }
    let plan = logs[0].2.plan.clone();
    let mut folder = Folder::create(Some(out), &plan, None)?;
    for (_, path, log) in &logs {
        read_bounds(path, &plan, &mut folder)?;
        read_runs(path, log, &mut folder)?;
    }
    let asked = plan.jobs(None).len();
    let results = folder.finish(Done { done: asked, asked })?;
    results.ok_or_else(|| CampaignError::other("the merged campaign is a part"))
}

fn missing(index: usize, count: usize) -> CampaignError {
    CampaignError::other(format!(
        "part {index}/{count} is missing: name its folder too, or run --shard {index}/{count}"
    ))
}

fn read_bounds(path: &Path, plan: &Plan, folder: &mut Folder) -> Result<(), CampaignError> {
    let reader = TableReader::open(&path.join(BOUNDS), &bound_names(&plan.columns))?;
    reader.groups(|rows| {
        for k in 0..rows.count() {
            let (point, epoch) = (rows.whole[0][k] as usize, rows.whole[1][k]);
            let Some(statistics) = folder.points.get_mut(point) else {
                return Err(CampaignError::file(path, &format!("{BOUNDS}: there is no point {point}")));
            };
            let pairs = rows.real[1..].as_chunks::<2>().0;
            let row = (
                epoch,
                rows.real[0][k],
                pairs.iter().map(|p| p[0][k]).collect(),
                pairs.iter().map(|p| p[1][k]).collect(),
            );
            statistics.bound.get_or_insert_with(|| BoundRecord { point, rows: Vec::new() }).rows.push(row);
        }
        Ok(())
    })
}

fn read_runs(path: &Path, log: &Log, folder: &mut Folder) -> Result<(), CampaignError> {
    let reader = TableReader::open(&path.join(RUNS), &run_names(&log.plan.columns))?;
    let mut failures = log.failures.clone();
    let mut current: Option<RunRecord> = None;
    let mut give = |mut run: RunRecord, folder: &mut Folder| {
        if run.point >= log.plan.points.len() {
            return Err(CampaignError::file(path, &format!("{RUNS}: there is no point {}", run.point)));
        }
        if let Some(k) = failures.iter().position(|f| (f.point, f.run) == (run.point, run.run)) {
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
    // those that failed before their first epoch
    for Failure { point, run, seed, reason } in failures {
        folder.add(Record::Run(RunRecord { point, run, seed, rows: Vec::new(), failure: Some(reason) }))?;
    }
    Ok(())
}
