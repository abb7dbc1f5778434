//! Equations of a compass and of two antennas: signs, and the way round the circle.
#![allow(missing_docs, reason = "test")]

use navfuse_testing::ModelBench;

const SCENARIO: &str = r#"
    name = "heading"

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

    [sensor.compass]
    type = "magnetic-heading"
    noise = "1 deg"
    declination = { sigma = "1 deg" }
    deviation = { sigma = "1 deg" }
    simulation = { rate = "10 Hz" }

    [sensor.antennas]
    type = "dual-antenna"
    noise = "0.2 deg"
    azimuth = { sigma = "1 deg" }
    elevation = { sigma = "1 deg" }
    simulation = { rate = "10 Hz" }

    [sensor.reference]
    simulation = { rate = "10 Hz" }

    [source.simulation]
    start = { speed = "10 m/s" }
    segments = [{ type = "cruise", duration = "1 s" }]
"#;

fn degrees(values: &[f64]) -> Vec<f64> {
    values.iter().map(|x| x.to_degrees()).collect()
}

fn close(found: &[f64], expected: &[f64]) {
    // angles of up to 180 deg, a few roundings of 2e-16 each
    let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(off < 1e-12 && found.len() == expected.len(), "{found:?}, not {expected:?}");
}

fn compass(attitude: [f64; 3], declination: f64, deviation: f64) -> ModelBench {
    ModelBench::new(
        SCENARIO,
        &[],
        "compass",
        &[
            ("ins.attitude", &attitude.map(f64::to_radians)),
            ("compass.declination", &[declination.to_radians()]),
            ("compass.deviation", &[deviation.to_radians()]),
        ],
    )
}

/// A vehicle that heads 40 deg from true north, where magnetic north is 3 deg east of it, reads 37
/// deg; with a deviation of 2 deg, 35 deg. Roll and pitch do not matter: the heading is that of the
/// forward axis.
#[test]
fn a_compass_reads_the_heading_less_declination_and_deviation() {
    close(&degrees(&compass([0.0, 0.0, 40.0], 3.0, 0.0).predict()), &[37.0]);
    close(&degrees(&compass([0.0, 0.0, 40.0], -3.0, 2.0).predict()), &[41.0]);
    close(&degrees(&compass([30.0, -50.0, 40.0], 3.0, 2.0).predict()), &[35.0]);
    assert!(compass([30.0, -50.0, 40.0], 3.0, 2.0).jacobian_error() < 1e-8);
}

#[test]
fn a_heading_differs_the_short_way_round() {
    let compass = compass([0.0, 0.0, 179.0], 0.0, 0.0);
    let difference = |from: f64, to: f64| {
        compass.model.difference(0, to.to_radians(), from.to_radians()).to_degrees()
    };
    close(&[difference(179.0, -179.0), difference(-179.0, 179.0)], &[2.0, -2.0]);
    close(&[difference(10.0, 350.0), difference(10.0, 20.0)], &[-20.0, 10.0]);
}

fn antennas(attitude: [f64; 3], azimuth: f64, elevation: f64) -> ModelBench {
    ModelBench::new(
        SCENARIO,
        &[],
        "antennas",
        &[
            ("ins.attitude", &attitude.map(f64::to_radians)),
            ("antennas.azimuth", &[azimuth.to_radians()]),
            ("antennas.elevation", &[elevation.to_radians()]),
        ],
    )
}

/// The baseline forward shows heading and pitch. To the right it shows the heading of the starboard
/// beam, and a roll to starboard lowers its end. Its own elevation adds to the pitch.
#[test]
fn two_antennas_read_heading_and_elevation_of_their_baseline() {
    close(&degrees(&antennas([0.0, 5.0, 40.0], 0.0, 0.0).predict()), &[40.0, 5.0]);
    close(&degrees(&antennas([5.0, 0.0, 40.0], 90.0, 0.0).predict()), &[130.0, -5.0]);
    close(&degrees(&antennas([0.0, 5.0, 40.0], 0.0, 3.0).predict()), &[40.0, 8.0]);
    close(&degrees(&antennas([0.0, 0.0, 40.0], -10.0, 0.0).predict()), &[30.0, 0.0]);
    assert!(antennas([8.0, -5.0, 40.0], 70.0, 3.0).jacobian_error() < 1e-8);
}

#[test]
fn only_the_heading_of_a_baseline_goes_round() {
    let antennas = antennas([0.0; 3], 0.0, 0.0);
    let difference = |channel: usize| antennas.model.difference(channel, 3.0, -3.0);
    close(&[difference(0), difference(1)], &[6.0 - std::f64::consts::TAU, 6.0]);
}

/// The keys give 1 deg for the compass and 0.2 deg for the antennas, whose elevation has twice the
/// noise of the heading.
#[test]
fn the_noise_is_the_square_of_the_stated_sigma() {
    let sigmas = |bench: &ModelBench, values: &[f64]| {
        let variances = bench.variances(&ModelBench::sample(values));
        degrees(&variances.iter().map(|v| v.sqrt()).collect::<Vec<_>>())
    };
    close(&sigmas(&compass([0.0; 3], 0.0, 0.0), &[0.1]), &[1.0]);
    close(&sigmas(&antennas([0.0; 3], 0.0, 0.0), &[0.1, 0.1]), &[0.2, 0.4]);
}

#[test]
fn a_heading_with_a_correlated_error_differs_the_short_way_round_too() {
    let error =
        "sensor.compass.correlated_error={ sigma = \"1 deg\", correlation_time = \"60 s\" }";
    let compass = ModelBench::new(SCENARIO, &[error], "compass", &[]);
    let off = compass.model.difference(0, -179_f64.to_radians(), 179_f64.to_radians());
    close(&[off.to_degrees()], &[2.0]);
}
