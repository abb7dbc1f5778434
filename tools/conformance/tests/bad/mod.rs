//! A sensor and a process with a fault that the scenario names.

pub mod spinner;
pub mod streams;

use navfuse_core::Real;
use navfuse_core::checkpoint::Io;
use navfuse_core::compose::Composer;
use navfuse_core::compose::calibration::LengthBias;
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::process::BuiltProcess;
use navfuse_core::model::process::{Interval, ProcessError, ProcessModel};
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::measurement::{AnyMeasurement, At, Jacobian, MeasurementModel};
use navfuse_core::model::sensor::motion::Motion;
use navfuse_core::model::simulate::Scene;
use navfuse_core::nalgebra::{SMatrix, SVector, Vector2, Vector3, convert};
use navfuse_core::plugin::{Plugin, ProcessType, Registry, SensorType};
use navfuse_core::state::covariance::{NoiseSlot, PhiSlot, Transition, Update};
use navfuse_core::state::display;
use navfuse_core::state::manifold::Scalar;
use navfuse_core::state::{
    BlockSet, BlockSpec, Display, Dynamics, Handle, Layout, Mode, State, View,
};
use navfuse_core::units::sample::{Channel, Sample};
use navfuse_core::units::{Length, Sigma};
use navfuse_ins::Navigation;
use schemars::JsonSchema;
use serde::Deserialize;
use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

pub struct BadPlugin;

impl Plugin for BadPlugin {
    fn build(&self, registry: &mut Registry) {
        registry.sensor::<Bad>();
        registry.sensor::<Fix>();
        registry.process::<Cart>();
    }
}

/// Two depths with one bias.
#[derive(Deserialize, JsonSchema)]
pub struct Bad {
    /// 1-sigma noise.
    pub noise: Sigma<Length>,
    /// Bias.
    pub bias: LengthBias,
    /// Name of the fault.
    pub fault: String,
}

impl SensorType for Bad {
    const TYPE: &'static str = "bad";
    fn channels(&self) -> Vec<Channel> {
        let first = if self.fault == "name" { "Depth one" } else { "one" };
        let unit = match self.fault.as_str() {
            "furlongs" => "furlong",
            "kilometres" => "km",
            "degrees" => "rad",
            _ => "m",
        };
        let mut channels = vec![Channel::new(first, "m"), Channel::new("two", unit)];
        if self.fault == "spare" {
            channels.push(Channel::new("three", "m"));
        }
        channels
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let navigation = Navigation::find(composer, "navigation", "ins")?;
        let unit = if self.fault == "centimetres" { "cm" } else { "m" };
        let shown = Display { unit, ..display::LENGTH };
        let bias = self.bias.block(composer, "bias", &[0.0], shown)?;
        let mut sigma = self.noise.value().si();
        match self.fault.as_str() {
            "linear" => sigma = sigma.sqrt(),
            "floor" => sigma = sigma.hypot(0.1),
            _ => {}
        }
        let model =
            BadModel { navigation, bias, sigma, fault: self.fault, asked: AtomicU32::new(0) };
        if model.fault == "rows" || model.fault == "none of them" {
            return Ok(Role::Measurement(Arc::new(Stubborn(model))));
        }
        if model.fault == "spare" {
            return Ok(Role::measurement(Spare(model)));
        }
        Ok(Role::measurement(model))
    }
}

/// A model with a third channel, for an instrument that the scenario does not have.
struct Spare(BadModel);

impl MeasurementModel<3> for Spare {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        let z = self.0.predict(x);
        SVector::from([z[0], z[1], convert(f64::NAN)])
    }
    fn noise(&self, x: &View<'_, f64>) -> SMatrix<f64, 3, 3> {
        let r = self.0.noise(x);
        SMatrix::from_diagonal(&SVector::from([r[(0, 0)], r[(1, 1)], 1.0]))
    }
    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        self.0.simulate(scene, sample);
    }
}

pub struct BadModel {
    navigation: Navigation,
    bias: Handle<Scalar>,
    sigma: f64,
    fault: String,
    asked: AtomicU32,
}

static SAMPLES: AtomicU32 = AtomicU32::new(0);

