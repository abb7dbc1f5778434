//! The driver of a live run: it owns the clock and the threads.

use crate::determined::Determined;
use crate::error::LiveError;
use crate::events::Events;
use crate::health::Sensors;
use crate::latency::Latency;
use crate::ports::Ports;
use crate::saver::{CHECKPOINT, STATUS, Saver};
use crate::stamps::Judged;
use crate::status::{Estimate, SensorState, Status};
use navfuse_core::checkpoint::Checkpoint;
use navfuse_core::model::record::{Epoch, Event, Level};
use navfuse_core::model::sensor::conversion::Converter;
use navfuse_core::model::stream::{Arrival, Command, Parcel, StreamError};
use navfuse_core::plugin::BuildError;
use navfuse_core::run::scenario::LiveAssembly;
use navfuse_core::session::{End, Finished, RunError, Session};
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::{Span, Time};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Longest wait for a sample, after which the driver looks at its clock and whether to stop.
const PATIENCE: Duration = Duration::from_millis(20);
/// Time between two states of the run.
const STATUS_PERIOD: Duration = Duration::from_secs(1);
/// Delay with which the time of the run goes on without the driving sensor, s: a sample of it that
/// a link delays by less is used.
const BEHIND: f64 = 1.0;

/// Settings of a live run.
#[derive(Debug)]
pub struct Options {
    /// Seconds of the run in a second: above 1 for a recording that is played faster.
    pub speed: f64,
    /// Folder for the checkpoint and the state of the run; `None` writes neither.
    pub folder: Option<PathBuf>,
    /// Time between two checkpoints.
    pub checkpoints: Duration,
    /// Checkpoint from which the run goes on.
    pub resume: Option<Checkpoint>,
    /// Set whenever the log is to begin a new file; the run clears it.
    pub reopen: Arc<AtomicBool>,
}

impl Default for Options {
    fn default() -> Self {
        let checkpoints = Duration::from_secs(5);
        Self { speed: 1.0, folder: None, checkpoints, resume: None, reopen: Arc::default() }
    }
}

/// Watches a live run.
pub trait Watch {
    /// Receives the estimate after each sample.
    fn newest(&mut self, _epoch: &Epoch<'_>) {}
    /// Receives the state of the run, once a second and at its end.
    fn status(&mut self, _status: &Status) {}
    /// Receives each event and each finding as it comes; one that the log has not got yet has the time
    /// [`Time::MIN`].
    fn event(&mut self, _event: &Event) {}
}

impl Watch for () {}

/// Runs a scenario on its links until `stop` is set or all links have ended.
///
/// The driver looks at `stop` every 20 ms, also while the links wait for bytes. It writes the
/// checkpoint and the state of the run to the folder of the options. Where a command resets the run,
/// `assemble` is called again; the links of the first assembly go on.
///
/// # Errors
/// When the scenario cannot be assembled, a thread cannot be started, or the checkpoint is of another
/// scenario.
pub fn run(
    mut assemble: impl FnMut() -> Result<LiveAssembly, BuildError>,
    mut options: Options,
    stop: &AtomicBool,
    watch: &mut dyn Watch,
) -> Result<Finished, LiveError> {
    let mut assembly = assemble()?;
    let feeds = std::mem::take(&mut assembly.feeds);
    let mut ports = Ports::start(feeds, &assembly.composition, options.speed)?;
    loop {
        match Driver::new(assembly, &mut options, ports)?.run(true, stop, watch) {
            (finished, None) => return Ok(finished),
            (_, Some(open)) => (assembly, ports) = (assemble()?, open),
        }
    }
}

/// A live run.
pub(crate) struct Driver {
    name: String,
    session: Session,
    ports: Ports,
    /// Events that the next sample takes into the log.
    reports: Vec<Event>,
    converters: Vec<Option<Converter>>,
    names: Vec<String>,
    sensors: Sensors,
    determined: Determined,
    events: Events,
    latency: Latency,
    saver: Option<Saver>,
    /// The reason for which the run has no checkpoint, once it is reported.
    unsaved: Option<String>,
    /// The last command, and what came of it.
    command: Option<String>,
    /// Set once a command resets the run.
    reset: bool,
    saved: Instant,
    checkpoints: Duration,
    reopen: Arc<AtomicBool>,
    shown: Instant,
    begin: Instant,
}

impl Driver {
    /// A run of an assembly on links that are open.
    pub(crate) fn new(
        assembly: LiveAssembly,
        options: &mut Options,
        mut ports: Ports,
    ) -> Result<Self, StreamError> {
        let LiveAssembly { composition, mut sinks, .. } = assembly;
        let infos: Vec<_> = composition.sensors.iter().map(|s| s.info.clone()).collect();
        let sensors = Sensors::new(&infos, options.speed);
        sinks.iter_mut().for_each(|(_, sink)| sink.never_wait());
        let determined = Determined::new(options.resume.is_some());
        let events = Events::default();
        sinks.push(("live".to_owned(), Box::new(sensors.clone())));
        sinks.push(("determined".to_owned(), Box::new(determined.clone())));
        sinks.push(("events".to_owned(), Box::new(events.clone())));
        let begin = Instant::now();
        Ok(Self {
            name: composition.name.clone(),
            reports: Vec::new(),
            converters: composition.sensors.iter().map(|s| s.conversion.clone()).collect(),
            names: infos.into_iter().map(|info| info.name).collect(),
            session: match options.resume.take() {
                Some(from) => Session::resume(composition, sinks, &from).map_err(|e| {
                    let remedy = "remove the checkpoint, or run without --resume";
                    StreamError::scenario(e.to_string()).with_remedy(remedy).with_source(e)
                })?,
                None => Session::new(composition, sinks),
            },
            saver: match &options.folder {
                Some(folder) => Some(Saver::start(folder, ports.arrivals.inbox())?),
                None => None,
            },
            ports,
            sensors,
            determined,
            events,
            latency: Latency::default(),
            unsaved: None,
            command: None,
            reset: false,
            checkpoints: options.checkpoints,
            reopen: Arc::clone(&options.reopen),
            saved: begin,
            shown: begin,
            begin,
        })
    }

