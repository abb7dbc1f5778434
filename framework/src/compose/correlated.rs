//! Time-correlated errors of any sensor: a first-order Gauss-Markov state for each channel, by which
//! the prediction of the sensor's own model is shifted.
//! ```text
//! z = h(x) + b + v,    b: Gauss-Markov with mean zero, stationary sigma and correlation time
//! ```
//! The type of the sensor knows nothing of it: this model wraps that of the type.

use crate::compose::Composer;
use crate::document::unknown;
use crate::model::error::ComposeError;
use crate::model::sensor::measurement::{AnyMeasurement, At};
use crate::model::sensor::roster::Roster;
use crate::model::simulate::Scene;
use crate::state::covariance::Update;
use crate::state::manifold::Scalar;
use crate::state::{BlockSet, BlockSpec, Display, Dynamics, Handle, Layout, Mode};
use crate::units::sample::{Channel, Sample};
use crate::units::time::Time;
use crate::units::{AnyQuantity, Duration, Positive};
use schemars::JsonSchema;
use serde::Deserialize;
use std::borrow::Cow;
use std::sync::Arc;

/// Time-correlated error of a sensor's channels.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CorrelatedError {
    /// Stationary 1-sigma, in a unit of the channels.
    pub sigma: AnyQuantity,
    /// Correlation time.
    pub correlation_time: Positive<Duration>,
    /// Channels with such an error. Default: every measured channel of the dimension of `sigma`.
    pub channels: Option<Vec<String>>,
}

/// Wraps a model whose channels have that error, and adds the states of the sensor that is being
/// composed.
///
/// # Errors
/// When a channel is unknown, or `sigma` is not above zero or does not fit a channel.
pub(crate) fn wrap(
    error: &CorrelatedError,
    model: Arc<dyn AnyMeasurement + Sync>,
    channels: &[Channel],
    composer: &mut Composer,
) -> Result<Arc<dyn AnyMeasurement + Sync>, ComposeError> {
    let fail = |key: &str, message: String| {
        Err(ComposeError::new(format!("correlated_error.{key}"), message))
    };
    if error.sigma.si() <= 0.0 {
        return fail("sigma", "a sigma above zero is needed".to_owned());
    }
    let measured = &channels[..model.channels().min(channels.len())];
    let fits = |channel: &Channel| error.sigma.si_as(channel.unit.exponents()).is_ok();
    let mut chosen = Vec::new();
    match &error.channels {
        None => chosen.extend((0..measured.len()).filter(|&c| fits(&measured[c]))),
        Some(names) => {
            for name in names {
                let Some(c) = measured.iter().position(|channel| *channel.name == **name) else {
                    let all: Vec<&str> = measured.iter().map(|channel| &*channel.name).collect();
                    return fail("channels", unknown("channel", name, &all));
                };
                chosen.push(c);
            }
        }
    }
    if let Some(&wrong) = chosen.iter().find(|&&c| !fits(&measured[c])) {
        let (name, unit) = (&measured[wrong].name, measured[wrong].unit.suffix());
        return fail("sigma", format!("it does not fit the channel {name}, which is in {unit}"));
    }
    if chosen.is_empty() {
        return fail("sigma", "no channel of the sensor has this dimension".to_owned());
    }
    chosen.sort_unstable();
    chosen.dedup();
    let mut errors = Vec::with_capacity(chosen.len());
    for c in chosen {
        let sigma = vec![error.sigma.si()];
        let spec = BlockSpec {
            mode: Mode::Estimate,
            initial: vec![0.0],
            sigma: sigma.clone(),
            truth: None,
            dynamics: Dynamics::GaussMarkov { sigma, time: error.correlation_time.value().si() },
            display: display(&measured[c])?,
        };
        errors.push((c, composer.block(&format!("error_{}", measured[c].name), spec)?));
    }
    Ok(Arc::new(Correlated { inner: model, errors }))
}

