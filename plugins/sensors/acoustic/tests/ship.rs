//! A ship with a navigation of its own: its pose at the time of a fix, and the errors of this pose.
#![allow(clippy::unwrap_used, missing_docs, reason = "a test fails by panicking")]

use navfuse_acoustic::Course;
use navfuse_core::model::record::{Epoch, Record, Wants};
use navfuse_core::model::sensor::body::{Pose, Track};
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::nalgebra::Vector3;
use navfuse_core::run::runner;
use navfuse_core::session::Finished;
use navfuse_core::units::time::Time;
use navfuse_testing::scenario;
use std::sync::atomic::AtomicBool;

/// A vehicle 60 m below a ship that turns in a swell of 3 deg.
const SCENARIO: &str = r#"
[estimator]
draw = "all"

[process.ins]
attitude = { sigma = ["0.1 deg", "0.1 deg", "0.3 deg"] }
velocity = { sigma = "5 cm/s" }
position = { sigma = "2 m" }
gyro_bias = { sigma = "1 deg/h" }
accel_bias = { sigma = "100 ug" }

[process.ship]
position = { sigma = "50 cm", correlation_time = "10 min" }
attitude = { sigma = ["0.1 deg", "0.1 deg", "0.5 deg"], correlation_time = "30 min" }

[sensor.imu]
gyro_noise = "1 deg/h/sqrt(Hz)"
accel_noise = "50 ug/sqrt(Hz)"
simulation = { rate = "20 Hz" }

[sensor.ship-navigation]
simulation = { rate = "5 Hz", latitude = "43.001 deg", longitude = "5.0005 deg", heading = "40 deg", speed = "1 m/s", turn = "0.5 deg/s", swell = "3 deg" }

[sensor.usbl]
ship = "ship"
range_noise = "10 cm"
angle_noise = "0.1 deg"
misalignment = { sigma = "0.2 deg" }
transceiver = ["10 m", "-3 m", "5 m"]
late = "4 s"
simulation = { rate = "0.5 Hz", offset = "0.33 s" }

[sensor.dvl]
noise = "1 cm/s"
simulation = { rate = "2 Hz", offset = "0.1 s" }

[sensor.depth]
noise = "5 cm"
simulation = { rate = "1 Hz", offset = "0.2 s" }

[sensor.reference]
simulation = { rate = "1 Hz" }

[source.simulation]
start = { latitude = "43 deg", longitude = "5 deg", height = "-60 m", heading = "30 deg" }
segments = [
    { type = "surge", duration = "20 s", speed = "2 m/s" },
    { type = "square", duration = "270 s", turn = "20 s", bank = "5 deg", pitch = "1 deg" },
]
"#;

/// The poses that the fixes had, and the last estimate with its errors in sigma.
#[derive(Default)]
struct Watch {
    usbl: usize,
    poses: Vec<(Time, Option<Pose>)>,
    bits: Vec<u64>,
    /// Names of the blocks of the ship, with the squares of their errors in sigma.
    errors: Vec<(String, f64)>,
}

impl Watch {
    fn epoch(&mut self, epoch: &Epoch<'_>) {
        self.bits = epoch.state.values.iter().map(|value| value.to_bits()).collect();
        let Some(truth) = epoch.truth else { return };
        self.errors.clear();
        for block in epoch.layout.blocks.iter().filter(|b| b.name.starts_with("ship.")) {
            let (Some(first), mut off) = (block.tangent, [0.0; 3]) else { continue };
            let range = block.range();
            (block.operations.local)(
                &truth.state.values[range.clone()],
                &epoch.state.values[range],
                &mut off,
            );
            for (k, off) in off.into_iter().enumerate() {
                let variance = epoch.covariance.get(first + k, first + k);
                self.errors.push((block.name.clone(), off * off / variance));
            }
        }
    }
}

impl Sink for Watch {
    fn wants(&self) -> Wants {
        Wants::EPOCHS | Wants::SAMPLES
    }
    fn start(&mut self, info: &RunInfo) -> Result<(), StreamError> {
        self.usbl = info.sensors.iter().position(|s| s.name == "usbl").unwrap();
        assert_eq!(info.layout.bodies[0].sensor, "ship-navigation");
        Ok(())
    }
    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        match *record {
            Record::Epoch(epoch) => self.epoch(epoch),
            Record::Sample(sample) if sample.sensor.0 == self.usbl => {
                self.poses.push((sample.time, Pose::of(sample, 3)));
            }
            _ => {}
        }
        Ok(())
    }
}

fn run(settings: &[&str]) -> (Finished, Watch) {
    run_text(SCENARIO, settings)
}

fn run_text(text: &str, settings: &[&str]) -> (Finished, Watch) {
    scenario(text, settings, |scenario| {
        let mut assembly = scenario.assemble(None).unwrap();
        assembly.sinks.push(("watch".into(), Box::new(Watch::default())));
        let mut finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
        assert!(finished.error.is_none(), "{:?}", finished.error);
        let watch = finished.take_sink::<Watch>().unwrap();
        (finished, watch)
    })
}

const EXACT: [&str; 2] = [
    "process.ship.position={ truth = [\"0 m\", \"0 m\", \"0 m\"] }",
    "process.ship.attitude={ truth = [\"0 deg\", \"0 deg\", \"0 deg\"] }",
];

fn course() -> Course {
    let keys = serde_json::json!({
        "latitude": "43.001 deg", "longitude": "5.0005 deg", "heading": "40 deg",
        "speed": "1 m/s", "turn": "0.5 deg/s", "swell": "3 deg",
    });
    serde_json::from_value(keys).unwrap()
}

