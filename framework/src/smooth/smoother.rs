//! The two passes over a run: forward with snapshots, and backward from segment to segment.
//!
//! `N` snapshots of `s` bytes and the records of a segment, `R / N` bytes of all `R`, need
//! `N s + R / N` bytes. That is least, `2 sqrt(R s)`, where both parts are equal. `R` is unknown
//! before the end, so a segment begins with a length of [`SHORTEST`]; as soon as the snapshots need
//! more than a segment, every second one is dropped and the length doubles.

use super::adjoint::{Adjoint, Map};
use super::error::SmoothError;
use super::quality::{Quality, QualityReport};
use super::segment::{Kind, Recorder, Row, Segment, correction_length, step_length};
use super::tape::{Entry, Rows, Steps};
use crate::ekf::{Ekf, Snapshot};
use crate::model::record::{Epoch, Truth};
use crate::state::covariance::{Covariance, Transition, Update};
use crate::state::{Layout, State};
use crate::units::sample::{Sample, SensorId};
use crate::units::time::Time;
use std::io;
use std::sync::Arc;

/// Length of the records of the first segments, bytes.
const SHORTEST: usize = 1 << 16;

/// Share of a variance that later samples take away below which they change nothing.
const UNCHANGED: f64 = 1e-6;

/// The filter at the beginning of a segment.
struct Checkpoint {
    snapshot: Snapshot,
    /// Place in the steps, and the number of estimates before it.
    at: u64,
    epochs: usize,
}

/// The forward pass: the steps of the run, and snapshots between them.
pub(crate) struct Forward {
    layout: Arc<Layout>,
    considers: bool,
    steps: Steps,
    checkpoints: Vec<Checkpoint>,
    /// For each estimate of the filter, `true` if the run records it.
    recorded: Vec<bool>,
    /// Estimates before the last step.
    recorded_before: usize,
    /// Length of the records since the last snapshot, and the longest one, bytes.
    since: usize,
    longest: usize,
    /// Start of the filter.
    start: Option<Time>,
    error: Option<io::Error>,
}

impl Forward {
    /// Begins the pass of a filter that has not started.
    pub(crate) fn new(ekf: &Ekf) -> Result<Self, SmoothError> {
        let layout = Arc::clone(&ekf.composition().layout);
        let mut forward = Self {
            considers: ekf.considered().contains(&true),
            layout,
            steps: Steps::new()?,
            checkpoints: Vec::new(),
            recorded: Vec::new(),
            recorded_before: 0,
            since: 0,
            longest: SHORTEST,
            start: None,
            error: None,
        };
        forward.checkpoint(ekf);
        Ok(forward)
    }

    fn checkpoint(&mut self, ekf: &Ekf) {
        let (at, epochs) = (self.steps.end, self.recorded.len());
        self.checkpoints.push(Checkpoint { snapshot: ekf.snapshot(), at, epochs });
        self.since = 0;
        // an odd number, so that the last one stays
        let count = self.checkpoints.len();
        if count % 2 == 1 && count * ekf.snapshot_size() > self.longest {
            let mut number = 0;
            self.checkpoints.retain(|_| {
                number += 1;
                number % 2 == 1
            });
            self.longest *= 2;
        }
    }

    fn push(&mut self, entry: &Entry) {
        self.recorded_before = self.recorded.len();
        if let Err(error) = self.steps.push(entry) {
            self.error.get_or_insert(error);
        }
    }

    /// Notes a sample that the filter takes next.
    pub(crate) fn sample(&mut self, ekf: &Ekf, sample: &Sample) {
        if self.since >= self.longest && ekf.running() {
            self.checkpoint(ekf);
        }
        if ekf.running() {
            self.start.get_or_insert(ekf.state().time);
        }
        self.push(&Entry::Sample(*sample));
    }

    /// Notes that the runner records the estimate.
    pub(crate) fn epoch_between(&mut self) {
        self.push(&Entry::Epoch);
        self.epoch(true);
    }

