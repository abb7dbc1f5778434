//! Output folder of a campaign: the records, and the results once all records are there.

use crate::CampaignError;
use crate::campaign::{Campaign, Shard};
use crate::columns::Columns;
use crate::execute::JobCount;
use crate::journal::{JOURNAL, Journal};
use crate::record::{Record, Row, RunRecord};
use crate::report::CampaignReport;
use crate::statistics::PointStatistics;
use crate::sweep;
use crate::tables::{Names, TableWriter};
use navfuse_core::document::LONGEST;
use navfuse_core::files::{FolderError, FolderLock, keep_earlier, write_whole};
use navfuse_core::input::read_text;
use navfuse_core::model::record::verdict::VerdictLevel;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

pub const CAMPAIGN: &str = "campaign.json";
pub const RUNS: &str = "runs.parquet";
pub const BOUNDS: &str = "bounds.parquet";
const EPOCHS: &str = "epochs.parquet";
const REPORT: &str = "report.json";
/// Names of all files that a campaign of any kind writes.
const ALL: [&str; 18] = [
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
    "campaign.html",
    "worst-1.html",
    "worst-2.html",
    "worst-3.html",
    "worst-4.html",
    "worst-5.html",
];

/// Content of `campaign.json`.
#[derive(Debug, Serialize, Deserialize)]
pub struct Log {
    /// Part of the campaign, as `1/7`; null for the whole campaign.
    pub shard: Option<String>,
    /// Completed jobs.
    pub done: usize,
    /// Requested jobs.
    pub asked: usize,
    pub failures: Vec<Failure>,
    /// CRC-32 of the tables from which a campaign is merged.
    pub checksums: BTreeMap<String, String>,
    /// Runs whose own verdict is not "consistent".
    #[serde(default)]
    pub doubted: Vec<Doubted>,
    #[serde(rename = "plan")]
    pub campaign: Campaign,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Failure {
    pub point: usize,
    pub run: usize,
    pub seed: u64,
    pub reason: String,
}

/// Run whose own verdict is not "consistent".
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Doubted {
    pub point: usize,
    pub run: usize,
    pub level: VerdictLevel,
}

/// Results of a campaign.
#[derive(Debug)]
pub struct Results {
    /// Numbers at the end of the runs.
    pub report: CampaignReport,
    /// Statistics over time, one entry per point.
    pub points: Vec<PointStatistics>,
    /// Written files.
    pub files: Vec<PathBuf>,
    /// Keeps other programs out of the folder as long as files are added to it.
    _lock: Option<FolderLock>,
}

/// Writes the records of a campaign, which arrive in order.
pub struct Folder {
    path: Option<PathBuf>,
    campaign: Campaign,
    shard: Option<Shard>,
    runs: Option<TableWriter>,
    journal: Option<Journal>,
    lock: Option<FolderLock>,
    pub(crate) points: Vec<PointStatistics>,
    failures: Vec<Failure>,
    doubted: Vec<Doubted>,
}

impl Folder {
    /// Creates a folder to write into; without a path, the records are only summed up. The records
    /// of a shard are written, but not summed up. The files of an earlier campaign are moved into
    /// the folder `earlier`.
    ///
    /// # Errors
    /// Returns an error if the folder or a file cannot be written.
    pub fn create(
        path: Option<&Path>,
        campaign: &Campaign,
        shard: Option<Shard>,
    ) -> Result<Self, CampaignError> {
        let lock = path.map(FolderLock::take).transpose()?;
        Self::begin(path, campaign, shard, lock, &[JOURNAL])
    }

    /// Creates a folder as [`Folder::create`] does, with a journal of the records, from which
    /// [`Folder::resume`] continues.
    ///
    /// # Errors
    /// As [`Folder::create`].
    pub fn with_journal(
        path: Option<&Path>,
        campaign: &Campaign,
        shard: Option<Shard>,
    ) -> Result<Self, CampaignError> {
        let mut folder = Self::create(path, campaign, shard)?;
        folder.journal = path.map(|path| Journal::create(path, campaign, shard)).transpose()?;
        Ok(folder)
    }

