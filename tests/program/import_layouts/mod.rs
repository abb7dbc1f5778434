//! One recording of a car, written in the layouts of many programs: `import` reads each of them
//! without an answer, and the run stays within its sigma; or it names what is missing.

mod decided;
mod dialects;
mod dives;
mod headings;
mod programs;
mod words;

use dialects::{Layout, Random};
use navfuse_core::document::Document;
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_import::Answers;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Number of layouts, and the share that must run.
const LAYOUTS: u64 = 48;
const SHARE: f64 = 0.95;
/// Largest error in sigma.
const SIGMA: f64 = 3.5;

/// A minute of driving on a bumpy road, with a MEMS IMU and GNSS.
const CAR: &str = r#"
seed = 11
[estimator]
draw = "start"
[process.ins]
attitude = { sigma = "0.5 deg" }
velocity = { sigma = "5 cm/s" }
position = { sigma = "10 cm" }
gyro_bias = { sigma = "100 deg/h", truth = ["30 deg/h", "-20 deg/h", "25 deg/h"] }
accel_bias = { sigma = "5 mg", truth = ["0.5 mg", "-0.4 mg", "0.6 mg"] }
[sensor.imu]
gyro_noise = "18 deg/h/sqrt(Hz)"
accel_noise = "150 ug/sqrt(Hz)"
simulation = { rate = "100 Hz" }
[sensor.gnss]
horizontal_noise = "1.5 m"
vertical_noise = "2.5 m"
velocity_noise = "5 cm/s"
simulation = { rate = "5 Hz" }
[sensor.reference]
simulation = { rate = "1 Hz" }
[source.simulation]
start = { latitude = "48.1 deg", longitude = "11.5 deg", height = "500 m", heading = "35 deg" }
segments = [
  { type = "static", duration = "2 s" },
  { type = "surge", duration = "8 s", speed = "12 m/s" },
  { type = "turn", duration = "10 s", angle = "80 deg" },
  { type = "surge", duration = "6 s", speed = "17 m/s" },
  { type = "turn", duration = "8 s", angle = "-70 deg" },
  { type = "surge", duration = "6 s", speed = "9 m/s" },
  { type = "turn", duration = "12 s", angle = "120 deg" },
  { type = "cruise", duration = "8 s" },
]
"#;

/// The samples of a recording by the name of the sensor: time in nanoseconds, and channels.
pub type Recorded = BTreeMap<String, Vec<(i64, Vec<f64>)>>;

fn record() -> Recorded {
    simulated(CAR)
}

fn simulated(scenario: &str) -> Recorded {
    let registry = navfuse::standard_plugins();
    let document = Document::parse("car.toml", scenario.to_owned()).expect("TOML");
    let scenario = Scenario::new(&registry, document, &[]).expect("a scenario");
    let assembly = scenario.assemble(None).unwrap_or_else(|e| panic!("{e}"));
    let mut recorded = Recorded::new();
    for (_, mut source) in assembly.sources {
        let mut sample = Sample::empty(Time::MIN, SensorId(0));
        while source.next(&mut sample).expect("a simulation does not fail") {
            let info = &assembly.composition.sensors[sample.sensor.0].info;
            let channel = |k: usize| sample.get(k).unwrap_or(f64::NAN);
            let row = (0..info.channels.len()).map(channel).collect();
            recorded.entry(info.name.clone()).or_default().push((sample.time.nanos(), row));
        }
    }
    recorded
}

/// Writes the reference on the clock of the IMU, which is `offset` nanoseconds ahead.
fn reference(path: &Path, recorded: &Recorded, offset: i64) {
    let mut text = "time_ns,lat_rad,lon_rad,height_m,vel_n_mps,vel_e_mps,vel_d_mps,roll_rad,\
                    pitch_rad,yaw_rad\n"
        .to_owned();
    for (nanos, v) in &recorded["reference"] {
        let cells: Vec<String> = v.iter().map(|v| format!("{v:e}")).collect();
        let _ = writeln!(text, "{},{}", nanos + offset, cells.join(","));
    }
    std::fs::write(path, text).expect("the test can write");
}

/// Imports files and runs the scenario next to the reference: the largest error of navigation in sigma, or
/// the message.
fn run(files: &[PathBuf], reference: &Path) -> Result<f64, String> {
    run_from(files, reference, None)
}

/// The scenario that `import` writes, with a position as the answer.
fn import(files: &[PathBuf], position: Option<[f64; 3]>) -> Result<String, String> {
    let registry = navfuse::standard_plugins();
    let answers = Answers { name: "imported".to_owned(), position, ..Answers::default() };
    let (place, stop) = (Path::new("imported.toml"), AtomicBool::new(false));
    let imported = navfuse_import::import(&registry, files, place, &answers, &stop);
    Ok(imported.map_err(|e| e.to_string())?.expect("nobody stops it").scenario)
}

