//! Threads and shards do not change the written files.

use crate::campaign::{SHORT, output, path};
use crate::common::scenario;
use navfuse_core::document::Document;
use navfuse_core::plugin::Shared;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use std::collections::BTreeMap;
use std::path::Path;

/// Reads the files of a folder, by name.
///
/// `campaign.rrd` is left out: the viewer's library gives every recording a random id, so that even
/// the same command never writes the same bytes twice. Its figures are those of the SVG files. The
/// list of own files has their times.
pub fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries =
        std::fs::read_dir(folder).expect("the folder is there").map(|e| e.expect("a file").path());
    let named = entries
        .map(|p| (p.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned()), p));
    named
        .filter(|(name, _)| ![".navfuse", "campaign.rrd"].contains(&name.as_str()))
        .map(|(n, p)| (n, std::fs::read(p).expect("a file")))
        .collect()
}

/// Checks that a campaign writes the same files with the same bytes on one thread, on two threads,
/// and in shards.
fn is_the_same(campaign: &[&str], counts: &[usize], names: &[&str]) {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).display().to_string();
    let whole = at("whole");
    output(&[campaign, &["--jobs", "1", "--out", &whole]].concat());
    let expected = files(Path::new(&whole));
    assert_eq!(expected.keys().map(String::as_str).collect::<Vec<_>>(), names);
    let agrees = |other: &str| {
        let found = files(Path::new(other));
        assert_eq!(
            found.keys().collect::<Vec<_>>(),
            expected.keys().collect::<Vec<_>>(),
            "{other}"
        );
        for (name, bytes) in &expected {
            assert!(found[name] == *bytes, "{other}/{name} differs");
        }
        // the recordings differ in their ids, a thousandth of their length
        let length = |folder: &str| {
            std::fs::metadata(Path::new(folder).join("campaign.rrd")).map_or(0, |m| m.len())
        };
        assert!(
            length(other).abs_diff(length(&whole)) * 100 <= length(&whole),
            "{other}/campaign.rrd differs"
        );
    };
    let two = at("two threads");
    output(&[campaign, &["--jobs", "2", "--out", &two]].concat());
    agrees(&two);
    for count in counts {
        let mut parts = Vec::new();
        for index in 1..=*count {
            parts.push(at(&format!("{index} of {count}")));
            output(
                &[campaign, &["--shard", &format!("{index}/{count}"), "--out", &parts[index - 1]]]
                    .concat(),
            );
        }
        // in any order
        parts.rotate_left(1);
        let merged = at(&format!("{count} merged"));
        let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
        output(&[&["merge"], &parts[..], &["--out", &merged]].concat());
        agrees(&merged);
    }
}

#[test]
fn a_campaign_is_the_same_to_the_byte_on_two_threads_and_in_seven_shards() {
    let names = [
        "bounds.parquet",
        "campaign.html",
        "campaign.json",
        "consistency.svg",
        "epochs.parquet",
        "report.json",
        "runs.parquet",
        "states.svg",
    ];
    // the bound and five runs: one of the seven shards is empty
    let quickstart = path("quickstart");
    let campaign =
        [&["monte-carlo", &quickstart, "--runs", "5", "--seed", "3"], &SHORT[..]].concat();
    is_the_same(&campaign, &[1, 7], &names);
}

#[test]
fn a_sweep_with_runs_is_the_same_in_shards_that_cut_through_its_points() {
    let names = [
        "bounds.parquet",
        "campaign.html",
        "campaign.json",
        "epochs.parquet",
        "report.json",
        "runs.parquet",
        "sweep.csv",
        "sweep.parquet",
        "sweep.svg",
    ];
    // two points of four jobs: three shards of 2, 3 and 3
    let vary = [
        "--vary",
        "sensor.dvl.noise=1 cm/s,3 cm/s",
        "--runs",
        "3",
        "--set",
        "estimator.stop=620 s",
    ];
    is_the_same(&[&["sweep", &path("pan-wu-3d")], &vary[..]].concat(), &[3], &names);
}

#[test]
fn a_bound_is_the_same_in_shards_and_writes_no_tables_of_runs() {
    let names = ["bound.svg", "bounds.parquet", "campaign.html", "campaign.json", "report.json"];
    is_the_same(&[&["bound", &path("quickstart")], &SHORT[..]].concat(), &[2], &names);
}

#[test]
fn another_seed_gives_other_runs_and_the_same_bound() {
    // the seed determines the lost samples, which would change the bound
    let all = ["--set", "sensor.dvl.simulation={rate = \"5 Hz\"}"];
    let folder = tempfile::tempdir().expect("a folder");
    let run = |seed: &str| {
        let out = folder.path().join(seed);
        let (quickstart, out_text) = (path("quickstart"), out.display().to_string());
        let campaign =
            ["monte-carlo", &quickstart, "--runs", "1", "--seed", seed, "--out", &out_text];
        output(&[&campaign, &SHORT[..], &all].concat());
        files(&out)
    };
    let (a, b) = (run("1"), run("2"));
    assert!(a["runs.parquet"] != b["runs.parquet"]);
    assert!(a["bounds.parquet"] == b["bounds.parquet"]);
}

/// First samples of each simulated sensor.
fn samples(scenario: Scenario<'_>) -> Vec<Sample> {
    let mut samples = Vec::new();
    for (_, mut source) in scenario.assemble(None).expect("the scenario composes").sources {
        let mut sample = Sample::empty(Time::MIN, SensorId(0));
        for _ in 0..5000 {
            if !source.next(&mut sample).expect("a simulation does not fail") {
                break;
            }
            samples.push(sample);
        }
    }
    samples
}

/// The sensors of `auv` lose samples, have outages, and lag by offsets that each run draws.
#[test]
fn runs_that_share_the_error_free_readings_have_the_samples_of_runs_that_do_not() {
    let registry = navfuse::standard_plugins();
    let document = Document::from_file(scenario("auv")).expect("the scenario is there");
    let shared = Shared::default();
    for seed in [1, 1, 2, 3] {
        let settings = [format!("seed={seed}"), "estimator.draw=all".to_owned()];
        let run = || Scenario::new(&registry, document.clone(), &settings).expect("it is TOML");
        let alone = samples(run());
        assert!(alone.len() > 20_000, "{}", alone.len());
        assert_eq!(samples(run().sharing(&shared)), alone, "seed {seed}");
    }
}
