//! A dive with a velocity log and a depth, written in the ways of several programs: numbers that stand for no
//! measurement, flags, and velocities along the beams.

use crate::import_layouts::{Recorded, SIGMA, reference, run_from, simulated};
use std::f64::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};

/// Five minutes of turns and changes of speed and depth, with a tactical IMU.
pub const DIVE: &str = r#"
seed = 5
[estimator]
draw = "start"
[process.ins]
attitude = { sigma = "0.5 deg" }
velocity = { sigma = "1 cm/s" }
position = { sigma = "1 m" }
gyro_bias = { sigma = "1 deg/h" }
accel_bias = { sigma = "300 ug" }
[sensor.imu]
gyro_noise = "0.3 deg/h/sqrt(Hz)"
accel_noise = "60 ug/sqrt(Hz)"
simulation = { rate = "50 Hz" }
[sensor.dvl]
noise = "1 cm/s"
simulation = { rate = "4 Hz" }
[sensor.depth]
noise = "5 cm"
simulation = { rate = "4 Hz" }
[sensor.reference]
simulation = { rate = "1 Hz" }
[source.simulation]
start = { latitude = "48.1 deg", longitude = "11.5 deg", height = "-10 m", heading = "20 deg" }
segments = [
  { type = "surge", duration = "8 s", speed = "1.6 m/s" },
  { type = "turn", duration = "15 s", angle = "70 deg" },
  { type = "descend", duration = "30 s", rate = "0.3 m/s" },
  { type = "turn", duration = "15 s", angle = "-110 deg" },
  { type = "surge", duration = "10 s", speed = "1 m/s" },
  { type = "turn", duration = "15 s", angle = "150 deg" },
  { type = "surge", duration = "10 s", speed = "2 m/s" },
  { type = "ascend", duration = "25 s", rate = "0.2 m/s" },
  { type = "turn", duration = "15 s", angle = "-60 deg" },
  { type = "surge", duration = "8 s", speed = "1.2 m/s" },
  { type = "turn", duration = "15 s", angle = "90 deg" },
  { type = "descend", duration = "30 s", rate = "0.3 m/s" },
  { type = "turn", duration = "15 s", angle = "-120 deg" },
  { type = "surge", duration = "10 s", speed = "1.8 m/s" },
  { type = "turn", duration = "15 s", angle = "100 deg" },
  { type = "cruise", duration = "30 s" },
]
"#;
/// Start of the dive, and spans without bottom, s.
const START: [f64; 3] = [48.1, 11.5, -10.0];
const LOST: [[i64; 2]; 2] = [[0, 20], [150, 160]];

fn lost(nanos: i64) -> bool {
    LOST.iter().any(|[from, to]| (*from..*to).contains(&(nanos / 1_000_000_000)))
}

/// A table of a sensor: the cells of a row from its values, and whether the bottom is lost.
pub struct Table {
    pub headings: &'static str,
    pub cells: fn(&[f64], bool) -> String,
}

fn put(folder: &Path, name: &str, rows: &[(i64, Vec<f64>)], table: &Table) -> PathBuf {
    let mut text = format!("{}\n", table.headings);
    for (nanos, v) in rows {
        let time = *nanos as f64 * 1e-9;
        text += &format!("{time:.3},{}\n", (table.cells)(v, lost(*nanos)));
    }
    let path = folder.join(name);
    std::fs::write(&path, text).expect("the test can write");
    path
}

pub fn list(values: &[f64]) -> String {
    values.iter().map(|v| format!("{v:.7}")).collect::<Vec<_>>().join(",")
}

const IMU: Table = Table { headings: "time,gx,gy,gz,ax,ay,az", cells: |v, _| list(v) };
pub const LOG: Table =
    Table { headings: "time_s,vel_x_mps,vel_y_mps,vel_z_mps", cells: |v, _| list(v) };
pub const DEPTH: Table = Table { headings: "time_s,depth_m", cells: |v, _| list(v) };

