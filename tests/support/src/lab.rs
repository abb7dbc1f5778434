//! A small laboratory, written with the public interface alone: a cart on a line, driven by a
//! speedometer whose drift is a state, and a sensor of three channels that measures its place.

use navfuse_core::Real;
use navfuse_core::compose::calibration::{Calibration, LengthBias};
use navfuse_core::compose::{Composer, Composition};
use navfuse_core::document::Document;
use navfuse_core::filter::Ekf;
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::process::BuiltProcess;
use navfuse_core::model::process::{Interval, ProcessError, ProcessModel};
use navfuse_core::model::record::finding::Finding;
use navfuse_core::model::record::{Epoch, Event, Observer, Outcome, Rejection, UpdateRecord};
use navfuse_core::model::sensor::measurement::MeasurementModel;
use navfuse_core::model::sensor::motion::Motion;
use navfuse_core::model::sensor::{Reference, Role};
use navfuse_core::model::simulate::{Scene, Simulate};
use navfuse_core::nalgebra::{SMatrix, SVector, UnitQuaternion, Vector3, convert};
use navfuse_core::plugin::{Plugin, ProcessType, Registry, SensorType};
use navfuse_core::run::scenario::Scenario;
use navfuse_core::state::covariance::{NoiseSlot, PhiSlot, Transition};
use navfuse_core::state::display;
use navfuse_core::state::geodesy::Geodetic;
use navfuse_core::state::manifold::Scalar;
use navfuse_core::state::{BlockSpec, Dynamics, Handle, Layout, Mode, State, View};
use navfuse_core::units::sample::{Channel, Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_core::units::{AccelerationNoise, Length, Sigma, Speed};
use schemars::JsonSchema;
use serde::Deserialize;
use std::sync::Arc;

/// Speed along the line, m/s, over the interval that ends at the sample.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Speedometer {}

impl SensorType for Speedometer {
    const TYPE: &'static str = "speedometer";
    const INPUT: bool = true;
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("speed", "mps")]
    }
    fn build(self, _: &mut Composer) -> Result<Role, ComposeError> {
        Ok(Role::Input(Box::new(())))
    }
}

#[derive(Clone)]
struct Silent;

impl Simulate for Silent {
    fn simulate(&self, _: &mut Scene<'_>, _: &mut Sample) {}
    fn boxed_clone(&self) -> Box<dyn Simulate> {
        Box::new(self.clone())
    }
}

/// A cart: `p' = u - drift + w`, with the spectral density of `w` 0.01 m^2/s.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cart {
    #[serde(default = "speed")]
    pub input: String,
    #[serde(default)]
    pub drift: Calibration<Speed, AccelerationNoise>,
}

fn speed() -> String {
    "speed".into()
}

pub const DENSITY: f64 = 0.01;

/// Length of the line on each side, m.
pub const LINE: f64 = 1e6;

impl ProcessType for Cart {
    const TYPE: &'static str = "cart";
    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        composer.input::<()>("input", &self.input)?;
        let place = BlockSpec {
            mode: Mode::Estimate,
            initial: vec![0.0],
            sigma: vec![1.0],
            truth: None,
            dynamics: Dynamics::Constant,
            display: display::LENGTH,
        };
        let place = composer.block("place", place)?;
        let drift = self.drift.block(composer, "drift", &[0.0], display::VELOCITY)?;
        let (p, d) = (composer.tangent(place), composer.tangent(drift));
        let t = composer.transition();
        let model = CartModel { place, drift, p_p: t.phi(p, p), p_d: t.phi(p, d), q: t.noise(p) };
        Ok(BuiltProcess::new(model).driven_by(self.input, Silent))
    }
}

#[derive(Clone)]
struct CartModel {
    place: Handle<Scalar>,
    drift: Handle<Scalar>,
    p_p: PhiSlot<1, 1>,
    p_d: PhiSlot<1, 1>,
    q: NoiseSlot<1>,
}

impl ProcessModel for CartModel {
    fn propagate(
        &mut self,
        layout: &Layout,
        state: &mut State,
        interval: &Interval<'_>,
        transition: &mut Transition,
    ) -> Result<(), ProcessError> {
        let speed = interval
            .input
            .and_then(|i| i.sample.get(0))
            .ok_or_else(|| ProcessError::input("no speed"))?;
        let dt = interval.duration();
        let place = state.get(layout, self.place) + (speed - state.get(layout, self.drift)) * dt;
        if place.abs() > LINE {
            return Err(ProcessError::domain("the cart has left the line"));
        }
        state.set(layout, self.place, &place);
        transition.set(self.p_p, &SMatrix::from([[1.0]]));
        transition.set(self.p_d, &SMatrix::from([[-dt]]));
        transition.set_noise(self.q, &SMatrix::from([[DENSITY * dt]]));
        Ok(())
    }
    fn follow(&self, layout: &Layout, motion: &Motion, truth: &mut State, known: &mut [bool]) {
        truth.set(layout, self.place, &motion.position.height);
        known[self.place.slot()] = true;
    }
    fn boxed_clone(&self) -> Box<dyn ProcessModel> {
        Box::new(self.clone())
    }
}

/// Three channels: the place, twice the place, and a tenth of its square, each with the same bias.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fix {
    pub noise: Sigma<Length>,
    #[serde(default)]
    pub bias: LengthBias,
}

impl SensorType for Fix {
    const TYPE: &'static str = "fix";
    fn channels(&self) -> Vec<Channel> {
        ["one", "two", "square"].map(|name| Channel::new(name, "m")).to_vec()
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let bias = self.bias.block(composer, "bias", &[0.0], display::LENGTH)?;
        let place = composer.find("place", "cart.place")?;
        Ok(Role::measurement(FixModel { place, bias, sigma: self.noise.value().si() }))
    }
}

