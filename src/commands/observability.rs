//! `navfuse observability`.

use crate::error::Result;
use crate::execution::input::{document_of, seconds};
use crate::output::progress::{Bar, INTERRUPTED, stop_on_signal};
use crate::output::{self, Format, write_files};
use clap::Args;
use navfuse_campaign::JobCount;
use navfuse_core::plugin::Registry;
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_observability::{Determination, ObservabilityReport, TrackerSink, plan, words};
use navfuse_segments::{Gatherer, Kind, SegmentError};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Interval of the normalised sigmas that are kept, s.
const EVERY: f64 = 1.0;
/// Number of states that are shown for a manoeuvre.
const IMPROVED: usize = 3;

/// Arguments of `observability`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse observability scenarios/pan-wu-3d.toml
  # write a page, figures and numbers; then the same for a recorded dive
  navfuse observability scenarios/pan-wu-2d.toml --out runs/observe
  navfuse observability runs/pan-wu-3d/run.mcap
  # rank the next manoeuvres
  navfuse observability scenarios/pan-wu-2d.toml --suggest
  navfuse observability scenarios/pan-wu-3d.toml --suggest \\
      --at \"720 s\" --for ins.accel_bias

A state is determined when at most a sixteenth of its variance still comes from the prior: its sigma \
is then at most a quarter of what it would be without measurements. `bits` counts how often sigma was \
halved; a velocity that is measured forgets its prior, although process noise keeps its sigma up.")]
pub struct Observability {
    /// A scenario (TOML), or a log that navfuse wrote (MCAP)
    pub scenario: PathBuf,
    /// Change a value of the scenario; may be given again
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// Rank the manoeuvres that could come next by the Cramer-Rao bound that they reach; needs a
    /// simulated scenario
    #[arg(long)]
    pub suggest: bool,
    /// Start of the manoeuvre, which replaces the rest of the scenario [default: its end]
    #[arg(long, value_name = "TIME", requires = "suggest")]
    pub at: Option<String>,
    /// A state or component that the manoeuvre is to determine, such as dvl.misalignment.roll; may
    /// be given again [default: the states that are not determined when it begins]
    #[arg(long = "for", value_name = "STATE", requires = "suggest")]
    pub of: Vec<String>,
    /// Folder for the report (JSON, HTML) and the figure of normalised sigmas (SVG)
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Form of the report
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub format: Format,
}

/// Reports which states a scenario or a log determines.
pub fn observability(registry: &Registry, arguments: &Observability) -> Result<ExitCode> {
    if arguments.suggest {
        return suggest(registry, arguments);
    }
    let (document, mut settings) = document_of(&arguments.scenario)?;
    settings.extend(arguments.set.iter().cloned());
    let scenario = Scenario::new(registry, document, &settings)?;
    let name = scenario.name();
    let mut assembly = scenario.assemble(None)?;
    assembly.sinks.push(("observability".into(), Box::new(TrackerSink::new(EVERY))));
    let gatherer = Gatherer::new(&assembly.composition);
    assembly.sinks.push(("segments".into(), Box::new(gatherer)));
    let stop = stop_on_signal();
    let text = arguments.format == Format::Text;
    let bar = Bar::new(text);
    let mut finished = runner::run(assembly, &stop, |progress| bar.run(progress));
    bar.done();
    let tracker = TrackerSink::take(&mut finished);
    if let (Some(tracker), None) = (tracker.as_ref().filter(|t| t.started()), &finished.error) {
        let mut report = ObservabilityReport::new(&name, tracker);
        let composed = scenario.compose().map_err(SegmentError::from);
        report.judge(composed.and_then(|c| Gatherer::take(&mut finished, &c)), tracker);
        if text {
            show(&report);
        } else {
            output::line(serde_json::to_string(&report)?);
        }
        if let Some(out) = &arguments.out {
            write(&report, out, text)?;
        }
    }
    output::run::events(&finished.events);
    Ok(match (finished.error, finished.interrupted) {
        (Some(_), _) => ExitCode::FAILURE,
        (None, true) => ExitCode::from(INTERRUPTED),
        (None, false) => ExitCode::SUCCESS,
    })
}

/// Suggests the manoeuvres that could come next.
fn suggest(registry: &Registry, arguments: &Observability) -> Result<ExitCode> {
    let (mut document, _) = document_of(&arguments.scenario)?;
    arguments.set.iter().try_for_each(|s| document.set(s))?;
    let at = arguments.at.as_deref().map(|text| seconds("--at", text)).transpose()?;
    let options = plan::Options { at, of: arguments.of.clone() };
    let text = arguments.format == Format::Text;
    let (bar, stop) = (Bar::new(text), stop_on_signal());
    let progress = |done, asked| bar.campaign(JobCount { done, asked });
    let plan = plan::suggest(registry, &document, &options, &stop, progress);
    bar.done();
    let Some(plan) = plan? else { return Ok(ExitCode::from(INTERRUPTED)) };
    if let Some(out) = &arguments.out {
        let content = serde_json::to_string_pretty(&plan)?;
        write_files(out, [("suggestions.json".to_owned(), content)], text)?;
    }
    if !text {
        output::line(serde_json::to_string(&plan)?);
        return Ok(ExitCode::SUCCESS);
    }
    output::line(format_args!(
        "after {:.0} s, at {:.1} m/s; what counts: {}",
        plan.at_s,
        plan.speed,
        plan.of.join(", ")
    ));
    let mut table = output::table(&[
        "manoeuvre",
        "time",
        "bits",
        "bits a minute",
        "most improved, compared with going straight",
    ]);
    for s in &plan.suggestions {
        let most: Vec<String> =
            s.improves.iter().take(IMPROVED).map(plan::Improvement::text).collect();
        let minutes = s.duration_s / 60.0;
        table.add_row([
            s.name.clone(),
            format!("{:.0} s", s.duration_s),
            tenths(s.bits),
            tenths(s.bits / minutes),
            most.join("\n"),
        ]);
    }
    output::right(&mut table, 1..4);
    output::line(table);
    if let Some(best) = plan.suggestions.first() {
        output::line(format_args!("\n{}:", best.name));
        best.segments.iter().for_each(|s| output::line(format_args!("  {s}")));
    }
    Ok(ExitCode::SUCCESS)
}

