//! `navfuse calibrate`: the methods of the literature, and the filter, on the same samples.

use crate::arguments::Format;
use crate::print;
use crate::progress::Bar;
use crate::run::document_of;
use clap::{Args, ValueEnum};
use navfuse_calibration::{AttitudeSource, Data, Estimate, Method, Step};
use navfuse_core::document::Document;
use navfuse_core::manifold::{Manifold, Rotation, Scalar};
use navfuse_core::nalgebra::Matrix4;
use navfuse_core::record::Epoch;
use navfuse_core::registry::Registry;
use navfuse_core::runner::{self, Progress};
use navfuse_core::scenario::{Assembly, Scenario};
use navfuse_core::stream::{Purpose, RunInfo, Sink, StreamError};
use navfuse_core::time::Time;
use navfuse_segments::{Kind, Mounting, Recording};
use serde_json::{Value, json};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Arguments of `calibrate`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse calibrate scenarios/pan-wu-3d.toml                          IO-DVLC on simulated samples
  navfuse calibrate runs/dive/run.mcap --method all                   all methods and the filter on the samples of a log
  navfuse calibrate scenarios/calibration.toml --method all           the comparison on one simulated run with GNSS and depth
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
    let (mut document, settings) = document_of(&arguments.source)?;
    settings.iter().chain(&arguments.set).try_for_each(|s| document.set(s))?;
    let bar = Bar::new(text);
    let scenario = Scenario::new(registry, document.clone(), &[])?;
    let recording = Recording::gather(scenario.assemble(None)?, |now, end| bar.run(Progress { now, end }));
    let source = match arguments.attitude {
        From::Gyros => AttitudeSource::Gyros,
        From::Reference => AttitudeSource::Reference,
    };
    let recording = recording?;
    recording.warnings.iter().for_each(|w| print::warn(format_args!("warning: {w}")));
    let data = Data::new(recording, source)?;
    if data.rest() == 0.0 {
        print::warn(
            "warning: there is no time at rest: the gyro bias is not known, and the methods' sigma is optimistic",
        );
    }
    let methods: Vec<Method> = match arguments.method.as_str() {
        "all" => Method::ALL.to_vec(),
        "ekf" => Vec::new(),
        name => {
            vec![name.parse().map_err(|e: String| format!("--method: {}", e.replace(", and all", ", ekf and all")))?]
        }
    };
    if let (Some(_), Some(method)) = (&arguments.write, methods.first())
        && let Some(why) = method.sigma_not_a_prior()
    {
        return Err(format!(
            "--write: the sigma of {} is not to be a prior: {why}; use --method io-dvlc, or --initialise, which keeps the prior's",
            method.name()
        )
        .into());
    }
    let mut outcomes: Vec<Outcome> = (methods.iter())
        .map(|m| Outcome {
            name: m.name().into(),
            sensors: m.sensors().into(),
            result: m.estimate(&data).map_err(|e| e.to_string()),
        })
        .collect();
    if ["all", "ekf"].contains(&arguments.method.as_str()) {
        outcomes.extend(filters(registry, &document, &data, &bar)?);
    }
    bar.done();
    if let [Outcome { name, result: Err(why), .. }] = &outcomes[..] {
        return Err(format!("{name}: {why}").into());
    }
    if text {
        table(&data, &outcomes)
    } else {
        print::line(in_json(&data, &outcomes))
    }
    for (path, keep_prior) in [(&arguments.write, false), (&arguments.initialise, true)] {
        let (Some(path), Some(Outcome { result: Ok(estimate), name, .. })) = (path, outcomes.first()) else { continue };
        write(&mut document, path, &data, estimate, keep_prior)?;
        if text {
            print::line(format_args!("{name} to {}", path.display()));
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// The scenario's filter; and where it has other sensors than IMU and DVL, the filter without them too.
fn filters(registry: &Registry, document: &Document, data: &Data, bar: &Bar) -> Result<Vec<Outcome>> {
    let name = &data.velocity()?.samples.name;
    let scenario = Scenario::new(registry, document.clone(), &[])?;
    let sensors = scenario.compose()?.sensors;
    let others: Vec<&String> = (sensors.iter())
        .filter(|s| s.info.purpose == Purpose::Measurement && s.info.name != *name)
        .map(|s| &s.info.name)
        .collect();
    let list = |names: &[&String]| {
        let names = names.iter().map(|n| n.as_str());
        ["IMU", "DVL"].into_iter().chain(names).collect::<Vec<_>>().join(", ")
    };
    let mut out = vec![filter(scenario.assemble(None)?, "ekf", list(&others), data, bar)?];
    if !others.is_empty() {
        let settings: Vec<String> = others.iter().map(|o| format!("sensor.{o}.enabled=false")).collect();
        let alone = Scenario::new(registry, document.clone(), &settings)?;
        out.push(filter(alone.assemble(None)?, "ekf, IMU and DVL", list(&[]), data, bar)?);
    }
    Ok(out)
}

fn filter(mut assembly: Assembly, name: &str, sensors: String, data: &Data, bar: &Bar) -> Result<Outcome> {
    let dvl = &data.velocity()?.samples.name;
    let kept = Arc::new(Mutex::new(Kept::default()));
    assembly.sinks.push((
        "calibrate".into(),
        Box::new(Listener { dvl: dvl.clone(), zero: data.recording.zero, kept: Arc::clone(&kept) }),
    ));
    let finished = runner::run(assembly, &AtomicBool::new(false), |p| bar.run(p));
    let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
    let history = std::mem::take(&mut kept.history);
    let result = match (&finished.error, history.first().zip(history.last())) {
        (Some(error), _) => Err(error.to_string()),
        (None, None) => Err(format!("the filter has no {dvl}.scale and {dvl}.misalignment")),
        (None, Some((first, last))) => {
            let (mounting, used) = (last.mounting, [first.time, last.time]);
            let determined = std::array::from_fn(|i| kept.told[i]);
            Ok(Estimate { mounting, covariance: Some(kept.covariance), determined, history, used, notes: Vec::new() })
        }
    };
    Ok(Outcome { name: name.into(), sensors, result })
}

/// What a filter's run tells of the DVL.
#[derive(Default)]
struct Kept {
    history: Vec<Step>,
    covariance: Matrix4<f64>,
    told: [bool; 4],
}

struct Listener {
    dvl: String,
    /// Zero of the recording's clock.
    zero: Time,
    kept: Arc<Mutex<Kept>>,
}

impl Sink for Listener {
    fn start(&mut self, _: &RunInfo) -> std::result::Result<(), StreamError> {
        Ok(())
    }

    fn epoch(&mut self, epoch: &Epoch<'_>) -> std::result::Result<(), StreamError> {
        let block = |name: &str| epoch.layout.find(&format!("{}.{name}", self.dvl));
        let (Some(scale), Some(misalignment)) = (block("scale"), block("misalignment")) else { return Ok(()) };
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let values = &epoch.state.values;
        let k = Scalar::load::<f64>(&values[scale.range()]);
        let mounting = Mounting { k, c_b_d: Rotation::load::<f64>(&values[misalignment.range()]) };
        kept.history.push(Step { time: epoch.state.time.since(self.zero), mounting });
        // the error of a rotation is a rotation vector to its left, as an estimate's is
        let places: Vec<Option<usize>> =
            std::iter::once(scale.tangent).chain((0..3).map(|i| misalignment.tangent.map(|t| t + i))).collect();
        let at = |i: usize, j: usize| places[i].zip(places[j]).map_or(0.0, |(a, b)| epoch.covariance.get(a, b));
        kept.covariance = Matrix4::from_fn(at);
        // half of the prior says that the samples told something
        let prior = [scale.spec.sigma[0]].into_iter().chain(misalignment.spec.sigma.iter().copied());
        let told: Vec<bool> = prior.enumerate().map(|(i, s)| at(i, i).sqrt() < 0.5 * s).collect();
        kept.told = std::array::from_fn(|i| told.get(i).copied().unwrap_or(false));
        Ok(())
    }

    fn finish(&mut self) -> std::result::Result<Option<String>, StreamError> {
        Ok(None)
    }
}

/// Degrees for angles, nothing for `k`.
fn unit(i: usize) -> f64 {
    if i == 0 { 1.0 } else { 1_f64.to_degrees() }
}

fn table(data: &Data, outcomes: &[Outcome]) {
    print::line(format_args!("{}: {}", data.recording.name, found(data)));
    let truth = data.velocity().ok().and_then(|v| v.truth);
    let mut table = print::table(&["method", "k", "roll deg", "pitch deg", "yaw deg", "settles after", "sensors"]);
    for outcome in outcomes {
        let Ok(e) = &outcome.result else { continue };
        let (values, sigma) = (e.values(), e.sigma());
        let cell = |i: usize, v: f64| {
            let decimals = if i == 0 { 5 } else { 3 };
            let sigma = sigma
                .filter(|_| e.determined[i])
                .map_or_else(String::new, |s| format!(" ± {:.decimals$}", s[i] * unit(i)));
            if e.determined[i] { format!("{:.decimals$}{sigma}", v * unit(i)) } else { "-".to_owned() }
        };
        let settled = e.settled_after().map_or_else(String::new, |t| format!("{t:.0} s"));
        let cells: Vec<String> = (0..4).map(|i| cell(i, values[i])).collect();
        let sensors = [settled, outcome.sensors.clone()];
        table.add_row([std::slice::from_ref(&outcome.name), &cells[..], &sensors].concat());
        if let Some(truth) = &truth {
            let error = e.error(truth);
            let cell = |i: usize| {
                let decimals = if i == 0 { 5 } else { 3 };
                if e.determined[i] { format!("{:+.decimals$}", error[i] * unit(i)) } else { String::new() }
            };
            let cells: Vec<String> = (0..4).map(cell).collect();
            table.add_row([&["  error".to_owned()], &cells[..], &[String::new(), String::new()]].concat());
        }
    }
    print::right(&mut table, 1..6);
    print::line(&table);
    if let Some(t) = truth {
        let a = t.angles().map(f64::to_degrees);
        print::line(format_args!("truth: k {:.5}, roll {:.3}, pitch {:.3}, yaw {:.3} deg", t.k, a.x, a.y, a.z));
    }
    let (k, yaw) = Estimate::SETTLED;
    print::line(format_args!(
        "settles: k within {k} and yaw within {:.1} deg of the end from then on; -: not determined",
        yaw.to_degrees()
    ));
    for outcome in outcomes {
        match &outcome.result {
            Ok(e) => e.notes.iter().for_each(|n| print::line(format_args!("{}: {n}", outcome.name))),
            Err(why) => print::line(format_args!("{}: not possible: {why}", outcome.name)),
        }
    }
}

/// The segments that were found, in words.
fn found(data: &Data) -> String {
    let of = |kind: Kind| format!("{kind} {:.0} s ({})", data.duration(kind), data.of(kind).count());
    let kinds = [Kind::Static, Kind::TypeI, Kind::TypeII, Kind::Steady].map(of);
    kinds.join(", ")
}

fn in_json(data: &Data, outcomes: &[Outcome]) -> Value {
    let truth = data.velocity().ok().and_then(|v| v.truth);
    let named = |v: [f64; 4]| {
        let deg = |i: usize| v[i] * unit(i);
        json!({ "k": v[0], "roll_deg": deg(1), "pitch_deg": deg(2), "yaw_deg": deg(3) })
    };
    let methods: Vec<Value> = (outcomes.iter())
        .map(|o| match &o.result {
            Err(why) => json!({ "method": o.name, "sensors": o.sensors, "needs": why }),
            Ok(e) => json!({
                "method": o.name,
                "sensors": o.sensors,
                "estimate": named(e.values()),
                "sigma": e.sigma().map(named),
                "error": truth.as_ref().map(|t| named(e.error(t))),
                "determined": e.determined,
                "settled_after_s": e.settled_after(),
                "used_s": e.used.map(|t| data.recording.clock(t)),
                "notes": e.notes,
            }),
        })
        .collect();
    json!({ "scenario": data.recording.name, "segments": data.segments, "attitude": data.attitude_told(), "methods": methods })
}

/// Writes the scenario with what was found in it. What is not determined stays as it is.
fn write(document: &mut Document, path: &Path, data: &Data, e: &Estimate, keep_prior: bool) -> Result<()> {
    let velocity = data.velocity()?;
    let name = &velocity.samples.name;
    let (found, initial) = (e.values(), velocity.initial.angles());
    let (before, prior) = ([velocity.initial.k, initial.x, initial.y, initial.z], velocity.angle_sigma);
    let prior = [velocity.scale_sigma, prior.x, prior.y, prior.z];
    let value = |i: usize| if e.determined[i] { found[i] } else { before[i] };
    let sigma = |i: usize| match e.sigma() {
        Some(s) if !keep_prior && e.determined[i] => s[i],
        _ => prior[i],
    };
    if !keep_prior && e.sigma().is_none() {
        return Err(
            "this method has no sigma to write: use --method io-dvlc, or --initialise, which keeps the prior's".into(),
        );
    }
    let degrees = |x: f64| format!("\"{:.6} deg\"", x.to_degrees());
    let angles = |of: &dyn Fn(usize) -> f64| format!("[{}]", [1, 2, 3].map(|i| degrees(of(i))).join(", "));
    let mut set = |block: &str, initial: String, sigma: String| -> Result<()> {
        let whole = document.root().get("sensor").and_then(|s| s.get(name)).and_then(|s| s.get(block));
        if whole.is_some_and(|node| node.value().is_table()) {
            document.set(&format!("sensor.{name}.{block}.initial={initial}"))?;
            document.set(&format!("sensor.{name}.{block}.sigma={sigma}"))?;
        } else {
            document.set(&format!("sensor.{name}.{block}={{ initial = {initial}, sigma = {sigma} }}"))?;
        }
        Ok(())
    };
    if sigma(0) > 0.0 {
        set("scale", format!("{:.8}", value(0)), format!("{:.8}", sigma(0)))?;
    }
    if (1..4).all(|i| sigma(i) > 0.0) {
        set("misalignment", angles(&value), angles(&sigma))?;
    }
    std::fs::write(path, document.to_toml()).map_err(|e| format!("{}: cannot be written: {e}", path.display()))?;
    Ok(())
}
