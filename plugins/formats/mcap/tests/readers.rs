//! Two independent readers of ROS 2 logs read every value of every message of a log.
//!
//! The test installs the readers from the Python package index into a virtual environment under the
//! target folder. Without Python or the index, the test is skipped.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test may stop")]

mod common;

use common::{fixture, read};
use navfuse_core::model::stream::Sink;
use navfuse_core::units::time::Time;
use navfuse_mcap::Compression;
use navfuse_testing::python::{Packages, output};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::Command;

const READERS: [&str; 2] = ["mcap-ros2-support==0.6.0", "rosbags==0.11.9"];

/// Returns a Python with the readers; without one, the test is skipped.
fn python() -> Option<PathBuf> {
    Packages {
        names: "mcap-ros2-support and rosbags",
        folder: Path::new(env!("CARGO_TARGET_TMPDIR")).join("readers"),
        variable: None,
        check: "import importlib.metadata as m\n\
                found = [m.version(p) for p in ('mcap-ros2-support', 'rosbags')]\n\
                assert found == ['0.6.0', '0.11.9'], found",
        install: &[&READERS[..]],
    }
    .python()
}

#[test]
fn independent_readers_read_every_value() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().unwrap();
    for (first, compression) in
        [(-450_000_001, Compression::Zstd), (0, Compression::Lz4), (5, Compression::None)]
    {
        let log = folder.path().join("run.mcap");
        let mut sink = fixture::create(&log, compression);
        fixture::run(&mut sink, Time::from_nanos(first), 600);
        sink.finish().unwrap();
        let messages: Vec<Value> = (read(&log).iter())
            .map(|m| {
                let (topic, schema) = (&m.topic, &m.schema);
                json!({
                    "topic": topic, "schema": schema, "log_time": m.log_time, "fields": m.fields
                })
            })
            .collect();
        let expected = folder.path().join("expected.json");
        std::fs::write(&expected, serde_json::to_string(&messages).unwrap()).unwrap();
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/readers.py");
        let told = output(Command::new(&python).arg(script).arg(&log).arg(&expected))
            .unwrap_or_else(|e| panic!("{e}"));
        println!("{compression:?}\n{told}");
        let all = format!("{} messages on ", messages.len());
        assert_eq!(told.matches(&all).count(), READERS.len(), "{told}");
    }
}
