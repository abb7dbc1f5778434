//! What the samples decide: the unit of integers of a position and of a pressure, by the likelihood, and whether a
//! receiver aids at all.

use crate::common::{navfuse, stderr, stdout};
use crate::import_layouts::dives::{DIVE, list};
use crate::import_layouts::{CAR, Recorded, SIGMA, reference, run_beside, simulated};
use std::process::Output;

const GRAVITY: f64 = 9.80665;
const HEADINGS: &str = "time,gx,gy,gz,ax,ay,az";

/// A folder with tables of a recording.
struct Files<'a> {
    recorded: &'a Recorded,
    folder: tempfile::TempDir,
}

impl<'a> Files<'a> {
    fn new(recorded: &'a Recorded) -> Self {
        Self { recorded, folder: tempfile::tempdir().expect("a folder") }
    }

    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).display().to_string()
    }

    /// Writes a table of a sensor, and returns its path.
    fn table(&self, headings: &str, sensor: &str, cells: &dyn Fn(&[f64]) -> String) -> String {
        let row =
            |(nanos, v): &(i64, Vec<f64>)| format!("{:.3},{}\n", *nanos as f64 * 1e-9, cells(v));
        let rows: String = self.recorded[sensor].iter().map(row).collect();
        let path = self.path(&format!("{sensor}.csv"));
        std::fs::write(&path, format!("{headings}\n{rows}")).expect("the test can write");
        path
    }

    fn import(&self, arguments: &[&str]) -> Output {
        navfuse(&[&["import", "--out", &self.path("imported.toml")], arguments].concat())
    }

    /// Imports files, as `import` decides, and runs the scenario: the scenario, and the largest error in sigma.
    fn run(&self, arguments: &[&str]) -> (String, Result<f64, String>) {
        let imported = self.import(arguments);
        assert!(imported.status.success(), "{}", stderr(&imported));
        let truth = self.folder.path().join("truth.csv");
        reference(&truth, self.recorded, 0);
        let text = std::fs::read_to_string(self.path("imported.toml")).expect("a scenario");
        let sigma = run_beside(&text, &truth);
        (text, sigma)
    }
}

#[test]
fn the_likelihood_finds_semicircles() {
    let recorded = simulated(CAR);
    let semicircles = |v: &[f64]| integers(v, std::f64::consts::PI);
    let e7 = |v: &[f64]| integers(v, 214.748_364_8_f64.to_radians());
    for (place, found) in [(semicircles as fn(&[f64]) -> String, true), (e7, false)] {
        let files = Files::new(&recorded);
        let imu = files.table(HEADINGS, "imu", &list);
        let fixes = files.table("time,latitude,longitude,altitude", "gnss", &place);
        let (text, sigma) = files.run(&[&imu, &fixes]);
        assert_eq!(text.contains("lat = 0.838"), found, "{text}");
        assert!(sigma.as_ref().is_ok_and(|sigma| *sigma <= SIGMA), "{sigma:?}");
    }
}

/// Integers of a position, 2^31 of which are so many radians.
fn integers(v: &[f64], half: f64) -> String {
    let [lat, lon] = [v[0], v[1]].map(|angle| (angle / half * 2_f64.powi(31)).round());
    format!("{lat},{lon},{:.3}", v[2])
}

/// Pressures at 10 m to 25 m, from vacuum and from the surface, in units that no heading states, beside an answered height
/// that is 4 m off.
#[test]
fn a_pressure_in_an_unknown_unit_has_the_one_with_which_the_vehicle_dives_as_its_log_measures() {
    let recorded = simulated(DIVE);
    for (air, unit) in [(101_325.0, 1e5), (0.0, 1e5), (101_325.0, 6894.757), (0.0, 1e4)] {
        let files = Files::new(&recorded);
        let pressure = |v: &[f64]| format!("{:.5}", (air + 1025.0 * GRAVITY * v[0]) / unit);
        let imu = files.table(HEADINGS, "imu", &list);
        let log = files.table("time,vx,vy,vz", "dvl", &list);
        let depth = files.table("time,pressure", "depth", &pressure);
        let (text, sigma) = files.run(&[&imu, &log, &depth, "--position", "48.1,11.5,-6"]);
        assert!(sigma.as_ref().is_ok_and(|s| *s <= SIGMA), "{air} {unit}: {sigma:?}\n{text}");
    }
}

/// A receiver that has a height, a velocity and accuracies in each row, and never a position: beside a log of the
/// velocity, and alone.
#[test]
fn a_receiver_that_never_has_a_position_is_left_out_or_refused() {
    let recorded = simulated(DIVE);
    for place in ["nan,nan", "0,0", ",", "NA,NA"] {
        let files = Files::new(&recorded);
        let imu = files.table(HEADINGS, "imu", &list);
        let log = files.table("time,vx,vy,vz", "dvl", &list);
        let head = "time,lat,lon,alt,vel_n_mps,vel_e_mps,vel_d_mps,hacc";
        let fixes = files.table(head, "depth", &|_| format!("{place},12.5,0.1,-0.2,0.05,3.0"));
        let alone = files.import(&[&imu, &fixes]);
        assert!(!alone.status.success(), "{place}");
        assert!(stderr(&alone).contains("no valid sample of gnss"), "{}", stderr(&alone));
        let beside = files.import(&[&imu, &log, &fixes, "--position", "48.1,11.5,-10"]);
        let printed = format!("{}{}", stdout(&beside), stderr(&beside));
        assert!(beside.status.success() && printed.contains("left out"), "{place}: {printed}");
        let text = std::fs::read_to_string(files.path("imported.toml")).expect("a scenario");
        assert!(!text.contains("sensor.gnss"), "{place}: {text}");
    }
}
