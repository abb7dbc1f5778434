//! Campaigns of runs, as `monte-carlo`, `bound`, `sweep` and `merge` do them.

use crate::error::{CommandError, Result};
use crate::execution::input::{document, runs_folder, seconds};
use crate::execution::worst::Again;
use crate::output::campaign::{self as show, Shown};
use crate::output::progress::{Bar, INTERRUPTED, stop_on_signal};
use crate::output::scenarios;
use crate::output::terminal::Detail;
use crate::output::{self, Format};
use clap::{Args, ValueEnum};
use navfuse_campaign::{
    Campaign, Extent, Folder, JobCount, Options, Results, Shard, execute, variation,
};
use navfuse_core::document::Document;
use navfuse_core::plugin::Registry;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Random draws of each run.
#[derive(Clone, Debug, Args)]
pub struct Draws {
    /// Seed of the campaign; run r has 1000000 times this seed, plus r [default: the scenario's seed]
    #[arg(long)]
    pub seed: Option<u64>,
    /// Values that are drawn beside the noise
    #[arg(long, value_enum, default_value_t = Start::Drawn)]
    pub start: Start,
    /// Judge errors and sigmas from this time on; earlier epochs are recorded, but do not count
    /// for the verdict
    #[arg(long, value_name = "TIME")]
    pub from: Option<String>,
}

/// Values that are drawn beside the noise.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Start {
    /// Initial errors from the priors, and the truths that the scenario does not state
    Drawn,
    /// Only the values that the scenario draws by its own `estimator.draw`
    Given,
}

/// Options of a campaign.
#[derive(Clone, Debug, Args)]
pub struct CampaignOptions {
    /// Change a value of the scenario; may be given again
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// Number of threads [default: one a core]
    #[arg(long)]
    pub jobs: Option<usize>,
    /// Time between two epochs of a run [default: such that there are about 300 epochs]
    #[arg(long, value_name = "TIME")]
    pub every: Option<String>,
    /// Do only this part, such as 3/7, for `merge`
    #[arg(long, value_name = "I/N")]
    pub shard: Option<Shard>,
    /// Continue the campaign that was killed or interrupted in this folder, or begin it
    #[arg(long)]
    pub resume: bool,
    /// Folder for the tables and plots [default: runs/NAME-COMMAND]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Form of the result
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub format: Format,
    /// Write nothing
    #[arg(long, conflicts_with_all = ["out", "shard", "resume"])]
    pub no_output: bool,
}

/// The command that runs a campaign, and the tables that it shows.
pub struct Kind<'a> {
    /// The command.
    pub name: &'a str,
    /// The tables.
    pub shown: Shown<'a>,
    /// The scenario's file, as it was given.
    pub scenario: &'a str,
}

/// The options of a campaign of `runs` runs for all combinations of values of `vary`.
pub fn drawn(runs: usize, draws: &Draws, vary: &[String]) -> Result<Options> {
    let initial_errors = match draws.start {
        Start::Drawn => navfuse_campaign::InitialErrors::Drawn,
        Start::Given => navfuse_campaign::InitialErrors::Given,
    };
    let vary = vary.iter().map(|v| variation(v)).collect::<std::result::Result<_, _>>()?;
    let from = draws.from.as_deref().map(|text| seconds("--from", text)).transpose()?;
    Ok(Options { runs, seed: draws.seed, initial_errors, vary, every: None, from })
}

/// A campaign that was run.
pub struct Conducted {
    /// The campaign.
    pub campaign: Campaign,
    /// Its scenario.
    pub document: Document,
    /// Its results; none for a part of a campaign.
    pub results: Option<Results>,
    /// The folder of its files.
    pub out: Option<PathBuf>,
    /// Jobs that were done.
    pub done: JobCount,
}

/// Number of threads of a campaign.
pub fn threads(jobs: Option<usize>) -> Result<usize> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    match jobs {
        Some(0) => {
            let message = "give at least one thread; without --jobs there is one a core";
            Err(CommandError::argument("--jobs 0", message))
        }
        jobs => Ok(jobs.unwrap_or(cores)),
    }
}

