//! Equations of dead reckoning: the attitude of the readings, and a velocity that turns with them.
#![allow(missing_docs, clippy::unwrap_used, reason = "test")]

use navfuse_core::document::Document;
use navfuse_core::filter::Ekf;
use navfuse_core::plugin::Registry;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_dead_reckoning::DeadReckoningPlugin;

const SCENARIO: &str = r#"
    [process.ins]
    type = "dead-reckoning"
    acceleration = "0.1 m/s^2/sqrt(Hz)"
    velocity = { sigma = "10 cm/s", initial = ["1 m/s", "0 m/s", "0 m/s"] }
    position = { sigma = "1 m", latitude = "0 deg", longitude = "0 deg", height = "0 m" }

    [sensor.ahrs]
    noise = "0.1 deg"
    tilt = "0.5 deg"
    heading = "2 deg"
    declination = "4 deg"
"#;

fn filter(settings: &[&str]) -> Ekf {
    let mut registry = Registry::new();
    registry.add(&navfuse_ins::InsPlugin).add(&DeadReckoningPlugin);
    let document = Document::parse("rov.toml", SCENARIO).unwrap();
    let settings: Vec<String> = settings.iter().map(|s| (*s).to_owned()).collect();
    Ekf::new(Scenario::new(&registry, document, &settings).unwrap().compose().unwrap())
}

/// Gives a reading of roll, pitch and yaw, deg.
fn give(ekf: &mut Ekf, seconds: f64, angles: [f64; 3]) {
    let angles = angles.map(f64::to_radians);
    let sample = Sample::new(Time::from_seconds(seconds).unwrap(), SensorId(0), &angles);
    ekf.process(&sample, &mut ()).unwrap();
}

/// A block in its display unit, with its sigma.
fn shown(ekf: &Ekf, name: &str) -> [[f64; 3]; 2] {
    let block = ekf.layout().blocks.iter().find(|b| b.name == name).unwrap();
    let (mut values, mut sigma) = ([0.0; 3], [0.0; 3]);
    block.show(&ekf.state().values, &mut values);
    block.show_sigma(&ekf.state().values, &ekf.covariance(), &mut sigma);
    [values, sigma]
}

/// The white noise of a reading and the slow error add up: hypot(0.1, 0.5) and hypot(0.1, 2) deg.
#[test]
fn the_attitude_is_the_reading_with_its_noise_and_its_slow_error() {
    let mut ekf = filter(&[]);
    for k in 0..50 {
        give(&mut ekf, 0.1 * f64::from(k), [1.0, -2.0, 26.0]);
    }
    let [angles, sigma] = shown(&ekf, "ins.attitude");
    // 1e-9 deg is the rounding of angles; of sigma, 0.1 s of a slow error of 600 s is 1 part in 6000
    let expected = ([1.0, -2.0, 30.0], [0.51, 0.51, 2.0025]);
    for k in 0..3 {
        assert!((angles[k] - expected.0[k]).abs() < 1e-9, "{angles:?}");
        assert!((sigma[k] / expected.1[k] - 1.0).abs() < 0.01, "{sigma:?}");
    }
}

/// Of 1 m/s to the north through a turn of 90 deg in 10 s the velocity is 1 m/s to the east, and the
/// track is the arc of a circle: 10 s / (pi / 2) = 6.366 m to the north and to the east.
#[test]
fn a_vehicle_keeps_its_speed_through_a_turn() {
    let mut ekf = filter(&[]);
    for k in 0..=100 {
        give(&mut ekf, 0.1 * f64::from(k), [0.0, 0.0, 0.9 * f64::from(k) - 4.0]);
    }
    let [velocity, _] = shown(&ekf, "ins.velocity");
    assert!(velocity[0].abs() < 1e-9 && (velocity[1] - 1.0).abs() < 1e-9, "{velocity:?}");
    let [position, _] = shown(&ekf, "ins.position");
    // radii of curvature at the equator, WGS-84
    let north = position[0].to_radians() * 6_335_439.0;
    let east = position[1].to_radians() * 6_378_137.0;
    // the trapezoid of a turn of 0.9 deg a step: (0.9 deg)^2 / 12 = 2e-5 of the arc
    let arc = 20.0 / std::f64::consts::PI;
    assert!((north - arc).abs() < 3e-4 && (east - arc).abs() < 3e-4, "{north} {east}");
}

/// A silent AHRS is bridged: the process coasts, and the heading becomes uncertain by the turn,
/// 5 deg/s/sqrt(Hz) over 4 s. The next reading ends that.
#[test]
fn a_silent_ahrs_makes_the_heading_uncertain_until_it_returns() {
    let mut ekf = filter(&["sensor.ahrs.max_gap=0.5 s"]);
    (0..20).for_each(|k| give(&mut ekf, 0.1 * f64::from(k), [0.0, 0.0, 26.0]));
    give(&mut ekf, 6.0, [0.0, 0.0, 56.0]);
    let [angles, sigma] = shown(&ekf, "ins.attitude");
    assert!((angles[2] - 60.0).abs() < 1e-6 && sigma[2] < 2.1, "{angles:?} {sigma:?}");
}
