//! Several driving sensors: a second IMU, and a model of the thrusters that carries the vehicle
//! through an outage of the IMU, as outsiders would write them.

use navfuse_core::model::sensor::motion::Motion;
use navfuse_core::model::simulate::{Random, Simulate};
use navfuse_core::prelude::*;
use navfuse_core::session::Finished;
use navfuse_ins::Navigation;
use navfuse_testing::judge::{Judge, judged};
use navfuse_testing::steps::allocations;
use std::fmt::Write;

/// Thrust over mass: the command, which holds until the next one.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Thruster {
    /// 1-sigma of each command.
    noise: Sigma<Acceleration>,
}

impl SensorType for Thruster {
    const TYPE: &'static str = "thruster";
    const INPUT: bool = true;
    fn channels(&self) -> Vec<Channel> {
        vec![Channel::new("thrust", "mps2")]
    }
    fn build(self, _: &mut Composer) -> Result<Role, ComposeError> {
        Ok(Role::Input(Box::new(self)))
    }
}

/// Drag over mass, 1/s.
const DRAG: f64 = 0.05;

/// Surge of a vehicle: `du/dt = thrust - DRAG u`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Surge {}

#[derive(Clone)]
struct SurgeModel {
    speed: Handle<Scalar>,
    phi: PhiSlot<1, 1>,
    q: NoiseSlot<1>,
    noise: f64,
}

impl ProcessType for Surge {
    const TYPE: &'static str = "thrusters";
    fn build(self, composer: &mut Composer) -> Result<BuiltProcess, ComposeError> {
        let noise = composer.input::<Thruster>("thruster", "thruster")?.noise.value().si();
        let spec = BlockSpec {
            mode: Mode::Estimate,
            initial: vec![0.0],
            sigma: vec![0.1],
            truth: None,
            dynamics: Dynamics::Constant,
            display: Display { unit: "m/s", scale: 1.0, components: &["forward"] },
        };
        let speed = composer.block::<Scalar>("speed", spec)?;
        let row = composer.tangent(speed);
        let t = composer.transition();
        let model = SurgeModel { speed, phi: t.phi(row, row), q: t.noise(row), noise };
        Ok(BuiltProcess::new(model).driven_by("thruster", Commands { noise }))
    }
}

impl ProcessModel for SurgeModel {
    fn propagate(
        &mut self,
        layout: &Layout,
        state: &mut State,
        interval: &Interval<'_>,
        transition: &mut Transition,
    ) -> Result<(), ProcessError> {
        let dt = interval.duration();
        let decay = (-DRAG * dt).exp();
        let held = interval.input.map(|input| (input.sample.get(0), input.duration));
        // before the first command, the speed is that of the start
        let (Some(thrust), whole) = held.unwrap_or((Some(0.0), 0.0)) else {
            return Err(ProcessError::input("a command without thrust"));
        };
        let speed = state.get(layout, self.speed) * decay + thrust * (1.0 - decay) / DRAG;
        state.set(layout, self.speed, &speed);
        transition.set(self.phi, &SMatrix::from([[decay]]));
        // the error of a command lasts: the parts of its interval add up to (noise * whole)^2
        transition.set_noise(self.q, &SMatrix::from([[self.noise.powi(2) * dt * whole]]));
        Ok(())
    }
    fn follow(&self, layout: &Layout, motion: &Motion, state: &mut State, known: &mut [bool]) {
        state.set(layout, self.speed, &forward(motion));
        known[self.speed.slot()] = true;
    }
    fn boxed_clone(&self) -> Box<dyn ProcessModel> {
        Box::new(self.clone())
    }
}

fn forward(motion: &Motion) -> f64 {
    (motion.c_b_n.inverse() * motion.velocity).x
}

#[derive(Clone)]
struct Commands {
    noise: f64,
}

