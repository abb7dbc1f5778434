//! Time-correlated errors of any sensor: a first-order Gauss-Markov state for each channel, by which
//! the prediction of the sensor's own model is shifted.
//! ```text
//! z = h(x) + b + v,    b: Gauss-Markov with mean zero, stationary sigma and correlation time
//! ```
//! The type of the sensor knows nothing of it: this model wraps that of the type.

use crate::compose::Composer;
use crate::document::unknown;
use crate::model::error::ComposeError;
use crate::model::measurement::{AnyMeasurement, At};
use crate::model::roster::Roster;
use crate::model::simulate::Scene;
use crate::state::covariance::Update;
use crate::state::manifold::Scalar;
use crate::state::{BlockSet, BlockSpec, Display, Dynamics, Handle, Layout, Mode};
use crate::units::sample::{Channel, Sample};
use crate::units::{AnyQuantity, Positive, Time as Duration};
use schemars::JsonSchema;
use serde::Deserialize;
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
    let fits = |channel: &Channel| {
        channel.parsed_unit().is_some_and(|unit| error.sigma.si_as(unit.exponents()).is_ok())
    };
    let mut chosen = Vec::new();
    match &error.channels {
        None => chosen.extend((0..measured.len()).filter(|&c| fits(&measured[c]))),
        Some(names) => {
            for name in names {
                let Some(c) = measured.iter().position(|channel| channel.name == name) else {
                    let all: Vec<&str> = measured.iter().map(|channel| channel.name).collect();
                    return fail("channels", unknown("channel", name, &all));
                };
                chosen.push(c);
            }
        }
    }
    if let Some(&wrong) = chosen.iter().find(|&&c| !fits(&measured[c])) {
        let (name, unit) = (measured[wrong].name, measured[wrong].unit);
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
            display: display(measured[c].unit),
        };
        errors.push((c, composer.block(&format!("error_{}", measured[c].name), spec)?));
    }
    Ok(Arc::new(Correlated { inner: model, errors }))
}

/// Presentation of an error of a channel in that unit.
fn display(unit: &str) -> Display {
    let unit = match unit {
        "m" => "m",
        "mps" => "m/s",
        "mps2" => "m/s^2",
        "rad" => "rad",
        "radps" => "rad/s",
        _ => "",
    };
    Display { unit, scale: 1.0, components: &["error"] }
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
}
