//! Records of one segment of the run, which the backward recursion reads.

use super::adjoint::Correction;
use super::course;
use super::estimate;
use crate::model::record::{Epoch, Observer, UpdateRecord};
use crate::state::covariance::{BackwardStep, Covariance, Product, Transition, Update};
use crate::state::{Layout, State};
use crate::units::sample::SensorId;
use crate::units::time::Time;
use std::slice::Iter;

/// A record.
#[derive(Clone, Copy, Debug)]
pub(super) enum Kind {
    /// Elements of a transition, or of the product of several, with the number of its pattern.
    Step(usize),
    /// A correction with that many components and columns, and its number in the segment.
    Update(usize, usize, usize),
    /// A gated sample with that many components, and its number in the segment: the gate, and what
    /// [`super::adjoint::Adjoint::reconsider`] takes.
    Gated(usize, usize),
    /// An estimate that the run records, see `estimate.rs`, and the offset of a further pass.
    Epoch,
    /// The end of a step, at which a further pass linearises: see `course.rs`.
    Course,
}

/// Length of the record of a correction.
pub(super) fn correction_length(update: &Update, n: usize, considers: bool) -> usize {
    let (m, w) = (update.m, update.columns.len());
    m * w + m * m + n * m * (1 + usize::from(considers)) + m + n + w
}

/// Length of the record of a gated sample.
pub(super) fn gated_length(update: &Update, n: usize) -> usize {
    1 + update.m * (update.m + n + 1)
}

/// Records of one segment.
pub(super) struct Segment {
    n: usize,
    considers: bool,
    data: Vec<f64>,
    columns: Vec<usize>,
    index: Vec<(Kind, usize, usize)>,
    /// Sensor and time of each correction and gated sample.
    pub(super) sources: Vec<(SensorId, Time)>,
    /// The pattern of the steps, and those of the clones.
    patterns: Vec<BackwardStep>,
    /// Transitions since the last record.
    product: Product,
}

impl Segment {
    pub(super) fn new(layout: &Layout, considers: bool) -> Self {
        Self {
            n: layout.tangent,
            considers,
            data: Vec::new(),
            columns: Vec::new(),
            index: Vec::new(),
            sources: Vec::new(),
            patterns: Vec::new(),
            product: Product::default(),
        }
    }

    /// Patterns of the transitions, without which the records can be read meanwhile.
    pub(super) fn take_patterns(&mut self) -> Vec<BackwardStep> {
        std::mem::take(&mut self.patterns)
    }

    /// Returns the patterns of [`Self::take_patterns`].
    pub(super) fn keep_patterns(&mut self, patterns: Vec<BackwardStep>) {
        self.patterns = patterns;
    }

    pub(super) fn clear(&mut self) {
        self.data.clear();
        self.columns.clear();
        self.index.clear();
        self.sources.clear();
    }

    fn begin(&mut self, kind: Kind) {
        self.index.push((kind, self.data.len(), self.columns.len()));
    }

    /// Adds a step. The steps between two other records have one record: their product changes few
    /// columns, while the backward recursion passes each record over the whole information.
    pub(super) fn transition(&mut self, transition: &Transition) {
        if !self.product.append(transition) {
            self.end_product();
            self.product.append(transition);
        }
    }

    /// Records the steps since the last record.
    pub(super) fn end_product(&mut self) {
        if self.product.is_empty() {
            return;
        }
        let places = self.product.places();
        let known = self.patterns.iter().position(|p| p.places() == places);
        let pattern = known.unwrap_or(self.patterns.len());
        if known.is_none() {
            self.patterns.push(BackwardStep::new(self.n, places));
        }
        self.begin(Kind::Step(pattern));
        self.data.extend(self.product.values());
        self.product.restart();
    }

    /// Adds a correction.
    pub(super) fn correction(&mut self, update: &Update, source: (SensorId, Time)) {
        self.end_product();
        self.begin(Kind::Update(update.m, update.columns.len(), self.sources.len()));
        self.sources.push(source);
        self.columns.extend_from_slice(&update.columns);
        // the Jacobian may have more room than rows
        let h = &update.h[..update.m * update.columns.len()];
        for part in [h, &update.s, update.gain()] {
            self.data.extend_from_slice(part);
        }
        if self.considers {
            self.data.extend(update.cross_covariance());
        }
        for part in [&update.innovation, &update.delta] {
            self.data.extend_from_slice(part);
        }
    }

