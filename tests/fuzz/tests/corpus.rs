//! The corpus of the fuzz targets, without a fuzzer: no file of it makes a reader panic, the good
//! ones are understood, and so are cuts and flipped bits.
//!
//! `UPDATE=1 cargo test --workspace --test corpus` writes the files that have a generator anew.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(dead_code, reason = "the generators have more than the corpus needs")]

#[path = "../../../plugins/formats/dvl-files/tests/dvl_files/generate.rs"]
mod dvl;
#[path = "../../../plugins/formats/ros2/tests/ros2/recorder.rs"]
mod recorder;
#[path = "../../../plugins/formats/vehicle-logs/tests/vehicle_logs/generate.rs"]
mod vehicle;

use navfuse_core::document::Document;
use navfuse_core::run::runner;
use navfuse_core::run::scenario::Scenario;
use navfuse_fuzzing::{TARGETS, corpus};
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Files of the corpus that are generated: target, name, bytes.
fn generated() -> Vec<(&'static str, &'static str, Vec<u8>)> {
    let mut files = Vec::new();
    for format in navfuse_dvl_files::Format::ALL {
        files.push((format.name(), "good-two.bin", dvl::records(format.name(), 2).concat()));
    }
    for (name, log) in vehicle::logs() {
        // the definitions of a ULog, and some messages
        let size = if name == "ulog" { 2600 } else { 900 };
        // NovAtel has a form in text and a binary one
        let binary = name == "novatel" && log[0] == 0xaa;
        let file = if binary { "good-binary.bin" } else { "good-begin.bin" };
        files.push((name, file, log[..log.len().min(size)].to_vec()));
    }
    let messages = recorder::usual(4);
    for (name, packing) in [
        ("good-plain.mcap", None),
        ("good-zstd.mcap", Some(mcap::Compression::Zstd)),
        ("good-lz4.mcap", Some(mcap::Compression::Lz4)),
    ] {
        files.push(("bag", name, recorder::mcap(&messages, packing, Some(600))));
    }
    files.push(("bag", "good.db3", recorder::sqlite(&messages)));
    let sentences = [
        "GPGGA,083000.00,3204.00000,N,03459.5000,W,4,12,0.7,10.5,M,18.25,M,,",
        "GPGST,083000.00,0.1,,,,0.03,0.04,0.06",
        "GPRMC,083000.00,A,3204.00000,N,03459.5000,W,3.6,90.0,010622,,,A",
        "HEHDT,350.00,T",
        "HCHDG,101.1,2.0,E,7.1,W",
        "PSXN,23,1.5,-2.5,351.0,0.1",
        "SDDPT,20.00,0.5",
        "PASHR,083000.50,350.1,T,1.0,-2.0,0.1,0.02,0.02,0.03,1,1",
        "GPZDA,083001.00,01,06,2022,00,00",
        "GPVTG,90.0,T,,M,3.6,N,6.7,K,A",
        "GPGGA,083001.00,3204.00100,N,03459.4980,W,4,12,0.7,10.5,M,18.25,M,,",
    ];
    let sentence = |content: &&str| {
        format!("${content}*{:02X}\r\n", content.bytes().fold(0, |sum, b| sum ^ b))
    };
    let text: String = sentences.iter().map(sentence).collect();
    for target in ["nmea", "nmea-sentences"] {
        files.push((target, "good-second.nmea", text.clone().into_bytes()));
    }
    files
}

/// Files of the corpus that a run or a campaign writes. They change with the filter.
fn recorded() -> Vec<(&'static str, &'static str, Vec<u8>)> {
    let folder = tempfile::tempdir().unwrap();
    let mut files = Vec::new();
    for (name, compression) in [("good-plain.mcap", "none"), ("good-zstd.mcap", "zstd")] {
        let mut registry = navfuse_fuzzing::registry();
        registry.add(&navfuse_mcap::McapPlugin);
        let text = format!("{DIVE}[sink.mcap]\ncompression = {compression:?}\n");
        let document = Document::parse("fuzz.toml", text).unwrap();
        let scenario = Scenario::new(&registry, document, &[]).unwrap();
        let output = folder.path().join(compression);
        std::fs::create_dir(&output).unwrap();
        let assembly = scenario.assemble(Some(&output)).unwrap_or_else(|e| panic!("{e}"));
        drop(runner::run(assembly, &AtomicBool::new(false), |_| ()));
        files.push(("mcap", name, std::fs::read(output.join("run.mcap")).unwrap()));
    }
    let output = folder.path().join("campaign");
    navfuse_fuzzing::write_campaign(&output);
    for (file, name) in [
        ("campaign.json", "good-definition.json"),
        ("runs.parquet", "table-of-runs.parquet"),
        ("bounds.parquet", "table-of-bounds.parquet"),
    ] {
        files.push(("campaign", name, std::fs::read(output.join(file)).unwrap()));
    }
    files
}

