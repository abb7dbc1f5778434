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

mod record;

use super::watch::{self, Due, Watch};
use crate::checkpoint::Io;
use crate::compose::Composition;
use crate::compose::estimator::Estimator;
use crate::compose::estimator::Linearised;
use crate::filter::EstimatorError;
use crate::model::process::start::AlignmentReport;
use crate::model::record::{Corrected, Epoch, Event, Level, Observer, Repetition, Truth};
use crate::state::covariance::Covariance;
use crate::state::{Block, State};
use crate::units::sample::Sample;
use crate::units::time::{Span, Time};
use record::{CONVERGED, CONVERGED_LAST, Record};
use std::borrow::Cow;

/// Part of the span after which the first passes are made.
const FIRST: i64 = 64;

/// Number of failures in a row that are reported; few samples at an uncertain heading may fail once.
const REPORTED: u32 = 3;

/// Reason for passes that the scenario does not ask for.
const WHY: &str = ", since products of errors that the processes neglect mattered";

/// An estimator whose first samples are linearised again.
pub(crate) struct Relinearised {
    estimator: Box<dyn Estimator>,
    record: Option<Box<Record>>,
    /// Set when samples were linearised again, until the caller knows it.
    jumped: bool,
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
        let record = estimator.linearised();
        let record = record.map(|ekf| Box::new(Record::new(ekf, (span, next), watch)));
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
        if watch.matters(watch::weight(ekf), ekf.time().since(start)) {
            self.pass(start, true, observer);
            self.compare(observer);
        }
    }

    /// Shows the estimate beside the reference of its time once more, which the last passes have changed.
    fn compare(&mut self, observer: &mut dyn Observer) {
        let truth = self.estimator.truth();
        if truth.state.time == self.estimator.time() {
            let (state, known) = (truth.state.clone(), truth.known.to_vec());
            let truth = Some(Truth { state: &state, known: &known });
            observer.epoch(&Epoch { truth, ..self.estimator.epoch() });
        }
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
