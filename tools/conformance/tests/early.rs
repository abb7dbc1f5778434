//! What the kit says at its end: how to go on, and where the runs were overconfident on the way.

use navfuse_acoustic::AcousticPlugin;
use navfuse_conformance::report;

/// A vehicle that passes a beacon 30 m away; its position is known to `sigma`.
fn next(sigma: &str) -> Vec<String> {
    let scenario = format!(
        r#"
        [process.ins]
        attitude = {{ sigma = "0.1 deg" }}
        velocity = {{ sigma = "1 cm/s" }}
        position = {{ sigma = ["{sigma}", "{sigma}", "10 cm"] }}

        [sensor.imu]
        gyro_noise = "0.1 deg/h/sqrt(Hz)"
        accel_noise = "10 ug/sqrt(Hz)"
        simulation = {{ rate = "20 Hz" }}

        [sensor.beacon]
        type = "acoustic-range"
        noise = "10 cm"
        transponder = {{ latitude = "43.0003 deg", longitude = "5 deg", height = "-10 m" }}
        simulation = {{ rate = "2 Hz", offset = "0.13 s" }}

        [sensor.reference]
        simulation = {{ rate = "1 Hz" }}

        [source.simulation]
        start = {{ latitude = "43 deg", longitude = "5 deg", height = "-10 m", heading = "60 deg" }}
        segments = [
            {{ type = "surge", duration = "10 s", speed = "2 m/s" }},
            {{ type = "cruise", duration = "50 s" }},
        ]
        "#
    );
    report(&[&AcousticPlugin], &scenario).next
}

/// The second-order term of 10 m at 33 m is 1.5 m, 15 times the noise of a range.
#[test]
fn a_prior_within_which_a_model_is_curved_is_named_with_remedies() {
    let next = next("10 m");
    println!("{next:#?}");
    assert!(next[0].starts_with("overconfident from "), "{next:?}");
    assert!(next[0].contains("relinearise = \""), "{next:?}");
    assert!(next[1].contains("navfuse monte-carlo"), "{next:?}");
}

/// Of 10 cm it is 0.15 mm.
#[test]
fn with_a_narrow_prior_only_the_next_step_is_named() {
    let next = next("10 cm");
    assert_eq!(next.len(), 1, "{next:?}");
    assert!(next[0].contains("navfuse monte-carlo"), "{next:?}");
}
