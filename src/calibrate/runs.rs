//! Many runs: what the errors of each method are, and whether its sigma is that of its errors.

use super::table::{HEADINGS, NUMBERS, named, settles};
use super::{Calibrate, Outcome, Result, decimals, outcomes, unit};
use crate::arguments::Format;
use crate::print;
use crate::progress::{Bar, INTERRUPTED, stop_on_ctrl_c};
use navfuse_calibration::Method;
use navfuse_campaign::JobCount;
use navfuse_core::document::Document;
use navfuse_core::plugin::Registry;
use navfuse_core::run::scenario::Scenario;
use navfuse_segments::Mounting;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The most runs: their table is of no use beyond.
const MAX_RUNS: u64 = 100_000;

/// What a method did on all runs.
struct Row {
    name: String,
    sensors: String,
    /// Of the runs in which it was possible.
    runs: Vec<Run>,
    /// Why it was not, where first.
    refused: Option<String>,
}

struct Run {
    error: [f64; 4],
    sigma: Option<[f64; 4]>,
    determined: [bool; 4],
    settled_after: Option<f64>,
}

impl Row {
    /// Root mean square over the runs of what is asked of a component, where all runs determined it.
    fn rms(&self, i: usize, of: impl Fn(&Run) -> Option<f64>) -> Option<f64> {
        let squares: Option<Vec<f64>> =
            self.runs.iter().map(|r| of(r).filter(|_| r.determined[i]).map(|v| v * v)).collect();
        squares.filter(|s| !s.is_empty()).map(|s| (s.iter().sum::<f64>() / s.len() as f64).sqrt())
    }

    /// R.m.s. error, r.m.s. sigma, and the r.m.s. of their ratio, for `k` (1) and the angles (rad).
    fn figures(&self) -> [[Option<f64>; 4]; 3] {
        let all = |of: &dyn Fn(&Run, usize) -> Option<f64>| {
            std::array::from_fn(|i| self.rms(i, |r| of(r, i)))
        };
        [
            all(&|r, i| Some(r.error[i])),
            all(&|r, i| Some(r.sigma?[i])),
            all(&|r, i| Some(r.error[i] / r.sigma?[i]).filter(|x| x.is_finite())),
        ]
    }

    /// The median over the runs, s.
    fn settled_after(&self) -> Option<f64> {
        let mut times: Vec<f64> = self.runs.iter().filter_map(|r| r.settled_after).collect();
        times.sort_by(f64::total_cmp);
        times.get(times.len() / 2).copied()
    }
}

