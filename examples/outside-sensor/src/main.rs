//! The `navfuse` command with a magnetometer.

fn main() -> std::process::ExitCode {
    let mut registry = navfuse::standard_plugins();
    registry.sensor::<outside_sensor::FieldDirection>();
    navfuse::command(&registry)
}