/// Runs a campaign and writes its files; `stop` interrupts it. None for a campaign that is to be
/// resumed and is complete.
pub fn conduct(
    registry: &Registry,
    path: &Path,
    settings: &CampaignOptions,
    mut options: Options,
    kind: &Kind<'_>,
    stop: &AtomicBool,
) -> Result<Option<Conducted>> {
    let threads = threads(settings.jobs)?;
    let mut document = document(path)?;
    settings.set.iter().try_for_each(|s| document.set(s))?;
    options.every = settings.every.as_deref().map(|text| seconds("--every", text)).transpose()?;
    let campaign = Campaign::new(registry, &document, &options)?;
    kind.shown.check(&campaign)?;
    let out = (!settings.no_output).then(|| {
        let part =
            settings.shard.map_or_else(String::new, |s| format!("-{}-of-{}", s.index, s.count));
        let name = format!("{}-{}{part}", campaign.scenario, kind.name);
        settings.out.clone().unwrap_or_else(|| runs_folder(&name))
    });
    let (mut folder, before) = match out.as_deref().filter(|_| settings.resume) {
        Some(out) if navfuse_campaign::is_complete(out, &campaign, settings.shard) => {
            output::warn(format_args!("{}: this campaign is complete", out.display()));
            return Ok(None);
        }
        Some(out) => Folder::resume(out, &campaign, settings.shard)?,
        None => (Folder::with_journal(out.as_deref(), &campaign, settings.shard)?, 0),
    };
    if before > 0 {
        output::warn(format_args!("resumed after {}", counted(before, "job")));
    }
    let bar = Bar::new(settings.format == Format::Text);
    let done = execute(
        &campaign,
        registry,
        &document,
        Extent { shard: settings.shard, threads, done: before },
        stop,
        |jobs| bar.campaign(jobs),
        |record| folder.add(record),
    );
    bar.done();
    let done = done?;
    let results = folder.finish(done)?;
    Ok(Some(Conducted { campaign, document, results, out, done }))
}

/// Runs a campaign and prints its results.
pub fn run(
    registry: &Registry,
    path: &Path,
    settings: &CampaignOptions,
    options: Options,
    kind: &Kind<'_>,
) -> Result<ExitCode> {
    let clock = Instant::now();
    let stop = stop_on_signal();
    let text = settings.format == Format::Text;
    let conducted = conduct(registry, path, settings, options, kind, &stop)?;
    let Some(Conducted { campaign, document, results, out, done }) = conducted else {
        return Ok(ExitCode::SUCCESS);
    };
    let again =
        Again { registry, document: &document, threads: threads(settings.jobs)?, stop: &stop };
    match (&results, &out) {
        (Some(results), _) => report(&campaign, results, kind, again, out.as_deref(), text)?,
        (None, Some(out)) => part(settings.shard, done, out, text),
        (None, None) => {}
    }
    if text {
        took(done, threads(settings.jobs)?, clock);
    }
    if done.interrupted() {
        let JobCount { done, asked } = done;
        let what = match settings.shard {
            None => "and the tables above are of these",
            Some(_) => {
                "and these were written; `navfuse merge` needs the whole part, so run it again"
            }
        };
        let how = if out.is_some() { "; --resume continues after them" } else { "" };
        output::warn(format_args!("interrupted: {done} of {asked} jobs were done, {what}{how}"));
        return Ok(ExitCode::from(INTERRUPTED));
    }
    Ok(ExitCode::SUCCESS)
}

