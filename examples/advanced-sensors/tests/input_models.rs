//! Consistency of the plugins of the how-to guides.
#![allow(missing_docs, clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use advanced_sensors::AdvancedSensors;
use navfuse_core::document::Document;
use navfuse_core::plugin::{Kind, Registry};
use navfuse_core::run::scenario::Scenario;
use navfuse_core::run::schema::parameters;
use navfuse_testing::judge::judged;
use navfuse_testing::steps::allocations;

fn registry() -> Registry {
    let mut registry = navfuse_testing::registry();
    registry.add(&AdvancedSensors);
    registry
}

/// An IMU with a gyro scale factor error of 1 %. A turn of 360 deg then changes the heading by 3.6
/// deg, about 10 times the sigma with which the fixes determine it.
const IMU: &str = r#"
[estimator]
draw = "all"
[process.imu-errors]
gyro_scale = { sigma = "1 %" }
accel_scale = { sigma = "0.5 %" }
misalignment = { sigma = "0.5 deg" }
[process.gyro-sensitivity]
sensitivity = { sigma = "100 deg/h/g" }
[process.ins]
attitude = { sigma = ["0.3 deg", "0.3 deg", "1 deg"] }
velocity = { sigma = "0.1 m/s" }
position = { sigma = "1 m" }
gyro_bias = { sigma = "20 deg/h" }
accel_bias = { sigma = "1000 ug" }
[sensor.imu]
gyro_noise = "5 deg/h/sqrt(Hz)"
accel_noise = "100 ug/sqrt(Hz)"
simulation = { rate = "50 Hz" }
[sensor.gnss]
horizontal_noise = "0.5 m"
vertical_noise = "1 m"
velocity_noise = "3 cm/s"
simulation = { rate = "2 Hz" }
[sensor.reference]
simulation = { rate = "1 Hz" }
[source.simulation]
start = { latitude = "43 deg", heading = "30 deg" }
segments = [
    { type = "surge", duration = "10 s", speed = "8 m/s" },
    { type = "turn", duration = "20 s", angle = "360 deg", bank = "10 deg" },
    { type = "cruise", duration = "5 s" },
    { type = "turn", duration = "20 s", angle = "-270 deg", bank = "-10 deg" },
    { type = "surge", duration = "10 s", speed = "-4 m/s" },
]
"#;

/// Mean NEES at the end of 30 runs, divided by the number of states, mean NIS of the updates with
/// `channels` channels, and sigma of the first component of a state over its prior.
fn campaign(text: &str, settings: &[&str], channels: usize, state: &str) -> [f64; 3] {
    let (mut nees, mut nis, mut count, mut share) = (0.0, 0.0, 0, 0.0);
    for seed in 1..=30 {
        let all = settings.iter().map(|s| (*s).to_owned()).chain([format!("seed={seed}")]);
        let (finished, judge) = judged(&registry(), text, &all.collect::<Vec<_>>());
        assert!(finished.error.is_none(), "seed {seed}: {:?}", finished.error);
        nees += judge.nees / (30 * judge.freedom) as f64;
        nis += judge.nis.iter().map(|(_, nis)| nis).filter(|nis| nis.is_finite()).sum::<f64>();
        count += judge.nis.iter().filter(|(_, nis)| nis.is_finite()).count();
        let row = finished.summary.rows.iter().find(|row| row.name == state).unwrap();
        share += row.sigma[2] / 30.0;
    }
    [nees, nis / (channels * count) as f64, share]
}

/// 27 states, so the mean NEES of 30 runs has a sigma of sqrt(2 / (30 * 27)) = 0.050, and the mean
/// NIS of 30 * 130 updates of 6 channels one of sqrt(2 / (30 * 130 * 6)) = 0.0093; 3.3 sigma.
#[test]
fn two_input_models_of_an_imu_stack_and_are_consistent() {
    for output in ["rates", "increments"] {
        let output = format!("sensor.imu.output=\"{output}\"");
        let [nees, nis, sigma] = campaign(IMU, &[&output], 6, "imu-errors.gyro_scale");
        println!("{output}: ANEES {nees:.3}, ANIS {nis:.4}, sigma of the scale of gyro z {sigma}");
        assert!((nees - 1.0).abs() < 0.165, "{nees}");
        assert!((nis - 1.0).abs() < 0.031, "{nis}");
        // a turn of 360 deg, observed to about 0.5 deg, determines the scale of gyro z to 0.15 %
        assert!(sigma < 0.0025, "{sigma}");
    }
}

