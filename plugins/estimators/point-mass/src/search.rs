//! The search: which sensors are curved, what they weigh, and which place explains the samples.

use crate::grid::Grid;
use crate::pass::Passed;
use crate::trail::{Trail, displace};
use navfuse_core::compose::Composition;
use navfuse_core::compose::estimator::Linearised;
use navfuse_core::compose::snapshot::Snapshot;
use navfuse_core::model::chi_square::above;
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::measurement::{AnyMeasurement, At};
use navfuse_core::state::manifold::Position;
use navfuse_core::state::{Handle, Layout, State};
use navfuse_core::units::sample::Sample;
use navfuse_core::units::time::Time;
use std::collections::VecDeque;
use std::sync::Arc;

/// Number of samples of the curved sensors at which the first decision is tried, and the part by which
/// their number grows until the next one.
const FIRST: usize = 8;
const GROWTH: usize = 4;

/// Difference of the logarithms of the weights at which a place is given up. It is wider than [`MARGIN`],
/// since the hypotheses neglect that the errors of other states last.
const GIVEN_UP: f64 = 20.0;

/// Largest number of places along which the filter runs.
const MOST: usize = 8;

/// Difference of the logarithms of the likelihoods at which the better place is decided: odds of
/// 22 000 to 1.
const MARGIN: f64 = 10.0;

/// Least probability that chance makes the innovations of the better place as large as they are.
const BY_CHANCE: f64 = 1e-4;

/// Number of samples that are kept before the filter starts.
const WAITING: usize = 256;

/// Longest time of a search, s.
pub(crate) const LONGEST: f64 = 1800.0;

/// The samples since the start, and the weights of the hypotheses.
pub(crate) struct Search {
    pub layout: Arc<Layout>,
    pub position: Handle<Position>,
    /// Blocks of the position: now, and at the times of past states.
    pub places: Arc<[usize]>,
    models: Vec<Option<Arc<dyn AnyMeasurement + Sync>>>,
    /// Whether each sensor is curved, once it is known.
    known: Vec<bool>,
    pub curved: Vec<bool>,
    /// Whether the filter has taken the past state that each sensor reads.
    begun: Vec<bool>,
    /// The filter before the first sample, which has not started.
    pub first: Snapshot,
    pub samples: Vec<Sample>,
    pub trail: Arc<Trail>,
    /// Samples of curved sensors for which the filter has not reached their time.
    held: VecDeque<Sample>,
    grid: Option<Grid>,
    pub start: Option<Time>,
    pub used: usize,
    next: usize,
}

/// Result of a search.
pub(crate) struct Decided {
    pub best: Passed,
    /// Number of places, and the logarithm of the odds against the next one.
    pub places: usize,
    pub odds: f64,
}

impl Search {
    pub fn new(composition: &Composition, first: Snapshot) -> Option<Self> {
        let layout = Arc::clone(&composition.layout);
        let models = composition.sensors.iter().map(|sensor| match &sensor.role {
            Role::Measurement(model) => Some(Arc::clone(model)),
            Role::Input(_) | Role::Reference(_) => None,
        });
        let n = composition.sensors.len();
        let position = layout.vehicle().position?;
        let clones = composition.sensors.iter().flat_map(|sensor| &sensor.clones);
        let pasts = clones.filter(|[source, _]| *source == position.slot()).map(|[_, past]| *past);
        Some(Self {
            position,
            places: std::iter::once(position.slot()).chain(pasts).collect(),
            begun: composition.sensors.iter().map(|sensor| sensor.clones.is_empty()).collect(),
            models: models.collect(),
            known: vec![false; n],
            curved: vec![false; n],
            first,
            samples: Vec::new(),
            trail: Arc::default(),
            held: VecDeque::new(),
            grid: None,
            start: None,
            used: 0,
            next: FIRST,
            layout,
        })
    }

    /// Begins anew with the filter as it is.
    pub fn begin(&mut self, first: Snapshot) {
        self.first = first;
        self.samples.clear();
        Arc::make_mut(&mut self.trail).clear();
    }

    /// Notes a sample that the run takes next; `running` once the filter has started.
    pub fn note(&mut self, ekf: &dyn Linearised, sample: &Sample) {
        if !ekf.running() && self.samples.len() == WAITING {
            self.begin(ekf.snapshot());
        }
        self.samples.push(*sample);
    }

    /// Returns `true` if the filter must not take the sample now, and keeps it. The filter takes the samples
    /// at which a past state is taken, such as pings.
    pub fn holds(&mut self, ekf: &dyn Linearised, sample: &Sample) -> bool {
        let index = sample.sensor.0;
        let Some(model) = self.models[index].clone() else { return false };
        let mut completed = *sample;
        model.complete(&mut completed);
        let measures = (0..model.channels()).any(|k| completed.get(k).is_some());
        let sensor = &ekf.composition().sensors[index];
        let excluded = sensor.excludes(sample.time);
        if !sensor.clones.is_empty() && model.keyframe(&completed) {
            // the samples before it measure from the past state that it replaces
            self.weigh(ekf, sample.time);
            self.begun[index] = ekf.running() && !excluded;
            return false;
        }
        if !measures || excluded || !self.begun[index] {
            return false;
        }
        if !self.known[index] {
            let covariance = ekf.covariance();
            let block = self.layout.block(self.position);
            let first = block.tangent_range().start;
            let sigmas = [0, 1].map(|k| {
                if ekf.running() { covariance.sigma(first + k) } else { block.spec.sigma[k] }
            });
            let track = (&*self.layout, &*self.places);
            let curved = is_curved(model.as_ref(), track, ekf.state(), sigmas, &completed);
            self.curved[index] = curved;
            self.known[index] = ekf.running();
        }
        if self.curved[index] {
            self.held.push_back(*sample);
        }
        self.curved[index]
    }

