//! Code of an outsider: a gauge of a level, a cart without an IMU, with a log and a fix, and a
//! witness that provides the truth.

use navfuse_core::Real;
use navfuse_core::compose::Composer;
use navfuse_core::compose::calibration::{LengthBias, ScaleFactor};
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::process::BuiltProcess;
use navfuse_core::model::process::{Interval, ProcessError, ProcessModel};
use navfuse_core::model::sensor::measurement::MeasurementModel;
use navfuse_core::model::sensor::motion::Motion;
use navfuse_core::model::sensor::{Reference, Role};
use navfuse_core::nalgebra::{Matrix2, SMatrix, SVector, UnitQuaternion, Vector3, convert};
use navfuse_core::plugin::{Plugin, ProcessType, Registry, SensorType};
use navfuse_core::state::covariance::{NoiseSlot, PhiSlot, Transition};
use navfuse_core::state::display;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::state::manifold::Scalar;
use navfuse_core::state::{BlockSpec, Display, Dynamics, Handle, Layout, Mode, State, View};
use navfuse_core::units::sample::{Channel, Sample};
use navfuse_core::units::{Length, Sigma};
use schemars::JsonSchema;
use serde::Deserialize;
use std::sync::Arc;

pub struct Outsider;

impl Plugin for Outsider {
    fn build(&self, registry: &mut Registry) {
        registry.process::<Cart>();
        registry.sensor::<Gauge>();
        registry.sensor::<Log>();
        registry.sensor::<Fix>();
        registry.sensor::<Witness>();
    }
}

const LENGTH: Display = Display { unit: "m", scale: 1.0, components: &["x"] };

/// Measures a level, which is its own state.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Gauge {
    noise: Sigma<Length>,
    level: LengthBias,
}

impl SensorType for Gauge {
    const TYPE: &'static str = "gauge";
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("level", "m")]
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let level = self.level.block(composer, "level", &[0.0], LENGTH)?;
        Ok(Role::measurement(Place { place: level, sigma: self.noise.value().si() }))
    }
}

/// Measures a scalar directly.
struct Place {
    place: Handle<Scalar>,
    sigma: f64,
}

impl MeasurementModel<1> for Place {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        SVector::from([x.get(self.place)])
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        SMatrix::from([[self.sigma * self.sigma]])
    }
}

/// Place and speed along a line with white acceleration; the cart begins at 0 m at 0 s and keeps
/// its speed.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Cart {}

pub const PLACE_SIGMA: f64 = 2.0;
pub const SPEED_SIGMA: f64 = 0.4;

/// Process noise of white acceleration of 0.09 m^2/s^3 over `dt` (Groves eq. 3.44).
pub fn white_acceleration(dt: f64) -> Matrix2<f64> {
    Matrix2::new(dt.powi(3) / 3.0, dt * dt / 2.0, dt * dt / 2.0, dt) * 0.09
}

impl ProcessType for Cart {
    const TYPE: &'static str = "cart";
    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        let spec = |sigma: f64, display: Display| BlockSpec {
            mode: Mode::Estimate,
            initial: vec![0.0],
            sigma: vec![sigma],
            truth: None,
            dynamics: Dynamics::Constant,
            display,
        };
        let place = composer.block("place", spec(PLACE_SIGMA, LENGTH))?;
        let speed =
            composer.block("speed", spec(SPEED_SIGMA, Display { unit: "m/s", ..LENGTH }))?;
        let (p, v) = (composer.tangent(place), composer.tangent(speed));
        let t = composer.transition();
        // speed follows place in the state: their correlated noise is one block
        let (p_p, p_v, q) = (t.phi(p, p), t.phi(p, v), t.noise(p));
        Ok(BuiltProcess::new(CartModel { place, speed, p_p, p_v, q }))
    }
}