/// Presentation of an error of a channel.
fn display(channel: &Channel) -> Result<Display, ComposeError> {
    match channel.unit.symbol() {
        Cow::Borrowed(unit) => Ok(Display { unit, scale: 1.0, components: &["error"] }),
        Cow::Owned(unit) => {
            let text = format!("no state can have the unit {unit} of the channel {}", channel.name);
            Err(ComposeError::new("correlated_error.sigma", text))
        }
    }
}

/// A model whose channels have a time-correlated error.
struct Correlated {
    inner: Arc<dyn AnyMeasurement + Sync>,
    /// Channel and state of each error, in order of the channels.
    errors: Vec<(usize, Handle<Scalar>)>,
}

impl Correlated {
    /// Sets the derivative of each channel with respect to its error, which is one.
    fn mark(&self, layout: &Layout, columns: &[usize], h: &mut [f64]) {
        for &(channel, error) in &self.errors {
            let tangent = layout.block(error).tangent;
            if let Some(at) = columns.iter().position(|&c| Some(c) == tangent) {
                h[channel * columns.len() + at] = 1.0;
            }
        }
    }
}

impl AnyMeasurement for Correlated {
    fn admit(&self, at: &At<'_>, roster: &mut Roster<'_>) {
        self.inner.admit(at, roster);
    }

    fn channels(&self) -> usize {
        self.inner.channels()
    }

    fn observations(&self) -> usize {
        self.inner.observations()
    }

    fn keyframe(&self, sample: &Sample) -> bool {
        self.inner.keyframe(sample)
    }

    fn predict(&self, at: &At<'_>, out: &mut [f64]) {
        self.inner.predict(at, out);
        self.errors.iter().for_each(|&(c, error)| out[c] += at.state.get(at.layout, error));
    }

    fn noise(&self, at: &At<'_>, out: &mut [f64]) {
        self.inner.noise(at, out);
    }

    fn blocks(&self, at: &At<'_>) -> BlockSet {
        let own = self.errors.iter().filter(|e| at.layout.block(e.1).tangent.is_some());
        let mut blocks = self.inner.blocks(at);
        blocks.extend(own.map(|(_, error)| error.slot()));
        blocks
    }

    fn linearise(&self, at: &At<'_>, update: &mut Update) {
        self.inner.linearise(at, update);
        // the states of the errors come after all that the sensor's type reads
        let w = update.columns.len();
        let tangents = self.errors.iter().filter_map(|e| at.layout.block(e.1).tangent);
        update.columns.extend(tangents);
        let wide = update.columns.len();
        update.h.truncate(update.m * w);
        update.h.resize(update.m * wide, 0.0);
        for a in (0..update.m).rev() {
            update.h.copy_within(a * w..(a + 1) * w, a * wide);
            update.h[a * wide + w..(a + 1) * wide].fill(0.0);
        }
        let present = (0..self.inner.channels()).filter(|&c| at.sample.get(c).is_some());
        for (a, channel) in present.enumerate().take(update.m) {
            let Some(k) = self.errors.iter().position(|e| e.0 == channel) else { continue };
            update.innovation[a] -= at.state.get(at.layout, self.errors[k].1);
            update.h[a * wide + w + k] = 1.0;
        }
    }

    fn derivative(&self, at: &At<'_>, block: usize, component: usize, out: &mut [f64]) {
        self.inner.derivative(at, block, component, out);
    }

    fn differentiate(&self, at: &At<'_>, columns: &[usize], read: &BlockSet, h: &mut [f64]) {
        self.inner.differentiate(at, columns, read, h);
        self.mark(at.layout, columns, h);
    }

    fn analytic(&self, at: &At<'_>, columns: &[usize], h: &mut [f64]) -> bool {
        let analytic = self.inner.analytic(at, columns, h);
        if analytic {
            self.mark(at.layout, columns, h);
        }
        analytic
    }

    fn difference(&self, channel: usize, measured: f64, predicted: f64) -> f64 {
        self.inner.difference(channel, measured, predicted)
    }

    fn change(&self, from: &At<'_>, to: &At<'_>, out: &mut [f64]) {
        self.inner.change(from, to, out);
        for &(c, error) in &self.errors {
            out[c] += to.state.get(to.layout, error) - from.state.get(from.layout, error);
        }
    }

