//! A session: the filter and everything around it that follows the samples of a run.

use crate::checkpoint::{Io, Part};
use crate::compose::Composition;
use crate::compose::estimator::Estimator;
use crate::filter::Timeline;
use crate::model::estimator_error::EstimatorError;
use crate::model::record::verdict::Verdict;
use crate::model::record::{Epoch, Event, Level, Observer, Record, Wants};
use crate::model::sensor::SensorInfo;
use crate::model::stream::{NamedSink, RunInfo};
use crate::session::announced::Announced;
use crate::session::estimators;
use crate::session::finished::{End, Finished, RunError};
use crate::session::info::run_info;
use crate::session::output_rate::OutputRate;
use crate::session::outputs::Outputs;
use crate::session::riding::Riding;
use crate::session::silence::SilenceMonitor;
use crate::session::summary::Statistics;
use crate::session::verdict::Judge;
use crate::smooth::{QualityReport, SmoothError, Smoother};
use crate::units::sample::Sample;
use crate::units::time::{Span, Time};

/// A run while it goes on: samples are pushed in the order of their arrival, and the sinks receive
/// the records at once.
///
/// A session knows no clock, no file and no thread. The runner pushes the samples of files; a
/// program on a vehicle pushes the samples of its instruments:
/// ```
/// use navfuse_core::compose::Composition;
/// use navfuse_core::session::{End, Session};
/// use navfuse_core::units::sample::{Sample, SensorId};
/// use navfuse_core::units::time::Time;
///
/// /// Passes pings of a speed log (ns, m/s) through the filter, and prints each estimate.
/// fn navigate(composition: Composition, pings: &[(i64, f64)]) {
///     let log = SensorId(composition.sensor("log").expect("the scenario has a log"));
///     let mut session = Session::new(composition, Vec::new());
///     let end = pings.iter().try_for_each(|(time, speed)| {
///         session.push(&Sample::new(Time::from_nanos(*time), log, &[*speed]))?;
///         session.newest(|epoch| println!("{}: {:?}", epoch.state.time, epoch.state.values));
///         Ok(())
///     });
///     let finished = session.finish(End::from(end));
///     println!("{:?}", finished.summary.verdict);
/// }
/// ```
pub struct Session {
    estimator: Box<dyn Estimator>,
    /// Samples that wait for late ones, where a sensor may be late.
    timeline: Option<Timeline>,
    /// Samples that wait for the pose of another body, where a sensor rides on one.
    riding: Option<Riding>,
    silence: SilenceMonitor,
    outputs: Outputs,
    /// Rate of the newest estimates.
    newest: OutputRate,
    sensors: Vec<SensorInfo>,
    announced: Announced,
    /// Set once a sample is beyond `estimator.stop`.
    over: bool,
    error: Option<RunError>,
}

impl Session {
    /// Begins a run, and informs the sinks. An error of the smoother is returned with the first
    /// sample.
    pub fn new(composition: Composition, sinks: Vec<NamedSink>) -> Self {
        let info = run_info(&composition);
        let mut session = Self::build(composition, &info, sinks);
        session.begin(&info);
        session
    }

    pub(super) fn composition(&self) -> &Composition {
        self.estimator.composition()
    }

    /// Saves or restores everything that changes during the run, after the parts of its scenario.
    pub(super) fn memory(&mut self, parts: &[Part], io: &mut Io<'_>) {
        let Self {
            estimator,
            timeline,
            riding,
            silence,
            outputs,
            newest,
            sensors: _,
            announced,
            over,
            error: _,
        } = self;
        Part::pass_all(parts, io);
        if estimator.composition().estimator.smooths() {
            io.refuse("the smoother needs every step since the start; remove `smooth` and `lag`");
        }
        estimator.memory(io);
        io.part("late samples", |io| io.each(timeline));
        io.part("samples on other bodies", |io| io.each(riding));
        io.part("silence", |io| io.pass(silence));
        io.part("results", |io| io.pass(outputs));
        io.part("events", |io| io.pass(announced));
        io.pass(newest);
        io.pass(over);
    }

