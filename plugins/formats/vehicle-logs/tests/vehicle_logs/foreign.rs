//! The readers equal pyulog and pymavlink, readers written by others.
//!
//! The tests install both from PyPI into the target folder, or use the interpreter that
//! NAVFUSE_VEHICLE_LOGS_PYTHON names. Without Python or PyPI they are skipped.

use crate::generate::{dataflash, flight, telemetry};
use crate::read;
use navfuse_testing::python::vehicle_logs;
use navfuse_vehicle_logs::Format;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// All values of each field, by message, instance and field.
type Columns = BTreeMap<(String, u32, String), Vec<f64>>;

/// The columns of a log as another reader has them.
fn theirs(kind: &str, log: &[u8]) -> Option<Columns> {
    let python = vehicle_logs(env!("CARGO_TARGET_TMPDIR")).python()?;
    let folder = tempfile::tempdir().unwrap();
    // pymavlink reads a file as a telemetry log by its name
    let name = if kind == "dataflash" { "log.bin" } else { "log.tlog" };
    let file = folder.path().join(name);
    std::fs::write(&file, log).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/vehicle_logs/foreign.py");
    let output = Command::new(python).arg(script).arg(kind).arg(&file).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let mut columns = Columns::new();
    for line in text.lines() {
        let cells: Vec<&str> = line.split(' ').collect();
        let key = (cells[0].to_owned(), cells[1].parse().unwrap(), cells[2].to_owned());
        columns.insert(key, cells[3..].iter().map(|v| v.parse().unwrap()).collect());
    }
    Some(columns)
}

/// The columns of a log as this crate has them.
fn ours(format: Format, log: &[u8]) -> Columns {
    let mut columns = Columns::new();
    let (rows, topics, damage) = read(format, log);
    assert_eq!(damage.describe("message"), None);
    for (record, values) in rows {
        let topic = &topics[record.topic];
        for (field, value) in topic.fields.iter().zip(values) {
            let key = (topic.name.clone(), topic.instance, field.clone());
            columns.entry(key).or_default().push(value);
        }
    }
    columns
}

fn equal(ours: &Columns, theirs: &Columns) {
    assert_eq!(ours.keys().collect::<Vec<_>>(), theirs.keys().collect::<Vec<_>>());
    for (key, a) in ours {
        // to the bit, and nan for nan
        let bits = |v: &[f64]| {
            v.iter().map(|x| if x.is_nan() { 0 } else { x.to_bits() }).collect::<Vec<_>>()
        };
        assert_eq!(bits(a), bits(&theirs[key]), "{key:?}");
    }
}

#[test]
fn ulog_equals_pyulog() {
    let log = flight(4);
    let Some(mut theirs) = theirs("ulog", &log) else { return };
    let dropouts = theirs.remove(&("dropouts".to_owned(), 0, "duration".to_owned()));
    assert_eq!(dropouts, Some(vec![150.0]));
    let ours = ours(Format::Ulog, &log);
    // two instances and an array of nested messages
    assert!(ours.contains_key(&("sensor_gps".to_owned(), 1, "latitude_deg".to_owned())));
    assert!(ours.contains_key(&("esc_status".to_owned(), 0, "esc[1].state".to_owned())));
    equal(&ours, &theirs);
}

#[test]
fn dataflash_equals_pymavlink() {
    let log = dataflash(2);
    let Some(theirs) = theirs("dataflash", &log) else { return };
    equal(&ours(Format::Dataflash, &log), &theirs);
}

#[test]
fn a_telemetry_log_equals_pymavlink() {
    let log = telemetry(50);
    let Some(theirs) = theirs("tlog", &log) else { return };
    equal(&ours(Format::Tlog, &log), &theirs);
}
