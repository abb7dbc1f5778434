//! The driver of a live run: it owns the clock and the threads.

use crate::health::{LinkStatus, Sensors, Status};
use crate::latency::Latency;
use crate::saver::{CHECKPOINT, STATUS, Saver};
use crate::stamps::{Judged, Stamps};
use navfuse_core::checkpoint::Checkpoint;
use navfuse_core::model::record::{Epoch, Event, Level};
use navfuse_core::model::sensor::conversion::Converter;
use navfuse_core::model::stream::{Arrival, Arrivals, NamedFeed, Parcel, StreamError};
use navfuse_core::run::scenario::LiveAssembly;
use navfuse_core::session::{End, Finished, RunError, Session};
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::{Span, Time};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::Builder;
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
}

impl Watch for () {}

/// Runs an assembly on its links until `stop` is set or all links have ended.
///
/// The driver looks at `stop` every 20 ms, also while the links wait for bytes. It writes the
/// checkpoint and the state of the run to the folder of the options.
///
/// # Errors
/// When a thread cannot be started, or the checkpoint is of another scenario.
pub fn run(
    assembly: LiveAssembly,
    options: Options,
    stop: &AtomicBool,
    watch: &mut dyn Watch,
) -> Result<Finished, StreamError> {
    let mut arrivals = Arrivals::default();
    let LiveAssembly { composition, feeds, sinks } = assembly;
    let feeds = start(feeds, &mut arrivals)?;
    let assembly = LiveAssembly { composition, feeds: Vec::new(), sinks };
    Driver::new(assembly, options, arrivals, feeds)?.run(stop, watch)
}

/// Starts each feed on a thread of its own; returns their names.
pub(crate) fn start(
    feeds: Vec<NamedFeed>,
    arrivals: &mut Arrivals,
) -> Result<Vec<String>, StreamError> {
    let mut names = Vec::new();
    for (name, feed) in feeds {
        let mut inbox = arrivals.inbox();
        let thread = Builder::new().name(name.clone()).spawn(move || feed.run(&mut inbox));
        // the thread ends with the run, or with the process where its port blocks
        drop(thread.map_err(|e| StreamError::new("the system gives no thread").with_source(e))?);
        names.push(name);
    }
    Ok(names)
}

/// A live run.
pub(crate) struct Driver {
    name: String,
    session: Session,
    arrivals: Arrivals,
    links: Vec<LinkStatus>,
    /// Events that the next sample takes into the log.
    reports: Vec<Event>,
    converters: Vec<Option<Converter>>,
    names: Vec<String>,
    stamps: Stamps,
    sensors: Sensors,
    latency: Latency,
    saver: Option<Saver>,
    /// Cleared once the run turns out to have no checkpoints.
    saves: bool,
    saved: Instant,
    checkpoints: Duration,
    reopen: Arc<AtomicBool>,
    shown: Instant,
    begin: Instant,
}

impl Driver {
    /// A run on feeds that have been started, each with its name.
    pub(crate) fn new(
        assembly: LiveAssembly,
        options: Options,
        mut arrivals: Arrivals,
        feeds: Vec<String>,
    ) -> Result<Self, StreamError> {
        let LiveAssembly { composition, mut sinks, .. } = assembly;
        let infos: Vec<_> = composition.sensors.iter().map(|s| s.info.clone()).collect();
        let sensors = Sensors::new(&infos, options.speed);
        sinks.iter_mut().for_each(|(_, sink)| sink.never_wait());
        sinks.push(("live".to_owned(), Box::new(sensors.clone())));
        let late = composition.sensors.iter().map(|s| s.late.map_or(0.0, Span::seconds)).collect();
        let driver = composition.processes.iter().find_map(|p| p.input);
        let begin = Instant::now();
        let link = |name| LinkStatus { name, ..LinkStatus::default() };
        Ok(Self {
            name: composition.name.clone(),
            links: feeds.into_iter().map(link).collect(),
            reports: Vec::new(),
            converters: composition.sensors.iter().map(|s| s.conversion.clone()).collect(),
            names: infos.into_iter().map(|info| info.name).collect(),
            stamps: Stamps::new(driver, late, options.speed),
            session: match options.resume {
                Some(from) => Session::resume(composition, sinks, &from).map_err(|e| {
                    let remedy = "remove the checkpoint, or run without --resume";
                    StreamError::scenario(e.to_string()).with_remedy(remedy).with_source(e)
                })?,
                None => Session::new(composition, sinks),
            },
            saver: match &options.folder {
                Some(folder) => Some(Saver::start(folder, arrivals.inbox())?),
                None => None,
            },
            arrivals,
            sensors,
            latency: Latency::default(),
            saves: true,
            checkpoints: options.checkpoints,
            reopen: options.reopen,
            saved: begin,
            shown: begin,
            begin,
        })
    }

