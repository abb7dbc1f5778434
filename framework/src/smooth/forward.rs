//! The two passes over a run or a part of it: forward with snapshots, and backward from segment to
//! segment.
//!
//! `N` snapshots of `s` bytes and the records of a segment, `R / N` bytes of all `R`, need
//! `N s + R / N` bytes. That is least, `2 sqrt(R s)`, where both parts are equal. `R` is unknown
//! before the end, so a segment begins with a length of [`SHORTEST`]; as soon as the snapshots need
//! more than a segment, every second one is dropped and the length doubles.

use super::adjoint::Adjoint;
use super::again::repeat_from;
use super::course;
use super::error::SmoothError;
use super::estimate::Row;
use super::segment::{Kind, Recorder, Segment, correction_length, gated_length};
use super::tape::{Entry, Steps};
use crate::compose::course::Course;
use crate::compose::{estimator::Linearised, snapshot::Snapshot};
use crate::filter::EstimatorError;
use crate::model::record::{Epoch, Observer};
use crate::state::Layout;
use crate::state::covariance::{Closure, Transition, Update};
use crate::units::sample::{Sample, SensorId};
use crate::units::time::Time;
use std::io;
use std::ops::Range;
use std::sync::Arc;

/// Length of the records of the first segments, bytes.
const SHORTEST: usize = 1 << 16;

/// The filter at the beginning of a segment.
struct Checkpoint {
    snapshot: Snapshot,
    /// Place in the steps, and the number of estimates before it.
    at: u64,
    epochs: usize,
}

/// Snapshots of one pass.
struct Checkpoints {
    list: Vec<Checkpoint>,
    /// Length of the records of a segment, bytes.
    longest: usize,
}

impl Checkpoints {
    fn new() -> Self {
        Self { list: Vec::new(), longest: SHORTEST }
    }

    fn add(&mut self, ekf: &dyn Linearised, at: u64, epochs: usize) {
        let snapshot = ekf.snapshot();
        let size = snapshot.size();
        self.list.push(Checkpoint { snapshot, at, epochs });
        // an odd number, so that the last one stays
        let count = self.list.len();
        if count % 2 == 1 && count * size > self.longest {
            let mut number = 0;
            self.list.retain(|_| {
                number += 1;
                number % 2 == 1
            });
            self.longest *= 2;
        }
    }
}

/// Length of the records since the last snapshot.
struct Counter {
    n: usize,
    considers: bool,
    /// Numbers of an estimate, and those of the end of a step for a further pass.
    row: usize,
    course: usize,
    /// Elements of the record of a step, and `true` if the last record is one, to which the next
    /// step belongs.
    closure: Closure,
    in_step: bool,
    /// For each estimate of the filter, `true` if the run records it, and the number of those that
    /// the pass has met.
    recorded: Vec<bool>,
    epochs: usize,
    /// Length, bytes.
    since: usize,
}

impl Counter {
    fn add(&mut self, numbers: usize) {
        self.in_step = false;
        self.since += 8 * numbers;
    }
}

impl Observer for Counter {
    fn epoch(&mut self, _: &Epoch<'_>) {
        if self.recorded.get(self.epochs) == Some(&true) {
            self.add(self.row + self.n);
        }
        self.epochs += 1;
    }
    fn transition(&mut self, transition: &Transition) {
        let other = self.closure.find(transition);
        if other || !self.in_step {
            self.add(self.closure.len());
        }
        if self.course > 0 {
            self.add(self.course);
        }
        self.in_step = self.course == 0;
    }
    fn correction(&mut self, update: &Update) {
        self.add(correction_length(update, self.n, self.considers));
    }
    fn gated(&mut self, update: &Update) {
        self.add(gated_length(update, self.n));
    }
}

/// The forward pass: the steps of the run, and snapshots between them.
pub(super) struct Forward {
    layout: Arc<Layout>,
    considers: bool,
    steps: Steps,
    checkpoints: Checkpoints,
    counter: Counter,
    /// Estimates before the last step.
    recorded_before: usize,
    /// The filter before the first step, for further passes.
    first: Snapshot,
    /// Start of the filter.
    pub(super) start: Option<Time>,
    /// Set if the filter failed in the last step.
    pub(super) failed_step: bool,
    error: Option<io::Error>,
}

