//! What the sink writes of a run.
#![allow(clippy::unwrap_used, clippy::panic)] // a failed test may panic

mod common;

use common::{DVL, DVL_HEADER, IMU, IMU_HEADER, REFERENCE, assemble, folder};
use std::path::Path;
use std::sync::atomic::AtomicBool;

const REFERENCE_HEADER: &str =
    "time_s,lat_deg,lon_deg,height_m,vel_n_mps,vel_e_mps,vel_d_mps,roll_deg,pitch_deg,yaw_deg\n";

/// Two seconds at rest, with a DVL at 2 Hz, one sample of which is far off.
fn at_rest(sensors: &str, source: &str) -> tempfile::TempDir {
    let imu: String =
        (1..=200).map(|k| format!("{}.{:02},0,0,0,0,0,-9.795\n", k / 100, k % 100)).collect();
    let folder = folder(&[
        ("imu.csv", format!("{IMU_HEADER}{imu}")),
        ("dvl.csv", format!("{DVL_HEADER}0.5,0.001,,0\n1,5,0,0\n1.5,0.001,0,0\n2,,,\n")),
        (
            "reference.csv",
            format!("{REFERENCE_HEADER}0.1,32,34,0,0,0,0,0,0,0\n1,32,34,0,0,0,0,0,0,0\n"),
        ),
    ]);
    let assembly =
        assemble(folder.path(), sensors, &format!("[source.csv]\n{source}"), true).unwrap();
    let finished = navfuse_core::run::runner::run(assembly, &AtomicBool::new(false), |_| {});
    assert!(finished.error.is_none(), "{:?}", finished.error);
    folder
}

fn table(path: &Path) -> (Vec<String>, Vec<Vec<String>>) {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines().map(|l| l.split(',').map(str::to_owned).collect::<Vec<_>>());
    let header = lines.next().unwrap();
    let rows: Vec<_> = lines.collect();
    assert!(rows.iter().all(|r| r.len() == header.len()));
    (header, rows)
}

#[test]
fn a_run_is_told_only_where_the_scenario_asks() {
    let folder = at_rest(&[IMU, DVL].concat(), "");
    assert!(!folder.path().join("estimate.csv").exists());
}

#[test]
fn estimates_have_headings_with_units_and_a_row_an_epoch() {
    let folder = at_rest(&[IMU, DVL, REFERENCE].concat(), "[sink.csv]\n");
    let (header, rows) = table(&folder.path().join("estimate.csv"));
    let place = |name: &str| {
        header.iter().position(|h| h == name).unwrap_or_else(|| panic!("{name} in {header:?}"))
    };
    assert_eq!(header[0], "time_s");
    for name in [
        "ins.position.latitude_deg",
        "ins.position.longitude_deg",
        "ins.position.height_m",
        "ins.position.north_sigma_m",
        "ins.position.down_error_m",
        "ins.velocity.east_mps",
        "ins.velocity.east_sigma_mps",
        "ins.velocity.east_error_mps",
        "ins.attitude.yaw_sigma_deg",
        "ins.gyro_bias.x_degph",
        "dvl.scale.k",
        "dvl.scale.k_sigma",
    ] {
        place(name);
    }
    let at = |row: &[String], name: &str| row[place(name)].parse::<f64>().ok();
    // 10 Hz from the reference's first sample at 0.1 s to 2 s
    let mut times: Vec<f64> = rows.iter().map(|r| r[0].parse().unwrap()).collect();
    // at 1 s there may be two: before the reference is known, and with it
    times.dedup();
    assert_eq!((times.len(), times[0], times[19]), (20, 0.1, 2.0));
    assert_eq!(
        (at(&rows[0], "ins.position.latitude_deg"), at(&rows[0], "ins.position.north_sigma_m")),
        (Some(32.0), Some(1.0))
    );
    // truth is known at 0.1 s and 1 s
    let known: Vec<f64> = rows
        .iter()
        .filter(|r| at(r, "ins.velocity.east_error_mps").is_some())
        .map(|r| r[0].parse().unwrap())
        .collect();
    assert_eq!(known, [0.1, 1.0]);
}

#[test]
fn without_truth_there_are_no_columns_of_errors() {
    let folder = at_rest(&[IMU, DVL].concat(), "[sink.csv]\n");
    let (header, _) = table(&folder.path().join("estimate.csv"));
    assert!(header.iter().all(|h| !h.contains("_error")), "{header:?}");
}

#[test]
fn innovations_have_a_row_a_measurement() {
    let folder = at_rest(&[IMU, DVL].concat(), "[sink.csv]\n");
    let (header, rows) = table(&folder.path().join("innovations.csv"));
    let expected = "time_s,sensor,outcome,nis,threshold,dvl.vel_x_mps,dvl.vel_x_sigma_mps,\
                    dvl.vel_y_mps,dvl.vel_y_sigma_mps,\
                    dvl.vel_z_mps,dvl.vel_z_sigma_mps";
    assert_eq!(header.join(","), expected);
    let start: Vec<_> = rows.iter().map(|r| r[..3].join(" ")).collect();
    assert_eq!(start, ["0.5 dvl accepted", "1 dvl gated", "1.5 dvl accepted"]);
    // the channel that was not there is empty
    assert!(
        rows[0][5].parse::<f64>().is_ok()
            && rows[0][7].is_empty()
            && rows[0][9].parse::<f64>().is_ok()
    );
    // 5 m/s, and a sigma not below the sensor's 2 cm/s
    assert!(
        (rows[1][5].parse::<f64>().unwrap() - 5.0).abs() < 1.0
            && rows[1][6].parse::<f64>().unwrap() >= 0.02
    );
}
