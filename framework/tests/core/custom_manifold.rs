//! A manifold outside of the framework: a direction on the unit sphere, with two degrees of freedom
//! in three numbers, observed by an angle that wraps.

use navfuse_core::Real;
use navfuse_core::compose::Composer;
use navfuse_core::document::Document;
use navfuse_core::filter::Ekf;
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::process::{BuiltProcess, OwnDynamics};
use navfuse_core::model::record::{Observer, Outcome, UpdateRecord};
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::measurement::{At, MeasurementModel, jacobian_error};
use navfuse_core::nalgebra::{SMatrix, SVector, Vector2, Vector3, convert};
use navfuse_core::plugin::{Plugin, ProcessType, Registry, SensorType};
use navfuse_core::run::scenario::Scenario;
use navfuse_core::state::display;
use navfuse_core::state::manifold::{Manifold, Operations, Reading};
use navfuse_core::state::{BlockSpec, Display, Dynamics, Handle, Mode, View};
use navfuse_core::units::sample::{Channel, Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_core::units::{Angle, Sigma};
use proptest::prelude::*;
use schemars::JsonSchema;
use serde::Deserialize;
use std::f64::consts::{PI, TAU};

/// A direction. The tangent (rad) is along two axes at right angles to the direction; the
/// coordinates are azimuth and elevation.
struct Direction;

/// Two axes at right angles to a direction and to each other.
fn axes<T: Real>(d: &Vector3<T>) -> (Vector3<T>, Vector3<T>) {
    let other: Vector3<T> = if d.z.abs() < convert(0.9) { Vector3::z() } else { Vector3::x() };
    let a = other.cross(d).normalize();
    (a, d.cross(&a))
}

impl Manifold for Direction {
    const AMBIENT: usize = 3;
    const TANGENT: usize = 2;
    const READING: Reading = Reading::Tangent;
    type Value<T: Real> = Vector3<T>;

    fn load<T: Real>(ambient: &[f64]) -> Vector3<T> {
        Vector3::new(ambient[0], ambient[1], ambient[2]).map(convert)
    }
    fn store(value: &Vector3<f64>, ambient: &mut [f64]) {
        ambient.copy_from_slice(value.normalize().as_slice());
    }
    fn retract<T: Real>(x: &Vector3<T>, delta: &[T]) -> Vector3<T> {
        let (a, b) = axes(x);
        (x + a * delta[0] + b * delta[1]).normalize()
    }
    fn local(to: &Vector3<f64>, from: &Vector3<f64>, delta: &mut [f64]) {
        let (a, b) = axes(from);
        let along = to.dot(from);
        delta.copy_from_slice(&[to.dot(&a) / along, to.dot(&b) / along]);
    }
    fn coordinates<T: Real>(x: &Vector3<T>, out: &mut [T]) {
        out[0] = x.y.atan2(x.x);
        out[1] = x.z.asin();
    }
    fn from_coordinates(c: &[f64]) -> Vector3<f64> {
        Vector3::new(c[1].cos() * c[0].cos(), c[1].cos() * c[0].sin(), c[1].sin())
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn it_obeys_what_the_framework_asks_of_a_manifold(
        azimuth in -PI..PI, elevation in -1.5..1.5_f64, d in [-1.0..1.0_f64, -1.0..1.0],
    ) {
        let operations = Operations::of::<Direction>();
        let mut x = [0.0; 3];
        (operations.from_coordinates)(&[azimuth, elevation], &mut x);
        let (mut y, mut back) = (x, [0.0; 2]);
        (operations.retract)(&mut y, &d);
        (operations.local)(&y, &x, &mut back);
        prop_assert!((Vector2::from(back) - Vector2::from(d)).norm() < 1e-14);
    }
}

/// A direction that stands still.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Star {
    sigma: Sigma<Angle>,
}

impl ProcessType for Star {
    const TYPE: &'static str = "star";
    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        let spec = BlockSpec {
            mode: Mode::Estimate,
            initial: vec![3.1, 0.4],
            sigma: vec![self.sigma.value().si(); 2],
            truth: None,
            dynamics: Dynamics::Constant,
            display: Display { components: &["azimuth", "elevation"], ..display::ANGLES },
        };
        composer.block::<Direction>("direction", spec)?;
        Ok(BuiltProcess::new(OwnDynamics))
    }
}