impl Forward {
    /// Begins the pass at the present of the filter, with or without records for a further pass.
    pub(super) fn new(ekf: &dyn Linearised, further: bool) -> Result<Self, SmoothError> {
        let layout = Arc::clone(&ekf.composition().layout);
        let considers = ekf.considered().contains(&true);
        let counter = Counter {
            n: layout.tangent,
            considers,
            row: Row::new(&layout).width(),
            course: if further { course::length(&layout) } else { 0 },
            closure: Closure::default(),
            in_step: false,
            recorded: Vec::new(),
            epochs: 0,
            since: 0,
        };
        let mut forward = Self {
            considers,
            layout,
            steps: Steps::new()?,
            checkpoints: Checkpoints::new(),
            counter,
            recorded_before: 0,
            first: ekf.snapshot(),
            start: None,
            failed_step: false,
            error: None,
        };
        forward.checkpoint(ekf);
        Ok(forward)
    }

    /// Begins at a start that the filter has just found, and forgets the steps until now.
    pub(super) fn begin(&mut self, ekf: &dyn Linearised) -> Result<(), SmoothError> {
        self.first = ekf.snapshot();
        self.start = Some(ekf.state().time);
        self.restart(ekf)
    }

    /// Forgets the steps, and begins again at the present of the filter.
    pub(super) fn restart(&mut self, ekf: &dyn Linearised) -> Result<(), SmoothError> {
        self.steps.clear()?;
        self.checkpoints = Checkpoints::new();
        self.counter.recorded.clear();
        self.counter.epochs = 0;
        self.recorded_before = 0;
        self.checkpoint(ekf);
        Ok(())
    }

    fn checkpoint(&mut self, ekf: &dyn Linearised) {
        self.checkpoints.add(ekf, self.steps.end, self.counter.recorded.len());
        (self.counter.since, self.counter.in_step) = (0, false);
    }

    fn push(&mut self, entry: &Entry) {
        self.recorded_before = self.counter.recorded.len();
        if let Err(error) = self.steps.push(entry) {
            self.error.get_or_insert(error);
        }
    }

    /// Notes a sample that the filter takes next.
    pub(super) fn sample(&mut self, ekf: &dyn Linearised, sample: &Sample) {
        if self.counter.since >= self.checkpoints.longest && ekf.running() {
            self.checkpoint(ekf);
        }
        if ekf.running() {
            self.start.get_or_insert(ekf.state().time);
        }
        self.push(&Entry::Sample(*sample));
    }

    /// Notes that the runner records the estimate.
    pub(super) fn epoch_between(&mut self) {
        self.push(&Entry::Epoch);
        self.epoch(true);
    }

    /// Notes that the filter uses the samples that it holds.
    pub(super) fn finish(&mut self) {
        self.push(&Entry::Finish);
    }

    /// Forgets the last step, in which the filter failed.
    pub(super) fn take_back(&mut self) {
        if let Err(error) = self.steps.take_back() {
            self.error.get_or_insert(error);
        }
        self.failed_step = true;
        self.counter.recorded.truncate(self.recorded_before);
    }

    /// Notes an estimate, and whether the run records it.
    pub(super) fn epoch(&mut self, recorded: bool) {
        self.counter.recorded.push(recorded);
        if recorded {
            self.counter.add(self.counter.row);
        }
    }

    pub(super) fn transition(&mut self, transition: &Transition) {
        self.counter.transition(transition);
    }

    pub(super) fn correction(&mut self, update: &Update) {
        self.counter.correction(update);
    }

    pub(super) fn gated(&mut self, update: &Update) {
        self.counter.gated(update);
    }

    /// Lets the filter take all steps again, linearised at a trajectory or at its estimate. Returns
    /// the error of a filter that fails.
    pub(super) fn repeat(
        &mut self,
        ekf: &mut dyn Linearised,
        course: Option<Box<dyn Course>>,
    ) -> Result<Result<(), EstimatorError>, SmoothError> {
        repeat_from(ekf, &self.first);
        match course {
            Some(course) => ekf.follow_course(course),
            None => ekf.leave_course(),
        }
        let Self { steps, checkpoints, counter, .. } = self;
        (counter.epochs, counter.since, counter.in_step) = (0, 0, false);
        *checkpoints = Checkpoints::new();
        checkpoints.add(ekf, 0, 0);
        let mut taken = Ok(());
        steps.read(0, steps.end, |at, entry| {
            if taken.is_err() {
                return Ok::<(), SmoothError>(());
            }
            if counter.since >= checkpoints.longest && ekf.running() {
                checkpoints.add(ekf, at, counter.epochs);
                (counter.since, counter.in_step) = (0, false);
            }
            taken = take(ekf, &entry, counter);
            Ok(())
        })?;
        match ekf.course_failed() {
            Some(error) => Err(error.into()),
            None => Ok(taken),
        }
    }

    /// Error of the temporary file, if there was one.
    pub(super) fn failed(&mut self) -> Option<SmoothError> {
        self.error.take().map(Into::into)
    }