    /// Runs until `stop` is set or all links have ended. A run that a command may reset returns its links
    /// where one does.
    pub(crate) fn run(
        mut self,
        resets: bool,
        stop: &AtomicBool,
        watch: &mut dyn Watch,
    ) -> (Finished, Option<Ports>) {
        let end = self.go_on(resets, stop, watch).unwrap_or_else(End::Failed);
        self.show(watch);
        self.reports.retain(|event| event.level > Level::Info);
        for Event { about, text, .. } in std::mem::take(&mut self.reports) {
            self.session.warn_at_end(about, text);
        }
        let last = match (&end, self.reset) {
            // nothing to go on from
            (_, true) => Some(Vec::new()),
            (End::Interrupted, _) => self.checkpoint().ok(),
            _ => None,
        };
        let mut finished = self.session.finish(end);
        self.events.fresh().iter().for_each(|event| watch.event(event));
        finished.summary.wall_s = self.begin.elapsed().as_secs_f64();
        let ports = self.reset.then_some(self.ports);
        if let Some(saver) = self.saver {
            saver.finish(last.map(|bytes| (CHECKPOINT, bytes)).into_iter().collect());
        }
        (finished, ports)
    }

    fn go_on(
        &mut self,
        resets: bool,
        stop: &AtomicBool,
        watch: &mut dyn Watch,
    ) -> Result<End, RunError> {
        while !self.session.is_over() {
            if stop.load(Ordering::Relaxed) || self.reset {
                return Ok(End::Interrupted);
            }
            match self.ports.arrivals.next(PATIENCE) {
                Some(arrival) => self.take(arrival, resets, watch)?,
                None if self.ports.have_ended() => break,
                None => self.wait()?,
            }
            self.events.fresh().iter().for_each(|event| watch.event(event));
            if self.reopen.swap(false, Ordering::Relaxed) {
                self.session.reopen();
            }
            if self.shown.elapsed() >= STATUS_PERIOD {
                self.shown = Instant::now();
                self.show(watch);
            }
            if self.saved.elapsed() >= self.checkpoints {
                self.save_again();
            }
        }
        Ok(End::Complete)
    }

    /// Takes what a link handed over.
    fn take(
        &mut self,
        arrival: Arrival,
        resets: bool,
        watch: &mut dyn Watch,
    ) -> Result<(), RunError> {
        let Arrival { feed, at, parcel } = arrival;
        let link = self.ports.links.get_mut(feed);
        match parcel {
            Parcel::Sample(sample) => {
                if let Some(link) = link {
                    link.samples += 1;
                }
                self.push(sample, at)?;
                self.session.newest(|epoch| watch.newest(epoch));
                self.latency.take(at.elapsed());
            }
            Parcel::Report(level, text) => {
                let about = link.map_or("live", |link| &link.name).to_owned();
                self.report(level, about, text);
            }
            Parcel::Command(command) => {
                let about = link.map_or("live", |link| &link.name).to_owned();
                let text = self.obey(command, resets);
                self.command = Some(format!("{text}, by {about}"));
                self.report(Level::Warning, about, text);
            }
            Parcel::End => {
                if let Some(link) = link {
                    link.ended = true;
                }
            }
        }
        Ok(())
    }

    /// Obeys a command, and returns what came of it.
    fn obey(&mut self, command: Command, resets: bool) -> String {
        match command {
            Command::Reset => {
                self.reset = resets;
                if resets { "the run begins anew" } else { "this run cannot restart" }.to_owned()
            }
            Command::Checkpoint => match self.save() {
                Ok(()) => "the run is saved".to_owned(),
                Err(why) => why,
            },
            Command::Use(sensor, used) => {
                let Some(off) = self.ports.off.get_mut(sensor.0) else {
                    return "there is no such sensor".to_owned();
                };
                *off = !used;
                let state = if used { "on" } else { "off" };
                format!("{} is switched {state}", self.names[sensor.0])
            }
        }
    }

