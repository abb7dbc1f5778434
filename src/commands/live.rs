//! `navfuse live`.

use crate::error::{CommandError, Result};
use crate::execution::input::{document, runs_folder, seconds};
use crate::execution::run::print;
use crate::execution::screen::Screen;
use crate::execution::service::ServiceManager;
use crate::output::progress::{end_on_signal, flag_on_hang_up};
use crate::output::warnings::Warnings;
use crate::output::{Format, line, warn};
use clap::Args;
use navfuse_core::compose::Composition;
use navfuse_core::document::{Document, Node, key};
use navfuse_core::files::FolderLock;
use navfuse_core::model::record::Event;
use navfuse_core::model::sensor::{Purpose, Sensor};
use navfuse_core::plugin::{Kind, Registry};
use navfuse_core::run::scenario::Scenario;
use navfuse_live::{Options, Status, Watch, read_checkpoint, run};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

/// The key by which the process of a sensor goes on without it.
const COAST: &str = "coast";
/// Its value where the scenario has none: the turns and accelerations of a slow vehicle.
const SLOW: &str = "{ turn = \"1 deg/s/sqrt(Hz)\", acceleration = \"0.1 m/s^2/sqrt(Hz)\" }";
/// The key `late` of the sensors that have none.
const LATE: &str = "\"1 s\"";
/// The type of the log, the keys by which it begins new files, and the setting of a log without them: the
/// index of a file is in memory until the file ends.
const LOG: &str = "mcap";
const ROTATES: [&str; 2] = ["rotate_every", "rotate_mb"];
const ROTATE: &str = "rotate_every=\"6 h\"";
/// The key of a link by which the time of the run is that of a simulation.
const SIMULATED: &str = "use_sim_time";

/// Arguments of `live`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  navfuse live vehicle.toml --resume
  navfuse live vehicle.toml --tui
  navfuse live vehicle.toml --out /data/dive-7
  navfuse play run.mcap --speed 10 | navfuse live desk.toml --speed 10

The links of the scenario, [link.NAME], state how the samples arrive. Ctrl-C and SIGTERM end the \
run, and write its log; SIGHUP begins a new log file.")]
pub struct Live {
    /// The scenario, a TOML file with links
    pub scenario: PathBuf,
    /// Change a value of the scenario; may be given again
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// Folder for the log, the checkpoint and the state of the run [default: runs/NAME of the scenario]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Form of the result
    #[arg(long, value_enum, default_value_t = Format::Text)]
    pub format: Format,
    /// Go on from the checkpoint in the folder, if there is one
    #[arg(long)]
    pub resume: bool,
    /// Show the run on the terminal while it goes on; the key q ends it
    #[arg(long)]
    pub tui: bool,
    /// Time between two checkpoints
    #[arg(long, value_name = "TIME", default_value = "5 s")]
    pub checkpoint: String,
    /// Seconds of the run in a second, for a recording that is played as fast; inf for any speed
    #[arg(long, value_name = "N", default_value_t = 1.0, value_parser = speed)]
    pub speed: f64,
}

/// A speed above zero.
pub fn speed(text: &str) -> std::result::Result<f64, String> {
    let speed = text.parse::<f64>().ok().filter(|speed| *speed > 0.0);
    speed.ok_or_else(|| "a number above zero, such as 10, or inf".to_owned())
}

/// Shows the run: on the screen, or its warnings as they come.
struct Shown {
    last: Status,
    manager: ServiceManager,
    screen: Option<Screen>,
    warnings: Warnings,
}

impl Watch for Shown {
    fn status(&mut self, status: &Status) {
        self.last.clone_from(status);
        self.manager.alive();
        if let Some(screen) = &self.screen {
            screen.status(status);
        }
    }

    fn event(&mut self, event: &Event) {
        match &self.screen {
            Some(screen) => screen.event(event),
            None => self.warnings.take(event),
        }
    }
}

