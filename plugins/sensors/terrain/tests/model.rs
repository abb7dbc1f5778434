//! The range to a mapped bottom, and its slope.
#![allow(clippy::expect_used, missing_docs, reason = "a test fails by panicking")]

use navfuse_testing::ModelBench;

const SCENARIO: &str = r#"
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

    [sensor.altimeter]
    type = "terrain"
    noise = "30 cm"
    map_noise = "40 cm"
    shift = { sigma = "5 m" }
    lever_arm = { sigma = "10 cm" }

    [sensor.reference]
    simulation = { rate = "1 Hz" }

    [source.simulation]
    start = { speed = "1 m/s" }
    segments = [{ type = "cruise", duration = "1 s" }]
"#;

/// On the equator 0.01 deg are 1105.7 m to the north; the bottom rises there by 100 m.
const MAP: &str =
    "ncols 2\nnrows 2\nxllcenter 0\nyllcenter 0\ncellsize 0.01\n-100 -100\n-200 -200\n";

/// The altimeter at a latitude, in deg, and a height, with the attitude roll, pitch and yaw, in deg.
fn bench(latitude: f64, height: f64, attitude: [f64; 3], settings: &[&str]) -> ModelBench {
    let folder = tempfile::tempdir().expect("a folder");
    let map = folder.path().join("map.asc");
    std::fs::write(&map, MAP).expect("the test can write");
    let map = format!("sensor.altimeter.map={:?}", map.display().to_string());
    let settings = [&[&*map], settings].concat();
    let position = [latitude.to_radians(), 0.005_f64.to_radians(), height];
    let blocks: [(&str, &[f64]); 2] =
        [("ins.position", &position), ("ins.attitude", &attitude.map(f64::to_radians))];
    ModelBench::new(SCENARIO, &settings, "altimeter", &blocks)
}

#[test]
fn the_range_straight_down_is_the_height_above_the_map() {
    let mut bench = bench(0.004, -50.0, [0.0; 3], &[]);
    // -200 m + 0.4 of 100 m
    assert!((bench.predict()[0] - 110.0).abs() < 1e-6, "{:?}", bench.predict());
    // a map that lies 110.57 m too far north has the bottom of 0.003 deg here, and 2 m too deep
    bench.set("altimeter.shift", &[110.574, 0.0, 2.0]);
    assert!((bench.predict()[0] - 122.0).abs() < 1e-3, "{:?}", bench.predict());
    let variance = bench.variances(&ModelBench::sample(&[110.0]))[0];
    assert!((variance - 0.25).abs() < 1e-12, "{variance}");
}

/// Pitched up by 20 deg, the beam of a vehicle that heads north points ahead: `r cos 20 deg` down and
/// `r sin 20 deg` to the north, where the bottom rises by 100 m over 1105.74 m.
#[test]
fn an_inclined_beam_meets_the_slope() {
    let bench = bench(0.004, -50.0, [0.0, 20.0, 0.0], &[]);
    let (sin, cos) = 20_f64.to_radians().sin_cos();
    let expected = 110.0 / (cos + sin * 100.0 / 1105.743);
    let found = bench.predict()[0];
    // the slope of the bilinear map is accurate to the radii of curvature, 1e-5 over 40 m
    assert!((found - expected).abs() < 0.01, "{found} {expected}");
    let error = bench.jacobian_error();
    assert!(error < 1e-6, "{error}");
}

#[test]
fn beyond_the_map_and_beyond_the_reach_there_is_no_range() {
    let nothing = [
        bench(0.011, -50.0, [0.0; 3], &[]),
        bench(0.004, -170.0, [0.0; 3], &[]),
        bench(0.004, -50.0, [0.0; 3], &["sensor.altimeter.reach=\"100 m\""]),
    ];
    for bench in nothing {
        assert!(bench.predict()[0].is_nan());
        let now = navfuse_core::units::time::Time::default();
        assert!(bench.simulate(now, now).get(0).is_none());
    }
}
