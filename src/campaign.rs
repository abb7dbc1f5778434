//! `navfuse monte-carlo`, `bound`, `sweep` and `merge`.

use crate::arguments::{Bound, CampaignOptions, Draws, Format, Merge, MonteCarlo, Start, Sweep};
use crate::print;
use crate::print_campaign::{self as show, Shown};
use crate::progress::{Bar, INTERRUPTED, stop_on_ctrl_c};
use crate::run::folder_name;
use navfuse_campaign::{Campaign, Folder, JobCount, Options, Results, Shard, execute, variation};
use navfuse_core::document::Document;
use navfuse_core::plugin::Registry;
use navfuse_core::units::Time as Duration;
use serde::Deserialize;
use serde::de::IntoDeserializer;
use serde::de::value::Error as ValueError;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// What a campaign is called, and what of it is shown.
struct Kind<'a> {
    /// The command.
    name: &'a str,
    shown: Shown<'a>,
    /// The scenario's file, as a person gave it.
    scenario: &'a str,
}

/// `navfuse monte-carlo`
pub fn monte_carlo(registry: &Registry, arguments: &MonteCarlo) -> Result<ExitCode> {
    if arguments.runs == 0 {
        return Err("--runs 0: give at least one run; `navfuse bound` needs none".into());
    }
    let options = drawn(arguments.runs, &arguments.draws, &[])?;
    let scenario = &arguments.scenario.display().to_string();
    let kind = Kind { name: "monte-carlo", shown: Shown::Consistency, scenario };
    go(registry, &arguments.scenario, &arguments.options, options, &kind)
}

/// `navfuse bound`
pub fn bound(registry: &Registry, arguments: &Bound) -> Result<ExitCode> {
    let scenario = &arguments.scenario.display().to_string();
    let kind = Kind { name: "bound", shown: Shown::Bound, scenario };
    go(registry, &arguments.scenario, &arguments.options, Options::default(), &kind)
}

/// `navfuse sweep`
pub fn sweep(registry: &Registry, arguments: &Sweep) -> Result<ExitCode> {
    let options = drawn(arguments.runs, &arguments.draws, &arguments.vary)?;
    let scenario = &arguments.scenario.display().to_string();
    let kind = Kind { name: "sweep", shown: Shown::Grid(&arguments.show), scenario };
    go(registry, &arguments.scenario, &arguments.options, options, &kind)
}

fn drawn(runs: usize, draws: &Draws, vary: &[String]) -> Result<Options> {
    let initial_errors = match draws.start {
        Start::Drawn => navfuse_campaign::InitialErrors::Drawn,
        Start::Given => navfuse_campaign::InitialErrors::Given,
    };
    let vary = vary.iter().map(|v| variation(v)).collect::<std::result::Result<_, _>>()?;
    let from = draws.from.as_deref().map(|text| seconds("--from", text)).transpose()?;
    Ok(Options { runs, seed: draws.seed, initial_errors, vary, every: None, from })
}

fn go(
    registry: &Registry,
    path: &Path,
    settings: &CampaignOptions,
    mut options: Options,
    kind: &Kind<'_>,
) -> Result<ExitCode> {
    if settings.jobs == Some(0) {
        return Err("--jobs 0: give at least one thread; without it there is one a core".into());
    }
    let mut document = Document::from_file(path)?;
    settings.set.iter().try_for_each(|s| document.set(s))?;
    options.every = settings.every.as_deref().map(|text| seconds("--every", text)).transpose()?;
    let plan = Campaign::new(registry, &document, &options)?;
    kind.shown.check(&plan)?;
    let out = (!settings.no_output).then(|| {
        let part =
            settings.shard.map_or_else(String::new, |s| format!("-{}-of-{}", s.index, s.count));
        let name = format!("{}-{}{part}", plan.scenario, kind.name);
        settings.out.clone().unwrap_or_else(|| PathBuf::from("runs").join(folder_name(&name)))
    });
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let threads = settings.jobs.unwrap_or(cores);
    let clock = Instant::now();
    let stop = stop_on_ctrl_c();
    let mut folder = Folder::create(out.as_deref(), &plan, settings.shard)?;
    let text = settings.format == Format::Text;
    let bar = Bar::new(text);
    let how = (settings.shard, threads);
    let done = execute(
        &plan,
        registry,
        &document,
        how,
        &stop,
        |d| bar.campaign(d),
        |record| folder.add(record),
    );
    bar.done();
    let done = done?;
    let results = folder.finish(done)?;
    match (&results, &out) {
        (Some(results), _) => report(&plan, results, kind, out.as_deref(), text)?,
        (None, Some(out)) => part(settings.shard, done, out, text),
        (None, None) => {}
    }
    if text {
        let (jobs, threads) = (counted(done.done, "job"), counted(threads, "thread"));
        print::line(format_args!("{jobs} on {threads} in {:.1} s", clock.elapsed().as_secs_f64()));
    }
    if done.interrupted() {
        let JobCount { done, asked } = done;
        let what = match settings.shard {
            None => "and are what is told",
            Some(_) => {
                "and are what was written; `navfuse merge` needs the whole part, so run it again"
            }
        };
        print::warn(format_args!("interrupted: {done} of {asked} jobs were done, {what}"));
        return Ok(ExitCode::from(INTERRUPTED));
    }
    Ok(ExitCode::SUCCESS)
}

