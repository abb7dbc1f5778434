//! A heading that positions decide, and an IMU whose forward axis a velocity log shows.

use crate::common::{navfuse, stderr};
use crate::import_layouts::dives::{DEPTH, DIVE, LOG, dive, list};
use crate::import_layouts::{SIGMA, reference, run_beside, simulated};
use std::fmt::Write;

/// The IMU counts right, backwards, down; the velocity log forward, right, down.
#[test]
fn an_imu_is_turned_by_a_log_along_whose_first_axis_the_vehicle_moves() {
    let mut recorded = simulated(DIVE);
    for (_, v) in recorded.get_mut("imu").expect("an IMU") {
        *v = vec![v[1], -v[0], v[2], v[4], -v[3], v[5]];
    }
    let sigma = dive(&recorded, &LOG, &DEPTH);
    assert!(matches!(sigma, Ok(sigma) if sigma <= SIGMA), "{sigma:?}");
}

/// Gyros of MEMS do not find north, and a velocity log and positions without a velocity give no course: the likelihood of
/// the samples decides between eight headings.
#[test]
fn positions_beside_a_velocity_log_decide_the_heading_that_gyros_do_not_find() {
    let receiver = "[sensor.gnss]\nhorizontal_noise = \"1.5 m\"\nvertical_noise = \"2.5 m\"\n\
                    simulation = { rate = \"1 Hz\" }\n[sensor.reference]";
    let coarse = DIVE
        .replace("0.3 deg/h/sqrt(Hz)", "8 deg/h/sqrt(Hz)")
        .replace("gyro_bias = { sigma = \"1 deg/h\" }", "gyro_bias = { sigma = \"8 deg/h\" }")
        .replace("heading = \"20 deg\"", "heading = \"200 deg\"")
        .replace("[sensor.reference]", receiver);
    let recorded = simulated(&coarse);
    let folder = tempfile::tempdir().expect("a folder");
    let place = |name: &str| folder.path().join(name).display().to_string();
    let write = |name: &str, headings: &str, sensor: &str, degrees: bool| {
        let mut text = format!("{headings}\n");
        for (nanos, v) in &recorded[sensor] {
            let cells = match degrees {
                true => format!("{:.9},{:.9},{:.3}", v[0].to_degrees(), v[1].to_degrees(), v[2]),
                false => list(v),
            };
            let _ = writeln!(text, "{:.3},{cells}", *nanos as f64 * 1e-9);
        }
        std::fs::write(place(name), text).expect("the test can write");
        place(name)
    };
    let files = [
        write("imu.csv", "time,gx,gy,gz,ax,ay,az", "imu", false),
        write("log.csv", "time_s,vel_x_mps,vel_y_mps,vel_z_mps", "dvl", false),
        write("fixes.csv", "time,latitude,longitude,altitude", "gnss", true),
    ];
    let scenario = place("dive.toml");
    let [imu, log, fixes] = files.each_ref().map(String::as_str);
    let imported = navfuse(&["import", imu, log, fixes, "--out", &scenario]);
    assert!(imported.status.success(), "{}", stderr(&imported));
    let truth = folder.path().join("reference.csv");
    reference(&truth, &recorded, 0);
    let text = std::fs::read_to_string(&scenario).expect("a scenario");
    assert!(text.contains("\"180 deg\"]") || text.contains("\"225 deg\"]"), "{text}");
    let sigma = run_beside(&text, &truth);
    assert!(matches!(sigma, Ok(sigma) if sigma <= SIGMA), "{sigma:?}");
}