struct FixModel {
    place: Handle<Scalar>,
    bias: Handle<Scalar>,
    sigma: f64,
}

impl MeasurementModel<3> for FixModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        let (p, b) = (x.get(self.place), x.get(self.bias));
        SVector::from([p + b, p * convert(2.0) + b, p * p * convert(0.1) + b])
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 3, 3> {
        SMatrix::identity() * (self.sigma * self.sigma)
    }
}

/// A reference: the place, m.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Survey {}

impl SensorType for Survey {
    const TYPE: &'static str = "survey";
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("place", "m")]
    }
    fn build(self, _: &mut Composer) -> Result<Role, ComposeError> {
        Ok(Role::Reference(Arc::new(Surveyor)))
    }
}

struct Surveyor;

impl Reference for Surveyor {
    fn motion(&self, _: &Layout, _: &State, sample: &Sample) -> Option<Motion> {
        let zero = Vector3::zeros();
        Some(Motion {
            time: sample.time,
            position: Geodetic { latitude: 0.0, longitude: 0.0, height: sample.get(0)? },
            velocity: zero,
            c_b_n: UnitQuaternion::identity(),
            w_ib_b: zero,
            f_ib_b: zero,
        })
    }
    fn sample(&self, _: &Motion, _: &mut Sample) {}
}

pub struct Lab;

impl Plugin for Lab {
    fn build(&self, registry: &mut Registry) {
        registry.sensor::<Speedometer>();
        registry.sensor::<Fix>();
        registry.sensor::<Survey>();
        registry.process::<Cart>();
    }
}

/// The scenario of most tests.
pub const SCENARIO: &str = r#"
[sensor.speed]
type = "speedometer"
[process.cart]
drift = { sigma = "0.5 m/s" }
[sensor.fix]
noise = "10 cm"
"#;

pub fn compose(scenario: &str, settings: &[&str]) -> Composition {
    try_compose(scenario, settings).unwrap()
}

fn try_compose(
    scenario: &str,
    settings: &[&str],
) -> Result<Composition, navfuse_core::plugin::BuildError> {
    let mut registry = Registry::new();
    registry.add(&Lab);
    let settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
    let document = Document::parse("lab.toml", scenario).unwrap();
    Scenario::new(&registry, document, &settings).unwrap().compose()
}

/// Message with which the scenario is rejected.
pub fn refused(scenario: &str, settings: &[&str]) -> String {
    try_compose(scenario, settings).unwrap_err().to_string()
}

pub fn filter(settings: &[&str]) -> Ekf {
    Ekf::new(compose(SCENARIO, settings))
}

pub fn seconds(t: f64) -> Time {
    Time::from_seconds(t).unwrap()
}

/// Log of a run.
#[derive(Default)]
pub struct Log {
    pub epochs: Vec<Time>,
    /// The first number of the last epoch's state.
    pub last_value: f64,
    pub updates: Vec<(f64, Outcome, f64)>,
    pub inputs: Vec<(f64, Option<Rejection>)>,
    pub events: Vec<String>,
    pub findings: Vec<Finding>,
    /// Innovations of the last update.
    pub innovation: Vec<f64>,
    pub present: u16,
    pub threshold: f64,
}

impl Log {
    pub fn outcomes(&self) -> Vec<Outcome> {
        self.updates.iter().map(|u| u.1).collect()
    }
    pub fn says(&self, text: &str) -> usize {
        self.events.iter().filter(|e| e.contains(text)).count()
    }
}

impl Observer for Log {
    fn epoch(&mut self, epoch: &Epoch<'_>) {
        self.epochs.push(epoch.state.time);
        self.last_value = epoch.state.values[0];
    }
    fn update(&mut self, u: &UpdateRecord<'_>) {
        self.updates.push((u.time.seconds(), u.outcome, u.nis));
        self.innovation = u.innovation.to_vec();
        self.present = u.present;
        self.threshold = u.threshold;
    }
    fn input(&mut self, sample: &Sample, rejected: Option<Rejection>) {
        self.inputs.push((sample.time.seconds(), rejected));
    }
    fn event(&mut self, event: Event) {
        self.events.push(format!("{} {}", event.about, event.text));
    }
    fn finding(&mut self, finding: Finding) {
        self.events.push(format!("{} {}", finding.about, finding.text));
        self.findings.push(finding);
    }
}

/// A filter with its log.
pub struct Bench {
    pub ekf: Ekf,
    pub log: Log,
}

impl Bench {
    pub fn new(settings: &[&str]) -> Self {
        Self { ekf: filter(settings), log: Log::default() }
    }

    pub fn of(scenario: &str, settings: &[&str]) -> Self {
        Self { ekf: Ekf::new(compose(scenario, settings)), log: Log::default() }
    }

    /// Gives a sample of the named sensor.
    pub fn give(&mut self, sensor: &str, t: f64, values: &[f64]) -> &mut Self {
        let id = SensorId(self.ekf.composition().sensor(sensor).unwrap());
        self.ekf.process(&Sample::new(seconds(t), id, values), &mut self.log).unwrap();
        self
    }

    /// Gives the fix at a place.
    pub fn fix(&mut self, t: f64, p: f64) -> &mut Self {
        self.give("fix", t, &[p, 2.0 * p, 0.1 * p * p])
    }

    pub fn value(&self, block: &str) -> f64 {
        self.ekf.state().values[self.ekf.layout().find(block).unwrap().offset]
    }

    pub fn variance(&self, block: &str) -> f64 {
        let t = self.ekf.layout().find(block).unwrap().tangent.unwrap();
        self.ekf.covariance().get(t, t)
    }
}