    /// Computes the segments again with their filter, the last one first, and passes the adjoint
    /// over their records; `visit` sees each correction and each recorded estimate, and the end of
    /// each step for a `further` pass. The filter has to be at the end of the pass, and is left in
    /// any state.
    pub(super) fn backward(
        &mut self,
        ekf: &mut dyn Linearised,
        adjoint: &mut Adjoint,
        further: bool,
        mut visit: impl FnMut(&mut Adjoint, Visit<'_>) -> Result<(), SmoothError>,
    ) -> Result<(), SmoothError> {
        let mut segment = Segment::new(&self.layout, self.considers);
        let present = |ekf: &dyn Linearised| (ekf.state().clone(), ekf.offset().to_vec());
        let mut end = (self.steps.end, (!self.failed_step).then(|| present(ekf)));
        while let Some(begin) = self.checkpoints.list.pop() {
            segment.clear();
            ekf.restore(&begin.snapshot);
            let mut recorder = Recorder {
                segment: &mut segment,
                recorded: self.counter.recorded[begin.epochs..].iter(),
                source: (SensorId(0), Time::MIN, 0.0),
                offset: ekf.offset().to_vec(),
                course: further,
            };
            replay(&mut self.steps, begin.at..end.0, ekf, &mut recorder)?;
            if end.1.is_some_and(|end| end != present(ekf)) {
                return Err(SmoothError::NotRepeatable { time: ekf.state().time });
            }
            segment.end_product();
            let mut patterns = segment.take_patterns();
            for (kind, values, columns) in segment.reversed() {
                match kind {
                    Kind::Step(pattern) => adjoint.pass(&mut patterns[pattern], values),
                    Kind::Gated(m, number) => {
                        let square = adjoint.reconsider(m, &values[1..]);
                        let (sensor, time) = segment.sources[number];
                        let threshold = values[0];
                        visit(adjoint, Visit::Gated { sensor, time, square, threshold })?;
                    }
                    Kind::Update(m, w, number) => {
                        let correction = segment.correction_of(m, w, values, columns);
                        let square = adjoint.correct(&self.layout, &correction);
                        let (sensor, time) = segment.sources[number];
                        visit(adjoint, Visit::Sample { sensor, time, m, square })?;
                    }
                    Kind::Epoch => visit(adjoint, Visit::Epoch(values))?,
                    Kind::Course => visit(adjoint, Visit::Course(values))?,
                }
            }
            segment.keep_patterns(patterns);
            let snapshot = &begin.snapshot;
            end = (begin.at, Some((snapshot.state().clone(), snapshot.offset().to_vec())));
        }
        Ok(())
    }

    /// Computes the steps since the beginning again for an observer. The filter is left at their
    /// end.
    pub(super) fn again(
        &mut self,
        ekf: &mut dyn Linearised,
        observer: &mut dyn Observer,
    ) -> Result<(), SmoothError> {
        let Some(begin) = self.checkpoints.list.first() else { return Ok(()) };
        ekf.restore(&begin.snapshot);
        let steps = begin.at..self.steps.end;
        replay(&mut self.steps, steps, ekf, observer)
    }
}

/// Lets the filter take the steps between two places.
fn replay(
    steps: &mut Steps,
    span: Range<u64>,
    ekf: &mut dyn Linearised,
    observer: &mut dyn Observer,
) -> Result<(), SmoothError> {
    steps.read(span.start, span.end, |_, entry| {
        // a failure of the filter has been reported in the forward pass
        drop(take(ekf, &entry, observer));
        Ok(())
    })
}

/// Lets the filter take a step.
fn take(
    ekf: &mut dyn Linearised,
    entry: &Entry,
    observer: &mut dyn Observer,
) -> Result<(), EstimatorError> {
    match entry {
        Entry::Sample(sample) => ekf.process(sample, observer)?,
        Entry::Epoch => {
            ekf.settle(observer);
            observer.epoch(&ekf.epoch());
        }
        Entry::Finish => ekf.finish(observer),
    }
    Ok(())
}

/// A record that the backward pass meets.
pub(super) enum Visit<'a> {
    /// A correction by a sample with `m` components, and the square of its smoothed innovation.
    Sample { sensor: SensorId, time: Time, m: usize, square: Option<f64> },
    /// A gated sample, the square of its residual from the smoothed run, and its gate.
    Gated { sensor: SensorId, time: Time, square: Option<f64>, threshold: f64 },
    /// An estimate that the run records.
    Epoch(&'a [f64]),
    /// The end of a step, if there is a further pass.
    Course(&'a [f64]),
}

#[cfg(test)]
mod tests;