fn refused(text: &str) -> String {
    let document = Document::parse("scenario.toml", text).unwrap();
    let registry = registry();
    let scenario = Scenario::new(&registry, document, &[]).unwrap();
    scenario.assemble(None).err().unwrap().to_string()
}

#[test]
fn an_imu_model_of_no_driving_sensor_is_refused() {
    let text = IMU.replace("[sensor.imu]", "[sensor.imv]\ntype = \"imu\"");
    let text = text.replace("[process.ins]", "[process.ins]\nimu = \"imv\"");
    let error = refused(&text);
    assert!(error.contains("[process.imu-errors]") || error.contains("scenario.toml:4"), "{error}");
    assert!(
        error.contains("no driving sensor imu") && error.contains("Did you mean imv?"),
        "{error}"
    );
}

/// A vehicle that only its pseudoranges locate.
const RECEIVER: &str = include_str!("../../../plugins/sensors/gnss/tests/pseudoranges.toml");

/// A vehicle without fixes drives two loops among 18 landmarks, 30 m apart, of which it sees those
/// within 25 m and maps five.
const CAMERA: &str = r#"
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
simulation = { rate = "20 Hz" }
[sensor.landmarks]
noise = "10 cm"
states = 5
gate = "off"
[sensor.landmarks.simulation]
rate = "2 Hz"
origin = ["43 deg", "0 deg"]
sight = "25 m"
landmarks = [
    ["10 m", "-8 m", "2 m"], ["10 m", "22 m", "-1 m"], ["10 m", "52 m", "1 m"],
    ["40 m", "-8 m", "2 m"], ["40 m", "22 m", "-1 m"], ["40 m", "52 m", "1 m"],
    ["70 m", "-8 m", "2 m"], ["70 m", "22 m", "-1 m"], ["70 m", "52 m", "1 m"],
    ["100 m", "-8 m", "2 m"], ["100 m", "22 m", "-1 m"], ["100 m", "52 m", "1 m"],
    ["130 m", "-8 m", "2 m"], ["130 m", "22 m", "-1 m"], ["130 m", "52 m", "1 m"],
    ["160 m", "-8 m", "2 m"], ["160 m", "22 m", "-1 m"], ["160 m", "52 m", "1 m"],
]
[sensor.reference]
simulation = { rate = "1 Hz" }
[source.simulation]
start = { latitude = "43 deg", heading = "0 deg" }
segments = [
    { type = "surge", duration = "10 s", speed = "3 m/s" },
    { type = "turn", duration = "120 s", angle = "720 deg" },
]
"#;

/// 30 runs of `n` error states: the mean NEES over `n` has a sigma of sqrt(2 / (30 n)), and the
/// mean NIS of `m` channels one of sqrt(2 / m); 3.3 sigma.
#[test]
fn landmarks_that_come_and_go_are_consistent_under_each_estimator() {
    for (estimator, runs) in [("ekf", 30), ("ukf", 30)] {
        let (mut nees, mut freedom, mut nis, mut channels) = (0.0, 0, 0.0, 0);
        let (mut added, mut removed) = (0, 0);
        for seed in 1..=runs {
            let settings = [format!("estimator.type=\"{estimator}\""), format!("seed={seed}")];
            let (finished, judge) = judged(&registry(), CAMERA, &settings);
            assert!(finished.error.is_none(), "seed {seed}: {:?}", finished.error);
            // the states of the vehicle, and of the landmarks in the map at the end
            assert_eq!(judge.freedom, 15 + 3 * 5, "seed {seed}: {}", judge.freedom);
            nees += judge.nees;
            freedom += judge.freedom;
            let accepted = || judge.nis.iter().map(|(_, nis)| nis).filter(|nis| nis.is_finite());
            nis += accepted().sum::<f64>();
            channels += 3 * accepted().count();
            let count =
                |text: &str| judge.events.iter().filter(|event| event.contains(text)).count();
            added += count(" added: landmarks.landmark_");
            removed += count(" removed: landmarks.landmark_");
        }
        let (freedom, channels) = (f64::from(freedom as u32), f64::from(channels as u32));
        let (nees, nis) = (nees / freedom, nis / channels);
        println!("{estimator}: ANEES {nees:.3}, ANIS {nis:.4}, {added} added, {removed} removed");
        assert!((nees - 1.0).abs() < 3.3 * (2.0 / freedom).sqrt(), "{nees}");
        assert!((nis - 1.0).abs() < 3.3 * (2.0 / channels).sqrt(), "{nis}");
        // the vehicle passes more than twice as many landmarks as it maps; five remain at the end
        assert!(added > 12 * runs as usize && added == removed + 5 * runs as usize, "{added}");
    }
}

