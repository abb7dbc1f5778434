//! Measurement models: one generic function, its Jacobian by dual numbers.

use crate::Real;
use crate::model::sensor::roster::Roster;
use crate::model::simulate::Scene;
use crate::state::covariance::Update;
use crate::state::manifold::{MAX_TANGENT, Manifold, Position};
use crate::state::{BlockSet, Handle, Layout, State, View};
use crate::units::sample::{MAX_CHANNELS, Sample, SensorId};
use crate::units::time::Time;
use nalgebra::{SMatrix, SVector};
use num_dual::Dual64;
use std::cell::RefCell;

/// A measurement model of `N` channels: `z [-] h(x) = v`, `v ~ N(0, R)`.
///
/// A sensor may have more than `N` channels. The channels after the first `N` are not measured;
/// [`View::channel`] reads them.
///
/// The author writes [`Self::predict`]. The framework differentiates it with respect to every block
/// that it reads, leaves out channels that a sample lacks, and simulates the sensor with it. Models
/// never touch the covariance.
///
/// A range from the origin of a two-dimensional state:
/// ```
/// use navfuse_core::Real;
/// use navfuse_core::state::manifold::Vector;
/// use navfuse_core::model::sensor::measurement::MeasurementModel;
/// use navfuse_core::state::{Handle, View};
/// use nalgebra::{SMatrix, SVector};
/// struct Range { position: Handle<Vector<2>>, sigma: f64 }
/// impl MeasurementModel<1> for Range {
///     fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
///         SVector::from([x.get(self.position).norm()])
///     }
///     fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
///         SMatrix::from_element(self.sigma * self.sigma)
///     }
/// }
/// ```
pub trait MeasurementModel<const N: usize>: Send + 'static {
    /// `h(x)`: predicted values of the channels, in the sensor's channel order, SI. A channel without a
    /// reading, such as beyond a map, is NaN, and its sample is rejected. `convert(f64::NAN)` is one scalar;
    /// all channels are `SVector::repeat(convert(f64::NAN))`. For `convert` in place of a vector the compiler
    /// reports that `f64: SubsetOf<Matrix<..>>` is not satisfied.
    /// ```
    /// use navfuse_core::prelude::*;
    /// /// The height of a bottom that is mapped north of zero, and its slope.
    /// fn bottom<T: Real>(north: T) -> SVector<T, 2> {
    ///     if number(north) < 0.0 {
    ///         return SVector::repeat(convert(f64::NAN));
    ///     }
    ///     SVector::from([north * convert(0.02), convert(0.02)])
    /// }
    /// assert!(bottom(-1.0_f64)[1].is_nan() && bottom(1.0_f64)[0] == 0.02);
    /// ```
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, N>;

    /// `R`: covariance of the noise of the channels, SI squared.
    fn noise(&self, x: &View<'_, f64>) -> SMatrix<f64, N, N>;

    /// Largest number of observations of one time, each a sample of its own: the satellites that a
    /// receiver tracks, the landmarks in an image. The filter applies, gates and records them one
    /// by one. Default: 1, so that a second sample of one time is rejected.
    fn observations(&self) -> usize {
        1
    }

    /// Returns `true` if a past state is taken at this sample. Default: at every sample. Odometry
    /// that measures from keyframes names them, such as by a channel. A sample with no measured
    /// channel at which a past state is taken is an event, such as a ping: it updates nothing else.
    /// Of several observations of one time, the past state is taken after the last.
    fn keyframe(&self, _sample: &Sample) -> bool {
        true
    }

    /// Adds and removes blocks that come and go, before a sample is used at the state `x`: a landmark
    /// that is seen for the first time, a beacon that has not been heard for long. `x` reads the
    /// sample as in [`Self::predict`]. A sample whose prediction is NaN, since its block is absent,
    /// is rejected. Default: nothing.
    fn admit(&self, _x: &View<'_, f64>, _roster: &mut Roster<'_>) {}

    /// `z [-] h(x)` of one channel. Default: the difference. A model of an angle wraps it into
    /// +-pi.
    fn difference(&self, _channel: usize, measured: f64, predicted: f64) -> f64 {
        measured - predicted
    }

    /// Completes a sample before its use with channels that a recording may omit because their
    /// value is always the same, such as the sideways speed of a rolling wheel. A sample without
    /// any of the model's channels stays as it is.
    fn complete(&self, _sample: &mut Sample) {}

    /// Fills a simulated sample with the prediction from the truth and noise of `R`. Override it
    /// for a sensor that loses channels, or has more than `N` of them: set the additional channels
    /// first, call [`Scene::measure`], and then clear the lost channels. It is called for each
    /// [`Scene::observation`]; a sample without channels is not sent.
    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        scene.measure(self, sample);
    }

    /// Time of the next simulated sample, if the instrument sends one before the next multiple of
    /// its rate: the reply to a ping. It is asked after each sample, with the scene of that sample,
    /// whose trajectory also knows later times. Default: none.
    fn next_time(&self, _scene: &mut Scene<'_>, _sample: &Sample) -> Option<Time> {
        None
    }

    /// Analytic Jacobian in place of dual numbers: fill every block that `predict` reads and return
    /// `true`.
    fn jacobian(&self, _x: &View<'_, f64>, _h: &mut Jacobian<'_, N>) -> bool {
        false
    }
}

