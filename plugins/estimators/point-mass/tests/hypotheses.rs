//! A position that is known to some 60 m: over a map, beside a beacon, and where nothing decides.
#![allow(clippy::unwrap_used, missing_docs, reason = "a test fails by panicking")]

mod two_way;

use navfuse_core::document::Document;
use navfuse_core::model::record::{Epoch, Record, Wants};
use navfuse_core::model::stream::{RunInfo, Sink, StreamError};
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::session::Finished;
use navfuse_core::state::manifold::Position;
use navfuse_point_mass::PointMassPlugin;
use navfuse_testing::registry;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use two_way::TwoWayPlugin;

const VEHICLE: &str = r#"
[estimator]
type = "point-mass"
draw = "all"

[process.ins]
attitude = { sigma = ["0.2 deg", "0.2 deg", "1 deg"] }
velocity = { sigma = "5 cm/s" }
position = { sigma = ["60 m", "60 m", "1 m"] }
gyro_bias = { sigma = "1 deg/h" }
accel_bias = { sigma = "500 ug" }

[sensor.imu]
gyro_noise = "1.5 deg/h/sqrt(Hz)"
accel_noise = "50 ug/sqrt(Hz)"
simulation = { rate = "20 Hz" }

[sensor.dvl]
noise = "1 cm/s"
simulation = { rate = "2 Hz", offset = "0.03 s" }

[sensor.depth]
noise = "5 cm"
simulation = { rate = "1 Hz", offset = "0.11 s" }

[sensor.reference]
simulation = { rate = "1 Hz" }

[source.simulation.start]
latitude = "43 deg"
longitude = "5 deg"
height = "-70 m"
heading = "30 deg"

[[source.simulation.segments]]
type = "surge"
duration = "20 s"
speed = "2 m/s"
"#;

const SQUARE: &str = r#"
[[source.simulation.segments]]
type = "square"
duration = "280 s"
turn = "20 s"
"#;

const STRAIGHT: &str = r#"
[[source.simulation.segments]]
type = "cruise"
duration = "120 s"
"#;

const BEACON: &str = r#"
[sensor.beacon]
type = "acoustic-range"
noise = "30 cm"
transponder = { latitude = "43.0003 deg", longitude = "5.0000 deg", height = "-110 m" }
simulation = { rate = "0.5 Hz", offset = "0.37 s" }
"#;

const TWO_WAY: &str = r#"
[sensor.two-way]
noise = "15 cm"
transponder = ["43.0003 deg", "5.0000 deg", "-110 m"]
simulation = { rate = "0.5 Hz", offset = "0.37 s" }
"#;

fn altimeter() -> String {
    let map = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../scenarios/survey-bottom.asc");
    format!(
        "\n[sensor.altimeter]\ntype = \"terrain\"\nmap = {:?}\nnoise = \"10 cm\"\nmap_noise = \"30 cm\"\n\
         simulation = {{ rate = \"1 Hz\", offset = \"0.33 s\" }}\n",
        map.display().to_string()
    )
}

/// The last estimate: error of the horizontal position, its sigma, and the square of the error of all
/// states in sigma, with their number.
#[derive(Default)]
struct Last {
    error: [f64; 2],
    sigma: [f64; 2],
    squared: f64,
    states: usize,
    decided: Option<String>,
}

impl Last {
    fn epoch(&mut self, epoch: &Epoch<'_>) {
        let Some(truth) = epoch.truth else { return };
        let mut error = vec![0.0; epoch.layout.tangent];
        epoch.layout.error(truth.state, epoch.state, truth.known, &mut error);
        let position = epoch.layout.handle::<Position>("ins.position").unwrap();
        let first = epoch.layout.block(position).tangent.unwrap();
        self.error = [error[first], error[first + 1]];
        self.sigma = [0, 1].map(|k| epoch.covariance.sigma(first + k));
        // the truth has no past states
        let blocks = epoch.layout.blocks.iter().enumerate();
        let now = blocks.filter(|(slot, block)| block.estimated() && !epoch.layout.is_past(*slot));
        let columns: Vec<usize> = now.flat_map(|(_, block)| block.tangent_range()).collect();
        self.squared = epoch.covariance.nees(&error, &columns).unwrap_or(f64::NAN);
        self.states = columns.len();
    }
}

impl Sink for Last {
    fn wants(&self) -> Wants {
        Wants::EPOCHS | Wants::COMPARISONS | Wants::EVENTS
    }
    fn start(&mut self, _: &RunInfo) -> Result<(), StreamError> {
        Ok(())
    }
    fn take(&mut self, record: &Record<'_>) -> Result<(), StreamError> {
        match record {
            Record::Epoch(epoch) => self.epoch(epoch),
            Record::Event(event) if event.text.contains("the place is decided by") => {
                self.decided = Some(format!("{}: {}", event.time, event.text));
            }
            _ => {}
        }
        Ok(())
    }
}

