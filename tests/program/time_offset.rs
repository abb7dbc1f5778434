//! A DVL that lags: the accuracy of the estimated lag, and its consistency.

use crate::common::{run_without_sinks, scenario, snapir};
use navfuse_campaign::{Campaign, Extent, Folder, Options, execute};
use navfuse_core::document::Document;
use navfuse_core::model::record::verdict::Reason;
use navfuse_core::session::summary::Summary;
use std::fmt::Write as _;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Returns estimate and sigma of the DVL's time offset, s.
fn offset(summary: &Summary) -> (f64, f64) {
    let row = summary.rows.iter().find(|r| r.name == "dvl.time_offset").expect("it is a state");
    (row.estimate[0], row.sigma[0])
}

/// Twenty filters, each with its own priors and noise. The final sigma is 5 ms, so that 20 ms are 4
/// sigma.
#[test]
fn a_lag_of_300_ms_is_found_to_20_ms_and_consistently() {
    let registry = navfuse::standard_plugins();
    let document = Document::from_file(scenario("time-offset")).expect("the scenario is there");
    let options = Options { runs: 20, ..Options::default() };
    let plan = Campaign::new(&registry, &document, &options).unwrap_or_else(|e| panic!("{e}"));
    let mut folder = Folder::create(None, &plan, None).unwrap_or_else(|e| panic!("{e}"));
    let mut last = Vec::new();
    let at = plan
        .columns
        .components
        .iter()
        .position(|c| c.name() == "dvl.time_offset.offset")
        .expect("it is a state");
    let stop = AtomicBool::new(false);
    let keep = |record| {
        if let navfuse_campaign::Record::Run(run) = &record {
            let row = run.rows.last().expect("the run has epochs");
            last.push((row.values[2 * at], row.values[2 * at + 1]));
        }
        folder.add(record)
    };
    let done = execute(
        &plan,
        &registry,
        &document,
        Extent { threads: 2, ..Extent::default() },
        &stop,
        |_| {},
        keep,
    )
    .unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(last.len(), 20);
    for (error, sigma) in &last {
        assert!(error.abs() < 0.02 && *sigma < 0.02, "{error} s, sigma {sigma} s");
    }
    let results = folder.finish(done).unwrap_or_else(|e| panic!("{e}")).expect("a whole campaign");
    let point = &results.report.points[0];
    let verdict = point.verdict.as_ref().expect("there are runs");
    assert!(verdict.consistent, "{}", verdict.text);
    for of in ["whole state", "dvl.time_offset"] {
        let anees = point.anees.iter().find(|a| a.of == of).expect("it is a block");
        let (value, band) =
            (anees.value.expect("runs went to their end"), anees.band.expect("a band"));
        println!("ANEES of {of}: {value:.2}, band {band:?}");
        assert!(band.low < value && value < band.high, "{of}: {value}, {band:?}");
    }
}

/// Copies a run's recording, with later time stamps of the DVL.
fn moved(run: &Path, by: f64, to: &Path) {
    std::fs::create_dir_all(to).expect("a folder");
    for name in ["imu.csv", "depth.csv", "reference.csv"] {
        std::fs::copy(run.join(name), to.join(name)).expect("the recording can be copied");
    }
    let text = std::fs::read_to_string(run.join("dvl.csv")).expect("there is a DVL");
    let mut lines = text.lines();
    let mut out = format!("{}\n", lines.next().expect("a heading"));
    for line in lines {
        let (time, rest) = line.split_once(',').expect("columns");
        let time: f64 = time.parse().expect("a time");
        let _ = writeln!(out, "{:.6},{rest}", time + by);
    }
    std::fs::write(to.join("dvl.csv"), out).expect("the test can write");
}

/// Four recorded dives with the DVL's time stamps 0.4 s late. The estimate from the unchanged
/// recording is the instrument's own lag, 5 to 35 ms. The runs consist mainly of turns: one sigma
/// is 2 to 6 ms, the bound 0.1 s.
#[test]
fn a_recorded_dvl_with_stamps_400_ms_late_is_found_to_lag() {
    let Some(data) = snapir() else { return };
    for name in ["T01", "T06", "T10", "T12"] {
        let run = data.join(name);
        let folder = tempfile::tempdir().expect("a folder");
        let found = [0.0, 0.4].map(|by| {
            let to = folder.path().join(format!("{by}"));
            moved(&run, by, &to);
            let directory = format!("source.csv.directory={}", to.display());
            let settings = [directory, "sensor.dvl.time_offset={ sigma = \"0.3 s\" }".to_owned()];
            let finished = run_without_sinks(&scenario("snapir"), &settings);
            assert!(finished.error.is_none(), "{name}: {:?}", finished.error);
            offset(&finished.summary)
        });
        println!("{name}: {found:.4?}");
        let [(own, _), (late, sigma)] = found;
        assert!((late - own - 0.4).abs() < 0.1 && sigma < 0.02, "{name}: {own} and {late} s");
        assert!(own.abs() < 0.1, "{name}: {own} s as recorded");
    }
}

/// Stamps of GPS time beside an IMU in UTC, with and without a state for small offsets: both runs name the
/// receiver first, with the size.
#[test]
fn leap_seconds_of_a_receiver_are_named_while_the_run_goes_on() {
    for offset in [None, Some(r#"sensor.gnss.time_offset={ sigma = "20 ms" }"#)] {
        let late = r#"sensor.gnss.simulation.faults=[{ type = "clock-offset", size = "18 s" }]"#;
        let healthy = ["sensor.imu.simulation.faults=[]", "sensor.gnss.simulation.outages=[]"];
        let settings = healthy.into_iter().chain([late]).chain(offset).map(str::to_owned);
        let settings: Vec<String> = settings.collect();
        let run = run_without_sinks(&scenario("faults/gnss-outage"), &settings);
        let first = run.summary.verdict.reasons.first();
        let named = |r: &Reason| r.about == "gnss" && r.text.contains("saw 18 s before them");
        assert!(first.is_some_and(named), "{offset:?}: {first:?}");
    }
}
