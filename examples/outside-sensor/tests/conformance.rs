//! Conformance of the sensor.

#[test]
fn the_magnetometer_conforms() -> Result<(), navfuse_conformance::Failed> {
    navfuse_conformance::check_sensor::<outside_sensor::FieldDirection>(include_str!(
        "../scenario.toml"
    ))
}
