//! Hypotheses of the horizontal position: Gaussian components on a grid over the prior, each with its
//! weight (Gaussian sum; Alspach & Sorenson, *IEEE Trans. Automatic Control* 17, 1972).
//!
//! A component is a displacement of the whole track with its covariance, and is corrected by the samples
//! as a filter of two states. Without that, the distance of the truth from the middle of its cell would
//! count against it at every sample.

use crate::trail::displace;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix2, Vector2};
use navfuse_core::model::sensor::measurement::{AnyMeasurement, At};
use navfuse_core::state::covariance::{Covariance, Update};
use navfuse_core::state::{Layout, State};
use navfuse_core::units::sample::Sample;
use std::sync::Arc;

/// Number of cells on either side of the middle.
const HALF: i32 = 30;

/// Reach of the grid on either side, prior sigma.
const REACH: f64 = 4.0;

/// Largest share of one sample in the weights, as a normalised innovation squared: an outlier is
/// improbable by 4 sigma and not by more.
pub(crate) const LARGEST: f64 = 16.0;

/// Difference of the logarithms of the weights at which a component is forgotten.
const FORGOTTEN: f64 = 60.0;

/// Step of a difference, sigma of a component.
const STEP: f64 = 0.3;

/// A displacement to the north and to the east, m, its covariance, and the logarithm of its weight.
#[derive(Clone, Copy)]
struct Component {
    offset: Vector2<f64>,
    covariance: Matrix2<f64>,
    weight: f64,
}

/// The components, and the work space of their predictions.
pub(crate) struct Grid {
    layout: Arc<Layout>,
    /// Blocks of the position: now, and at the times of past states.
    places: Arc<[usize]>,
    components: Vec<Component>,
    /// Variance of the position of the track, north and east, m^2: at the start, and at the last sample.
    prior: [f64; 2],
    last: [f64; 2],
    state: State,
}

impl Grid {
    /// A grid over a prior of these sigmas to the north and to the east, m.
    pub fn new(layout: &Arc<Layout>, places: &Arc<[usize]>, sigmas: [f64; 2]) -> Self {
        let cell = sigmas.map(|s| REACH * s / f64::from(HALF));
        // half a cell, so that the sum is smooth
        let covariance = Matrix2::from_diagonal(&Vector2::from(cell.map(|c| 0.25 * c * c)));
        let at = |i: i32, j: i32| {
            let offset = Vector2::new(f64::from(i) * cell[0], f64::from(j) * cell[1]);
            let weight = -0.5 * ((offset.x / sigmas[0]).powi(2) + (offset.y / sigmas[1]).powi(2));
            Component { offset, covariance, weight }
        };
        let row = |i: i32| (-HALF..=HALF).map(move |j| at(i, j));
        let prior = sigmas.map(|s| s * s);
        Self {
            layout: Arc::clone(layout),
            places: Arc::clone(places),
            components: (-HALF..=HALF).flat_map(row).collect(),
            prior,
            last: prior,
            state: layout.initial_state(),
        }
    }

    /// Corrects and weights the components by a sample. The uncertainty of all other states adds to the
    /// noise of the sample, and what the track has lost since the last sample to their covariance.
    pub fn weigh(
        &mut self,
        state: &State,
        covariance: &Covariance,
        model: &dyn AnyMeasurement,
        sample: &Sample,
    ) {
        let n = model.channels();
        let present: Vec<usize> = (0..n).filter(|k| sample.get(*k).is_some()).collect();
        let m = present.len();
        if m == 0 {
            return;
        }
        let mut noise = vec![0.0; n * n];
        model.noise(&At { layout: &self.layout, state, sample }, &mut noise);
        let rest = self.of_other_states(state, covariance, model, sample, m);
        let noise = DMatrix::from_fn(m, m, |i, j| noise[present[i] * n + present[j]]) + rest;
        let first = self.first(self.places[0]);
        let now = [0, 1].map(|k| covariance.get(first + k, first + k));
        let lost = [0, 1].map(|k| (now[k] - self.last[k]).max(0.0));
        self.last = [0, 1].map(|k| now[k].max(self.last[k]));

        self.state.clone_from(state);
        let mut components = std::mem::take(&mut self.components);
        let mut read = vec![0.0; n];
        for component in &mut components {
            component.covariance += Matrix2::from_diagonal(&Vector2::from(lost));
            let mut at = |offset: Vector2<f64>| {
                self.predict(state, model, sample, offset.into(), &mut read);
                DVector::from_fn(m, |i, _| read[present[i]])
            };
            let steps = [0, 1].map(|k| STEP * component.covariance[(k, k)].sqrt());
            let axes = [Vector2::new(steps[0], 0.0), Vector2::new(0.0, steps[1])];
            let ends = axes.map(|axis| [at(component.offset + axis), at(component.offset - axis)]);
            let middle = at(component.offset);
            let h = DMatrix::from_fn(m, 2, |i, k| {
                let [on, back] = &ends[k];
                model.difference(present[i], on[i], back[i]) / (2.0 * steps[k])
            });
            let innovation = DVector::from_fn(m, |i, _| {
                let z = sample.get(present[i]).unwrap_or(f64::NAN);
                model.difference(present[i], z, middle[i])
            });
            component.correct(&h, &innovation, &noise);
        }
        let largest = components.iter().map(|c| c.weight).fold(f64::NEG_INFINITY, f64::max);
        components.retain(|c| c.weight > largest - FORGOTTEN);
        self.components = components;
    }

