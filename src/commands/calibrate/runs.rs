//! Many runs: the errors of each method, compared with its sigma.

use super::apply::{Request, outcomes};
use super::edit;
use super::files;
use super::outcome::Outcome;
use super::table::{HEADINGS, NUMBERS, named};
use crate::error::{CommandError, Result};
use crate::output::progress::{Bar, INTERRUPTED, stop_on_signal};
use crate::output::{self, write_files};
use navfuse_calibration::words::{decimals, settles, unit};
use navfuse_calibration::{Repeated, Run};
use navfuse_campaign::JobCount;
use navfuse_core::document::Document;
use navfuse_core::plugin::Registry;
use navfuse_core::run::scenario::Scenario;
use navfuse_report::calibration;
use navfuse_segments::Mounting;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Largest number of runs.
const MAX_RUNS: u64 = 100_000;

/// Calibrates with many seeds and prints the errors.
pub fn repeat(
    registry: &Registry,
    document: &Document,
    request: &Request,
    count: u64,
    out: Option<&Path>,
    text: bool,
) -> Result<ExitCode> {
    let scenario = Scenario::new(registry, document.clone(), &[])?;
    let seeds = seeds(&scenario, count)?;
    let (bar, done) = (Bar::new(text), AtomicUsize::new(0));
    let progress = |done| bar.campaign(JobCount { done, asked: seeds.len() });
    progress(0);
    let stop = stop_on_signal();
    let results: Result<Vec<_>> = (seeds.par_iter())
        .map(|seed| {
            if stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
            let result = one(registry, document, request, *seed);
            progress(done.fetch_add(1, Ordering::Relaxed) + 1);
            let (outcomes, truth) = result?;
            Ok(Some((*seed, outcomes, truth)))
        })
        .collect();
    bar.done();
    let results: Vec<_> = results?.into_iter().flatten().collect();
    let (asked, seeds) = (seeds.len(), results.iter().map(|r| r.0).collect::<Vec<u64>>());
    let interrupted = || {
        output::warn(format_args!(
            "interrupted: {} of {asked} runs were completed; the results cover these runs",
            seeds.len()
        ));
        Ok(ExitCode::from(INTERRUPTED))
    };
    if seeds.is_empty() {
        return interrupted();
    }
    let rows = joined(results);
    if let [Repeated { name, refused: Some(why), runs, .. }] = &rows[..]
        && runs.is_empty()
    {
        return Err(CommandError::Request(format!("{name}: {why}")));
    }
    let (name, json) = (scenario.name(), in_json(&scenario.name(), &rows, &seeds));
    if text {
        table(&name, &rows, &seeds);
    } else {
        output::line(&json);
    }
    if let Some(out) = out {
        let page = calibration::repeated(&name, &edit::text(document)?, &seeds, &rows)?;
        write_files(out, files(serde_json::to_string_pretty(&json)?, page), text)?;
    }
    if seeds.len() < asked { interrupted() } else { Ok(ExitCode::SUCCESS) }
}

/// Returns `count` consecutive seeds, beginning with the scenario's.
fn seeds(scenario: &Scenario<'_>, count: u64) -> Result<Vec<u64>> {
    let rejected = |message: &str| Err(CommandError::argument(format!("--runs {count}"), message));
    if count < 2 {
        return rejected("give at least two; to calibrate with a single run, leave out --runs");
    }
    if count > MAX_RUNS {
        return rejected(&format!("at most {MAX_RUNS}"));
    }
    if !scenario.simulates()? {
        return Err(CommandError::argument(
            "--runs",
            "a recording cannot be repeated with other noise; give a scenario whose sources are \
             simulated, such as [source.simulation]",
        ));
    }
    let first = scenario.compose()?.seed;
    match first.checked_add(count).filter(|end| i64::try_from(*end).is_ok()) {
        Some(end) => Ok((first..end).collect()),
        None => Err(CommandError::Request(format!(
            "seed = {first}: --runs {count} goes beyond the largest seed; give a smaller one"
        ))),
    }
}