#[derive(Clone)]
struct CartModel {
    place: Handle<Scalar>,
    speed: Handle<Scalar>,
    p_p: PhiSlot<1, 1>,
    p_v: PhiSlot<1, 1>,
    q: NoiseSlot<2>,
}

impl ProcessModel for CartModel {
    fn propagate(
        &mut self,
        layout: &Layout,
        state: &mut State,
        interval: &Interval<'_>,
        transition: &mut Transition,
    ) -> Result<(), ProcessError> {
        let dt = interval.duration();
        let place = state.get(layout, self.place) + state.get(layout, self.speed) * dt;
        state.set(layout, self.place, &place);
        transition.set(self.p_p, &SMatrix::from([[1.0]]));
        transition.set(self.p_v, &SMatrix::from([[dt]]));
        transition.set_noise(self.q, &white_acceleration(dt));
        Ok(())
    }

    fn follow(&self, layout: &Layout, motion: &Motion, state: &mut State, known: &mut [bool]) {
        let speed = motion.velocity.x;
        state.set(layout, self.place, &(speed * motion.time.seconds()));
        state.set(layout, self.speed, &speed);
        for slot in [self.place.slot(), self.speed.slot()] {
            known[slot] = true;
        }
    }

    fn boxed_clone(&self) -> Box<dyn ProcessModel> {
        Box::new(self.clone())
    }
}

/// Measures `k v + b` and `p + b / 2`.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Log {
    scale: ScaleFactor,
    bias: LengthBias,
}

/// Noise covariance of the log, row-major.
pub const LOG_NOISE: [f64; 4] = [0.04, 0.03, 0.03, 0.09];

impl SensorType for Log {
    const TYPE: &'static str = "log";
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("speed", "mps"), Channel::new("place", "m")]
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        Ok(Role::measurement(LogModel {
            place: composer.find("place", "cart.place")?,
            speed: composer.find("speed", "cart.speed")?,
            scale: self.scale.block(composer, "scale", &[1.0], display::RATIO)?,
            bias: self.bias.block(composer, "bias", &[0.0], LENGTH)?,
        }))
    }
}

struct LogModel {
    place: Handle<Scalar>,
    speed: Handle<Scalar>,
    scale: Handle<Scalar>,
    bias: Handle<Scalar>,
}

impl MeasurementModel<2> for LogModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 2> {
        let bias = x.get(self.bias);
        SVector::from([
            x.get(self.scale) * x.get(self.speed) + bias,
            x.get(self.place) + bias * convert(0.5),
        ])
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 2, 2> {
        SMatrix::from_row_slice(&LOG_NOISE)
    }
}

/// Measures the cart's place.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Fix {
    noise: Sigma<Length>,
}

impl SensorType for Fix {
    const TYPE: &'static str = "fix";
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("place", "m")]
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let place = composer.find("place", "cart.place")?;
        Ok(Role::measurement(Place { place, sigma: self.noise.value().si() }))
    }
}

/// Provides the speed along north; its samples set the epochs of the truth.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Witness {}

impl SensorType for Witness {
    const TYPE: &'static str = "witness";
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("speed", "mps")]
    }
    fn build(self, _: &mut Composer) -> Result<Role, ComposeError> {
        Ok(Role::Reference(Arc::new(WitnessModel)))
    }
}

struct WitnessModel;

impl Reference for WitnessModel {
    fn motion(&self, _: &Layout, _: &State, sample: &Sample) -> Option<Motion> {
        Some(Motion {
            time: sample.time,
            position: Geodetic { latitude: 0.0, longitude: 0.0, height: 0.0 },
            velocity: Vector3::new(sample.get(0)?, 0.0, 0.0),
            c_b_n: UnitQuaternion::identity(),
            w_ib_b: Vector3::zeros(),
            f_ib_b: Vector3::zeros(),
        })
    }
    fn sample(&self, motion: &Motion, sample: &mut Sample) {
        sample.set(0, motion.velocity.x);
    }
}
