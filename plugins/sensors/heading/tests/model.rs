//! Equations of a compass and of two antennas: signs, and the way round the circle.
#![allow(missing_docs, clippy::unwrap_used, reason = "test")]

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

/// The field of the Earth and the vertical.
mod field {
    use navfuse_core::nalgebra::Vector3;
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

        [sensor.magnetometer]
        noise = "0.2 uT"
        field = { strength = "50 uT", inclination = "60 deg", declination = { sigma = "0.5 deg" } }
        hard_iron = { sigma = "5 uT" }
        scale = { sigma = "2 %" }
        soft_iron = { sigma = "2 %" }
        misalignment = { sigma = "1 deg" }

        [sensor.inclinometer]
        noise = "0.1 deg"
        roll_bias = { sigma = "0.3 deg" }
        pitch_bias = { sigma = "0.3 deg" }

        [sensor.reference]
        simulation = { rate = "1 Hz" }

        [source.simulation]
        start = { speed = "1 m/s" }
        segments = [{ type = "cruise", duration = "1 s" }]
    "#;

    fn bench(sensor: &str, degrees: [f64; 3]) -> ModelBench {
        let attitude = degrees.map(f64::to_radians);
        ModelBench::new(SCENARIO, &[], sensor, &[("ins.attitude", &attitude)])
    }

    /// 25 uT to magnetic north and 43.301 uT down. A vehicle that heads east of magnetic north by 90 deg has
    /// the north on its left; one that is upside down has the field above it.
    #[test]
    fn a_magnetometer_sees_the_field_from_its_vehicle() {
        for (attitude, declination, expected) in [
            ([0.0, 0.0, 0.0], 0.0, [25.0, 0.0, 43.3013]),
            ([0.0, 0.0, 90.0], 0.0, [0.0, -25.0, 43.3013]),
            ([0.0, 0.0, 100.0], 10.0, [0.0, -25.0, 43.3013]),
            ([180.0, 0.0, 0.0], 0.0, [25.0, 0.0, -43.3013]),
            ([0.0, 90.0, 0.0], 0.0, [-43.3013, 0.0, 25.0_f64]),
        ] {
            let mut bench = bench("magnetometer", attitude);
            bench.set("magnetometer.declination", &[f64::to_radians(declination)]);
            let found = Vector3::from_vec(bench.predict()) * 1e6;
            assert!((found - Vector3::from(expected)).norm() < 1e-4, "{attitude:?}: {found}");
        }
    }

    /// `(I + S) m + h` with `S` of 1, 2, 3 % on and -1, 0.5, 4 % off the diagonal:
    /// x: 1.01 * 25 - 0.01 * 0 + 0.005 * 43.3013 + 3, and so on.
    #[test]
    fn iron_scales_mixes_and_shifts_the_axes() {
        let mut bench = bench("magnetometer", [0.0; 3]);
        bench.set("magnetometer.scale", &[1.01, 1.02, 1.03]);
        bench.set("magnetometer.soft_iron", &[-0.01, 0.005, 0.04]);
        bench.set("magnetometer.hard_iron", &[3e-6, -2e-6, 1e-6]);
        let found = Vector3::from_vec(bench.predict()) * 1e6;
        let expected = Vector3::new(28.466_506, -0.517_949, 45.725_308);
        assert!((found - expected).norm() < 1e-4, "{found}");
        let error = bench.jacobian_error();
        assert!(error < 1e-6, "{error}");
    }

    #[test]
    fn an_inclinometer_shows_roll_and_pitch_with_their_biases() {
        let mut bench = bench("inclinometer", [-20.0, 35.0, 200.0]);
        bench.set("inclinometer.roll_bias", &[0.01]);
        bench.set("inclinometer.pitch_bias", &[-0.02]);
        let expected = [-20_f64.to_radians() + 0.01, 35_f64.to_radians() - 0.02];
        let found = bench.predict();
        assert!((0..2).all(|k| (found[k] - expected[k]).abs() < 1e-12), "{found:?}");
        let error = bench.jacobian_error();
        assert!(error < 1e-6, "{error}");
    }
}

/// The World Magnetic Model as the source of the field.
mod model_of_the_earth {
    use navfuse_core::compose::Composition;
    use navfuse_core::state::Mode;
    use navfuse_testing::ModelBench;

