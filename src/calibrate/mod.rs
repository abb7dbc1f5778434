//! `navfuse calibrate`: the methods of the literature, and the filter, on the same samples.

mod filter;
mod runs;
mod table;
mod write;

use crate::arguments::Format;
use crate::print;
use crate::progress::Bar;
use crate::run::document_of;
use clap::{Args, ValueEnum};
use navfuse_calibration::{AttitudeSource, CalibrationData, Estimate, Method, MethodError};
use navfuse_core::document::Document;
use navfuse_core::plugin::Registry;
use navfuse_core::run::runner::Progress;
use navfuse_core::run::scenario::Scenario;
use navfuse_segments::Recording;
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Arguments of `calibrate`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse calibrate scenarios/pan-wu-3d.toml                          IO-DVLC on simulated samples
  navfuse calibrate runs/dive/run.mcap --method all                   all methods and the filter on the samples of a log
  navfuse calibrate scenarios/calibration.toml --method all           the comparison on one simulated run with GNSS and depth
  navfuse calibrate scenarios/calibration.toml --method all --runs 20 its errors over 20 seeds, and whether its sigma is theirs
  navfuse calibrate dive.toml --write next.toml                       values and sigma, for the next dive
  navfuse calibrate dive.toml --initialise again.toml                 values alone, to run the filter again on this dive

Methods:
  io-dvlc           Pan & Wu (2016), improved     IMU and DVL: constant attitude, force varying in two directions
  io-dvlc-printed   eq. (18) as printed           as above; single samples as anchors, no sigma
  troni             Troni & Whitcomb (2010)       IMU, DVL, attitude, depth where there is one
  troni-printed     gravity's change left out     as above
  kinsey-2006       Kinsey & Whitcomb (2006)      DVL, attitude, position fixes; misalignment only
  kinsey-2007       Kinsey & Whitcomb (2007)      DVL, attitude, position fixes
  joyce             Joyce (1989)                  DVL, heading, GNSS; scale factor and yaw only
  tang              Tang et al. (2013)            DVL, attitude, GNSS
  ekf               the scenario's filter         what the scenario has")]
pub struct Calibrate {
    /// The scenario, a TOML file, or a log, an MCAP file that navfuse wrote
    pub source: PathBuf,
    /// A method, `ekf`, or `all`
    #[arg(long, value_name = "NAME", default_value = "io-dvlc")]
    pub method: String,
    /// Where the methods take the attitude from
    #[arg(long, value_enum, default_value_t = From::Gyros)]
    pub attitude: From,
    /// Change a value of the scenario; may be given again
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// Repeat it with so many seeds, from the scenario's on, and print r.m.s. errors; the samples must be simulated
    #[arg(long, value_name = "N", conflicts_with_all = ["write", "initialise"])]
    pub runs: Option<u64>,
    /// Write the scenario with the estimate and its sigma as the DVL's prior: for other data than these
    #[arg(long, value_name = "FILE", conflicts_with = "initialise")]
    pub write: Option<PathBuf>,
    /// Write the scenario with the estimate as the DVL's initial value, its prior sigma as it was: for the same data
    #[arg(long, value_name = "FILE")]
    pub initialise: Option<PathBuf>,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub format: Format,
}

/// Where the attitude comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum From {
    /// The gyros, from the first attitude of the reference, or the scenario's initial one
    Gyros,
    /// The reference; that of a simulation is the truth
    Reference,
}

/// A method's result, or why it has none.
struct Outcome {
    name: String,
    sensors: String,
    result: std::result::Result<Estimate, String>,
}

