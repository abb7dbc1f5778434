//! Conformance of the sensor that `navfuse new-plugin` writes, and of the one in `examples/`.
//! `tests/outside.rs` of the root package runs the tests of their own crates.

#[path = "../../../src/templates/plugin/lib.txt"]
mod my_sensor;
#[path = "../../../examples/outside-sensor/src/lib.rs"]
mod outside_sensor;

use navfuse_conformance::{Failed, check_sensor};

#[test]
fn the_sensor_of_a_new_plugin_conforms() -> Result<(), Failed> {
    check_sensor::<my_sensor::MySensor>(include_str!("../../../src/templates/plugin/scenario.txt"))
}

#[test]
fn the_sensor_of_the_example_conforms() -> Result<(), Failed> {
    check_sensor::<outside_sensor::FieldDirection>(include_str!(
        "../../../examples/outside-sensor/scenario.toml"
    ))
}
