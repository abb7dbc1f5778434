//! A sensor outside of the framework, in one file: a towed log that measures the speed through
//! water with a scale factor, from parameters in TOML to an estimate.

use navfuse_core::Real;
use navfuse_core::compose::Composer;
use navfuse_core::compose::calibration::ScaleFactor;
use navfuse_core::document::Document;
use navfuse_core::filter::Ekf;
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::process::{BuiltProcess, OwnDynamics};
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::measurement::{At, Jacobian, MeasurementModel, jacobian_error};
use navfuse_core::nalgebra::{SMatrix, SVector};
use navfuse_core::plugin::{Plugin, ProcessType, Registry, SensorType};
use navfuse_core::run::scenario::Scenario;
use navfuse_core::state::display;
use navfuse_core::state::manifold::{Position, Scalar};
use navfuse_core::state::{BlockSpec, Dynamics, Handle, Mode, View};
use navfuse_core::units::sample::{Channel, Sample, SensorId};
use navfuse_core::units::{Length, Sigma};
use navfuse_testing::lab::{self, Bench, Lab, SCENARIO, seconds};
use schemars::JsonSchema;
use serde::Deserialize;

/// A tape that measures the place, stretched.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Tape {
    /// 1-sigma noise of one reading.
    noise: Sigma<Length>,
    /// How much it is stretched.
    #[serde(default)]
    scale: ScaleFactor,
    /// What the test wants the Jacobian to be wrong by.
    #[serde(default)]
    wrong: f64,
    /// Number of channels that it declares, of one that the model has.
    #[serde(default = "one")]
    channels: usize,
}

fn one() -> usize {
    1
}

impl SensorType for Tape {
    const TYPE: &'static str = "tape";

    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("length", "m"); self.channels]
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        Ok(Role::measurement(TapeModel {
            place: composer.find("place", "cart.place")?,
            scale: self.scale.block(composer, "scale", &[1.0], display::RATIO)?,
            sigma: self.noise.value().si(),
            wrong: self.wrong,
        }))
    }
}

struct TapeModel {
    place: Handle<Scalar>,
    scale: Handle<Scalar>,
    sigma: f64,
    wrong: f64,
}

impl MeasurementModel<1> for TapeModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        SVector::from([x.get(self.place) * x.get(self.scale)])
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        SMatrix::from_element(self.sigma * self.sigma)
    }

    fn jacobian(&self, x: &View<'_, f64>, h: &mut Jacobian<'_, 1>) -> bool {
        h.set(self.place, &SMatrix::from([[x.get(self.scale) + self.wrong]]));
        h.set(self.scale, &SMatrix::from([[x.get(self.place)]]));
        true
    }
}

struct Mine;

impl Plugin for Mine {
    fn build(&self, registry: &mut Registry) {
        registry.sensor::<Tape>();
    }
}

fn compose(settings: &[&str]) -> Result<Ekf, String> {
    let mut registry = Registry::new();
    registry.add(&Lab).add(&Mine);
    let scenario = format!(
        "{SCENARIO}[sensor.tape]\nnoise = \"1 cm\"\nscale = {{ initial = 1.1, sigma = 0.2 }}\n"
    );
    let settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
    let document = Document::parse("tape.toml", scenario).unwrap();
    let scenario = Scenario::new(&registry, document, &settings).unwrap();
    scenario.compose().map(Ekf::new).map_err(|e| e.to_string())
}

#[test]
fn its_scale_is_estimated_from_what_another_sensor_knows() {
    let mut b = Bench { ekf: compose(&[]).unwrap(), log: lab::Log::default() };
    for k in 0..100 {
        let t = f64::from(k);
        b.give("speed", t, &[1.0]).fix(t, t).give("tape", t, &[t * 0.97]);
    }
    let (error, sigma) = (b.value("tape.scale") - 0.97, b.variance("tape.scale").sqrt());
    assert!(error.abs() < 5.0 * sigma && sigma < 1e-3, "{error} {sigma}");
}

