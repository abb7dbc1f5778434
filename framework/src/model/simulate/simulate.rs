//! Simulation of sensors: the scene, simulators of driving sensors, and faults of all sensors.

use crate::checkpoint::fnv1a;
use crate::model::sensor::measurement::MeasurementModel;
use crate::model::sensor::motion::Trajectory;
use crate::model::simulate::fault::Fault;
use crate::state::{Layout, State, View};
use crate::units::sample::{MAX_CHANNELS, Sample};
use crate::units::time::Time;
use crate::units::{Duration, Frequency, Positive, Ratio, Sigma};
use nalgebra::allocator::Allocator;
use nalgebra::{DefaultAllocator, Dim, OMatrix};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_xoshiro::Xoshiro256PlusPlus;
use schemars::JsonSchema;
use serde::Deserialize;
use std::any::Any;

/// Random numbers that are the same on every machine and for any number of threads.
#[derive(Clone, Debug)]
pub struct Random(Xoshiro256PlusPlus);

impl Random {
    /// Stream of a seed for one purpose: an additional sensor does not change the draws of another.
    pub fn new(seed: u64, purpose: &str) -> Self {
        // FNV-1a, since the standard hasher may change with the compiler
        let hash = fnv1a(purpose.as_bytes());
        Self(Xoshiro256PlusPlus::seed_from_u64(seed ^ hash.rotate_left(17)))
    }

    /// A draw from N(0, 1).
    pub fn normal(&mut self) -> f64 {
        self.0.sample(StandardNormal)
    }

    /// A draw from [0, 1).
    pub fn uniform(&mut self) -> f64 {
        self.0.random()
    }
}

/// Inputs of a simulated sensor.
pub struct Scene<'a> {
    /// The blocks.
    pub layout: &'a Layout,
    /// Every block at its truth.
    pub truth: &'a State,
    /// The motion.
    pub trajectory: &'a mut dyn Trajectory,
    /// Time of the sensor's previous sample, at which an integrating sensor begins.
    pub from: Time,
    /// The time of the sample.
    pub to: Time,
    /// Number of the observation of this time, from 0 on: see [`MeasurementModel::observations`].
    pub observation: usize,
    /// Simulated noise as a multiple of the model's.
    pub noise: f64,
    /// Size of the outlier in this sample, in sigma; zero for a good sample.
    pub outlier: f64,
    /// The sensor's own random numbers.
    pub random: &'a mut Random,
    /// What the simulated instrument remembers: see [`Scene::recall`].
    pub memory: &'a mut Memory,
}

/// What a simulated instrument remembers from sample to sample; empty at the start of a run.
#[derive(Debug, Default)]
pub struct Memory(Option<Box<dyn Any + Send>>);

impl Scene<'_> {
    /// What the simulated instrument remembered last ([`Self::remember`]), and the default at the
    /// start: the output of a filter inside of the instrument, the time of a ping.
    ///
    /// ```
    /// use navfuse_core::prelude::*;
    /// /// Smooths the readings of a sluggish instrument, of which each step adds a share.
    /// fn smoothed(scene: &mut Scene<'_>, reading: f64, share: f64) -> f64 {
    ///     let before = scene.recall::<Option<f64>>().unwrap_or(reading);
    ///     let output = before + share * (reading - before);
    ///     scene.remember(Some(output));
    ///     output
    /// }
    /// ```
    pub fn recall<M: Clone + Default + Send + 'static>(&self) -> M {
        self.memory.0.as_ref().and_then(|m| m.downcast_ref()).cloned().unwrap_or_default()
    }

    /// Remembers a value, in the place of the one before it.
    pub fn remember<M: Clone + Default + Send + 'static>(&mut self, value: M) {
        self.memory.0 = Some(Box::new(value));
    }

    /// Sets the `N` channels of a sample to the prediction from the truth and noise of `R`.
    pub fn measure<M: MeasurementModel<N> + ?Sized, const N: usize>(
        &mut self,
        model: &M,
        sample: &mut Sample,
    ) {
        let x = View::new(self.layout, self.truth).of_truth().with(sample);
        let (predicted, noise) = (model.predict(&x), model.noise(&x));
        let noise = self.draw(noise);
        (0..N).for_each(|i| sample.set(i, predicted[i] + noise[i]));
    }

    /// Draws the noise of channels with that covariance.
    pub(crate) fn draw<D: Dim>(&mut self, covariance: OMatrix<f64, D, D>) -> [f64; MAX_CHANNELS]
    where
        DefaultAllocator: Allocator<D, D>,
    {
        let n = covariance.nrows();
        // some channels may have a noise of zero, which has no Cholesky factor
        let factor = match covariance.clone().cholesky() {
            Some(c) => c.l(),
            None => covariance.map(|v| v.max(0.0).sqrt()),
        };
        let mut draw = [0.0; MAX_CHANNELS];
        for d in &mut draw[..n] {
            *d = self.random.normal() * self.noise;
            if self.outlier > 0.0 {
                *d += self.outlier * if self.random.uniform() < 0.5 { -1.0 } else { 1.0 };
            }
        }
        let noise = |i| (0..n).map(|j| factor[(i, j)] * draw[j]).sum();
        std::array::from_fn(|i| if i < n { noise(i) } else { 0.0 })
    }
}

