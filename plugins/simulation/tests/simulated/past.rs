//! Past states and truths that processes move, with plugins as an outsider would write them: visual
//! odometry, and the clock of a receiver.

use navfuse_core::document::Document;
use navfuse_core::model::simulate::Random;
use navfuse_core::nalgebra::Matrix2;
use navfuse_core::prelude::*;
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::session::Finished;
use navfuse_core::units::Duration;
use navfuse_ins::Navigation;
use navfuse_testing::judge::{Judge, judged};
use navfuse_testing::rts::Records;
use navfuse_testing::steps::allocations;
use std::sync::atomic::AtomicBool;

// ANCHOR: odometry
/// Visual odometry: translation and rotation of the camera since its previous image.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct VisualOdometry {
    /// 1-sigma noise of the translation.
    translation: Sigma<Length>,
    /// 1-sigma noise of the rotation.
    rotation: Sigma<Angle>,
    /// Time between keyframes, from which the camera measures. Default: every image.
    keyframes: Option<Positive<Duration>>,
}

struct Relative(VisualOdometry, Navigation, Past<Rotation>, Past<Position>);

impl SensorType for VisualOdometry {
    const TYPE: &'static str = "visual-odometry";
    fn channels(&self) -> Vec<Channel> {
        let metres = ["x", "y", "z"].map(|name| Channel::new(name, "m"));
        let angles = ["turn_x", "turn_y", "turn_z"].map(|name| Channel::new(name, "rad"));
        [metres, angles].concat()
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let now = Navigation::only(composer)?;
        let (attitude, position) = (composer.past(now.attitude)?, composer.past(now.position)?);
        Ok(Role::measurement(Relative(self, now, attitude, position)))
    }
}

impl MeasurementModel<6> for Relative {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 6> {
        let back = x.then(self.2).inverse(); // from navigation axes to those of the previous image
        let moved = back * x.get(self.1.position).ned_from(&x.then(self.3));
        let turned = back * x.get(self.1.attitude); // of a small turn: C - C' = 2 [turn x]
        let sine = |i, j| (turned[(i, j)] - turned[(j, i)]) * convert::<f64, T>(0.5);
        SVector::from([moved.x, moved.y, moved.z, sine(2, 1), sine(0, 2), sine(1, 0)])
    }
    fn keyframe(&self, sample: &Sample) -> bool {
        let every = self.0.keyframes.map_or(0.0, |time| time.value().si());
        every == 0.0 || (sample.time.seconds() / every).fract() == 0.0
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 6, 6> {
        let (t, r) = (self.0.translation.value().si(), self.0.rotation.value().si());
        SMatrix::from_diagonal(&SVector::from([t, t, t, r, r, r].map(|s| s * s)))
    }
}
// ANCHOR_END: odometry

/// Clock of a receiver: offset (m) and drift (m/s), both with white noise.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Clock {
    /// A clock whose truth nobody moves.
    #[serde(default)]
    no_truth: bool,
}

#[derive(Clone)]
struct ClockModel {
    wanders: bool,
    states: [Handle<Scalar>; 2],
    phi: [PhiSlot<1, 1>; 3],
    noise: NoiseSlot<2>,
}

/// Spectral densities of offset (m^2/s) and drift (m^2/s^3).
const DENSITY: [f64; 2] = [0.04, 0.01];

impl ClockModel {
    /// Covariance of the noise of `dt` seconds (Brown & Hwang, section 9.3).
    fn covariance(dt: f64) -> Matrix2<f64> {
        let [f, g] = DENSITY;
        let cross = g * dt * dt / 2.0;
        Matrix2::new(f * dt + g * dt.powi(3) / 3.0, cross, cross, g * dt)
    }
}

impl ProcessType for Clock {
    const TYPE: &'static str = "clock";
    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        let mut state = |name: &str, sigma: f64| {
            composer.block::<Scalar>(
                name,
                BlockSpec {
                    mode: Mode::Estimate,
                    initial: vec![0.0],
                    sigma: vec![sigma],
                    truth: None,
                    dynamics: Dynamics::Constant,
                    display: Display { unit: "m", scale: 1.0, components: &["clock"] },
                },
            )
        };
        let states = [state("offset", 10.0)?, state("drift", 1.0)?];
        let [b, d] = states.map(|state| composer.tangent(state));
        let t = composer.transition();
        let phi = [t.phi(b, b), t.phi(b, d), t.phi(d, d)];
        Ok(BuiltProcess::new(ClockModel {
            wanders: !self.no_truth,
            states,
            phi,
            noise: t.noise(b),
        }))
    }
}