impl Simulate for Commands {
    fn simulate(&self, scene: &mut Scene<'_>, sample: &mut Sample) {
        // the command at `to` moves the vehicle from there on, for one interval
        let (from, to) = (scene.to, scene.to + (scene.to - scene.from));
        let (before, after) =
            (forward(&scene.trajectory.at(from)), forward(&scene.trajectory.at(to)));
        let decay = (-DRAG * to.since(from)).exp();
        let thrust = (after - before * decay) * DRAG / (1.0 - decay);
        sample.set(0, thrust + self.noise * scene.noise * scene.random.normal());
    }
    fn boxed_clone(&self) -> Box<dyn Simulate> {
        Box::new(self.clone())
    }
}

/// Difference between two velocities, which is zero but for noise: that of the INS in body axes, and
/// the speed of the thrusters or the velocity of a second INS.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Tie {
    noise: Sigma<Speed>,
    #[serde(default)]
    second: bool,
}

struct TieModel {
    noise: f64,
    first: Navigation,
    speed: Option<Handle<Scalar>>,
    second: Option<Navigation>,
}

impl SensorType for Tie {
    const TYPE: &'static str = "tie";
    fn channels(&self) -> Vec<Channel> {
        ["x", "y", "z"].map(|name| Channel::new(name, "mps")).to_vec()
    }
    fn build(self, composer: &mut Composer) -> Result<Role, ComposeError> {
        let second = self.second.then(|| Navigation::find(composer, "second", "other"));
        let speed = (!self.second).then(|| composer.find("second", "thrusters.speed"));
        Ok(Role::measurement(TieModel {
            noise: self.noise.value().si(),
            first: Navigation::find(composer, "ins", "ins")?,
            speed: speed.transpose()?,
            second: second.transpose()?,
        }))
    }
}

impl MeasurementModel<3> for TieModel {
    fn predict<T: Real>(&self, x: &View<'_, T>) -> SVector<T, 3> {
        let body = |n: &Navigation| x.get(n.attitude).inverse() * x.get(n.velocity);
        let speed = self.speed.map_or_else(T::zero, |speed| x.get(speed));
        let other = self.second.as_ref().map_or_else(Vector3::zeros, body);
        body(&self.first) - other - Vector3::new(speed, T::zero(), T::zero())
    }
    fn noise(&self, _: &View<'_, f64>) -> SMatrix<f64, 3, 3> {
        SMatrix::identity() * self.noise.powi(2)
    }
}

/// The plugins of this file.
fn registry() -> Registry {
    let mut registry = Registry::new();
    registry.add(&navfuse_ins::InsPlugin).add(&navfuse_simulation::SimulationPlugin);
    registry.sensor::<Thruster>();
    registry.sensor::<Tie>();
    registry.process::<Surge>();
    registry
}

/// Runs a scenario; the updates are those with an innovation.
fn run(text: &str, settings: &[String]) -> (Finished, Judge) {
    let (finished, mut judge) = judged(&registry(), text, settings);
    judge.nis.retain(|(_, nis)| nis.is_finite());
    (finished, judge)
}

const INS: &str = r#"
[estimator]
draw = "all"
[process.ins]
attitude = { sigma = ["0.3 deg", "0.3 deg", "1 deg"] }
velocity = { sigma = "0.1 m/s" }
position = { sigma = "1 m" }
gyro_bias = { sigma = "20 deg/h" }
accel_bias = { sigma = "500 ug" }
[sensor.imu]
gyro_noise = "10 deg/h/sqrt(Hz)"
accel_noise = "100 ug/sqrt(Hz)"
simulation = { rate = "50 Hz" }
[sensor.tie]
noise = "5 cm/s"
gate = "off"
simulation = { rate = "2 Hz" }
[sensor.reference]
simulation = { rate = "1 Hz" }
[source.simulation.start]
latitude = "30 deg"
heading = "20 deg"
"#;

const MOTION: &str = r#"
[[source.simulation.segments]]
type = "surge"
duration = "20 s"
speed = "1.5 m/s"
[[source.simulation.segments]]
type = "turn"
duration = "20 s"
angle = "60 deg"
"#;