    /// Runs until `stop` is set or all links have ended.
    pub(crate) fn run(
        mut self,
        stop: &AtomicBool,
        watch: &mut dyn Watch,
    ) -> Result<Finished, StreamError> {
        let end = self.go_on(stop, watch).unwrap_or_else(End::Failed);
        self.show(watch);
        self.reports.retain(|event| event.level > Level::Info);
        for Event { about, text, .. } in std::mem::take(&mut self.reports) {
            self.session.warn_at_end(about, text);
        }
        let last = matches!(end, End::Interrupted).then(|| self.checkpoint()).flatten();
        let mut finished = self.session.finish(end);
        finished.summary.wall_s = self.begin.elapsed().as_secs_f64();
        drop(self.arrivals);
        if let Some(saver) = self.saver {
            saver.finish(last.map(|bytes| (CHECKPOINT, bytes)).into_iter().collect());
        }
        Ok(finished)
    }

    fn go_on(&mut self, stop: &AtomicBool, watch: &mut dyn Watch) -> Result<End, RunError> {
        while !self.session.is_over() {
            if stop.load(Ordering::Relaxed) {
                return Ok(End::Interrupted);
            }
            match self.arrivals.next(PATIENCE) {
                Some(arrival) => self.take(arrival, watch)?,
                None if self.links.iter().all(|link| link.ended) => break,
                None => self.wait()?,
            }
            if self.reopen.swap(false, Ordering::Relaxed) {
                self.session.reopen();
            }
            if self.shown.elapsed() >= STATUS_PERIOD {
                self.shown = Instant::now();
                self.show(watch);
            }
            if self.saved.elapsed() >= self.checkpoints {
                self.saved = Instant::now();
                if let Some(bytes) = self.checkpoint()
                    && let Some(saver) = &self.saver
                {
                    saver.save(CHECKPOINT, bytes);
                }
            }
        }
        Ok(End::Complete)
    }

    /// Takes what a link handed over.
    fn take(&mut self, arrival: Arrival, watch: &mut dyn Watch) -> Result<(), RunError> {
        let Arrival { feed, at, parcel } = arrival;
        let link = self.links.get_mut(feed);
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
            Parcel::End => {
                if let Some(link) = link {
                    link.ended = true;
                }
            }
        }
        Ok(())
    }

    /// Pushes a sample, unless its time stamp is wrong.
    fn push(&mut self, mut sample: Sample, at: Instant) -> Result<(), RunError> {
        let sensor = sample.sensor.0;
        let Some(converter) = self.converters.get(sensor) else { return Ok(()) };
        if let Some(converter) = converter {
            converter.apply(&mut sample);
        }
        match self.stamps.judge(sensor, sample.time, at) {
            Judged::Usable(time) => sample.time = time,
            Judged::Stepped(time, step) => {
                sample.time = time;
                let text = format!("its clock was set by {step:.1} s, which the run leaves out");
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
        self.reports.push(Event { time: Time::MIN, level, about, text });
    }

    /// Lets the time of the run go on while the driving sensor is silent.
    fn wait(&mut self) -> Result<(), RunError> {
        let now = Instant::now();
        let silent = self.stamps.silence(now).is_some_and(|silence| silence > BEHIND);
        let behind = Span::from_seconds(BEHIND).unwrap_or_default();
        match self.stamps.now(now).filter(|_| silent && self.session.running()) {
            Some(time) => self.session.tick(time - behind),
            None => Ok(()),
        }
    }

    /// Shows the state of the run, and writes it.
    fn show(&mut self, watch: &mut dyn Watch) {
        let verdict = self.session.health();
        self.count_dropped();
        let running = self.session.running();
        let milliseconds = |latency: Duration| latency.as_secs_f64() * 1e3;
        let mut sensors = self.sensors.status(Instant::now(), &verdict);
        for (k, sensor) in sensors.iter_mut().enumerate() {
            sensor.clock = self.stamps.clock(k);
        }
        let status = Status {
            name: self.name.clone(),
            running,
            time_s: self.session.newest(|epoch| epoch.state.time.seconds()),
            sensors,
            verdict: verdict.level,
            text: verdict.text,
            links: self.links.clone(),
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

    /// Counts the samples that the links dropped. A link that floods the run is reported at once, and
    /// again whenever its count has doubled.
    fn count_dropped(&mut self) {
        let mut reports = Vec::new();
        for (k, link) in self.links.iter_mut().enumerate() {
            let dropped = self.arrivals.dropped(k);
            if (dropped + 1).ilog2() > (link.dropped + 1).ilog2() {
                let text = format!("{dropped} samples dropped: they came faster than the filter");
                reports.push((link.name.clone(), text));
            }
            link.dropped = dropped;
        }
        for (about, text) in reports {
            self.report(Level::Warning, about, text);
        }
    }

    /// The run as bytes, once there is an estimate. A run without checkpoints reports it once.
    fn checkpoint(&mut self) -> Option<Vec<u8>> {
        if !self.saves || self.saver.is_none() || !self.session.running() {
            return None;
        }
        match self.session.checkpoint() {
            Ok(checkpoint) => Some(checkpoint.as_bytes().to_vec()),
            Err(error) => {
                self.saves = false;
                let text = format!("the run has no checkpoint: {error}");
                self.report(Level::Warning, "live".to_owned(), text);
                None
            }
        }
    }
}
