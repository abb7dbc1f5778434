//! The `navfuse` command with a vehicle that has no IMU.

fn main() -> std::process::ExitCode {
    let mut registry = navfuse::standard_plugins();
    registry.add(&outside_vehicle::OutsideVehicle);
    navfuse::command(&registry)
}