/// The vehicle while its IMU is silent from 40 s to 100 s: it changes its heading by a draw from
/// N(0, (1 deg)^2 * 5 s) in every 5 s, as `coast` assumes, and its speed twice.
fn outage(seed: u64) -> String {
    let mut text = INS.to_owned();
    text += r#"
[process.thrusters]
[sensor.thruster]
noise = "2 cm/s^2"
simulation = { rate = "5 Hz" }
"#;
    text += MOTION;
    let mut random = Random::new(seed, "turns");
    for k in 0..14 {
        let angle = 5.0_f64.sqrt() * random.normal();
        let segment = "[[source.simulation.segments]]";
        writeln!(text, "{segment}\ntype = \"turn\"\nduration = \"5 s\"\nangle = \"{angle} deg\"")
            .unwrap();
        if k == 5 {
            writeln!(text, "{segment}\ntype = \"surge\"\nduration = \"5 s\"\nspeed = \"2 m/s\"")
                .unwrap();
        }
    }
    text
}

const COAST: [&str; 3] = [
    "sensor.imu.simulation.outages=[[\"40 s\", \"100 s\"]]",
    "sensor.imu.coast={ turn = [\"0.01 deg/s/sqrt(Hz)\", \"0.01 deg/s/sqrt(Hz)\", \
     \"1 deg/s/sqrt(Hz)\"], acceleration = \"0.2 m/s^2/sqrt(Hz)\" }",
    "estimator.stop=99.5 s",
];

fn settings(values: &[&str], seed: u64) -> Vec<String> {
    values.iter().map(|v| (*v).to_owned()).chain([format!("seed={seed}")]).collect()
}

/// 30 runs that end at 99 s, when the IMU has been silent for 59 s: 16 known states, so the mean NEES
/// has a sigma of sqrt(2 / (30 * 16)) = 0.065 of its mean. The mean NIS of the 77 updates of 3
/// channels before the gap has one of sqrt(2 / (30 * 77 * 3)) = 0.017. In the gap it is smaller than
/// one, since `acceleration` is a bound on the motion, and the vehicle of this test has no vertical
/// motion at all; there the test holds that it is not larger.
#[test]
fn a_model_of_the_thrusters_carries_the_vehicle_through_60_s_without_an_imu() {
    let (mut nees, mut before, mut within) = (0.0, Vec::new(), Vec::new());
    for seed in 1..=30 {
        let (finished, judge) = run(&outage(seed), &settings(&COAST, seed));
        assert!(finished.error.is_none(), "{:?}", finished.error);
        // time goes on with the measurements, and the last one waits for a later sample
        assert_eq!((judge.freedom, judge.last, judge.refused), (16, 99.0, 1), "seed {seed}");
        nees += judge.nees / (30.0 * 16.0);
        for (time, nis) in judge.nis {
            if time < 40.0 { before.push(nis) } else { within.push(nis) }
        }
    }
    let mean = |nis: &[f64]| nis.iter().sum::<f64>() / (3 * nis.len()) as f64;
    let (before, within) = (mean(&before), mean(&within));
    println!("ANEES {nees:.3}, ANIS {before:.4} before the gap, {within:.4} in it");
    assert!((nees - 1.0).abs() < 0.22, "{nees}");
    assert!((before - 1.0).abs() < 0.057 && within < 1.0, "{before} {within}");
}

