//! `navfuse import`.

use crate::error::{CommandError, Result};
use crate::execution::campaign::threads;
use crate::output;
use crate::output::progress::{Bar, INTERRUPTED, stop_on_signal};
use clap::{Args, ValueEnum};
use navfuse_core::document::{Document, file_remedy};
use navfuse_core::input::text_of;
use navfuse_core::plugin::Registry;
use navfuse_import::{Answers, Heading, Imported, OdometryUse, StreamSurvey};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

/// 1-sigma of a heading that is given without one, deg.
const HEADING: f64 = 5.0;

/// Arguments of `import`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse import imu.csv dvl.csv depth.csv reference.csv --out dive.toml
  navfuse import imu.csv dive-7.pd0 nav.nmea
  navfuse import imu.csv --position 34.246048,108.909664,380
  navfuse import imu.csv pool.json --heading relative      no sensor shows north
  navfuse import dive/      a bag of ROS 2: its folder, or one of its files

Files are recognised by their content: tables with a heading for each column (CSV), solutions of \
RTKLIB, files of Doppler velocity logs, NMEA 0183, logs of vehicles (PX4 ULog, MAVLink, NovAtel, \
VectorNav, SBET, KF-GINS), text of KF-GINS and SBG, and bags of ROS 2. The scenario runs at \
once. Lines with values that no file gives are marked with ANSWER.")]
pub struct Import {
    /// The files of the recording
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// The scenario, a new file [default: import.toml]
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Latitude and longitude (deg) and height (m) at the start, where no file gives them
    #[arg(long, value_name = "LAT,LON,HEIGHT", allow_hyphen_values = true)]
    pub position: Option<String>,
    /// Heading at the start (deg) and its 1-sigma, 5 deg by default, where no sensor shows it; with
    /// `relative`, headings and the track count from the heading at the start
    #[arg(long, value_name = "DEG[,SIGMA]|relative", allow_hyphen_values = true)]
    pub heading: Option<String>,
    /// Use of an odometry in a bag: a sensor of the motion between its messages, or the reference
    /// [default: relative-pose where the files have GNSS or a reference, else reference]
    #[arg(long, value_name = "USE")]
    pub odometry: Option<Odometry>,
}

/// Use of an odometry in a bag.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Odometry {
    /// Sensor of the motion since the previous message
    RelativePose,
    /// Reference, from which the filter starts and with which it is compared
    Reference,
}

/// Looks at the files of a recording, and writes a scenario for them.
pub fn import(registry: &Registry, arguments: &Import) -> Result<ExitCode> {
    let out = arguments.out.clone().unwrap_or_else(|| PathBuf::from("import.toml"));
    output::check(&out)?;
    for file in &arguments.files {
        let there = text_of(file).and_then(|_| std::fs::metadata(file));
        there.map_err(|error| {
            let extension = file.extension().map_or("csv".into(), OsStr::to_string_lossy);
            let remedy = file_remedy(file, &extension, &error);
            CommandError::file(file, "cannot be read", remedy)(error)
        })?;
    }
    let name = out.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    let position = arguments.position.as_deref().map(position).transpose()?;
    let heading = arguments.heading.as_deref().map(heading).transpose()?;
    let odometry = arguments.odometry.map(|usage| match usage {
        Odometry::RelativePose => OdometryUse::RelativePose,
        Odometry::Reference => OdometryUse::Reference,
    });
    let answers = Answers { name, position, heading, odometry };
    let stop = stop_on_signal();
    let imported = navfuse_import::import(registry, &arguments.files, &out, &answers, &stop)?;
    let Some(mut imported) = imported else { return Ok(ExitCode::from(INTERRUPTED)) };
    decide(registry, &out, &mut imported, &stop)?;
    if stop.load(Ordering::Relaxed) {
        return Ok(ExitCode::from(INTERRUPTED));
    }
    output::write(&out, &imported.scenario)?;
    print(&imported);
    output::line(next(&out, imported.questions.len()));
    Ok(ExitCode::SUCCESS)
}