    fn complete(&self, sample: &mut Sample) {
        self.inner.complete(sample);
    }

    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        self.inner.simulate(scene, sample);
        for &(c, error) in &self.errors {
            if let Some(value) = sample.get(c) {
                sample.set(c, value + scene.truth.get(scene.layout, error));
            }
        }
    }

    fn next_time(&self, scene: &mut Scene<'_>, sample: &Sample) -> Option<Time> {
        self.inner.next_time(scene, sample)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test fails by panicking")]
    use super::*;
    use crate::Real;
    use crate::model::sensor::measurement::{Erased, MeasurementModel};
    use crate::state::manifold::Vector;
    use crate::state::{View, display as units};
    use crate::units::sample::SensorId;
    use crate::units::time::Time;
    use nalgebra::{SMatrix, SVector};

    /// Two products of two states; the difference of the second channel wraps at 10.
    struct Products(Handle<Vector<2>>);

    impl MeasurementModel<2> for Products {
        fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 2> {
            let x = x.get(self.0);
            SVector::from([x[0] * x[1], x[0] * x[0]])
        }
        fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 2, 2> {
            SMatrix::identity()
        }
        fn difference(&self, channel: usize, measured: f64, predicted: f64) -> f64 {
            let difference = measured - predicted;
            if channel == 1 { difference % 10.0 } else { difference }
        }
    }

    /// At the state (3, 2) the products are 6 and 9, with the slopes (2, 3) and (6, 0). The second
    /// channel has the error 0.25.
    #[test]
    fn the_error_adds_to_its_channel_with_a_slope_of_one() {
        let mut composer = Composer::default();
        composer.begin("test");
        let spec = |initial: &[f64]| BlockSpec {
            mode: Mode::Estimate,
            initial: initial.to_vec(),
            sigma: vec![1.0; initial.len()],
            truth: None,
            dynamics: Dynamics::Constant,
            display: units::RATIOS,
        };
        let x = composer.block::<Vector<2>>("x", spec(&[3.0, 2.0])).expect("a block");
        let error = composer.block::<Scalar>("error", spec(&[0.25])).expect("a block");
        let layout = composer.finish().0;
        let state = layout.initial_state();
        let model = Correlated { inner: Arc::new(Erased(Products(x))), errors: vec![(1, error)] };
        assert_eq!((model.difference(0, 25.0, 2.0), model.difference(1, 25.0, 2.0)), (23.0, 3.0));
        let sample = Sample::new(Time::default(), SensorId(0), &[7.0, 11.0]);
        let at = At { layout: &layout, state: &state, sample: &sample };
        let mut z = [0.0; 2];
        model.predict(&at, &mut z);
        assert_eq!(z, [6.0, 9.25]);
        let mut h = [0.0; 6];
        model.differentiate(&at, &[0, 1, 2], &model.blocks(&at), &mut h);
        let slopes = [2.0, 3.0, 0.0, 6.0, 0.0, 1.0];
        assert_eq!(h, slopes);
        let mut update = Update::with_capacity(3, 2);
        model.linearise(&at, &mut update);
        assert_eq!(
            (&update.columns[..], &update.innovation[..]),
            (&[0, 1, 2][..], &[1.0, 1.75][..])
        );
        assert_eq!(update.h, slopes);
        // the second channel alone
        let mut alone = Sample::empty(Time::default(), SensorId(0));
        alone.set(1, 11.0);
        let mut update = Update::with_capacity(3, 2);
        model.linearise(&At { sample: &alone, ..at }, &mut update);
        assert_eq!((&update.h[..], &update.innovation[..]), (&slopes[3..], &[1.75][..]));
        // another state has other products, 20 and 16, and another error
        let mut other = state.clone();
        other.values.copy_from_slice(&[4.0, 5.0, 1.5]);
        let mut change = [0.0; 2];
        model.change(&at, &At { state: &other, ..at }, &mut change);
        assert_eq!(change, [14.0, 8.25]);
    }
}