#[test]
fn without_coast_the_gap_ends_the_run_and_with_it_the_imu_takes_over_again() {
    let stop = "estimator.stop=110 s";
    let (finished, _) = run(&outage(1), &settings(&[COAST[0], stop], 1));
    let error = finished.error.unwrap().to_string();
    assert!(error.contains("max_gap"), "{error}");
    let (finished, judge) = run(&outage(1), &settings(&[COAST[0], COAST[1], stop], 1));
    assert!(finished.error.is_none(), "{:?}", finished.error);
    let told = finished.events.iter().filter(|e| e.text.contains("the process coasted")).count();
    assert_eq!((told, judge.last), (1, 110.0));
    // chi-square of 16: beyond 45 in one run of ten thousand
    assert!(judge.nees < 45.0, "{}", judge.nees);
    let imu = &finished.summary.samples["imu"];
    assert!(imu["rejected"].as_u64().unwrap() <= 1, "{imu}");
}

/// The IMU begins at 10 s. The reference is there at 0 s, and again from 20 s on. The estimate at 39 s
/// has 16 known states: chi-square is beyond 45 in one run of ten thousand.
#[test]
fn a_process_that_coasts_comes_from_a_reference_to_its_first_sample() {
    let late = [
        "sensor.imu.simulation.outages=[[\"0 s\", \"10 s\"]]",
        "sensor.reference.simulation.outages=[[\"0.5 s\", \"19.5 s\"]]",
        "estimator.stop=39 s",
    ];
    let (waited, _) = run(&outage(1), &settings(&late, 1));
    assert_eq!(waited.summary.duration_s, 19.0, "from the second reference on");
    let (finished, judge) = run(&outage(1), &settings(&[&late[..], &COAST[1..2]].concat(), 1));
    assert!(finished.error.is_none(), "{:?}", finished.error);
    assert_eq!((finished.summary.duration_s, judge.last), (39.0, 39.0));
    assert!(judge.nees < 45.0, "{}", judge.nees);
}

/// A second IMU of its own rate drives a second INS; the tie holds the two together.
fn two_imus() -> String {
    let mut text = INS.replace("[sensor.tie]", "[sensor.tie]\nsecond = true");
    text += r#"
[process.other]
type = "ins"
imu = "second"
attitude = { sigma = ["0.3 deg", "0.3 deg", "1 deg"] }
velocity = { sigma = "0.1 m/s" }
position = { sigma = "1 m" }
gyro_bias = { sigma = "20 deg/h" }
accel_bias = { sigma = "500 ug" }
[sensor.second]
type = "imu"
gyro_noise = "10 deg/h/sqrt(Hz)"
accel_noise = "100 ug/sqrt(Hz)"
simulation = { rate = "80 Hz" }
"#;
    text + MOTION
}

#[test]
fn a_step_with_a_second_driver_allocates_nothing() {
    let found = allocations(&registry(), &two_imus(), 5.0, |step| {
        allocation_counter::measure(step).count_total
    });
    assert!(found.accepted > 60 && found.reporting == 0, "{found:?}");
    assert!(found.silent.0 > 4500, "both IMUs, 50 and 80 Hz over 35 s: {found:?}");
    assert_eq!(found.silent.1, 0, "{found:?}");
}

#[test]
fn a_second_imu_drives_a_second_process() {
    let text = two_imus();
    let (mut nees, mut nis, mut count) = (0.0, 0.0, 0);
    for seed in 1..=30 {
        let (finished, judge) = run(&text, &settings(&[], seed));
        assert!(finished.error.is_none(), "{:?}", finished.error);
        assert_eq!((judge.freedom, judge.refused), (30, 0), "seed {seed}");
        assert!(finished.summary.samples["second"]["used"].as_u64().unwrap() > 3000);
        nees += judge.nees / (30.0 * 30.0);
        nis += judge.nis.iter().map(|(_, nis)| nis).sum::<f64>();
        count += judge.nis.len();
    }
    let nis = nis / (3 * count) as f64;
    println!("ANEES {nees:.3}, ANIS {nis:.4}, {count} updates");
    // sigma: sqrt(2 / (30 * 30)) = 0.047, and sqrt(2 / (30 * 77 * 3)) = 0.017; 3.3 sigma
    assert!((nees - 1.0).abs() < 0.16, "{nees}");
    assert!((nis - 1.0).abs() < 0.057, "{nis}");
}