/// The outcomes of one run, and the true mounting.
fn one(
    registry: &Registry,
    document: &Document,
    request: &Request,
    seed: u64,
) -> Result<(Vec<Outcome>, Mounting)> {
    let failed = |e: CommandError| CommandError::Seed { seed, source: Box::new(e) };
    let mut document = document.clone();
    document.set(&format!("seed={seed}")).map_err(|e| failed(e.into()))?;
    let (data, outcomes) = outcomes(registry, &document, request, &|_| {}).map_err(failed)?;
    let velocity = data.velocity()?;
    let truth = velocity.truth.ok_or_else(|| {
        let name = &velocity.samples.name;
        CommandError::argument(
            "--runs",
            format!(
                "no truth to compare with; state sensor.{name}.scale.truth and \
                 sensor.{name}.misalignment.truth"
            ),
        )
    })?;
    Ok((outcomes, truth))
}

/// The rows, from the outcomes of each run.
fn joined(runs: Vec<(u64, Vec<Outcome>, Mounting)>) -> Vec<Repeated> {
    let mut rows: Vec<Repeated> = Vec::new();
    for (_, outcomes, truth) in runs {
        for (k, outcome) in outcomes.into_iter().enumerate() {
            if rows.len() == k {
                rows.push(Repeated {
                    name: outcome.name,
                    sensors: outcome.sensors,
                    runs: Vec::new(),
                    refused: None,
                });
            }
            match outcome.result {
                Err(why) => drop(rows[k].refused.get_or_insert(why.to_string())),
                Ok(e) => rows[k].runs.push(Run::new(&e, &truth)),
            }
        }
    }
    rows
}

fn table(name: &str, rows: &[Repeated], seeds: &[u64]) {
    output::line(format_args!("{name}, {} runs: r.m.s. of the errors", seeds.len()));
    let mut table = output::table(&HEADINGS);
    for row in rows.iter().filter(|r| !r.runs.is_empty()) {
        let [errors, sigmas, ratios] = row.figures();
        let line = |name: &str, cells: [String; 4], end: [String; 2]| {
            [&[name.to_owned()], &cells[..], &end].concat()
        };
        let cells = |of: [Option<f64>; 4]| {
            std::array::from_fn(|i| {
                of[i].map_or("-".to_owned(), |v| format!("{:.*}", decimals(i), v * unit(i)))
            })
        };
        let settled = row.settled_after().map_or_else(String::new, |t| format!("{t:.0} s"));
        table.add_row(line(&row.name, cells(errors), [settled, row.sensors.clone()]));
        if ratios.iter().any(Option::is_some) {
            table.add_row(line("  sigma", cells(sigmas), Default::default()));
            let ratio = ratios.map(|r| r.map_or("-".to_owned(), |r| format!("{r:.2}")));
            table.add_row(line("  error/sigma", ratio, Default::default()));
        }
    }
    output::right(&mut table, NUMBERS);
    output::line(&table);
    // the mean square of n ratios scatters by sqrt(2/n), its root by half of that
    let scatter = (0.5 / seeds.len() as f64).sqrt();
    // the seeds of an interrupted command have gaps
    let whole = seeds
        .last()
        .zip(seeds.first())
        .filter(|(last, first)| *last - *first + 1 == seeds.len() as u64);
    let all = || seeds.iter().map(u64::to_string).collect::<Vec<_>>().join(", ");
    let list = whole.map_or_else(all, |(last, first)| format!("{first} to {last}"));
    output::line(format_args!(
        "seeds {list}; error/sigma of a consistent sigma is 1 +- {scatter:.2}"
    ));
    output::aside(settles() + "; its median");
    for row in rows {
        if let Some(why) = &row.refused {
            let times = seeds.len() - row.runs.len();
            output::line(format_args!(
                "{}: not possible in {times} of {} runs: {why}",
                row.name,
                seeds.len()
            ));
        }
    }
}

fn in_json(name: &str, rows: &[Repeated], seeds: &[u64]) -> Value {
    let methods: Vec<Value> = (rows.iter())
        .map(|row| {
            let [error, sigma, ratio] = row.figures();
            json!({
                "method": row.name,
                "sensors": row.sensors,
                "runs": row.runs.len(),
                "needs": row.refused,
                "rms_error": named(error),
                "rms_sigma": named(sigma),
                "rms_error_over_sigma": {
                    "k": ratio[0],
                    "roll": ratio[1],
                    "pitch": ratio[2],
                    "yaw": ratio[3],
                },
                "settled_after_s": row.settled_after(),
            })
        })
        .collect();
    json!({ "scenario": name, "seeds": seeds, "methods": methods })
}
