//! An estimator that smooths its first seconds while it runs, and goes on from a state that is linearised
//! at their smoothed trajectory.
//!
//! A filter linearises each sample at the estimate of its time. Where the prior is wide, the noise
//! moves that estimate from sample to sample, and the derivatives with it. The null space of the
//! measurements, such as a rotation of a DVL about the velocity, then differs between samples, and
//! the filter takes the difference for information (Huang, Mourikis & Roumeliotis, *IJRR* 29,
//! 2010). With one trajectory for all samples the null space is that of one linear system.
//!
//! After `T / 64`, whenever the time since the start has grown by a quarter, and after `T`, the
//! filter takes all samples since the start once more, linearised at the trajectory `c` that they
//! smooth to, and again until its estimate stays (Gauss-Newton). It goes on from `c [+] d`, and the
//! samples are forgotten after `T`. The records of the filter give the first trajectory, so a pass
//! is one run of the filter over these samples, and a backward recursion for the mean alone
//! (`means.rs`). All times together repeat `5 T` of samples for each pass.
//!
//! Findings of comparisons with the estimate wait until the last passes, since each pass compares
//! anew: those of the last one count.
//!
//! Without a span in the scenario, it does so only while the products of errors that the processes
//! neglect matter (`watch.rs`).

use super::change::Change;
use super::means::{Points, Records};
use super::recording::{Pass, Recording};
use super::watch::{self, Due, Watch};
use crate::checkpoint::Io;
use crate::compose::Composition;
use crate::compose::estimator::Estimator;
use crate::compose::{estimator::Linearised, snapshot::Snapshot};
use crate::filter::EstimatorError;
use crate::model::process::start::AlignmentReport;
use crate::model::record::finding::Finding;
use crate::model::record::{Corrected, Epoch, Event, Level, Observer, Repetition, Truth};
use crate::state::covariance::Covariance;
use crate::state::{Block, State};
use crate::units::sample::Sample;
use crate::units::time::{Span, Time};
use std::borrow::Cow;
use std::sync::Arc;

/// Largest number of passes at one time.
const PASSES: u32 = 12;

/// Largest change of the estimate by a pass, in its sigma, at which the passes have converged, and
/// that at the last time. The error of the trajectory counts in the second order alone, and the next
/// time takes the same samples again.
const CONVERGED: f64 = 0.1;
const CONVERGED_LAST: f64 = 1e-3;

/// Change of the estimate by a pass, in its sigma, that may be larger than that of the pass before.
/// The trajectory then lies within the uncertainty, and passes that swing about the solution end at it.
const WITHIN: f64 = 1.0;

/// Part of the span after which the first passes are made.
const FIRST: i64 = 64;

/// Part by which the time since the start grows until the next passes.
const GROWTH: i64 = 4;

/// Part of the time since the start after which passes that failed are tried again, twice of it.
const RETRY: i64 = 128;

/// Number of failures in a row that are reported; few samples at an uncertain heading may fail once.
const REPORTED: u32 = 3;

/// Reason for passes that the scenario does not ask for.
const WHY: &str = ", since products of errors that the processes neglect mattered";

/// Number of samples that are kept before the filter starts.
const WAITING: usize = 256;

/// An estimator whose first samples are linearised again.
pub(crate) struct Relinearised {
    estimator: Box<dyn Estimator>,
    record: Option<Box<Record>>,
    /// Set when samples were linearised again, until the caller knows it.
    jumped: bool,
}

/// The samples since the start, until the last passes are made.
struct Record {
    /// The filter before the first sample, which has not started.
    first: Snapshot,
    samples: Vec<Sample>,
    /// Time from the start to the next passes, and to the last ones.
    next: Span,
    span: Span,
    /// Number of times in a row at which the passes failed.
    failures: u32,
    /// Set where the products of errors decide about the passes.
    watch: Option<Watch>,
    /// Time from the start before which no passes are tried after some that failed.
    retry: Span,
    /// Findings that compare samples with the estimate: of the run, and of the last pass.
    findings: Vec<Finding>,
    found: Vec<Finding>,
    /// Records of the filter, and of the last pass.
    run: Records,
    pass: Records,
}