/// Tells where a part is.
fn part(shard: Option<Shard>, done: JobCount, out: &Path, text: bool) {
    let shard = shard.map_or_else(String::new, |s| s.to_string());
    let JobCount { done, asked } = done;
    if text {
        let next = if done == asked { "; `navfuse merge` joins the parts" } else { "" };
        print::line(format_args!(
            "part {shard}: {done} of {asked} jobs are in {}{next}",
            out.display()
        ));
    } else {
        print::line(
            serde_json::json!({ "shard": shard, "done": done, "asked": asked, "out": out.display().to_string() }),
        );
    }
}

/// `1 job`, `2 jobs`.
fn counted(count: usize, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}

/// `navfuse merge`
pub fn merge(arguments: &Merge) -> Result<ExitCode> {
    let plan = navfuse_campaign::campaign_of(&arguments.parts[0])?;
    let name = format!("{}-merged", plan.scenario);
    let out =
        arguments.out.clone().unwrap_or_else(|| PathBuf::from("runs").join(folder_name(&name)));
    // what the command that made the parts shows
    let (name, shown) = match (plan.keys.is_empty(), plan.runs) {
        (false, _) => ("sweep", Shown::Grid(&arguments.show)),
        (true, 0) => ("bound", Shown::Bound),
        (true, _) => ("monte-carlo", Shown::Consistency),
    };
    shown.check(&plan)?;
    if let (Shown::Consistency | Shown::Bound, Some(state)) = (shown, arguments.show.first()) {
        return Err(format!(
            "--show {state}: only of a sweep, and these are parts of a `navfuse {name}`"
        )
        .into());
    }
    let results = navfuse_campaign::merge(&arguments.parts, &out)?;
    report(
        &plan,
        &results,
        &Kind { name, shown, scenario: "SCENARIO" },
        Some(&out),
        arguments.format == Format::Text,
    )?;
    Ok(ExitCode::SUCCESS)
}

/// Prints the results and draws them.
fn report(
    plan: &Campaign,
    results: &Results,
    kind: &Kind<'_>,
    out: Option<&Path>,
    text: bool,
) -> Result<()> {
    let mut files = results.files.clone();
    if let Some(out) = out {
        let figures = navfuse_campaign::figures(plan, results, |c| kind.shown.shows(c));
        for figure in &figures {
            let path = out.join(format!("{}.svg", figure.name));
            std::fs::write(&path, navfuse_figures::svg(figure)?)
                .map_err(|e| format!("{}: {e}", path.display()))?;
            files.push(path);
        }
        #[cfg(feature = "rerun")]
        if plan.keys.is_empty() {
            let path = out.join("campaign.rrd");
            navfuse_viewer::figures::record(
                &path,
                &format!("{} {}", plan.scenario, kind.name),
                &figures,
            )?;
            files.push(path);
        }
    }
    if text {
        show::results(plan, results, kind.shown, kind.scenario);
        show::files(&files, out);
    } else {
        print::line(serde_json::to_string(&results.report)?);
    }
    Ok(())
}

/// A time with its unit, in seconds.
pub fn seconds(option: &str, text: &str) -> Result<f64> {
    let deserializer = IntoDeserializer::<ValueError>::into_deserializer(text);
    Ok(Duration::deserialize(deserializer).map_err(|e| format!("{option} {text:?}: {e}"))?.si())
}
