//! Conformance of every type. A run of the command tests that the source reads the sink's file.

use navfuse_conformance::{Failed, check};
use outside_vehicle::OutsideVehicle;

#[test]
fn vehicle_sensors_trajectory_and_sink_conform() -> Result<(), Failed> {
    check(&[&OutsideVehicle], include_str!("../scenario.toml"))
}