/// `navfuse calibrate`
pub fn calibrate(registry: &Registry, arguments: &Calibrate) -> Result<ExitCode> {
    let text = arguments.format == Format::Text;
    let methods = methods(&arguments.method)?;
    if let (Some(_), Some(method)) = (&arguments.write, methods.first())
        && let Some(why) = method.sigma_not_a_prior()
    {
        return Err(format!(
            "--write: the sigma of {} is not to be a prior: {why}; use --method io-dvlc, or --initialise, which keeps the prior's",
            method.name()
        )
        .into());
    }
    let (mut document, settings) = document_of(&arguments.source)?;
    settings.iter().chain(&arguments.set).try_for_each(|s| document.set(s))?;
    if let Some(count) = arguments.runs {
        return runs::repeat(registry, &document, &methods, arguments, count);
    }
    let bar = Bar::new(text);
    let (data, outcomes) = outcomes(registry, &document, &methods, arguments, &|p| bar.run(p))?;
    bar.done();
    data.recording.warnings.iter().for_each(|w| print::warn(format_args!("warning: {w}")));
    if data.rest() == 0.0 && !methods.is_empty() {
        print::warn(
            "warning: there is no time at rest: the gyro bias is not known, and the methods' sigma is optimistic",
        );
    }
    let needs_rest = |m: &&Method| **m == Method::IoDvlc || arguments.attitude == From::Gyros;
    if let (Some(_), Some(method), true) =
        (&arguments.write, methods.first().filter(needs_rest), data.rest() == 0.0)
    {
        return Err(format!(
            "--write: the sigma of {} is not to be a prior: without rest the gyro bias is not known, and the errors may be \
             several times larger; use --method ekf, which estimates the bias, or --initialise, which keeps the prior's",
            method.name()
        )
        .into());
    }
    if let [Outcome { name, result: Err(why), .. }] = &outcomes[..] {
        return Err(format!("{name}: {why}").into());
    }
    if text {
        table::print(&data, &outcomes)
    } else {
        print::line(table::in_json(&data, &outcomes))
    }
    for (path, keep_prior) in [(&arguments.write, false), (&arguments.initialise, true)] {
        let (Some(path), Some(Outcome { result: Ok(estimate), name, .. })) =
            (path, outcomes.first())
        else {
            continue;
        };
        write::scenario(&mut document, path, &data, estimate, keep_prior)?;
        if text {
            print::line(format_args!("{name} to {}", path.display()));
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// The methods that a name asks for, without the filter.
fn methods(name: &str) -> Result<Vec<Method>> {
    match name {
        "all" => Ok(Method::ALL.to_vec()),
        "ekf" => Ok(Vec::new()),
        name => {
            Ok(vec![name.parse().map_err(|e: MethodError| format!("--method: {e}, ekf and all"))?])
        }
    }
}

/// What the methods, and the filter where it is asked for, make of the samples of a scenario.
fn outcomes(
    registry: &Registry,
    document: &Document,
    methods: &[Method],
    arguments: &Calibrate,
    progress: &dyn Fn(Progress),
) -> Result<(CalibrationData, Vec<Outcome>)> {
    let scenario = Scenario::new(registry, document.clone(), &[])?;
    let recording =
        Recording::gather(scenario.assemble(None)?, |now, end| progress(Progress { now, end }))?;
    let source = match arguments.attitude {
        From::Gyros => AttitudeSource::Gyros,
        From::Reference => AttitudeSource::Reference,
    };
    let data = CalibrationData::new(recording, source)?;
    let outcome = |m: &Method| Outcome {
        name: m.name().into(),
        sensors: m.sensors().into(),
        result: m.estimate(&data).map_err(|e| e.to_string()),
    };
    let mut outcomes: Vec<Outcome> = methods.iter().map(outcome).collect();
    if ["all", "ekf"].contains(&arguments.method.as_str()) {
        outcomes.extend(filter::outcomes(registry, document, &data, progress)?);
    }
    Ok((data, outcomes))
}

/// Degrees for angles, nothing for `k`.
fn unit(i: usize) -> f64 {
    if i == 0 { 1.0 } else { 1_f64.to_degrees() }
}

/// Decimals of `k`, and of an angle in degrees.
fn decimals(i: usize) -> usize {
    if i == 0 { 5 } else { 3 }
}
