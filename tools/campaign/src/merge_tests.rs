//! Shards of a campaign with runs that fail.

use super::*;
use crate::campaign::{InitialErrors, Point};
use crate::columns::{BlockColumns, Columns, Component};
use crate::journal::JOURNAL;
use navfuse_core::files::LIST;
use std::collections::BTreeMap;

const RUNS_ASKED: usize = 6;

fn campaign() -> Campaign {
    let component =
        Component { state: "dvl.scale".into(), component: "k".into(), unit: String::new() };
    Campaign {
        version: "1".into(),
        scenario: "made up".into(),
        keys: Vec::new(),
        points: vec![Point::default()],
        runs: RUNS_ASKED,
        seed: 2,
        every: 1,
        from: None,
        initial_errors: InitialErrors::Drawn,
        smooths: false,
        columns: Columns {
            components: vec![component],
            blocks: vec![BlockColumns { name: "dvl.scale".into(), dimension: 1, known: true }],
            sensors: vec!["dvl".into()],
        },
        overrides: Vec::new(),
        text: String::new(),
    }
}

/// Returns the record of a job: the second run fails before its first epoch, the fifth after two of
/// three.
fn record(campaign: &Campaign, job: Job) -> Record {
    if job.run == 0 {
        let rows = (0..3).map(|epoch| (epoch, epoch as f64, vec![0.1], vec![0.05])).collect();
        return Record::Bound(BoundRecord { point: job.point, rows });
    }
    let epochs = match job.run {
        2 => 0,
        5 => 2,
        _ => 3,
    };
    let x = job.run as f64 / 7.0;
    let row = |epoch: i64| {
        let values = vec![x, 0.1, x * x, x * x, 4.0, 0.0, 11.0 + x, 12.0, 24.0];
        Row { epoch, time: epoch as f64, values }
    };
    let failure = (epochs < 3).then(|| format!("made up to fail after {epochs} epochs"));
    let (point, run, seed) = (job.point, job.run, campaign.seed_of(job.run));
    let rows = (0..epochs).map(row).collect();
    Record::Run(RunRecord { point, run, seed, rows, failure, ..RunRecord::default() })
}

/// Writes a shard, or the whole campaign.
fn write(
    campaign: &Campaign,
    shard: Option<Shard>,
    path: &Path,
) -> Result<Option<Results>, CampaignError> {
    let mut folder = Folder::create(Some(path), campaign, shard)?;
    let jobs = campaign.jobs(shard);
    for job in &jobs {
        folder.add(record(campaign, *job))?;
    }
    folder.finish(JobCount { done: jobs.len(), asked: jobs.len() })
}

fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let results = entries.filter(|e| e.file_name() != LIST);
    results.map(|e| (e.file_name().into(), std::fs::read(e.path()).unwrap_or_default())).collect()
}

#[test]
fn failed_runs_are_reported_and_their_shards_merge_to_the_same_bytes() -> Result<(), CampaignError>
{
    let folder = tempfile::tempdir().map_err(|e| CampaignError::file(Path::new("."), e))?;
    let (campaign, whole) = (campaign(), folder.path().join("whole"));
    let results =
        write(&campaign, None, &whole)?.ok_or_else(|| CampaignError::Parts("no results".into()))?;
    let point = &results.report.points[0];
    assert_eq!((point.runs, point.failed), (RUNS_ASKED - 2, 2));
    let worst =
        point.worst.as_ref().map(|w| (w.run, w.seed, w.failure.as_deref(), w.again.as_str()));
    let again = "--set estimator.draw=all --set seed=2000002";
    assert_eq!(worst, Some((2, 2_000_002, Some("made up to fail after 0 epochs"), again)));
    let verdict = point.verdict.as_ref().map_or("", |v| v.text.as_str());
    assert_eq!(verdict, "2 of 6 runs ended early; run 2: made up to fail after 0 epochs");
    // the runs that reached the end
    let rmse =
        ([1, 3, 4, 6].map(|run| (f64::from(run) / 7.0).powi(2)).iter().sum::<f64>() / 4.0).sqrt();
    assert!(point.states[0].rmse.is_some_and(|r| (r - rmse).abs() < 1e-15), "{:?}", point.states);
    drop(results); // they keep the folder locked
    for count in [1, 3, 7, 20] {
        let parts: Vec<PathBuf> =
            (1..=count).map(|index| folder.path().join(format!("{index}-{count}"))).collect();
        for (k, part) in parts.iter().enumerate() {
            write(&campaign, Some(Shard { index: k + 1, count }), part)?;
        }
        let out = folder.path().join(format!("merged-{count}"));
        merge(&parts, &out)?;
        assert!(files(&out) == files(&whole), "{count} shards");
    }
    Ok(())
}

