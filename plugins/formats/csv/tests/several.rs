//! A recording in several files, an instrument at an angle, and a column that is added to another.
#![allow(clippy::unwrap_used)] // a failed test may panic

mod common;

use common::{
    DEPTH, DVL, DVL_HEADER, IMU, IMU_HEADER, Read, assemble, drain, folder, read_aid, read_dvl,
};

/// Reads a DVL whose first file is `dvl.csv` and whose second one has these rows.
fn read_two(second: &str, keys: &str) -> Result<Read, String> {
    let first = format!("{DVL_HEADER}0,1,2,3\n1,2,4,6\n2,3,6,9\n");
    let second = format!("{DVL_HEADER}{second}");
    let files = [("dvl.csv", first.as_str()), ("two.csv", &second), ("imu.csv", IMU_HEADER)];
    let folder = folder(&files);
    let source = format!("[source.csv.files.dvl]\nthen = [\"two.csv\"]\n{keys}\n");
    let mut assembly = assemble(folder.path(), &[IMU, DVL].concat(), &source, false)?;
    Ok(drain(folder.path(), assembly.sources[1].1.as_mut()))
}

#[test]
fn files_that_follow_one_another_are_one_recording() {
    let read = read_two("3,4,8,12\n4,5,10,15\n", "").unwrap();
    assert_eq!(read.nanos(), [0, 1, 2, 3, 4].map(|s| s * 1_000_000_000));
    assert_eq!(read.values(4), [5.0, 10.0, 15.0].map(Some));
    assert_eq!((read.error, read.warning), (None, None));
    assert_eq!(read.end.unwrap().seconds(), 4.0);
    // the row that a program wrote into both files is used once
    let read = read_two("2,3,6,9\n3,4,8,12\n", "").unwrap();
    assert_eq!((read.nanos().len(), read.error), (4, None));
    assert!(read.warning.unwrap().contains("1 rows at the begins of files"));
}

#[test]
fn a_file_of_the_same_time_is_another_device() {
    let read = read_two("0.5,4,8,12\n4,5,10,15\n", "").unwrap();
    let error = read.error.unwrap();
    assert!(
        error.contains("two.csv: it begins at 0.500 s, before dvl.csv ends at 2.000 s"),
        "{error}"
    );
}

#[test]
fn a_rotation_turns_the_vectors_and_a_part_of_one_is_none() {
    let file = format!("{DVL_HEADER}0,1,2,3\n1,,2,3\n");
    let read = read_dvl(file, "rotation = [\"0 deg\", \"0 deg\", \"90 deg\"]").unwrap();
    assert_eq!(read.samples.len(), 1);
    // forward of the instrument is right of the vehicle: x -> y, y -> -x
    for (value, expected) in read.values(0).into_iter().zip([-2.0, 1.0, 3.0]) {
        assert!((value.unwrap() - expected).abs() < 1e-15);
    }
}

#[test]
fn a_column_is_added_to_another_in_the_same_unit() {
    let file = "time_s,below,height\n0,1200,34\n1,1300,\n";
    let keys = "columns.depth = { column = \"below\", unit = \"cm\", plus = \"height\" }\n\
                nan = \"missing\"";
    let read = read_aid("depth", DEPTH, file, keys).unwrap();
    assert_eq!((read.samples.len(), read.values(0)), (1, vec![Some(12.34)]));
    let error = read_aid("depth", DEPTH, file, &keys.replace("height", "geoid")).unwrap_err();
    assert!(error.contains("no column \"geoid\""), "{error}");
}