/// Runs the dive with a table of the log and one of the depth: the largest error in sigma.
pub fn dive(recorded: &Recorded, log: &Table, depth: &Table) -> Result<f64, String> {
    let folder = tempfile::tempdir().expect("a folder");
    let truth = folder.path().join("reference.csv");
    reference(&truth, recorded, 0);
    let files = [("imu", "imu.csv", &IMU), ("dvl", "log.csv", log), ("depth", "depth.csv", depth)];
    let files =
        files.map(|(sensor, name, table)| put(folder.path(), name, &recorded[sensor], table));
    run_from(&files, &truth, Some(START))
}

fn or(v: &[f64], lost: bool, number: f64) -> String {
    if lost { list(&[number; 3]) } else { list(v) }
}

/// What programs write where an instrument has no measurement.
const ABSENT: [(&str, Table, Table); 6] = [
    (
        "mm/s with -32768",
        Table {
            headings: "time,vx_mm,vy_mm,vz_mm",
            cells: |v, lost| {
                let cell = |v: &f64| if lost { -32768.0 } else { (1e3 * v).round() };
                v.iter().map(|v| format!("{:.0}", cell(v))).collect::<Vec<_>>().join(",")
            },
        },
        DEPTH,
    ),
    ("99.999", Table { headings: "time,u,v,w", cells: |v, lost| or(v, lost, 99.999) }, DEPTH),
    ("zeros", Table { headings: LOG.headings, cells: |v, lost| or(v, lost, 0.0) }, DEPTH),
    (
        "zeros and a letter",
        Table {
            headings: "time,vx,vy,vz,status",
            cells: |v, lost| format!("{},{}", or(v, lost, 0.0), if lost { "V" } else { "A" }),
        },
        DEPTH,
    ),
    (
        "a depth of -9999",
        LOG,
        Table {
            headings: "time,depth",
            cells: |v, lost| if lost { "-9999".to_owned() } else { list(v) },
        },
    ),
    (
        "a pressure of zero",
        LOG,
        Table {
            headings: "time,pressure",
            cells: |v, lost| {
                let kilopascals = (101_325.0 + 1025.0 * 9.80665 * v[0]) / 1000.0;
                list(&[if lost { 0.0 } else { kilopascals }])
            },
        },
    ),
];