impl MeasurementModel<2> for BadModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 2> {
        let height = x.get(self.navigation.position).height;
        if self.fault == "branch" && height > T::zero() {
            return Vector2::new(-height, -height);
        }
        if self.fault == "ramp" {
            // without a jump where the bias begins to count
            let above = if height > T::zero() { height * x.get(self.bias) } else { T::zero() };
            return Vector2::repeat(above - height);
        }
        if self.fault == "far" {
            // the range to a mark 90 m away that is out of its place by the bias
            let here = x.get(self.navigation.position);
            let away = [60.0, 60.0, 30.0].map(convert::<f64, T>);
            let mark = here.displaced(&(Vector3::from(away) + Vector3::repeat(x.get(self.bias))));
            return Vector2::repeat((mark.earth_fixed() - here.earth_fixed()).norm() - height);
        }
        let mut z = Vector2::repeat(-height + x.get(self.bias));
        match self.fault.as_str() {
            "needs" => {
                z[1] += convert::<f64, T>(if x.channel(0).is_none() && x.channel(1).is_some() {
                    f64::NAN
                } else {
                    0.0
                })
            }
            "blind" => z[1] = convert(7.0),
            "degrees" => z[1] += convert(30.0),
            "memory" => {
                z[1] +=
                    convert::<f64, T>(1e-6 * f64::from(self.asked.fetch_add(1, Ordering::Relaxed)))
            }
            _ => {}
        }
        z
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 2, 2> {
        let [a, b, c] = match self.fault.as_str() {
            "correlation" => [1.0, 2.0, 2.0],
            "asymmetric" => [1.0, 0.5, 0.0],
            "negative" => [-1.0, 0.0, 0.0],
            _ => [1.0, 0.0, 0.0],
        };
        SMatrix::<f64, 2, 2>::new(a, b, c, 1.0) * self.sigma * self.sigma
    }

    fn jacobian(&self, _: &View<'_, f64>, h: &mut Jacobian<'_, 2>) -> bool {
        h.set(self.navigation.position, &SMatrix::<f64, 2, 3>::new(0.0, 0.0, 1.0, 0.0, 0.0, 1.0));
        h.set(self.bias, &Vector2::new(0.5, 1.0));
        self.fault == "jacobian"
    }

    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        let fault = self.fault.as_str();
        if fault == "noisy" {
            scene.noise *= 2.0;
        }
        scene.measure(self, sample);
        let two = sample.get(1).unwrap_or(f64::NAN);
        match fault {
            "nan" => sample.set(1, f64::NAN),
            "beyond" => sample.set(5, 1.0),
            "unset" => sample.clear(1),
            "static" => {
                sample.set(1, two + 1e-9 * f64::from(SAMPLES.fetch_add(1, Ordering::Relaxed)))
            }
            "offset" => (0..2).for_each(|i| sample.set(i, sample.get(i).unwrap_or(f64::NAN) + 1.0)),
            _ => {}
        }
    }
}

/// A model that ignores which channels are missing, or declares no channels.
struct Stubborn(BadModel);

impl AnyMeasurement for Stubborn {
    fn channels(&self) -> usize {
        if self.0.fault == "rows" { 2 } else { 0 }
    }
    fn predict(&self, at: &At<'_>, out: &mut [f64]) {
        let z = self.0.predict(&View::new(at.layout, at.state));
        out.iter_mut().zip(z.iter()).for_each(|(out, z)| *out = *z);
    }
    fn noise(&self, at: &At<'_>, out: &mut [f64]) {
        let r = self.0.noise(&View::new(at.layout, at.state));
        out.iter_mut().zip(r.iter()).for_each(|(out, r)| *out = *r);
    }
    fn blocks(&self, at: &At<'_>) -> BlockSet {
        let read = RefCell::default();
        self.0.predict(&View::new(at.layout, at.state).recording(&read));
        read.into_inner()
    }
    fn linearise(&self, at: &At<'_>, update: &mut Update) {
        let mut z = [0.0; 2];
        AnyMeasurement::predict(self, at, &mut z);
        update.columns = self
            .blocks(at)
            .slots()
            .flat_map(|slot| at.layout.blocks[slot].tangent_range())
            .collect();
        update.h = [0.0, 0.0, 1.0, 1.0].repeat(2);
        update.innovation = (0..2).map(|i| at.sample.get(i).unwrap_or(z[i]) - z[i]).collect();
        update.r = vec![1.0, 0.0, 0.0, 1.0];
        update.m = 2;
    }
    fn derivative(&self, _: &At<'_>, _: usize, _: usize, _: &mut [f64]) {}

    fn differentiate(&self, _: &At<'_>, _: &[usize], _: &BlockSet, _: &mut [f64]) {}
    fn analytic(&self, _: &At<'_>, _: &[usize], _: &mut [f64]) -> bool {
        true
    }
    fn difference(&self, _: usize, measured: f64, predicted: f64) -> f64 {
        measured - predicted
    }
    fn change(&self, _: &At<'_>, _: &At<'_>, _: &mut [f64]) {}
    fn complete(&self, _: &mut Sample) {}
    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        scene.measure(&self.0, sample);
    }
}

/// A cart on a line at a steady speed, without any driving sensor.
#[derive(Deserialize, JsonSchema)]
pub struct Cart {
    /// Name of the fault.
    pub fault: String,
}

impl ProcessType for Cart {
    const TYPE: &'static str = "cart";
    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        let spec = |unit| BlockSpec {
            mode: Mode::Estimate,
            initial: vec![0.0],
            sigma: vec![0.1],
            truth: None,
            dynamics: Dynamics::Constant,
            display: Display { unit, scale: 1.0, components: &["x"] },
        };
        let place = composer.block("place", spec("m"))?;
        let speed = composer.block("speed", spec("m/s"))?;
        let (p, v) = (composer.tangent(place), composer.tangent(speed));
        // a clock that runs away, which no motion of a vehicle gives
        let clock =
            (self.fault == "clock").then(|| composer.block("clock", spec("s"))).transpose()?;
        let c = clock.and_then(|clock| composer.tangent(clock));
        if self.fault == "constraint" {
            composer.constraint("rails", [Channel::new("place", "m")], RailModel { place });
        }
        let undeclared = self.fault == "undeclared";
        let t = composer.transition();
        let (p_p, p_v) = (t.phi(p, p), t.phi(p, if undeclared { None } else { v }));
        let (v_v, c_c, q) = (t.phi(v, v), t.phi(c, c), t.noise(p));
        let fault = self.fault;
        let model = CartModel { place, speed, clock, p_p, p_v, v_v, c_c, q, fault, steps: 0 };
        Ok(BuiltProcess::new(model))
    }
}