    const PLACE: &str = "latitude = \"42.283 deg\", longitude = \"-71.35 deg\", height = \"1 km\"";

    fn scenario(sensors: &str) -> String {
        super::SCENARIO.replacen("[sensor.reference]", &format!("{sensors}[sensor.reference]"), 1)
    }

    fn magnetometer(date: &str, more: &str) -> String {
        let wmm = format!("wmm = {{ {PLACE}, date = \"{date}\" }}");
        scenario(&format!("[sensor.magnetometer]\nnoise = \"0.1 uT\"\nfield = {{ {wmm}{more} }}\n"))
    }

    /// The example of MathWorks for `wrldmagm`: 20139, -4905 and 46532 nT, and -13.6891 deg. The date
    /// is the beginning of a day, in which the field changes by 0.2 nT.
    #[test]
    fn both_sensors_have_the_field_of_place_and_date() {
        let text = magnetometer("2028-07-04", "");
        let bench = ModelBench::new(&text, &[], "magnetometer", &[("ins.attitude", &[0.0; 3])]);
        for (found, expected) in bench.predict().iter().zip([20139.0, -4905.0, 46532.0]) {
            assert!((found * 1e9 - expected).abs() < 0.7, "{found:e} {expected}");
        }
        let wmm = format!("sensor.compass.wmm={{ {PLACE}, date = \"2028-07-04\" }}");
        let state: [(&str, &[f64]); 2] =
            [("ins.attitude", &[0.0; 3]), ("compass.deviation", &[0.0])];
        let text = super::SCENARIO.replace("    declination = { sigma = \"1 deg\" }\n", "");
        let declination = -ModelBench::new(&text, &[&wmm], "compass", &state).predict()[0];
        assert!((declination.to_degrees() + 13.6891).abs() < 2e-4, "{}", declination.to_degrees());
    }

    fn compose(text: &str) -> Result<Composition, String> {
        navfuse_testing::scenario(text, &[], |s| s.compose().map_err(|error| error.to_string()))
    }

    /// 0.26 deg and 5417 deg nT over 20728 nT are 0.3686 deg.
    #[test]
    fn the_filter_considers_the_uncertainty_of_the_model_unless_the_scenario_states_one() {
        let declination = |more: &str| {
            let composition = compose(&magnetometer("2028-07-04", more)).unwrap();
            let name = "magnetometer.declination";
            let block = composition.layout.blocks.iter().find(|b| b.name == name).unwrap();
            (block.spec.mode, block.spec.sigma[0].to_degrees())
        };
        let (mode, sigma) = declination("");
        assert!(mode == Mode::Consider && (sigma - 0.3686).abs() < 1e-4, "{mode:?} {sigma}");
        let (mode, sigma) = declination(", declination.sigma = \"2 deg\"");
        assert!(mode == Mode::Estimate && (sigma - 2.0).abs() < 1e-9, "{mode:?} {sigma}");
    }

    #[test]
    fn a_date_outside_the_validity_needs_a_sigma_and_is_noted() {
        let refused = compose(&magnetometer("2030-01-01", "")).unwrap_err();
        assert!(
            refused.contains("field: declination") && refused.contains("2025 to 2030"),
            "{refused}"
        );
        let stated = ", declination.sigma = \"2 deg\"";
        let noted = |date: &str| {
            let notes = compose(&magnetometer(date, stated)).unwrap().notes;
            notes.iter().any(|(_, text)| text.contains("the date is outside its validity"))
        };
        assert!(noted("2030-01-01") && noted("2024-12-31"));
        assert!(!noted("2029-12-31") && !noted("2025-01-01"));
    }

    #[test]
    fn a_field_from_two_sources_or_from_none_is_rejected() {
        for field in [", strength = \"46 uT\"", ", inclination = \"60 deg\""] {
            let text = magnetometer("2026-01-01", field);
            assert!(compose(&text).unwrap_err().contains("give wmm, or strength and inclination"));
        }
        let none = "[sensor.magnetometer]\nnoise = \"0.1 uT\"\nfield = { strength = \"46 uT\" }\n";
        assert!(compose(&scenario(none)).unwrap_err().contains("give wmm"));
    }
}
