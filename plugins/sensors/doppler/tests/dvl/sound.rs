//! The speed of sound of the water at the instrument.

use crate::common::{compose, model, no_sample, predict, set};
use navfuse_core::model::sensor::measurement::{At, jacobian_error};

const SCENARIO: &str = r#"
[process.ins]
attitude = { sigma = "1 deg" }
velocity = { sigma = "1 cm/s" }
position = { sigma = "1 m" }
gyro_bias = { sigma = "0.1 deg/h" }
accel_bias = { sigma = "100 ug" }
[sensor.imu]
gyro_noise = "0.2 deg/h/sqrt(Hz)"
accel_noise = "20 ug/sqrt(Hz)"
simulation = { rate = "50 Hz" }
[sensor.dvl]
noise = "1 cm/s"
misalignment = { sigma = "1 deg" }
sound_speed = { set = "1500 m/s", surface = "30 m", water = { temperature = 25, equation = "mackenzie" } }
[sensor.reference]
simulation = { rate = "1 Hz" }
[source.simulation]
start = { speed = "1 m/s" }
segments = [{ type = "cruise", duration = "1 s" }]
"#;

/// 1000 m below the surface the water of Mackenzie's check value has 1550.744 m/s. A piston reads every
/// axis too small by that; a phased array reads the horizontal velocity as it is, and the vertical one
/// as its beams at `sin(30 deg) c / 1500 m/s`.
#[test]
fn the_water_at_the_instrument_corrects_each_array_as_it_works() {
    let ratio = 1500.0 / 1550.744_f64;
    let steered = (1.0 - 0.25 / (ratio * ratio)).sqrt() / 30_f64.to_radians().cos();
    for (array, expected) in [
        ("piston", [2.0 * ratio, 0.5 * ratio, -0.8 * ratio]),
        ("phased", [2.0, 0.5, -0.8 * ratio * steered]),
    ] {
        let array = format!("sensor.dvl.sound_speed.array={array:?}");
        let composition = compose(SCENARIO, &[&array]);
        let mut state = composition.layout.initial_state();
        set(&composition, &mut state, "ins.attitude", &[0.0; 3]);
        set(&composition, &mut state, "ins.velocity", &[2.0, 0.5, -0.8]);
        set(&composition, &mut state, "ins.position", &[0.7, 0.1, -970.0]);
        let found = predict(&composition, "dvl", &state, &no_sample());
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-6, "{array}: {found} {expected}");
        }
        let (sample, layout) = (no_sample(), &composition.layout);
        let at = At { layout, state: &state, sample: &sample };
        let error = jacobian_error(model(&composition, "dvl").as_ref(), &at);
        assert!(error < 1e-6, "{array}: {error:e}");
        let mut measured = no_sample();
        measured.set(3, 1500.0);
        let found = predict(&composition, "dvl", &state, &measured);
        assert!((found[0] - 2.0).abs() < 1e-12 && (found[2] + 0.8).abs() < 1e-12, "{found:?}");
    }
}
