//! What every type must hold. That the source reads what the sink wrote is shown by a run of the command.

use navfuse_conformance::{Failed, check};
use outside_vehicle::OutsideVehicle;

#[test]
fn vehicle_sensors_trajectory_and_sink_conform() -> Result<(), Failed> {
    check(&[&OutsideVehicle], include_str!("../scenario.toml"))
}