/// Between two poses, `h` = 0.2 s apart, a roll `A sin(w t)` of 3 deg and 9 s is off the chord by at
/// most `A w^2 h^2 / 8` = 1.3e-4 rad; the pitch, half of it within 7 s, adds 1.1e-4. The last pose
/// held, as a command is, would be off by `A w h`, 7e-3 rad.
#[test]
fn a_fix_has_the_pose_of_the_ship_at_its_own_time() {
    let (_, watch) = run(&EXACT);
    let (course, mut worst) = (course(), (0.0_f64, 0.0_f64));
    assert!(watch.poses.len() > 130);
    for (time, pose) in &watch.poses[1..] {
        let (pose, truth) = (pose.unwrap(), Track::pose(&course, *time));
        worst.0 = worst.0.max(pose.c_b_n.angle_to(&truth.c_b_n));
        worst.1 = worst.1.max(pose.position.ned_from(&truth.position).norm());
    }
    // the arc of a circle with 1 m/s and 0.5 deg/s is off its chord by v w h^2 / 8, 4e-5 m
    assert!(worst.0 < 1.8e-4 && worst.0 > 2e-5 && worst.1 < 1e-4, "{worst:?}");
}

/// The ship's navigation arrives 1 s late, the fixes 2 s, in another order: nothing changes, to the bit.
#[test]
fn delays_of_fix_and_ship_change_nothing() {
    let (plain, expected) = run(&[]);
    let (delayed, found) = run(&[
        "sensor.usbl.delay={ mean = \"2 s\", sigma = \"0.3 s\" }",
        "sensor.ship-navigation.delay={ mean = \"1 s\" }",
    ]);
    assert_eq!(found.bits, expected.bits);
    assert_eq!(delayed.summary.samples["usbl"], plain.summary.samples["usbl"]);
    assert!(plain.summary.samples["usbl"]["accepted"].as_u64().unwrap() > 130);
}

/// Where the ship's navigation is silent for longer than `max_gap`, the fixes have no pose and are
/// rejected; before and after it they are used.
#[test]
fn a_silent_ship_costs_its_fixes() {
    let outage = "sensor.ship-navigation.simulation.outages=[[\"100 s\", \"140 s\"]]";
    let (finished, watch) = run(&[outage]);
    let without = |(time, pose): &&(Time, Option<Pose>)| {
        (100.0..139.0).contains(&time.seconds()) == pose.is_some()
    };
    // the first fix is before the first pose of the navigation but one
    assert_eq!(watch.poses.iter().filter(without).count(), 0, "{:?}", watch.poses);
    let usbl = &finished.summary.samples["usbl"];
    assert_eq!(usbl["rejected"], 20, "{usbl}");
}

/// Six states of the ship and 10 runs: the mean of 60 squared errors in sigma is 1 with a standard
/// deviation of `sqrt(2/60)` if they were independent, of `sqrt(2/20)` if those of a run were of two.
#[test]
fn the_errors_of_the_ship_are_states_and_consistent() {
    let mut squares = Vec::new();
    for seed in 1..=10 {
        let (_, watch) = run(&[&format!("seed={seed}")]);
        assert_eq!(watch.errors.len(), 6, "{:?}", watch.errors);
        squares.extend(watch.errors.iter().map(|(_, square)| *square));
    }
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    assert!((mean - 1.0).abs() < 3.0 * 0.1_f64.sqrt(), "{mean}");
}

#[test]
fn mistakes_are_named() {
    let error = |settings: &[&str]| {
        let found = scenario(SCENARIO, settings, |s| s.compose().map(|_| ()));
        found.err().map_or_else(String::new, |error| error.to_string())
    };
    let found = error(&["sensor.usbl.ship=\"tender\""]);
    assert!(found.contains("there is no [process.tender]") && found.contains("ship"), "{found}");
    let found = error(&["sensor.usbl.simulation.heading=\"3 deg\""]);
    assert!(found.contains("navigation simulates it"), "{found}");
    let found = error(&["process.ship.navigation=\"imu\""]);
    assert!(found.contains("of another type"), "{found}");
}

/// A circle closes: with 1 m/s and 0.5 deg/s the ship is where it was after 720 s, and its radius is
/// `v / w`, 114.6 m.
#[test]
fn a_turning_ship_goes_in_a_circle() {
    let course = course();
    let at = |seconds: f64| Track::pose(&course, Time::from_seconds(seconds).unwrap()).position;
    let (start, half) = (at(0.0), at(360.0));
    assert!(at(720.0).ned_from(&start).norm() < 1e-6);
    let across: Vector3<f64> = half.ned_from(&start);
    assert!((across.norm() - 229.2).abs() < 0.1, "{across}");
    // to the right of a heading of 40 deg is 130 deg
    assert!((across.y.atan2(across.x).to_degrees() - 130.0).abs() < 0.01, "{across}");
}

/// The ship and its navigation stand before the vehicle and its IMU: the same estimates, to the bit.
#[test]
fn the_tables_stand_in_any_order() {
    let table = |name: &str| {
        let from = SCENARIO.find(name).unwrap();
        let end = SCENARIO[from + 1..].find("\n[").map_or(SCENARIO.len(), |end| from + end + 2);
        &SCENARIO[from..end]
    };
    let first = [table("[process.ship]"), table("[sensor.ship-navigation]")];
    let rest = first.iter().fold(SCENARIO.to_owned(), |text, table| text.replace(table, ""));
    let swapped = format!("{}\n{rest}", first.join("\n"));
    assert!(swapped.find("[process.ship]") < swapped.find("[process.ins]"));
    let short = ["estimator.stop=60 s"];
    let [usual, swapped] = [SCENARIO, &swapped].map(|text| run_text(text, &short).1.bits);
    assert_eq!(usual, swapped);
}
