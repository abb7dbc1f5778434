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

    /// Computes `h(x)` at several states, the channels of one state after those of another. The
    /// derivatives come from it: there are then more than two states, and the last one is amid the
    /// others. Default: one state after the other. A model that is called from afar, as one in a
    /// script, needs one call for all of them.
    fn predict_all(&self, states: &[View<'_, f64>], z: &mut [f64]) {
        let n = z.len() / states.len().max(1);
        states.iter().zip(z.chunks_mut(n.max(1))).for_each(|(x, z)| self.predict(x, z));
    }

    /// Reads the states that [`Self::predict`] reads, so that the framework knows them; nobody reads
    /// `z` after it. Default: it predicts.
    fn read(&self, x: &View<'_, f64>, z: &mut [f64]) {
        self.predict(x, z);
    }

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

    /// Records the blocks that the prediction reads.
    fn read(&self, at: &At<'_>, read: &RefCell<BlockSet>) {
        let mut unused = [0.0; MAX_CHANNELS];
        self.model.read(&at.view().recording(read), &mut unused[..self.channels]);
    }

    fn noise_at(&self, x: &View<'_, f64>) -> [f64; MAX_CHANNELS * MAX_CHANNELS] {
        let mut r = [0.0; MAX_CHANNELS * MAX_CHANNELS];
        self.model.noise(x, &mut r[..self.channels * self.channels]);
        r
    }

    /// The prediction, and its derivatives along axes, each a block and a component of its tangent:
    /// the channels of one axis after those of another.
    fn expand(&self, at: &At<'_>, axes: &[(usize, usize)]) -> (Vec<f64>, Vec<f64>) {
        let n = self.channels;
        let moved = |&(slot, axis): &(usize, usize)| {
            let step = difference_step(at, slot);
            [step, -step].map(|step| {
                let mut delta = [0.0; MAX_TANGENT];
                delta[axis] = step;
                View::seeded(at.layout, at.state, slot, delta).with(at.sample)
            })
        };
        let states: Vec<View<'_, f64>> =
            axes.iter().flat_map(moved).chain(std::iter::once(at.view())).collect();
        let mut z = vec![0.0; n * states.len()];
        self.model.predict_all(&states, &mut z);
        let predicted = z.split_off(2 * n * axes.len());
        let pairs = axes.iter().zip(z.chunks_exact((2 * n).max(1)));
        let slope = |((slot, _), pair): (&(usize, usize), &[f64])| {
            let (ahead, behind) = pair.split_at(n);
            let step = difference_step(at, *slot);
            let difference = |i| self.model.difference(i, ahead[i], behind[i]) / (2.0 * step);
            (0..n).map(difference).collect::<Vec<f64>>()
        };
        let slopes = pairs.flat_map(slope).collect();
        (predicted, slopes)
    }

    /// The prediction; the rows of `h`, each of `columns` numbers, become its derivatives by the
    /// tangents of the blocks that are read.
    fn expand_all(&self, at: &At<'_>, columns: usize, read: &BlockSet, h: &mut [f64]) -> Vec<f64> {
        let width = |slot: usize| at.layout.blocks[slot].tangent_range().len();
        let axes = read.slots().flat_map(|slot| (0..width(slot)).map(move |axis| (slot, axis)));
        let (predicted, slopes) = self.expand(at, &axes.collect::<Vec<_>>());
        for (column, slope) in slopes.chunks_exact(self.channels.max(1)).enumerate() {
            slope.iter().enumerate().for_each(|(i, h_i)| h[i * columns + column] = *h_i);
        }
        predicted
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
        self.read(at, &read);
        read.into_inner()
    }

    fn linearise(&self, at: &At<'_>, update: &mut Update) {
        let n = self.channels;
        let read = RefCell::new(std::mem::take(&mut update.read));
        read.borrow_mut().clear();
        self.read(at, &read);
        update.read_blocks(at.layout, read.into_inner(), n);
        let predicted = self.expand_all(at, update.columns.len(), &update.read, &mut update.h);
        let innovation: [f64; MAX_CHANNELS] = std::array::from_fn(|i| match at.sample.get(i) {
            Some(z) if i < n => self.model.difference(i, z, predicted[i]),
            _ => f64::NAN,
        });
        update.keep_channels(at.sample, &innovation[..n], &self.noise_at(&at.view())[..n * n]);
    }

    fn derivative(&self, at: &At<'_>, block: usize, component: usize, out: &mut [f64]) {
        out.copy_from_slice(&self.expand(at, &[(block, component)]).1);
    }

    fn differentiate(&self, at: &At<'_>, columns: &[usize], read: &BlockSet, h: &mut [f64]) {
        self.expand_all(at, columns.len(), read, h);
    }

    fn analytic(&self, _: &At<'_>, _: &[usize], _: &mut [f64]) -> bool {
        false
    }

    fn difference(&self, channel: usize, measured: f64, predicted: f64) -> f64 {
        self.model.difference(channel, measured, predicted)
    }

    fn change(&self, from: &At<'_>, to: &At<'_>, out: &mut [f64]) {
        let (n, mut z) = (self.channels, [0.0; 2 * MAX_CHANNELS]);
        self.model.predict_all(&[from.view(), to.view()], &mut z[..2 * n]);
        let change = |(i, out): (usize, &mut f64)| *out = self.difference(i, z[n + i], z[i]);
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