/// Simulates a driving sensor.
///
/// ```
/// use navfuse_core::prelude::*;
/// use navfuse_core::model::simulate::Simulate;
/// /// The mean angular rate over the interval, with white noise (rad/s/sqrt(Hz)).
/// #[derive(Clone)]
/// struct Gyros {
///     noise: f64,
/// }
/// impl Simulate for Gyros {
///     fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
///         let dt = scene.to.since(scene.from);
///         let (angle, _) = scene.trajectory.increments(scene.from, scene.to);
///         for axis in 0..3 {
///             let noise = self.noise / dt.sqrt() * scene.noise * scene.random.normal();
///             sample.set(axis, angle[axis] / dt + noise);
///         }
///     }
///     fn boxed_clone(&self) -> Box<dyn Simulate> {
///         Box::new(self.clone())
///     }
/// }
/// ```
pub trait Simulate: Send + Sync {
    /// Fills the sample's channels.
    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample);
    /// Copies the simulator.
    fn boxed_clone(&self) -> Box<dyn Simulate>;
}

/// Rate and faults of a simulated sensor.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Faults {
    /// Samples per second.
    pub rate: Positive<Frequency>,
    /// Time of the first sample.
    #[serde(default = "zero_time")]
    pub offset: Duration,
    /// Simulated noise as a multiple of the model's: 2 makes the sensor twice as noisy as the
    /// filter assumes.
    #[serde(default = "one")]
    pub noise: Sigma<Ratio>,
    /// Probability that a sample is lost.
    #[serde(default = "zero")]
    pub dropout: Sigma<Ratio>,
    /// Spans of time without samples, each `["700 s", "760 s"]`.
    #[serde(default)]
    pub outages: Vec<[Duration; 2]>,
    /// Probability that a sample is an outlier.
    #[serde(default = "zero")]
    pub outliers: Sigma<Ratio>,
    /// Size of an outlier as a multiple of the model's sigma.
    #[serde(default = "twenty")]
    pub outlier_size: Sigma<Ratio>,
    /// Faults of the instrument, each with its type and span of time, such as
    /// `{ type = "stuck", from = "250 s", to = "310 s" }`; applied in their order.
    #[serde(default)]
    pub faults: Vec<Fault>,
}

fn zero_time() -> Duration {
    Duration::from_si(0.0)
}
fn zero() -> Sigma<Ratio> {
    Sigma::from_si(0.0)
}
fn one() -> Sigma<Ratio> {
    Sigma::from_si(1.0)
}
fn twenty() -> Sigma<Ratio> {
    Sigma::from_si(20.0)
}

/// The sensor that drives a process model.
pub struct DrivingSensor {
    /// Name in the scenario.
    pub name: String,
    /// Simulator.
    pub simulator: Box<dyn Simulate>,
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::Real;
    use crate::model::sensor::motion::Motion;
    use crate::units::sample::SensorId;
    use nalgebra::{SMatrix, SVector, Vector3};

    /// Two channels with correlated noise.
    struct Pair;

    impl MeasurementModel<2> for Pair {
        fn predict<T: Real>(&self, _: &View<'_, T>) -> SVector<T, 2> {
            SVector::from([nalgebra::convert(10.0), nalgebra::convert(-20.0)])
        }
        fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 2, 2> {
            SMatrix::<f64, 2, 2>::new(4.0, 3.0, 3.0, 9.0)
        }
    }

    struct Nowhere;

    impl Trajectory for Nowhere {
        fn at(&mut self, _: Time) -> Motion {
            unreachable!("the model reads no motion")
        }
        fn increments(&mut self, _: Time, _: Time) -> (Vector3<f64>, Vector3<f64>) {
            unreachable!("the model reads no motion")
        }
    }

    /// Deviations of many samples from the prediction, in which the noise is white with unit
    /// variance: the lower Cholesky factor of the noise is (2, 0; 1.5, sqrt(6.75)).
    fn whitened(noise: f64, outlier: f64) -> Vec<[f64; 2]> {
        let (layout, mut random) = (Layout::default(), Random::new(1, "pair"));
        let truth = layout.initial_state();
        let draw = |_| {
            let mut scene = Scene {
                layout: &layout,
                truth: &truth,
                trajectory: &mut Nowhere,
                from: Time::default(),
                to: Time::default(),
                observation: 0,
                noise,
                outlier,
                random: &mut random,
                memory: &mut Memory::default(),
            };
            let mut sample = Sample::empty(Time::default(), SensorId(0));
            scene.measure(&Pair, &mut sample);
            let [x, y] = [sample.values()[0] - 10.0, sample.values()[1] + 20.0];
            [0.5 * x, (y - 0.75 * x) / 6.75_f64.sqrt()]
        };
        (0..4000).map(draw).collect()
    }

    fn mean(values: &[[f64; 2]], of: impl Fn(&[f64; 2]) -> f64) -> f64 {
        values.iter().map(of).sum::<f64>() / values.len() as f64
    }

    /// The mean of 4000 products with the variance 1 has the sigma 0.016, that of squares 0.022.
    #[test]
    fn simulated_noise_has_the_covariance_of_the_model() {
        for noise in [1.0, 3.0] {
            let drawn = whitened(noise, 0.0);
            for k in 0..2 {
                let variance = mean(&drawn, |u| u[k] * u[k]) / (noise * noise);
                assert!((variance - 1.0).abs() < 0.09, "{k}: {variance}");
                assert!(mean(&drawn, |u| u[k]).abs() < 0.064 * noise);
            }
            assert!(mean(&drawn, |u| u[0] * u[1]).abs() < 0.064 * noise * noise);
        }
    }

    /// An outlier of 30 sigma lies 30 above or below, each in half of the samples, whose number has
    /// the sigma of 32 of 4000.
    #[test]
    fn outliers_lie_their_size_to_either_side() {
        let drawn = whitened(1.0, 30.0);
        for k in 0..2 {
            assert!(drawn.iter().all(|u| (u[k].abs() - 30.0).abs() < 6.0));
            let above = drawn.iter().filter(|u| u[k] > 0.0).count();
            assert!(above.abs_diff(2000) < 130, "{above}");
        }
    }
}