    /// Reads the sensor at a displaced state.
    fn predict(
        &mut self,
        state: &State,
        model: &dyn AnyMeasurement,
        sample: &Sample,
        offset: [f64; 2],
        out: &mut [f64],
    ) {
        for block in self.places.iter().map(|slot| &self.layout.blocks[*slot]) {
            self.state.values[block.range()].copy_from_slice(&state.values[block.range()]);
        }
        displace(&self.layout, &self.places, &mut self.state.values, offset);
        model.predict(&At { layout: &self.layout, state: &self.state, sample }, out);
    }

    /// The first error state of a block.
    fn first(&self, slot: usize) -> usize {
        self.layout.blocks[slot].tangent_range().start
    }

    /// Covariance of the prediction by all states but the displacement of the track: the largest of those
    /// at the middle of the grid and around it, since a slope differs from place to place. A past position
    /// counts by what the track since then adds to its error: `H_past (dx_past - dx)`.
    fn of_other_states(
        &mut self,
        state: &State,
        covariance: &Covariance,
        model: &dyn AnyMeasurement,
        sample: &Sample,
        m: usize,
    ) -> DMatrix<f64> {
        let firsts: Vec<usize> = self.places.iter().map(|slot| self.first(*slot)).collect();
        let now = [firsts[0], firsts[0] + 1];
        let mut largest = DMatrix::zeros(m, m);
        let mut update = Update::with_capacity(covariance.dimension(), m);
        let steps = [[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];
        for step in steps {
            let sigmas = self.prior.map(f64::sqrt);
            self.state.clone_from(state);
            let offset = [step[0] * sigmas[0], step[1] * sigmas[1]];
            displace(&self.layout, &self.places, &mut self.state.values, offset);
            model.linearise(&At { layout: &self.layout, state: &self.state, sample }, &mut update);
            let w = update.columns.len();
            let derivative = |i: usize, column: usize| {
                let place = update.columns.iter().position(|c| *c == column);
                place.map_or(0.0, |k| update.h[i * w + k])
            };
            let others = update.columns.iter().copied().filter(|column| !now.contains(column));
            let columns: Vec<usize> = others.chain(now).collect();
            let h = DMatrix::from_fn(m, columns.len(), |i, k| {
                match now.iter().position(|c| *c == columns[k]) {
                    Some(axis) => -firsts[1..].iter().map(|f| derivative(i, f + axis)).sum::<f64>(),
                    None => derivative(i, columns[k]),
                }
            });
            let p = DMatrix::from_fn(columns.len(), columns.len(), |i, j| {
                covariance.get(columns[i], columns[j])
            });
            let spread = &h * p * h.transpose();
            if spread.trace().is_finite() && spread.trace() > largest.trace() {
                largest = spread;
            }
        }
        largest
    }

    /// Places within `margin` of the heaviest one, the heaviest first: components that overlap within
    /// three sigma are one place.
    pub fn places(&self, margin: f64) -> Vec<[f64; 2]> {
        let largest = self.components.iter().map(|c| c.weight).fold(f64::NEG_INFINITY, f64::max);
        let mut heavy: Vec<&Component> =
            self.components.iter().filter(|c| c.weight > largest - margin).collect();
        heavy.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        let mut places: Vec<&Component> = Vec::new();
        for component in heavy {
            if !places.iter().any(|place| place.overlaps(component)) {
                places.push(component);
            }
        }
        places.into_iter().map(|place| place.offset.into()).collect()
    }
}

impl Component {
    /// Corrects offset and covariance, and weights the component by the density of the innovation.
    fn correct(&mut self, h: &DMatrix<f64>, innovation: &DVector<f64>, noise: &DMatrix<f64>) {
        let spread = DMatrix::from_fn(2, h.nrows(), |k, i| {
            (0..2).map(|j| self.covariance[(k, j)] * h[(i, j)]).sum()
        });
        let s = noise + h * &spread;
        let Some(Fit { likelihood, squared, root }) = Fit::of(innovation, s) else {
            // beyond the map, or beside its edge: an outlier of the noise
            let alone = noise.diagonal().iter().map(|r| r.ln()).sum::<f64>();
            self.weight -= 0.5 * (LARGEST + alone);
            return;
        };
        self.weight += likelihood;
        if squared > LARGEST {
            return;
        }
        let delta = &spread * root.solve(innovation);
        let less = &spread * root.solve(&spread.transpose());
        self.offset += Vector2::new(delta[0], delta[1]);
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            self.covariance[(i, j)] -= 0.5 * (less[(i, j)] + less[(j, i)]);
        }
    }

    /// Returns `true` if both are one place.
    fn overlaps(&self, other: &Self) -> bool {
        let apart = self.offset - other.offset;
        let sum = self.covariance + other.covariance;
        sum.try_inverse().is_some_and(|inverse| apart.dot(&(inverse * apart)) < 9.0)
    }
}

/// An innovation beside its covariance.
pub(crate) struct Fit {
    /// Logarithm of the density, with a bound on the square.
    pub likelihood: f64,
    /// Normalised innovation squared.
    squared: f64,
    root: Cholesky<f64, Dyn>,
}

impl Fit {
    /// `None` where the innovation or its density is not a number.
    pub fn of(innovation: &DVector<f64>, s: DMatrix<f64>) -> Option<Self> {
        let root = s.cholesky()?;
        let squared = root.solve(innovation).dot(innovation);
        let log_det: f64 = root.l_dirty().diagonal().iter().map(|d| 2.0 * d.ln()).sum();
        let sum = squared.min(LARGEST) + log_det;
        let finite = squared.is_finite() && sum.is_finite();
        finite.then_some(Self { likelihood: -0.5 * sum, squared, root })
    }
}
