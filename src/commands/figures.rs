//! `navfuse figures`.

use crate::error::Result;
use crate::execution::history::{End, run};
use crate::output;
use crate::output::progress::{Bar, stop_on_signal};
use crate::output::write;
use clap::{Args, ValueEnum};
use navfuse_calibration::{AttitudeSource, CalibrationData, Method};
use navfuse_core::document::Document;
use navfuse_core::plugin::Registry;
use navfuse_core::run::runner::Progress;
use navfuse_core::run::scenario::Scenario;
use navfuse_report::RunHistory;
use navfuse_report::pan_wu::{self, Observer, Runs};
use navfuse_segments::Recording;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// The 3D scenario of the paper. It is part of the program, so that an installed program can make
/// the figures too.
const PAN_WU_3D: &str = include_str!("../../scenarios/pan-wu-3d.toml");
/// The 2D scenario of the paper.
const PAN_WU_2D: &str = include_str!("../../scenarios/pan-wu-2d.toml");

/// Arguments of `figures`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse figures pan-wu
  navfuse figures pan-wu --set seed=7 --out figures/seed-7

The command writes:
  figure-01.svg to figure-16.svg   the figures, by their numbers in the paper
  index.html                       all figures with the captions of the paper
  figures.rrd                      the figures over time for the rerun viewer")]
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

/// Makes the figures of a paper.
pub fn figures(registry: &Registry, arguments: &Figures) -> Result<ExitCode> {
    let Paper::PanWu = arguments.paper;
    let out = arguments.out.clone().unwrap_or_else(|| Path::new("runs").join("figures-pan-wu"));
    let index = out.join("index.html");
    output::check(&index)?; // before minutes of work
    let (stop, bar) = (stop_on_signal(), Bar::new(true));
    let history = |file: &str, text: &str| -> Result<(RunHistory, End)> {
        let document = Document::parse(file, text)?;
        let (history, end, _) = run(registry, document, &arguments.set, Vec::new(), &stop, &bar)?;
        Ok((history, end))
    };
    let (three, end) = history("pan-wu-3d.toml", PAN_WU_3D)?;
    if end != End::Whole {
        return Ok(end.code());
    }
    let (two, end) = history("pan-wu-2d.toml", PAN_WU_2D)?;
    if end != End::Whole {
        return Ok(end.code());
    }
    let observers = observers(registry, &arguments.set)?;
    let figures = pan_wu::figures(&Runs { three, two, observers })?;
    for (_, figure) in &figures {
        let path = out.join(format!("{}.svg", figure.name));
        write(&path, &navfuse_figures::svg(figure)?)?;
        output::line(path.display());
    }
    write(&index, &pan_wu::page(&figures)?)?;
    output::line(index.display());
    #[cfg(feature = "rerun")]
    {
        let path = out.join("figures.rrd");
        let figures: Vec<_> = figures.into_iter().map(|(_, figure)| figure).collect();
        navfuse_viewer::figures::record(&path, "figures of Pan & Wu (2016)", None, &[], &figures)?;
        output::line(path.display());
    }
    Ok(ExitCode::SUCCESS)
}

/// IO-DVLC of the paper on the samples of its 3D run: by eq. (18) as printed, and improved.
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
