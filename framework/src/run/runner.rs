//! The runner: merges sources in order of time, feeds the filter, and tells the sinks.

use crate::ekf::{Ekf, EstimatorError};
use crate::model::record::{Epoch, Event, Level, Observer, Rejection, UpdateRecord};
use crate::model::sensor::Role;
use crate::model::sensor::{Purpose, SensorInfo};
use crate::model::stream::{RunInfo, Sink, Source, StreamError};
use crate::run::scenario::Assembly;
use crate::run::summary::{Recorded, Statistics, Summary};
use crate::state::covariance::{Transition, Update};
use crate::units::sample::{Sample, SensorId};
use crate::units::time::Time;
use std::sync::atomic::{AtomicBool, Ordering};

/// Why a run ended early. What was recorded until then is kept.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A source failed.
    #[error("source {source_name}: {error}")]
    Source {
        /// Which.
        source_name: String,
        /// Why.
        #[source]
        error: StreamError,
    },
    /// The filter cannot go on.
    #[error(transparent)]
    Estimator(#[from] EstimatorError),
    /// The samples end before a process has found its start.
    #[error("{0}")]
    Unfinished(String),
    /// The filter never started.
    #[error("{0}")]
    NeverStarted(String),
}

/// How a run ended: the summary is there in any case.
#[derive(Debug)]
pub struct Finished {
    /// What the run tells in numbers.
    pub summary: Summary,
    /// Where each sink wrote.
    pub recorded: Vec<Recorded>,
    /// Warnings and errors in order of time.
    pub events: Vec<Event>,
    /// Why it ended early, if it did.
    pub error: Option<RunError>,
    /// Whether it was interrupted.
    pub interrupted: bool,
}

/// Progress of a run.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// The time reached.
    pub now: Time,
    /// The time of the last sample, where the sources can tell.
    pub end: Option<Time>,
}

