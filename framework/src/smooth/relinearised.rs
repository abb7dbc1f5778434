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

use super::change::Change;
use super::means::Records;
use crate::checkpoint::Io;
use crate::compose::Composition;
use crate::compose::estimator::Estimator;
use crate::compose::{estimator::Linearised, snapshot::Snapshot};
use crate::filter::EstimatorError;
use crate::model::process::start::AlignmentReport;
use crate::model::record::finding::Finding;
use crate::model::record::{
    Epoch, Event, Level, Observer, Rejection, Repetition, Truth, UpdateRecord,
};
use crate::state::covariance::{Covariance, Transition, Update};
use crate::state::{Block, State};
use crate::units::sample::Sample;
use crate::units::time::Span;
use std::sync::Arc;

/// Largest number of passes at one time.
const PASSES: u32 = 12;

/// Largest change of the estimate by a pass, in its sigma, at which the passes have converged, and
/// that at the last time. The error of the trajectory counts in the second order alone, and the next
/// time takes the same samples again.
const CONVERGED: f64 = 0.1;
const CONVERGED_LAST: f64 = 1e-3;

/// Part of the span after which the first passes are made.
const FIRST: i64 = 64;

/// Part by which the time since the start grows until the next passes.
const GROWTH: i64 = 4;

/// Number of failures in a row that are reported; few samples at an uncertain heading may fail once.
const REPORTED: u32 = 3;

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
    /// Records of the filter, and of the last pass.
    run: Records,
    pass: Records,
}

impl Relinearised {
    /// Lets an estimator linearise the samples of the span after its start again.
    pub(crate) fn new(mut estimator: Box<dyn Estimator>, span: Span) -> Self {
        let record = estimator.linearised().map(|ekf| {
            let considers = ekf.considered().contains(&true);
            let records = || Records::new(&ekf.composition().layout, considers);
            Box::new(Record {
                first: ekf.snapshot(),
                samples: Vec::new(),
                next: Span::from_nanos(span.nanos() / FIRST),
                span,
                failures: 0,
                run: records(),
                pass: records(),
            })
        });
        Self { record, estimator, jumped: false }
    }

    /// Makes the passes if they are due.
    fn relinearise(&mut self, observer: &mut dyn Observer) {
        let Self { estimator, record: place, jumped } = self;
        let Some((ekf, record)) = estimator.linearised().zip(place.as_mut()) else { return };
        let time = ekf.time();
        let Some(start) = record.run.start.filter(|start| time - *start >= record.next) else {
            return;
        };
        let (before, last) = (ekf.snapshot(), time - start >= record.span);
        let converged = if last { CONVERGED_LAST } else { CONVERGED };
        let made = record.relinearise(ekf, converged, observer);
        if made.is_err() {
            ekf.leave_course();
            ekf.restore(&before);
            observer.repetition(Repetition::Failed);
        }
        let mut report = |level, text| {
            observer.event(Event { time, level, about: "estimator".into(), text });
        };
        match made {
            Ok(text) => {
                *jumped = true;
                record.failures = 0;
                if last {
                    let text = format!("linearised the samples since {start} again: {text}");
                    report(Level::Info, text);
                }
            }
            Err(text) => {
                record.failures += 1;
                if last || record.failures == REPORTED {
                    let text = format!(
                        "the samples since {start} were not linearised again, and the estimate \
                         stays: {text}"
                    );
                    report(Level::Warning, text);
                }
            }
        }
        let grown = (time - start).nanos();
        record.next = Span::from_nanos(grown.saturating_add(grown / GROWTH)).min(record.span);
        if last {
            *place = None;
        }
    }
}

