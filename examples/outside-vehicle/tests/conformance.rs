//! What every process and sensor must hold. That the source reads what the sink wrote is shown by a run of the command.

use navfuse_conformance::{Failed, check};
use outside_vehicle::VehiclePlugin;

#[test]
fn vehicle_and_sensors_conform() -> Result<(), Failed> {
    let scenario = include_str!("../scenario.toml").replace("[sink.lines]", "");
    check(&[&VehiclePlugin], &scenario)
}