/// Jacobian of an `N`-channel model, filled block by block.
#[derive(Debug)]
pub struct Jacobian<'a, const N: usize> {
    layout: &'a Layout,
    columns: &'a [usize],
    /// Row-major over all `N` channels.
    values: &'a mut [f64],
}

impl<const N: usize> Jacobian<'_, N> {
    /// Sets the derivative with respect to a block's tangent; a fixed block is skipped.
    pub fn set<M: Manifold, const K: usize>(
        &mut self,
        block: Handle<M>,
        derivative: &SMatrix<f64, N, K>,
    ) {
        const { assert!(K == M::TANGENT) };
        let Some(tangent) = self.layout.block(block).tangent else { return };
        if let Some(at) = self.columns.iter().position(|&c| c == tangent) {
            for i in 0..N {
                for k in 0..K {
                    self.values[i * self.columns.len() + at + k] = derivative[(i, k)];
                }
            }
        }
    }
}

/// A measurement model with its type erased, as the estimator and the simulator call it.
///
/// ```
/// use navfuse_core::model::sensor::measurement::{AnyMeasurement, At};
/// use navfuse_core::prelude::*;
/// /// Returns the reading of each channel at a state and its 1-sigma, for a sensor of any type.
/// fn reading(model: &dyn AnyMeasurement, layout: &Layout, state: &State) -> Vec<(f64, f64)> {
///     let (n, at) = (model.channels(), At::state(layout, state));
///     let (mut h, mut r) = (vec![0.0; n], vec![0.0; n * n]);
///     model.predict(&at, &mut h);
///     model.noise(&at, &mut r);
///     (0..n).map(|i| (h[i], r[i * n + i].sqrt())).collect()
/// }
/// ```
pub trait AnyMeasurement: Send {
    /// Number of predicted channels.
    fn channels(&self) -> usize;
    /// Largest number of observations of one time, each a sample of its own.
    fn observations(&self) -> usize {
        1
    }
    /// Returns `true` if a past state is taken at the sample.
    fn keyframe(&self, _sample: &Sample) -> bool {
        true
    }
    /// Adds and removes blocks that come and go, before a sample is used.
    fn admit(&self, _at: &At<'_>, _roster: &mut Roster<'_>) {}
    /// Computes `h(x)` into `out`.
    fn predict(&self, at: &At<'_>, out: &mut [f64]);
    /// Computes `R`, row-major, into `out`.
    fn noise(&self, at: &At<'_>, out: &mut [f64]);
    /// Computes innovation, Jacobian and noise of the sample's channels into the update's work
    /// space.
    fn linearise(&self, at: &At<'_>, update: &mut Update);
    /// Blocks that `h` reads.
    fn blocks(&self, at: &At<'_>) -> BlockSet;
    /// Computes the derivative of `h(x)` with respect to a component of the tangent of a block, by
    /// dual numbers, into `out`. The block may be fixed.
    fn derivative(&self, at: &At<'_>, block: usize, component: usize, out: &mut [f64]);
    /// Computes the Jacobian over `columns` (row-major, all channels) by dual numbers.
    fn differentiate(&self, at: &At<'_>, columns: &[usize], read: &BlockSet, h: &mut [f64]);
    /// Computes the analytic Jacobian, if the model has one.
    fn analytic(&self, at: &At<'_>, columns: &[usize], h: &mut [f64]) -> bool;
    /// Computes `z [-] h(x)` of one channel.
    fn difference(&self, channel: usize, measured: f64, predicted: f64) -> f64;
    /// Computes the change of each channel from one state to another, `h(to) [-] h(from)`, into
    /// `out`.
    fn change(&self, from: &At<'_>, to: &At<'_>, out: &mut [f64]);
    /// Completes a sample with the channels that a recording may omit.
    fn complete(&self, sample: &mut Sample);
    /// Fills a simulated sample.
    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample);
    /// Time of a simulated sample between this one and the next multiple of the rate.
    fn next_time(&self, _scene: &mut Scene<'_>, _sample: &Sample) -> Option<Time> {
        None
    }
}

/// Point of evaluation of a model: a state, and the sample to predict.
#[derive(Clone, Copy, Debug)]
pub struct At<'a> {
    /// The layout of the state.
    pub layout: &'a Layout,
    /// The state.
    pub state: &'a State,
    /// The sample.
    pub sample: &'a Sample,
}

static NO_SAMPLE: Sample = Sample::empty(Time::MIN, SensorId(0));

impl<'a> At<'a> {
    /// Evaluation at a state, for a model that reads no channel.
    pub fn state(layout: &'a Layout, state: &'a State) -> Self {
        Self { layout, state, sample: &NO_SAMPLE }
    }

    pub(super) fn view(&self) -> View<'a, f64> {
        View::new(self.layout, self.state).with(self.sample)
    }
}

/// Adapter that makes a model an [`AnyMeasurement`].
#[derive(Debug)]
pub struct Erased<M, const N: usize>(pub M);

impl<M: MeasurementModel<N>, const N: usize> Erased<M, N> {
    /// Derivative of the prediction along one axis of the tangent of a block.
    fn dual(&self, at: &At<'_>, slot: usize, axis: usize) -> [f64; N] {
        let mut delta = [Dual64::from(0.0); MAX_TANGENT];
        delta[axis] = delta[axis].derivative();
        let view = View::seeded(at.layout, at.state, slot, delta).with(at.sample);
        let z = self.0.predict(&view);
        std::array::from_fn(|i| z[i].eps)
    }
}

impl<M: MeasurementModel<N>, const N: usize> AnyMeasurement for Erased<M, N> {
    fn channels(&self) -> usize {
        N
    }

    fn observations(&self) -> usize {
        self.0.observations()
    }

    fn keyframe(&self, sample: &Sample) -> bool {
        self.0.keyframe(sample)
    }

    fn admit(&self, at: &At<'_>, roster: &mut Roster<'_>) {
        self.0.admit(&at.view(), roster);
    }

    fn predict(&self, at: &At<'_>, out: &mut [f64]) {
        out.copy_from_slice(self.0.predict(&at.view()).as_slice());
    }

    fn noise(&self, at: &At<'_>, out: &mut [f64]) {
        out.copy_from_slice(self.0.noise(&at.view()).as_slice());
    }

    fn blocks(&self, at: &At<'_>) -> BlockSet {
        let read = RefCell::default();
        self.0.predict(&at.view().recording(&read));
        read.into_inner()
    }

    fn linearise(&self, at: &At<'_>, update: &mut Update) {
        const { assert!(N <= MAX_CHANNELS) };
        let read = RefCell::new(std::mem::take(&mut update.read));
        read.borrow_mut().clear();
        let predicted = self.0.predict(&at.view().recording(&read));
        update.read_blocks(at.layout, read.into_inner(), N);
        if !self.analytic(at, &update.columns, &mut update.h) {
            self.differentiate(at, &update.columns, &update.read, &mut update.h);
        }
        let noise = self.0.noise(&at.view());
        let innovation = |i| match at.sample.get(i) {
            Some(z) => self.0.difference(i, z, predicted[i]),
            None => f64::NAN,
        };
        update.keep_channels(
            at.sample,
            &std::array::from_fn::<f64, N, _>(innovation),
            noise.as_slice(),
        );
    }

    fn derivative(&self, at: &At<'_>, block: usize, component: usize, out: &mut [f64]) {
        out.copy_from_slice(&self.dual(at, block, component));
    }

    fn differentiate(&self, at: &At<'_>, columns: &[usize], read: &BlockSet, h: &mut [f64]) {
        let mut column = 0;
        for slot in read.slots() {
            for k in 0..at.layout.blocks[slot].tangent_range().len() {
                let z = self.dual(at, slot, k);
                (0..N).for_each(|i| h[i * columns.len() + column] = z[i]);
                column += 1;
            }
        }
    }

    fn analytic(&self, at: &At<'_>, columns: &[usize], h: &mut [f64]) -> bool {
        self.0.jacobian(&at.view(), &mut Jacobian { layout: at.layout, columns, values: h })
    }

    fn difference(&self, channel: usize, measured: f64, predicted: f64) -> f64 {
        self.0.difference(channel, measured, predicted)
    }

    fn change(&self, from: &At<'_>, to: &At<'_>, out: &mut [f64]) {
        let (from, to) = (self.0.predict(&from.view()), self.0.predict(&to.view()));
        (0..N).for_each(|i| out[i] = self.0.difference(i, to[i], from[i]));
    }

    fn complete(&self, sample: &mut Sample) {
        self.0.complete(sample);
    }

    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        self.0.simulate(scene, sample);
    }

    fn next_time(&self, scene: &mut Scene<'_>, sample: &Sample) -> Option<Time> {
        self.0.next_time(scene, sample)
    }
}

/// The part of [`AnyMeasurement::linearise`] that is the same for all models, compiled once.
impl Update {
    /// Takes the blocks that a model of `n` channels reads, and clears its Jacobian.
    pub(super) fn read_blocks(&mut self, layout: &Layout, read: BlockSet, n: usize) {
        self.columns.clear();
        for slot in read.slots() {
            self.columns.extend(layout.blocks[slot].tangent_range());
        }
        self.read = read;
        self.h.clear();
        self.h.resize(n * self.columns.len(), 0.0);
    }

    /// Takes innovation and noise (column by column) of all channels, and keeps those, with their
    /// rows of the Jacobian, that the sample has.
    pub(super) fn keep_channels(&mut self, sample: &Sample, innovation: &[f64], noise: &[f64]) {
        let (n, w) = (innovation.len(), self.columns.len());
        self.innovation.clear();
        self.r.clear();
        for i in (0..n).filter(|&i| sample.get(i).is_some()) {
            let m = self.innovation.len();
            self.h.copy_within(i * w..(i + 1) * w, m * w);
            self.innovation.push(innovation[i]);
            let present = (0..n).filter(|&j| sample.get(j).is_some());
            self.r.extend(present.map(|j| noise[j * n + i]));
        }
        self.m = self.innovation.len();
    }
}

/// Step of central differences along the tangent of a block: the cube root of the rounding error
/// times the magnitude of the value. The tangent of a position is in metres.
pub(super) fn difference_step(at: &At<'_>, slot: usize) -> f64 {
    let block = &at.layout.blocks[slot];
    let largest = || at.state.values[block.range()].iter().fold(1.0_f64, |a, x| a.max(x.abs()));
    let position = block.operations.kind == std::any::TypeId::of::<Position>();
    6e-6 * if position { 1e3 } else { largest() }
}

/// Largest error of a model's Jacobian at a state, relative to the largest derivative of the
/// channel. The reference is central differences along the tangents of the blocks; their rounding
/// error is subtracted. For tests of sensors; 1e-6 is a good bound.
pub fn jacobian_error(model: &dyn AnyMeasurement, at: &At<'_>) -> f64 {
    let &At { layout, state, sample } = at;
    let (n, read) = (model.channels(), model.blocks(at));
    let columns: Vec<usize> =
        read.slots().flat_map(|slot| layout.blocks[slot].tangent_range()).collect();
    let w = columns.len();
    let mut used = vec![0.0; n * w];
    if !model.analytic(at, &columns, &mut used) {
        model.differentiate(at, &columns, &read, &mut used);
    }
    let (mut numeric, mut rounding) = (vec![0.0; n * w], vec![0.0; n * w]);
    let mut column = 0;
    for slot in read.slots() {
        let (block, step) = (&layout.blocks[slot], difference_step(at, slot));
        for k in 0..block.tangent_range().len() {
            let mut slope = |step: f64| {
                let (mut moved, mut delta, mut z) =
                    (state.clone(), [0.0; MAX_TANGENT], [0.0; MAX_CHANNELS]);
                delta[k] = step;
                (block.operations.retract)(
                    &mut moved.values[block.range()],
                    &delta[..block.operations.tangent],
                );
                model.predict(&At { layout, state: &moved, sample }, &mut z[..n]);
                for i in 0..n {
                    numeric[i * w + column] += z[i] / (2.0 * step);
                    rounding[i * w + column] += 2.0 * f64::EPSILON * (z[i] / step).abs();
                }
            };
            slope(step);
            slope(-step);
            column += 1;
        }
    }
    let row = |m: &[f64], i: usize| m[i * w..(i + 1) * w].to_vec();
    let errors = (0..n).map(|i| {
        let (used, numeric, rounding) = (row(&used, i), row(&numeric, i), row(&rounding, i));
        let largest = numeric.iter().fold(f64::MIN_POSITIVE, |a, x| a.max(x.abs()));
        // a latitude in radians changes little with a lever arm, so rounding of the differences
        // dominates there
        let beyond = |k: usize| ((used[k] - numeric[k]).abs() - rounding[k]) / largest;
        (0..w).map(beyond).fold(0.0_f64, f64::max)
    });
    errors.fold(0.0, f64::max)
}