impl ProcessModel for ClockModel {
    fn propagate(
        &mut self,
        layout: &Layout,
        state: &mut State,
        interval: &Interval<'_>,
        transition: &mut Transition,
    ) -> Result<(), ProcessError> {
        let (dt, [b, d]) = (interval.duration(), self.states);
        let offset = state.get(layout, b) + dt * state.get(layout, d);
        state.set(layout, b, &offset);
        for (place, value) in self.phi.iter().zip([1.0, dt, 1.0]) {
            transition.set(*place, &SMatrix::from([[value]]));
        }
        transition.set_noise(self.noise, &Self::covariance(dt));
        Ok(())
    }
    fn follow(&self, _: &Layout, _: &Motion, _: &mut State, _: &mut [bool]) {}
    fn wander(
        &mut self,
        layout: &Layout,
        truth: &mut State,
        known: &mut [bool],
        dt: f64,
        random: &mut Random,
    ) {
        if !self.wanders {
            return;
        }
        let [b, d] = self.states;
        let root = Self::covariance(dt).cholesky().map_or_else(Matrix2::zeros, |c| c.l());
        let noise = root * SVector::from([random.normal(), random.normal()]);
        let (offset, drift) = (truth.get(layout, b), truth.get(layout, d));
        truth.set(layout, b, &(offset + dt * drift + noise.x));
        truth.set(layout, d, &(drift + noise.y));
        known[b.slot()] = true;
        known[d.slot()] = true;
    }
    fn boxed_clone(&self) -> Box<dyn ProcessModel> {
        Box::new(self.clone())
    }
}

/// Comparison of the receiver's clock with a better one.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Comparison {
    /// State that is compared.
    #[serde(default = "offset")]
    of: String,
}

fn offset() -> String {
    "offset".into()
}

struct Offset(Handle<Scalar>);

impl SensorType for Comparison {
    const TYPE: &'static str = "comparison";
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("offset", "m")]
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        Ok(Role::measurement(Offset(composer.find("of", &format!("clock.{}", self.of))?)))
    }
}

impl MeasurementModel<1> for Offset {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 1> {
        SVector::from([x.get(self.0)])
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 1, 1> {
        SMatrix::from([[4.0]])
    }
}

/// A float: its place and velocity along one line, pushed by white acceleration.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Float {}

#[derive(Clone)]
struct FloatStep([Handle<Scalar>; 2]);

impl ProcessType for Float {
    const TYPE: &'static str = "float";
    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        let mut state = |name: &str, sigma: f64| {
            let display = Display { unit: "m", scale: 1.0, components: &["float"] };
            let (mode, dynamics) = (Mode::Estimate, Dynamics::Constant);
            let (initial, sigma) = (vec![0.0], vec![sigma]);
            let spec = BlockSpec { mode, initial, sigma, truth: None, dynamics, display };
            composer.block::<Scalar>(name, spec)
        };
        let states = [state("place", 10.0)?, state("velocity", 1.0)?];
        Ok(composer.step(FloatStep(states)))
    }
}

impl Step for FloatStep {
    fn step<T: Real>(
        &self,
        x: &View<'_, T>,
        _: Option<&Input<'_>>,
        dt: f64,
        next: &mut Moved<'_, T>,
    ) {
        let [place, velocity] = self.0;
        let speed = x.get(velocity);
        next.set(place, &(x.get(place) + speed * convert(dt)));
        next.set(velocity, &speed);
    }
    fn noise(&self, _: &View<'_, f64>, noise: &mut Densities<'_>) {
        noise.white(self.0[1], &[1.0]);
    }
    fn follow(&self, layout: &Layout, _: &Motion, state: &mut State, known: &mut [bool]) {
        self.0.iter().for_each(|block| {
            state.set(layout, *block, &0.0);
            known[block.slot()] = true;
        });
    }
}

/// The plugins of this file.
fn registry() -> Registry {
    let mut registry = Registry::new();
    registry.add(&navfuse_ins::InsPlugin).add(&navfuse_simulation::SimulationPlugin);
    registry.add(&navfuse_gnss::GnssPlugin);
    registry.sensor::<VisualOdometry>();
    registry.sensor::<crate::ping::TwoWay>();
    registry.sensor::<crate::ping::Axes>();
    registry.sensor::<Comparison>();
    registry.process::<Clock>();
    registry.process::<Float>();
    registry
}