/// Runs an assembly to its end, or until `stop` is set; `progress` is called about a hundred times
/// a second of run time at most.
pub fn run(assembly: Assembly, stop: &AtomicBool, mut progress: impl FnMut(Progress)) -> Finished {
    let Assembly { composition, sources, sinks } = assembly;
    let clock = std::time::Instant::now();
    let until = composition.estimator.stop();
    let period = composition.estimator.output_period();
    let info = RunInfo {
        name: composition.name.clone(),
        scenario: composition.text.clone(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        layout: (*composition.layout).clone(),
        sensors: composition.sensors.iter().map(|s| s.info.clone()).collect(),
    };
    let timeouts = composition.sensors.iter().map(|s| s.timeout).collect();
    let mut fan = Fan {
        sinks,
        statistics: Statistics::new(&info),
        events: Vec::new(),
        next_epoch: Time::MIN,
    };
    fan.each(Time::MIN, |sink| sink.start(&info));
    let notes = composition.notes.clone();
    let mut ekf = Ekf::new(composition);
    let mut silence = Silence::new(timeouts, &info.sensors);
    let mut merge = Merge::new(sources, &info.sensors);
    let end = merge.end().map(|e| until.map_or(e, |u| u.min(e)));
    let (mut error, mut interrupted, mut count) = (None, false, 0_u64);
    if let Err(e) = merge.fill() {
        error = Some(e);
    }
    let time = merge.first(false).map_or(Time::MIN, |(sample, _)| sample.time);
    for (about, text) in notes {
        fan.event(Event { time, level: Level::Info, about, text });
    }
    while error.is_none() {
        let Some((sample, source)) = merge.first(ekf.running()) else { break };
        if until.is_some_and(|u| sample.time > u) {
            break;
        }
        if stop.load(Ordering::Relaxed) {
            interrupted = true;
            break;
        }
        // when everything of the state's time is in, and no reference has told it already
        let now = ekf.state().time;
        if ekf.running() && now >= fan.next_epoch && sample.time > now {
            fan.next_epoch = Time::from_nanos((now.nanos().div_euclid(period) + 1) * period);
            if fan.statistics.last_epoch != Some(now) {
                fan.epoch(&ekf.epoch());
            }
        }
        merge.due(sample.time, &mut fan);
        fan.each(sample.time, |sink| sink.sample(&sample));
        fan.statistics.read(&sample);
        if let Err(e) = ekf.process(&sample, &mut fan) {
            error = Some(e.into());
            break;
        }
        silence.heard(&sample, &info.sensors, &mut fan);
        count += 1;
        if count.is_multiple_of(4096) {
            progress(Progress { now: sample.time, end });
        }
        if let Err(e) = merge.advance(source) {
            error = Some(e);
        }
    }
    ekf.finish(&mut fan);
    merge.warnings(&mut fan);
    let mut unfinished: Vec<Event> = ekf.unfinished().collect();
    if error.is_none()
        && !interrupted
        && let Some(at) = unfinished.iter().position(|e| e.level == Level::Error)
    {
        let Event { about, text, .. } = unfinished.remove(at);
        error = Some(RunError::Unfinished(format!("{about}: {text}")));
    }
    if error.is_none() {
        unfinished.into_iter().for_each(|event| fan.event(event));
    }
    if error.is_none() && !ekf.running() && !interrupted {
        error = Some(RunError::NeverStarted(never_started(&ekf)));
    }
    let now = ekf.state().time;
    if ekf.running() && fan.statistics.last_epoch != Some(now) {
        fan.epoch(&ekf.epoch());
    }
    for event in fan.statistics.unheard(&ekf) {
        fan.event(event);
    }
    if let Some(e) = &error {
        fan.event(Event {
            time: now,
            level: Level::Error,
            about: "run".into(),
            text: e.to_string(),
        });
    } else if interrupted {
        fan.event(Event {
            time: now,
            level: Level::Warning,
            about: "run".into(),
            text: "interrupted".into(),
        });
    }
    let recorded = fan.close(now);
    let mut summary = fan.statistics.summary(&ekf);
    summary.wall_s = clock.elapsed().as_secs_f64();
    progress(Progress { now, end: Some(now) });
    Finished { summary, recorded, events: fan.events, error, interrupted }
}

fn never_started(ekf: &Ekf) -> String {
    let start = ekf.composition().start();
    let reference = ekf.composition().sensors.iter().find(|s| matches!(s.role, Role::Reference(_)));
    if let Some(stop) = ekf.composition().estimator.stop().filter(|stop| *stop < start) {
        return format!(
            "the filter never started: estimator.stop = {stop} is before estimator.start = {start}; give a later one"
        );
    }
    match reference {
        Some(r) if ekf.composition().estimator.from_reference() => format!(
            "the filter never started: no sample of [sensor.{}] at or after estimator.start = {start}; check the time \
             stamps, or give the initial values and estimator.initial = \"given\"",
            r.info.name
        ),
        _ => format!(
            "the filter never started: no sample of the driving sensor at or after estimator.start = {start}"
        ),
    }
}

/// The heads of all sources.
struct Merge {
    sources: Vec<(String, Box<dyn Source>)>,
    heads: Vec<Option<Sample>>,
    /// What the sources know will happen, the last first.
    schedule: Vec<Event>,
    /// Which sensors are references.
    references: Vec<bool>,
}

impl Merge {
    fn new(sources: Vec<(String, Box<dyn Source>)>, sensors: &[SensorInfo]) -> Self {
        let mut schedule: Vec<Event> = sources.iter().flat_map(|(_, s)| s.schedule()).collect();
        schedule.sort_by_key(|e| std::cmp::Reverse(e.time));
        let references = sensors.iter().map(|s| s.purpose == Purpose::Reference).collect();
        Self { heads: vec![None; sources.len()], sources, schedule, references }
    }

    /// Tells what was scheduled up to a time.
    fn due(&mut self, now: Time, fan: &mut Fan) {
        while self.schedule.last().is_some_and(|e| e.time <= now) {
            if let Some(event) = self.schedule.pop() {
                fan.event(event);
            }
        }
    }

    fn end(&self) -> Option<Time> {
        self.sources.iter().filter_map(|(_, s)| s.end()).max()
    }

    fn fill(&mut self) -> Result<(), RunError> {
        (0..self.sources.len()).try_for_each(|k| self.advance(k))
    }

    fn advance(&mut self, k: usize) -> Result<(), RunError> {
        let (name, source) = &mut self.sources[k];
        let mut sample = Sample::empty(Time::MIN, SensorId(0));
        let failed = |error| RunError::Source { source_name: name.clone(), error };
        let more = source.next(&mut sample).map_err(failed)?;
        let (found, count) = (sample.sensor.0, self.references.len());
        if found >= count {
            return Err(failed(StreamError::format(format!(
                "a sample of sensor number {found}, but there are {count}"
            ))));
        }
        self.heads[k] = more.then_some(sample);
        Ok(())
    }

    /// The earliest head; the first source of those at the same time, but what a running filter is
    /// compared with last.
    fn first(&self, running: bool) -> Option<(Sample, usize)> {
        let heads = self.heads.iter().enumerate().filter_map(|(k, h)| h.as_ref().map(|h| (h, k)));
        heads
            .min_by_key(|(h, k)| (h.time, running && self.references[h.sensor.0], *k))
            .map(|(h, k)| (*h, k))
    }

    fn warnings(&mut self, fan: &mut Fan) {
        for (name, source) in &mut self.sources {
            if let Some(text) = source.warning() {
                let time = fan.statistics.last_epoch.unwrap_or(Time::MIN);
                fan.event(Event { time, level: Level::Warning, about: name.clone(), text });
            }
        }
    }
}

/// Tells everything to everyone.
struct Fan {
    sinks: Vec<(String, Box<dyn Sink>)>,
    statistics: Statistics,
    events: Vec<Event>,
    next_epoch: Time,
}

impl Fan {
    /// Calls every sink; one that fails is closed, and named.
    fn each(&mut self, time: Time, mut call: impl FnMut(&mut dyn Sink) -> Result<(), StreamError>) {
        let mut failed = Vec::new();
        self.sinks.retain_mut(|(name, sink)| match call(sink.as_mut()) {
            Ok(()) => true,
            Err(error) => {
                // what it wrote until then may still be saved; that it fails again is no news
                sink.finish().ok();
                failed.push((std::mem::take(name), error));
                false
            }
        });
        for (about, error) in failed {
            let text = format!("{error}; the run goes on without this sink");
            self.event(Event { time, level: Level::Error, about, text });
        }
    }

    fn close(&mut self, time: Time) -> Vec<Recorded> {
        let mut recorded = Vec::new();
        for (name, mut sink) in std::mem::take(&mut self.sinks) {
            match sink.finish() {
                Ok(place) => recorded.extend(place.map(|place| Recorded { sink: name, place })),
                Err(error) => {
                    self.events.push(Event {
                        time,
                        level: Level::Error,
                        about: name,
                        text: error.to_string(),
                    });
                }
            }
        }
        recorded
    }
}

impl Observer for Fan {
    fn epoch(&mut self, epoch: &Epoch<'_>) {
        self.statistics.epoch(epoch);
        self.each(epoch.state.time, |sink| sink.epoch(epoch));
    }
    fn update(&mut self, update: &UpdateRecord<'_>) {
        self.statistics.update(update);
        self.each(update.time, |sink| sink.update(update));
    }
    fn transition(&mut self, transition: &Transition) {
        self.each(Time::MIN, |sink| sink.transition(transition));
    }
    fn correction(&mut self, update: &Update) {
        self.each(Time::MIN, |sink| sink.correction(update));
    }
    fn input(&mut self, sample: &Sample, rejected: Option<Rejection>) {
        self.statistics.input(sample, rejected);
    }
    fn event(&mut self, event: Event) {
        self.each(event.time, |sink| sink.event(&event));
        // warnings may be many; an error is always kept
        if event.level == Level::Error
            || (event.level == Level::Warning && self.events.len() < 1000)
        {
            self.events.push(event);
        }
    }
}

/// Notices sensors that fall silent.
struct Silence {
    /// The driving sensor: its clock is that of the others.
    driver: Option<usize>,
    sensors: Vec<Heard>,
    /// The time of the sample before.
    before: Time,
    next: Time,
}

/// What was heard of a sensor.
struct Heard {
    /// As the scenario gives it, s.
    timeout: Option<f64>,
    last: Option<Time>,
    /// The longest of the first intervals, s, and their number.
    usual: (f64, u32),
    lost: bool,
}

impl Heard {
    /// How long it may be silent, s: by default three times the usual, and at least 5 s. One that
    /// spoke once has no usual.
    fn timeout(&self) -> f64 {
        match (self.timeout, self.usual) {
            (Some(given), _) => given,
            (None, (_, 0)) => f64::INFINITY,
            (None, (usual, _)) => (3.0 * usual).ceil().max(5.0),
        }
    }
}

impl Silence {
    /// How often it looks for silent sensors.
    const PERIOD: Time = Time::from_nanos(100_000_000);
    /// How many intervals tell what is usual.
    const INTERVALS: u32 = 8;

    fn new(timeouts: Vec<Option<f64>>, sensors: &[SensorInfo]) -> Self {
        Self {
            driver: sensors.iter().position(|s| s.purpose == Purpose::Input),
            sensors: timeouts
                .into_iter()
                .map(|timeout| Heard { timeout, last: None, usual: (0.0, 0), lost: false })
                .collect(),
            before: Time::MIN,
            next: Time::MIN,
        }
    }

    fn heard(&mut self, sample: &Sample, sensors: &[SensorInfo], fan: &mut Fan) {
        let now = sample.time;
        // one wrong stamp among good ones is no clock
        let clock = now.min(std::mem::replace(&mut self.before, now));
        if clock >= self.next {
            self.next = clock + Self::PERIOD;
            self.check(clock, sensors, fan);
        }
        let heard = &mut self.sensors[sample.sensor.0];
        let Some(last) = heard.last.replace(now) else { return };
        if heard.usual.1 < Self::INTERVALS {
            heard.usual = (heard.usual.0.max(now.since(last)), heard.usual.1 + 1);
        }
        if std::mem::take(&mut heard.lost) {
            let name = &sensors[sample.sensor.0].name;
            let text = format!("{name} is back after {:.1} s", now.since(last));
            fan.event(Event { time: now, level: Level::Info, about: name.clone(), text });
        }
    }

    fn check(&mut self, clock: Time, sensors: &[SensorInfo], fan: &mut Fan) {
        let driven = self.driver.map(|d| self.sensors[d].last.unwrap_or(Time::MIN));
        for (k, (heard, sensor)) in self.sensors.iter_mut().zip(sensors).enumerate() {
            let now = driven.filter(|_| self.driver != Some(k)).unwrap_or(clock);
            let timeout = heard.timeout();
            if !heard.lost && heard.last.is_some_and(|last| now.since(last) > timeout) {
                heard.lost = true;
                let text = format!("{} lost: no sample for {timeout} s", sensor.name);
                fan.event(Event {
                    time: now,
                    level: Level::Warning,
                    about: sensor.name.clone(),
                    text,
                });
            }
        }
    }
}