#[derive(Clone)]
struct CartModel {
    place: Handle<Scalar>,
    speed: Handle<Scalar>,
    clock: Option<Handle<Scalar>>,
    p_p: PhiSlot<1, 1>,
    p_v: PhiSlot<1, 1>,
    v_v: PhiSlot<1, 1>,
    c_c: PhiSlot<1, 1>,
    q: NoiseSlot<2>,
    fault: String,
    steps: u32,
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
        self.steps += 1;
        let drift = if matches!(&*self.fault, "forgets" | "unsaved") {
            1e-9 * f64::from(self.steps)
        } else {
            0.0
        };
        let place = state.get(layout, self.place) + state.get(layout, self.speed) * dt + drift;
        state.set(layout, self.place, &place);
        let one = SMatrix::from([[1.0]]);
        transition.set(self.p_p, &one);
        transition.set(self.p_v, &(one * if self.fault == "phi" { -dt } else { dt }));
        transition.set(self.v_v, &one);
        transition.set(self.c_c, &one);
        if let Some(clock) = self.clock {
            let time = state.get(layout, clock) + dt;
            state.set(layout, clock, &time);
        }
        let sign = if self.fault == "q" { -1e-6 } else { 1.0 };
        // white acceleration of 1e-4 m^2/s^3
        let q =
            SMatrix::<f64, 2, 2>::new(dt * dt * dt / 3.0, dt * dt / 2.0, dt * dt / 2.0, sign * dt);
        transition.set_noise(self.q, &(q * 1e-4));
        Ok(())
    }
    fn follow(&self, layout: &Layout, motion: &Motion, state: &mut State, known: &mut [bool]) {
        state.set(layout, self.place, &motion.position.height);
        state.set(layout, self.speed, &-motion.velocity.z);
        known[self.place.slot()] = true;
        known[self.speed.slot()] = true;
    }
    fn memory(&mut self, io: &mut Io<'_>) {
        if self.fault != "unsaved" {
            io.pass(&mut self.steps);
        }
    }
    fn boxed_clone(&self) -> Box<dyn ProcessModel> {
        let steps = if self.fault == "forgets" { 0 } else { self.steps };
        Box::new(Self { steps, ..self.clone() })
    }
}

/// A constraint of the cart, which a run never applies.
struct RailModel {
    place: Handle<Scalar>,
}

impl MeasurementModel<1> for RailModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        SVector::from([x.get(self.place)])
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        SMatrix::from_element(1.0)
    }
}

/// The place of the cart.
#[derive(Deserialize, JsonSchema)]
pub struct Fix {
    /// 1-sigma noise.
    pub noise: Sigma<Length>,
}

impl SensorType for Fix {
    const TYPE: &'static str = "fix";
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("place", "m")]
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        Ok(Role::measurement(FixModel {
            place: composer.find("place", "cart.place")?,
            sigma: self.noise.value().si(),
        }))
    }
}

struct FixModel {
    place: Handle<Scalar>,
    sigma: f64,
}

impl MeasurementModel<1> for FixModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        SVector::from([x.get(self.place)])
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        SMatrix::from_element(self.sigma * self.sigma)
    }
}

/// A height whose noise is a number without a unit.
#[derive(Deserialize, JsonSchema)]
pub struct Bare {
    /// 1-sigma noise.
    pub noise: f64,
}

/// A height whose noise has no documentation.
#[derive(Deserialize, JsonSchema)]
pub struct Undocumented {
    pub noise: Sigma<Length>,
}

fn height(composer: &mut Composer, sigma: f64) -> Result<Role, ComposeError> {
    let navigation = Navigation::find(composer, "navigation", "ins")?;
    Ok(Role::measurement(HeightModel { navigation, sigma }))
}

struct HeightModel {
    navigation: Navigation,
    sigma: f64,
}

impl MeasurementModel<1> for HeightModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        SVector::from([x.get(self.navigation.position).height])
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        SMatrix::from_element(self.sigma * self.sigma)
    }
}

impl SensorType for Bare {
    const TYPE: &'static str = "bare";
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("height", "m")]
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        height(composer, self.noise)
    }
}

impl SensorType for Undocumented {
    const TYPE: &'static str = "undocumented";
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("height", "m")]
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        height(composer, self.noise.value().si())
    }
}
