//! What a replay needs does not depend on the length of the log.

#![cfg(target_os = "linux")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may stop")]

mod common;

use common::{Draw, fixture};
use navfuse_core::model::record::Record;
use navfuse_core::model::stream::{Sink, Source};
use navfuse_core::units::sample::{Sample, SensorId};
use navfuse_core::units::time::Time;
use navfuse_mcap::{Compression, McapSource};
use std::collections::BTreeMap;

/// Memory of this process that is not a file's, bytes.
fn memory() -> i64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|l| l.strip_prefix("RssAnon:")).unwrap();
    line.trim().strip_suffix(" kB").unwrap().parse::<i64>().unwrap() * 1024
}

#[test]
fn writing_and_reading_take_as_much_memory_at_the_end_as_at_the_start() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let count = 400_000;
    let mut draw = Draw(1);
    let mut sink = fixture::create(&path, Compression::Zstd);
    let mut early = 0;
    for k in 0..count {
        let values: [f64; 6] = std::array::from_fn(|_| draw.number());
        sink.take(&Record::Sample(&Sample::new(
            Time::from_nanos(k * 10_000_000),
            SensorId(0),
            &values,
        )))
        .unwrap();
        if k == count / 10 {
            early = memory();
        }
    }
    let written = memory() - early;
    sink.finish().unwrap();
    let mut source = McapSource::open(&path, fixture::sensors(), BTreeMap::new()).unwrap();
    let mut sample = Sample::empty(Time::MIN, SensorId(0));
    let mut read = 0;
    while source.next(&mut sample).unwrap() {
        read += 1;
        if read == count / 10 {
            early = memory();
        }
    }
    assert_eq!(read, count);
    let replayed = memory() - early;
    // the log is 150 MB before and 32 MB after compression; one more buffer of a chunk of 1 MiB is
    // no growth
    let bound = 3 << 20;
    assert!(written < bound && replayed < bound, "grew by {written} and {replayed} bytes");
}