    /// Notes that the filter uses the samples that it holds.
    pub(crate) fn finish(&mut self) {
        self.push(&Entry::Finish);
    }

    /// Forgets the last step, in which the filter failed.
    pub(crate) fn take_back(&mut self) {
        self.steps.take_back();
        self.recorded.truncate(self.recorded_before);
    }

    /// Notes an estimate, and whether the run records it.
    pub(crate) fn epoch(&mut self, recorded: bool) {
        self.recorded.push(recorded);
        if recorded {
            self.since += 8 * Row::new(&self.layout).width();
        }
    }

    pub(crate) fn transition(&mut self, transition: &Transition) {
        self.since += 8 * step_length(transition);
    }

    pub(crate) fn correction(&mut self, update: &Update) {
        self.since += 8 * correction_length(update, self.layout.tangent, self.considers);
    }

    /// Error of the temporary file, if there was one.
    pub(crate) fn failed(&mut self) -> Option<SmoothError> {
        self.error.take().map(Into::into)
    }

    /// Passes backward over the run with its filter, and calls `progress` with the time that it has
    /// reached. The filter is left in any state.
    pub(crate) fn backward(
        mut self,
        ekf: &mut Ekf,
        mut progress: impl FnMut(Time),
    ) -> Result<Smoothed, SmoothError> {
        let row = Row::new(&self.layout);
        let mut pass = Backward {
            adjoint: Adjoint::new(&self.layout, ekf.considered()),
            layout: Arc::clone(&self.layout),
            rows: Rows::new(row.width())?,
            quality: Quality::new(
                ekf.composition(),
                self.start.unwrap_or_default(),
                ekf.state().time,
            ),
            differences: vec![0.0; row.n],
            row,
            map: Map::identity(row.n),
            state: self.layout.initial_state(),
            covariance: Covariance::zero(row.n),
            delta: vec![0.0; row.n],
            written: Vec::with_capacity(row.width()),
        };
        let mut segment = Segment::new(&self.layout, self.considers);
        let mut end: Option<Checkpoint> = None;
        while let Some(begin) = self.checkpoints.pop() {
            segment.clear();
            ekf.restore(&begin.snapshot);
            let to = end.as_ref().map_or(self.steps.end, |end| end.at);
            let recorded = self.recorded[begin.epochs..].iter();
            let source = (SensorId(0), Time::MIN);
            let mut recorder = Recorder { segment: &mut segment, recorded, source };
            self.steps.read(begin.at, to, |entry| -> Result<(), SmoothError> {
                match entry {
                    // a failure of the filter has been reported in the forward pass
                    Entry::Sample(sample) => drop(ekf.process(&sample, &mut recorder)),
                    Entry::Epoch => {
                        let epoch = ekf.epoch();
                        crate::model::record::Observer::epoch(&mut recorder, &epoch);
                    }
                    Entry::Finish => ekf.finish(&mut recorder),
                }
                Ok(())
            })?;
            if let Some(end) = end
                && end.snapshot.state() != ekf.state()
            {
                return Err(SmoothError::NotRepeatable { time: ekf.state().time });
            }
            pass.over(&segment)?;
            progress(begin.snapshot.state().time);
            end = Some(begin);
        }
        let Backward { rows, row, layout, quality, .. } = pass;
        let quality = quality.report(ekf.composition());
        Ok(Smoothed { rows, row, layout, quality })
    }
}

/// The backward pass.
struct Backward {
    layout: Arc<Layout>,
    row: Row,
    adjoint: Adjoint,
    rows: Rows,
    map: Map,
    state: State,
    covariance: Covariance,
    delta: Vec<f64>,
    quality: Quality,
    /// Difference of each error state from the filter, in its sigma.
    differences: Vec<f64>,
    written: Vec<f64>,
}

