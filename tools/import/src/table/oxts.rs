//! The folder `oxts` of a drive of KITTI: a file for each row, and their times.

use crate::found::Found;
use navfuse_core::document::quoted;

/// The columns of a row, in the order of the data format of KITTI. The axes are forward, left, up.
const COLUMNS: [&str; 25] = [
    "lat_deg",
    "lon_deg",
    "height_m",
    "roll",
    "pitch",
    "yaw",
    "vel_n_mps",
    "vel_e_mps",
    "vf",
    "vl",
    "vu",
    "ax",
    "ay",
    "az",
    "accel_x_mps2",
    "accel_y_mps2",
    "accel_z_mps2",
    "wx",
    "wy",
    "wz",
    "gyro_x_radps",
    "gyro_y_radps",
    "gyro_z_radps",
    "h_acc_m",
    "vel_accuracy",
];
/// The columns after them, such as the number of satellites.
const MORE: usize = 5;

/// The inertial unit and the receiver in the rows.
pub fn oxts(beginning: &str) -> Vec<Found> {
    let first = beginning.lines().next().unwrap_or_default();
    // the first line has the date and the time, too
    if first.split_whitespace().count() != 2 + COLUMNS.len() + MORE {
        return Vec::new();
    }
    let mut names = vec!["date".to_owned(), "time".to_owned()];
    names.extend(COLUMNS.map(str::to_owned));
    names.extend((1..=MORE).map(|k| format!("more_{k}")));
    let names: Vec<String> = names.iter().map(|name| quoted(name)).collect();
    let source = vec![
        "delimiter = \"whitespace\"".to_owned(),
        format!("headings = [{}]", names.join(", ")),
        "time = { column = \"time\", date = \"date\" }".to_owned(),
    ];
    let imu = Found { kind: "imu", source: source.clone(), ..Found::default() };
    let gnss = Found { kind: "gnss", source, velocity: true, ..Found::default() };
    vec![imu, gnss]
}