    /// Resumes the campaign in a folder after its last complete record, and returns the number of
    /// its records. Without a journal it begins the campaign.
    ///
    /// # Errors
    /// As [`Folder::create`], and if the journal is of another campaign.
    pub fn resume(
        path: &Path,
        campaign: &Campaign,
        shard: Option<Shard>,
    ) -> Result<(Self, usize), CampaignError> {
        if !path.join(JOURNAL).exists() {
            return Ok((Self::with_journal(Some(path), campaign, shard)?, 0));
        }
        let lock = FolderLock::take(path)?;
        let mut folder = Self::begin(Some(path), campaign, shard, Some(lock), &[])?;
        match Journal::resume(path, campaign, shard, |record| folder.add(record))? {
            Some((journal, count)) => {
                folder.journal = Some(journal);
                Ok((folder, count))
            }
            // it was killed before the first record
            None => {
                folder.journal = Some(Journal::create(path, campaign, shard)?);
                Ok((folder, 0))
            }
        }
    }

    /// Moves the files of an earlier campaign, and `more`, away, so that no old result stays beside
    /// the new ones, and begins the table of runs.
    fn begin(
        path: Option<&Path>,
        campaign: &Campaign,
        shard: Option<Shard>,
        lock: Option<FolderLock>,
        more: &[&str],
    ) -> Result<Self, CampaignError> {
        let mut runs = None;
        if let Some(path) = path {
            keep_earlier(path, ALL.iter().chain(more))
                .map_err(|source| FolderError::Keep { path: path.to_owned(), source })?;
            if campaign.runs > 0 {
                runs = Some(TableWriter::create(&path.join(RUNS), &run_names(&campaign.columns))?);
            }
        }
        let points = vec![PointStatistics::new(campaign.from); campaign.points.len()];
        Ok(Self {
            path: path.map(Into::into),
            campaign: campaign.clone(),
            shard,
            runs,
            journal: None,
            lock,
            points,
            failures: Vec::new(),
            doubted: Vec::new(),
        })
    }