    /// Builds the parts of a run.
    pub(super) fn build(composition: Composition, info: &RunInfo, sinks: Vec<NamedSink>) -> Self {
        let rate = OutputRate::new(composition.estimator.output_period());
        let newest = OutputRate::new(composition.estimator.newest_period());
        let judge = Judge::new(&composition);
        let timeouts = composition.sensors.iter().map(|s| s.timeout).collect();
        Self {
            silence: SilenceMonitor::new(timeouts, &info.sensors),
            timeline: Timeline::new(&composition),
            riding: Riding::new(&composition),
            announced: Announced::new(composition.notes.clone()),
            estimator: estimators::create(composition),
            outputs: Outputs::new(sinks, Statistics::new(info), rate, judge),
            newest,
            sensors: info.sensors.clone(),
            over: false,
            error: None,
        }
    }

    /// Informs the sinks, and begins the smoother.
    pub(super) fn begin(&mut self, info: &RunInfo) {
        self.outputs.start(info);
        if let Some(filter) = self.estimator.linearised() {
            match Smoother::new(filter) {
                Ok(smoother) => self.outputs.smoother = smoother,
                Err(error) => self.error = Some(error.into()),
            }
        }
    }

    /// Announces events, each of which is logged once the samples reach its time. An event at
    /// [`Time::MIN`] is logged with the first sample.
    pub fn announce(&mut self, events: Vec<Event>) {
        self.announced.add(events);
    }

    /// Keeps a warning for the end of the log, such as that a file was cut off.
    pub fn warn_at_end(&mut self, about: String, text: String) {
        self.announced.add_warning(about, text);
    }

    /// Asks the sinks to begin new files, as [`crate::model::stream::Sink::reopen`] does.
    pub fn reopen(&mut self) {
        self.outputs.reopen(self.estimator.time());
    }

    /// Returns `true` once there is an estimate.
    pub fn running(&self) -> bool {
        self.estimator.running()
    }

    /// Time of the estimate.
    pub fn time(&self) -> Time {
        self.estimator.time()
    }

    /// The key `estimator.stop`.
    pub fn stop(&self) -> Option<Time> {
        self.estimator.composition().estimator.stop()
    }

    /// Returns `true` once the samples have passed `estimator.stop`, and no late one can precede it.
    pub fn is_over(&self) -> bool {
        self.over
    }

    /// Takes a sample that arrives.
    ///
    /// # Errors
    /// When the run cannot go on. The records until then are kept: [`Self::finish`] with the error.
    pub fn push(&mut self, sample: &Sample) -> Result<(), RunError> {
        self.announced.begin(sample.time, &mut self.outputs);
        self.failed()?;
        if self.stop().is_some_and(|stop| sample.time > stop) {
            // late samples before the end may follow
            let window = self.timeline.as_ref().map_or(Span::ZERO, Timeline::window);
            self.over = self.stop().is_some_and(|stop| sample.time > stop + window);
            return Ok(());
        }
        self.take(sample)?;
        self.show_newest();
        let failed = self.outputs.smoother.as_mut().and_then(Smoother::failed);
        failed.map_or(Ok(()), |error| Err(error.into()))
    }

    /// Advances the time without a sample: it reports sensors that are silent at this time, and
    /// uses samples that no late one can precede any more. No estimate changes, so a run without
    /// ticks gives the same estimates. As after a driving sample of this time, it rejects samples
    /// that are later than their `late`.
    ///
    /// `now` is a time of the driving sensor's clock.
    ///
    /// # Errors
    /// As [`Self::push`].
    pub fn tick(&mut self, now: Time) -> Result<(), RunError> {
        if let Some(timeline) = &mut self.timeline {
            timeline.reach(now);
        }
        self.process_settled()?;
        self.silence.tick(now, &self.sensors, &mut self.outputs);
        Ok(())
    }

