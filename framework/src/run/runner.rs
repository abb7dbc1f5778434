//! The runner: merges the sources in order of time, feeds the filter, and passes the results on to
//! the sinks.

use crate::compose::Composition;
use crate::compose::estimator::Estimator;
use crate::filter::Timeline;
use crate::model::estimator_error::EstimatorError;
use crate::model::record::finding::Finding;
use crate::model::record::{Event, Level, Observer, Record, Wants};
use crate::model::sensor::SensorInfo;
use crate::model::stream::{NamedSink, RunInfo, Sink, StreamError};
use crate::run::delayed::delayed;
use crate::run::estimators;
use crate::run::merge::Merge;
use crate::run::output_rate::OutputRate;
use crate::run::outputs::Outputs;
use crate::run::scenario::Assembly;
use crate::run::silence::SilenceMonitor;
use crate::run::summary::{Recorded, Statistics, Summary};
use crate::run::verdict::Judge;
use crate::smooth::{QualityReport, SmoothError, Smoother};
use crate::units::sample::Sample;
use crate::units::time::{Span, Time};
use std::any::Any;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// The reason for which a run ended early. Everything recorded until then is kept.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// A source failed.
    #[error("source {source_name}: {error}")]
    Source {
        /// The source's name in the scenario.
        source_name: String,
        /// The reason.
        #[source]
        error: StreamError,
    },
    /// The filter cannot continue.
    #[error(transparent)]
    Estimator(#[from] EstimatorError),
    /// The run cannot be smoothed.
    #[error("the run cannot be smoothed: {0}")]
    Smooth(#[from] SmoothError),
    /// The samples ended before a process had found its initial values.
    #[error("{0}")]
    Unfinished(String),
    /// The filter never started.
    #[error("{0}")]
    NeverStarted(String),
}

/// The end of a run. The summary is there also after an error.
pub struct Finished {
    /// The results in numbers.
    pub summary: Summary,
    /// The places that the sinks wrote to.
    pub recorded: Vec<Recorded>,
    /// Warnings and errors in order of time.
    pub events: Vec<Event>,
    /// Faults that the filter found, in order of time.
    pub findings: Vec<Finding>,
    /// The error that ended the run early.
    pub error: Option<RunError>,
    /// True for a run that was interrupted.
    pub interrupted: bool,
    /// The sinks that the assembly had, each with its name; a sink that failed is among them.
    pub sinks: Vec<NamedSink>,
}

impl Finished {
    /// Takes the first sink of type `T` out of the result.
    ///
    /// ```
    /// # use navfuse_core::prelude::*;
    /// # use navfuse_core::run::runner;
    /// # use navfuse_core::run::scenario::Assembly;
    /// # use std::sync::atomic::AtomicBool;
    /// /// Counts the estimates.
    /// #[derive(Default)]
    /// struct Epochs(usize);
    /// impl Sink for Epochs {
    ///     fn wants(&self) -> Wants {
    ///         Wants::EPOCHS
    ///     }
    ///     fn take(&mut self, _: &Record<'_>) -> Result<(), StreamError> {
    ///         self.0 += 1;
    ///         Ok(())
    ///     }
    /// }
    /// fn epochs(mut assembly: Assembly) -> Option<usize> {
    ///     assembly.sinks.push(("epochs".into(), Box::new(Epochs::default())));
    ///     let mut finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    ///     finished.take_sink::<Epochs>().map(|epochs| epochs.0)
    /// }
    /// ```
    pub fn take_sink<T: Sink>(&mut self) -> Option<T> {
        let at = self.sinks.iter().position(|(_, sink)| (sink.as_ref() as &dyn Any).is::<T>())?;
        let (_, sink) = self.sinks.remove(at);
        let sink: Box<dyn Any> = sink;
        sink.downcast().ok().map(|sink| *sink)
    }
}

impl std::fmt::Debug for Finished {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Finished")
            .field("summary", &self.summary)
            .field("recorded", &self.recorded)
            .field("events", &self.events)
            .field("findings", &self.findings)
            .field("error", &self.error)
            .field("interrupted", &self.interrupted)
            .finish_non_exhaustive()
    }
}