/// With one decimal, and no sign before a zero.
fn tenths(value: f64) -> String {
    format!("{:.1}", (10.0 * value).round() / 10.0 + 0.0)
}

/// Prints the report.
fn show(report: &ObservabilityReport) {
    output::line(format_args!(
        "{}, {:.0} s to {:.0} s",
        report.scenario, report.start_s, report.end_s
    ));
    let mut table =
        output::table(&["state", "", "prior", "now", "unit", "bits", "still prior", "verdict"]);
    let mut before = "";
    for s in &report.states {
        let verdict = match (s.verdict, s.since_s, s.lost_s) {
            (_, Some(since), _) => format!("determined since {since:.0} s"),
            (verdict, None, Some(lost)) => format!("{}, was until {lost:.0} s", verdict.text()),
            (verdict, None, None) => verdict.text().to_owned(),
        };
        table.add_row([
            if s.state == before { String::new() } else { s.state.clone() },
            s.component.clone(),
            words::short(s.prior),
            words::short(s.sigma),
            s.unit.clone(),
            tenths(s.bits),
            words::still_prior(s.prior_weight),
            verdict,
        ]);
        before = &s.state;
    }
    output::right(&mut table, 2..4);
    output::right(&mut table, 5..7);
    output::line(format_args!("{table}"));
    output::line(words::MEASURES);
    segments(report);
    let missing: Vec<_> =
        report.states.iter().filter(|s| s.verdict != Determination::Determined).collect();
    if !missing.is_empty() {
        output::line("\nWhat is missing");
    }
    for s in missing {
        let why = s.missing.as_deref().unwrap_or_default();
        output::line(format_args!("  {}: {}: {why}", s.title, s.verdict.text()));
    }
    if !report.undetermined.is_empty() {
        output::line(
            "\nDirections that the measurements left open, and the share of their prior variance",
        );
    }
    for d in &report.undetermined {
        output::line(format_args!("  {:>4.0} %  {}", 100.0 * d.left, d.text));
    }
}

/// Prints the segments, and the verdicts of Theorem 1.
fn segments(report: &ObservabilityReport) {
    let Some(view) = &report.segments else {
        if let Some(why) = &report.no_segments {
            output::line(format_args!("\nno segments: {why}"));
        }
        return;
    };
    let mut table = output::table(&["segment", "from", "to", ""]);
    for s in view.segments.iter().filter(|s| s.kind != Kind::Steady) {
        let what = match (s.force_rate, s.heading_change_deg) {
            (Some((rate, [x, y, z])), _) => {
                format!(
                    "specific-force rate {} mm/s^3 along [{x:.2} {y:.2} {z:.2}]",
                    words::short(1e3 * rate)
                )
            }
            (_, Some(turn)) => format!("heading {turn:+.0} deg"),
            _ => String::new(),
        };
        table.add_row([
            s.kind.to_string(),
            format!("{:.0} s", s.from_s),
            format!("{:.0} s", s.to_s),
            what,
        ]);
    }
    output::right(&mut table, 1..3);
    output::line(format_args!("\n{table}"));
    let d = &view.type_i;
    let [a, b, c] = d.singular_values.map(|s| words::short(1e3 * s));
    let noise = words::short(1e3 * d.noise);
    output::line(format_args!(
        "type I: {} of the specific-force rate; singular values {a}, {b}, {c} mm/s^3, \
         noise {noise}",
        directions(d.rank)
    ));
    if let Some(s) = &view.type_ii {
        let [a, b, c] = s.singular_values.map(words::short);
        output::line(format_args!(
            "type II: {} points alpha in {}; singular values {a}, {b}, {c} m/s^2, noise {}; \
             condition of sum(alpha alpha') {:.0}",
            s.points,
            directions(s.rank),
            words::short(s.noise),
            s.condition_about_zero
        ));
    }
    for v in &view.verdicts {
        let disagrees = if v.agrees { "" } else { " [the filter disagrees]" };
        output::line(format_args!("{}: {}{disagrees}", v.about, v.text));
    }
    for warning in &view.warnings {
        output::warn(format_args!("warning: {warning}"));
    }
}

/// A number of directions in words.
fn directions(rank: usize) -> String {
    match rank {
        0 => "no direction".to_owned(),
        1 => "1 direction".to_owned(),
        _ => format!("{rank} independent directions"),
    }
}

/// Writes the report and the figure.
fn write(report: &ObservabilityReport, out: &Path, text: bool) -> Result<()> {
    let figure = report.figure();
    let files = [
        ("observability.json".to_owned(), serde_json::to_string_pretty(report)?),
        ("observability.html".to_owned(), navfuse_report::observability::page(report)?),
        (format!("{}.svg", figure.name), navfuse_figures::svg(&figure)?),
    ];
    write_files(out, files, text)
}
