//! Tables of inertial units that programs write without headings, or with a line of units.

use crate::found::Found;
use navfuse_core::document::quoted;

/// The columns of KF-GINS: increments of an IMU, positions of a receiver, and a solution. Times are
/// seconds of the GPS week.
const INCREMENTS: [&str; 7] = [
    "time_s",
    "dtheta_x_rad",
    "dtheta_y_rad",
    "dtheta_z_rad",
    "dvel_x_mps",
    "dvel_y_mps",
    "dvel_z_mps",
];
const POSITIONS: [&str; 7] =
    ["time_s", "lat_deg", "lon_deg", "height_m", "h_acc_m", "sigma_e_m", "v_acc_m"];
const SOLUTION: [&str; 11] = [
    "week",
    "time_s",
    "lat_deg",
    "lon_deg",
    "height_m",
    "vel_n_mps",
    "vel_e_mps",
    "vel_d_mps",
    "roll_deg",
    "pitch_deg",
    "yaw_deg",
];
/// Seconds of a week.
const WEEK: f64 = 604_800.0;

/// Recognises a table of numbers without headings, by the number of its columns and by their size.
pub fn without_headings(rows: &[Vec<String>]) -> Option<Found> {
    let numbers = |row: &Vec<String>| -> Option<Vec<f64>> {
        row.iter().map(|cell| cell.parse().ok()).collect()
    };
    let rows: Vec<Vec<f64>> = rows.iter().map(numbers).collect::<Option<_>>()?;
    let width = rows.first()?.len();
    let all = |fits: &dyn Fn(&[f64]) -> bool| rows.iter().all(|r| r.len() == width && fits(r));
    let small = |values: &[f64], most: f64| values.iter().all(|v| v.abs() < most);
    let (kind, headings): (_, &[&str]) = if width == 7
        && all(&|r| (0.0..=WEEK).contains(&r[0]) && small(&r[1..4], 0.2) && small(&r[4..], 5.0))
    {
        ("imu", &INCREMENTS)
    } else if width == 7
        && all(&|r| {
            let place = small(&r[1..2], 90.0) && small(&r[2..3], 360.0);
            (0.0..=WEEK).contains(&r[0]) && place && r[4..].iter().all(|s| (0.0..1e3).contains(s))
        })
    {
        ("gnss", &POSITIONS)
    } else if width == 11
        && all(&|r| (0.0..=WEEK).contains(&r[1]) && small(&r[2..3], 90.0) && small(&r[8..], 361.0))
    {
        ("reference", &SOLUTION)
    } else {
        return None;
    };
    let list: Vec<String> = headings.iter().map(|h| quoted(h)).collect();
    let question = format!("the columns are taken for columns of KF-GINS: {}", headings.join(", "));
    let increments = kind == "imu";
    Some(Found {
        kind,
        sensor: if increments { vec!["output = \"increments\"".to_owned()] } else { Vec::new() },
        source: vec![format!("headings = [{}]", list.join(", "))],
        questions: vec![question],
        velocity: false,
    })
}

/// Recognises the inertial unit in a text export of SBG: a line of headings and a line of units in
/// parentheses, separated by tabs.
pub fn sbg(headings: &[String], units: &[String]) -> Option<Found> {
    let unit = |heading: &str| {
        let place = headings.iter().position(|h| h == heading)?;
        let unit = units.get(place)?.strip_prefix('(')?.strip_suffix(')')?;
        Some(unit.replace('.', "*").replace("s^-2", "s^2").replace("s^-1", "s").replace("*s", "/s"))
    };
    // the axes are forward, right, down
    let mut source = vec!["comment = \"(\"    # the line of units".to_owned()];
    let (title, format) = headings.first().zip(units.first())?;
    source.push(match format.as_str() {
        "(us)" => format!("time = {{ column = {}, unit = \"us\" }}", quoted(title)),
        _ => format!("time = {{ column = {}, format = \"date-time\" }}", quoted(title)),
    });
    for (channel, heading) in [
        ("gyro_x", "gyroX"),
        ("gyro_y", "gyroY"),
        ("gyro_z", "gyroZ"),
        ("accel_x", "accelX"),
        ("accel_y", "accelY"),
        ("accel_z", "accelZ"),
    ] {
        let unit = unit(heading)?;
        source.push(format!(
            "columns.{channel} = {{ column = {}, unit = {} }}",
            quoted(heading),
            quoted(&unit)
        ));
    }
    let (sensor, questions) = (Vec::new(), Vec::new());
    Some(Found { kind: "imu", sensor, source, questions, velocity: false })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use crate::table::recognise;

    #[test]
    fn tables_of_kf_gins_are_recognised_by_their_columns() {
        let imu = "91620.0 1e-5 -2e-5 3e-5 0.001 -0.002 -0.049\n91620.005 0 0 0 0 0 -0.049\n";
        let found = recognise(imu).unwrap().remove(0);
        assert_eq!((found.kind, found.sensor[0].as_str()), ("imu", "output = \"increments\""));
        assert!(found.source.contains(&"delimiter = \"whitespace\"".to_owned()));
        let position = "91620.0 30.44 114.47 20.9 0.01 0.01 0.02\n";
        assert_eq!(recognise(position).unwrap()[0].kind, "gnss");
        let solution = "2017 91620.0 30.44 114.47 20.9 0.1 0.2 0.0 1.5 -2.5 185.7\n";
        assert_eq!(recognise(solution).unwrap()[0].kind, "reference");
        assert!(recognise("1,2,3\n4,5,6\n").is_err());
        assert!(recognise("91620.0 30.44 114.47 20.9 -1 0.01 0.02\n").is_err());
    }

    #[test]
    fn a_text_export_of_sbg_has_its_units_in_the_second_line() {
        let text = "timestamp\tstatus\taccelX\taccelY\taccelZ\tgyroX\tgyroY\tgyroZ\ttemperature\n\
                    (us)\t(na)\t(m.s^-2)\t(m.s^-2)\t(m.s^-2)\t(deg.s^-1)\t(deg.s^-1)\t(deg.s^-1)\t(degC)\n\
                    1000\t0\t0.1\t0.2\t-9.8\t1\t2\t3\t25\n";
        let found = recognise(text).unwrap().remove(0);
        assert_eq!(found.kind, "imu");
        for line in [
            "delimiter = \"\\u0009\"",
            "time = { column = \"timestamp\", unit = \"us\" }",
            "columns.gyro_y = { column = \"gyroY\", unit = \"deg/s\" }",
            "columns.accel_z = { column = \"accelZ\", unit = \"m/s^2\" }",
        ] {
            assert!(found.source.iter().any(|l| l == line), "{line}: {:?}", found.source);
        }
    }
}
