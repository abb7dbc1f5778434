//! Consistency of the plugins of the how-to guides.
#![allow(missing_docs, clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use advanced_sensors::AdvancedSensors;
use navfuse_core::document::Document;
use navfuse_core::plugin::Registry;
use navfuse_core::run::scenario::Scenario;
use navfuse_testing::judge::judged;

fn registry() -> Registry {
    let mut registry = navfuse_testing::registry();
    registry.add(&AdvancedSensors);
    registry
}

/// An IMU whose errors turn the heading by 10 sigma of the fixes' knowledge in two turns: 1 % of
/// 360 deg is 3.6 deg.
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
        // a turn of 360 deg seen to about 0.5 deg gives the scale of gyro z to 0.15 %
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