/// Calibrates with the seeds from the scenario's on, and prints what the errors were.
pub fn repeat(
    registry: &Registry,
    document: &Document,
    methods: &[Method],
    arguments: &Calibrate,
    count: u64,
) -> Result<ExitCode> {
    if count < 2 {
        return Err(format!(
            "--runs {count}: give at least two; without it there is one, and its table"
        )
        .into());
    }
    if count > MAX_RUNS {
        return Err(format!("--runs {count}: at most {MAX_RUNS}").into());
    }
    let scenario = Scenario::new(registry, document.clone(), &[])?;
    if !scenario.simulates()? {
        return Err("--runs: a recording has only the noise that it has: this needs a scenario whose sources are \
                    simulated, such as [source.simulation]"
            .into());
    }
    let first = scenario.compose()?.seed;
    let Some(end) = first.checked_add(count).filter(|end| i64::try_from(*end).is_ok()) else {
        return Err(format!(
            "seed = {first}: --runs {count} goes on beyond the largest seed; give a smaller one"
        )
        .into());
    };
    let seeds: Vec<u64> = (first..end).collect();
    let text = arguments.format == Format::Text;
    let (bar, done) = (Bar::new(text), AtomicUsize::new(0));
    let progress = |done| bar.campaign(JobCount { done, asked: seeds.len() });
    progress(0);
    let stop = stop_on_ctrl_c();
    let results: std::result::Result<Vec<_>, String> = (seeds.par_iter())
        .map(|seed| {
            if stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
            let mut document = document.clone();
            let result = (document.set(&format!("seed={seed}")).map_err(Into::into))
                .and_then(|()| outcomes(registry, &document, methods, arguments, &|_| {}));
            progress(done.fetch_add(1, Ordering::Relaxed) + 1);
            let (data, outcomes) = result.map_err(|e| format!("with --set seed={seed}: {e}"))?;
            let velocity = data.velocity().map_err(|e| e.to_string())?;
            let truth = velocity.truth.ok_or_else(|| {
                let name = &velocity.samples.name;
                format!("--runs: no truth to compare with; state sensor.{name}.scale.truth and sensor.{name}.misalignment.truth")
            })?;
            Ok(Some((*seed, outcomes, truth)))
        })
        .collect();
    bar.done();
    let results: Vec<_> = results?.into_iter().flatten().collect();
    let (asked, seeds) = (seeds.len(), results.iter().map(|r| r.0).collect::<Vec<u64>>());
    let interrupted = || {
        print::warn(format_args!(
            "interrupted: {} of {asked} runs were done, and are what is told",
            seeds.len()
        ));
        Ok(ExitCode::from(INTERRUPTED))
    };
    if seeds.is_empty() {
        return interrupted();
    }
    let rows = joined(results);
    if let [Row { name, refused: Some(why), runs, .. }] = &rows[..]
        && runs.is_empty()
    {
        return Err(format!("{name}: {why}").into());
    }
    if text {
        table(&scenario.name(), &rows, &seeds);
    } else {
        print::line(in_json(&scenario.name(), &rows, &seeds));
    }
    if seeds.len() < asked { interrupted() } else { Ok(ExitCode::SUCCESS) }
}

/// The rows, from each run's outcomes.
fn joined(runs: Vec<(u64, Vec<Outcome>, Mounting)>) -> Vec<Row> {
    let mut rows: Vec<Row> = Vec::new();
    for (_, outcomes, truth) in runs {
        for (k, outcome) in outcomes.into_iter().enumerate() {
            if rows.len() == k {
                rows.push(Row {
                    name: outcome.name,
                    sensors: outcome.sensors,
                    runs: Vec::new(),
                    refused: None,
                });
            }
            match outcome.result {
                Err(why) => drop(rows[k].refused.get_or_insert(why)),
                Ok(e) => rows[k].runs.push(Run {
                    error: e.error(&truth),
                    sigma: e.sigma(),
                    determined: e.determined,
                    settled_after: e.settled_after(),
                }),
            }
        }
    }
    rows
}

fn table(name: &str, rows: &[Row], seeds: &[u64]) {
    print::line(format_args!("{name}, {} runs: r.m.s. of the errors", seeds.len()));
    let mut table = print::table(&HEADINGS);
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
    print::right(&mut table, NUMBERS);
    print::line(&table);
    // the mean square of n ratios scatters by sqrt(2/n), its root by half of that
    let scatter = (0.5 / seeds.len() as f64).sqrt();
    // an interrupted list has gaps
    let whole = seeds
        .last()
        .zip(seeds.first())
        .filter(|(last, first)| *last - *first + 1 == seeds.len() as u64);
    let list = || seeds.iter().map(u64::to_string).collect::<Vec<_>>().join(", ");
    let told = whole.map_or_else(list, |(last, first)| format!("{first} to {last}"));
    print::line(format_args!("seeds {told}; error/sigma of an honest sigma is 1 +- {scatter:.2}"));
    print::line(settles() + "; its median");
    for row in rows {
        if let Some(why) = &row.refused {
            let times = seeds.len() - row.runs.len();
            print::line(format_args!(
                "{}: not possible in {times} of {} runs: {why}",
                row.name,
                seeds.len()
            ));
        }
    }
}

fn in_json(name: &str, rows: &[Row], seeds: &[u64]) -> Value {
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
                "rms_error_over_sigma": { "k": ratio[0], "roll": ratio[1], "pitch": ratio[2], "yaw": ratio[3] },
                "settled_after_s": row.settled_after(),
            })
        })
        .collect();
    json!({ "scenario": name, "seeds": seeds, "methods": methods })
}