/// Runs a scenario on its links.
pub fn live(registry: &Registry, arguments: &Live) -> Result<ExitCode> {
    let stop = end_on_signal();
    let reopen = flag_on_hang_up();
    let scenario = on_vehicle(registry, arguments)?;
    let folder = arguments.out.clone().unwrap_or_else(|| runs_folder(&scenario.name()));
    let _lock = FolderLock::take(&folder)?;
    let resume = if arguments.resume { read_checkpoint(&folder)? } else { None };
    let assemble = || scenario.assemble_live(Some(&folder));
    let every = seconds("--checkpoint", &arguments.checkpoint)?;
    let checkpoints = Duration::try_from_secs_f64(every)
        .map_err(|e| CommandError::argument("--checkpoint", e.to_string()))?;
    let (speed, saved) = (pace(arguments)?, Some(folder.clone()));
    let options = Options { speed, folder: saved, checkpoints, resume, reopen };
    let mut shown = Shown {
        last: Status::default(),
        manager: ServiceManager::connect(),
        screen: match arguments.tui {
            true => Some(Screen::open(scenario.name(), Arc::clone(&stop))?),
            false => None,
        },
        warnings: Warnings::default(),
    };
    let finished = run(assemble, options, &stop, &mut shown);
    // the terminal is restored before anything is printed
    shown.screen = None;
    let finished = finished?;
    let text = arguments.format == Format::Text;
    print(&finished, &shown.warnings.others(&finished.events), None, text)?;
    if text {
        let [median, most, largest] = shown.last.latency_ms;
        line(format_args!(
            "latency from a sample to its estimate: median {median:.3} ms, 99 % {most:.3} ms, \
             largest {largest:.3} ms"
        ));
    }
    Ok(if finished.error.is_some() { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// The scenario, with the settings that a run on a vehicle needs and the scenario does not make.
fn on_vehicle<'a>(registry: &'a Registry, arguments: &Live) -> Result<Scenario<'a>> {
    let document = document(&arguments.scenario)?;
    let mut scenario = Scenario::new(registry, document.clone(), &arguments.set)?;
    let composition = scenario.compose()?;
    for (name, setting) in coasting(registry, &composition) {
        scenario.set(&setting)?;
        warn(format_args!(
            "note: so that the run continues while [sensor.{name}] is silent, it uses {setting}"
        ));
    }
    let rotate = rotating(&scenario, &document, &arguments.set)?;
    for setting in &rotate {
        scenario.set(setting)?;
        warn(format_args!("note: the log goes on in new files: {setting}"));
    }
    let late = waiting(&composition);
    let settings = [&arguments.set[..], &rotate, &late].concat();
    let mut waits = Scenario::new(registry, document, &settings)?;
    // an estimator that cannot go back has no late samples
    if waits.compose().is_err() {
        return Ok(scenario);
    }
    for (_, setting) in coasting(registry, &composition) {
        waits.set(&setting)?;
    }
    for setting in &late {
        warn(format_args!(
            "note: its samples may arrive after newer IMU samples, so the run uses {setting}"
        ));
    }
    Ok(waits)
}

/// The seconds of the run in a second: any number of them where a link follows simulated time.
fn pace(arguments: &Live) -> Result<f64> {
    let mut document = document(&arguments.scenario)?;
    arguments.set.iter().try_for_each(|setting| document.set(setting))?;
    let root = document.root();
    let links = root.get("link").map_or_else(|| Ok(Vec::new()), |links| links.entries())?;
    let simulated = |key: Node<'_>| key.parse::<bool>().unwrap_or_default();
    let simulated = |link: &Node<'_>| link.get(SIMULATED).is_some_and(simulated);
    let Some((name, _)) = links.iter().find(|(_, link)| simulated(link)) else {
        return Ok(arguments.speed);
    };
    warn(format_args!("note: the run follows the simulated time of [link.{name}], at any speed"));
    Ok(f64::INFINITY)
}

/// The settings by which logs begin new files, for those whose table does not say when.
fn rotating(scenario: &Scenario<'_>, document: &Document, set: &[String]) -> Result<Vec<String>> {
    let mut document = document.clone();
    set.iter().try_for_each(|setting| document.set(setting))?;
    let (root, mut settings) = (document.root(), Vec::new());
    for sink in scenario.sinks_of_type(LOG)? {
        let table = root.get("sink").and_then(|sinks| sinks.get(&sink));
        if !table.is_some_and(|table| ROTATES.iter().any(|key| table.get(key).is_some())) {
            settings.push(format!("sink.{}.{ROTATE}", key(&sink)));
        }
    }
    Ok(settings)
}

/// The settings by which samples of sensors may arrive after those of the driving sensor: each link
/// and each instrument has a delay of its own.
fn waiting(composition: &Composition) -> Vec<String> {
    let measures = |s: &&Sensor| s.info.purpose == Purpose::Measurement && !s.constraint;
    let sensors = composition.sensors.iter().filter(measures);
    let sensors = sensors.filter(|s| s.late.is_none());
    sensors.map(|s| format!("sensor.{}.late={LATE}", key(&s.info.name))).collect()
}

/// The settings by which a run goes on where a sensor that drives a process falls silent, each with
/// its sensor, for those that can and whose table does not say how.
fn coasting(registry: &Registry, composition: &Composition) -> Vec<(String, String)> {
    let ends = composition.processes.iter().filter(|p| p.coasts_after.is_none());
    let sensors = ends.filter_map(|p| Some(&composition.sensors[p.input?].info));
    let coasts = |kind: &str| {
        let schema = registry.get(Kind::Sensor, kind).map(|entry| entry.schema.as_value());
        schema.is_some_and(|s| s.pointer(&format!("/properties/{COAST}")).is_some())
    };
    let setting = |name: &str| format!("sensor.{}.{COAST}={SLOW}", key(name));
    sensors.filter(|s| coasts(&s.kind)).map(|s| (s.name.clone(), setting(&s.name))).collect()
}