#[test]
fn a_smoothed_run_with_landmarks_is_refused() {
    let error = refused(&CAMERA.replace("draw = ", "smooth = true\ndraw = "));
    assert!(error.contains("landmarks.landmark_1") && error.contains("estimator"), "{error}");
}

/// A step in which a landmark comes or goes logs an event, whose text is allocated.
#[test]
fn a_step_with_input_models_several_observations_or_landmarks_allocates_nothing() {
    let cases =
        [("input models", IMU, 100), ("pseudoranges", RECEIVER, 400), ("camera", CAMERA, 250)];
    for (name, text, least) in cases {
        let found = allocations(&registry(), text, 8.0, |step| {
            allocation_counter::measure(step).count_total
        });
        println!("{name}: {found:?}");
        assert!(found.accepted > least, "{name}: {found:?}");
        assert_eq!(found.silent.1, 0, "{name}: {found:?}");
        assert_eq!(found.reporting > 0, name == "camera", "{name}: {found:?}");
    }
}

#[test]
fn a_type_extends_the_simulation_of_its_sensor() {
    let error = refused(&RECEIVER.replace("mask =", "maks ="));
    assert!(error.contains("sensor.pseudoranges.simulation.maks"), "{error}");
    assert!(error.contains("mask") && error.contains("satellites, "), "{error}");
    let error = refused(&RECEIVER.replace("mask = \"10 deg\"", "mask = \"10 m\""));
    assert!(error.contains("sensor.pseudoranges.simulation.mask"), "{error}");
    let registry = registry();
    let entry = registry.get(Kind::Sensor, "pseudoranges").unwrap();
    let keys: Vec<String> = parameters(entry).into_iter().map(|p| p.key).collect();
    for key in ["simulation.rate", "simulation.mask"] {
        assert!(keys.iter().any(|k| k == key), "{key} is not in {keys:?}");
    }
    let error = refused(&IMU.replace("rate = \"2 Hz\"", "rate = \"2 Hz\", mask = \"1 deg\""));
    assert!(error.contains("sensor.gnss.simulation.mask"), "other types do not have it: {error}");
}

#[test]
fn a_preset_of_another_type_corrects_the_vehicle_as_that_type_does() {
    let keys = "lever_arm = [\"-0.4 m\", \"0 m\", \"-6 m\"]\nvertical_noise = \"0.5 m\"\n";
    let start = IMU.find("[sensor.gnss]").unwrap();
    let (before, after) = IMU.split_at(start);
    let plain = after.replacen("vertical_noise = \"1 m\"\nvelocity_noise = \"3 cm/s\"\n", keys, 1);
    let preset = "[sensor.gnss]\ntype = \"vessel-receiver\"\nnoise = \"0.5 m\"\n";
    let preset = preset.to_owned() + &after[after.find("simulation").unwrap()..];
    let rows = [before.to_owned() + &plain, before.to_owned() + &preset].map(|text| {
        let (finished, _) = judged(&registry(), &text, &[]);
        assert!(finished.error.is_none(), "{:?}", finished.error);
        finished.summary.rows.iter().map(|row| row.estimate.clone()).collect::<Vec<_>>()
    });
    assert_eq!(rows[0], rows[1]);
}