/// Progress of a run.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// The time that the run has reached.
    pub now: Time,
    /// The time of the last sample, where the sources know it.
    pub end: Option<Time>,
}

/// Runs an assembly to its end, or until `stop` is set, and calls `progress` from time to time.
pub fn run(assembly: Assembly, stop: &AtomicBool, mut progress: impl FnMut(Progress)) -> Finished {
    let clock = Instant::now();
    let mut run = Run::begin(assembly);
    run.process_samples(stop, &mut progress);
    run.finish_filter();
    run.record_last_epoch();
    run.smooth();
    run.log_silent_sensors();
    run.log_end();
    let now = run.estimator.time();
    let finished = run.close(clock);
    progress(Progress { now, end: Some(now) });
    finished
}

/// Samples between two calls of the progress function.
const PROGRESS: u64 = 4096;

/// A run while it goes on.
struct Run {
    estimator: Box<dyn Estimator>,
    /// Samples that wait for late ones, where a sensor may be late.
    timeline: Option<Timeline>,
    merge: Merge,
    silence: SilenceMonitor,
    outputs: Outputs,
    /// Output rate of the newest estimates.
    newest: OutputRate,
    sensors: Vec<SensorInfo>,
    /// `estimator.stop`.
    until: Option<Time>,
    error: Option<RunError>,
    interrupted: bool,
    /// Quality of a run that is smoothed.
    quality: Option<QualityReport>,
}

impl Run {
    /// Opens the run: informs the sinks, reads the first samples, and logs the notes of the parts.
    fn begin(assembly: Assembly) -> Self {
        let Assembly { composition, sources, sinks } = assembly;
        let info = run_info(&composition);
        let judge = Judge::new(&composition);
        let rate = OutputRate::new(composition.estimator.output_period());
        let mut outputs = Outputs::new(sinks, Statistics::new(&info), rate, judge);
        outputs.start(&info);
        let sensors = info.sensors;
        let timeouts = composition.sensors.iter().map(|s| s.timeout).collect();
        let notes = composition.notes.clone();
        let mut run = Self {
            until: composition.estimator.stop(),
            merge: Merge::new(delayed(sources, &composition), &sensors),
            timeline: Timeline::new(&composition),
            estimator: estimators::create(composition),
            silence: SilenceMonitor::new(timeouts, &sensors),
            outputs,
            newest: rate,
            sensors,
            error: None,
            interrupted: false,
            quality: None,
        };
        run.error = run.merge.fill().err();
        if let Some(filter) = estimators::filter(run.estimator.as_ref()) {
            match Smoother::new(filter) {
                Ok(smoother) => run.outputs.smoother = smoother,
                Err(error) => run.error = Some(error.into()),
            }
        }
        let time = run.merge.first(false).map_or(Time::MIN, |source| run.merge.sample(source).time);
        for (about, text) in notes {
            run.outputs.event(Event { time, level: Level::Info, about, text });
        }
        run
    }

    /// Takes all samples in the order of their arrival.
    fn process_samples(&mut self, stop: &AtomicBool, progress: &mut impl FnMut(Progress)) {
        let end = self.merge.end().map(|e| self.until.map_or(e, |u| u.min(e)));
        let mut count = 0_u64;
        while self.error.is_none() {
            let Some(source) = self.merge.first(self.estimator.running()) else { break };
            let sample = self.merge.sample(source);
            if self.until.is_some_and(|u| sample.time > u + self.window()) {
                break;
            }
            if stop.load(Ordering::Relaxed) {
                self.interrupted = true;
                break;
            }
            if let Err(error) = self.take(&sample) {
                self.error = Some(error.into());
                break;
            }
            if let Some(error) = self.outputs.smoother.as_mut().and_then(Smoother::failed) {
                self.error = Some(error.into());
                break;
            }
            count += 1;
            if count.is_multiple_of(PROGRESS) {
                progress(Progress { now: sample.time, end });
            }
            self.error = self.merge.advance(source).err();
        }
        if let Some(timeline) = &mut self.timeline
            && self.error.is_none()
        {
            timeline.close();
            self.error = self.process_settled().err().map(RunError::from);
        }
    }

    /// Longest time from a sample to its arrival.
    fn window(&self) -> Span {
        self.timeline.as_ref().map_or(Span::ZERO, Timeline::window)
    }

