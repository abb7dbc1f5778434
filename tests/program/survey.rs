//! Faults of the aids of a survey under water, each for 300 s: the table of docs/src/how-to/survey.md.

use crate::common::{command, parallel, run_without_sinks, scenario};
use navfuse_core::model::record::finding::Severity;
use navfuse_core::model::record::verdict::VerdictLevel;

/// The sensor, its fault, and the sensor that the verdict names.
const FAULTS: [(&str, &str, &str); 8] = [
    ("magnetometer", "type='bias', size='5 uT', channels=['mag_x']", "magnetometer"),
    ("usbl", "type='bias', size='40 m', channels=['offset_x']", "usbl"),
    ("beacon-north", "type='bias', size='15 m', channels=['range']", "beacon-north"),
    // echoes of twice the way double the noise too, which does not explain their jump
    ("altimeter", "type='scale', size='2', channels=['range']", "altimeter"),
    ("pressure", "type='bias', size='100 mbar', channels=['pressure']", "pressure"),
    ("pressure", "type='frozen'", "pressure"),
    ("dvl", "type='bias', size='30 cm/s', channels=['vel_x']", "dvl"),
    // the gyro compass of the ship turns the fixes of its USBL
    ("ship-navigation", "type='bias', size='5 deg', channels=['heading']", "usbl"),
];

/// The position is right to 4 sigma: of 24 independent errors, none is beyond by chance but once in 600
/// such tables. No reason about another sensor weighs as much as the one about the faulty one.
#[test]
fn a_fault_of_each_aid_is_contained_and_named() {
    let failed = parallel(&FAULTS, |(sensor, fault, named)| {
        let settings = [
            "sensor.imu.simulation.rate=20 Hz".to_owned(),
            format!("sensor.{sensor}.simulation.faults=[{{from='1100 s', to='1400 s', {fault}}}]"),
        ];
        let finished = run_without_sinks(&scenario("survey"), &settings);
        let summary = &finished.summary;
        let verdict = &summary.verdict;
        let position = summary.rows.iter().find(|row| row.name == "ins.position");
        let position = position.expect("the row of the position");
        let errors = position.error.as_ref().expect("there is a reference").iter();
        let worst = errors.zip(&position.error_sigma).map(|(e, s)| (e / s).abs());
        let worst = worst.fold(0.0, f64::max);
        let first = verdict.reasons.iter().find(|reason| reason.severity >= Severity::Contained);
        let first = first.map(|reason| reason.about.clone()).unwrap_or_default();
        println!("{sensor} {fault}: {first}, {worst:.1} sigma, {:?}", verdict.level);
        let good = verdict.level == VerdictLevel::Doubtful && first == named && worst < 4.0;
        (!good).then(|| format!("{sensor} {fault}: {verdict:#?}, {worst:.1} sigma"))
    });
    let failed: Vec<String> = failed.into_iter().flatten().collect();
    assert!(failed.is_empty(), "{failed:#?}");
}

/// The survey has two driving sensors: the IMU and the navigation of the ship.
#[test]
fn the_log_has_each_part_of_a_simulated_trajectory_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let page = folder.path().join("survey.html");
    let mut report = command();
    report.arg("report").arg(scenario("survey")).arg("--out").arg(&page);
    report.args(["--set", "estimator.stop=100 s", "--set", "sensor.imu.simulation.rate=20 Hz"]);
    assert!(report.output().is_ok_and(|output| output.status.success()));
    let page = std::fs::read_to_string(page).expect("the page");
    for part in ["surge from 60 s to 80 s", "square leg 1 from 80 s to 280 s"] {
        assert_eq!(page.matches(part).count(), 1, "{part}");
    }
}
