//! A process model outside of the framework: a vehicle without an IMU, at nearly constant velocity
//! in the plane, observed by the distances to two beacons.

use navfuse_core::Real;
use navfuse_core::compose::calibration::Calibration;
use navfuse_core::compose::{Composer, Composition};
use navfuse_core::document::Document;
use navfuse_core::filter::Ekf;
use navfuse_core::model::error::ComposeError;
use navfuse_core::model::process::{
    BuiltProcess, Densities, Input, Interval, Moved, ProcessError, ProcessModel, Step,
};
use navfuse_core::model::record::{Observer, Outcome, Rejection, UpdateRecord};
use navfuse_core::model::sensor::Role;
use navfuse_core::model::sensor::measurement::MeasurementModel;
use navfuse_core::model::sensor::motion::Motion;
use navfuse_core::model::simulate::Random;
use navfuse_core::nalgebra::{
    DMatrix, Matrix4, Rotation3, SMatrix, SVector, Vector2, Vector4, convert,
};
use navfuse_core::plugin::{Plugin, ProcessType, Registry, SensorType};
use navfuse_core::run::scenario::Scenario;
use navfuse_core::run::schema::parameters;
use navfuse_core::state::covariance::{NoiseSlot, PhiDiagonal, Transition};
use navfuse_core::state::display;
use navfuse_core::state::manifold::{Manifold, Position, Rotation, Scalar, Vector};
use navfuse_core::state::{BlockSpec, Display, Dynamics, Handle, Layout, Mode, State, View};
use navfuse_core::units::sample::{Channel, Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_core::units::{AccelerationNoise, Length, Quantity, Sigma};
use schemars::JsonSchema;
use serde::Deserialize;
use std::sync::Arc;

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
    /// Process whose place is measured.
    #[serde(default)]
    of: Option<String>,
    /// Charge of each metre and second.
    #[serde(default)]
    #[expect(dead_code, reason = "read by its schema")]
    charge: Calibration<Quantity<-4, 0, 4, 0, 0, 2>, Quantity<-4, 0, 3, 0, 0, 2>>,
}

const BEACONS: [[f64; 2]; 2] = [[-50.0, 120.0], [150.0, -40.0]];

impl SensorType for Ranges {
    const TYPE: &'static str = "ranges";

    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("first", "m"), Channel::new("second", "m")]
    }

    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let of = self.of.as_deref().unwrap_or("cruise");
        let place = composer.find("of", &format!("{of}.place"))?;
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

/// A body that turns at a rate of its own and goes ahead: a state on every manifold.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Body {
    speed: f64,
}

impl ProcessType for Body {
    const TYPE: &'static str = "body";

    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        // at a pitch of 90 deg, where roll and yaw are singular
        let step = BodyStep {
            rare: block(composer, "rare", &[0.0])?,
            rate: block(composer, "rate", &[0.1, -0.3, 0.2])?,
            attitude: block(composer, "attitude", &[0.4, std::f64::consts::FRAC_PI_2, 0.0])?,
            position: block(composer, "position", &[0.9, 0.2, -50.0])?,
            speed: block(composer, "speed", &[self.speed])?,
        };
        Ok(composer.step(step))
    }
}

fn block<M: Manifold>(
    composer: &mut Composer,
    name: &str,
    initial: &[f64],
) -> Result<Handle<M>, ComposeError> {
    let spec = BlockSpec {
        mode: Mode::Estimate,
        initial: initial.to_vec(),
        sigma: vec![1.0; initial.len()],
        truth: None,
        dynamics: Dynamics::Constant,
        display: display::LEVER_ARM,
    };
    composer.block(name, spec)
}

#[derive(Clone)]
struct BodyStep {
    attitude: Handle<Rotation>,
    rate: Handle<Vector<3>>,
    position: Handle<Position>,
    speed: Handle<Scalar>,
    /// Read above 10 m/s alone.
    rare: Handle<Scalar>,
}

impl Step for BodyStep {
    fn step<T: Real>(
        &self,
        x: &View<'_, T>,
        _: Option<&Input<'_>>,
        dt: f64,
        next: &mut Moved<'_, T>,
    ) {
        let (c_b_n, rate, mut speed) = (x.get(self.attitude), x.get(self.rate), x.get(self.speed));
        if speed > convert(10.0) {
            speed += x.get(self.rare);
        }
        let way = c_b_n.matrix().column(0) * (speed * convert(dt));
        next.set(self.attitude, &(c_b_n * Rotation3::new(rate * convert::<f64, T>(dt))));
        next.set(self.position, &x.get(self.position).displaced(&way));
        next.set(self.speed, &speed);
    }
    fn noise(&self, _: &View<'_, f64>, noise: &mut Densities<'_>) {
        noise.white(self.speed, &[0.01]);
    }
}

struct Mine;

impl Plugin for Mine {
    fn build(&self, registry: &mut Registry) {
        registry.process::<Cruise>();
        registry.process::<Body>();
        registry.sensor::<Ranges>();
    }
}

