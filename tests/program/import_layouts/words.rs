//! Words of programs for the axes of a vehicle, for logs, depths and pressures, rows whose kind stands after the time,
//! and a velocity log with a clock of its own.

use super::dives::{DEPTH, DIVE, LOG, Table, dive, list};
use super::{SIGMA, record, reference, run, run_from, simulated};
use std::fmt::Write;

const POUNDS: f64 = 6894.757;
const FOOT: f64 = 0.3048;

/// The pressure above vacuum of sea water at a depth, Pa.
fn pressure(depth: f64) -> f64 {
    101_325.0 + 1025.0 * 9.80665 * depth
}

const DIVES: [(&str, Table, Table); 6] = [
    (
        "forward, starboard, down; fathoms",
        Table { headings: "time,V_fwd,V_stbd,V_down", cells: |v, _| list(v) },
        Table { headings: "time,Depth (fathoms)", cells: |v, _| list(&[v[0] / (6.0 * FOOT)]) },
    ),
    (
        "forward, port, up; feet",
        Table { headings: "time,V_fwd,V_port,V_up", cells: |v, _| list(&[v[0], -v[1], -v[2]]) },
        Table { headings: "time,Vehicle Depth (ft)", cells: |v, _| list(&[v[0] / FOOT]) },
    ),
    (
        "words of a log; psi",
        Table { headings: "unix,bt.vx,bt.vy,bt.vz", cells: |v, _| list(v) },
        Table { headings: "time,Press_PSI", cells: |v, _| list(&[pressure(v[0]) / POUNDS]) },
    ),
    (
        "surge, sway, heave; decibar above the surface",
        Table {
            headings: "t,DVL Surge [m/s],DVL Sway [m/s],DVL Heave [m/s]",
            cells: |v, _| list(v),
        },
        Table {
            headings: "elapsed,PRES_DBAR,TEMP_C",
            cells: |v, _| list(&[1e-4 * (pressure(v[0]) - 101_325.0), 12.1]),
        },
    ),
    (
        "a frame; atmospheres",
        Table { headings: "time,velocity_b_x,velocity_b_y,velocity_b_z", cells: |v, _| list(v) },
        Table {
            headings: "time,abs_pressure_atm",
            cells: |v, _| list(&[pressure(v[0]) / 101_325.0]),
        },
    ),
    (
        "a depth of the sea beside that of the vehicle",
        LOG,
        Table { headings: "time,water depth,depth", cells: |v, _| list(&[40.0, v[0]]) },
    ),
];

#[test]
fn words_and_units_of_logs_and_depths_mean_their_channels() {
    let recorded = simulated(DIVE);
    let found = DIVES.iter().map(|(name, log, depth)| (name, dive(&recorded, log, depth)));
    let failed: Vec<_> =
        found.filter(|(_, found)| !matches!(found, Ok(s) if *s <= SIGMA)).collect();
    assert!(failed.is_empty(), "{failed:?}");
}

/// The clock of the log is 0.3 s late, which the motion before the run does not show: the filter estimates it.
#[test]
fn a_late_log_in_a_file_of_its_own_has_a_clock_that_the_filter_finds() {
    let mut recorded = simulated(DIVE);
    let log = recorded.get_mut("dvl").expect("a log");
    log.iter_mut().for_each(|(nanos, _)| *nanos += 300_000_000);
    let sigma = dive(&recorded, &LOG, &DEPTH);
    assert!(matches!(sigma, Ok(sigma) if sigma <= SIGMA), "{sigma:?}");
}

/// A log whose axes point up or to the left, also of one that is mounted at 45 deg, by the depth and the accelerations.
#[test]
fn a_log_whose_axes_point_up_or_to_the_left_is_turned_by_the_motion() {
    let recorded = simulated(DIVE);
    let headings = "time,Surge,Sway,Heave";
    let logs = [
        Table { headings, cells: |v, _| list(&[v[0], v[1], -v[2]]) },
        Table { headings, cells: |v, _| list(&[v[0], -v[1], v[2]]) },
        Table { headings, cells: |v, _| list(&[v[0], -v[1], -v[2]]) },
        Table {
            headings,
            cells: |v, _| {
                let half = std::f64::consts::FRAC_1_SQRT_2;
                list(&[half * (v[0] + v[1]), half * (v[0] - v[1]), -v[2]])
            },
        },
    ];
    for (k, log) in logs.iter().enumerate() {
        let sigma = dive(&recorded, log, &DEPTH);
        assert!(matches!(sigma, Ok(sigma) if sigma <= SIGMA), "{k}: {sigma:?}");
    }
}

/// Log and depth are 37 s behind an IMU in a file of its own, and have time in common with it: the depth shows no
/// motion, but begins and ends with the log.
#[test]
fn a_depth_shares_the_clock_of_a_log_with_which_it_begins_and_ends() {
    let mut recorded = simulated(DIVE);
    for sensor in ["dvl", "depth"] {
        let rows = recorded.get_mut(sensor).expect("a sensor");
        rows.iter_mut().for_each(|(nanos, _)| *nanos -= 37_000_000_000);
    }
    let sigma = dive(&recorded, &LOG, &DEPTH);
    assert!(matches!(sigma, Ok(sigma) if sigma <= SIGMA), "{sigma:?}");
}

/// The IMU counts in GPS time, and log and depth in UTC.
#[test]
fn a_log_and_a_depth_that_lack_the_leap_seconds_of_the_imu_are_shifted() {
    let mut recorded = simulated(DIVE);
    for sensor in ["dvl", "depth"] {
        let rows = recorded.get_mut(sensor).expect("a sensor");
        rows.iter_mut().for_each(|(nanos, _)| *nanos -= 18_000_000_000);
    }
    let sigma = dive(&recorded, &LOG, &DEPTH);
    assert!(matches!(sigma, Ok(sigma) if sigma <= SIGMA), "{sigma:?}");
}

