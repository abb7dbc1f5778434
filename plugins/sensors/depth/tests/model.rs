//! The equations of depth and pressure: the port, the sign, and what a sample may be.
#![allow(clippy::expect_used, missing_docs, reason = "a test fails by panicking")]

use navfuse_core::nalgebra::{Rotation3, Vector3};
use navfuse_testing::ModelBench;

const SCENARIO: &str = r#"
    name = "depth"

    [process.ins]
    attitude = { sigma = "1 deg" }
    velocity = { sigma = "1 m/s" }
    position = { sigma = "1 m" }
    gyro_bias = { sigma = "0.1 deg/h" }
    accel_bias = { sigma = "50 ug" }

    [sensor.imu]
    gyro_noise = "0.1 deg/h/sqrt(Hz)"
    accel_noise = "20 ug/sqrt(Hz)"
    simulation = { rate = "50 Hz" }

    [sensor.depth]
    noise = "5 cm"
    bias = { sigma = "1 m" }
    lever_arm = { sigma = "20 cm" }

    [sensor.pressure]
    noise = "10 mbar"
    atmosphere = { sigma = "20 mbar" }
    density = { sigma = "0.2 %" }
    surface = "20 m"
    lever_arm = { sigma = "20 cm" }

    [sensor.reference]
    simulation = { rate = "1 Hz" }

    [source.simulation]
    start = { speed = "1 m/s" }
    segments = [{ type = "cruise", duration = "1 s" }]
"#;

const ATTITUDE: [f64; 3] = [0.4, -0.7, 2.0];
const ARM: [f64; 3] = [-1.5, 0.4, 0.6];

fn bench() -> ModelBench {
    let blocks: [(&str, &[f64]); 4] = [
        ("ins.attitude", &ATTITUDE),
        ("ins.position", &[0.5, 1.0, -120.0]),
        ("depth.bias", &[0.25]),
        ("depth.lever_arm", &ARM),
    ];
    ModelBench::new(SCENARIO, &[], "depth", &blocks)
}

/// At 120 m below the ellipsoid the port is deeper by the down component of its lever arm, and the
/// sensor shows its bias more. The Earth falls away by 1.6^2 / 2R = 2e-7 m.
#[test]
fn the_depth_of_the_port_grows_downward() {
    let [roll, pitch, yaw] = ATTITUDE;
    let arm = Rotation3::from_euler_angles(roll, pitch, yaw) * Vector3::from(ARM);
    let found = bench().predict();
    assert!(found.len() == 1 && (found[0] - (120.25 + arm.z)).abs() < 3e-7, "{found:?} {arm}");
}

#[test]
fn the_jacobian_is_the_derivative() {
    let error = bench().jacobian_error();
    assert!(error < 1e-6, "{error}");
}

/// Water that is 2 % denser than the instrument assumes makes a depth of 120 m read 122.4 m.
#[test]
fn a_denser_water_scales_the_depth_and_not_its_bias() {
    let settings = ["sensor.depth.scale={ sigma = \"2.5 %\" }"];
    let blocks: [(&str, &[f64]); 3] =
        [("ins.position", &[0.5, 1.0, -120.0]), ("depth.bias", &[0.25]), ("depth.scale", &[1.02])];
    let bench = ModelBench::new(SCENARIO, &settings, "depth", &blocks);
    assert!((bench.predict()[0] - (122.4 + 0.25)).abs() < 1e-12, "{:?}", bench.predict());
    assert!(bench.jacobian_error() < 1e-6, "{}", bench.jacobian_error());
}

#[test]
fn the_noise_is_the_square_of_the_stated_sigma() {
    let variances = bench().variances(&ModelBench::sample(&[120.0]));
    assert!((variances[0] / 25e-4 - 1.0).abs() < 1e-12, "5 cm, {variances:?}");
}

/// From above the surface, where the air is thin, to below the deepest trench.
#[test]
fn a_depth_that_no_sea_has_is_refused() {
    let bench = bench();
    let id = bench.composition.sensor("depth").expect("the sensor is there");
    let sensor = &bench.composition.sensors[id];
    assert_eq!(sensor.info.channels.iter().map(|c| c.column()).collect::<Vec<_>>(), ["depth_m"]);
    let [(0, limit)] = sensor.limits.as_slice() else { unreachable!("{:?}", sensor.limits) };
    assert!((-1e3..-10.0).contains(&limit.low) && (10_950.0..2e4).contains(&limit.high));
}

/// 7321.45 m below a surface 20 m above the ellipsoid, at 30 deg of latitude, where Saunders has 7500
/// dbar; with 1 % more density and 1000 hPa of air, 7575 dbar and 10 dbar.
#[test]
fn a_pressure_is_that_of_the_water_and_of_the_air() {
    let position = [30_f64.to_radians(), 0.2, 20.0 - 7321.45];
    let mut bench = ModelBench::new(SCENARIO, &[], "pressure", &[("ins.position", &position)]);
    // the check value has 0.01 m
    assert!((bench.predict()[0] - (75e6 + 101_325.0)).abs() < 100.0, "{:?}", bench.predict());
    bench.set("pressure.density", &[1.01]);
    bench.set("pressure.atmosphere", &[1e5]);
    assert!((bench.predict()[0] - 75.85e6).abs() < 100.0, "{:?}", bench.predict());
    let error = bench.jacobian_error();
    assert!(error < 1e-6, "{error}");
}
