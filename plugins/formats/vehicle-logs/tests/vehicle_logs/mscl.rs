//! The reader of MIP equals MSCL, the library of MicroStrain.
//!
//! The test installs `pymscl` from PyPI into the target folder, or uses the interpreter that
//! NAVFUSE_MSCL_PYTHON names. Without Python or PyPI it is skipped.

use crate::generate::units::mip;
use crate::read;
use navfuse_testing::python::Packages;
use navfuse_vehicle_logs::Format;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// The names of MSCL, with the record and the field here.
const NAMES: [(&str, &str, &str); 25] = [
    ("scaledGyroX", "MIP-IMU", "gyro_x"),
    ("scaledGyroY", "MIP-IMU", "gyro_y"),
    ("scaledGyroZ", "MIP-IMU", "gyro_z"),
    ("scaledAccelX", "MIP-IMU", "accel_x"),
    ("scaledAccelY", "MIP-IMU", "accel_y"),
    ("scaledAccelZ", "MIP-IMU", "accel_z"),
    ("gnss1_latitude", "MIP-GNSS", "lat"),
    ("gnss1_longitude", "MIP-GNSS", "lon"),
    ("gnss1_heightAboveElipsoid", "MIP-GNSS", "height"),
    ("gnss1_horizontalAccuracy", "MIP-GNSS", "h_acc"),
    ("gnss1_verticalAccuracy", "MIP-GNSS", "v_acc"),
    ("gnss1_northVelocity", "MIP-GNSS", "vel_n"),
    ("gnss1_eastVelocity", "MIP-GNSS", "vel_e"),
    ("gnss1_downVelocity", "MIP-GNSS", "vel_d"),
    ("gnss1_speedAccuracy", "MIP-GNSS", "s_acc"),
    ("gnss1_gnssFixType", "MIP-GNSS", "type"),
    ("estLatitude", "MIP-FILTER", "lat"),
    ("estLongitude", "MIP-FILTER", "lon"),
    ("estHeightAboveElipsoid", "MIP-FILTER", "height"),
    ("estNorthVelocity", "MIP-FILTER", "vel_n"),
    ("estEastVelocity", "MIP-FILTER", "vel_e"),
    ("estDownVelocity", "MIP-FILTER", "vel_d"),
    ("estRoll", "MIP-FILTER", "roll"),
    ("estPitch", "MIP-FILTER", "pitch"),
    ("estYaw", "MIP-FILTER", "yaw"),
];

#[test]
fn mip_equals_mscl() {
    let packages = Packages {
        names: "pymscl",
        folder: Path::new(env!("CARGO_TARGET_TMPDIR")).join("mscl"),
        variable: Some("NAVFUSE_MSCL_PYTHON"),
        check: "import mscl",
        install: &[&["pymscl==68.4.5"]],
    };
    let Some(python) = packages.python() else { return };
    let log = mip(3, false);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("log.mip");
    std::fs::write(&file, &log).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/vehicle_logs/read_mip.py");
    let output = Command::new(python).arg(script).arg(&file).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut theirs: BTreeMap<String, Vec<u64>> = BTreeMap::new();
    for line in String::from_utf8(output.stdout).unwrap().lines() {
        let (name, value) = line.split_once(' ').unwrap();
        let value: f64 = value.parse().unwrap();
        theirs.entry(name.to_owned()).or_default().push(value.to_bits());
    }
    let (rows, topics, _) = read(Format::Mip, &log);
    for (name, record, field) in NAMES {
        let ours = rows.iter().filter_map(|(row, values)| {
            let topic = &topics[row.topic];
            let k =
                topic.fields.iter().position(|f| f == field).filter(|_| topic.name == record)?;
            Some(values[k]).filter(|value| !value.is_nan()).map(f64::to_bits)
        });
        let ours: Vec<u64> = ours.collect();
        assert!(!ours.is_empty(), "{name}");
        assert_eq!(theirs.get(name), Some(&ours), "{name}");
    }
}