impl Backward {
    fn over(&mut self, segment: &Segment) -> Result<(), SmoothError> {
        for (kind, values, columns) in segment.reversed() {
            match kind {
                Kind::Step(pattern) => {
                    segment.set_map(&mut self.map, pattern, values);
                    self.adjoint.pass(&mut self.map);
                }
                Kind::Update(m, w, number) => {
                    let correction = segment.correction_of((m, w), values, columns);
                    let square = self.adjoint.correct(&self.layout, &correction);
                    let (sensor, time) = segment.sources[number];
                    self.quality.sample(sensor.0, time, m, square);
                }
                Kind::Epoch => self.epoch(values)?,
            }
        }
        Ok(())
    }

    /// Writes a smoothed estimate.
    fn epoch(&mut self, values: &[f64]) -> Result<(), SmoothError> {
        let Row { values: ambient, signals, n, .. } = self.row;
        let (estimate, truth) = values.split_at(1 + ambient + signals + self.row.triangle());
        self.state.values.copy_from_slice(&estimate[1..=ambient]);
        unpack(&estimate[1 + ambient + signals..], n, &mut self.covariance);
        for (i, variance) in self.differences.iter_mut().enumerate() {
            *variance = self.covariance.get(i, i);
        }
        self.adjoint.smooth(&mut self.covariance, &mut self.delta);
        for (i, (value, delta)) in self.differences.iter_mut().zip(&self.delta).enumerate() {
            let known = *value - self.covariance.get(i, i);
            // later samples that change nothing leave rounding alone
            *value = if known > UNCHANGED * *value { delta / known.sqrt() } else { 0.0 };
        }
        self.layout.inject(&mut self.state, &mut self.delta, &mut self.covariance);
        self.written.clear();
        self.state.time = Time::from_nanos(estimate[0].to_bits().cast_signed());
        let (layout, state) = (&*self.layout, &self.state);
        let epoch = Epoch { layout, state, covariance: &self.covariance, truth: None };
        self.quality.epoch(&epoch, &self.differences);
        self.written.push(estimate[0]);
        self.written.extend_from_slice(&self.state.values);
        self.written.extend_from_slice(&estimate[1 + ambient..][..signals]);
        let covariance = &self.covariance;
        self.written.extend((0..n).flat_map(|i| (0..=i).map(move |j| covariance.get(i, j))));
        self.written.extend_from_slice(truth);
        Ok(self.rows.push(&self.written)?)
    }
}

fn unpack(triangle: &[f64], n: usize, covariance: &mut Covariance) {
    let places = (0..n).flat_map(|i| (0..=i).map(move |j| (i, j)));
    places.zip(triangle).for_each(|((i, j), value)| covariance.set(i, j, *value));
}

/// Smoothed estimates of a run.
pub(crate) struct Smoothed {
    rows: Rows,
    row: Row,
    layout: Arc<Layout>,
    pub(crate) quality: QualityReport,
}

impl Smoothed {
    /// Passes the estimates to `each` in order of time.
    pub(crate) fn each(mut self, mut each: impl FnMut(&Epoch<'_>)) -> Result<(), SmoothError> {
        let Row { values: ambient, signals, n, .. } = self.row;
        let mut state = self.layout.initial_state();
        let mut truth = state.clone();
        let mut covariance = Covariance::zero(n);
        let mut known = vec![false; self.row.blocks];
        let triangle = self.row.triangle();
        self.rows.reversed(|row| {
            let (estimate, given) = row.split_at(1 + ambient + signals + triangle);
            state.time = Time::from_nanos(estimate[0].to_bits().cast_signed());
            state.values.copy_from_slice(&estimate[1..=ambient]);
            state.signals.copy_from_slice(&estimate[1 + ambient..][..signals]);
            unpack(&estimate[1 + ambient + signals..], n, &mut covariance);
            truth.time = state.time;
            truth.values.copy_from_slice(&given[1..=ambient]);
            known.iter_mut().zip(&given[1 + ambient..]).for_each(|(k, v)| *k = *v != 0.0);
            let truth = (given[0] != 0.0).then_some(Truth { state: &truth, known: &known });
            let (layout, state, covariance) = (&*self.layout, &state, &covariance);
            each(&Epoch { layout, state, covariance, truth });
        })?;
        Ok(())
    }
}
