//! Relative poses in the filter: consistency, keyframes, and what the sensor rejects.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use navfuse_core::plugin::Registry;
use navfuse_testing::judge::judged;

const RUNS: u64 = 20;

/// A vehicle that surges, turns and pitches with a monocular odometry, whose scale, mounting and
/// lever arm the filter estimates.
const ODOMETRY: &str = r#"
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
[sensor.odometry]
type = "relative-pose"
translation_noise = ["1 cm", "2 cm", "1 cm"]
rotation_noise = "0.05 deg"
scale = { sigma = "10 %" }
misalignment = { sigma = "2 deg" }
lever_arm = { initial = ["1 m", "0.2 m", "-0.5 m"], sigma = "20 cm" }
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

fn registry() -> Registry {
    navfuse_testing::registry()
}

/// Mean NEES at the end and mean NIS, each divided by its degrees of freedom; number of updates of
/// one run; largest ratio of the sigma of the scale factor to its prior.
fn consistency(settings: &[&str]) -> (f64, f64, usize, f64) {
    let (mut nees, mut nis, mut updates, mut scale) = (0.0, 0.0, 0, 0.0_f64);
    for seed in 1..=RUNS {
        let mut settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
        settings.push(format!("seed={seed}"));
        let (finished, judge) = judged(&registry(), ODOMETRY, &settings);
        assert!(finished.error.is_none(), "{:?}", finished.error);
        // 15 of the INS, scale factor, misalignment, lever arm
        assert_eq!((judge.freedom, judge.refused), (22, 0), "seed {seed}");
        nees += judge.nees;
        nis += judge.nis.iter().map(|(_, nis)| nis).sum::<f64>();
        updates = judge.nis.len();
        let row = finished.summary.rows.iter().find(|row| row.name.contains("scale")).unwrap();
        scale = scale.max(row.sigma[0] / 0.1);
    }
    let runs = RUNS as f64;
    (nees / (runs * 22.0), nis / (runs * updates as f64 * 6.0), updates, scale)
}

/// The mean NEES of 20 runs with 22 states has a sigma of sqrt(2 / (20 * 22)) = 0.067 of its mean,
/// the mean NIS of 20 * 235 updates of 6 channels one of sqrt(2 / (4700 * 6)) = 0.0084. The bands are
/// 3.3 sigma.
#[test]
fn odometry_with_unknown_scale_mounting_and_lever_arm_is_consistent() {
    let (anees, anis, updates, scale) = consistency(&[]);
    println!("ANEES {anees:.3}, ANIS {anis:.4}, scale {scale:.3}");
    assert!((anees - 1.0).abs() < 0.22, "{anees}");
    assert!((anis - 1.0).abs() < 0.028, "{anis}");
    assert_eq!(updates, 235);
    // the accelerometers of the surge observe the scale
    assert!(scale < 0.5, "{scale}");
}

/// With a keyframe every second, four images measure from each. The first image after the start at
/// 1 s measures from the keyframe of that time or the next one.
#[test]
fn odometry_from_keyframes_is_consistent() {
    let (anees, anis, updates, _) = consistency(&["sensor.odometry.simulated_keyframes=\"1 s\""]);
    println!("ANEES {anees:.3}, ANIS {anis:.4}, updates {updates}");
    assert!((anees - 1.0).abs() < 0.22, "{anees}");
    assert!((anis - 1.0).abs() < 0.028, "{anis}");
    assert_eq!(updates, 232);
}

#[test]
fn keyframes_without_a_time_between_them_are_an_error() {
    let document = navfuse_core::document::Document::parse("test.toml", ODOMETRY).unwrap();
    let keyframes = "sensor.odometry.simulated_keyframes=\"0.1 ns\"".to_owned();
    let registry = registry();
    let scenario =
        navfuse_core::run::scenario::Scenario::new(&registry, document, &[keyframes]).unwrap();
    let error = scenario.compose().map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("simulated_keyframes") && error.contains("1 ns"), "{error}");
}