    /// Takes a sample that arrives.
    fn take(&mut self, sample: &Sample) -> Result<(), EstimatorError> {
        if self.until.is_some_and(|until| sample.time > until) {
            return Ok(()); // late samples before the end may follow
        }
        let Some((timeline, filter)) =
            self.timeline.as_mut().zip(estimators::settled_mut(self.estimator.as_mut()))
        else {
            return self.process(sample);
        };
        if !timeline.arrive(sample, filter, &mut self.outputs) {
            self.outputs.send(sample.time, &Record::Sample(sample));
            self.outputs.statistics.read(sample);
            return Ok(());
        }
        self.process_settled()?;
        self.show_newest();
        Ok(())
    }

    /// Processes the samples that no late sample can precede.
    fn process_settled(&mut self) -> Result<(), EstimatorError> {
        while let Some(timeline) = &mut self.timeline
            && let Some(sample) = timeline.release(self.estimator.running())
        {
            self.process(&sample)?;
            if let Some(timeline) = &mut self.timeline
                && estimators::has_jumped(self.estimator.as_mut())
            {
                timeline.forget_copies();
            }
        }
        Ok(())
    }

    /// Shows the newest estimate to the sinks that want it, once in each period of the output rate.
    fn show_newest(&mut self) {
        let Self { timeline: Some(timeline), outputs, estimator, .. } = self else { return };
        let Some(filter) = estimators::settled_mut(estimator.as_mut()) else { return };
        let Some(now) = timeline.now() else { return };
        if outputs.want(Wants::NEWEST) && self.newest.is_due(now) {
            self.newest.begin_period(now);
            timeline.newest(filter, |epoch| {
                outputs.send(epoch.state.time, &Record::Newest(epoch));
            });
        }
    }

    /// Passes one sample on to the filter and the sinks.
    fn process(&mut self, sample: &Sample) -> Result<(), EstimatorError> {
        self.record_epoch(sample.time);
        self.release(sample.time);
        self.merge.log_schedule(sample.time, &mut self.outputs);
        self.outputs.send(sample.time, &Record::Sample(sample));
        self.outputs.statistics.read(sample);
        self.estimate(sample)?;
        if let Some(filter) = estimators::filter_mut(self.estimator.as_mut())
            && let Some(samples) = filter.take_found()
        {
            if let Some(smoother) = &mut self.outputs.smoother {
                smoother.begin(filter);
            }
            for sample in &samples {
                self.record_epoch(sample.time);
                self.release(sample.time);
                self.estimate(sample)?;
            }
        }
        self.silence.sample(sample, &self.sensors, &mut self.outputs);
        Ok(())
    }

    /// Passes one sample on to the estimator. A filter leaves the samples of a search that ends to
    /// the runner, so that the smoother may keep the filter between them.
    fn estimate(&mut self, sample: &Sample) -> Result<(), EstimatorError> {
        let Self { estimator, outputs, .. } = self;
        let Some(filter) = estimators::filter_mut(estimator.as_mut()) else {
            return estimator.process(sample, outputs);
        };
        if let Some(smoother) = &mut outputs.smoother {
            smoother.sample(filter, sample);
        }
        let taken = filter.take(sample, outputs);
        if let (Err(_), Some(smoother)) = (&taken, &mut outputs.smoother) {
            // the estimate before the sample is the last good one
            smoother.take_back();
        }
        taken
    }

    /// Records the estimate when one is due and every sample of the state's time has been used,
    /// unless a reference has caused the estimate to be recorded already.
    fn record_epoch(&mut self, next_sample: Time) {
        let now = self.estimator.time();
        if self.estimator.running() && self.outputs.rate.is_due(now) && next_sample > now {
            self.outputs.rate.begin_period(now);
            self.record_last_epoch();
        }
    }

    /// Records the current estimate unless it is recorded already.
    fn record_last_epoch(&mut self) {
        if self.estimator.running() {
            self.estimator.settle(&mut self.outputs);
            self.outputs.record(&self.estimator.epoch());
        }
    }

