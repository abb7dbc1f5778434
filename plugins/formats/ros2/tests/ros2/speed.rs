//! Speed and memory of the source on a long bag.

use crate::recorder::{Imu, mcap, usual};
use crate::registry;
use navfuse_core::document::Document;
use navfuse_core::run::scenario::Scenario;
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_testing::recording::INERTIAL;
use std::path::Path;

/// Processor time of this process, s, and its memory that is not a file's, bytes.
fn usage() -> Option<(f64, i64)> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    let fields: Vec<&str> = stat.rsplit_once(") ")?.1.split(' ').collect();
    // clock ticks of 10 ms in user and system mode
    let ticks: f64 = fields[11].parse::<f64>().ok()? + fields[12].parse::<f64>().ok()?;
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("RssAnon:"))?;
    Some((ticks / 100.0, line.trim().strip_suffix(" kB")?.parse::<i64>().ok()? * 1024))
}

/// Reads all samples; returns their number, and the growth of the memory after the first tenth.
fn read(folder: &Path, count: u64) -> (u64, f64, i64) {
    let name = folder.join("test.toml").display().to_string();
    let keys = "[source.ros2]\npath = \"bag.mcap\"\nsensors.imu = { topic = \"/imu\" }\n";
    let document = Document::parse(name, format!("{INERTIAL}{keys}")).unwrap();
    let registry = registry();
    let mut assembly = Scenario::new(&registry, document, &[]).unwrap().assemble(None).unwrap();
    let source = &mut assembly.sources[0].1;
    let (mut sample, mut samples, mut early) = (Sample::empty(Time::MIN, SensorId(0)), 0, 0);
    let start = usage().map_or(0.0, |(time, _)| time);
    while source.next(&mut sample).unwrap() {
        samples += 1;
        if samples == count / 10 {
            early = usage().map_or(0, |(_, memory)| memory);
        }
    }
    let (end, late) = usage().unwrap_or_default();
    (samples, end - start, late - early)
}

fn bag(folder: &Path, messages: &[Imu], packing: Option<mcap::Compression>) -> u64 {
    let bytes = mcap(messages, packing, Some(1 << 20));
    std::fs::write(folder.join("bag.mcap"), &bytes).unwrap();
    bytes.len() as u64
}

#[test]
fn a_bag_takes_as_much_memory_at_its_end_as_at_its_start() {
    let folder = tempfile::tempdir().unwrap();
    let count = 60_000;
    bag(folder.path(), &usual(count), Some(mcap::Compression::Zstd));
    let (samples, _, grown) = read(folder.path(), count as u64);
    assert_eq!(samples, count as u64);
    // the bag has 20 MB unpacked; one more chunk of 1 MiB, packed and unpacked, is no growth
    assert!(grown < 3 << 20, "{grown} bytes");
}

/// Prints the speed in bytes of messages per second of processor time:
/// `cargo test --release --workspace --test ros2 speed -- --ignored --nocapture`.
#[test]
#[ignore = "it measures"]
fn speed_of_reading() {
    let folder = tempfile::tempdir().unwrap();
    let count = 600_000;
    let messages = usual(count);
    for packing in [None, Some(mcap::Compression::Zstd), Some(mcap::Compression::Lz4)] {
        let size = bag(folder.path(), &messages, packing);
        let (samples, seconds, grown) = read(folder.path(), count as u64);
        let bytes = samples as f64 * crate::recorder::SIZE as f64;
        println!(
            "{packing:?}: {:.0} MB/s of {:.0} MB in a file of {:.0} MB, {:.2} us per message, \
             {grown} bytes more memory",
            bytes / seconds * 1e-6,
            bytes * 1e-6,
            size as f64 * 1e-6,
            seconds / samples as f64 * 1e6
        );
    }
}
