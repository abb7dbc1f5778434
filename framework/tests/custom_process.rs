//! A process model outside of the framework: a vehicle without an IMU, at nearly constant velocity
//! in the plane, observed by the distances to two beacons.
#![allow(missing_docs, clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use navfuse_core::Real;
use navfuse_core::compose::Composer;
use navfuse_core::document::Document;
use navfuse_core::filter::Ekf;
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::process::BuiltProcess;
use navfuse_core::model::process::{Interval, ProcessError, ProcessModel};
use navfuse_core::model::record::{Observer, Outcome, Rejection, UpdateRecord};
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::measurement::MeasurementModel;
use navfuse_core::model::sensor::motion::Motion;
use navfuse_core::model::simulate::Random;
use navfuse_core::nalgebra::{Matrix4, SMatrix, SVector, Vector2, Vector4, convert};
use navfuse_core::plugin::{Plugin, ProcessType, Registry, SensorType};
use navfuse_core::run::scenario::Scenario;
use navfuse_core::state::covariance::{NoiseSlot, PhiDiagonal, Transition};
use navfuse_core::state::display;
use navfuse_core::state::manifold::Vector;
use navfuse_core::state::{BlockSpec, Display, Dynamics, Handle, Layout, Mode, State, View};
use navfuse_core::units::sample::{Channel, Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_core::units::{AccelerationNoise, Length, Sigma};
use schemars::JsonSchema;
use serde::Deserialize;

/// Nearly constant velocity in the plane: place and velocity, moved by white acceleration.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Cruise {
    /// White acceleration.
    acceleration: Sigma<AccelerationNoise>,
    /// The place becomes NaN.
    #[serde(default)]
    broken: bool,
}

impl ProcessType for Cruise {
    const TYPE: &'static str = "cruise";

    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        let display = Display { unit: "m", scale: 1.0, components: &["x", "y"] };
        let spec = |initial: [f64; 2], sigma: f64, display: &Display| BlockSpec {
            mode: Mode::Estimate,
            initial: initial.to_vec(),
            sigma: vec![sigma; 2],
            truth: None,
            dynamics: Dynamics::Constant,
            display: display.clone(),
        };
        let place = composer.block("place", spec([0.0, 0.0], 10.0, &display))?;
        let velocity = composer.block("velocity", spec([1.0, 0.5], 0.5, &display::VELOCITY))?;
        let (p, v) = (composer.tangent(place), composer.tangent(velocity));
        let t = composer.transition();
        let model = CruiseModel {
            place,
            velocity,
            density: self.acceleration.value().si().powi(2),
            broken: self.broken,
            p_p: t.phi_diagonal(p, p),
            p_v: t.phi_diagonal(p, v),
            // place and velocity are adjacent, so one noise block holds their coupled noise
            q: t.noise(p),
        };
        Ok(BuiltProcess::new(model))
    }
}

#[derive(Clone)]
struct CruiseModel {
    place: Handle<Vector<2>>,
    velocity: Handle<Vector<2>>,
    density: f64,
    broken: bool,
    p_p: PhiDiagonal<2>,
    p_v: PhiDiagonal<2>,
    q: NoiseSlot<4>,
}

impl ProcessModel for CruiseModel {
    fn propagate(
        &mut self,
        layout: &Layout,
        state: &mut State,
        interval: &Interval<'_>,
        transition: &mut Transition,
    ) -> Result<(), ProcessError> {
        let dt = interval.duration();
        let mut place = state.get(layout, self.place) + state.get(layout, self.velocity) * dt;
        if self.broken {
            place.y = f64::NAN;
        }
        state.set(layout, self.place, &place);
        transition.set_diagonal(self.p_p, &[1.0; 2]);
        transition.set_diagonal(self.p_v, &[dt; 2]);
        transition.set_noise(self.q, &noise(self.density, dt));
        Ok(())
    }

    fn follow(&self, layout: &Layout, motion: &Motion, state: &mut State, known: &mut [bool]) {
        state.set(layout, self.velocity, &motion.velocity.xy());
        known[self.velocity.slot()] = true;
    }

    fn boxed_clone(&self) -> Box<dyn ProcessModel> {
        Box::new(self.clone())
    }
}

/// White acceleration over `dt` (Groves eq. 3.44).
fn noise(density: f64, dt: f64) -> Matrix4<f64> {
    let (a, b, c) = (density * dt.powi(3) / 3.0, density * dt * dt / 2.0, density * dt);
    Matrix4::new(a, 0.0, b, 0.0, 0.0, a, 0.0, b, b, 0.0, c, 0.0, 0.0, b, 0.0, c)
}

/// Distances to two beacons.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Ranges {
    noise: Sigma<Length>,
    /// The prediction is NaN.
    #[serde(default)]
    broken: bool,
}

const BEACONS: [[f64; 2]; 2] = [[-50.0, 120.0], [150.0, -40.0]];

impl SensorType for Ranges {
    const TYPE: &'static str = "ranges";

    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("first", "m"), Channel::new("second", "m")]
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let place = composer.find("place", "cruise.place")?;
        let (sigma, broken) = (self.noise.value().si(), self.broken);
        Ok(Role::measurement(RangesModel { place, sigma, broken }))
    }
}

struct RangesModel {
    place: Handle<Vector<2>>,
    sigma: f64,
    broken: bool,
}

