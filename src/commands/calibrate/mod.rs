//! `navfuse calibrate`: the methods of the literature, and the filter, on the same samples.

mod apply;
mod edit;
mod filter;
mod outcome;
mod runs;
mod table;
mod write;

use crate::error::{CommandError, Result};
use crate::execution::input::document_of;
use crate::output::progress::Bar;
use crate::output::{self, Format, write_files};
use apply::{Request, outcomes};
use clap::{Args, ValueEnum};
use navfuse_calibration::{AttitudeSource, CalibrationData, Method, MethodError};
use navfuse_core::document::Document;
use navfuse_core::plugin::Registry;
use navfuse_core::run::runner::Progress;
use navfuse_report::calibration::{self, Applied};
use outcome::Outcome;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Arguments of `calibrate`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse calibrate scenarios/pan-wu-3d.toml       IO-DVLC on simulated samples
  navfuse calibrate dive.mcap --method all         all methods, on a log
  # errors against sigma over 20 seeds, with GNSS and depth
  navfuse calibrate scenarios/calibration.toml --method all --runs 20
  navfuse calibrate dive.mcap --method all --out runs/dive  the same as a page
  # values and sigma for the next dive; values alone, to filter this dive again
  navfuse calibrate dive.toml --write next.toml
  navfuse calibrate dive.toml --initialise again.toml

Methods:
  io-dvlc          Pan & Wu (2016), improved  IMU and DVL: constant attitude,
                                              force that varies in 2 directions
  io-dvlc-printed  eq. (18) as printed        the same, from single samples
  troni            Troni & Whitcomb (2010)    IMU, DVL, attitude, depth if given
  troni-printed    gravity's change left out  the same
  kinsey-2006      Kinsey & Whitcomb (2006)   DVL, attitude, fixes; angles alone
  kinsey-2007      Kinsey & Whitcomb (2007)   DVL, attitude, position fixes
  joyce            Joyce (1989)               DVL, heading, GNSS; scale and yaw
  tang             Tang et al. (2013)         DVL, attitude, GNSS
  ekf              the scenario's filter      all sensors of the scenario")]
pub struct Calibrate {
    /// The scenario, a TOML file, or a log, an MCAP file that navfuse wrote
    #[arg(value_name = "SCENARIO|LOG")]
    pub source: PathBuf,
    /// A method, `ekf`, or `all`
    #[arg(long, value_name = "NAME", default_value = "io-dvlc")]
    pub method: String,
    /// Source of the attitude that the methods use
    #[arg(long, value_enum, default_value_t = From::Gyros)]
    pub attitude: From,
    /// Change a value of the scenario; may be given again
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// Repeat with N seeds, the scenario's first, and print r.m.s. errors; the samples must be
    /// simulated
    #[arg(long, value_name = "N", conflicts_with_all = ["write", "initialise"])]
    pub runs: Option<u64>,
    /// Write the scenario with the estimate and its sigma as the DVL's prior, to run it on other data
    #[arg(long, value_name = "FILE", conflicts_with = "initialise")]
    pub write: Option<PathBuf>,
    /// Write the scenario with the estimate as the DVL's initial value and the prior sigma unchanged,
    /// to run it on the same data
    #[arg(long, value_name = "FILE")]
    pub initialise: Option<PathBuf>,
    /// Folder for a page (HTML) and the numbers (JSON)
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Form of the result
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub format: Format,
}

/// Source of the attitude.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum From {
    /// The gyros, from the first attitude of the reference or the initial one of the scenario
    Gyros,
    /// The reference; in a simulation it is the truth
    Reference,
}