fn run_from(
    files: &[PathBuf],
    reference: &Path,
    position: Option<[f64; 3]>,
) -> Result<f64, String> {
    run_beside(&import(files, position)?, reference)
}

/// Runs a scenario next to the reference: the largest error of navigation in sigma.
fn run_beside(scenario: &str, reference: &Path) -> Result<f64, String> {
    let registry = navfuse::standard_plugins();
    let text = format!(
        "{scenario}\n[sensor.reference]\n[source.csv.files.reference]\npath = {reference:?}\n"
    );
    let document = Document::parse("imported.toml", text).map_err(|e| e.to_string())?;
    let scenario = Scenario::new(&registry, document, &[]).map_err(|e| e.to_string())?;
    let assembly = scenario.assemble(None).map_err(|e| e.to_string())?;
    let finished = runner::run(assembly, &AtomicBool::new(false), |_| {});
    if let Some(error) = finished.error {
        return Err(format!("the run failed: {error}"));
    }
    let navigation = |name: &str| ["ins.attitude", "ins.velocity", "ins.position"].contains(&name);
    let rows = finished.summary.rows.iter().filter(|row| navigation(&row.name));
    let errors = rows.flat_map(|row| {
        let error = row.error.clone().expect("a reference");
        error.into_iter().zip(row.error_sigma.clone())
    });
    Ok(errors.map(|(error, sigma)| (error / sigma).abs()).fold(0.0, f64::max))
}

#[test]
fn layouts_of_many_programs_run_untouched_or_name_what_is_missing() {
    let recorded = record();
    let mut random = Random(20_261_125);
    let (mut held, mut unnamed) = (0, 0);
    for _ in 0..LAYOUTS {
        let layout = Layout::draw(&mut random);
        let folder = tempfile::tempdir().expect("a folder");
        let truth = folder.path().join("reference.csv");
        reference(&truth, &recorded, layout.origin);
        match run(&layout.write(folder.path(), &recorded), &truth) {
            Ok(sigma) if sigma <= SIGMA => held += 1,
            Ok(sigma) => println!("{sigma:.1} sigma: {layout:?}"),
            Err(message) => {
                println!("{message}: {layout:?}");
                let named = ["column", "unit", "time", "IMU"].iter().any(|w| message.contains(w));
                unnamed += usize::from(!named || message.contains("the run failed"));
            }
        }
    }
    println!("{held} of {LAYOUTS} run within {SIGMA} sigma");
    assert_eq!(unnamed, 0, "a message does not name what is missing");
    assert!(f64::from(held) >= SHARE * LAYOUTS as f64);
}