/// Headings of a car, with what its rates are divided by.
const CARS: [(&str, f64); 3] = [
    (
        "Time,Roll Rate,Pitch Rate,Yaw Rate,Long Accel,Lat Accel,Vert Accel",
        std::f64::consts::PI / 180.0,
    ),
    ("time,Gyro_P,Gyro_Q,Gyro_R,Acc_X,Acc_Y,Acc_Z", 1.0),
    ("time,omega_roll,omega_pitch,omega_yaw,acc_longitudinal,acc_lateral,acc_vertical", 1.0),
];

#[test]
fn axes_of_a_vehicle_have_words_and_a_velocity_may_be_west_and_up() {
    let recorded = record();
    for (headings, unit) in CARS {
        let folder = tempfile::tempdir().expect("a folder");
        let truth = folder.path().join("reference.csv");
        reference(&truth, &recorded, 0);
        let mut imu = format!("{headings}\n");
        for (nanos, v) in &recorded["imu"] {
            let rates = [0, 1, 2].map(|k| v[k] / unit);
            let cells = [rates, [v[3], v[4], v[5]]].concat();
            let _ = writeln!(imu, "{:.3},{}", *nanos as f64 * 1e-9, list(&cells));
        }
        let mut fixes = "time,lat,lon,h,v_north,v_west,v_up\n".to_owned();
        for (nanos, v) in &recorded["gnss"] {
            let place = [v[0].to_degrees(), v[1].to_degrees(), v[2], v[3], -v[4], -v[5]];
            let cells = place.map(|v| format!("{v:.9}")).join(",");
            let _ = writeln!(fixes, "{:.3},{cells}", *nanos as f64 * 1e-9);
        }
        let files = [("imu.csv", imu), ("fixes.csv", fixes)].map(|(name, text)| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).expect("the test can write");
            path
        });
        let sigma = run(&files, &truth);
        assert!(matches!(sigma, Ok(sigma) if sigma <= SIGMA), "{headings}: {sigma:?}");
    }
}

/// Rows of one width whose kind stands after the time, and of several widths whose kind stands before it.
#[test]
fn rows_of_several_kinds_are_found_by_the_word_in_any_of_their_first_cells() {
    let recorded = record();
    let row = |first: bool, kind: &str, nanos: i64, values: &[f64]| {
        let cells = values.iter().map(|v| format!("{v:.9}")).collect::<Vec<_>>();
        let time = format!("{:.3}", nanos as f64 * 1e-9);
        match first {
            true => format!("{kind} {time} {}\n", cells.join(" ")),
            false => format!("{time},{kind},{}\n", cells.join(",")),
        }
    };
    for first in [false, true] {
        let folder = tempfile::tempdir().expect("a folder");
        let truth = folder.path().join("reference.csv");
        reference(&truth, &recorded, 0);
        let mut rows: Vec<(i64, String)> = Vec::new();
        for (nanos, v) in &recorded["imu"] {
            let text = match first {
                true => row(first, "IMU", *nanos, v),
                false => row(first, "GYR", *nanos, &v[..3]) + &row(first, "ACC", *nanos, &v[3..6]),
            };
            rows.push((*nanos, text));
        }
        for (nanos, v) in &recorded["gnss"] {
            let place = [v[0].to_degrees(), v[1].to_degrees(), v[2]];
            rows.push((*nanos, row(first, "GPS", *nanos, &place)));
        }
        rows.sort_by_key(|(nanos, _)| *nanos);
        let log = folder.path().join("log.txt");
        let text: String = rows.into_iter().map(|(_, text)| text).collect();
        std::fs::write(&log, text).expect("the test can write");
        let sigma = run(&[log], &truth);
        assert!(matches!(sigma, Ok(sigma) if sigma <= SIGMA), "{first}: {sigma:?}");
    }
}

/// Rows of an IMU, a log and a depth in one file without headings, each with the name of its kind and a date.
#[test]
fn rows_of_kinds_with_dates_are_an_imu_a_log_and_a_depth() {
    let recorded = simulated(DIVE);
    let folder = tempfile::tempdir().expect("a folder");
    let truth = folder.path().join("reference.csv");
    // 2023-11-14T22:13:20Z
    let (date, begin) = (1_700_000_000_000_000_000, 80_000_000_000_i64);
    reference(&truth, &recorded, date);
    let mut rows: Vec<(i64, String)> = Vec::new();
    for (sensor, kind) in [("imu", "IMU"), ("dvl", "DVL"), ("depth", "DEP")] {
        for (t, v) in &recorded[sensor] {
            let clock = clock(t + begin);
            let values = list(v).replace(',', " ");
            rows.push((*t, format!("{kind} 2023/11/14 {clock} {values}\n")));
        }
    }
    rows.sort_by_key(|(t, _)| *t);
    let log = folder.path().join("dive.txt");
    let text: String = rows.into_iter().map(|(_, row)| row).collect();
    std::fs::write(&log, text).expect("the test can write");
    let sigma = run_from(&[log], &truth, Some([48.1, 11.5, -10.0]));
    assert!(matches!(sigma, Ok(sigma) if sigma <= SIGMA), "{sigma:?}");
}

/// The time of the day, so many nanoseconds after 22:12.
fn clock(nanos: i64) -> String {
    let millis = nanos / 1_000_000;
    let [minute, second] = [12 + millis / 60_000, millis / 1000 % 60];
    format!("22:{minute}:{second:02}.{:03}", millis % 1000)
}