impl Relinearised {
    /// Lets an estimator linearise the samples of the span after its start again.
    pub(crate) fn new(estimator: Box<dyn Estimator>, span: Span) -> Self {
        Self::with(estimator, span, Span::from_nanos(span.nanos() / FIRST), None)
    }

    /// Lets an estimator linearise the samples since its start again while the products of errors
    /// matter.
    pub(crate) fn watching(estimator: Box<dyn Estimator>) -> Self {
        Self::with(estimator, watch::LONGEST, watch::FIRST, Some(Watch::default()))
    }

    fn with(
        mut estimator: Box<dyn Estimator>,
        span: Span,
        next: Span,
        watch: Option<Watch>,
    ) -> Self {
        let record = estimator.linearised().map(|ekf| {
            let considers = ekf.considered().contains(&true);
            let records = || Records::new(&ekf.composition().layout, considers);
            Box::new(Record {
                first: ekf.snapshot(),
                samples: Vec::new(),
                next,
                span,
                failures: 0,
                watch,
                retry: Span::ZERO,
                findings: Vec::new(),
                found: Vec::new(),
                run: records(),
                pass: records(),
            })
        });
        Self { record, estimator, jumped: false }
    }

    /// Makes the passes if they are due.
    fn relinearise(&mut self, observer: &mut dyn Observer) {
        let Self { estimator, record: place, .. } = self;
        let Some((ekf, record)) = estimator.linearised().zip(place.as_mut()) else { return };
        let Some(start) = record.run.start else { return };
        let time = ekf.time() - start;
        match record.due(ekf, time) {
            Due::Nothing => {}
            Due::Passes => {
                let last = time >= record.span;
                self.pass(start, last, observer);
            }
            Due::End => self.close(observer),
        }
    }

    /// Makes the passes, the last ones of all if `last` is set.
    fn pass(&mut self, start: Time, last: bool, observer: &mut dyn Observer) {
        self.settle(observer);
        let Self { estimator, record: place, jumped } = self;
        let Some((ekf, record)) = estimator.linearised().zip(place.as_mut()) else { return };
        let (time, before) = (ekf.time(), ekf.snapshot());
        let converged = if last { CONVERGED_LAST } else { CONVERGED };
        let made = record.relinearise(ekf, converged, observer);
        if made.is_err() {
            ekf.leave_course();
            ekf.restore(&before);
            observer.repetition(Repetition::Failed);
        }
        // passes end the watch once their covariance shows that the products will not matter
        let watch = record.watch.as_mut().filter(|_| made.is_ok());
        let over =
            watch.is_some_and(|watch| watch.made(watch::weight(ekf), watch::weight_moving(ekf)));
        let last = last || over;
        record.plan(time - start);
        let mut report = |level, text| {
            observer.event(Event { time, level, about: "estimator".into(), text });
        };
        match made {
            Ok(text) => {
                *jumped = true;
                record.failures = 0;
                if last {
                    let why = record.watch.map_or("", |_| WHY);
                    let text = format!("linearised the samples since {start} again{why}: {text}");
                    report(Level::Info, text);
                }
            }
            Err(text) => {
                record.failures += 1;
                record.plan_again(time - start);
                if last || record.failures == REPORTED {
                    let text = format!(
                        "the samples since {start} were not linearised again, and the estimate \
                         stays: {text}"
                    );
                    report(Level::Warning, text);
                }
            }
        }
        if last {
            self.close(observer);
        }
    }

    /// Ends the passes: forgets the samples, and reports the findings.
    fn close(&mut self, observer: &mut dyn Observer) {
        let findings = self.record.take().map(|record| record.findings);
        findings.into_iter().flatten().for_each(|finding| observer.finding(finding));
    }

    /// Makes the last passes of a run that ends while the products of errors matter.
    fn end(&mut self, observer: &mut dyn Observer) {
        let Self { estimator, record, .. } = self;
        let Some((ekf, record)) = estimator.linearised().zip(record.as_ref()) else { return };
        let Some((watch, start)) = record.watch.zip(record.run.start) else { return };
        if watch.ends_with_passes(watch::weight(ekf), ekf.time().since(start)) {
            self.pass(start, true, observer);
        }
    }
}

