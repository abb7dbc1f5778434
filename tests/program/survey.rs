//! Faults of the aids of a survey under water, each for 300 s: the table of docs/src/how-to/survey.md.

use crate::common::{command, parallel, run_without_sinks, scenario};
use navfuse_core::model::record::finding::Severity;
use navfuse_core::model::record::verdict::VerdictLevel;
use navfuse_core::session::Finished;
use navfuse_core::session::summary::Summary;

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

/// The largest error of the position at the end, in its sigma.
fn worst(summary: &Summary) -> f64 {
    let position = summary.rows.iter().find(|row| row.name == "ins.position");
    let position = position.expect("the row of the position");
    let errors = position.error.as_ref().expect("there is a reference").iter();
    errors.zip(&position.error_sigma).map(|(e, s)| (e / s).abs()).fold(0.0, f64::max)
}

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
        let worst = worst(summary);
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

/// A first sample that is off by less than the prior allows passes any gate. Those after it take it back: the position
/// is right, in a smoothed run too, and the sensor is named.
#[test]
fn a_wrong_first_sample_is_taken_back_and_named() {
    let firsts = [
        ("usbl", "from='3 s', size='6 m', channels=['offset_x']"),
        ("beacon-north", "size='4 m', channels=['range']"),
        ("pressure", "from='0.55 s', size='150 mbar', channels=['pressure']"),
    ];
    let jobs: Vec<_> = firsts.iter().flat_map(|first| [false, true].map(|s| (*first, s))).collect();
    let failed = parallel(&jobs, |((sensor, fault), smooth)| {
        let settings = [
            "sensor.imu.simulation.rate=20 Hz".to_owned(),
            "estimator.stop=60 s".to_owned(),
            format!("estimator.smooth={smooth}"),
            format!("sensor.{sensor}.simulation.faults=[{{type='spike', {fault}}}]"),
        ];
        let Finished { summary, findings, .. } = run_without_sinks(&scenario("survey"), &settings);
        let (verdict, worst) = (&summary.verdict, worst(&summary));
        let named = verdict.reasons.iter().all(|reason| reason.about == *sensor);
        let good = findings.len() == 1 && named && worst < 4.0;
        let good = good && verdict.level == VerdictLevel::Doubtful;
        (!good).then(|| format!("{sensor} {smooth}: {verdict:#?}, {worst:.1} sigma"))
    });
    let failed: Vec<String> = failed.into_iter().flatten().collect();
    assert!(failed.is_empty(), "{failed:#?}");
}