impl MeasurementModel<2> for RangesModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 2> {
        let place = x.get(self.place);
        let zero: T = convert(if self.broken { f64::NAN } else { 0.0 });
        SVector::from(BEACONS.map(|b| (place - Vector2::from(b).map(convert)).norm() + zero))
    }

    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 2, 2> {
        SMatrix::identity() * self.sigma.powi(2)
    }
}

struct Mine;

impl Plugin for Mine {
    fn build(&self, registry: &mut Registry) {
        registry.process::<Cruise>();
        registry.sensor::<Ranges>();
    }
}

fn filter(settings: &[&str]) -> Ekf {
    let mut registry = Registry::new();
    registry.add(&Mine);
    let scenario = r#"
        [process.cruise]
        acceleration = "50 mm/s^2/sqrt(Hz)"
        [sensor.ranges]
        noise = "50 cm"
    "#;
    let document = Document::parse("cruise.toml", scenario).unwrap();
    let settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
    Ekf::new(Scenario::new(&registry, document, &settings).unwrap().compose().unwrap())
}

fn ranges(place: Vector2<f64>) -> [f64; 2] {
    BEACONS.map(|b| (place - Vector2::from(b)).norm())
}

#[test]
fn a_vehicle_without_an_imu_is_filtered_as_the_textbook_does() {
    let mut ekf = filter(&[]);
    let mut random = Random::new(1, "ranges");
    let (mut x, mut p) = (
        Vector4::new(0.0, 0.0, 1.0, 0.5),
        Matrix4::from_diagonal(&Vector4::new(100.0, 100.0, 0.25, 0.25)),
    );
    let mut before = 0.0;
    for k in 0..400 {
        let t = f64::from(k) * 0.5 + if k % 2 == 0 { 0.0 } else { 0.2 }; // at no fixed rate
        let truth = Vector2::new(3.0 + 1.2 * t, -2.0 + 0.3 * t);
        let z = ranges(truth).map(|r| r + 0.5 * random.normal());
        let time = Time::from_seconds(t).unwrap();
        ekf.process(&Sample::new(time, SensorId(0), &z), &mut ()).unwrap();
        // the same, densely
        let dt = t - before;
        before = t;
        let mut phi = Matrix4::identity();
        phi[(0, 2)] = dt;
        phi[(1, 3)] = dt;
        x = phi * x;
        p = phi * p * phi.transpose() + noise(0.0025, dt);
        let mut h = SMatrix::<f64, 2, 4>::zeros();
        for (k, b) in BEACONS.iter().enumerate() {
            let d = x.xy() - Vector2::from(*b);
            h.fixed_view_mut::<1, 2>(k, 0).copy_from(&(d / d.norm()).transpose());
        }
        let s = h * p * h.transpose() + SMatrix::<f64, 2, 2>::identity() * 0.25;
        let gain = p * h.transpose() * s.try_inverse().unwrap();
        x += gain * (Vector2::from(z) - Vector2::from(ranges(x.xy())));
        let a = Matrix4::identity() - gain * h;
        p = a * p * a.transpose() + gain * gain.transpose() * 0.25;
        // 400 steps of a stable filter with numbers of at most 250: 30 times the rounding of
        // 250 x 2^-53 = 3e-14
        for i in 0..4 {
            assert!(
                (ekf.state().values[i] - x[i]).abs() < 1e-12,
                "step {k}: {:?} {x}",
                ekf.state().values
            );
            for j in 0..4 {
                assert!((ekf.covariance().get(i, j) - p[(i, j)]).abs() < 1e-12, "step {k}");
            }
        }
    }
    // and it finds the vehicle: five sigma of the place, and of the velocity
    let truth = [3.0 + 1.2 * before, -2.0 + 0.3 * before, 1.2, 0.3];
    for (i, truth) in truth.iter().enumerate() {
        let sigma = ekf.covariance().get(i, i).sqrt();
        assert!(
            (ekf.state().values[i] - truth).abs() < 5.0 * sigma,
            "{i}: {:?} {sigma}",
            ekf.state().values
        );
    }
}

/// Outcomes of samples.
#[derive(Default)]
struct Outcomes(Vec<Outcome>);

impl Observer for Outcomes {
    fn update(&mut self, update: &UpdateRecord<'_>) {
        self.0.push(update.outcome);
    }
}

fn sample(seconds: f64) -> Sample {
    Sample::new(Time::from_seconds(seconds).unwrap(), SensorId(0), &ranges(Vector2::zeros()))
}

#[test]
fn a_process_that_yields_nan_ends_the_run_with_its_name_the_block_and_the_time() {
    let mut ekf = filter(&["process.cruise.broken=true"]);
    ekf.process(&sample(0.0), &mut ()).unwrap();
    let error = ekf.process(&sample(1.5), &mut ()).unwrap_err();
    assert_eq!(error.to_string(), "at 1.500 s: cruise: cruise.place is no longer a number");
}

#[test]
fn a_sensor_whose_model_predicts_nan_is_named_and_leaves_the_estimate_as_it_was() {
    let mut ekf = filter(&["sensor.ranges.broken=true"]);
    let mut outcomes = Outcomes::default();
    ekf.process(&sample(0.0), &mut outcomes).unwrap();
    assert_eq!(outcomes.0, [Outcome::Rejected(Rejection::Prediction)]);
    assert_eq!(ekf.state().values, [0.0, 0.0, 1.0, 0.5]);
    assert_eq!(ekf.covariance().get(0, 0), 100.0);
}