impl Record {
    /// Decides whether passes are due this time after the start, and plans the next ones if not.
    fn due(&mut self, ekf: &dyn Linearised, time: Span) -> Due {
        let planned = time >= self.next;
        let Some(watch) = self.watch else {
            return if planned { Due::Passes } else { Due::Nothing };
        };
        if time < self.retry {
            return Due::Nothing;
        }
        let due = watch.due(watch::weight(ekf), time.seconds(), planned);
        if planned {
            self.plan(time);
        }
        due
    }

    /// Plans passes in place of some that failed, where the scenario does not plan them: soon, since
    /// the first samples of a drive may not suffice, and later after each failure.
    fn plan_again(&mut self, time: Span) {
        let wait = (time.nanos() / RETRY) << self.failures.min(4);
        self.retry = Span::from_nanos(time.nanos().saturating_add(wait));
        if self.watch.is_some() {
            self.next = self.next.min(self.retry);
        }
    }

    /// Plans the next passes.
    fn plan(&mut self, time: Span) {
        let time = time.nanos();
        self.next = Span::from_nanos(time.saturating_add(time / GROWTH)).min(self.span);
    }

    /// Observer of the run, which records it.
    fn recording<'a>(&'a mut self, observer: &'a mut dyn Observer) -> Recording<'a> {
        Recording { records: &mut self.run, findings: &mut self.findings, observer }
    }

    /// Notes a sample that the filter takes next, from the first one on that may start it.
    fn note(&mut self, ekf: &dyn Linearised, sample: &Sample) {
        let first = self.samples.is_empty();
        // a search gives its samples back when it ends
        if ekf.searching() || first && sample.time < ekf.composition().start() {
            return;
        }
        if first || !ekf.running() && self.samples.len() == WAITING {
            self.begin(ekf);
        }
        self.samples.push(*sample);
    }

    /// Forgets the samples until now.
    fn begin(&mut self, ekf: &dyn Linearised) {
        self.first = ekf.snapshot();
        self.samples.clear();
    }

    /// Makes the passes until one changes the estimate less, and leaves the filter at their result.
    /// Returns their report, or the reason why there is no result; the filter is then in any state.
    fn relinearise(
        &mut self,
        ekf: &mut dyn Linearised,
        converged: f64,
        observer: &mut dyn Observer,
    ) -> Result<String, String> {
        let mut made = self.passes(ekf, converged, false, observer);
        if made.is_err() {
            // after passes that failed the filter may have left the region from which they converge
            self.take_all(ekf, None, observer)?;
            made = self.passes(ekf, converged, true, observer);
        }
        let report = made?;
        let injected = ekf.join_course();
        self.pass.joined(&injected);
        observer.repetition(Repetition::Ends(&injected));
        std::mem::swap(&mut self.run, &mut self.pass);
        std::mem::swap(&mut self.findings, &mut self.found);
        Ok(report)
    }

    /// Takes the samples from the start once more with the records of a pass, linearised at a
    /// trajectory or, without one, at the estimate.
    fn take_all(
        &mut self,
        ekf: &mut dyn Linearised,
        course: Option<Points>,
        observer: &mut dyn Observer,
    ) -> Result<(), String> {
        self.pass.clear();
        ekf.restore(&self.first);
        match course {
            Some(course) => ekf.follow_course(Box::new(course)),
            None => ekf.leave_course(),
        }
        observer.repetition(Repetition::Begins);
        self.found.clear();
        let mut pass = Pass { records: &mut self.pass, findings: &mut self.found, observer };
        let mut samples = self.samples.iter();
        let taken = samples.try_for_each(|sample| ekf.take(sample, &mut pass));
        ekf.settle(&mut pass);
        taken.map_err(|error| error.to_string())
    }