/// Answers questions as the samples do, where they decide between a few answers: one after another, the clearest
/// first.
fn decide(
    registry: &Registry,
    out: &Path,
    imported: &mut Imported,
    stop: &AtomicBool,
) -> Result<()> {
    while !imported.alternatives.is_empty() {
        let document = Document::parse(out.display().to_string(), imported.scenario.clone())?;
        let answers = &imported.alternatives;
        let (bar, threads) = (Bar::new(true), threads(None)?);
        let show = |done, all| bar.trials(done, all);
        let found = navfuse_diagnose::likeliest(registry, &document, answers, threads, stop, &show);
        bar.done();
        let Some(answer) = found?.cloned() else { return Ok(()) };
        imported.scenario =
            navfuse_diagnose::apply(&imported.scenario, std::slice::from_ref(&answer))?;
        imported.notes.push(format!("of a few answers the samples are likeliest with {answer}"));
        let key = |answer: &str| answer.split('=').next().map(str::to_owned);
        imported.alternatives.retain(|other| key(other) != key(&answer));
    }
    Ok(())
}

/// The scenario, the number of guesses in it, and the command that follows.
fn next(out: &Path, guesses: usize) -> String {
    let out = out.display();
    let check = match guesses {
        0 => String::new(),
        1 => "check the guess marked ANSWER, then ".to_owned(),
        n => format!("check the {n} guesses marked ANSWER, then "),
    };
    format!("scenario {out}: {check}`navfuse run {out}`")
}

/// Three numbers with commas.
fn position(text: &str) -> Result<[f64; 3]> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    let inside = |n: &[f64; 3]| n[0].abs() < 90.0 && n[1].abs() <= 360.0 && n[2].abs() < 1e5;
    numbers.and_then(|n| <[f64; 3]>::try_from(n).ok()).filter(inside).ok_or_else(|| {
        let message = "latitude, longitude (deg) and height (m) are needed, such as 54.5,10.2,0";
        CommandError::argument(format!("--position {text:?}"), message)
    })
}

/// A heading with its 1-sigma, or `relative`.
fn heading(text: &str) -> Result<Heading> {
    let mut numbers = text.split(',').map(|n| n.trim().parse::<f64>());
    let known = match (numbers.next(), numbers.next(), numbers.next()) {
        (Some(Ok(heading)), None, None) => Some((heading, HEADING)),
        (Some(Ok(heading)), Some(Ok(sigma)), None) => Some((heading, sigma)),
        _ => None,
    };
    let inside =
        |(heading, sigma): &(f64, f64)| heading.abs() <= 360.0 && (0.01..=180.0).contains(sigma);
    match known.filter(inside) {
        Some((heading, sigma)) => Ok(Heading::Known(heading, sigma)),
        None if text == "relative" => Ok(Heading::Relative),
        None => {
            let message = "a heading and its 1-sigma (deg) are needed, such as 75,3, or `relative`";
            Err(CommandError::argument(format!("--heading {text:?}"), message))
        }
    }
}

fn print(imported: &Imported) {
    let mut table = output::table(&["sensor", "samples", "rate", "from", "to", "gaps", "longest"]);
    let mut notes = imported.notes.clone();
    for stream in &imported.streams {
        let StreamSurvey { sensor, samples, span, gaps, .. } = stream;
        if *samples == 0 {
            notes.push(format!("{sensor}: no sample"));
            continue;
        }
        table.add_row([
            sensor.clone(),
            samples.to_string(),
            format!("{:.4} Hz", stream.rate()),
            span[0].to_string(),
            span[1].to_string(),
            gaps.0.to_string(),
            if gaps.0 > 0 { format!("{:.3} s", gaps.1) } else { String::new() },
        ]);
        notes.extend(stream.warnings.iter().map(|w| format!("{sensor}: {w}")));
    }
    output::line(table);
    notes.iter().for_each(|note| output::warn(format_args!("note: {note}")));
    for question in &imported.questions {
        output::line(format_args!("answer: {question}"));
    }
}