/// Runs a scenario with the plugins of this file.
pub fn run(text: &str, settings: &[String]) -> (Finished, Judge) {
    let registry = registry();
    let (finished, judge) = judged(&registry, text, settings);
    assert!(finished.error.is_none(), "{:?}", finished.error);
    (finished, judge)
}

/// Mean NEES at the end and mean NIS of a number of runs, each divided by its degrees of freedom.
pub fn consistency(text: &str, runs: u64, freedom: (usize, usize)) -> [f64; 2] {
    let (mut nees, mut nis) = (0.0, (0.0, 0));
    for seed in 1..=runs {
        let (_, judge) = run(text, &[format!("seed={seed}")]);
        assert_eq!((judge.freedom, judge.refused), (freedom.0, 0), "seed {seed}");
        nees += judge.nees;
        nis = (nis.0 + judge.nis.iter().map(|(_, nis)| nis).sum::<f64>(), nis.1 + judge.nis.len());
    }
    [nees / (runs as usize * freedom.0) as f64, nis.0 / (nis.1 * freedom.1) as f64]
}

const CAMERA: &str = r#"
[estimator]
draw = "all"
[process.ins]
attitude = { sigma = ["0.3 deg", "0.3 deg", "1 deg"] }
velocity = { sigma = "0.2 m/s" }
position = { sigma = "1 m" }
gyro_bias = { sigma = "20 deg/h" }
accel_bias = { sigma = "2000 ug" }
[sensor.imu]
gyro_noise = "10 deg/h/sqrt(Hz)"
accel_noise = "100 ug/sqrt(Hz)"
simulation = { rate = "50 Hz" }
[sensor.camera]
type = "visual-odometry"
translation = "1 cm"
rotation = "0.05 deg"
gate = "off"
simulation = { rate = "4 Hz" }
[sensor.reference]
simulation = { rate = "1 Hz" }
[source.simulation.start]
latitude = "30 deg"
heading = "20 deg"
[[source.simulation.segments]]
type = "surge"
duration = "15 s"
speed = "2 m/s"
[[source.simulation.segments]]
type = "turn"
duration = "20 s"
angle = "90 deg"
bank = "8 deg"
[[source.simulation.segments]]
type = "cruise"
duration = "25 s"
"#;

/// Over 30 runs the mean of a chi-square of 15 has a sigma of sqrt(2 / (30 * 15)) = 0.067 of its
/// mean, and that of 30 * 235 updates of 6 channels one of sqrt(2 / (7050 * 6)) = 0.0069. The bands
/// are 3.3 sigma. An update that took the past for exact would be far outside: it would ignore that
/// each error of a pose enters two updates.
#[test]
fn visual_odometry_with_past_poses_is_consistent() {
    let [anees, anis] = consistency(CAMERA, 30, (15, 6));
    println!("ANEES {anees:.3}, ANIS {anis:.4}");
    assert!((anees - 1.0).abs() < 0.22, "{anees}");
    assert!((anis - 1.0).abs() < 0.023, "{anis}");
    let (finished, judge) = run(CAMERA, &[]);
    // the filter starts with the reference of 1 s, and the image after it begins the chain
    let camera = &finished.summary.samples["camera"];
    assert_eq!((&camera["read"], &camera["accepted"]), (&241.into(), &235.into()), "{camera}");
    assert_eq!(judge.nis.len(), 235);
}

/// Four images measure from each keyframe. The bands are those of the test above, with 30 * 232
/// updates: the first keyframe after the start is that of 2 s, the ninth of 241 images.
#[test]
fn visual_odometry_from_keyframes_is_consistent() {
    let text = CAMERA.replace("[sensor.camera]", "[sensor.camera]\nkeyframes = \"1 s\"");
    let [anees, anis] = consistency(&text, 30, (15, 6));
    println!("ANEES {anees:.3}, ANIS {anis:.4}");
    assert!((anees - 1.0).abs() < 0.22, "{anees}");
    assert!((anis - 1.0).abs() < 0.023, "{anis}");
    // three images between keyframes that the filter does not use cost nothing else
    let exclude = "sensor.camera.exclude=[[\"30.1 s\", \"30.9 s\"]]".to_owned();
    let (finished, _) = run(&text, &[exclude]);
    let camera = &finished.summary.samples["camera"];
    assert_eq!((&camera["accepted"], &camera["excluded"]), (&229.into(), &3.into()), "{camera}");
}

