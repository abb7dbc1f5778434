//! Threads and shards change nothing in what is written.

use crate::{SHORT, path, told};
use std::collections::BTreeMap;
use std::path::Path;

/// The files of a folder by name.
///
/// Not `campaign.rrd`: the viewer's library gives every recording an id of its own, so that not even the same command
/// twice writes the same bytes. It is made of the figures that are in the SVG files.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries =
        std::fs::read_dir(folder).expect("the folder is there").map(|e| e.expect("a file").path());
    let named = entries
        .map(|p| (p.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned()), p));
    named
        .filter(|(name, _)| name != "campaign.rrd")
        .map(|(n, p)| (n, std::fs::read(p).expect("a file")))
        .collect()
}

/// A campaign on one and on two threads, and in so many shards, has those files and the same bytes in them.
fn is_the_same(campaign: &[&str], counts: &[usize], names: &[&str]) {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).display().to_string();
    let whole = at("whole");
    told(&[campaign, &["--jobs", "1", "--out", &whole]].concat());
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
        // the recordings differ in their ids, which take a thousandth of them
        let length = |folder: &str| {
            std::fs::metadata(Path::new(folder).join("campaign.rrd")).map_or(0, |m| m.len())
        };
        assert!(
            length(other).abs_diff(length(&whole)) * 100 <= length(&whole),
            "{other}/campaign.rrd differs"
        );
    };
    let two = at("two threads");
    told(&[campaign, &["--jobs", "2", "--out", &two]].concat());
    agrees(&two);
    for count in counts {
        let mut parts = Vec::new();
        for index in 1..=*count {
            parts.push(at(&format!("{index} of {count}")));
            told(
                &[campaign, &["--shard", &format!("{index}/{count}"), "--out", &parts[index - 1]]]
                    .concat(),
            );
        }
        // in any order
        parts.rotate_left(1);
        let merged = at(&format!("{count} merged"));
        let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
        told(&[&["merge"], &parts[..], &["--out", &merged]].concat());
        agrees(&merged);
    }
}

#[test]
fn a_campaign_is_the_same_to_the_byte_on_two_threads_and_in_seven_shards() {
    let names = [
        "bounds.parquet",
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
    let names = ["bound.svg", "bounds.parquet", "campaign.json", "report.json"];
    is_the_same(&[&["bound", &path("quickstart")], &SHORT[..]].concat(), &[2], &names);
}

#[test]
fn another_seed_gives_other_runs_and_the_same_bound() {
    // which samples are lost is a matter of the seed, and of the bound
    let all = ["--set", "sensor.dvl.simulation={rate = \"5 Hz\"}"];
    let folder = tempfile::tempdir().expect("a folder");
    let run = |seed: &str| {
        let out = folder.path().join(seed);
        let (quickstart, out_text) = (path("quickstart"), out.display().to_string());
        let campaign =
            ["monte-carlo", &quickstart, "--runs", "1", "--seed", seed, "--out", &out_text];
        told(&[&campaign, &SHORT[..], &all].concat());
        files(&out)
    };
    let (a, b) = (run("1"), run("2"));
    assert!(a["runs.parquet"] != b["runs.parquet"]);
    assert!(a["bounds.parquet"] == b["bounds.parquet"]);
}