    /// Makes passes until one changes the estimate less, from the records of the run or, with
    /// `anew`, from those of a run without a trajectory.
    fn passes(
        &mut self,
        ekf: &mut dyn Linearised,
        converged: f64,
        anew: bool,
        observer: &mut dyn Observer,
    ) -> Result<String, String> {
        let layout = Arc::clone(&ekf.composition().layout);
        let mut last = f64::INFINITY;
        let mut report = String::new();
        for number in 1..=PASSES {
            let records = if number == 1 && !anew { &mut self.run } else { &mut self.pass };
            let course = records.smooth(&layout, ekf.considered());
            self.take_all(ekf, Some(course), observer)
                .map_err(|error| format!("pass {number} failed: {error}"))?;
            // the trajectory ends at the estimate of the pass before, and the offset is the change
            let mut change = Change::default();
            for (i, d) in ekf.offset().iter().enumerate() {
                let variance = ekf.propagated().get(i, i);
                if variance > 0.0 {
                    change.take(d.abs() / variance.sqrt(), i, ekf.state().time);
                }
            }
            let words = change.words(&layout);
            // the linear run holds at a step that shrinks
            if change.size > last.max(WITHIN) || change.size.is_nan() {
                return Err(format!(
                    "pass {number} diverges: it changed {words}, more than the pass before it; \
                     state a prior nearer to the truth"
                ));
            }
            last = change.size;
            let ended = if last <= converged { "converged" } else { "not converged" };
            report = format!("{ended} after {number} passes: the last one changed {words}");
            if last <= converged {
                break;
            }
        }
        Ok(report)
    }
}

impl Estimator for Relinearised {
    fn composition(&self) -> &Composition {
        self.estimator.composition()
    }

    fn process(
        &mut self,
        sample: &Sample,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        let Self { estimator, record: Some(record), .. } = self else {
            return self.estimator.process(sample, observer);
        };
        let Some(ekf) = estimator.linearised() else { return Ok(()) };
        record.note(ekf, sample);
        ekf.take(sample, &mut record.recording(observer))?;
        if let Some(samples) = ekf.take_found() {
            record.begin(ekf);
            record.samples.extend_from_slice(&samples);
            ekf.catch_up(&samples, &mut record.recording(observer))?;
        }
        self.relinearise(observer);
        Ok(())
    }

    fn finish(&mut self, observer: &mut dyn Observer) {
        match &mut self.record {
            Some(record) => self.estimator.finish(&mut record.recording(observer)),
            None => self.estimator.finish(observer),
        }
        self.end(observer);
        self.close(observer);
    }

    fn running(&self) -> bool {
        self.estimator.running()
    }

    fn state(&self) -> &State {
        self.estimator.state()
    }

    fn covariance(&self) -> Cow<'_, Covariance> {
        self.estimator.covariance()
    }

    fn settle(&mut self, observer: &mut dyn Observer) {
        match &mut self.record {
            Some(record) => {
                self.estimator.settle(&mut record.recording(observer));
            }
            None => self.estimator.settle(observer),
        }
    }

    fn epoch(&mut self) -> Epoch<'_> {
        self.estimator.epoch()
    }

    fn truth(&self) -> Truth<'_> {
        self.estimator.truth()
    }

    fn settled(&mut self) -> Option<&mut dyn Linearised> {
        self.estimator.linearised()
    }

    fn memory(&mut self, io: &mut Io<'_>) {
        if io.restores() {
            self.record = None;
        } else if self.record.as_ref().is_some_and(|record| record.watch.is_none()) {
            io.refuse("it linearises its samples again until estimator.relinearise is over");
        }
        self.estimator.memory(io);
    }

    fn has_jumped(&mut self) -> bool {
        std::mem::take(&mut self.jumped)
    }

    fn unfinished(&self) -> Vec<Event> {
        self.estimator.unfinished()
    }

    fn lacking(&self) -> Option<&Block> {
        self.estimator.lacking()
    }

    fn corrected(&self) -> Vec<Corrected> {
        self.estimator.corrected()
    }

    fn alignments(&self) -> Vec<(String, AlignmentReport)> {
        self.estimator.alignments()
    }
}
