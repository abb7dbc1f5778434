//! A measurement model at a state of one's choice.

use crate::scenario;
use navfuse_core::compose::Composition;
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::measurement::{AnyMeasurement, At, jacobian_error};
use navfuse_core::model::sensor::motion::{Motion, Trajectory};
use navfuse_core::model::simulate::{Memory, Random, Scene};
use navfuse_core::nalgebra::Vector3;
use navfuse_core::state::State;
use navfuse_core::state::covariance::Update;
use navfuse_core::units::sample::{MAX_CHANNELS, Sample, SensorId};
use navfuse_core::units::time::Time;
use std::sync::Arc;

/// Model of one sensor of a scenario, and the state at which it is evaluated.
pub struct ModelBench {
    /// Composition of the scenario.
    pub composition: Composition,
    /// State, which begins with the scenario's initial values.
    pub state: State,
    /// Model of the sensor.
    pub model: Arc<dyn AnyMeasurement + Sync>,
}

impl ModelBench {
    /// Composes a scenario with a sensor that measures, and sets blocks to coordinates in SI.
    pub fn new(text: &str, settings: &[&str], sensor: &str, blocks: &[(&str, &[f64])]) -> Self {
        let composition =
            scenario(text, settings, |s| s.compose().unwrap_or_else(|e| panic!("{e}")));
        let state = composition.layout.initial_state();
        let id = composition.sensor(sensor).unwrap_or_else(|| panic!("no sensor {sensor}"));
        let Role::Measurement(model) = &composition.sensors[id].role else {
            panic!("{sensor} does not measure");
        };
        let model = Arc::clone(model);
        let mut bench = Self { composition, state, model };
        blocks.iter().for_each(|(name, values)| bench.set(name, values));
        bench
    }

    /// Sets a block to coordinates in SI.
    pub fn set(&mut self, name: &str, values: &[f64]) {
        let block = self.composition.layout.find(name);
        let block = block.unwrap_or_else(|| panic!("no state {name}"));
        (block.operations.from_coordinates)(values, &mut self.state.values[block.range()]);
    }

    /// Place at which the model is evaluated for a sample.
    pub fn at<'a>(&'a self, sample: &'a Sample) -> At<'a> {
        At { layout: &self.composition.layout, state: &self.state, sample }
    }

    /// A sample with values in the first channels, and none in the others.
    pub fn sample(values: &[f64]) -> Sample {
        Sample::new(Time::default(), SensorId(0), values)
    }

    /// Prediction of all channels.
    pub fn predict(&self) -> Vec<f64> {
        let mut h = vec![0.0; self.model.channels()];
        self.model.predict(&self.at(&Self::sample(&[])), &mut h);
        h
    }

    /// Variances of the noise of a sample's channels.
    pub fn variances(&self, sample: &Sample) -> Vec<f64> {
        let mut update = Update::with_capacity(self.composition.layout.tangent, MAX_CHANNELS);
        self.model.linearise(&self.at(sample), &mut update);
        (0..update.m).map(|k| update.r[k * update.m + k]).collect()
    }

    /// Largest difference of the Jacobian from the slope of the prediction.
    pub fn jacobian_error(&self) -> f64 {
        jacobian_error(self.model.as_ref(), &self.at(&Self::sample(&[])))
    }

    /// A simulated sample without noise, whose truth is the state; `from` is the time of the sample
    /// before. The motion between both is unknown.
    pub fn simulate(&self, from: Time, to: Time) -> Sample {
        let mut sample = Sample::new(to, SensorId(0), &[]);
        let mut scene = Scene {
            layout: &self.composition.layout,
            truth: &self.state,
            trajectory: &mut Unknown,
            from,
            to,
            observation: 0,
            noise: 0.0,
            outlier: 0.0,
            random: &mut Random::new(1, "model"),
            memory: &mut Memory::default(),
        };
        self.model.simulate(&mut scene, &mut sample);
        sample
    }
}

/// A motion of which nothing is known.
struct Unknown;

impl Trajectory for Unknown {
    fn at(&mut self, time: Time) -> Motion {
        Motion::unknown(time)
    }

    fn increments(&mut self, _: Time, _: Time) -> (Vector3<f64>, Vector3<f64>) {
        (Vector3::repeat(f64::NAN), Vector3::repeat(f64::NAN))
    }
}