impl Record {
    /// Notes a sample that the filter takes next.
    fn note(&mut self, ekf: &dyn Linearised, sample: &Sample) {
        // a search gives its samples back when it ends
        if ekf.searching() {
            return;
        }
        if !ekf.running() && self.samples.len() == WAITING {
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
        let layout = Arc::clone(&ekf.composition().layout);
        let mut last = f64::INFINITY;
        let mut report = String::new();
        for number in 1..=PASSES {
            let records = if number == 1 { &mut self.run } else { &mut self.pass };
            let course = records.smooth(&layout, ekf.considered());
            self.pass.clear();
            ekf.restore(&self.first);
            ekf.follow_course(Box::new(course));
            observer.repetition(Repetition::Begins);
            let mut pass = Pass { records: &mut self.pass, observer };
            let mut samples = self.samples.iter();
            samples
                .try_for_each(|sample| ekf.take(sample, &mut pass))
                .map_err(|error| format!("pass {number} failed: {error}"))?;
            ekf.settle(&mut pass);
            // the trajectory ends at the estimate of the pass before, and the offset is the change
            let mut change = Change::default();
            for (i, d) in ekf.offset().iter().enumerate() {
                let variance = ekf.covariance().get(i, i);
                if variance > 0.0 {
                    change.take(d.abs() / variance.sqrt(), i, ekf.state().time);
                }
            }
            let words = change.words(&layout);
            // the linear run holds at a step that shrinks
            if change.size > last || change.size.is_nan() {
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
        let injected = ekf.join_course();
        self.pass.joined(&injected);
        observer.repetition(Repetition::Ends(&injected));
        std::mem::swap(&mut self.run, &mut self.pass);
        Ok(report)
    }
}

/// Shows what a pass does to its records, and the maps of the error to the observer.
struct Pass<'a> {
    records: &'a mut Records,
    observer: &'a mut dyn Observer,
}

impl Observer for Pass<'_> {
    fn transition(&mut self, transition: &Transition) {
        self.records.transition(transition);
        self.observer.transition(transition);
    }
    fn correction(&mut self, update: &Update) {
        self.records.correction(update);
        self.observer.correction(update);
    }
    fn moved(&mut self, state: &State, covariance: &Covariance, offset: &[f64]) {
        self.records.moved(state, covariance, offset);
    }
}

/// Shows the records what the filter does, and everything to the observer.
struct Recording<'a> {
    records: &'a mut Records,
    observer: &'a mut dyn Observer,
}

impl Observer for Recording<'_> {
    fn epoch(&mut self, epoch: &Epoch<'_>) {
        self.observer.epoch(epoch);
    }
    fn update(&mut self, update: &UpdateRecord<'_>) {
        self.observer.update(update);
    }
    fn transition(&mut self, transition: &Transition) {
        self.records.transition(transition);
        self.observer.transition(transition);
    }
    fn correction(&mut self, update: &Update) {
        self.records.correction(update);
        self.observer.correction(update);
    }
    fn moved(&mut self, state: &State, covariance: &Covariance, offset: &[f64]) {
        self.records.moved(state, covariance, offset);
        self.observer.moved(state, covariance, offset);
    }
    fn corrected(&mut self, offset: &[f64]) {
        self.observer.corrected(offset);
    }
    fn gated(&mut self, update: &Update) {
        self.observer.gated(update);
    }
    fn input(&mut self, sample: &Sample, rejected: Option<Rejection>) {
        self.observer.input(sample, rejected);
    }
    fn event(&mut self, event: Event) {
        self.observer.event(event);
    }
    fn finding(&mut self, finding: Finding) {
        self.observer.finding(finding);
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
        ekf.take(sample, &mut Recording { records: &mut record.run, observer })?;
        if let Some(samples) = ekf.take_found() {
            record.begin(ekf);
            record.samples.extend_from_slice(&samples);
            ekf.catch_up(&samples, &mut Recording { records: &mut record.run, observer })?;
        }
        self.relinearise(observer);
        Ok(())
    }

    fn finish(&mut self, observer: &mut dyn Observer) {
        self.estimator.finish(observer);
    }

    fn running(&self) -> bool {
        self.estimator.running()
    }

    fn state(&self) -> &State {
        self.estimator.state()
    }

    fn covariance(&self) -> &Covariance {
        self.estimator.covariance()
    }

    fn settle(&mut self, observer: &mut dyn Observer) {
        match &mut self.record {
            Some(record) => {
                self.estimator.settle(&mut Recording { records: &mut record.run, observer });
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
        } else if self.record.is_some() {
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

    fn alignments(&self) -> Vec<(String, AlignmentReport)> {
        self.estimator.alignments()
    }
}
