//! Measurement models whose channels are known at run time only, as a script declares them.

use super::measurement::{AnyMeasurement, At, difference_step};
use crate::model::simulate::Scene;
use crate::state::covariance::Update;
use crate::state::manifold::MAX_TANGENT;
use crate::state::{BlockSet, View};
use crate::units::sample::{MAX_CHANNELS, Sample};
use nalgebra::DMatrix;
use std::cell::RefCell;

/// A measurement model whose number of channels is known at run time: `z [-] h(x) = v`,
/// `v ~ N(0, R)`.
///
/// It is a [`MeasurementModel`] without type parameters. The framework differentiates it by central
/// differences along the tangents of the blocks that it reads, so that each sample costs two
/// predictions for every error state in place of one. `AnyHandle` names a block whose manifold the
/// program does not know.
///
/// ```
/// use navfuse_core::prelude::*;
/// /// A polynomial of one state, whose coefficients a script gives.
/// struct Polynomial { state: AnyHandle, coefficients: Vec<f64>, sigma: f64 }
/// impl DynamicModel for Polynomial {
///     fn predict(&self, x: &View<'_, f64>, z: &mut [f64]) {
///         let mut value = [0.0];
///         x.read(self.state, &mut value);
///         z[0] = self.coefficients.iter().rev().fold(0.0, |sum, c| sum * value[0] + c);
///     }
///     fn noise(&self, _: &View<'_, f64>, r: &mut [f64]) {
///         r[0] = self.sigma * self.sigma;
///     }
/// }
/// let mut registry = Registry::new();
/// let schema = schemars::json_schema!({
///     "type": "object", "properties": { "coefficients": { "type": "array" } }
/// });
/// registry.sensor_dyn("polynomial", schema, |table, composer| {
///     let given = table.get("coefficients").and_then(|list| list.as_array());
///     let coefficients = given.into_iter().flatten().filter_map(|c| c.as_f64()).collect();
///     let state = composer.find_any("state", "lake.level")?;
///     let model = Polynomial { state, coefficients, sigma: 0.1 };
///     Ok((vec![Channel::new("level", "m")], Role::dynamic(1, model)))
/// });
/// ```
///
/// [`MeasurementModel`]: super::measurement::MeasurementModel
pub trait DynamicModel: Send + Sync + 'static {
    /// Computes `h(x)`, the predicted values of the channels in the sensor's channel order, SI.
    fn predict(&self, x: &View<'_, f64>, z: &mut [f64]);

    /// Computes `R`, the covariance of the noise of the channels, row by row, SI squared. The
    /// elements are zero before.
    fn noise(&self, x: &View<'_, f64>, r: &mut [f64]);

    /// `z [-] h(x)` of one channel. Default: the difference. A model of an angle wraps it into
    /// +-pi.
    fn difference(&self, _channel: usize, measured: f64, predicted: f64) -> f64 {
        measured - predicted
    }
}

/// Adapter that makes a dynamic model an [`AnyMeasurement`].
pub(super) struct Dynamic<M> {
    pub channels: usize,
    pub model: M,
}

impl<M: DynamicModel> Dynamic<M> {
    fn predicted(&self, x: &View<'_, f64>) -> [f64; MAX_CHANNELS] {
        let mut z = [0.0; MAX_CHANNELS];
        self.model.predict(x, &mut z[..self.channels]);
        z
    }

    fn noise_at(&self, x: &View<'_, f64>) -> [f64; MAX_CHANNELS * MAX_CHANNELS] {
        let mut r = [0.0; MAX_CHANNELS * MAX_CHANNELS];
        self.model.noise(x, &mut r[..self.channels * self.channels]);
        r
    }

    /// Derivative of the prediction along one axis of the tangent of a block.
    fn slope(&self, at: &At<'_>, slot: usize, axis: usize) -> [f64; MAX_CHANNELS] {
        let step = difference_step(at, slot);
        let [ahead, behind] = [step, -step].map(|step| {
            let mut delta = [0.0; MAX_TANGENT];
            delta[axis] = step;
            self.predicted(&View::seeded(at.layout, at.state, slot, delta).with(at.sample))
        });
        let difference = |i| self.model.difference(i, ahead[i], behind[i]) / (2.0 * step);
        std::array::from_fn(|i| if i < self.channels { difference(i) } else { 0.0 })
    }
}

impl<M: DynamicModel> AnyMeasurement for Dynamic<M> {
    fn channels(&self) -> usize {
        self.channels
    }

    fn predict(&self, at: &At<'_>, out: &mut [f64]) {
        self.model.predict(&at.view(), out);
    }

    fn noise(&self, at: &At<'_>, out: &mut [f64]) {
        out.fill(0.0);
        self.model.noise(&at.view(), out);
    }

    fn blocks(&self, at: &At<'_>) -> BlockSet {
        let read = RefCell::default();
        self.predicted(&at.view().recording(&read));
        read.into_inner()
    }

    fn linearise(&self, at: &At<'_>, update: &mut Update) {
        let n = self.channels;
        let read = RefCell::new(std::mem::take(&mut update.read));
        read.borrow_mut().clear();
        let predicted = self.predicted(&at.view().recording(&read));
        update.read_blocks(at.layout, read.into_inner(), n);
        self.differentiate(at, &update.columns, &update.read, &mut update.h);
        let innovation: [f64; MAX_CHANNELS] = std::array::from_fn(|i| match at.sample.get(i) {
            Some(z) if i < n => self.model.difference(i, z, predicted[i]),
            _ => f64::NAN,
        });
        update.keep_channels(at.sample, &innovation[..n], &self.noise_at(&at.view())[..n * n]);
    }

    fn derivative(&self, at: &At<'_>, block: usize, component: usize, out: &mut [f64]) {
        out.copy_from_slice(&self.slope(at, block, component)[..self.channels]);
    }

    fn differentiate(&self, at: &At<'_>, columns: &[usize], read: &BlockSet, h: &mut [f64]) {
        let axes = |slot: usize| at.layout.blocks[slot].tangent_range().len();
        let axes = read.slots().flat_map(|slot| (0..axes(slot)).map(move |axis| (slot, axis)));
        for (column, (slot, axis)) in axes.enumerate() {
            let slope = self.slope(at, slot, axis);
            (0..self.channels).for_each(|i| h[i * columns.len() + column] = slope[i]);
        }
    }

    fn analytic(&self, _: &At<'_>, _: &[usize], _: &mut [f64]) -> bool {
        false
    }

    fn difference(&self, channel: usize, measured: f64, predicted: f64) -> f64 {
        self.model.difference(channel, measured, predicted)
    }

    fn change(&self, from: &At<'_>, to: &At<'_>, out: &mut [f64]) {
        let (from, to) = (self.predicted(&from.view()), self.predicted(&to.view()));
        let change = |(i, out): (usize, &mut f64)| *out = self.difference(i, to[i], from[i]);
        out.iter_mut().enumerate().for_each(change);
    }

    fn complete(&self, _: &mut Sample) {}

    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        let x = View::new(scene.layout, scene.truth).of_truth().with(sample);
        let (z, r) = (self.predicted(&x), self.noise_at(&x));
        let n = self.channels;
        let noise = scene.draw(DMatrix::from_row_slice(n, n, &r[..n * n]));
        (0..n).for_each(|i| sample.set(i, z[i] + noise[i]));
    }
}