    /// Pushes a sample, unless its sensor is switched off or its time stamp is wrong.
    fn push(&mut self, mut sample: Sample, at: Instant) -> Result<(), RunError> {
        let sensor = sample.sensor.0;
        let Some(converter) = self.converters.get(sensor) else { return Ok(()) };
        if self.ports.off[sensor] {
            self.sensors.left_out(sensor);
            return Ok(());
        }
        if let Some(converter) = converter {
            converter.apply(&mut sample);
        }
        match self.ports.stamps.judge(sensor, sample.time, at) {
            Judged::Usable(time) => sample.time = time,
            Judged::Stepped(time, step) => {
                sample.time = time;
                let text = format!("its clock stepped by {step:.1} s, which the run removes");
                self.report(Level::Warning, self.names[sensor].clone(), text);
            }
            Judged::Refused(error) => {
                if self.sensors.refused(sensor) == 1 {
                    let text = format!(
                        "a time stamp is wrong by {error:.1} s: such samples are not used; set \
                         `clock` or time = \"arrival\" of its link"
                    );
                    self.report(Level::Warning, self.names[sensor].clone(), text);
                }
                return Ok(());
            }
        }
        self.sensors.arrived(sensor, sample.time, at);
        if !self.reports.is_empty() {
            self.session.announce(std::mem::take(&mut self.reports));
        }
        self.session.push(&sample)
    }

    /// Logs an event with the next sample, or at the end of the run if it is more than information.
    fn report(&mut self, level: Level, about: String, text: String) {
        let event = Event { time: Time::MIN, level, about, text };
        self.events.announce(&event);
        self.reports.push(event);
    }

    /// Lets the time of the run go on while the driving sensor is silent.
    fn wait(&mut self) -> Result<(), RunError> {
        let now = Instant::now();
        let silent = self.ports.stamps.silence(now).is_some_and(|silence| silence > BEHIND);
        let behind = Span::from_seconds(BEHIND).unwrap_or_default();
        match self.ports.stamps.now(now).filter(|_| silent && self.session.running()) {
            Some(time) => self.session.tick(time - behind),
            None => Ok(()),
        }
    }

    /// Shows the state of the run, and writes it.
    fn show(&mut self, watch: &mut dyn Watch) {
        let verdict = self.session.health();
        for (about, text) in self.ports.count_dropped() {
            self.report(Level::Warning, about, text);
        }
        let running = self.session.running();
        let newest = self.session.newest(|epoch| (epoch.state.time.seconds(), Estimate::of(epoch)));
        let (estimate, accuracy) = newest.map(|(_, estimate)| estimate).unwrap_or_default();
        let milliseconds = |latency: Duration| latency.as_secs_f64() * 1e3;
        let mut sensors = self.sensors.status(Instant::now(), &verdict);
        for (k, sensor) in sensors.iter_mut().enumerate() {
            sensor.clock = self.ports.stamps.clock(k);
            if self.ports.off[k] {
                sensor.state = SensorState::Off;
            }
        }
        self.determined.share(&mut sensors);
        let status = Status {
            name: self.name.clone(),
            running,
            time_s: newest.map(|(time, _)| time),
            estimate,
            accuracy,
            states: self.determined.states(),
            sensors,
            verdict: verdict.level,
            text: verdict.text,
            links: self.ports.links.clone(),
            command: self.command.clone(),
            latency_ms: [
                milliseconds(self.latency.quantile(0.5)),
                milliseconds(self.latency.quantile(0.99)),
                milliseconds(self.latency.largest()),
            ],
        };
        watch.status(&status);
        if let Some(saver) = &self.saver
            && let Ok(content) = serde_json::to_vec_pretty(&status)
        {
            saver.save(STATUS, content);
        }
    }

    /// Saves the run from time to time. A reason against it is reported once.
    fn save_again(&mut self) {
        self.saved = Instant::now();
        if self.saver.is_none() || !self.session.running() {
            return;
        }
        if let Err(why) = self.save()
            && self.unsaved.as_ref() != Some(&why)
        {
            self.unsaved = Some(why.clone());
            self.report(Level::Warning, "live".to_owned(), why);
        }
    }

    /// Saves the run, or returns the reason against it.
    fn save(&mut self) -> Result<(), String> {
        let bytes = self.checkpoint()?;
        let saver = self.saver.as_ref().ok_or("the run cannot be saved: it has no folder")?;
        saver.save(CHECKPOINT, bytes);
        Ok(())
    }

    /// The run as bytes.
    fn checkpoint(&mut self) -> Result<Vec<u8>, String> {
        if !self.session.running() {
            return Err("the run cannot be saved: there is no estimate yet".to_owned());
        }
        let checkpoint = self.session.checkpoint().map_err(|error| error.to_string())?;
        Ok(checkpoint.as_bytes().to_vec())
    }
}