    /// Adds a record.
    ///
    /// # Errors
    /// Returns an error if the record cannot be written.
    pub fn add(&mut self, record: Record) -> Result<(), CampaignError> {
        if let Some(journal) = &mut self.journal {
            journal.add(&record)?;
        }
        match record {
            Record::Bound(bound) => {
                let point = bound.point;
                self.points[point].bound = Some(bound);
            }
            Record::Run(run) => {
                self.points[run.point].add(&self.campaign.columns, &run);
                if run.judged != VerdictLevel::Consistent {
                    let RunRecord { point, run, judged: level, .. } = run;
                    self.doubted.push(Doubted { point, run, level });
                }
                if let Some(reason) = run.failure {
                    self.failures.push(Failure {
                        point: run.point,
                        run: run.run,
                        seed: run.seed,
                        reason,
                    });
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

    /// Completes the files. A shard has no results.
    ///
    /// # Errors
    /// Returns an error if a file cannot be written.
    pub fn finish(mut self, done: JobCount) -> Result<Option<Results>, CampaignError> {
        let mut files = Vec::new();
        let mut checksums = BTreeMap::new();
        if let (Some(table), Some(path)) = (self.runs.take(), &self.path) {
            checksums.insert(RUNS.to_owned(), table.finish()?);
            files.push(path.join(RUNS));
        }
        self.failures.sort_by_key(|f| (f.point, f.run));
        self.doubted.sort_by_key(|d| (d.point, d.run));
        if let Some(path) = &self.path {
            checksums.insert(BOUNDS.to_owned(), self.write_bounds(&path.join(BOUNDS))?);
            let (campaign, failures) = (self.campaign.clone(), self.failures.clone());
            let doubted = self.doubted.clone();
            let shard = self.shard.map(|s| s.to_string());
            let JobCount { done, asked } = done;
            let log = Log { shard, done, asked, failures, doubted, checksums, campaign };
            write_json(&path.join(CAMPAIGN), &log)?;
            files.extend([BOUNDS, CAMPAIGN].map(|name| path.join(name)));
        }
        let journal = self.journal.take().filter(|_| !done.interrupted());
        if self.shard.is_some() {
            journal.map_or(Ok(()), Journal::remove)?;
            return Ok(None);
        }
        let report = CampaignReport::new(&self.campaign, &self.points);
        if let Some(path) = &self.path {
            if self.campaign.runs > 0 {
                self.write_epochs(&path.join(EPOCHS))?;
                files.push(path.join(EPOCHS));
            }
            write_json(&path.join(REPORT), &report)?;
            files.push(path.join(REPORT));
            if !self.campaign.keys.is_empty() {
                files.extend(sweep::write(path, &report)?);
            }
        }
        journal.map_or(Ok(()), Journal::remove)?;
        Ok(Some(Results { report, points: self.points, files, _lock: self.lock }))
    }

    fn write_bounds(&self, path: &Path) -> Result<String, CampaignError> {
        let mut table = TableWriter::create(path, &bound_names(&self.campaign.columns))?;
        for bound in self.points.iter().filter_map(|p| p.bound.as_ref()) {
            for (epoch, time, filtered, smoothed) in &bound.rows {
                let pairs = filtered.iter().zip(smoothed).flat_map(|(f, s)| [f, s]);
                table.push(
                    &[],
                    &[bound.point as i64, *epoch],
                    std::iter::once(time).chain(pairs),
                )?;
            }
        }
        table.finish()
    }

    /// Writes the statistics over all runs at each epoch.
    fn write_epochs(&self, path: &Path) -> Result<(), CampaignError> {
        let columns = &self.campaign.columns;
        let mut real = vec!["time_s".to_owned()];
        for c in &columns.components {
            real.extend(
                ["rmse", "mean_error", "sigma", "bound"].map(|what| format!("{}.{what}", c.name())),
            );
        }
        real.push("anees".into());
        real.extend(columns.blocks.iter().map(|b| format!("{}.anees", b.name)));
        real.extend(
            columns
                .sensors
                .iter()
                .flat_map(|s| ["mean_nis", "expected_nis"].map(|what| format!("{s}.{what}"))),
        );
        let names = Names {
            text: Vec::new(),
            whole: vec!["point".into(), "epoch".into(), "runs".into()],
            real,
        };
        let mut table = TableWriter::create(path, &names)?;
        for (number, point) in self.points.iter().enumerate() {
            for (epoch, e) in point.epochs() {
                let bound = point.bound.as_ref().and_then(|b| b.at(epoch));
                let mut row = vec![e.time];
                for k in 0..columns.components.len() {
                    let values = [e.rmse(k), e.mean_error(k), e.sigma(k), bound.map(|b| b.2[k])];
                    row.extend(values.map(|v| v.unwrap_or(f64::NAN)));
                }
                row.extend(
                    (0..=columns.blocks.len()).map(|of| e.anees(of).map_or(f64::NAN, |a| a.0)),
                );
                for sensor in 0..columns.sensors.len() {
                    let nis = e.nis(sensor);
                    row.extend([nis.nis / nis.used, nis.expected / nis.used]);
                }
                let runs = e.anees(0).map_or(0, |a| a.1) as i64;
                table.push(&[], &[number as i64, epoch, runs], &row)?;
            }
        }
        table.finish().map(drop)
    }
}

/// True if a folder holds this campaign, or this part of it, with all its jobs.
pub fn is_complete(folder: &Path, campaign: &Campaign, shard: Option<Shard>) -> bool {
    let text = read_text(&folder.join(CAMPAIGN), LONGEST).ok();
    let log: Option<Log> = text.and_then(|text| serde_json::from_str(&text).ok());
    log.is_some_and(|log| {
        log.done == log.asked
            && log.shard == shard.map(|s| s.to_string())
            && log.campaign.difference(&campaign.read_back()).is_none()
    })
}

pub fn run_names(columns: &Columns) -> Names {
    let mut real = vec!["time_s".to_owned()];
    real.extend(Row::names(columns));
    let whole = ["point", "run", "seed", "epoch"].map(String::from).to_vec();
    Names { text: Vec::new(), whole, real }
}

pub fn bound_names(columns: &Columns) -> Names {
    let mut real = vec!["time_s".to_owned()];
    real.extend(
        columns
            .components
            .iter()
            .flat_map(|c| ["bound", "smoothed"].map(|what| format!("{}.{what}", c.name()))),
    );
    Names { text: Vec::new(), whole: ["point", "epoch"].map(String::from).to_vec(), real }
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<(), CampaignError> {
    let text = serde_json::to_string_pretty(value).map_err(|e| CampaignError::file(path, e))?;
    write_whole(path, (text + "\n").as_bytes()).map_err(|e| CampaignError::file(path, e))
}