    /// Weights the hypotheses by the samples up to a time, which the filter has reached but for a part of
    /// the interval of the driving sensor.
    pub fn weigh(&mut self, ekf: &dyn Linearised, until: Time) {
        if !ekf.running() || self.trail.is_empty() {
            return;
        }
        let (state, covariance) = (ekf.state(), ekf.covariance());
        let first = self.layout.block(self.position).tangent_range().start;
        if self.grid.is_none() {
            let sigmas = [0, 1].map(|k| covariance.sigma(first + k));
            self.start = Some(state.time);
            self.grid = Some(Grid::new(&self.layout, &self.places, sigmas));
        }
        while self.held.front().is_some_and(|sample| sample.time <= until) {
            let Some(mut sample) = self.held.pop_front() else { return };
            // before the start no track leads to it
            if self.start.is_some_and(|start| sample.time < start) {
                continue;
            }
            let Some((grid, model)) = self.grid.as_mut().zip(self.models[sample.sensor.0].as_ref())
            else {
                continue;
            };
            model.complete(&mut sample);
            grid.weigh(state, &covariance, model.as_ref(), &sample);
            self.used += 1;
        }
    }

    /// Returns `true` if a decision is due.
    pub fn is_due(&self) -> bool {
        self.used >= self.next
    }

    /// Runs the filter along the places that are left, and compares the results. The filter is in any
    /// state afterwards.
    pub fn decide(&mut self, ekf: &mut dyn Linearised) -> Option<Decided> {
        self.next = self.used + (self.used / GROWTH).max(1);
        let candidates = self.grid.as_ref()?.places(GIVEN_UP);
        if candidates.len() > MOST {
            return None;
        }
        let here = ekf.state().clone();
        let mut places: Vec<Passed> = Vec::new();
        for offset in &candidates {
            // a place that does not settle is not excluded
            let passed = self.pass(ekf, &here, *offset)?;
            // two hypotheses may lead to one place
            let same = |other: &Passed| {
                (0..2).all(|k| {
                    (other.offset[k] - passed.offset[k]).abs() < other.sigma[k] + passed.sigma[k]
                })
            };
            match places.iter_mut().find(|other| same(other)) {
                Some(other) if other.likelihood < passed.likelihood => *other = passed,
                Some(_) => {}
                None => places.push(passed),
            }
        }
        places.sort_by(|a, b| b.likelihood.total_cmp(&a.likelihood));
        let mut places = places.into_iter();
        let best = places.next()?;
        let odds = places.next().map_or(f64::INFINITY, |next| best.likelihood - next.likelihood);
        let fits = above(best.expected.max(1), best.squared) >= BY_CHANCE;
        (odds >= MARGIN && fits).then_some(Decided { best, places: candidates.len(), odds })
    }

    /// Names of the curved sensors of a composition.
    pub fn names(&self, composition: &Composition) -> String {
        let names = composition.sensors.iter().zip(&self.curved).filter(|(_, curved)| **curved);
        names.map(|(sensor, _)| sensor.info.name.as_str()).collect::<Vec<_>>().join(", ")
    }
}

/// Returns `true` if the second-order term of a model within one sigma of the horizontal position is
/// above its noise, or if the model has no value there.
fn is_curved(
    model: &dyn AnyMeasurement,
    (layout, places): (&Layout, &[usize]),
    state: &State,
    sigmas: [f64; 2],
    sample: &Sample,
) -> bool {
    let n = model.channels();
    let mut displaced = state.clone();
    let mut reading = |offset: [f64; 2]| {
        displaced.clone_from(state);
        displace(layout, places, &mut displaced.values, offset);
        let mut out = vec![0.0; n];
        model.predict(&At { layout, state: &displaced, sample }, &mut out);
        out
    };
    let middle = reading([0.0; 2]);
    let axes = [[sigmas[0], 0.0], [0.0, sigmas[1]]];
    let ends = axes.map(|axis| [reading(axis), reading(axis.map(|x| -x))]);
    let mut noise = vec![0.0; n * n];
    model.noise(&At { layout, state, sample }, &mut noise);
    let measured = (0..n).filter(|k| sample.get(*k).is_some());
    measured.into_iter().any(|k| {
        ends.iter().any(|[on, back]| {
            let term = 0.5
                * (model.difference(k, on[k], middle[k]) + model.difference(k, back[k], middle[k]));
            term.is_nan() || term * term > noise[k * n + k]
        })
    })
}