/// Runs a campaign of each scenario, and prints one table with a row for each.
pub fn run_several(
    registry: &Registry,
    paths: &[PathBuf],
    settings: &CampaignOptions,
    options: &Options,
) -> Result<ExitCode> {
    if let Some(shard) = settings.shard {
        let message = "a part belongs to one scenario; give one, or leave --shard out";
        return Err(CommandError::argument(format!("--shard {shard}"), message));
    }
    if settings.resume {
        let message = "a campaign of one scenario resumes; give one, or leave --resume out";
        return Err(CommandError::argument("--resume", message));
    }
    let clock = Instant::now();
    let stop = stop_on_signal();
    let text = settings.format == Format::Text;
    let mut all: Vec<Conducted> = Vec::with_capacity(paths.len());
    let mut total = JobCount { done: 0, asked: 0 };
    for path in paths {
        let scenario = &path.display().to_string();
        let kind = Kind { name: "monte-carlo", shown: Shown::Consistency, scenario };
        let mut own = settings.clone();
        let stem = path.file_stem().unwrap_or_default();
        own.out = settings.out.as_ref().map(|out| out.join(stem));
        let Some(one) = conduct(registry, path, &own, options.clone(), &kind, &stop)? else {
            continue;
        };
        if let (Some(results), Some(out)) = (&one.results, &one.out) {
            let threads = threads(own.jobs)?;
            let again = Again { registry, document: &one.document, threads, stop: &stop };
            draw(&one.campaign, results, &kind, again, Some(out), &mut Vec::new())?;
        }
        total.done += one.done.done;
        total.asked += one.done.asked;
        all.push(one);
        if total.done < total.asked {
            break;
        }
    }
    let rows = all.iter().filter_map(|one| Some((&one.campaign, one.results.as_ref()?)));
    if text {
        scenarios::table(rows);
        took(total, threads(settings.jobs)?, clock);
    } else {
        output::line(serde_json::to_string(&scenarios::rows(rows))?);
    }
    if total.done < total.asked {
        let (done, asked) = (all.len(), paths.len());
        output::warn(format_args!("interrupted at scenario {done} of {asked}"));
        return Ok(ExitCode::from(INTERRUPTED));
    }
    Ok(ExitCode::SUCCESS)
}

/// Prints the number of jobs and their time.
fn took(done: JobCount, threads: usize, clock: Instant) {
    let (jobs, threads) = (counted(done.done, "job"), counted(threads, "thread"));
    output::aside(format_args!("{jobs} on {threads} in {:.1} s", clock.elapsed().as_secs_f64()));
}

/// Prints the place of a part.
fn part(shard: Option<Shard>, done: JobCount, out: &Path, text: bool) {
    let shard = shard.map_or_else(String::new, |s| s.to_string());
    let JobCount { done, asked } = done;
    if text {
        let next = if done == asked { "; `navfuse merge` joins the parts" } else { "" };
        output::line(format_args!(
            "part {shard}: {done} of {asked} jobs are in {}{next}",
            out.display()
        ));
    } else {
        output::line(serde_json::json!({
            "shard": shard,
            "done": done,
            "asked": asked,
            "out": out.display().to_string(),
        }));
    }
}

/// A number with its noun: `1 job`, `2 jobs`.
fn counted(count: usize, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}

/// Prints the results and draws them. A figure that cannot be written is an error after the tables
/// have been printed.
pub fn report(
    campaign: &Campaign,
    results: &Results,
    kind: &Kind<'_>,
    again: Again<'_>,
    out: Option<&Path>,
    text: bool,
) -> Result<()> {
    let mut files = results.files.clone();
    let drawn = draw(campaign, results, kind, again, out, &mut files);
    match (text, Detail::get()) {
        (false, _) => output::line(serde_json::to_string(&results.report)?),
        (true, Detail::Quiet) => show::verdicts(results),
        (true, _) => {
            show::results(campaign, results, kind.shown, kind.scenario);
            show::files(&files, out);
        }
    }
    drawn
}

/// Draws the results, and adds the paths of the figures to `files`.
fn draw(
    campaign: &Campaign,
    results: &Results,
    kind: &Kind<'_>,
    again: Again<'_>,
    out: Option<&Path>,
    files: &mut Vec<PathBuf>,
) -> Result<()> {
    if let Some(out) = out {
        let figures = navfuse_campaign::figures(campaign, results, |c| kind.shown.shows(c));
        for figure in &figures {
            let path = out.join(format!("{}.svg", figure.name));
            output::write(&path, &navfuse_figures::svg(figure)?)?;
            files.push(path);
        }
        let pages = again.pages(campaign, results, out)?;
        let name = |page: &PathBuf| page.file_name().map(|n| n.to_string_lossy().into_owned());
        let names: Vec<String> = pages.iter().filter_map(name).collect();
        let shown = |c: &_| kind.shown.shows(c);
        let page = navfuse_report::campaign::page(campaign, results, &figures, shown, &names)?;
        let path = out.join("campaign.html");
        output::write(&path, &page)?;
        files.push(path);
        files.extend(pages);
        #[cfg(feature = "rerun")]
        if campaign.keys.is_empty() {
            let path = out.join("campaign.rrd");
            navfuse_viewer::figures::record(
                &path,
                &format!("{} {}", campaign.scenario, kind.name),
                None,
                &[],
                &figures,
            )?;
            files.push(path);
        }
    }
    Ok(())
}