/// A run of a second.
const DIVE: &str = r#"
name = "dive"
[estimator]
start = "0.2 s"
[process.ins]
attitude = { sigma = "0.1 deg" }
velocity = { sigma = "1 cm/s" }
position = { sigma = "1 m" }
[sensor.imu]
gyro_noise = "0.1 deg/h/sqrt(Hz)"
accel_noise = "10 ug/sqrt(Hz)"
simulation = { rate = "5 Hz" }
[sensor.depth]
noise = "5 cm"
simulation = { rate = "5 Hz" }
[sensor.reference]
simulation = { rate = "5 Hz" }
[source.simulation.start]
latitude = "30 deg"
[[source.simulation.segments]]
type = "static"
duration = "1 s"
"#;

#[test]
fn the_generated_files_are_those_of_their_generators() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus");
    let update = std::env::var_os("UPDATE").is_some();
    if update {
        for (target, name, bytes) in generated().into_iter().chain(recorded()) {
            std::fs::create_dir_all(folder.join(target)).unwrap();
            std::fs::write(folder.join(target).join(name), &bytes).unwrap();
        }
    }
    for (target, name, bytes) in generated() {
        let path = folder.join(target).join(name);
        // packers may change; what they pack does not
        if !name.contains("zstd") && !name.contains("lz4") {
            assert!(std::fs::read(&path).unwrap() == bytes, "{}", path.display());
        }
    }
}

#[test]
fn every_file_of_the_corpus_is_read_without_a_panic() {
    for target in TARGETS {
        let mut understood = 0;
        for (path, bytes) in corpus(target.name) {
            let found = (target.read)(&bytes);
            let good = path.file_stem().unwrap().to_string_lossy().starts_with("good");
            assert_eq!(found > 0, good, "{}: {found}", path.display());
            understood += usize::from(good);
            // cuts and flipped bits over the whole file, as a fuzzer would begin
            let steps = bytes.len().div_ceil(if target.weight > 2 { 64 } else { 8 }).max(1);
            for at in (0..bytes.len()).step_by(steps) {
                (target.read)(&bytes[..at]);
                let mut flipped = bytes.clone();
                flipped[at] ^= 1 << (at % 8);
                (target.read)(&flipped);
            }
        }
        assert!(understood > 0, "{}: no file of the corpus is understood", target.name);
    }
}

/// The formats that a stranger may write, the fuzz targets and their corpus are the same everywhere.
#[test]
fn the_table_of_formats_the_targets_and_the_corpus_agree() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut known: Vec<String> = TARGETS.iter().map(|t| t.name.to_owned()).collect();
    known.sort();
    let text = std::fs::read_to_string(root.join("SECURITY.md")).unwrap();
    let rows = text.lines().filter(|l| l.starts_with("| ")).skip(1);
    let column = rows.filter_map(|row| row.split('|').nth(2));
    let mut listed: Vec<String> =
        column.flat_map(|cell| cell.split(',')).map(|t| t.trim().replace('`', "")).collect();
    listed.sort();
    assert_eq!(listed, known);
    for folder in ["fuzz/fuzz_targets", "fuzz/corpus"] {
        let entries =
            std::fs::read_dir(root.join(folder)).unwrap().map(|entry| entry.unwrap().path());
        let mut names: Vec<String> =
            entries.map(|path| path.file_stem().unwrap().to_string_lossy().into_owned()).collect();
        names.sort();
        assert_eq!(names, known, "{folder}");
    }
}
