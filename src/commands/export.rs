//! `navfuse export`.

use crate::error::{CommandError, Result};
use crate::execution::input::{document_of, log_of, missing_log};
use crate::output;
use crate::output::progress::{Bar, INTERRUPTED, stop_on_signal};
use clap::{Args, ValueEnum};
use navfuse_core::model::stream::Sink;
use navfuse_core::plugin::Registry;
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::units::Date;
use navfuse_export::{Axes, BagSink, Format, Options, Table, TableSink, UtcClock};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

/// Arguments of `export`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse export runs/dive --to geojson             writes runs/dive/run.geojson
  navfuse export runs/dive/run.mcap --to csv        every state, full covariance
  navfuse export dive.mcap --to sbet --origin 2026-06-01T08:00:00Z
  navfuse export dive.mcap --to ros2 --origin 2026-06-01T08:00:00Z --out bag

geojson, kml, gpx, nmea, sbet, tum and kitti contain position, velocity and attitude from the \
log. csv and parquet contain every state with its full covariance, ros2 contains pose and \
velocity with their covariances. For these three, the filter runs the scenario in the log again \
on its samples.")]
pub struct Export {
    /// A log, which is an MCAP file that navfuse wrote, or the folder of a run with one
    pub log: PathBuf,
    /// The format
    #[arg(long, value_enum, value_name = "FORMAT")]
    pub to: To,
    /// The file, or the folder of ros2 [default: beside the log, with the ending of the format]
    #[arg(long, visible_alias = "output", value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// UTC of the run's zero; without it, times of the run count from 1970, as in ROS 2
    #[arg(long, value_name = "DATE")]
    pub origin: Option<Date>,
    /// Axes of csv, parquet, tum and kitti
    #[arg(long, value_enum, default_value = "ned")]
    pub axes: ToAxes,
}

/// A format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum To {
    /// GeoJSON: the track, and a point with all properties for each epoch
    Geojson,
    /// KML: the track
    Kml,
    /// GPX: the track
    Gpx,
    /// Trajectory of the TUM benchmark, for evo
    Tum,
    /// Trajectory of the KITTI benchmark, for evo
    Kitti,
    /// Table of every state with its full covariance
    Csv,
    /// NMEA 0183: GGA, GST, RMC, HDT, PASHR, ZDA
    Nmea,
    /// SBET of Applanix, and its file of accuracies
    Sbet,
    /// Table as csv, in double precision
    Parquet,
    /// Bag of ROS 2 with odometry, fix and transform, in the axes of REP 103
    Ros2,
}

/// Axes of vectors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ToAxes {
    /// North, east, down; the body of a trajectory forward, right, down
    Ned,
    /// East, north, up; the body of a trajectory forward, left, up
    Enu,
}

impl ToAxes {
    fn axes(self) -> Axes {
        match self {
            Self::Ned => Axes::Ned,
            Self::Enu => Axes::Enu,
        }
    }
}

/// The writer of a format.
enum Writer {
    Track(Format),
    Table(Table),
    Bag,
}

impl To {
    fn writer(self) -> Writer {
        match self {
            Self::Geojson => Writer::Track(Format::GeoJson),
            Self::Kml => Writer::Track(Format::Kml),
            Self::Gpx => Writer::Track(Format::Gpx),
            Self::Tum => Writer::Track(Format::Tum),
            Self::Kitti => Writer::Track(Format::Kitti),
            Self::Nmea => Writer::Track(Format::Nmea),
            Self::Sbet => Writer::Track(Format::Sbet),
            Self::Csv => Writer::Table(Table::Csv),
            Self::Parquet => Writer::Table(Table::Parquet),
            Self::Ros2 => Writer::Bag,
        }
    }
}