#[test]
fn numbers_that_stand_for_no_measurement_are_left_out() {
    let recorded = simulated(DIVE);
    let mut failed = Vec::new();
    for (name, log, depth) in &ABSENT {
        match dive(&recorded, log, depth) {
            Ok(sigma) if sigma <= SIGMA => {}
            other => failed.push(format!("{name}: {other:?}")),
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

/// The velocities along beams with a slant and azimuths, deg, times a factor.
fn along<const N: usize>(v: &[f64], slant: f64, azimuth: [f64; N], factor: f64) -> String {
    let (sin, cos) = slant.to_radians().sin_cos();
    let beam = |azimuth: f64| {
        let (y, x) = azimuth.to_radians().sin_cos();
        factor * (sin * (x * v[0] + y * v[1]) + cos * v[2])
    };
    list(&azimuth.map(beam))
}

/// Logs with velocities along their beams: an X, the pairs of a Janus, the other sense of rotation with the other
/// sign, three beams, and beams whose angles the table has.
const BEAMS: [(&str, Table); 5] = [
    (
        "an X",
        Table {
            headings: "time,beam1,beam2,beam3,beam4",
            cells: |v, _| along(v, 30.0, [45.0, 135.0, 225.0, 315.0], 1.0),
        },
    ),
    (
        "pairs",
        Table {
            headings: "time,b1,b2,b3,b4",
            cells: |v, _| along(v, 20.0, [270.0, 90.0, 0.0, 180.0], 1.0),
        },
    ),
    (
        "the other sense and sign, in mm/s",
        Table {
            headings: "time,beam1_vel [mm/s],beam2_vel [mm/s],beam3_vel [mm/s],beam4_vel [mm/s]",
            cells: |v, _| along(v, 22.5, [45.0, 315.0, 225.0, 135.0], -1000.0),
        },
    ),
    (
        "three",
        Table {
            headings: "time_s,beam1_mps,beam2_mps,beam3_mps",
            cells: |v, _| along(v, 25.0, [0.0, 120.0, 240.0], 1.0),
        },
    ),
    (
        "known angles",
        Table {
            headings: "time,vel_beam_1,vel_beam_2,vel_beam_3,vel_beam_4,beam_angle_deg,beam1_azimuth,\
                       beam2_azimuth,beam3_azimuth,beam4_azimuth",
            cells: |v, _| {
                let azimuth = [30.0, 120.0, 210.0, 300.0];
                format!("{},25,{}", along(v, 25.0, azimuth, 1.0), list(&azimuth))
            },
        },
    ),
];

#[test]
fn velocities_along_beams_need_no_angles_where_the_motion_shows_them() {
    let recorded = simulated(DIVE);
    let mut failed = Vec::new();
    for (name, log) in &BEAMS {
        match dive(&recorded, log, &DEPTH) {
            Ok(sigma) if sigma <= SIGMA => {}
            other => failed.push(format!("{name}: {other:?}")),
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

/// Nothing of the dive but the IMU at rest: no sensor shows the heading, and a relative one is zero.
#[test]
fn a_heading_that_no_file_shows_is_counted_from_unless_an_answer_gives_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut text = "time,gx,gy,gz,ax,ay,az\n".to_owned();
    let mut noise = 0.37_f64;
    for k in 0..1500 {
        let mut draw = || {
            noise = (997.0 * noise + 0.1234).fract();
            noise - 0.5
        };
        // the noise of MEMS, which do not find north: 0.1 deg/s
        let row = [0.0, 0.0, 0.0, 0.0, 0.0, -9.81].map(|mean| mean + 0.02 * FRAC_PI_2 * draw());
        text += &format!("{:.2},{}\n", 0.01 * f64::from(k), list(&row));
    }
    let imu = folder.path().join("imu.csv");
    std::fs::write(&imu, text).expect("the test can write");
    let at = |name: &str| folder.path().join(name).display().to_string();
    let run = |out: &str, more: &[&str]| {
        let imu = imu.display().to_string();
        let first = ["import", "--out", out, "--position", "43,5,0", &imu];
        let imported = crate::common::navfuse(&[&first[..], more].concat());
        assert!(imported.status.success(), "{}", crate::common::stderr(&imported));
        let ran = crate::common::navfuse(&["run", out, "--no-output"]);
        let words = |text: String| text.split_whitespace().collect::<Vec<_>>().join(" ");
        [words(crate::common::stdout(&imported)), words(crate::common::stdout(&ran))]
    };
    let [asked, verdict] = run(&at("asked.toml"), &[]);
    assert!(asked.contains("count from it; give it with --heading"), "{asked}");
    assert!(verdict.contains("verdict: consistent"), "{verdict}");
    for heading in ["relative", "75", "-20,2"] {
        let [asked, verdict] = run(&at(&format!("{heading}.toml")), &["--heading", heading]);
        assert!(!asked.contains("--heading"), "{asked}");
        assert!(verdict.contains("verdict: consistent"), "{heading}: {verdict}");
    }
    let imu = imu.display().to_string();
    let wrong = ["import", "--out", &at("wrong.toml"), "--heading", "north", &imu];
    let wrong = crate::common::navfuse(&wrong);
    assert!(crate::common::stderr(&wrong).contains("a heading and its 1-sigma"));
}

/// A lake whose surface is 1400 m above the ellipsoid: the depth counts from there.
#[test]
fn a_depth_in_a_lake_counts_from_its_surface() {
    let recorded = simulated(&DIVE.replace("\"-10 m\"", "\"1390 m\""));
    let depth = Table { headings: DEPTH.headings, cells: |v, _| list(&[v[0] + 1400.0]) };
    let folder = tempfile::tempdir().expect("a folder");
    let truth = folder.path().join("reference.csv");
    reference(&truth, &recorded, 0);
    let files =
        [("imu", "imu.csv", &IMU), ("dvl", "log.csv", &LOG), ("depth", "depth.csv", &depth)];
    let files =
        files.map(|(sensor, name, table)| put(folder.path(), name, &recorded[sensor], table));
    let sigma = run_from(&files, &truth, Some([START[0], START[1], 1390.0]));
    assert!(matches!(sigma, Ok(sigma) if sigma <= SIGMA), "{sigma:?}");
}