#[test]
fn files_of_many_programs_run_without_an_answer() {
    let recorded = record();
    let mut failed = Vec::new();
    for program in programs::all() {
        let [folder, own] = [0, 1].map(|_| tempfile::tempdir().expect("a folder"));
        let written = program.write(&recorded, folder.path());
        let truth = own.path().join("reference.csv");
        reference(&truth, &recorded, written.offset);
        match run(&written.given, &truth) {
            Ok(sigma) if sigma <= SIGMA => {}
            other => failed.push(format!("{}: {other:?}", program.name)),
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

/// The rows of the pictures' drives are every tenth sample of their IMU: their times count from the middle of the time
/// that a row stands for, so that the receiver is not late.
#[test]
fn rows_of_kitti_are_samples_and_no_means_of_their_interval() {
    let recorded = record();
    let [folder, own] = [0, 1].map(|_| tempfile::tempdir().expect("a folder"));
    let kitti = programs::all().find(|p| p.name.starts_with("KITTI")).expect("it is there");
    let written = kitti.write(&recorded, folder.path());
    let truth = own.path().join("reference.csv");
    reference(&truth, &recorded, written.offset);
    let scenario = import(&written.given, None).unwrap_or_else(|e| panic!("{e}"));
    assert!(scenario.contains("offset = \"45.0 ms\""), "{scenario}");
    let sigma = run(&written.given, &truth).unwrap_or_else(|e| panic!("{e}"));
    // 2.5 without the offset
    assert!(sigma < 2.0, "{sigma}");
}

/// An IMU at a yaw, one beside the course by less than `import` turns it, and one that is tilted: the error of
/// the angles that `import` guesses is part of the sigma.
#[test]
fn an_imu_at_any_angle_is_turned_along_its_vehicle_and_its_error_is_in_the_sigma() {
    let recorded = record();
    for angles in [[0.0, 40.0], [180.0, -130.0], [0.0, 155.0], [0.0, 10.0], [30.0, 0.0]] {
        let folder = tempfile::tempdir().expect("a folder");
        let truth = folder.path().join("reference.csv");
        reference(&truth, &recorded, 0);
        let files = programs::mounted::at_an_angle(&recorded, folder.path(), angles);
        let sigma = run(&files, &truth).unwrap_or_else(|e| panic!("{e}"));
        assert!(sigma < SIGMA, "{angles:?}: {sigma}");
    }
}

#[test]
fn a_velocity_log_along_north_and_east_under_other_names_is_refused() {
    let recorded = record();
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: String| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("the test can write");
        path
    };
    let mut imu = "time,gx,gy,gz,ax,ay,az\n".to_owned();
    for (nanos, v) in &recorded["imu"] {
        let cells: Vec<String> = v.iter().map(|v| format!("{v:.7}")).collect();
        let _ = writeln!(imu, "{:.3},{}", *nanos as f64 * 1e-9, cells.join(","));
    }
    let imu = write("imu.csv", imu);
    // east, north, up, and north, east, down
    for (order, up, words) in
        [([4, 3, 5], -1.0, "east and north"), ([3, 4, 5], 1.0, "north and east")]
    {
        let mut log = "time,vx,vy,vz\n".to_owned();
        for (nanos, v) in &recorded["gnss"] {
            // as slow as a vehicle under water
            let [x, y, z] = order.map(|k| 0.1 * v[k]);
            let _ = writeln!(log, "{:.3},{x:.3},{y:.3},{:.3}", *nanos as f64 * 1e-9, up * z);
        }
        let files = [imu.clone(), write("log.csv", log)];
        let error = run(&files, &folder.path().join("reference.csv")).expect_err("it is refused");
        assert!(error.contains(&format!("they are along {words}")), "{error}");
    }
}

/// Nothing holds the track: without this the run is consistent, hundreds of kilometres from the truth.
#[test]
fn an_imu_that_moves_without_any_position_or_velocity_is_refused() {
    let recorded = record();
    let folder = tempfile::tempdir().expect("a folder");
    let imu = programs::mounted::inertial_alone(&recorded, folder.path());
    let error = import(&imu, None).expect_err("nothing aids it");
    assert!(error.contains("no file measures a position or a velocity"), "{error}");
}

/// The car reverses for 10 s before it drives ahead.
const REVERSING: &str = r#"
  { type = "static", duration = "2 s" },
  { type = "surge", duration = "4 s", speed = "-3.5 m/s" },
  { type = "cruise", duration = "6 s" },
  { type = "surge", duration = "4 s", speed = "0 m/s" },
"#;

#[test]
fn a_car_that_reverses_at_the_start_has_its_heading_by_positions_alone() {
    let (before, after) = CAR.split_once("  { type = \"static\"").expect("the first segment");
    let rest = after.split_once('\n').expect("the other segments").1;
    let recorded = simulated(&format!("{before}{REVERSING}{rest}"));
    let folder = tempfile::tempdir().expect("a folder");
    let truth = folder.path().join("reference.csv");
    reference(&truth, &recorded, 0);
    let files = programs::mounted::positions_alone(&recorded, folder.path());
    let sigma = run(&files, &truth).unwrap_or_else(|e| panic!("{e}"));
    assert!(sigma < SIGMA, "{sigma}");
}

/// The latitude of the recording with the longitude of New York: both may be latitudes.
#[test]
fn a_longitude_that_may_be_a_latitude_is_found_before_it_without_headings() {
    let mut recorded = record();
    let west = (-74_f64 - 11.5).to_radians();
    recorded.get_mut("gnss").expect("fixes").iter_mut().for_each(|(_, v)| v[1] += west);
    let folder = tempfile::tempdir().expect("a folder");
    let files = programs::mounted::longitudes_first(&recorded, folder.path());
    let scenario = import(&files, None).unwrap_or_else(|e| panic!("{e}"));
    assert!(scenario.contains("headings = [\"time\", \"lon\", \"lat\", \"height\"]"), "{scenario}");
}

#[test]
fn metres_from_a_point_need_this_point_and_run_with_it() {
    let recorded = record();
    let folder = tempfile::tempdir().expect("a folder");
    let truth = folder.path().join("reference.csv");
    reference(&truth, &recorded, 0);
    for vertical in [("up [m]", 1.0), ("Down (m)", -1.0)] {
        let point = [48.1, 11.5, 500.0];
        let files = programs::mounted::from_a_point(&recorded, folder.path(), point, vertical);
        let refused = run(&files, &truth).expect_err("no file has the point");
        assert!(refused.contains("metres east and north of a point"), "{refused}");
        let scenario = import(&files, Some(point)).unwrap_or_else(|e| panic!("{e}"));
        assert!(scenario.contains("columns.height"), "{scenario}");
        let sigma = run_beside(&scenario, &truth).unwrap_or_else(|e| panic!("{e}"));
        assert!(sigma < SIGMA, "{vertical:?}: {sigma}");
    }
}