#[test]
fn a_sample_that_is_rejected_unseen_breaks_the_chain_of_past_states() {
    // the images of 30 s to 35 s are not used: the first one after it begins a new chain
    let exclude = "sensor.camera.exclude=[[\"30 s\", \"35 s\"]]".to_owned();
    let (finished, judge) = run(CAMERA, &[exclude]);
    let camera = &finished.summary.samples["camera"];
    assert_eq!((&camera["accepted"], &camera["excluded"]), (&214.into(), &20.into()), "{camera}");
    let nis: Vec<f64> =
        judge.nis.iter().map(|(_, nis)| *nis).filter(|nis| nis.is_finite()).collect();
    // no update spans the gap, in which the vehicle moved by 10 m: a chi-square of 6 exceeds 40 once
    // in two million samples
    assert!(nis.len() == 214 && nis.iter().all(|nis| *nis < 40.0), "{nis:?}");
}

#[test]
fn a_sensor_with_a_past_state_has_no_time_offset() {
    let mut registry = Registry::new();
    registry.add(&navfuse_ins::InsPlugin).add(&navfuse_simulation::SimulationPlugin);
    registry.sensor::<VisualOdometry>();
    let document = Document::parse("past.toml", CAMERA).unwrap();
    let offset = "sensor.camera.time_offset={ sigma = \"0.1 s\" }".to_owned();
    let scenario = Scenario::new(&registry, document, &[offset]).unwrap();
    let text = scenario.compose().map(|_| ()).unwrap_err().to_string();
    assert!(text.contains("cannot have a time offset: the past state is copied"), "{text}");
    assert!(text.contains("samples = { clock = "), "{text}");
}

const RECEIVER: &str = r#"
[estimator]
draw = "all"
initial = "given"
[process.clock]
[sensor.comparison]
gate = "off"
simulation = { rate = "1 Hz" }
[source.simulation.start]
latitude = "30 deg"
[[source.simulation.segments]]
type = "static"
duration = "120 s"
"#;

/// 60 runs: the sigma of the mean NEES is sqrt(2 / (60 * 2)) = 0.13, that of the mean NIS of 121
/// updates sqrt(2 / (60 * 121)) = 0.017; 3.3 sigma.
#[test]
fn a_clock_whose_truth_wanders_is_judged_by_it() {
    let [anees, anis] = consistency(RECEIVER, 60, (2, 1));
    assert!((anees - 1.0).abs() < 0.43, "{anees}");
    assert!((anis - 1.0).abs() < 0.056, "{anis}");
    let (_, judge) = run(RECEIVER, &[]);
    // the drift alone has a sigma of sqrt(0.01 * 120) = 1.1 m/s at the end
    let (first, last) = (judge.truths[0], judge.truths[judge.truths.len() - 1]);
    assert!((last - first).abs() > 3.0, "{first} {last}");
}

/// A float that its trajectory leaves at rest, at sea, whose place is compared once a second. 60 runs,
/// as above.
#[test]
fn a_truth_that_moves_by_the_process_is_a_draw_of_its_noise() {
    let float = RECEIVER.replace("[process.clock]", "[process.clock]\ntype = \"float\"");
    let float = float.replace("[sensor.comparison]", "[sensor.comparison]\nof = \"place\"");
    let wandering = float.replace("\"float\"", "\"float\"\nwander = true");
    let [anees, anis] = consistency(&wandering, 60, (2, 1));
    assert!((anees - 1.0).abs() < 0.43, "{anees}");
    assert!((anis - 1.0).abs() < 0.056, "{anis}");
    // the trajectory is no draw of the acceleration of 1 m/s^2/sqrt(Hz): 200 runs of the textbook's
    // filter have a mean NIS of 0.75, with a sigma of 0.10 in each
    let reference =
        "[sensor.reference]\nsimulation = { rate = \"1 Hz\" }\n[source.simulation.start]";
    let followed = float.replace("[source.simulation.start]", reference);
    let [_, anis] = consistency(&followed, 20, (2, 1));
    assert!((anis - 0.75).abs() < 0.08, "{anis}");
    // without the draw the truth moves as well, and without noise
    let (finished, judge) = run(&wandering, &["estimator.draw=\"nothing\"".to_owned()]);
    assert!(finished.summary.rows.iter().all(|row| row.error.is_some()));
    assert!(judge.truths.iter().all(|truth| *truth == 0.0));
}

