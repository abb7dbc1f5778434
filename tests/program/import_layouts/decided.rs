//! The unit of integers of a position, between which the likelihood of the samples decides.

use crate::common::{navfuse, stderr};
use crate::import_layouts::dives::list;
use crate::import_layouts::{CAR, Recorded, SIGMA, reference, run_beside, simulated};
use std::fmt::Write;

/// Imports an IMU beside positions alone, as `import` decides, and runs the scenario: the largest error in
/// sigma, and the scenario.
fn decided(recorded: &Recorded, position: fn(&[f64]) -> String) -> (String, Result<f64, String>) {
    let folder = tempfile::tempdir().expect("a folder");
    let place = |name: &str| folder.path().join(name).display().to_string();
    let write = |name: &str, head: &str, sensor: &str, cells: &dyn Fn(&[f64]) -> String| {
        let mut text = format!("{head}\n");
        for (nanos, v) in &recorded[sensor] {
            let _ = writeln!(text, "{:.3},{}", *nanos as f64 * 1e-9, cells(v));
        }
        std::fs::write(place(name), text).expect("the test can write");
        place(name)
    };
    let imu = write("imu.csv", "time,gx,gy,gz,ax,ay,az", "imu", &list);
    let fixes = write("fixes.csv", "time,latitude,longitude,altitude", "gnss", &|v| position(v));
    let scenario = place("drive.toml");
    let imported = navfuse(&["import", &imu, &fixes, "--out", &scenario]);
    assert!(imported.status.success(), "{}", stderr(&imported));
    let truth = folder.path().join("reference.csv");
    reference(&truth, recorded, 0);
    let text = std::fs::read_to_string(&scenario).expect("a scenario");
    let sigma = run_beside(&text, &truth);
    (text, sigma)
}

#[test]
fn the_likelihood_finds_semicircles() {
    let recorded = simulated(CAR);
    let semicircles = |v: &[f64]| integers(v, std::f64::consts::PI);
    let e7 = |v: &[f64]| integers(v, 214.748_364_8_f64.to_radians());
    for (place, found) in [(semicircles as fn(&[f64]) -> String, true), (e7, false)] {
        let (text, sigma) = decided(&recorded, place);
        assert_eq!(text.contains("lat = 0.838"), found, "{text}");
        assert!(sigma.as_ref().is_ok_and(|sigma| *sigma <= SIGMA), "{sigma:?}");
    }
}

/// Integers of a position, 2^31 of which are so many radians.
fn integers(v: &[f64], half: f64) -> String {
    let [lat, lon] = [v[0], v[1]].map(|angle| (angle / half * 2_f64.powi(31)).round());
    format!("{lat},{lon},{:.3}", v[2])
}
