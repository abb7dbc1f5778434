//! `navfuse figures`.

use crate::print;
use crate::progress::{Bar, stop_on_ctrl_c};
use crate::report::{End, run, write};
use clap::{Args, ValueEnum};
use navfuse_calibration::{AttitudeSource, CalibrationData, Method};
use navfuse_core::document::Document;
use navfuse_core::plugin::Registry;
use navfuse_core::run::runner::Progress;
use navfuse_core::run::scenario::Scenario;
use navfuse_report::pan_wu::{self, Observer, Runs};
use navfuse_segments::Recording;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// The scenarios are in the program, so that an installed one can make the figures too.
const PAN_WU_3D: &str = include_str!("../scenarios/pan-wu-3d.toml");
const PAN_WU_2D: &str = include_str!("../scenarios/pan-wu-2d.toml");

/// Arguments of `figures`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse figures pan-wu
  navfuse figures pan-wu --set seed=7 --out figures/seed-7

What it writes:
  figure-01.svg to figure-16.svg   the figures, by their numbers in the paper
  index.html                       all of them with the paper's captions, on one page that opens offline
  figures.rrd                      those over time for the rerun viewer, where navfuse was built with it")]
pub struct Figures {
    /// The paper
    #[arg(value_enum)]
    pub paper: Paper,
    /// Folder for the figures [default: runs/figures-PAPER]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Change a value of the scenarios; may be given again
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
}

/// A paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Paper {
    /// Pan & Wu, Underwater Doppler Navigation with Self-calibration, J. Navigation 69 (2016)
    PanWu,
}

/// `navfuse figures`
pub fn figures(registry: &Registry, arguments: &Figures) -> Result<ExitCode> {
    let Paper::PanWu = arguments.paper;
    let out = arguments.out.clone().unwrap_or_else(|| Path::new("runs").join("figures-pan-wu"));
    let stop = stop_on_ctrl_c();
    let mut histories = Vec::new();
    for (file, text) in [("pan-wu-3d.toml", PAN_WU_3D), ("pan-wu-2d.toml", PAN_WU_2D)] {
        let document = Document::parse(file, text.to_owned())?;
        let (history, end) = run(registry, document, &arguments.set, [], &stop, &Bar::new(true))?;
        if end != End::Whole {
            return Ok(end.code());
        }
        histories.push(history);
    }
    let observers = observers(registry, &arguments.set)?;
    let [three, two] = <[_; 2]>::try_from(histories).map_err(|_| "two runs are needed")?;
    let figures = pan_wu::figures(&Runs { three, two, observers })?;
    for (_, figure) in &figures {
        let path = out.join(format!("{}.svg", figure.name));
        write(&path, &navfuse_figures::svg(figure)?)?;
        print::line(path.display());
    }
    let index = out.join("index.html");
    write(&index, &pan_wu::page(&figures)?)?;
    print::line(index.display());
    #[cfg(feature = "rerun")]
    {
        let path = out.join("figures.rrd");
        let figures: Vec<_> = figures.into_iter().map(|(_, figure)| figure).collect();
        navfuse_viewer::figures::record(&path, "figures of Pan & Wu (2016)", &figures)?;
        print::line(path.display());
    }
    Ok(ExitCode::SUCCESS)
}

/// IO-DVLC of the paper on the samples of its 3D run: by eq. (18) as it is printed, and improved.
fn observers(registry: &Registry, settings: &[String]) -> Result<Vec<Observer>> {
    let scenario = Scenario::new(
        registry,
        Document::parse("pan-wu-3d.toml", PAN_WU_3D.to_owned())?,
        settings,
    )?;
    let bar = Bar::new(true);
    let recording =
        Recording::gather(scenario.assemble(None)?, |now, end| bar.run(Progress { now, end }));
    bar.done();
    let data = CalibrationData::new(recording?, AttitudeSource::Gyros)?;
    let methods = [(Method::IoDvlcPrinted, "eq. (18) as printed"), (Method::IoDvlc, "improved")];
    let observers = methods.map(|(method, name)| -> Result<Observer> {
        let estimate = method.estimate(&data)?;
        let steps = estimate.history.iter().map(|step| {
            let angles = step.mounting.angles().map(f64::to_degrees);
            (data.recording.clock(step.time), [step.mounting.k, angles.x, angles.y, angles.z])
        });
        Ok(Observer { name: name.into(), steps: steps.collect() })
    });
    observers.into_iter().collect()
}