/// Calibrates the DVL on the samples of a scenario or a log.
pub fn calibrate(registry: &Registry, arguments: &Calibrate) -> Result<ExitCode> {
    let text = arguments.format == Format::Text;
    [&arguments.write, &arguments.initialise]
        .into_iter()
        .flatten()
        .try_for_each(|o| output::check(o))?;
    let request = request(&arguments.method, arguments.attitude)?;
    let method = request.methods.first().copied();
    if let (true, Some(method)) = (arguments.write.is_some(), method)
        && let Some(why) = method.sigma_not_a_prior()
    {
        return Err(no_prior(method, why, "use --method io-dvlc"));
    }
    let (mut document, settings) = document_of(&arguments.source)?;
    settings.iter().chain(&arguments.set).try_for_each(|s| document.set(s))?;
    if let Some(count) = arguments.runs {
        let out = arguments.out.as_deref();
        return runs::repeat(registry, &document, &request, count, out, text);
    }
    let bar = Bar::new(text);
    let (data, outcomes) = outcomes(registry, &document, &request, &|p| bar.run(p))?;
    bar.done();
    print_warnings(&data, &request);
    check_rest(arguments, method, &data)?;
    let outcomes = single_failure(outcomes)?;
    if text {
        table::print(&data, &outcomes);
    } else {
        output::line(table::in_json(&data, &outcomes));
    }
    if let Some(out) = &arguments.out {
        write_page(&document, &data, &outcomes, out, text)?;
    }
    for (path, keep_prior) in [(&arguments.write, false), (&arguments.initialise, true)] {
        let (Some(path), Some(Outcome { result: Ok(estimate), name, .. })) =
            (path, outcomes.first())
        else {
            continue;
        };
        write::scenario(&mut document, path, &data, estimate, keep_prior)?;
        if text {
            output::line(format_args!("{name} to {}", path.display()));
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Writes the page of the methods' results, and their numbers.
fn write_page(
    document: &Document,
    data: &CalibrationData,
    outcomes: &[Outcome],
    out: &Path,
    shown: bool,
) -> Result<()> {
    let applied = outcomes.iter().map(|outcome| {
        let (name, result) = outcome.named();
        Applied { name, sensors: &outcome.sensors, result }
    });
    let page = calibration::page(&edit::text(document)?, data, &applied.collect::<Vec<_>>())?;
    let numbers = serde_json::to_string_pretty(&table::in_json(data, outcomes))?;
    write_files(out, files(numbers, page), shown)
}

/// The files of a calibration, each with its name.
fn files(numbers: String, page: String) -> [(String, String); 2] {
    [("calibration.json".to_owned(), numbers), ("calibration.html".to_owned(), page)]
}

/// Calibrates the DVL by a method, by the filter (`ekf`), or by all. The result is what `calibrate
/// --format json` prints.
///
/// # Errors
/// When there is no such method, the scenario does not fit, or the one method gives no estimate.
pub fn calibration(
    registry: &Registry,
    document: &Document,
    method: &str,
    attitude: From,
    progress: &dyn Fn(Progress),
) -> Result<Value> {
    let request = request(method, attitude)?;
    let (data, outcomes) = outcomes(registry, document, &request, progress)?;
    Ok(table::in_json(&data, &single_failure(outcomes)?))
}

/// The methods of a name.
fn request(name: &str, attitude: From) -> Result<Request> {
    let methods = match name {
        "all" => Method::ALL.to_vec(),
        "ekf" => Vec::new(),
        name => vec![name.parse().map_err(|e: MethodError| {
            CommandError::argument("--method", format!("{e}, ekf and all"))
        })?],
    };
    let attitude = match attitude {
        From::Gyros => AttitudeSource::Gyros,
        From::Reference => AttitudeSource::Reference,
    };
    Ok(Request { methods, attitude, filter: ["all", "ekf"].contains(&name) })
}

/// The error of `--write` with a method whose sigma cannot serve as a prior.
fn no_prior(method: Method, why: &str, remedy: &str) -> CommandError {
    CommandError::argument(
        "--write",
        format!(
            "the sigma of {} cannot serve as a prior: {why}; {remedy}, or --initialise, which \
             keeps the prior",
            method.name()
        ),
    )
}

/// Prints the warnings of the recording, and one where the gyro bias is unknown.
fn print_warnings(data: &CalibrationData, request: &Request) {
    data.recording.warnings.iter().for_each(|w| output::warn(format_args!("warning: {w}")));
    if data.rest() == 0.0 && !request.methods.is_empty() {
        output::warn(
            "warning: there is no time at rest: the gyro bias is not known, and the methods' sigma \
             is optimistic",
        );
    }
}

/// Rejects `--write` for a method that needs the gyro bias where no time at rest gives it.
fn check_rest(arguments: &Calibrate, method: Option<Method>, data: &CalibrationData) -> Result<()> {
    let needs_rest = |m: &Method| *m == Method::IoDvlc || arguments.attitude == From::Gyros;
    match method.filter(needs_rest) {
        Some(method) if arguments.write.is_some() && data.rest() == 0.0 => Err(no_prior(
            method,
            "without rest the gyro bias is not known, and the errors may be several times larger",
            "use --method ekf, which estimates the bias",
        )),
        _ => Ok(()),
    }
}

/// The outcomes, or the error of the only method.
fn single_failure(mut outcomes: Vec<Outcome>) -> Result<Vec<Outcome>> {
    if let [Outcome { result: Err(_), .. }] = &outcomes[..]
        && let Some(Outcome { name, result: Err(error), .. }) = outcomes.pop()
    {
        return Err(CommandError::Method { name, source: Box::new(error) });
    }
    Ok(outcomes)
}