#[test]
fn the_truth_of_a_driven_process_does_not_wander() {
    let document = Document::parse("past.toml", CAMERA).unwrap();
    let registry = registry();
    let wander = ["process.ins.wander=true".to_owned()];
    let text = Scenario::new(&registry, document, &wander).unwrap().compose();
    let text = text.map(|_| ()).unwrap_err().to_string();
    assert!(text.contains("a process of type ins does not move the truth"), "{text}");
}

#[test]
fn a_block_without_a_truth_is_judged_by_nobody() {
    let (finished, judge) = run(RECEIVER, &["process.clock.no_truth=true".to_owned()]);
    assert!(judge.truths.is_empty(), "no epoch has a truth");
    for row in &finished.summary.rows {
        assert!(row.error.is_none(), "{}", row.name);
    }
    // without the draw, its truth is at rest as well, and nobody takes that for its truth
    let (finished, _) = run(RECEIVER, &["estimator.draw=\"nothing\"".to_owned()]);
    assert!(finished.summary.rows.iter().all(|row| row.error.is_none()));
}

/// A camera whose previous image is a clone of attitude and position, taken anew at each image.
#[test]
fn a_step_with_past_states_allocates_nothing() {
    let found =
        allocations(&registry(), CAMERA, 5.0, |step| allocation_counter::measure(step).count_total);
    assert!(found.accepted > 200 && found.reporting == 0, "{found:?}");
    assert_eq!(found.silent.1, 0, "{found:?}");
}

const SLOW_GNSS: &str = r#"
[sensor.gnss]
horizontal_noise = "1 m"
vertical_noise = "2 m"
time_offset = { sigma = "100 ms", truth = "60 ms" }
late = "3 s"
simulation = { rate = "2 Hz" }
"#;

/// Steps, estimates and smoothed estimates.
fn smoothed(text: &str, settings: &[&str]) -> (Records, Finished) {
    let document = Document::parse("past.toml", text).unwrap();
    let settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
    let registry = registry();
    let scenario = Scenario::new(&registry, document, &settings).unwrap();
    let mut assembly = scenario.assemble(None).unwrap();
    assembly.sinks.push(("records".into(), Box::<Records>::default()));
    let mut finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    (finished.take_sink().unwrap(), finished)
}

/// A camera that measures from its previous image, and a GNSS receiver whose fixes show the place of
/// 60 ms ago and arrive 1 s late.
#[test]
fn past_states_beside_late_samples_and_a_time_offset_are_smoothed_as_in_the_textbook() {
    let short = ["estimator.stop=\"21 s\"", "estimator.output_rate=\"2 Hz\""];
    let slow = ["sensor.imu.simulation.rate=\"20 Hz\"", "estimator.initial=\"reference\""];
    let base = [short, slow].concat();
    let delay = "sensor.gnss.delay={ mean = \"1 s\", sigma = \"0.3 s\" }";
    let keyframes = "sensor.camera.keyframes=\"1 s\"";
    let text = format!("{CAMERA}{SLOW_GNSS}");
    for camera in [&[][..], &[keyframes]] {
        let with = |more: &[&str]| smoothed(&text, &[&base[..], camera, more].concat());
        let (records, finished) = with(&["estimator.smooth=true", delay]);
        let [gnss, camera] = ["gnss", "camera"].map(|name| &finished.summary.samples[name]);
        assert!(gnss["accepted"].as_u64() > Some(30), "{gnss}");
        assert!(camera["accepted"].as_u64() > Some(60), "{camera}");
        let (worst, spread) = records.differences(records.projected());
        assert!(worst < 1e-6 && spread < 1e-6, "{worst} {spread}");
        // late samples take their place before they are smoothed
        let (in_order, _) = with(&["estimator.smooth=true"]);
        assert_eq!(in_order.smoothed.len(), records.smoothed.len());
        for (one, other) in in_order.smoothed.iter().zip(&records.smoothed) {
            assert_eq!((&one.state, &one.covariance), (&other.state, &other.covariance));
        }
        let (further, finished) = with(&["estimator.passes=10", delay]);
        let passes = finished.summary.smoothing.unwrap().passes.unwrap();
        assert!(passes.converged, "{passes:?}");
        // the past of an image is the smoothed pose of the image before, in the last pass too
        assert_eq!(further.smoothed.len(), records.smoothed.len());
    }
}