fn filter(settings: &[&str]) -> Ekf {
    Ekf::new(composed(settings).unwrap())
}

fn composed(settings: &[&str]) -> Result<Composition, String> {
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
    let scenario = Scenario::new(&registry, document, &settings).map_err(|e| e.to_string())?;
    scenario.compose().map_err(|e| e.to_string())
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
    let text = "at 1.500 s: cruise: cruise.place is no longer a number; look in the equations";
    assert!(error.to_string().starts_with(text), "{error}");
}

#[test]
fn a_state_of_another_part_is_suggested_where_the_key_names_the_wrong_one() {
    let error = composed(&["sensor.ranges.of=ins"]).map(|_| ()).unwrap_err();
    let text =
        "there is no state ins.place; did you mean cruise.place? (states so far: cruise.place";
    assert!(error.contains(text), "{error}");
}

#[test]
fn a_calibration_of_a_quantity_without_a_name_has_its_example() {
    let mut registry = Registry::new();
    registry.add(&Mine);
    let entry = registry.entries().find(|entry| &*entry.name == "ranges").unwrap();
    let charge = parameters(entry).into_iter().find(|row| row.key == "charge").unwrap();
    assert_eq!(charge.takes, "calibration, e.g. \"1 s^2*A/m^2\"");
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

/// A composition with the body, whose process has moved the state over 0.5 s from one error state
/// displaced.
fn moved(
    speed: f64,
    displaced: (usize, f64),
) -> Result<(Arc<Layout>, State, Transition), ProcessError> {
    let mut registry = Registry::new();
    registry.add(&Mine);
    let scenario = format!("[process.body]\nspeed = {speed:?}\n");
    let document = Document::parse("body.toml", &scenario).unwrap();
    let mut composition = Scenario::new(&registry, document, &[]).unwrap().compose().unwrap();
    let (layout, transition) = (&composition.layout, &mut composition.transition);
    let mut state = layout.initial_state();
    for block in &layout.blocks {
        let row = displaced.0.wrapping_sub(block.tangent_range().start);
        let mut delta = vec![0.0; block.operations.tangent];
        delta.get_mut(row).into_iter().for_each(|delta| *delta = displaced.1);
        (block.operations.retract)(&mut state.values[block.range()], &delta);
    }
    let interval =
        Interval { from: Time::default(), to: Time::from_nanos(500_000_000), input: None };
    let process = &mut composition.processes[0].model;
    process.propagate(layout, &mut state, &interval, transition)?;
    Ok((Arc::clone(layout), state, transition.clone()))
}

/// Row of a block of the body.
fn row(layout: &Layout, name: &str) -> usize {
    layout.find(name).unwrap().tangent.unwrap()
}

/// Differences over 1 cm: a position of 1 rad is rounded at 1.4 nm; a radius of 6e6 m bends by 1e-9
/// on 1 cm; the third derivative of a rotation leaves `step^2 / 6`.
#[test]
fn the_derivative_of_a_step_is_that_of_central_differences_on_every_manifold() {
    let (layout, _, transition) = moved(3.0, (0, 0.0)).unwrap();
    let mut phi = DMatrix::<f64>::identity(layout.tangent, layout.tangent);
    transition.elements().for_each(|(i, j, value)| phi[(i, j)] = value);
    let mut largest = 0.0_f64;
    for column in 0..layout.tangent {
        let step = 5e-3;
        let [to, from] = [step, -step].map(|step| moved(3.0, (column, step)).unwrap().1);
        for block in &layout.blocks {
            let (range, rows) = (block.range(), block.tangent_range());
            let mut change = vec![0.0; rows.len()];
            (block.operations.local)(&to.values[range.clone()], &from.values[range], &mut change);
            for (row, change) in rows.zip(change) {
                largest = largest.max((phi[(row, column)] - change / (2.0 * step)).abs());
            }
        }
    }
    assert!(largest < 1e-5, "{largest:e}");
}

/// At rest the position does not depend on the attitude, and yet the derivative has its place.
#[test]
fn a_derivative_that_is_zero_at_the_start_has_its_place() {
    let (layout, _, transition) = moved(0.0, (0, 0.0)).unwrap();
    let place = (row(&layout, "body.position"), row(&layout, "body.attitude"));
    let found: Vec<f64> =
        transition.elements().filter(|e| (e.0, e.1) == place).map(|e| e.2).collect();
    assert_eq!(found, [0.0]);
    // the position does not depend on the block that is read above 10 m/s alone
    let rare = row(&layout, "body.rare");
    assert!(transition.elements().all(|e| e.1 != rare));
}

#[test]
fn a_step_that_reads_another_block_than_at_the_start_ends_the_run() {
    let speed = row(&moved(3.0, (0, 0.0)).unwrap().0, "body.speed");
    let error = moved(3.0, (speed, 8.0)).unwrap_err().to_string();
    assert!(error.starts_with("the step uses body.rare, and did not"), "{error}");
}