    /// Adds an injection without a sample: a correction without components.
    pub(super) fn injection(&mut self, delta: &[f64]) {
        self.end_product();
        self.begin(Kind::Update(0, 0, self.sources.len()));
        self.sources.push((SensorId(0), Time::MIN));
        self.data.extend_from_slice(delta);
    }

    fn gated(&mut self, update: &Update, source: (SensorId, Time), threshold: f64) {
        self.end_product();
        self.begin(Kind::Gated(update.m, self.sources.len()));
        self.sources.push(source);
        self.data.push(threshold);
        self.data.extend_from_slice(&update.s);
        self.data.extend_from_slice(&update.innovation);
        self.data.extend(update.cross_covariance());
    }

    fn epoch(&mut self, epoch: &Epoch<'_>, offset: &[f64]) {
        self.end_product();
        self.begin(Kind::Epoch);
        estimate::write(epoch, &mut self.data);
        self.data.extend_from_slice(offset);
    }

    /// Adds the end of a step.
    pub(super) fn course(&mut self, state: &State, covariance: &Covariance, offset: &[f64]) {
        self.end_product();
        self.begin(Kind::Course);
        course::write(state, covariance, offset, &mut self.data);
    }

    /// Records, the last one first: each with its numbers and columns.
    pub(super) fn reversed(&self) -> impl Iterator<Item = (Kind, &[f64], &[usize])> {
        let ends = self.index.iter().skip(1).map(|i| (i.1, i.2));
        let ends: Vec<_> = ends.chain([(self.data.len(), self.columns.len())]).collect();
        self.index.iter().zip(ends).rev().map(|(&(kind, at, column), (end, last))| {
            (kind, &self.data[at..end], &self.columns[column..last])
        })
    }

    /// The correction of a record.
    pub(super) fn correction_of<'a>(
        &self,
        m: usize,
        w: usize,
        values: &'a [f64],
        columns: &'a [usize],
    ) -> Correction<'a> {
        let n = self.n;
        let (h, rest) = values.split_at(m * w);
        let (s, rest) = rest.split_at(m * m);
        let (gain, rest) = rest.split_at(n * m);
        let (cross, rest) = rest.split_at(if self.considers { n * m } else { 0 });
        let (innovation, delta) = rest.split_at(m);
        Correction { m, columns, h, s, gain, cross, innovation, delta }
    }
}

/// Records a segment while the filter computes it again.
pub(super) struct Recorder<'a> {
    pub(super) segment: &'a mut Segment,
    /// For each estimate, `true` if the run records it.
    pub(super) recorded: Iter<'a, bool>,
    /// Sensor, time and gate of the last judged sample.
    pub(super) source: (SensorId, Time, f64),
    /// Offset of a further pass; empty in the first one.
    pub(super) offset: Vec<f64>,
    /// Set if the state at the end of each step is recorded for the next pass.
    pub(super) course: bool,
}

impl Observer for Recorder<'_> {
    fn epoch(&mut self, epoch: &Epoch<'_>) {
        if self.recorded.next().is_some_and(|recorded| *recorded) {
            self.segment.epoch(epoch, &self.offset);
        }
    }
    fn update(&mut self, update: &UpdateRecord<'_>) {
        self.source = (update.sensor, update.time, update.threshold);
    }
    fn transition(&mut self, transition: &Transition) {
        self.segment.transition(transition);
    }
    fn correction(&mut self, update: &Update) {
        let (sensor, time, _) = self.source;
        self.segment.correction(update, (sensor, time));
    }
    fn moved(&mut self, state: &State, covariance: &Covariance, offset: &[f64]) {
        self.corrected(offset);
        if self.course {
            self.segment.course(state, covariance, offset);
        }
    }
    fn corrected(&mut self, offset: &[f64]) {
        self.offset.clear();
        self.offset.extend_from_slice(offset);
    }
    fn gated(&mut self, update: &Update) {
        let (sensor, time, threshold) = self.source;
        self.segment.gated(update, (sensor, time), threshold);
    }
}
