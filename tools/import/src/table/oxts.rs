//! The folder `oxts` of a drive of KITTI: a file for each row, and their times.

use super::units::step;
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

/// Interval of the instrument, s, whose samples the rows are: of the drives with pictures, every tenth.
const SAMPLE: f64 = 0.01;
/// Interval of the rows, s, from which samples between them are missing.
const FEWER: f64 = 0.02;

/// The usual interval of the rows, s.
fn interval(text: &str) -> f64 {
    let second = |line: &str| {
        let mut parts = line.split_whitespace().nth(1)?.split(':').map(str::parse::<f64>);
        let [hour, minute, second] = [parts.next()?, parts.next()?, parts.next()?];
        Some((hour.ok()? * 60.0 + minute.ok()?) * 60.0 + second.ok()?)
    };
    let times: Vec<f64> = text.lines().filter_map(second).collect();
    step(&times)
}

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
    let mut imu = Found { kind: "imu", source: source.clone(), ..Found::default() };
    let interval = interval(beginning);
    if interval > FEWER {
        // a filter takes a row for the mean of the interval that ends with it, whose middle is this much earlier
        let early = 0.5 * (interval - SAMPLE);
        imu.source.retain(|key| !key.starts_with("time ="));
        imu.source.push(format!(
            "time = {{ column = \"time\", date = \"date\", offset = \"{:.1} ms\" }}",
            1e3 * early
        ));
        imu.questions.push(format!(
            "its rows are samples of 10 ms, {:.0} ms apart, and no means of this time: they count {:.0} ms later",
            1e3 * interval,
            1e3 * early
        ));
    }
    let gnss = Found { kind: "gnss", source, velocity: true, ..Found::default() };
    vec![imu, gnss]
}