#[test]
fn its_jacobian_is_checked_by_one_call_that_finds_a_wrong_one() {
    let error = |settings: &[&str]| {
        let mut ekf = compose(settings).unwrap();
        let speed = SensorId(ekf.composition().sensor("speed").unwrap());
        for t in [0.0, 5.0] {
            ekf.process(&Sample::new(seconds(t), speed, &[2.0]), &mut lab::Log::default()).unwrap();
        }
        let tape = ekf.composition().sensor("tape").unwrap();
        let Role::Measurement(model) = &ekf.composition().sensors[tape].role else {
            panic!("it measures")
        };
        jacobian_error(model.as_ref(), &At::state(ekf.layout(), ekf.state()))
    };
    assert!(error(&[]) < 1e-9, "{}", error(&[]));
    // relative to the largest derivative of the channel, the place, 10
    assert!(
        (error(&["sensor.tape.wrong=0.01"]) - 0.001).abs() < 1e-8,
        "{}",
        error(&["sensor.tape.wrong=0.01"])
    );
}

#[test]
fn a_scenario_that_does_not_fit_it_is_refused_with_line_key_and_remedy() {
    let refused = |settings: &[&str]| compose(settings).err().unwrap();
    let text = refused(&["sensor.tape.noise=\"1 cm/s\""]);
    assert!(text.contains("sensor.tape.noise") && text.contains("a length is needed"), "{text}");
    let text = refused(&["sensor.tape.stretch=1"]);
    assert!(text.contains("stretch"), "{text}");
    let text = refused(&["sensor.tape.channels=0"]);
    assert!(text.contains("0 channels are declared, the model predicts 1"), "{text}");
    let text = refused(&["sensor.tape.scale={ mode = \"consider\" }"]);
    assert!(text.contains("scale") && text.contains("needs a sigma"), "{text}");
}

/// The message lists the keys of the type and those that the framework reads from every sensor; for
/// a table within the sensor's, only those of that table.
#[test]
fn the_keys_of_an_unknown_one_are_those_of_its_table() {
    let refused = |setting: &str| compose(&[setting]).err().unwrap();
    let text = refused("sensor.tape.exclud=1");
    assert!(text.contains("sensor.tape.exclud: ") && text.contains("\"exclude\"?"), "{text}");
    let text = refused("sensor.tape.scale={ exclud = 1, initial = 1 }");
    assert!(text.contains("sensor.tape.scale.exclud: ") && !text.contains("exclude"), "{text}");
}

/// A star's altitude stands for it: the latitude itself, rad.
struct Latitude(Handle<Position>);

impl MeasurementModel<1> for Latitude {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        SVector::from([x.get(self.0).latitude])
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        SMatrix::from_element(1e-12)
    }
}

/// A body that stands still at 45 degrees, and its sextant.
#[derive(Deserialize, JsonSchema)]
struct Still {}

impl ProcessType for Still {
    const TYPE: &'static str = "still";
    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        let initial = vec![std::f64::consts::FRAC_PI_4, 3.0, 0.0];
        let (mode, dynamics, display) = (Mode::Estimate, Dynamics::Constant, display::POSITION);
        composer.block::<Position>(
            "position",
            BlockSpec { mode, initial, sigma: vec![1.0; 3], truth: None, dynamics, display },
        )?;
        Ok(BuiltProcess::new(OwnDynamics))
    }
}

#[derive(Deserialize, JsonSchema)]
struct Sextant {}

impl SensorType for Sextant {
    const TYPE: &'static str = "sextant";
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("latitude", "rad")]
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        Ok(Role::measurement(Latitude(composer.find("position", "still.position")?)))
    }
}

#[test]
fn the_jacobian_of_an_angle_with_respect_to_a_position_in_metres_is_checked_too() {
    let mut registry = Registry::new();
    registry.process::<Still>();
    registry.sensor::<Sextant>();
    let document =
        Document::parse("still.toml", "[process.still]\n[sensor.sextant]\n".to_owned()).unwrap();
    let ekf = Ekf::new(Scenario::new(&registry, document, &[]).unwrap().compose().unwrap());
    let Role::Measurement(model) = &ekf.composition().sensors[0].role else {
        panic!("it measures")
    };
    // the step is 6 mm, 1e-9 rad: the rounding of 0.8 rad, 1e-16, leaves 1e-7 of it
    let error = jacobian_error(model.as_ref(), &At::state(ekf.layout(), ekf.state()));
    assert!(error < 2e-7, "{error:e}");
}