/// Azimuth and elevation.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Telescope {
    noise: Sigma<Angle>,
}

struct TelescopeModel {
    direction: Handle<Direction>,
    sigma: f64,
}

impl SensorType for Telescope {
    const TYPE: &'static str = "telescope";
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("azimuth", "rad"), Channel::new("elevation", "rad")]
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let direction = composer.find("direction", "star.direction")?;
        Ok(Role::measurement(TelescopeModel { direction, sigma: self.noise.value().si() }))
    }
}

impl MeasurementModel<2> for TelescopeModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 2> {
        let mut out = [T::zero(); 2];
        Direction::coordinates(&x.get(self.direction), &mut out);
        SVector::from(out)
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 2, 2> {
        SMatrix::identity() * self.sigma.powi(2)
    }
    fn difference(&self, channel: usize, measured: f64, predicted: f64) -> f64 {
        let d = measured - predicted;
        if channel == 0 { d - TAU * (d / TAU).round() } else { d }
    }
}

struct Mine;

impl Plugin for Mine {
    fn build(&self, registry: &mut Registry) {
        registry.process::<Star>();
        registry.sensor::<Telescope>();
    }
}

#[derive(Default)]
struct Outcomes(Vec<Outcome>);

impl Observer for Outcomes {
    fn update(&mut self, update: &UpdateRecord<'_>) {
        self.0.push(update.outcome);
    }
}

#[test]
fn a_direction_is_estimated_across_the_azimuth_where_angles_wrap() {
    let mut registry = Registry::new();
    registry.add(&Mine);
    let scenario = "[process.star]\nsigma = \"5 deg\"\n[sensor.telescope]\nnoise = \"0.1 deg\"\n";
    let document = Document::parse("star.toml", scenario).unwrap();
    let mut ekf = Ekf::new(Scenario::new(&registry, document, &[]).unwrap().compose().unwrap());
    let mut outcomes = Outcomes::default();
    // the estimate starts at an azimuth of 3.1; the truth is beyond half a turn, at -3.1
    for k in 0..50 {
        let t = Time::from_seconds(f64::from(k)).unwrap();
        ekf.process(&Sample::new(t, SensorId(0), &[-3.1, 0.38]), &mut outcomes).unwrap();
    }
    assert_eq!(outcomes.0, [Outcome::Accepted; 50]);
    let block = ekf.layout().find("star.direction").unwrap();
    let (mut shown, mut sigma) = ([0.0; 2], [0.0; 2]);
    block.show(&ekf.state().values, &mut shown);
    block.show_sigma(&ekf.state().values, &ekf.covariance(), &mut sigma);
    // the remaining share of the 0.083 rad: R / (P n) = (0.1/5)^2 / 50, and the nonlinearity of the
    // first, large step
    assert!((shown[0] - (-3.1_f64).to_degrees()).abs() < 0.05, "{shown:?}");
    assert!((shown[1] - 0.38_f64.to_degrees()).abs() < 0.05, "{shown:?}");
    // noise over the root of the number: along the tangent the azimuth counts cos(elevation)
    let expected = [0.1 / 50.0_f64.sqrt() * 0.38_f64.cos(), 0.1 / 50.0_f64.sqrt()];
    let mut found = sigma;
    found.sort_by(f64::total_cmp);
    assert!(
        (found[0] / expected[0] - 1.0).abs() < 0.02 && (found[1] / expected[1] - 1.0).abs() < 0.02,
        "{sigma:?}"
    );
    let Role::Measurement(model) = &ekf.composition().sensors[0].role else {
        panic!("it measures")
    };
    // central differences of 1e-6 on derivatives of order one
    assert!(jacobian_error(model.as_ref(), &At::state(ekf.layout(), ekf.state())) < 1e-8);
}