/// Writes the estimates of a log in another format.
pub fn export(registry: &Registry, arguments: &Export) -> Result<ExitCode> {
    let arguments = &Export { log: log_of(&arguments.log)?, ..arguments.clone() };
    let (log, stop) = (&arguments.log, stop_on_signal());
    navfuse_core::input::open(log).map_err(missing_log(log))?;
    let uses_axes = matches!(arguments.to, To::Tum | To::Kitti | To::Csv | To::Parquet);
    if arguments.axes != ToAxes::Ned && !uses_axes {
        let message = "only csv, parquet, tum and kitti have axes";
        return Err(CommandError::argument("--axes", message));
    }
    match arguments.to.writer() {
        Writer::Track(format) => {
            let file = place(arguments, format.extension())?;
            track(arguments, format, &file, &stop)
        }
        Writer::Table(format) => {
            let file = place(arguments, format.extension())?;
            let sink = TableSink::new(&file, format, arguments.axes.axes());
            let epochs = |sink: &TableSink| sink.whole.then_some(sink.epochs);
            again(registry, arguments, sink, epochs, &file, &stop)
        }
        Writer::Bag => {
            let folder = place(arguments, "ros2")?;
            let sink = BagSink::new(&folder, arguments.origin.map_or(0, |date| date.nanos));
            let epochs = |sink: &BagSink| sink.whole.then_some(sink.epochs);
            again(registry, arguments, sink, epochs, &folder, &stop)
        }
    }
}

/// The path of the file, whose folder is made.
fn place(arguments: &Export, extension: &str) -> Result<PathBuf> {
    let log = &arguments.log;
    // of run.mcap and of run.mcap.part
    let name = if log.extension().is_some_and(|e| e == "part") {
        log.with_extension("")
    } else {
        log.clone()
    };
    let file = arguments.out.clone().unwrap_or_else(|| name.with_extension(extension));
    output::check(&file)?;
    let folder = file.parent().filter(|p| !p.as_os_str().is_empty());
    let made = folder.map_or(Ok(()), std::fs::create_dir_all);
    made.map_err(CommandError::file(&file, "cannot be written", "; give another with --out"))?;
    Ok(file)
}

/// Writes a trajectory from the estimates in the log.
fn track(arguments: &Export, format: Format, file: &Path, stop: &AtomicBool) -> Result<ExitCode> {
    let log = &arguments.log;
    let origin = arguments.origin.map_or(0, |date| date.nanos);
    let name = navfuse_mcap::read_scenario(log)?.name;
    let options = Options { name, axes: arguments.axes.axes(), clock: UtcClock { origin } };
    let bar = Bar::new(true);
    let exported = navfuse_export::export(log, format, file, &options, |read| {
        bar.log(read);
        !stop.load(Ordering::Relaxed)
    });
    bar.done();
    let Some(exported) = exported? else { return Ok(ExitCode::from(INTERRUPTED)) };
    exported.warnings.iter().for_each(|w| output::warn(format_args!("warning: {w}")));
    for path in &exported.files {
        output::line(format_args!("{}: {} epochs", path.display(), exported.epochs));
    }
    Ok(ExitCode::SUCCESS)
}

/// Runs the filter again on the samples of the log, for states with their covariance. `epochs`
/// gives the number of epochs in a sink whose result is whole.
fn again<S: Sink>(
    registry: &Registry,
    arguments: &Export,
    sink: S,
    epochs: impl Fn(&S) -> Option<u64>,
    file: &Path,
    stop: &AtomicBool,
) -> Result<ExitCode> {
    let (document, settings) = document_of(&arguments.log)?;
    let scenario = Scenario::new(registry, document, &settings)?;
    let mut assembly = scenario.assemble(None)?;
    assembly.sinks.push(("export".to_owned(), Box::new(sink)));
    let bar = Bar::new(true);
    let mut finished = runner::run(assembly, stop, |progress| bar.run(progress));
    bar.done();
    output::run::events(&finished.events);
    if let Some(epochs) = finished.take_sink::<S>().and_then(|sink| epochs(&sink)) {
        output::line(format_args!("{}: {epochs} epochs", file.display()));
    } else {
        // the event of the sink that failed has been printed
        return Ok(ExitCode::FAILURE);
    }
    match finished.error.take() {
        Some(error) => Err(error.into()),
        None if finished.interrupted => Ok(ExitCode::from(INTERRUPTED)),
        None => Ok(ExitCode::SUCCESS),
    }
}