fn run(text: &str, settings: &[&str]) -> (Finished, Last) {
    let mut registry = registry();
    registry.add(&PointMassPlugin);
    registry.add(&TwoWayPlugin);
    let settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
    let document = Document::parse("test.toml", text).unwrap();
    let scenario = Scenario::new(&registry, document, &settings).unwrap();
    let mut assembly = scenario.assemble(None).unwrap();
    assembly.sinks.push(("last".into(), Box::new(Last::default())));
    let mut finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    let last = finished.take_sink::<Last>().unwrap();
    (finished, last)
}

/// Runs with ten seeds; the number of decided ones, and the sum of the squares over the states.
fn campaign(text: &str, settings: &[&str]) -> (usize, f64, Vec<[f64; 2]>) {
    let (mut decided, mut sum, mut freedom, mut errors) = (0, 0.0, 0, Vec::new());
    for seed in 1..=10 {
        let seed = format!("seed={seed}");
        let (_, last) = run(text, &[settings, &[&*seed]].concat());
        decided += usize::from(last.decided.is_some());
        println!("{}", last.decided.as_deref().unwrap_or("not decided"));
        println!(
            "{seed}: {:?} of {:?}, {:.1} of {}",
            last.error, last.sigma, last.squared, last.states
        );
        sum += last.squared;
        freedom += last.states;
        errors.push(last.error);
    }
    (decided, sum / freedom as f64, errors)
}

/// 10 runs of 15 states: the sum of 150 squares is within 0.66 and 1.42 of 150 but for one case in
/// 10 000 (Wilson & Hilferty).
const BAND: [f64; 2] = [0.62, 1.48];

#[test]
fn over_a_map_the_place_is_found_and_the_covariance_holds() {
    let text = format!("{VEHICLE}{SQUARE}{}", altimeter());
    let (decided, mean, errors) = campaign(&text, &[]);
    assert_eq!(decided, 10);
    assert!(mean > BAND[0] && mean < BAND[1], "{mean}");
    assert!(errors.iter().flatten().all(|e| e.abs() < 10.0), "{errors:?}");
    // the filter that linearises at its estimate finds other valleys
    let (_, alone, _) = campaign(&text, &["estimator.type=ekf"]);
    assert!(alone > 3.0, "{alone}");
}

#[test]
fn beside_a_beacon_the_place_is_found_once_the_vehicle_has_turned() {
    let (decided, mean, errors) = campaign(&format!("{VEHICLE}{SQUARE}{BEACON}"), &[]);
    assert_eq!(decided, 10);
    assert!(mean > BAND[0] && mean < BAND[1], "{mean}");
    assert!(errors.iter().flatten().all(|e| e.abs() < 5.0), "{errors:?}");
}

/// The replies measure from the place of the ping, half a metre before: the past position moves with the
/// track of each hypothesis.
#[test]
fn with_replies_to_pings_the_place_is_found_as_with_a_beacon() {
    let (decided, mean, errors) = campaign(&format!("{VEHICLE}{SQUARE}{TWO_WAY}"), &[]);
    assert_eq!(decided, 10);
    assert!(mean > BAND[0] && mean < BAND[1], "{mean}");
    assert!(errors.iter().flatten().all(|e| e.abs() < 5.0), "{errors:?}");
}

#[test]
fn samples_that_are_excluded_decide_nothing() {
    for (sensor, name) in [(BEACON, "beacon"), (TWO_WAY, "two-way")] {
        let exclude = format!("sensor.{name}.exclude=[[\"0 s\", \"250 s\"]]");
        let stop = "estimator.stop=250 s";
        let (_, last) = run(&format!("{VEHICLE}{SQUARE}{sensor}"), &[&exclude, stop]);
        assert!(last.decided.is_none(), "{name}: {:?}", last.decided);
    }
}

/// Along a straight track both sides of a beacon have the same ranges.
#[test]
fn without_a_decision_the_estimate_stays_without_the_beacon_and_the_verdict_doubts() {
    let text = format!("{VEHICLE}{STRAIGHT}{BEACON}");
    let (finished, last) = run(&text, &[]);
    assert!(last.sigma.iter().all(|s| *s > 50.0), "{:?}", last.sigma);
    let findings = &finished.findings;
    let found = findings.iter().any(|f| f.text.contains("do not decide between places"));
    assert!(found, "{findings:?}");
}

/// With a prior of 5 m a range to a beacon at 40 m is not curved beyond its noise of 1 m: the estimator
/// is the extended Kalman filter, to the bit.
#[test]
fn without_a_curved_sensor_it_is_the_extended_kalman_filter() {
    let text = format!("{VEHICLE}{SQUARE}{BEACON}");
    let small = ["process.ins.position.sigma=[\"3 m\",\"3 m\",\"1 m\"]", "sensor.beacon.noise=1 m"];
    let [mine, ekf] = [&["estimator.type=point-mass"], &["estimator.type=ekf"]]
        .map(|kind: &[&str; 1]| run(&text, &[&small[..], kind].concat()).1);
    assert_eq!((mine.error, mine.sigma), (ekf.error, ekf.sigma));
}