    /// Passes on the estimates of which the filter is the lag ahead, once every sample of its time
    /// has been used.
    fn release(&mut self, next_sample: Time) {
        let Self { outputs, estimator, .. } = self;
        let now = estimator.time();
        let due = |smoother: &mut Smoother| next_sample > now && smoother.is_due(now);
        if let Some(mut smoother) = outputs.smoother.take_if(due) {
            if let Some(filter) = estimators::filter_mut(estimator.as_mut()) {
                smoother.release(filter, |epoch| outputs.smoothed(epoch));
            }
            outputs.smoother = Some(smoother);
        }
    }

    /// Lets the filter use the samples that it holds, and finds out whether it ever started.
    fn finish_filter(&mut self) {
        if let Some(smoother) = &mut self.outputs.smoother {
            smoother.finish();
        }
        self.estimator.finish(&mut self.outputs);
        let time = self.outputs.statistics.last_epoch.unwrap_or(Time::MIN);
        self.merge.log_warnings(time, &mut self.outputs);
        let mut unfinished: Vec<Event> = self.estimator.unfinished();
        if self.error.is_none()
            && !self.interrupted
            && let Some(at) = unfinished.iter().position(|e| e.level == Level::Error)
        {
            let Event { about, text, .. } = unfinished.remove(at);
            self.error = Some(RunError::Unfinished(format!("{about}: {text}")));
        }
        if self.error.is_none() {
            for event in unfinished {
                self.outputs.judge.unfinished(&event.about, &event.text);
                self.outputs.event(event);
            }
        }
        if self.error.is_none() && !self.estimator.running() && !self.interrupted {
            self.error =
                Some(RunError::NeverStarted(estimators::never_started(self.estimator.as_ref())));
        }
    }

    /// Passes backward over the run, or over the rest of it, and gives the smoothed estimates to
    /// the sinks and the statistics.
    fn smooth(&mut self) {
        let Some(smoother) = self.outputs.smoother.take() else { return };
        let Self { estimator, outputs, .. } = self;
        let Some(filter) = estimators::filter_mut(estimator.as_mut()) else { return };
        let end = filter.snapshot();
        let result = smoother.end(filter, |epoch| outputs.smoothed(epoch));
        filter.restore(&end);
        let time = self.estimator.time();
        match result {
            Ok(quality) => self.quality = quality,
            Err(error) => drop(self.error.get_or_insert(error.into())),
        }
        let events = self.quality.as_ref().map(|quality| quality.events(time));
        events.into_iter().flatten().for_each(|event| self.outputs.event(event));
    }

    /// Warns of sensors that gave no sample at all.
    fn log_silent_sensors(&mut self) {
        for event in self.outputs.statistics.silent(self.estimator.as_ref()) {
            self.outputs.event(event);
        }
    }

    /// Logs an early end.
    fn log_end(&mut self) {
        let (level, text) = match &self.error {
            Some(error) => (Level::Error, error.to_string()),
            None if self.interrupted => (Level::Warning, "interrupted".to_owned()),
            None => return,
        };
        let time = self.estimator.time();
        self.outputs.event(Event { time, level, about: "run".into(), text });
    }

    /// Closes the sinks and sums the run up.
    fn close(mut self, clock: Instant) -> Finished {
        let end = self.estimator.time();
        let verdict = self.outputs.verdict(end, self.error.as_ref().map(ToString::to_string));
        let recorded = self.outputs.close(end);
        let mut summary = self.outputs.statistics.summary(self.estimator.as_ref(), verdict);
        summary.smoothing = self.quality;
        summary.wall_s = clock.elapsed().as_secs_f64();
        let findings = std::mem::take(&mut self.outputs.findings);
        let (events, sinks) = self.outputs.into_parts();
        let Self { error, interrupted, .. } = self;
        Finished { summary, recorded, events, findings, error, interrupted, sinks }
    }
}

/// The facts about a run that its sinks receive first.
fn run_info(composition: &Composition) -> RunInfo {
    RunInfo {
        name: composition.name.clone(),
        description: composition.description.clone(),
        scenario: composition.text.clone(),
        seed: composition.seed,
        simulated: composition.simulated,
        smoothed: composition.estimator.smooths(),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        layout: (*composition.layout).clone(),
        sensors: composition.sensors.iter().map(|s| s.info.clone()).collect(),
    }
}
