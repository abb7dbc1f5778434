//! Tables of KF-GINS, which have no headings.

use super::content::increases;
use super::layout::Layout;
use super::place;
use crate::found::Found;

/// The columns of KF-GINS: positions of a receiver, and a solution. Times are seconds of the GPS
/// week.
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

/// Recognises positions and solutions by the number of their columns and by their size.
pub fn without_headings(layout: &Layout) -> Option<Found> {
    let width = layout.width();
    let columns: Vec<Vec<f64>> = (0..width).map(|k| layout.column(k)).collect();
    let all = |k: usize, fits: &dyn Fn(f64) -> bool| columns[k].iter().all(|v| fits(*v));
    let week = |k: usize| all(k, &|v| (0.0..=WEEK).contains(&v)) && increases(&columns[k]);
    let below = |k: usize, most: f64| all(k, &|v| v.abs() < most);
    let sigma = |k: usize| all(k, &|v| (0.0..1e3).contains(&v));
    // forces and rates have the range of angles too, but they change faster than a vehicle moves
    let place = |k: usize| {
        place::order(&columns[k - 1], &columns, k).is_some_and(|order| order[0] == "lat")
    };
    let (kind, headings): (_, &[&str]) = match width {
        7 if week(0) && place(1) && (4..7).all(sigma) => ("gnss", &POSITIONS),
        11 if week(1) && place(2) && (8..11).all(|k| below(k, 361.0)) => ("reference", &SOLUTION),
        _ => return None,
    };
    let mut layout = layout.clone();
    layout.headings = headings.iter().map(|h| (*h).to_owned()).collect();
    layout.given = true;
    let question = format!("the columns are taken for columns of KF-GINS: {}", headings.join(", "));
    let (source, questions) = (layout.keys(), vec![question]);
    Some(Found { kind, source, questions, ..Found::default() })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
    use crate::table::recognise;

    #[test]
    fn tables_of_kf_gins_are_recognised_by_their_columns() {
        let row = |k: usize| {
            let (time, turn) = (91620.0 + 0.005 * k as f64, k % 3);
            format!(
                "{time:.3} {turn}e-5 -{turn}e-5 2{turn}e-6 0.00{turn} 0.00{turn} -0.04{}\n",
                8 + k % 2
            )
        };
        let imu: String = (0..40).map(row).collect();
        let found = recognise(&imu, "").unwrap().remove(0);
        assert_eq!((found.kind, found.sensor[0].as_str()), ("imu", "output = \"increments\""));
        assert!(found.source.contains(&"delimiter = \"whitespace\"".to_owned()));
        let position =
            "91620.0 30.44 114.47 20.9 0.01 0.01 0.02\n91621.0 30.44 114.47 20.9 0.01 0.01 0.02\n";
        assert_eq!(recognise(position, "").unwrap()[0].kind, "gnss");
        let solution = "2017 91620.0 30.44 114.47 20.9 0.1 0.2 0.0 1.5 -2.5 185.7\n\
                        2017 91620.1 30.44 114.47 20.9 0.1 0.2 0.0 1.5 -2.5 185.7\n";
        assert_eq!(recognise(solution, "").unwrap()[0].kind, "reference");
        assert!(recognise("1,2,3\n4,5,6\n", "").is_err());
        assert!(recognise("91620.0 30.44 114.47 20.9 -1 0.01 0.02\n", "").is_err());
    }

    #[test]
    fn a_text_export_of_sbg_has_its_units_in_the_second_line() {
        let text = "timestamp\tstatus\taccelX\taccelY\taccelZ\tgyroX\tgyroY\tgyroZ\ttemperature\n\
                    (us)\t(na)\t(m.s^-2)\t(m.s^-2)\t(m.s^-2)\t(deg.s^-1)\t(deg.s^-1)\t(deg.s^-1)\t(degC)\n\
                    1000\t0\t0.1\t0.2\t-9.8\t1\t2\t3\t25\n";
        let found = recognise(text, "").unwrap().remove(0);
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
