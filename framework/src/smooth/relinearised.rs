//! An EKF that smooths its first minutes while it runs, and goes on from a state that is linearised
//! at their smoothed trajectory.
//!
//! A filter linearises each sample at the estimate of its time. Where the prior is wide, the noise
//! moves that estimate from sample to sample, and the derivatives with it. The null space of the
//! measurements, such as a rotation of a DVL about the velocity, then differs between samples, and
//! the filter takes the difference for information (Huang, Mourikis & Roumeliotis, *IJRR* 29,
//! 2010). With one trajectory for all samples the null space is that of one linear system.
//!
//! At the times `start + T / 16, T / 8, ... T` the passes of the smoother are made over all samples
//! since the start. The last trajectory `c` is followed once more, the filter goes on from
//! `c [+] d`, and the samples are forgotten after `T`.

use super::error::SmoothError;
use super::forward::Forward;
use super::passes;
use crate::compose::Composition;
use crate::compose::estimator::Estimator;
use crate::ekf::{Ekf, EstimatorError};
use crate::model::finding::Finding;
use crate::model::record::{Epoch, Event, Level, Observer, Rejection, Truth, UpdateRecord};
use crate::model::start::AlignmentReport;
use crate::state::covariance::{Covariance, Transition, Update};
use crate::state::{Block, State};
use crate::units::sample::Sample;
use crate::units::time::Time;

/// Largest number of passes at one time.
const PASSES: u32 = 12;

/// Part of the span after which the first passes are made; each further one doubles it.
const FIRST: i64 = 16;

/// Time between estimates at which the change by a pass is measured.
const SPACING: Time = Time::from_nanos(1_000_000_000);

/// An EKF whose first samples are linearised again.
pub(crate) struct Relinearised {
    ekf: Ekf,
    record: Option<Record>,
    /// Reason why nothing can be recorded, until it is reported.
    failed: Option<SmoothError>,
}

/// The samples since the start, until the last passes are made.
struct Record {
    forward: Forward,
    /// Start of the filter.
    start: Option<Time>,
    /// Time from the start to the next passes, and to the last ones.
    next: Time,
    span: Time,
    /// Time of the last estimate at which a change is measured.
    measured: Option<Time>,
    /// Set after the first passes: the filter has left the recorded run.
    apart: bool,
}

impl Relinearised {
    /// Creates an estimator that linearises the samples of the span after its start again.
    pub(crate) fn new(composition: Composition, span: Time) -> Self {
        let ekf = Ekf::new(composition);
        let next = Time::from_nanos(span.nanos() / FIRST);
        let (record, failed) = match Forward::new(&ekf, true) {
            Ok(forward) => {
                let (start, measured) = (None, None);
                (Some(Record { forward, start, next, span, measured, apart: false }), None)
            }
            Err(error) => (None, Some(error)),
        };
        Self { ekf, record, failed }
    }

    /// Makes the passes if they are due.
    fn relinearise(&mut self, observer: &mut dyn Observer) {
        let Self { ekf, record: place, failed } = self;
        let time = ekf.state().time;
        let mut report = |level, text| {
            observer.event(Event { time, level, about: "estimator".into(), text });
        };
        if let Some(record) = place
            && let Some(start) = record.start
            && time - start >= record.next
        {
            let before = ekf.snapshot();
            let made = record.relinearise(ekf);
            if !matches!(made, Ok(Ok(_))) {
                ekf.leave_course();
                ekf.restore(&before);
            }
            match made {
                Ok(Ok(text)) => {
                    report(
                        Level::Info,
                        format!("linearised the samples since {start} again: {text}"),
                    );
                }
                Ok(Err(text)) => report(
                    Level::Warning,
                    format!(
                        "the samples since {start} were not linearised again, and the estimate \
                         stays: {text}"
                    ),
                ),
                Err(error) => *failed = Some(error),
            }
            let (done, length) = (time - start, record.next + record.next);
            record.next = length.min(record.span);
            if done >= record.span {
                *place = None;
            }
        }
        if let Some(error) = failed.take() {
            *place = None;
            report(Level::Error, format!("samples are no longer linearised again: {error}"));
        }
    }
}