#[test]
fn a_campaign_resumes_after_any_cut_of_its_journal_to_the_same_bytes() -> Result<(), CampaignError>
{
    let failed = |e| CampaignError::file(Path::new("."), e);
    let folder = tempfile::tempdir().map_err(failed)?;
    let (campaign, whole) = (campaign(), folder.path().join("whole"));
    write(&campaign, None, &whole)?;
    let jobs = campaign.jobs(None);
    let killed = folder.path().join("killed");
    let mut begun = Folder::with_journal(Some(&killed), &campaign, None)?;
    let mut ends = Vec::new();
    let journal = killed.join(JOURNAL);
    let length = || std::fs::metadata(&journal).map(|m| m.len()).map_err(failed);
    for job in &jobs {
        ends.push(length()?);
        begun.add(record(&campaign, *job))?;
    }
    drop(begun);
    let bytes = std::fs::read(&journal).map_err(failed)?;
    // the end of the definition, one byte before and behind it, and so on for every record
    let cuts = ends.iter().flat_map(|end| [end - 1, *end, end + 1]).chain([bytes.len() as u64]);
    for (k, cut) in cuts.enumerate() {
        for flips in [false, true] {
            let mut damaged = bytes[..cut as usize].to_vec();
            damaged.iter_mut().rev().take(usize::from(flips)).for_each(|byte| *byte ^= 1);
            let path = folder.path().join(format!("{k}-{flips}"));
            std::fs::create_dir(&path).map_err(failed)?;
            std::fs::write(path.join(JOURNAL), &damaged).map_err(failed)?;
            std::fs::copy(killed.join(LIST), path.join(LIST)).map_err(failed)?;
            let (mut resumed, done) = Folder::resume(&path, &campaign, None)?;
            let intact = cut - u64::from(flips);
            let expected = ends.iter().skip(1).filter(|end| **end <= intact).count()
                + usize::from(intact >= bytes.len() as u64);
            assert_eq!(done, expected, "cut at {cut}");
            for job in &jobs[done..] {
                resumed.add(record(&campaign, *job))?;
            }
            resumed.finish(JobCount { done: jobs.len(), asked: jobs.len() })?;
            assert!(files(&path) == files(&whole), "cut at {cut}");
        }
    }
    Ok(())
}

#[test]
fn a_journal_of_another_campaign_is_refused() -> Result<(), CampaignError> {
    let folder = tempfile::tempdir().map_err(|e| CampaignError::file(Path::new("."), e))?;
    drop(Folder::with_journal(Some(folder.path()), &campaign(), None)?);
    let other = Campaign { seed: 3, ..campaign() };
    let refused = Folder::resume(folder.path(), &other, None).err().map(|e| e.to_string());
    let refused = refused.unwrap_or_default();
    assert!(refused.contains("--seed is 2 instead of 3"), "{refused}");
    let part = Some(Shard { index: 1, count: 2 });
    let refused = Folder::resume(folder.path(), &campaign(), part).err().map(|e| e.to_string());
    assert!(refused.unwrap_or_default().contains("the whole instead of part 1/2"));
    Ok(())
}