    /// Shows the estimate after all samples that have arrived; `None` before the start. A late
    /// sample may still change it.
    pub fn newest<T>(&mut self, look: impl FnOnce(&Epoch<'_>) -> T) -> Option<T> {
        estimators::newest(&mut self.timeline, self.estimator.as_mut(), look)
    }

    /// The verdict on the run so far.
    pub fn health(&self) -> Verdict {
        self.outputs.health()
    }

    fn take(&mut self, sample: &Sample) -> Result<(), EstimatorError> {
        let Some(riding) = &mut self.riding else { return self.use_complete(sample) };
        riding.arrive(sample);
        self.use_ridden()
    }

    /// Uses the samples that do not wait for the pose of another body any more.
    fn use_ridden(&mut self) -> Result<(), EstimatorError> {
        while let Some(sample) = self.riding.as_mut().and_then(Riding::next) {
            self.use_complete(&sample)?;
        }
        Ok(())
    }

    /// Takes a sample that has all its channels.
    fn use_complete(&mut self, sample: &Sample) -> Result<(), EstimatorError> {
        let Some((timeline, filter)) = self.timeline.as_mut().zip(self.estimator.settled()) else {
            return self.process(sample);
        };
        if !timeline.arrive(sample, filter, &mut self.outputs) {
            self.outputs.send(sample.time, &Record::Sample(sample));
            self.outputs.statistics.read(sample);
            return Ok(());
        }
        self.process_settled()
    }

    /// Processes the samples that no late sample can precede.
    fn process_settled(&mut self) -> Result<(), EstimatorError> {
        while let Some(timeline) = &mut self.timeline
            && let Some(sample) = timeline.release(self.estimator.running())
        {
            self.process(&sample)?;
            if let Some(timeline) = &mut self.timeline
                && self.estimator.has_jumped()
            {
                timeline.forget_copies();
            }
        }
        Ok(())
    }

    /// Shows the newest estimate to the sinks that want it, once in each period of their rate.
    fn show_newest(&mut self) {
        let Self { timeline, outputs, estimator, .. } = self;
        let settled = estimator.running().then(|| estimator.time());
        let Some(now) = timeline.as_ref().map_or(settled, Timeline::now) else { return };
        if outputs.want(Wants::NEWEST) && self.newest.is_due(now) {
            self.newest.begin_period(now);
            estimators::newest(timeline, estimator.as_mut(), |epoch| {
                outputs.send(epoch.state.time, &Record::Newest(epoch));
            });
        }
    }

    /// Passes one sample on to filter and sinks.
    fn process(&mut self, sample: &Sample) -> Result<(), EstimatorError> {
        self.record_epoch(sample.time);
        self.release(sample.time);
        self.announced.reach(sample.time, &mut self.outputs);
        self.outputs.send(sample.time, &Record::Sample(sample));
        self.outputs.statistics.read(sample);
        self.estimate(sample)?;
        if let Some(filter) = self.estimator.linearised()
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
    /// the session, so that the smoother may keep the filter between them.
    fn estimate(&mut self, sample: &Sample) -> Result<(), EstimatorError> {
        let Self { estimator, outputs, .. } = self;
        let Some(filter) = estimator.linearised() else {
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

    /// Passes on the estimates that lie the lag behind the filter, once every sample of the
    /// filter's time has been used.
    fn release(&mut self, next_sample: Time) {
        let Self { outputs, estimator, .. } = self;
        let now = estimator.time();
        let due = |smoother: &mut Smoother| next_sample > now && smoother.is_due(now);
        if let Some(mut smoother) = outputs.smoother.take_if(due) {
            if let Some(filter) = estimator.linearised() {
                smoother.release(filter, |epoch| outputs.smoothed(epoch));
            }
            outputs.smoother = Some(smoother);
        }
    }

    /// Ends the run: records what is left, smooths, judges, and closes the sinks. The wall time of
    /// the summary is zero, since a session has no clock.
    pub fn finish(mut self, end: End) -> Finished {
        let interrupted = matches!(end, End::Interrupted);
        let mut result = match end {
            End::Failed(error) => Err(error),
            End::Complete | End::Interrupted => self.failed(),
        };
        result = result.and_then(|()| Ok(self.process_rest()?));
        self.finish_filter();
        result = result.and_then(|()| self.log_unfinished(interrupted));
        self.record_last_epoch();
        let quality = match self.smooth() {
            Ok(quality) => quality,
            Err(error) => {
                result = result.and(Err(error.into()));
                None
            }
        };
        for event in self.outputs.statistics.silent(self.estimator.as_ref()) {
            self.outputs.event(event);
        }
        let error = result.err();
        self.log_end(error.as_ref(), interrupted);
        self.close(error, interrupted, quality)
    }

    /// Error of the smoother, if it could not begin.
    fn failed(&mut self) -> Result<(), RunError> {
        self.error.take().map_or(Ok(()), Err)
    }

    /// Processes the samples that wait for the pose of another body or for late ones.
    fn process_rest(&mut self) -> Result<(), EstimatorError> {
        if let Some(riding) = &mut self.riding {
            riding.close();
        }
        self.use_ridden()?;
        if let Some(timeline) = &mut self.timeline {
            timeline.close();
        }
        self.process_settled()
    }

    /// Lets the filter use the samples that it holds, and logs the warnings for the end.
    fn finish_filter(&mut self) {
        self.announced.begin(self.estimator.time(), &mut self.outputs);
        if let Some(smoother) = &mut self.outputs.smoother {
            smoother.finish();
        }
        estimators::finish(self.estimator.as_mut(), &mut self.outputs);
        let time = self.outputs.statistics.last_epoch.unwrap_or(Time::MIN);
        self.announced.end(time, &mut self.outputs);
    }

    /// Logs the processes that have not found their initial values. Unless the run was interrupted,
    /// it is an error if a process needs them, or if the filter never started.
    fn log_unfinished(&mut self, interrupted: bool) -> Result<(), RunError> {
        let unfinished = self.estimator.unfinished();
        let fatal = unfinished.iter().find(|e| e.level == Level::Error && !interrupted);
        if let Some(Event { about, text, .. }) = fatal {
            return Err(RunError::Unfinished(format!("{about}: {text}")));
        }
        for event in unfinished {
            self.outputs.judge.unfinished(&event.about, &event.text);
            self.outputs.event(event);
        }
        if !self.estimator.running() && !interrupted {
            let reason = estimators::never_started(self.estimator.as_ref());
            return Err(RunError::NeverStarted(reason));
        }
        Ok(())
    }

    /// Passes backward over the run, or over the rest of it, and gives the smoothed estimates to
    /// the sinks and the statistics.
    fn smooth(&mut self) -> Result<Option<QualityReport>, SmoothError> {
        let Some(smoother) = self.outputs.smoother.take() else { return Ok(None) };
        let Self { estimator, outputs, .. } = self;
        let Some(filter) = estimator.linearised() else { return Ok(None) };
        let end = filter.snapshot();
        let result = smoother.end(filter, |epoch| outputs.smoothed(epoch));
        filter.restore(&end);
        let time = self.estimator.time();
        let quality = result?;
        let events = quality.as_ref().map(|quality| quality.events(time));
        events.into_iter().flatten().for_each(|event| self.outputs.event(event));
        Ok(quality)
    }

    /// Logs an early end.
    fn log_end(&mut self, error: Option<&RunError>, interrupted: bool) {
        let (level, text) = match error {
            Some(error) => (Level::Error, error.to_string()),
            None if interrupted => (Level::Warning, "interrupted".to_owned()),
            None => return,
        };
        let time = self.estimator.time();
        self.outputs.event(Event { time, level, about: "run".into(), text });
    }

    /// Closes the sinks and sums the run up.
    fn close(
        mut self,
        error: Option<RunError>,
        interrupted: bool,
        quality: Option<QualityReport>,
    ) -> Finished {
        let time = self.estimator.time();
        let verdict = self.outputs.verdict(time, error.as_ref());
        let recorded = self.outputs.close(time, &self.estimator.corrected());
        let mut summary = self.outputs.statistics.summary(self.estimator.as_ref(), verdict);
        summary.smoothing = quality;
        let findings = std::mem::take(&mut self.outputs.findings);
        let (events, sinks) = self.outputs.into_parts();
        Finished { time, summary, recorded, events, findings, error, interrupted, sinks }
    }
}