impl Record {
    /// Returns `true` once in a spacing, at an estimate.
    fn measures(&mut self, time: Time) -> bool {
        let due = self.measured.is_none_or(|last| time - last >= SPACING);
        if due {
            self.measured = Some(time);
        }
        due
    }

    /// Makes the passes, and leaves the filter at their result. Returns their report, or the reason
    /// why there is no result; the filter is then in any state.
    fn relinearise(&mut self, ekf: &mut Ekf) -> Result<Result<String, String>, SmoothError> {
        if self.apart
            && let Err(error) = self.forward.repeat(ekf, None)?
        {
            return Ok(Err(error.to_string()));
        }
        self.apart = true;
        let mut smoothed = passes::smooth(&mut self.forward, ekf, PASSES)?;
        let text = smoothed.quality.passes.take().map(|passes| passes.text).unwrap_or_default();
        let Some(course) = smoothed.course.take() else { return Ok(Err(text)) };
        if let Err(error) = self.forward.repeat(ekf, Some(Box::new(course)))? {
            return Ok(Err(error.to_string()));
        }
        ekf.join_course();
        Ok(Ok(text))
    }
}

/// Shows the records of a run what the filter does, and everything to the observer.
struct Recording<'a> {
    record: &'a mut Record,
    observer: &'a mut dyn Observer,
}

impl Observer for Recording<'_> {
    fn epoch(&mut self, epoch: &Epoch<'_>) {
        let measures = self.record.measures(epoch.state.time);
        self.record.forward.epoch(measures);
        self.observer.epoch(epoch);
    }
    fn update(&mut self, update: &UpdateRecord<'_>) {
        self.observer.update(update);
    }
    fn transition(&mut self, transition: &Transition) {
        self.record.forward.transition(transition);
        self.observer.transition(transition);
    }
    fn correction(&mut self, update: &Update) {
        self.record.forward.correction(update);
        self.observer.correction(update);
    }
    fn moved(&mut self, state: &State, covariance: &Covariance, offset: &[f64]) {
        self.record.start.get_or_insert(state.time);
        self.observer.moved(state, covariance, offset);
    }
    fn corrected(&mut self, offset: &[f64]) {
        self.observer.corrected(offset);
    }
    fn gated(&mut self, update: &Update) {
        self.record.forward.gated(update);
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
        self.ekf.composition()
    }

    fn process(
        &mut self,
        sample: &Sample,
        observer: &mut dyn Observer,
    ) -> Result<(), EstimatorError> {
        let Some(record) = &mut self.record else {
            return self.ekf.process(sample, observer);
        };
        record.forward.sample(&self.ekf, sample);
        self.ekf.process(sample, &mut Recording { record, observer })?;
        if self.ekf.running() {
            let time = self.ekf.state().time;
            if record.measures(time) {
                self.ekf.settle(&mut Recording { record, observer });
                record.forward.epoch_between();
            }
        }
        self.failed = self.failed.take().or_else(|| record.forward.failed());
        self.relinearise(observer);
        Ok(())
    }

    fn finish(&mut self, observer: &mut dyn Observer) {
        self.ekf.finish(observer);
    }

    fn running(&self) -> bool {
        self.ekf.running()
    }

    fn state(&self) -> &State {
        self.ekf.state()
    }

    fn covariance(&self) -> &Covariance {
        self.ekf.covariance()
    }

    fn settle(&mut self, observer: &mut dyn Observer) {
        // a settled covariance is part of the recorded run
        match &mut self.record {
            Some(record) => {
                self.ekf.settle(&mut Recording { record, observer });
                record.measured = Some(self.ekf.state().time);
                record.forward.epoch_between();
            }
            None => self.ekf.settle(observer),
        }
    }

    fn epoch(&mut self) -> Epoch<'_> {
        self.ekf.epoch()
    }

    fn truth(&self) -> Truth<'_> {
        self.ekf.truth()
    }

    fn unfinished(&self) -> Vec<Event> {
        self.ekf.unfinished().collect()
    }

    fn lacking(&self) -> Option<&Block> {
        self.ekf.lacking()
    }

    fn alignments(&self) -> Vec<(String, AlignmentReport)> {
        Estimator::alignments(&self.ekf)
    }
}
