//! Noise that grows with the speed.

use crate::common::{compose, model, no_sample, run, set};
use navfuse_core::model::sensor::measurement::At;

const SCENARIO: &str = r#"
[process.ins]
attitude = { sigma = "0.01 deg" }
velocity = { sigma = "5 mm/s" }
position = { sigma = "1 m" }
[sensor.imu]
gyro_noise = "0.1 deg/h/sqrt(Hz)"
accel_noise = "10 ug/sqrt(Hz)"
simulation = { rate = "20 Hz" }
[sensor.dvl]
noise = "3 mm/s"
gate = "off"
simulation = { rate = "5 Hz" }
[sensor.reference]
simulation = { rate = "1 Hz" }
[estimator]
draw = "start"
[source.simulation]
start = { latitude = "43 deg" }
segments = [
    { type = "static", duration = "60 s" },
    { type = "surge", duration = "20 s", speed = "4 m/s" },
    { type = "cruise", duration = "60 s" },
]
"#;

/// Settings of both types of DVL.
const TYPES: [[&str; 2]; 2] = [
    ["sensor.dvl.type=\"dvl\"", "sensor.dvl.relative_noise=[\"1 %\", \"1 %\", \"0.4 %\"]"],
    ["sensor.dvl.type=\"dvl-beams\"", "sensor.dvl.relative_noise=\"1 %\""],
];

/// At 4 m/s, 1 % is 4 cm/s: `0.003^2 + 0.04^2`. At rest the noise is 3 mm/s.
#[test]
fn the_variance_is_that_of_rest_and_a_share_of_the_squared_speed() {
    for (settings, shares) in TYPES.iter().zip([&[0.01, 0.01, 0.004][..], &[0.01; 4]]) {
        let composition = compose(SCENARIO, settings);
        let m = shares.len();
        for speed in [0.0_f64, 4.0] {
            let mut state = composition.layout.initial_state();
            // north, east, down: the speed has three components
            set(&composition, &mut state, "ins.velocity", &[0.6 * speed, 0.0, 0.8 * speed]);
            let (layout, sample) = (&composition.layout, &no_sample());
            let mut r = vec![0.0; m * m];
            model(&composition, "dvl").noise(&At { layout, state: &state, sample }, &mut r);
            for (i, share) in shares.iter().enumerate() {
                let expected = 0.003_f64.powi(2) + (share * speed).powi(2);
                let variance = r[i * m + i];
                assert!((variance / expected - 1.0).abs() < 1e-12, "{i}: {variance} {expected}");
            }
        }
    }
}

/// The simulated noise grows as the filter's: the mean NIS is the number of channels, at rest and
/// at speed. A filter with the noise of rest would have 178 times as much at 4 m/s.
#[test]
fn simulation_and_filter_agree_at_rest_and_at_speed() {
    for settings in TYPES {
        for stop in ["60 s", "140 s"] {
            let stop = format!("estimator.stop=\"{stop}\"");
            let log = run(SCENARIO, &[&settings[..], &[&stop]].concat());
            let (mean, bound) = log.mean_nis(1);
            assert!((mean - 1.0).abs() < bound, "{settings:?} {stop}: {mean} ± {bound}");
        }
    }
}
