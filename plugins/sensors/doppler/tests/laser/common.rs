//! What the tests share: a scenario whose beams and motion a test sets.

use navfuse_core::compose::Composition;
use navfuse_core::document::Document;
use navfuse_core::run::scenario::Scenario;
pub use navfuse_testing::registry;

/// A navigation-grade IMU after an alignment at rest, and a laser whose misalignment and scale are
/// not known.
pub const SCENARIO: &str = r#"
name = "laser"
seed = 1

[process.ins]
attitude = { sigma = ["0.005 deg", "0.005 deg", "0.05 deg"] }
velocity = { sigma = "2 mm/s" }
position = { sigma = "1 m" }
gyro_bias = { sigma = "0.01 deg/h" }
accel_bias = { sigma = "50 ug" }

[sensor.imu]
gyro_noise = "0.1 deg/h/sqrt(Hz)"
accel_noise = "10 ug/sqrt(Hz)"
simulation = { rate = "100 Hz" }

[sensor.laser]
type = "laser-doppler"
beams = [[1, 0, 1]]
noise = "5 mm/s"
scale = { sigma = "1 %" }
misalignment = { sigma = "0.5 deg" }
simulation = { rate = "10 Hz" }

[sensor.reference]
simulation = { rate = "10 Hz" }

[source.simulation]
segments = [{ type = "cruise", duration = "20 s" }]
"#;

/// The scenario with settings.
pub fn document(settings: &[&str]) -> Document {
    let mut document = Document::parse("laser.toml", SCENARIO).expect("a scenario");
    settings.iter().for_each(|s| document.set(s).unwrap_or_else(|e| panic!("{s}: {e}")));
    document
}

/// The scenario composed.
pub fn compose(settings: &[&str]) -> Composition {
    let registry = registry();
    let scenario =
        Scenario::new(&registry, document(settings), &[]).unwrap_or_else(|e| panic!("{e}"));
    scenario.compose().unwrap_or_else(|e| panic!("{e}"))
}

/// Why the scenario does not compose.
pub fn refused(settings: &[&str]) -> String {
    let registry = registry();
    match Scenario::new(&registry, document(settings), &[]).map(|s| s.compose()) {
        Err(error) => error.to_string(),
        Ok(Err(error)) => error.to_string(),
        Ok(Ok(_)) => panic!("{settings:?} is not refused"),
    }
}
